"""A pin in a hole with clearance, both of one material, in plane strain: Persson's solution, with the displacements.

Persson, On the stress distribution of cylindrical elastic bodies in contact, Chalmers, 1964; Ciavarella and Decuzzi,
Int. J. Solids Struct. 38, 2001. An infinite plate has a hole of radius R; the pin is smaller by the clearance c, and a
force Q at its centre presses it to the side x > 0 (strains are small: R is the radius of both).
With y = tan(theta / 2) and b the same at the ends of contact,

    E c / ((1 - nu^2) Q) = (2 - ln(1 + b^2) - 2 b^4) / (pi (1 + b^2) b^2)
    p R / Q = 2 / (pi a) s / (1 + y^2) + ln((a + s) / (a - s)) / (2 pi b^2 a^2),  a = sqrt(1 + b^2), s = sqrt(b^2 - y^2)

The displacements are those of Kolosov and Muskhelishvili's potentials for this pressure as a Fourier series; away from
the edge of the hole few terms are enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
Complex = NDArray[np.complexfloating]

#: terms of the series, and points that they are integrated with
_TERMS, _POINTS = 300, 1 << 16


@dataclass(frozen=True)
class PinInHole:
    """The pin and the hole. `angle`: half of the angle of contact, degrees; the force follows from it."""

    radius: float
    clearance: float
    young: float
    poisson: float
    angle: float

    @property
    def b(self) -> float:
        """tan(theta / 2) at the end of contact."""
        return float(np.tan(np.radians(self.angle) / 2))

    @property
    def force(self) -> float:
        """Q, by unit thickness."""
        b = self.b
        ratio = (2 - np.log(1 + b**2) - 2 * b**4) / (np.pi * (1 + b**2) * b**2)
        return float(self.young / (1 - self.poisson**2) * self.clearance / ratio)

    def pressure(self, angle: Floats) -> Floats:
        """Contact pressure (n,) at angles (n,) from the x axis, radians."""
        b, y = self.b, np.tan(angle / 2)
        a, s = np.sqrt(1 + b**2), np.sqrt(np.maximum(b**2 - y**2, 0.0))
        shape = 2 / (np.pi * a) * s / (1 + y**2) + np.log((a + s) / (a - s)) / (2 * np.pi * b**2 * a**2)
        return self.force / self.radius * shape

    def displacement(self, x: Floats, body: Literal["pin", "plate"]) -> Floats:
        """Displacement (n, 2) at points (n, 2) of a body, moved along x so that the two touch at (R, 0)."""
        z: Complex = np.asarray((x[:, 0] + 1j * x[:, 1]) / self.radius, complex)
        u = self._outside(z) if body == "plate" else self._inside(z) + self._lift
        return np.stack([u.real, u.imag], axis=1)

    @cached_property
    def _series(self) -> Floats:
        """(n,): p = sum of p_k cos(k theta)."""
        t = (np.arange(_POINTS) + 0.5) / _POINTS * np.pi
        coefficients = np.array([2 * np.mean(self.pressure(t) * np.cos(k * t)) for k in range(_TERMS)])
        coefficients[0] /= 2
        return coefficients

    @cached_property
    def _lift(self) -> float:
        """Rigid-body displacement of the pin along x."""
        at: Complex = np.ones(1, complex)
        return float((self._outside(at) - self._inside(at)).real[0]) + self.clearance

    @property
    def _kappa(self) -> float:
        return 3 - 4 * self.poisson

    def _outside(self, z: Complex) -> Complex:
        """u_x + i u_y of the plate: sigma_rr = -p, sigma_rt = 0 on the hole, the potentials in powers z^-k."""
        p, k, kappa = self._series, np.arange(2, _TERMS), self._kappa
        A, B = np.zeros(_TERMS), np.zeros(_TERMS + 2)
        A[1], B[1], B[2] = -p[1] / (2 * (1 + kappa)), kappa * p[1] / (2 * (1 + kappa)), p[0]
        B[3] = 2 * A[1] + p[1] / 2
        A[2:] = -p[2:] / 2
        B[k + 2] = (1 + k) * A[k] + p[k] / 2
        powers = z[:, None] ** -np.arange(1.0, _TERMS + 1)  # of z^-k and of the integrals of z^-(k + 1)
        phi = A[1] * np.log(z) + (powers[:, : _TERMS - 2] * (A[2:] / (1 - k))).sum(axis=1)
        own = np.arange(2, _TERMS + 2)
        psi = B[1] * np.log(z) + (powers * (B[2:] / (1 - own))).sum(axis=1)
        slope = (powers[:, : _TERMS - 1] * A[1:]).sum(axis=1)
        return self._moved(z, phi, slope, psi)

    def _inside(self, z: Complex) -> Complex:
        """u_x + i u_y of the pin, with the force at its centre and the potentials in powers z^k."""
        p, k, kappa = self._series, np.arange(2, _TERMS), self._kappa
        C, D = -p[1] / (2 * (1 + kappa)), kappa * p[1] / (2 * (1 + kappa))
        A, B = -p / 2, np.zeros(_TERMS)
        A[1] -= 2 * C
        B[k - 2] = (1 - k) * A[k] + p[k] / 2
        n = np.arange(_TERMS)
        powers = z[:, None] ** n
        phi = C * np.log(z) + z * (powers * (A / (n + 1))).sum(axis=1)
        psi = D * np.log(z) + z * (powers * (B / (n + 1))).sum(axis=1)
        return self._moved(z, phi, C / z + (powers * A).sum(axis=1), psi)

    def _moved(self, z: Complex, phi: Complex, slope: Complex, psi: Complex) -> Complex:
        shear = self.young / (2 * (1 + self.poisson))
        return self.radius * (self._kappa * phi - z * slope.conj() - psi.conj()) / (2 * shear)
