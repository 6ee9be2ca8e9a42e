"""Verdict's measures of a HEXA8.

Stimpson et al., *The Verdict Library Reference Manual*, 2007, section 7; `dimension`: Flanagan and Belytschko, Int. J.
Numer. Meth. Engng 17, 1981.

Notation: X principal axes (from face to face through the centre, four times as long), frames the edges that leave each
corner, det the determinant of a frame, B the derivative of the volume by the nodes.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.quality.linear import Linear
from lacmesh.quality.vectors import LARGEST, ROUND_OFF, bounded, cross, dot, norm, ratio, triple, unit
from lacmesh.reference.shapes import gradient

_EDGES = CELLS["HEXA8"].edges
SIGNS = np.array(CELLS["HEXA8"].reference)
#: each corner and its neighbours, counted so that the cube's determinants are positive
FRAMES = (
    (0, 1, 3, 4),
    (1, 2, 0, 5),
    (2, 3, 1, 6),
    (3, 0, 2, 7),
    (4, 7, 5, 0),
    (5, 4, 6, 1),
    (6, 5, 7, 2),
    (7, 6, 4, 3),
)
_DIAGONALS = ((0, 6), (1, 7), (2, 4), (3, 5))
_POINTS = SIGNS / np.sqrt(3)  # of the 2 x 2 x 2 rule

Frame = tuple[NDArray, NDArray, NDArray]


class Hexahedron(Linear):
    """HEXA8 with nodes x (8, 3, k)."""

    @cached_property
    def l(self) -> NDArray:  # noqa: E743
        """(12, k): lengths of the edges."""
        return np.stack([norm(self.x[j] - self.x[i]) for i, j in _EDGES])

    @cached_property
    def X(self) -> Frame:
        """Principal axes, each (3, k)."""
        a, b, c = np.einsum("nd,nsk->dsk", SIGNS, self.x)
        return a, b, c

    @cached_property
    def axes(self) -> NDArray:
        """(3, k): lengths of the principal axes."""
        return np.stack([norm(a) for a in self.X])

    @cached_property
    def frames(self) -> list[Frame]:
        """Edges that leave each corner, then the principal axes: nine triples of (3, k)."""
        x = self.x
        return [(x[i] - x[c], x[j] - x[c], x[k] - x[c]) for c, i, j, k in FRAMES] + [self.X]

    @cached_property
    def det(self) -> NDArray:
        """(9, k): determinants of the frames."""
        return np.stack([triple(*f) for f in self.frames])

    @cached_property
    def products(self) -> NDArray:
        """(9, k): products of the lengths of each frame."""
        return np.stack([norm(a) * norm(b) * norm(c) for a, b, c in self.frames])

    @cached_property
    def some(self) -> NDArray:
        """(9, k): the determinants, set to 0 where they are negative or mere round-off."""
        return np.where(self.det > ROUND_OFF * self.products, self.det, 0)

    @cached_property
    def squares(self) -> NDArray:
        """(9, k): sums of the squared lengths of each frame."""
        return np.stack([sum(dot(e, e) for e in f) for f in self.frames])

    @cached_property
    def diagonals(self) -> NDArray:
        """(4, k): lengths of the diagonals."""
        return np.stack([norm(self.x[j] - self.x[i]) for i, j in _DIAGONALS])

    @cached_property
    def size(self) -> NDArray:
        """(k,): volume."""
        return self.volume()

    @property
    def sampled_size(self) -> NDArray:
        """(k,): mean of the determinants at the corners."""
        return self.det[:8].mean(axis=0)

    def volume(self) -> NDArray:
        """Volume of the trilinear map, exact: the determinant at 2 x 2 x 2 points."""
        return self._determinants(_POINTS).sum(axis=0)

    def _determinants(self, points: NDArray) -> NDArray:
        """(p, k): determinants of the map at points (p, 3) of the reference cube."""
        return np.stack([triple(*np.einsum("nd,nsk->dsk", dN, self.x)) for dN in gradient("HEXA8", points)])

    def jacobian(self) -> NDArray:
        """The least determinant, of the corners and of the axes at their true length."""
        return np.minimum(self.det[:8].min(axis=0), self.det[8] / 64)

    @cached_property
    def _scaled(self) -> NDArray:
        """(9, k): determinant over the lengths of the frame; LARGEST where one has none."""
        return ratio(self.det, self.products, otherwise=LARGEST)

    def scaled_jacobian(self) -> NDArray:
        """Determinant over the lengths of the frame, the least of corners and axes."""
        return np.where((self.products > 0).all(axis=0), self._scaled.min(axis=0), LARGEST)

    def shear(self) -> NDArray:
        """Determinant over the lengths of the edges at a corner, the least; 0 where it is negative."""
        least = self._scaled[:8].min(axis=0)
        return np.where((least > ROUND_OFF) & (self.products[:8] > 0).all(axis=0), least, 0)

    def shape(self) -> NDArray:
        """3 det^(2/3) over the squared edges at a corner, the least; 0 where one is negative."""
        return ratio(3 * np.cbrt(self.some[:8]) ** 2, self.squares[:8], otherwise=0.0).min(axis=0)

    def relative_size_squared(self) -> NDArray:
        """Size over the mean size of the type, or its inverse where that is less, squared; 0 if inverted.

        In a mesh whose mean size is negative, -LARGEST for the cells that are not inverted.
        """
        if self.mean_size < 0:
            return np.where(self.sampled_size > 0, -LARGEST, 0.0)
        return super().relative_size_squared()

    def shear_and_size(self) -> NDArray:
        """Shear times relative size squared."""
        return self.shear() * self.relative_size_squared()

    @cached_property
    def _conditions(self) -> NDArray:
        """(8, k): condition numbers at the corners, in the Frobenius norm; infinite where not positive."""
        corners = self.frames[:8]
        minors = np.stack([sum(dot(n, n) for n in (cross(a, b), cross(b, c), cross(c, a))) for a, b, c in corners])
        return ratio(np.sqrt(self.squares[:8] * minors), 3 * self.some[:8], otherwise=np.inf)

    def condition(self) -> NDArray:
        """Condition number of the map, the largest of the corners: the same as max_aspect_frobenius."""
        return self.max_aspect_frobenius()

    def max_aspect_frobenius(self) -> NDArray:
        """Condition number of the map, the largest of the corners."""
        return bounded(self._conditions.max(axis=0))

    def med_aspect_frobenius(self) -> NDArray:
        """Condition number of the map, the mean of the corners."""
        return bounded(self._conditions.mean(axis=0))

    def oddy(self) -> NDArray:
        """Deviation of the metric of a frame from a multiple of the identity, the largest (Oddy et al., 1988)."""
        metric = [sum(dot(a, b) ** 2 for a in f for b in f) for f in self.frames]
        return bounded(ratio(np.stack(metric) - self.squares**2 / 3, np.cbrt(self.some) ** 4).max(axis=0))

    def skew(self) -> NDArray:
        """Cosine of the angle between two principal axes, without its sign, the largest."""
        a, b, c = (unit(v) for v in self.X)
        largest = np.max([np.abs(dot(a, b)), np.abs(dot(b, c)), np.abs(dot(c, a))], axis=0)
        return np.where(self._longest_axis_share > ROUND_OFF, largest, LARGEST)

    @cached_property
    def _longest_axis_share(self) -> NDArray:
        """(k,): shortest principal axis over the longest edge."""
        return ratio(self.axes.min(axis=0), self.l.max(axis=0), otherwise=0.0)

    def taper(self) -> NDArray:
        """Length of a cross derivative over the shorter of its two principal axes, the largest."""
        pairs = ((0, 1), (0, 2), (1, 2))
        across = [np.einsum("n,nsk->sk", SIGNS[:, i] * SIGNS[:, j], self.x) for i, j in pairs]
        nothing = ROUND_OFF * self.l.max(axis=0)
        ratios = [
            ratio(norm(v), np.minimum(self.axes[i], self.axes[j]), nothing)
            for v, (i, j) in zip(across, pairs, strict=True)
        ]
        return bounded(np.max(ratios, axis=0))

    def max_edge_ratio(self) -> NDArray:
        """The longest principal axis over the shortest."""
        return bounded(ratio(self.axes.max(axis=0), self.axes.min(axis=0), ROUND_OFF * self.l.max(axis=0)))

    def stretch(self) -> NDArray:
        """sqrt(3) times the shortest edge over the longest diagonal."""
        longest = self.diagonals.max(axis=0)
        return bounded(np.sqrt(3) * ratio(self.l.min(axis=0), longest, ROUND_OFF * self.l.max(axis=0)))

    def diagonal(self) -> NDArray:
        """The shortest diagonal over the longest."""
        longest = self.diagonals.max(axis=0)
        return bounded(ratio(self.diagonals.min(axis=0), longest, ROUND_OFF * self.l.max(axis=0)))

    def dimension(self) -> NDArray:
        """Characteristic length for stable time steps: volume over sqrt(2 B.B)."""
        B: NDArray = np.zeros_like(self.x)
        for dN in gradient("HEXA8", _POINTS):
            a, b, c = np.einsum("nd,nsk->dsk", dN, self.x)
            B += np.einsum("nd,dsk->nsk", dN, np.stack([cross(b, c), cross(c, a), cross(a, b)]))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.abs((B * self.x).sum(axis=(0, 1))) / 3 / np.sqrt(2 * (B**2).sum(axis=(0, 1)))

    def distortion(self) -> NDArray:
        """Least determinant of the map, at the corners and at 2 x 2 x 2 points, over its mean."""
        inside = self._determinants(_POINTS)
        least = np.minimum(self.det[:8].min(axis=0) / 8, inside.min(axis=0))
        with np.errstate(divide="ignore", invalid="ignore"):
            return bounded(8 * least / self.volume())
