"""Verdict's measures of a PYRAM5, as its program defines them (the manual of 2007 has the volume only).

`shape` takes the direction of the base from the corner of node 0, and limits the length of the edge 0-1 to that of the
edge 1-2: it depends on the order in which the cell lists its nodes.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lacmesh.quality.linear import Linear
from lacmesh.quality.quadrangle import Quadrangle
from lacmesh.quality.tetrahedron import Tetrahedron
from lacmesh.quality.vectors import cross, dot, norm, triple

#: the four ways to take three corners of the base, and the apex
_TETRAHEDRA = ((0, 1, 2, 4), (0, 2, 3, 4), (0, 1, 3, 4), (1, 2, 3, 4))
_BASE = ((0, 1), (1, 2), (2, 3), (3, 0))


class Pyramid(Linear):
    """PYRAM5 with nodes x (5, 3, k)."""

    @cached_property
    def _tetrahedra(self) -> list[Tetrahedron]:
        return [Tetrahedron(self.x[list(c)]) for c in _TETRAHEDRA]

    @cached_property
    def size(self) -> NDArray:
        """(k,): volume."""
        return self.volume()

    def volume(self) -> NDArray:
        """Four tetrahedra around the centre of the base."""
        x, centre = self.x, self.x[:4].mean(axis=0)
        return np.sum([triple(x[i] - x[4], centre - x[4], x[j] - x[4]) for i, j in _BASE], axis=0) / 6

    def jacobian(self) -> NDArray:
        """The least determinant of the tetrahedra of three corners of the base and the apex."""
        return np.min([t.det for t in self._tetrahedra], axis=0)

    def scaled_jacobian(self) -> NDArray:
        """The least scaled Jacobian of these tetrahedra, times sqrt(2), mirrored at 1; 0 where negative."""
        least = np.sqrt(2) * np.min([t.scaled_jacobian() for t in self._tetrahedra], axis=0)
        return np.where(least <= 0, 0, np.where(least < 1, least, 2 - least))

    def shape(self) -> NDArray:
        """Shape of the base, times the cosine of the axis to its normal, times height over ideal height or inverse."""
        x = self.x
        base = Quadrangle(x[:4]).shape()
        axis, normal = x[4] - x[:4].mean(axis=0), cross(x[1] - x[0], x[3] - x[0])
        edges = [norm(x[j] - x[i]) for i, j in _BASE] + [norm(x[4] - x[i]) for i in range(4)]
        ideal = np.max([np.minimum(edges[0], edges[1]), *edges[2:]], axis=0) / np.sqrt(2)
        with np.errstate(divide="ignore", invalid="ignore"):
            height = dot(axis, normal) / norm(normal)
            value = base * height / norm(axis) * np.minimum(height / ideal, ideal / height)
        return np.where((base == 0) | ~(height > 0), 0, value)
