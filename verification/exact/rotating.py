"""A disc with a hole that rotates: plane stress, free edges (Timoshenko and Goodier, Theory of Elasticity, article 32).

    sigma_r = (3 + nu) / 8 f (a^2 + b^2 - a^2 b^2 / r^2 - r^2)
    sigma_t = (3 + nu) / 8 f (a^2 + b^2 + a^2 b^2 / r^2 - (1 + 3 nu) / (3 + nu) r^2)

with the force f r per volume, f = rho omega^2, and u = r (sigma_t - nu sigma_r) / E.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


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
