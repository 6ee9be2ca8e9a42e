"""Motion of a state: velocities and forces that the next step starts from, energies, momentum, impulses."""

from __future__ import annotations

from typing import NamedTuple, Self

from lacmesh.mesh import Floats
from lacsolver.results.state import StepState

#: energies of a state in motion, in their order: kinetic + strain - external + damped + contact + numerical = 0
ENERGIES = ("kinetic", "strain", "external", "damped", "contact", "numerical")


class MotionState(NamedTuple):
    """Velocities, forces and sums that a step in motion keeps.

    `w` are the displacements of all nodes, then of the points that carry the own mass of rigid bodies
    (`problem.inertia`), n_w in all.
    `velocity`, `acceleration`, `reaction` (n_w,): the last are the forces of supports. `internal`, `load`, `contact`
    (n_dof,): internal forces, loads, and contact forces B^T p. `energies` (6,): see ENERGIES. `linear` (dim,) and
    `angular` (3,) or (): momentum, the angular one about the origin. By zone, `impulse` (n, dim) on the slave since the
    start, and `pushes` (n, 2, dim): the force on it now, and as the time scheme weighs it.
    """

    velocity: Floats
    acceleration: Floats
    reaction: Floats
    internal: Floats
    load: Floats
    contact: Floats
    energies: Floats
    linear: Floats
    angular: Floats
    impulse: Floats
    pushes: Floats

    @classmethod
    def of(cls, state: StepState) -> Self | None:
        """Return the motion of a state; None if it is static."""
        kept = state.histories.scheme
        return cls(**{name: kept[name] for name in cls._fields}) if set(cls._fields) <= set(kept) else None
