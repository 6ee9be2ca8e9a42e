"""Like cylinders pressed together, then sheared or rolled: Cattaneo and Mindlin, Mindlin and Deresiewicz, Carter.

Johnson, Contact Mechanics, 7.2 to 7.4 and 8.3. Half-planes of one material, so that shear does not change the
pressure p = p0 sqrt(1 - x^2 / a^2). `load`: Q / (mu P), between -1 and 1. Under a load that grows from 0, with
c / a = sqrt(1 - load),

    t = mu p0 [sqrt(1 - x^2 / a^2) - c / a sqrt(1 - x^2 / c^2)]

and |x| < c sticks. Every time that the load turns, twice such a distribution is added, as friction must turn round:
c' / a = sqrt(1 - |change| / 2). In steady rolling the second ellipse stands at the leading edge, its centre at a - c,
and the creep is (mu a / R) (1 - c / a) for a clearance x^2 / 2 R.

Tractions of both bodies are those of `half_plane`; t is sigma_xy on the surface: along x on the lower body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verification.exact.half_plane import Ellipse, HalfPlane

Floats = NDArray[np.floating]


@dataclass(frozen=True)
class Cylinders:
    """Two half-planes of one material with a clearance x^2 / 2 R, in contact on |x| < a. `young`: stress."""

    young: float = 1.0
    poisson: float = 0.3
    radius: float = 5.0
    friction: float = 0.4
    half_width: float = 1.0

    @property
    def peak(self) -> float:
        """p0, the largest pressure (Johnson, 4.43): E* a / 2 R, 1 / E* = 2 (1 - nu^2) / E."""
        return self.young / (2 * (1 - self.poisson**2)) * self.half_width / (2 * self.radius)

    @property
    def force(self) -> float:
        """P, by unit thickness."""
        return np.pi / 2 * self.half_width * self.peak

    def stick(self, load: float) -> float:
        """Half-width c of the part that sticks under a load that has grown from 0."""
        return float(self.half_width * np.sqrt(1 - abs(load)))

    def sheared(self, *turns: float) -> tuple[Ellipse, ...]:
        """Tractions after loads that went from 0 to the first of `turns`, then to the next, and so on.

        No load may exceed those before that it turned at, so that loops stay within loops.
        """
        ellipses = [Ellipse(self.half_width, pressure=self.peak)]
        before, share = 0.0, 1.0
        for load in turns:
            change = (load - before) / share
            peak = np.sign(change) * share * self.friction * self.peak
            ellipses.append(Ellipse(self.half_width, shear=peak))
            c = self.stick(change)
            if c > 0:
                ellipses.append(Ellipse(c, shear=-peak * c / self.half_width))
            before, share = load, 2.0
        return tuple(ellipses)

    def rolling(self, load: float, at: float = 0.0) -> tuple[Ellipse, ...]:
        """Tractions in steady rolling along +x, the contact about x = `at`."""
        a, c, peak = self.half_width, self.stick(load), self.friction * self.peak
        behind = Ellipse(a, self.peak, np.sign(load) * peak, at)
        return behind, Ellipse(c, 0.0, -np.sign(load) * peak * c / a, at + a - c)

    def creep(self, load: float) -> float:
        """Relative displacement of the far bodies, the upper to the lower, over the way rolled."""
        return float(np.sign(load) * self.friction / self.radius * (self.half_width - self.stick(load)))

    def body(self, side: int) -> HalfPlane:
        """The upper (1) or the lower (-1) half-plane."""
        return HalfPlane(side, self.young, self.poisson)

    def apart(self, x: Floats, loads: Sequence[Ellipse]) -> Floats:
        """Displacement (n, 2) of the upper surface less that of the lower one at places (n,), up to a translation."""
        place = np.stack([x, np.zeros_like(x)], axis=1)
        return self.body(1).displacement(place, loads) - self.body(-1).displacement(place, loads)

    def displacement(self, x: Floats, side: int, loads: Sequence[Ellipse], stuck: float = 0.0) -> Floats:
        """Displacement (n, 2) of a body at points (n, 2), the upper one moved so that the surfaces meet at x = 0, and
        do not slip at the place `stuck`.
        """
        u = self.body(side).displacement(x, loads)
        if side < 0:
            return u
        closed, slip = self.apart(np.array([0.0, stuck]), loads)
        return u - np.array([slip[0], closed[1]])

    def slip(self, x: Floats, loads: Sequence[Ellipse], stuck: float = 0.0) -> Floats:
        """Slip (n,) of the upper surface along x at places (n,), none where it is `stuck`."""
        return np.asarray(self.apart(x, loads)[:, 0] - self.apart(np.array([stuck]), loads)[0, 0])

    def dissipation(self, load: float) -> float:
        """Work of friction while the load grows from 0: a point that slips carries mu p from then on."""
        c = self.stick(load)
        s, w = np.polynomial.legendre.leggauss(60)
        angle = np.arcsin(c / self.half_width) * (1 - s) / 2 + np.pi / 4 * (1 + s)  # x = a sin(angle), c < x < a
        x = self.half_width * np.sin(angle)
        weight = w * self.half_width * np.cos(angle) * (np.pi / 2 - np.arcsin(c / self.half_width)) / 2
        return float(2 * np.sum(weight * self.friction * self.peak * np.cos(angle) * self.slip(x, self.sheared(load))))


def shear(x: Floats, loads: Sequence[Ellipse]) -> Floats:
    """Shear stress (n,) on the surface at places (n,)."""
    return np.sum([load.shear * load.shape(x) for load in loads], axis=0)


def pressure(x: Floats, loads: Sequence[Ellipse]) -> Floats:
    """Pressure (n,) on the surface at places (n,)."""
    return np.sum([load.pressure * load.shape(x) for load in loads], axis=0)
