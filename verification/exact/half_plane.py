"""Half-planes under elliptic tractions in closed form: displacements and stresses at any depth, plane strain.

With the body in Im z >= 0, z = x + i y, and sigma_yy - i sigma_xy = N - i T on its surface, one potential, continued
through the surface where that is free, gives all (Muskhelishvili, Some basic problems, articles 112 and 113):

    Phi(z) = 1 / (2 pi i) int (N - i T) / (s - z) ds,   phi' = Phi
    sigma_xx + sigma_yy = 4 Re Phi,   sigma_yy - i sigma_xy = Phi(z) - Phi(z*) + (z - z*) Phi'(z)*
    2 G (u_x + i u_y) = kappa phi(z) + phi(z*) - (z - z*) Phi(z)*,   kappa = 3 - 4 nu

(* is the conjugate). Of sqrt(1 - s^2 / a^2) on |s| < a, with root = sqrt(z^2 - a^2) ~ z:

    Phi = i / (2 a) (z - root),   phi = i / (4 a) (z^2 - z root + a^2 log(z + root))

A body below is the mirror image of one above. Displacements are known up to a translation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Complex = NDArray[np.complexfloating]


@dataclass(frozen=True)
class Ellipse:
    """Elliptic tractions on |x - centre| < half_width: peaks of the pressure and of the shear stress sigma_xy."""

    half_width: float
    pressure: float = 0.0
    shear: float = 0.0
    centre: float = 0.0

    def shape(self, x: Floats) -> Floats:
        """sqrt(1 - (x - centre)^2 / a^2) at x (n,), 0 outside."""
        return np.sqrt(np.maximum(1 - ((x - self.centre) / self.half_width) ** 2, 0.0))


@dataclass(frozen=True)
class HalfPlane:
    """A half-plane above (`side` 1) or below (-1) the surface y = 0. `young`: stress."""

    side: int
    young: float
    poisson: float

    def displacement(self, x: Floats, loads: Sequence[Ellipse]) -> Floats:
        """Displacement (n, 2) at points (n, 2) of the body under tractions on its surface."""
        total = np.zeros(len(x), complex)
        for load in loads:
            z, factor = self._place(x, load), self._factor(load)
            across = z.conj()
            total += (3 - 4 * self.poisson) * factor * _integral(z, load.half_width, 1)
            total += factor * _integral(across, load.half_width, -1)
            total -= (z - across) * (factor * _potential(z, load.half_width, 1)).conj()
        total /= self.young / (1 + self.poisson)
        return np.stack([total.real, self.side * total.imag], axis=1)

    def under_forces(self, x: Floats, place: Floats, force: Floats) -> Floats:
        """Displacement (n, 2) at points (n, 2) off the surface under forces (k, 2), along x and y, at its places (k,).

        With the body above, the integral of N - i T over a force F is -F_y + i F_x.
        """
        z: Complex = np.asarray(x[:, 0] + 1j * np.maximum(self.side * x[:, 1], 0.0))
        factor = -self.side * force[:, 1] + 1j * force[:, 0]
        phi, across = (-(np.log(p[:, None] - place) @ factor) / (2j * np.pi) for p in (z, z.conj()))
        slope = (1 / (place - z[:, None])) @ factor / (2j * np.pi)
        total = (3 - 4 * self.poisson) * phi + across - (z - z.conj()) * slope.conj()
        total /= self.young / (1 + self.poisson)
        return np.stack([total.real, self.side * total.imag], axis=1)

    def stress(self, x: Floats, loads: Sequence[Ellipse]) -> Floats:
        """Stress (n, 3): xx, yy, xy, at points (n, 2) of the body under tractions on its surface."""
        total, along = np.zeros(len(x)), np.zeros(len(x), complex)
        for load in loads:
            z, factor, a = self._place(x, load), self._factor(load), load.half_width
            phi = factor * _potential(z, a, 1)
            slope = factor * 1j / (2 * a) * (1 - z / _root(z, a, 1))
            total += 4 * phi.real
            along += phi - factor * _potential(z.conj(), a, -1) + (z - z.conj()) * slope.conj()
        return np.stack([total - along.real, along.real, -self.side * along.imag], axis=1)

    def _place(self, x: Floats, load: Ellipse) -> Complex:
        depth = np.maximum(self.side * x[:, 1], 0.0)
        return np.asarray(x[:, 0] - load.centre + 1j * depth)

    def _factor(self, load: Ellipse) -> complex:
        """N - i T of the peaks, in the frame in which the body is above."""
        return complex(-load.pressure, -self.side * load.shear)


def _root(z: Complex, a: float, half: int) -> Complex:
    """sqrt(z^2 - a^2) ~ z, continuous in the upper (`half` 1) or lower half of the plane; on its edge from there."""
    place = z.real + 1j * half * np.maximum(half * z.imag, 1e-300)
    root = np.sqrt(place - a) * np.sqrt(place + a)
    return np.where(root == 0, 1e-300, root)


def _potential(z: Complex, a: float, half: int) -> Complex:
    return 1j / (2 * a) * (z - _root(z, a, half))


def _integral(z: Complex, a: float, half: int) -> Complex:
    root = _root(z, a, half)
    return 1j / (4 * a) * (z**2 - z * root + a**2 * np.log(z + root))
