"""Ledger of the work in static steps with friction: where the work of loads and supports has gone.

    external = strain + dissipation + pressures + left

`external`: work of loads, supports and heat; `strain`: energy of bodies and springs; `dissipation`: energy that
friction has taken; `pressures`: work of the contact forces along normals, and of ties. All count from the undeformed
bodies on. Work is that of mean forces, du . (F + F') / 2, that of friction its traction at the end of each step times
the slip of that step. `left` is what these leave over: it falls with the size of steps, and has what materials with a
history keep.

Pressures of contact that stays closed do no work where the normals of both skins agree; at sharp edges they do. They
also do where macro-elements close or open within a step and where an interference is pressed apart, and what contact
with a stiffness stores is counted there.
"""

from __future__ import annotations

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.equilibrium.balance_of_energy import heat_of, strain
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.state import StepState, Work


class Ledger:
    """The work of steps one after the other. `of` gives one where it is kept: for static cases with friction."""

    def __init__(self, model: ReducedProblem, state: StepState) -> None:
        """Start from a state, or from the undeformed bodies."""
        self._now, start = state.work, state.iterate
        none: Floats = np.zeros(model.problem.space.n_dof)
        self._forces: tuple[Floats, Floats] = none, none
        if start is not None:
            self._forces = _forces(LoadStep(model, state.time, state), start.q, start.p)[:2]

    @classmethod
    def of(cls, model: ReducedProblem, state: StepState) -> Ledger | None:
        """Return the ledger of a problem from a state on; None for a problem in motion or without friction."""
        problem = model.problem
        rubs = problem.case.dynamics is None and any(pair.pairing.friction for pair in problem.joints)
        return cls(model, state) if rubs else None

    def add(self, step: LoadStep, q: Floats, p: Floats) -> Work:
        """Return the work so far, after a step that has converged at q (n_q,), p (m,)."""
        outer, pressing, internal = _forces(step, q, p)
        du, dot = step.u(q) - step.u_before, step.model.problem.space.dot
        external = 0.5 * dot(du, self._forces[0] + outer) + heat_of(step, q)
        normal = 0.5 * dot(du, self._forces[1] + pressing)
        self._forces, stored = (outer, pressing), strain(step, q, internal)
        before = self._now or Work.of(0.0, 0.0, 0.0, 0.0)
        taken = before.dissipation + step.dissipated(q, p)
        self._now = Work.of(before.external + external, stored, taken, before.pressures + normal)
        return self._now


def _forces(step: LoadStep, q: Floats, p: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the forces of loads and supports, those of contact along normals, and internal ones, (n_dof,) each.

    The first are internal and contact forces, as all are in equilibrium.
    """
    from lacsolver.equilibrium.starting import motion_forces

    internal, _, contact = motion_forces(step, q, p)
    return internal + contact, step.pressing(q, p), internal
