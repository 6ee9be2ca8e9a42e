"""Cracks that a pressure opens: the tip of an edge crack in plane strain, and a penny-shaped crack.

**Edge crack.** A term of Williams's series of a crack along x < 0 with its tip at the origin (J. Appl. Mech. 24, 1957,
109), of mode I with the power s = n / 2 of r, n odd, beside a uniform stress yy = -p, which presses on the faces from
inside. With kappa = 3 - 4 nu,

    2 G u_x = A r^s ((kappa + s - 1) cos(s theta) - s cos((s - 2) theta))
    2 G u_y = A r^s ((kappa - s + 1) sin(s theta) + s sin((s - 2) theta))

The opening is 2 A (kappa + 1) r^s sin(s pi) / 2 G: for n = 1 the field of a stress intensity, for n = 3 a cusp.

**Penny.** |r| < 1 on z = 0 under the pressure p inside, in an infinite body (Sneddon, Proc. R. Soc. A 187, 1946, 229):
opening 8 (1 - nu^2) p / (pi E) sqrt(1 - r^2). Displacements by a harmonic f (Green and Zerna, Theoretical elasticity),

    2 G u_r = (1 - 2 nu) f_r + z f_rz,   2 G u_z = -2 (1 - nu) f_z + z f_zz,   f = 2 p / pi (Im P - Re G)

with w = z + i, R = sqrt(r^2 + w^2), L = log(R + w), G = w L - R, P = (w^2 / 2 - r^2 / 4) L - 3 w R / 4 + r^2 / 4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class EdgeCrack:
    """`n`: number of the term, 1 or 3; `pressure`; the term opens by `opened` at a distance of 1 from the tip."""

    n: int = 1
    young: float = 1000.0
    poisson: float = 0.3
    pressure: float = 2.0
    opened: float = 0.01

    @property
    def _modulus(self) -> float:
        return self.young / (1 + self.poisson)

    @property
    def _factor(self) -> float:
        """A of the term."""
        return self.opened * self._modulus / (8 * (1 - self.poisson) * float(np.sin(self.n * np.pi / 2)))

    def opening(self, r: Floats) -> Floats:
        """Opening (n,) at distances (n,) from the tip."""
        return np.asarray(self.opened * r ** (self.n / 2))

    def displacement(self, x: Floats) -> Floats:
        """Displacement (n, 2) at points (n, 2), y = 0 from above."""
        r, theta = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
        s, kappa = self.n / 2, 3 - 4 * self.poisson
        along = (kappa + s - 1) * np.cos(s * theta) - s * np.cos((s - 2) * theta)
        across = (kappa - s + 1) * np.sin(s * theta) + s * np.sin((s - 2) * theta)
        term = (self._factor / self._modulus * r**s)[:, None] * np.stack([along, across], axis=1)
        strain = self.pressure * (1 + self.poisson) / self.young * np.array([self.poisson, self.poisson - 1])
        return np.asarray(term + strain * x)

    def stress(self, x: Floats) -> Floats:
        """Stresses xx, yy, xy (n, 3) at points (n, 2) off the tip."""
        r, theta = np.hypot(x[:, 0], x[:, 1]), np.arctan2(x[:, 1], x[:, 0])
        s = self.n / 2
        c, d = np.cos((s - 1) * theta), np.cos((s - 3) * theta)
        parts = [(1 + s) * c - (s - 1) * d, (3 - s) * c + (s - 1) * d,
                 (s - 1) * np.sin((s - 3) * theta) - (s - 1) * np.sin((s - 1) * theta)]  # fmt: skip
        term = (self._factor * s * r ** (s - 1))[:, None] * np.stack(parts, axis=1)
        return np.asarray(term - self.pressure * np.array([0.0, 1.0, 0.0]))


@dataclass(frozen=True)
class PennyCrack:
    """The crack of radius 1, and the pressure inside it."""

    young: float = 1000.0
    poisson: float = 0.3
    pressure: float = 5.0

    def opening(self, r: Floats) -> Floats:
        """Opening (n,) at radii (n,) below 1."""
        most = 8 * (1 - self.poisson**2) * self.pressure / (np.pi * self.young)
        return np.asarray(most * np.sqrt(np.maximum(1 - r**2, 0)))

    def displacement(self, r: Floats, z: Floats) -> Floats:
        """Displacement (n, 2) along r and z at points of the half z >= 0 (n,), and by symmetry below it."""
        below, z = z < 0, np.abs(z)
        w = z + 1j
        R = np.sqrt(r**2 + w**2)
        L = np.log(R + w)
        G_r = -r / R + w * r / (R * (R + w))
        P_r = -r / 2 * L + (w**2 / 2 - r**2 / 4) * r / (R * (R + w)) - 0.75 * w * r / R + r / 2
        f_r = P_r.imag - G_r.real
        f_z = (w * L - R).imag - L.real
        f_rz = G_r.imag - (r / (R * (R + w))).real
        f_zz = L.imag - (1 / R).real
        size = 2 * self.pressure / np.pi * (1 + self.poisson) / self.young
        along = (1 - 2 * self.poisson) * f_r + z * f_rz
        across = -2 * (1 - self.poisson) * f_z + z * f_zz
        return np.asarray(size * np.stack([along, np.where(below, -across, across)], axis=1))
