"""Motion of a state: velocities and forces that the next step starts from, energies, momentum, impulses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np

from lacmesh.mesh import Floats

#: energies of a state in motion, in their order: kinetic + strain + soft_contact - external + damped + contact +
#: friction + numerical = 0
ENERGIES = ("kinetic", "strain", "external", "damped", "contact", "friction", "numerical", "soft_contact")

#: arrays of a motion that grow with the model: those with the points of rigid bodies (n_w,), and those without (n_dof,)
WITH_POINTS, AT_NODES = ("velocity", "acceleration", "reaction"), ("internal", "load", "contact")

CONTACT, _FRICTION, _NUMERICAL = (ENERGIES.index(name) for name in ("contact", "friction", "numerical"))
#: those that are there at a time
STORED = [ENERGIES.index(name) for name in ("kinetic", "strain", "soft_contact")]

#: parts of the largest energy above which a warning is due: what the steps have made, and what contact has taken
_MADE, _TAKEN = 0.01, 0.05


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
        energies = np.insert(energies, _FRICTION, 0.0) if len(energies) <= _NUMERICAL else energies
        # or before soft contact was one: what it stores is a part of what contact has taken, until the next step
        energies = np.append(energies, 0.0) if len(energies) < len(ENERGIES) else energies
        return cls(**{name: kept[name] for name in cls._fields} | {"energies": energies})


def doubtful_energy(times: Sequence[float], energies: Floats, conservative: bool) -> str | None:
    """Return a sentence if the steps have made over 1 % of the largest energy, or contact has taken over 5 % of it.

    `times` (n,) and `energies` (n, 8), in the order of ENERGIES, are those of the steps in motion. Contact may take
    energy if its laws are not `conservative`.

    >>> import numpy as np
    >>> doubtful_energy([0.5, 1.0], np.array([[1.0, 0, 1, 0, 0, 0, 0, 0], [1.5, 0, 1, 0, 0.1, 0, -0.6, 0]]), True)
    'contact and the time scheme have made 33% of the largest energy out of nothing by time 1'
    >>> doubtful_energy([0.5, 1.0], np.array([[1.0, 0, 1, 0, 0, 0, 0, 0], [0.9, 0, 1, 0, 0.1, 0, 0, 0]]), True)
    'contact has taken 10% of the largest energy by time 1, as steps do not resolve the impact'
    """
    if not len(times):
        return None
    largest = max(energies[:, STORED].sum(axis=1).max(), energies[:, 2].max())  # external has that at the start
    gained, taken = -energies[:, [CONTACT, _NUMERICAL]].sum(axis=1), energies[:, CONTACT]
    last, most = int(gained.argmax()), int(taken.argmax())
    if gained[last] > _MADE * largest:
        share = f"{gained[last] / largest:.0%} of the largest energy out of nothing by time {times[last]:.6g}"
        return f"contact and the time scheme have made {share}"
    if conservative and taken[most] > _TAKEN * largest:
        share = f"{taken[most] / largest:.0%} of the largest energy by time {times[most]:.6g}"
        return f"contact has taken {share}, as steps do not resolve the impact"
    return None
