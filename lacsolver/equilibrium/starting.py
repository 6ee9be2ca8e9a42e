"""Start of a motion: initial displacements and velocities, and accelerations and pressures that are consistent.

Nodes without mass take their places at once, and rows that are closed may carry pressures. Both follow from one step of
the backward Euler method, with a step so small that nothing else moves: forces balance, 0 <= p, 0 <= G. Accelerations
are then those of T^T M (T q'' + b) = T^T (f - f_int - B^T p - C v) + forces on rigid bodies, with b the acceleration
that prescribed displacements and finite rotations have at q'' = 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.equilibrium.attempt import attempt, first_iterate
from lacsolver.equilibrium.balance_of_energy import kinetic, momentum, strain
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.motion import MotionState
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.schemes import StepTerms
from lacsolver.equilibrium.state import Iterate, StepState
from lacsolver.linear.krylov import conjugate_gradients
from lacsolver.problem.inertia import Inertia
from lacsolver.problem.initial import fitted, initial_motion

#: step of the backward Euler method, relative to the first one
_TINY = 1e-3
#: relative residual of the accelerations, and most iterations for it
_EXACT, _MOST = 1e-15, 2000
#: weights of values at 0, 1, 2, 3 half steps for their first and second derivatives at 0, of third and second order
_FIRST, _SECOND = np.array([-11, 18, -9, 2]) / 6, np.array([2.0, -5, 4, -1])


def start_of_motion(
    model: ReducedProblem, inertia: Inertia, C: csr_array | None, state: StepState, dt: float
) -> StepState:
    """Return the state at the start of a motion, from an undeformed or a static state; `dt`: size of the first step.

    Raises CaseError for initial motions that prescribed displacements exclude.
    """
    problem, t = model.problem, state.time
    c = problem.constraints
    displacements, velocities = initial_motion(problem.space, problem.case, t)
    now = state.iterate or first_iterate(_resting(model, inertia, state, np.zeros(c.n_q), _TINY * dt))
    if problem.space.largest((displacements.record >= 0).astype(float)):  # on any process
        now = now._replace(q=fitted(problem, displacements, c.u0(t), "displacement"))
    path = _Path(inertia, t, dt / 2)
    rate = fitted(problem, velocities, path.velocity(now.q, np.zeros(c.n_q))[: problem.space.n_dof], "velocity")
    v, b = path.velocity(now.q, rate), path.acceleration(now.q, rate)
    damping = np.zeros(len(v)) if C is None else C @ v
    step = _resting(
        model, inertia, replace(state, iterate=now, earlier=None), now.q, _TINY * dt, inertia.M @ b + damping
    )
    q, p, active = attempt(step).iterate
    internal, load, contact = motion_forces(step, q, p)
    F = inertia.padded(internal - load + contact) + damping
    T = inertia.tangent(q, t)
    left = c.force(t, q) - inertia.on_unknowns(F + inertia.M @ b, q, t)
    a = T @ _accelerations(model, inertia.reduced(inertia.M, q, t), left) + b
    whole, soft = (kinetic(inertia, v), strain(step, q, internal)), step.stored_in_contact(q, p)
    pushes = step.zone_forces(q, p)
    motion = MotionState(
        v, a, inertia.M @ a + F, internal, load, contact, np.array([*whole, sum(whole) + soft, 0, 0, 0, 0, soft]),
        *momentum(inertia, inertia.places(q, t), v), np.zeros_like(pushes), np.stack([pushes, pushes], axis=1),
    )  # fmt: skip
    histories = state.histories._replace(scheme=motion._asdict())
    return StepState(t, Iterate(q, p, active), None, np.inf, histories)


def motion_forces(step: LoadStep, q: Floats, p: Floats) -> tuple[Floats, Floats, Floats]:
    """Return internal forces, loads and contact forces (n_dof,), with thermal forces as a part of the internal ones.

    Rows of equality act like loads: what moves the point of a coupling does work from outside.
    """
    internal, load, contact = step.forces(q, p)
    joining = step.joining(q, p)
    load, contact = load - joining, contact - joining
    warm = step.model.problem.loads.thermal
    if warm is not None:
        thermal = warm.force(step.t, None)
        internal, load = internal - thermal, load - thermal
    return internal, load, contact


class _Path:
    """The motion of nodes and points at the start if the unknowns go on at a constant rate, by differences."""

    def __init__(self, inertia: Inertia, t: float, h: float) -> None:
        self._inertia, self._t, self._h = inertia, t, h

    def velocity(self, q: Floats, rate: Floats) -> NDArray[np.floating]:
        """Return the velocities (n_w,) at q with the rates of change (n_q,) of the unknowns."""
        held = _FIRST @ self._differences(q, np.zeros_like(q)) / self._h
        return np.asarray(self._inertia.tangent(q, self._t) @ rate + held)

    def acceleration(self, q: Floats, rate: Floats) -> NDArray[np.floating]:
        """Return the accelerations (n_w,) at constant rates."""
        turning = rate if self._inertia.turning else np.zeros_like(rate)
        return np.asarray(_SECOND @ self._differences(q, turning) / self._h**2)

    def _differences(self, q: Floats, rate: Floats) -> NDArray[np.floating]:
        """Return displacements (4, n_w) at four times from the start on, beyond those at the start."""
        places, h = self._inertia.places, self._h
        first = places(q, self._t)
        return np.stack([places(q + k * h * rate, self._t + k * h) - first for k in range(4)])


def _resting(
    model: ReducedProblem, inertia: Inertia, state: StepState, q: Floats, h: float, forces: Floats | None = None
) -> LoadStep:
    """Return a load step of size h, at the time of a state, from rest at q (n_q,) under further forces (n_w,)."""
    t = state.time
    w, M = inertia.places(q, t), csr_array(inertia.M / h**2)

    def force(now: Floats) -> NDArray[np.floating]:
        inner = M @ (inertia.places(now, t) - w)
        return inertia.on_unknowns(inner if forces is None else inner + forces, now, t)

    return LoadStep(model, t, state, StepTerms(force, inertia.reduced(M, q, t)))


def _accelerations(model: ReducedProblem, M: csr_array, f: Floats) -> NDArray[np.floating]:
    """Return the rates q'' (n_q,) with M q'' = f where there is mass, 0 elsewhere, by conjugate gradients."""
    updated, summed = model.problem.constraints.updated, model.problem.constraints.summed
    diagonal = updated(summed(M.diagonal()))
    scale = np.where(diagonal > 0, 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 0.0)

    def apply(x: Floats) -> NDArray[np.floating]:
        return scale * summed(M @ updated(scale * x))

    return updated(scale * conjugate_gradients(apply, scale * f, model.vectors, _EXACT, _MOST))
