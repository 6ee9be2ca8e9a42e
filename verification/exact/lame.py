"""Thick spheres and cylinders under pressure, and one pressed into another: Lame's solutions (small strains).

A body between the radii a < b, the pressures p on its inner and q on its outer side (Timoshenko and Goodier, Theory of
Elasticity, 3rd ed., articles 28 and 136), with k = 2 for cylinders and 3 for spheres:

    sigma_r = A - (k - 1) B / r^k,  sigma_t = A + B / r^k
    A = (p a^k - q b^k) / (b^k - a^k),  B = (p - q) a^k b^k / ((k - 1) (b^k - a^k))

and u = r times the hoop strain, which Hooke's law gives from these. In plane strain the stress across the plane is
nu (sigma_r + sigma_t), in plane stress 0. Two bodies that meet at r = c: the pressure there is the one at which the
displacement of the outer one, less that of the inner one, is the interference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Shape = Literal["sphere", "plane_strain", "plane_stress"]


@dataclass(frozen=True)
class Shell:
    """A thick sphere, or a cylinder in a plane, between two radii. `young`: stress."""

    shape: Shape
    inner: float
    outer: float
    young: float
    poisson: float

    def stress(self, r: Floats, inside: float, outside: float) -> tuple[Floats, Floats]:
        """Radial and hoop stress (n,) at radii (n,), of the pressures inside and outside."""
        k = 3 if self.shape == "sphere" else 2
        a, b = self.inner**k, self.outer**k
        mean = (inside * a - outside * b) / (b - a)
        part = (inside - outside) * a * b / (b - a) / r**k
        return mean - part, mean + part / (k - 1)

    def displacement(self, r: Floats, inside: float, outside: float) -> Floats:
        """Radial displacement (n,) at radii (n,), outwards."""
        radial, hoop = self.stress(r, inside, outside)
        across = {"sphere": hoop, "plane_strain": self.poisson * (radial + hoop), "plane_stress": 0 * hoop}[self.shape]
        return r * (hoop - self.poisson * (radial + across)) / self.young


@dataclass(frozen=True)
class Fit:
    """A shell in another, the radius between them `within.outer` = `around.inner`.

    `pressure`: inside the inner one; `outside`: around the outer one; `interference`: by how much the inner one was
    larger than the room for it.
    """

    within: Shell
    around: Shell
    pressure: float = 0.0
    interference: float = 0.0
    outside: float = 0.0

    @property
    def between(self) -> float:
        """Contact pressure, from the interference."""
        apart, per_unit = self._apart(0.0), self._apart(1.0) - self._apart(0.0)
        return (self.interference - apart) / per_unit

    def displacement(self, x: Floats, body: Literal["within", "around"]) -> Floats:
        """Displacement (n, dim) at points (n, dim) of one of the bodies, whose centre is at 0."""
        r = np.linalg.norm(x, axis=1)
        shell, p = getattr(self, body), self.between
        u = shell.displacement(r, *((self.pressure, p) if body == "within" else (p, self.outside)))
        return x * (u / r)[:, None]

    def _apart(self, p: float) -> float:
        """Radial displacement of the outer body's contact face minus the inner one's, under contact pressure p."""
        c = np.array([self.within.outer])
        inner, outer = self.within.displacement(c, self.pressure, p), self.around.displacement(c, p, self.outside)
        return float((outer - inner)[0])


# ---- a disc with a hole that rotates


@dataclass(frozen=True)
class Disc:
    """A disc between two radii. `load`: density times the square of the angular velocity."""

    inner: float
    outer: float
    young: float
    poisson: float
    load: float

    def stress(self, r: Floats) -> tuple[Floats, Floats]:
        """Radial and hoop stress (n,) at radii (n,)."""
        a, b, nu = self.inner**2, self.outer**2, self.poisson
        factor = (3 + nu) / 8 * self.load
        radial = factor * (a + b - a * b / r**2 - r**2)
        return radial, factor * (a + b + a * b / r**2 - (1 + 3 * nu) / (3 + nu) * r**2)

    def displacement(self, x: Floats) -> Floats:
        """Displacement (n, 2) at points (n, 2) or more."""
        x = np.asarray(x)[:, :2]
        r = np.linalg.norm(x, axis=1)
        radial, hoop = self.stress(r)
        return x * ((hoop - self.poisson * radial) / self.young)[:, None]
