"""Verdict's measures of a TRIA3.

Stimpson, Ernst, Knupp, Pebay, Thompson, *The Verdict Library Reference Manual*, 2007, section 4.

Notation: L edges, l their lengths, A twice the area.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.quality.linear import Linear
from lacmesh.quality.vectors import LARGEST, ROUND_OFF, angle, bounded, cross, norm, ratio

_ROOT_3 = np.sqrt(3)


class Triangle(Linear):
    """TRIA3 with nodes x (3, 3, k)."""

    @cached_property
    def L(self) -> NDArray:
        """(3, 3, k): edges, one node to the next."""
        return np.roll(self.x, -1, axis=0) - self.x

    @cached_property
    def l(self) -> NDArray:  # noqa: E743
        """(3, k): lengths of the edges."""
        return np.stack([norm(e) for e in self.L])

    @cached_property
    def A(self) -> NDArray:
        """(k,): twice the area, set to 0 where it is mere round-off."""
        twice = norm(cross(self.L[0], -self.L[2]))
        return np.where(twice > ROUND_OFF * self.l.max(axis=0) ** 2, twice, 0)

    @cached_property
    def size(self) -> NDArray:
        """(k,): area."""
        return self.area()

    def area(self) -> NDArray:
        """Area."""
        return norm(cross(self.L[0], -self.L[2])) / 2

    def aspect_ratio(self) -> NDArray:
        """Longest edge over the radius of the inscribed circle, 1 when equilateral."""
        return bounded(ratio(self.l.max(axis=0) * self.l.sum(axis=0), 2 * _ROOT_3 * self.A))

    def aspect_frobenius(self) -> NDArray:
        """Sum of squared edges over 4 sqrt(3) times the area."""
        return bounded(ratio((self.l**2).sum(axis=0), 2 * _ROOT_3 * self.A))

    def condition(self) -> NDArray:
        """Condition number of the map from the equilateral triangle: the same as aspect_frobenius."""
        return self.aspect_frobenius()

    def distortion(self) -> NDArray:
        """1: the determinant of a linear map is the same everywhere."""
        return np.ones(self.x.shape[-1])

    def radius_ratio(self) -> NDArray:
        """Radius of the circumscribed circle over twice that of the inscribed one."""
        return bounded(ratio(self.l.prod(axis=0) * self.l.sum(axis=0), 4 * self.A**2))

    def scaled_jacobian(self) -> NDArray:
        """Twice the area over the largest product of two edges, times 2 / sqrt(3)."""
        products = self.l * np.roll(self.l, 1, axis=0)
        return ratio(2 / _ROOT_3 * self.A, products.max(axis=0), otherwise=0.0)

    def shape(self) -> NDArray:
        """1 / condition."""
        inverse = self.condition()
        return np.where(inverse < LARGEST, 1 / inverse, 0)

    @cached_property
    def _angles(self) -> NDArray:
        """(3, k): degrees at the corners; 0 where an edge has no length."""
        at = np.stack([angle(self.L[c], -self.L[c - 1]) for c in range(3)])
        return np.where(self.l.min(axis=0) > 0, at, 0)

    def min_angle(self) -> NDArray:
        """The least angle, degrees."""
        return self._angles.min(axis=0)

    def max_angle(self) -> NDArray:
        """The largest angle, degrees."""
        return self._angles.max(axis=0)
