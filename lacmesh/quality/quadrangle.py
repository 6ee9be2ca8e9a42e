"""Verdict's measures of a QUAD4.

Stimpson et al., *The Verdict Library Reference Manual*, 2007, section 5. A quadrangle whose last two nodes coincide is
measured as a triangle if Verdict does so. `distortion` follows the program, not the manual: it is the determinant of a
shell with a thickness of a thousandth of its width, on both sides if the quadrangle is warped.

Notation: L edges, l their lengths, X principal axes, N normals at the corners, alpha their components along the normal
at the centre (twice the area seen from that corner).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.quality.linear import Linear
from lacmesh.quality.triangle import Triangle
from lacmesh.quality.vectors import LARGEST, ROUND_OFF, angle, bounded, cross, dot, norm, ratio, unit
from lacmesh.reference.shapes import gradient, shape

_GAUSS = [(a / np.sqrt(3), b / np.sqrt(3)) for a in (-1, 1) for b in (-1, 1)]


class Quadrangle(Linear):
    """QUAD4 with nodes x (4, 3, k)."""

    @cached_property
    def L(self) -> NDArray:
        """(4, 3, k): edges, one node to the next."""
        return np.roll(self.x, -1, axis=0) - self.x

    @cached_property
    def l(self) -> NDArray:  # noqa: E743
        """(4, k): lengths of the edges."""
        return np.stack([norm(e) for e in self.L])

    @cached_property
    def X(self) -> tuple[NDArray, NDArray]:
        """Principal axes, each (3, k): from side to side through the centre, doubled."""
        return self.L[0] - self.L[2], self.L[1] - self.L[3]

    @cached_property
    def N(self) -> NDArray:
        """(4, 3, k): normals at the corners; their length is the area of the parallelogram of the two edges there."""
        return np.stack([cross(self.L[c - 1], self.L[c]) for c in range(4)])

    @cached_property
    def alpha(self) -> NDArray:
        """(4, k): components of the normals at the corners along the normal at the centre."""
        centre = unit(cross(*self.X))
        return np.stack([dot(centre, n) for n in self.N])

    @cached_property
    def beside(self) -> tuple[NDArray, NDArray]:
        """(4, k) each: at every corner the product of the two edges, and the sum of their squares."""
        before = np.roll(self.l, 1, axis=0)
        return before * self.l, before**2 + self.l**2

    @cached_property
    def _triangle(self) -> Triangle:
        return Triangle(self.x[:3])

    def _unless_collapsed(self, values: NDArray, of_triangle: NDArray) -> NDArray:
        return np.where(self.l[2] == 0, of_triangle, values)

    @cached_property
    def size(self) -> NDArray:
        """(k,): area."""
        return self.area()

    def area(self) -> NDArray:
        """Mean of alpha."""
        return self.alpha.mean(axis=0)

    def aspect_ratio(self) -> NDArray:
        """Longest edge times the perimeter, over four times the area."""
        with np.errstate(divide="ignore", invalid="ignore"):
            value = self.l.max(axis=0) * self.l.sum(axis=0) / (4 * self._some(self.area(), 2))
        return np.where(np.isnan(value), -LARGEST, bounded(value))  # a point: 0 / 0

    def _some(self, values: NDArray, power: int) -> NDArray:
        """Return products of `power` lengths, set to 0 where they are mere round-off."""
        return np.where(np.abs(values) > ROUND_OFF * self.l.max(axis=0) ** power, values, 0)

    def _frobenius(self) -> NDArray:
        """(4, k): aspect of the triangle at each corner; infinite where it is flat."""
        half = 2 * np.stack([self._some(norm(n), 2) for n in self.N])
        return ratio(self.beside[1], half, otherwise=np.inf)

    def max_aspect_frobenius(self) -> NDArray:
        """Squared edges over twice the area of the parallelogram at a corner, the largest."""
        return bounded(self._frobenius().max(axis=0))

    def med_aspect_frobenius(self) -> NDArray:
        """Squared edges over twice the area of the parallelogram at a corner, the mean over the corners."""
        return bounded(self._frobenius().mean(axis=0))

    def condition(self) -> NDArray:
        """Condition number of the map at a corner, the largest."""
        at = ratio(self.beside[1], 2 * self._some(self.alpha, 2), otherwise=np.inf)
        return self._unless_collapsed(bounded(at.max(axis=0)), self._triangle.condition())

    def jacobian(self) -> NDArray:
        """The least alpha."""
        return self._unless_collapsed(self.alpha.min(axis=0), 2 * self._triangle.area())

    def scaled_jacobian(self) -> NDArray:
        """alpha over the product of the edges, the least over the corners."""
        least = ratio(self.alpha, self.beside[0], otherwise=0.0).min(axis=0)
        return self._unless_collapsed(least, self._triangle.scaled_jacobian())

    def shear(self) -> NDArray:
        """scaled_jacobian, 0 where it is negative."""
        value = self.scaled_jacobian()
        return np.where(value > ROUND_OFF, value, 0)

    def shape(self) -> NDArray:
        """2 alpha over the sum of the squared edges, the least over the corners; 0 where negative."""
        least = 2 * ratio(self.alpha, self.beside[1], otherwise=0.0).min(axis=0)
        return np.where(least > ROUND_OFF, least, 0)

    def shear_and_size(self) -> NDArray:
        """Shear times relative size squared."""
        return self.shear() * self.relative_size_squared()

    def skew(self) -> NDArray:
        """Cosine of the angle between the principal axes, without its sign."""
        return np.abs(dot(unit(self.X[0]), unit(self.X[1])))

    def taper(self) -> NDArray:
        """Length of the cross derivative over the shorter principal axis."""
        across = norm(self.x[0] - self.x[1] + self.x[2] - self.x[3])
        return ratio(across, np.minimum(norm(self.X[0]), norm(self.X[1])), ROUND_OFF * self.l.max(axis=0))

    def warpage(self) -> NDArray:
        """Cubed cosine of the angle between the normals at opposite corners, the lesser of both."""
        n = [unit(v) for v in self.N]
        least = np.minimum(dot(n[0], n[2]) ** 3, dot(n[1], n[3]) ** 3)
        return np.where(np.min([norm(v) for v in self.N], axis=0) > 0, least, ROUND_OFF)

    def stretch(self) -> NDArray:
        """sqrt(2) times the shortest edge over the longer diagonal."""
        longer = np.maximum(norm(self.x[2] - self.x[0]), norm(self.x[3] - self.x[1]))
        return ratio(np.sqrt(2) * self.l.min(axis=0), longer, ROUND_OFF * self.l.max(axis=0))

    def oddy(self) -> NDArray:
        """Deviation of the metric at a corner from a multiple of the identity, the largest (Oddy et al., 1988)."""
        squares = self.l**2
        before = np.roll(squares, 1, axis=0)
        across = np.stack([dot(self.L[c - 1], self.L[c]) for c in range(4)])
        det = before * squares - across**2
        nothing = ROUND_OFF * squares.max(axis=0) ** 2
        return ratio((before - squares) ** 2 + 4 * across**2, 2 * det, nothing).max(axis=0)

    def max_edge_ratio(self) -> NDArray:
        """The longer principal axis over the shorter."""
        a, b = norm(self.X[0]), norm(self.X[1])
        return bounded(ratio(np.maximum(a, b), np.minimum(a, b), ROUND_OFF * self.l.max(axis=0)))

    def radius_ratio(self) -> NDArray:
        """Edges (root of the summed squares) times the longest of edges and diagonals, over the least corner area."""
        diagonals = [norm(self.x[2] - self.x[0]), norm(self.x[3] - self.x[1])]
        longest = np.maximum(self.l.max(axis=0), np.max(diagonals, axis=0))
        least = self._some(np.min([norm(n) for n in self.N], axis=0), 2)
        return bounded(ratio(np.sqrt((self.l**2).sum(axis=0)) * longest, 2 * np.sqrt(2) * least))

    @cached_property
    def _angles(self) -> NDArray:
        return np.stack([angle(self.L[c], -self.L[c - 1]) for c in range(4)])

    def min_angle(self) -> NDArray:
        """The least angle at a corner, degrees; 360 where an edge has no length."""
        least = np.where(self.l.min(axis=0) > 0, self._angles.min(axis=0), 360)
        return self._unless_collapsed(least, self._triangle.min_angle())

    def max_angle(self) -> NDArray:
        """The largest angle at a corner, degrees, more than 180 where a corner is re-entrant; 0 without an edge."""
        largest = self._angles.max(axis=0)
        largest = np.where((self.alpha < 0).any(axis=0), 360 - largest, largest)
        largest = np.where(self.l.min(axis=0) > 0, largest, 0)
        return self._unless_collapsed(largest, self._triangle.max_angle())

    @cached_property
    def _face_normal(self) -> NDArray:
        """(3, k): the normal that defines positive area: from corners 0 and 2 if they agree, else from corner 1."""
        n = [unit(v) for v in self.N[:3]]
        agree, first = dot(n[0], n[2]) > 0, dot(n[0], n[1]) > 0
        return np.where(agree, n[0] + n[2], np.where(first, n[0] + n[1], n[1] + n[2]))

    def _signed(self, normals: NDArray) -> NDArray:
        """Lengths of normals (m, 3, k), negative if they oppose the normal of the face."""
        return np.stack([np.where(dot(self._face_normal, n) > 0, norm(n), -norm(n)) for n in normals])

    def distortion(self) -> NDArray:
        """Least determinant at the corners and at 2 x 2 points, over its mean."""
        area = np.sum([norm(_normal(self.x, p)) for p in _GAUSS], axis=0)
        n = np.stack([unit(v) for v in self.N])
        flat = np.all([np.abs(dot(n[0], v)) >= 0.99 for v in n], axis=0)
        off = np.where(flat, 0, 0.0005 / np.sqrt(3) * np.sqrt(area)) * n
        inside = [
            dot(np.einsum("n,nsk->sk", shape("QUAD4", [p])[0], n), _normal(side, p))
            for p in _GAUSS
            for side in (self.x + off, self.x - off)
        ]
        least = np.minimum(np.min(inside, axis=0), self._signed(self.N).min(axis=0) / 4)
        x = self.x
        corners = [cross(x[(c + 1) % 3] - x[c], x[(c + 2) % 3] - x[c]) for c in range(3)]
        with np.errstate(divide="ignore", invalid="ignore"):
            triangle = self._signed(np.stack(corners)).min(axis=0) / (norm(corners[0]) / 2)
        return self._unless_collapsed(4 * ratio(least, area, otherwise=0.0), triangle)


def _normal(x: NDArray, point: tuple[float, float]) -> NDArray:
    """(3, k): normal of the bilinear map of nodes x (4, 3, k) at a point of the reference square."""
    a, b = np.einsum("nd,nsk->dsk", gradient("QUAD4", [point])[0], x)
    return cross(a, b)
