"""Motion of a state: velocities and forces that the next step starts from, energies, momentum, impulses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Self

import numpy as np

from lacmesh.mesh import Floats

#: energies of a state in motion, in their order: kinetic + strain + soft_contact - external + damped + contact +
#: friction + numerical = 0
ENERGIES = ("kinetic", "strain", "external", "damped", "contact", "friction", "numerical", "soft_contact")

#: arrays of a motion that grow with the model: those with the points of rigid bodies (n_w,), and those without (n_dof,)
WITH_POINTS, AT_NODES = ("velocity", "acceleration", "reaction"), ("internal", "load", "contact")

CONTACT, _FRICTION, NUMERICAL = (ENERGIES.index(name) for name in ("contact", "friction", "numerical"))
#: those that are there at a time
STORED = [ENERGIES.index(name) for name in ("kinetic", "strain", "soft_contact")]


class MotionState(NamedTuple):
    """Velocities, forces and sums that a step in motion keeps.

    `w` are the displacements of all nodes, then of the points that carry the own mass of rigid bodies
    (`problem.inertia`), n_w in all.
    `velocity`, `acceleration`, `reaction` (n_w,): the last are the forces of supports. `internal`, `load`, `contact`
    (n_dof,): internal forces, loads, and contact forces B^T p. `energies` (8,): see ENERGIES. `linear` (dim,) and
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

    @property
    def account(self) -> float:
        """Sum of the account of energy, `external` with the other sign: 0 but round-off."""
        return float(self.energies.sum() - 2 * self.energies[ENERGIES.index("external")])

    @classmethod
    def of(cls, kept: Mapping[str, Floats]) -> Self | None:
        """Return the motion that a time scheme has kept; None if it has kept none."""
        if not set(cls._fields) <= set(kept):
            return None
        energies = kept["energies"]  # of a state that was written before friction was a part of it: none was taken
        energies = np.insert(energies, _FRICTION, 0.0) if len(energies) <= NUMERICAL else energies
        # or before soft contact was one: what it stores is a part of what contact has taken, until the next step
        energies = np.append(energies, 0.0) if len(energies) < len(ENERGIES) else energies
        return cls(**{name: kept[name] for name in cls._fields} | {"energies": energies})
