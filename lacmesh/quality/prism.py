"""Verdict's measures of a PENTA6.

Stimpson et al., *The Verdict Library Reference Manual*, 2007, section 8, and the program's own notes. Two constants are
rounded as in the program. `shape` is 1 for the right prism on an equilateral triangle, and less for every other, but
not always a good criterion: it compares the volume with the lengths of the edges, without their directions.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.quality.linear import Linear
from lacmesh.quality.tetrahedron import Tetrahedron
from lacmesh.quality.vectors import LARGEST, ROUND_OFF, bounded, dot, norm, ratio, triple

#: each corner, its two neighbours in the triangle, and that in the other triangle
CORNERS = ((0, 1, 2, 3), (1, 2, 0, 4), (2, 0, 1, 5), (3, 5, 4, 0), (4, 3, 5, 1), (5, 4, 3, 2))
SIDES = ((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
#: aspect_frobenius of the tetrahedron at a corner of the ideal prism
IDEAL_ASPECT = 1.16477
#: volume of the ideal prism, and its determinant
_IDEAL_VOLUME, _IDEAL_JACOBIAN = 0.433013, 0.866025


class Prism(Linear):
    """PENTA6 with nodes x (6, 3, k)."""

    @cached_property
    def _tetrahedra(self) -> list[Tetrahedron]:
        """The tetrahedron of the edges at each corner."""
        return [Tetrahedron(self.x[list(c)]) for c in CORNERS]

    @cached_property
    def det(self) -> NDArray:
        """(6, k): determinants at the corners."""
        return np.stack([t.det for t in self._tetrahedra])

    @cached_property
    def size(self) -> NDArray:
        """(k,): volume."""
        return self.volume()

    def volume(self) -> NDArray:
        """Volume of the prism's map, exact: cones from node 0 over triangles around the centres of the faces."""
        x = self.x - self.x[0]
        six = triple(x[3], x[4], x[5])
        for face in SIDES:
            centre = x[list(face)].mean(axis=0)
            six += sum(triple(x[a], x[b], centre) for a, b in zip(face, face[1:] + face[:1], strict=True))
        return six / 6

    def jacobian(self) -> NDArray:
        """The least determinant at a corner."""
        return self.det.min(axis=0)

    def scaled_jacobian(self) -> NDArray:
        """Determinant over the lengths of the edges, times 2 / sqrt(3), the least over the corners that have edges."""
        lengths = np.stack([norm(a) * norm(b) * norm(c) for a, b, c in (t.sides for t in self._tetrahedra)])
        least = ratio(self.det, lengths, otherwise=np.inf).min(axis=0)
        return np.where(np.isinf(least), -LARGEST, 2 / np.sqrt(3) * least)

    def shape(self) -> NDArray:
        """3 (2 det / sqrt(3))^(2/3) over the squared edges at a corner, the least; 0 where one is negative."""
        squares = np.stack([sum(dot(e, e) for e in t.sides) for t in self._tetrahedra])
        some = np.where(self.det > ROUND_OFF * squares**1.5, self.det, 0)
        least = ratio(3 * np.cbrt(2 / np.sqrt(3) * some) ** 2, squares, otherwise=0.0).min(axis=0)
        return np.minimum(least, 1)

    def max_aspect_frobenius(self) -> NDArray:
        """aspect_frobenius of the tetrahedron at a corner over that of the ideal prism, the largest, and at least 1."""
        largest = np.max([t.aspect_frobenius() for t in self._tetrahedra], axis=0)
        return np.where(largest < LARGEST, np.maximum(largest / IDEAL_ASPECT, 1), LARGEST)

    def condition(self) -> NDArray:
        """Equal to max_aspect_frobenius."""
        return self.max_aspect_frobenius()

    def distortion(self) -> NDArray:
        """Least determinant at a corner over its mean."""
        volume = self.volume()
        with np.errstate(divide="ignore", invalid="ignore"):
            value = self.jacobian() * (_IDEAL_VOLUME / _IDEAL_JACOBIAN) / volume
        return np.where(volume == 0, LARGEST, bounded(value))
