"""Measures that lacmesh computes, of cells of dimension 2 and 3: corner Jacobian, edge ratio, angles.

The corner Jacobian is one number for the quality of a cell, scaled for each type to 1 for its ideal cell. At a corner
the tangents of the edges are normalised and their determinant is computed (Knupp, Int. J. Numer. Meth. Engng 48, 2000);
the ideal cells are the equilateral triangle and tetrahedron, the square and the cube, the prism with an equilateral
base and the pyramid with equilateral sides. At a pyramid's apex, where four edges meet, each set of three consecutive
edges counts; for the ideal pyramid they give the same value as the corners of the base. The tangents of a quadratic
cell are those of its curved edges.

The edge ratio compares the lengths of the curved edges. The angle at a corner of a surface cell is that between its
edges; a dihedral angle of a solid is that between two facets at either end of their common edge, measured between the
planes that are tangent to the edges there. All are in degrees, 0 to 180, without sign. Corners with an edge of zero
length are left out; NaN if all are.

Notation: a *way* 2 e + s runs along edge e from its end s; x (3, n, k) are the nodes of k cells, components first.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from functools import cache, cached_property
from itertools import combinations
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.quality.determinant import as_points, by_pieces
from lacmesh.reference.vectors import cross, dot, norm, over

#: family -> the square of the determinant at a corner of its ideal cell
_IDEAL = {"TRIA": 0.75, "QUAD": 1.0, "TETRA": 0.5, "HEXA": 1.0, "PENTA": 0.75, "PYRAM": 0.5}
#: points and weights that measure a curved edge, on [0, 1] (Gauss, 3 points)
_GAUSS = tuple(zip(0.5 + np.sqrt(0.15) * np.array([-1, 0, 1]), np.array([5, 8, 5]) / 18, strict=True))


class Corners(NamedTuple):
    """Corners of a cell type. `planes` (m, 2): the ways along both edges at each corner of each facet, or of a surface.

    `frames` (c, 2): a plane at each corner of a solid, and the way out of it. `angles` (a, 2): for each angle of a
    solid its two planes, at an end of an edge.
    """

    planes: Ints
    frames: Ints
    angles: Ints


@cache
def corners_of(name: str) -> Corners:
    """Return the corners of a cell type."""
    cell = CELLS[name]
    way = {ends: 2 * k + s for k, edge in enumerate(cell.edges) for s, ends in enumerate((edge, edge[::-1]))}
    circles = [tuple(range(cell.n_corners))]
    if cell.dim == 3:
        circles = [f.nodes[: CELLS[CELLS[f.type].linear].n_corners] for f in cell.facets]
    planes = [(way[t[k], t[k - 1]], way[t[k], t[(k + 1) % len(t)]]) for t in circles for k in range(len(t))]
    at_end: dict[int, list[int]] = defaultdict(list)
    for k, pair in enumerate(planes):
        for w in pair:
            at_end[w].append(k)
    frames = []
    for c in range(cell.n_corners):
        for three in combinations([w for ends, w in way.items() if ends[0] == c], 3):  # an apex has four of them
            k = next(k for k, pair in enumerate(planes) if set(pair) < set(three))
            frames.append((k, *set(three) - set(planes[k])))
    angles = list(at_end.values()) if cell.dim == 3 else []
    return Corners(*(np.array(rows, int).reshape(-1, 2) for rows in (planes, frames, angles)))


class Shapes:
    """Some cells of one type, with nodes x (3, n, k): what several of their measures need, computed once.

    `plane`: surface cells are measured relative to +z, not to their own mean normal.
    """

    def __init__(self, name: str, x: Floats, plane: bool = False) -> None:
        self.name, self.x, self.plane = name, x, plane
        self.cell, self.corners = CELLS[name], corners_of(name)

    @cached_property
    def tangents(self) -> tuple[Floats, Floats]:
        """(3, edges, k), twice: derivatives by a parameter of the edge at its ends, from there along the edge."""
        a, b = (self.x[:, [edge[end] for edge in self.cell.edges]] for end in (0, 1))
        if self.cell.order == 1:
            return b - a, a - b
        middle = 4 * self.x[:, self.cell.n_corners : self.cell.n_corners + a.shape[1]]
        return middle - 3 * a - b, middle - 3 * b - a

    @cached_property
    def lengths(self) -> Floats:
        """(edges, k): lengths of the edges; along a curved one the derivative is linear."""
        a, b = self.tangents
        if self.cell.order == 1:
            return norm(a)
        return np.asarray(sum(weight * norm((1 - at) * a - at * b) for at, weight in _GAUSS))

    @cached_property
    def directions(self) -> Floats:
        """(3, ways, k): tangents of unit length; 0 where an edge has no length."""
        a, b = self.tangents
        out = np.empty((3, 2 * a.shape[1], a.shape[2]))
        out[:, ::2] = over(a, norm(a))
        out[:, 1::2] = over(b, norm(b)) if self.cell.order == 2 else -out[:, ::2]
        return out

    @cached_property
    def normals(self) -> Floats:
        """(3, planes, k): cross products of the directions along each plane, into a solid."""
        return cross(*(self.directions[:, ways] for ways in self.corners.planes.T))

    @cached_property
    def determinants(self) -> Floats:
        """(frames, k): determinants of three directions at the corners of a solid."""
        plane, way = self.corners.frames.T
        a, b = (self.directions[:, ways] for ways in self.corners.planes[plane].T)
        return dot(cross(a, b), self.directions[:, way])

    @cached_property
    def cosines(self) -> Floats:
        """(2, k): least and largest cosine of an angle, within [-1, 1]; NaN without any."""
        if self.cell.dim == 3:
            one, other = self.corners.angles.T
            length = norm(self.normals)
            cosines = -dot(self.normals[:, one], self.normals[:, other]) / (length[one] * length[other])
        else:
            a, b = (self.directions[:, ways] for ways in self.corners.planes.T)
            cosines = np.where(dot(a, a) * dot(b, b) > 0, dot(a, b), np.nan)
        return np.clip(np.stack([np.fmin.reduce(cosines), np.fmax.reduce(cosines)]), -1.0, 1.0)


def corner_jacobian(name: str, x: Floats, plane: bool = False) -> Floats:
    """(k,): least scaled Jacobian over the corners of cells with nodes at x (k, n_nodes, 3); 1 ideal, <= 0 invalid.

    For surface cells the sign is relative to their own mean normal, or to +z if `plane`. Points and lines give 1.

    >>> float(corner_jacobian("QUAD4", np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]]))[0])
    1.0
    """
    if name not in CELLS or CELLS[name].dim < 2:
        return np.ones(len(x))
    return np.asarray(by_pieces(lambda piece: [_corner_jacobian(Shapes(name, piece, plane))], *as_points(x), 1)[0])


def own_measures(name: str, points: Floats, nodes: Ints, measures: Iterable[str]) -> dict[str, NDArray]:
    """Return some measures of `OWN`, (c,) each, of cells with `nodes` (c, n) among points (p, 3).

    >>> x, nodes = np.array(CELLS["TETRA4"].reference), np.arange(4)[None]
    >>> own_measures("TETRA4", x, nodes, ["min_dihedral", "edge_ratio"])
    {'min_dihedral': array([54.73561032]), 'edge_ratio': array([1.41421356])}
    """
    names = list(measures)

    def rows(x: Floats) -> list[NDArray]:
        cells = Shapes(name, x)
        return [OWN[measure](cells) for measure in names]

    return dict(zip(names, by_pieces(rows, points, nodes, len(names)), strict=True)) if names else {}


def _corner_jacobian(cells: Shapes) -> Floats:
    """Least determinant of the directions at a corner; of a surface, of them and the mean normal, or +z."""
    if cells.cell.dim == 3:
        least = cells.determinants.min(axis=0)
    elif cells.plane:
        least = -cells.normals[2].max(axis=0)
    else:
        mean = cells.normals.sum(axis=1)
        least = over(dot(cells.normals, mean[:, None]).min(axis=0), norm(mean))
    return np.asarray(least / _IDEAL[cells.cell.family] ** 0.5)


def _edge_ratio(cells: Shapes) -> Floats:
    """Longest edge over the shortest; infinite if an edge has no length."""
    shortest = cells.lengths.min(axis=0)
    return np.where(shortest > 0, cells.lengths.max(axis=0) / shortest, np.inf)


_LEAST_ANGLE, _LARGEST_ANGLE = (lambda cells, row=row: np.degrees(np.arccos(cells.cosines[row])) for row in (1, 0))
#: name -> the measure (k,) of some cells
OWN: Mapping[str, Callable[[Shapes], Floats]] = MappingProxyType(
    {
        "corner_jacobian": _corner_jacobian,
        "edge_ratio": _edge_ratio,
        "min_dihedral": _LEAST_ANGLE,
        "max_dihedral": _LARGEST_ANGLE,
        "min_corner_angle": _LEAST_ANGLE,
        "max_corner_angle": _LARGEST_ANGLE,
    }
)
