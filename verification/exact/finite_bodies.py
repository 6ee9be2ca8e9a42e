"""A cylinder on a block and a sphere on its like, as finite bodies: their data, and pressures by other finite elements.

`PROFILES` were computed once by `data/provenance/finite_bodies.py`, without lacmesh and lacsolver: QUAD4 with 128 cells
to the contact's half-width, whose nodes meet, so that contact is a linear complementarity problem. `linear`: the
direction of contact is the normal of the plane master. `current`: the deformed skins are followed.

A pressure is over the half-space's peak and against the distance over its radius, both under the same force, so that
what coarse cells far off do to the force plays no part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]

#: of the cylinder on a block: radius, moduli of cylinder and block, Poisson's ratio, how far the cylinder's flat is
#: pushed, the force a length that meshes are made for; widths and heights of both
RADIUS, STEEL, ALLOY, POISSON, PUSH, FORCE = 50.0, 210000.0, 70000.0, 0.3, 0.2, 3500.0
CYLINDER, BLOCK = (40.0, 50.0), (100.0, 200.0)
#: of the two spheres of ssnv104: modulus, radius, displacement of each flat
SPHERE, SPHERE_RADIUS, APPROACH = 20000.0, 50.0, 2.0


class Hertz(NamedTuple):
    """Contact of half-spaces under a force: half-width or radius, and peak (Johnson, Contact Mechanics, 1985)."""

    radius: float
    peak: float

    @classmethod
    def plane(cls, force: float) -> Hertz:
        """Contact of the cylinder on the block under a force per unit length (Johnson, eqs 4.43 and 4.45)."""
        modulus = 1 / ((1 - POISSON**2) * (1 / STEEL + 1 / ALLOY))
        a = float(np.sqrt(4 * force * RADIUS / (np.pi * modulus)))
        return cls(a, 2 * force / (np.pi * a))

    @classmethod
    def round(cls, force: float) -> Hertz:
        """Contact of the two spheres (Johnson, eqs 4.22 and 4.24)."""
        modulus = SPHERE / (2 * (1 - POISSON**2))
        a = float(np.cbrt(3 * force * (SPHERE_RADIUS / 2) / (4 * modulus)))
        return cls(a, 3 * force / (2 * np.pi * a**2))


@dataclass(frozen=True)
class Profile:
    """sqrt(1 - (s / width)^2) (c0 + c1 s^2 + c2 s^4), of peak and radius of a half-space under the same force."""

    force: float
    width: float
    shape: tuple[float, float, float]

    def __call__(self, s: Floats) -> Floats:
        """(n,): the pressure over the half-space's peak at distances s (n,) in parts of its radius."""
        round_ = np.sqrt(np.maximum(0.0, 1 - (s / self.width) ** 2))
        return np.asarray(round_ * np.polyval(self.shape[::-1], s**2))


#: with 128 cells to the half-width
PROFILES = {
    "linear": Profile(3477.19989, 0.999590, (1.000210, -0.000012, 0.000034)),
    "current": Profile(3480.59218, 0.998136, (1.002258, -0.001631, -0.000832)),
    "spheres": Profile(659854.511, 0.995771, (0.999765, -0.000699, 0.001065)),
}
