"""Like spheres pressed together, then sheared (Cattaneo and Mindlin), nu = 0: slip is along the load, all is exact.

Johnson, Contact Mechanics, 4.2, 7.2 and 7.4; tractions on the disc r < a, `load` = Q / (mu P), c / a = (1 - load)^1/3:

    p = p0 sqrt(1 - r^2 / a^2),   t = mu p0 [sqrt(1 - r^2 / a^2) - c / a sqrt(1 - r^2 / c^2)] along x

The displacements away from the disc are Boussinesq's and Cerruti's (Johnson, 3.4 and 3.6) integrated over it; with
r = a sin(angle) the integrand is smooth, and Gauss's rule times the trapezoidal one converges like a power.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]

#: points of the rule on a disc: along its radius, around (a point half a radius away: 1e-10)
_ALONG, _AROUND = 24, 72
#: points at which displacements are summed at once
_PIECE = 1 << 10


@dataclass(frozen=True)
class LikeSpheres:
    """Two half-spaces of one material, nu = 0, with a clearance r^2 / 2 R, in contact on r < a. `young`: stress."""

    young: float = 1.0
    radius: float = 5.0
    friction: float = 0.4
    half_width: float = 1.0

    @property
    def peak(self) -> float:
        """p0, the largest pressure: 2 E* a / (pi R), E* = E / 2."""
        return self.young * self.half_width / (np.pi * self.radius)

    @property
    def force(self) -> float:
        """P, the normal force."""
        return 2 / 3 * np.pi * self.half_width**2 * self.peak

    def stick(self, load: float) -> float:
        """Radius c of the part that sticks."""
        return float(self.half_width * np.cbrt(1 - abs(load)))

    def shear(self, r: Floats, load: float) -> Floats:
        """Shear stress (n,) along x on the lower body, at distances (n,) from the axis."""
        a, c = self.half_width, self.stick(load)
        inner = c / a * _ellipse(r, c) if c > 0 else 0.0
        return np.asarray(np.sign(load) * self.friction * self.peak * (_ellipse(r, a) - inner))

    def displacement(self, x: Floats, side: int, load: float) -> Floats:
        """Displacement (n, 3) at points (n, 3) off the disc, of the body above (`side` 1) or below z = 0.

        The upper body is moved so that the surfaces meet on the axis, and do not slip there.
        """
        u = self.far(x, side, load)
        return u if side < 0 else u - [self.shift(load), 0.0, self.approach]

    def far(self, x: Floats, side: int, load: float) -> Floats:
        """Displacement (n, 3) at points (n, 3) off the disc, that of far points being 0."""
        a, c, u = self.half_width, self.stick(load), np.zeros((len(x), 3))
        sheared = np.sign(load) * self.friction * self.peak
        mirrored = x * [1.0, 1.0, side]
        for k in range(0, len(x), _PIECE):
            place = mirrored[k : k + _PIECE]
            # the lower body is pulled along x, the upper one against it
            own = _summed(place, a, _boussinesq) * self.peak - side * sheared * _summed(place, a, _cerruti)
            if load and c > 0:
                own += side * sheared * c / a * _summed(place, c, _cerruti)
            u[k : k + _PIECE] = own
        return u / self.young * [1.0, 1.0, side]

    @property
    def approach(self) -> float:
        """Mutual approach of far points: a^2 / R (Johnson, 4.23); the upper surface is lifted by so much."""
        return self.half_width**2 / self.radius

    def shift(self, load: float) -> float:
        """Displacement along x of the upper surface where it sticks, less that of the lower one; far points stay."""
        a, c = self.half_width, self.stick(load)
        # u = pi q0 a / (4 G) in the middle of an ellipse of peak q0, nu = 0 (Johnson, 3.42 with 3.91), G = E / 2
        return float(-np.sign(load) * self.friction * self.peak * np.pi / self.young * (a - c**2 / a))


def _ellipse(r: Floats, a: float) -> Floats:
    return np.sqrt(np.maximum(1 - (r / a) ** 2, 0.0))


def _summed(x: Floats, a: float, kernel: object) -> Floats:
    """Displacement (n, 3) times E at points (n, 3), z >= 0, under sqrt(1 - r^2 / a^2) of a kernel's unit force."""
    s, w = np.polynomial.legendre.leggauss(_ALONG)
    angle, around = np.pi / 4 * (1 + s), 2 * np.pi * np.arange(_AROUND) / _AROUND
    r = a * np.sin(angle)
    weight = w * np.pi / 4 * a * np.cos(angle) * r * np.cos(angle) * 2 * np.pi / _AROUND
    place = np.stack([np.outer(r, np.cos(around)), np.outer(r, np.sin(around)), np.zeros((_ALONG, _AROUND))], axis=-1)
    apart = x[:, None] - place.reshape(-1, 3)
    return np.asarray(np.einsum("npi,p->ni", kernel(apart), np.repeat(weight, _AROUND)))  # type: ignore[operator]


def _boussinesq(x: Floats) -> Floats:
    """Displacement (.., 3) times E at x (.., 3) from a unit force along z, into the body; nu = 0, 4 pi G = 2 pi E."""
    rho, z = np.linalg.norm(x, axis=-1), x[..., 2]
    aside = z / rho**3 - 1 / (rho * (rho + z))
    return np.stack([x[..., 0] * aside, x[..., 1] * aside, z**2 / rho**3 + 2 / rho], axis=-1) / (2 * np.pi)


def _cerruti(x: Floats) -> Floats:
    """Displacement (.., 3) times E at x (.., 3) from a unit force along x; nu = 0."""
    rho = np.linalg.norm(x, axis=-1)
    own, y, z = x[..., 0], x[..., 1], x[..., 2]
    deep = rho + z
    across = 1 / rho**3 - 1 / (rho * deep**2)
    columns = [1 / rho + 1 / deep + own**2 * across, own * y * across, own * z / rho**3 + own / (rho * deep)]
    return np.stack(columns, axis=-1) / (2 * np.pi)
