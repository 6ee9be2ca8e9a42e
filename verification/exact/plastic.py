"""Metals that yield, in closed form or by a quadrature: spheres and tubes under pressure, and known ratios of punches.

`Sphere`: small strains, perfect plasticity (Hill, The mathematical theory of plasticity, 1950, chapter V.2). The
plastic zone a <= r <= c goes out as the pressure grows:

    p = 2 Y ln(c / a) + 2 Y / 3 (1 - c^3 / b^3)
    u = Y r / E ((1 - nu) c^3 / r^3 - 2/3 (1 - 2 nu) (1 - c^3 / b^3 + 3 ln(c / r)))       r <= c
    u = Y r / (3 E) ((1 + nu) c^3 / r^3 + 2 (1 - 2 nu) c^3 / b^3)                         r >= c

`Tube`: finite plane strain of an incompressible body, in logarithmic strain. A point at R comes to r, r^2 = R^2 + a^2 -
A^2, with the principal strains e = ln(r / R), 0, -e, whose axes stay; so the equivalent stress s follows from the
equivalent strain 2 e / sqrt(3) = s / (3 G) + pbar, s = Y(pbar) + H pbar, and the pressure inside is the integral of
2 / sqrt(3) s / r from a to b.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import brentq

Floats = NDArray[np.floating]

#: mean pressure of a flat punch on a half-plane, over the yield stress in shear (Prandtl 1920)
PRANDTL = 2 + np.pi
#: peak pressure of Hertz's contact at first yield by von Mises, over the yield stress, for nu = 0.3 (Johnson, Contact
#: mechanics, 1985, sections 6.1 and 6.2)
FIRST_YIELD = {"axisymmetric": 1.60, "plane_strain": 1.79}
#: mean pressure of a ball over the yield stress, fully plastic (Tabor 1951; Johnson 1985, section 6.3)
INDENTATION = (2.7, 3.0)


@dataclass(frozen=True)
class Sphere:
    """A thick sphere between two radii that yields as far as `front`. `young`, `limit` (Y): stresses."""

    inner: float
    outer: float
    front: float
    young: float
    poisson: float
    limit: float

    @property
    def pressure(self) -> float:
        """The pressure inside."""
        rest = 1 - (self.front / self.outer) ** 3
        return self.limit * (2 * float(np.log(self.front / self.inner)) + 2 / 3 * rest)

    def displacement(self, r: Floats) -> Floats:
        """Radial displacement (n,) at radii (n,)."""
        c, b, nu = self.front, self.outer, self.poisson
        flow = 1 - (c / b) ** 3 + 3 * np.log(c / r)
        plastic = (1 - nu) * (c / r) ** 3 - 2 / 3 * (1 - 2 * nu) * flow
        elastic = ((1 + nu) * (c / r) ** 3 + 2 * (1 - 2 * nu) * (c / b) ** 3) / 3
        return np.asarray(self.limit / self.young * r * np.where(r < c, plastic, elastic))


@dataclass(frozen=True)
class Tube:
    """A tube between radii of the undeformed body. `shear`: G; `limit`, `slope`: Y + slope pbar; `kinematic`: H."""

    inner: float
    outer: float
    shear: float
    limit: float
    slope: float
    kinematic: float

    def equivalent_stress(self, strain: float) -> float:
        """Equivalent stress at an equivalent strain."""
        elastic = 3 * self.shear * strain
        if elastic <= self.limit:
            return elastic
        flow = (elastic - self.limit) / (3 * self.shear + self.slope + self.kinematic)
        return self.limit + (self.slope + self.kinematic) * flow

    def pressure(self, moved: float) -> float:
        """The pressure that moves the inner radius by so much."""
        more = (self.inner + moved) ** 2 - self.inner**2

        def at(R: float) -> float:
            r = np.sqrt(R * R + more)
            return float(2 / np.sqrt(3) * self.equivalent_stress(2 / np.sqrt(3) * np.log(r / R)) * R / (r * r))

        front = brentq(lambda R: 2 * np.sqrt(3) * self.shear * np.log1p(more / R**2) / 2 - self.limit, 1e-9, 1e9)
        inside = [front] if self.inner < front < self.outer else None
        return float(quad(at, self.inner, self.outer, points=inside, epsabs=0, epsrel=1e-12)[0])
