"""Measures that lacmesh computes: validity, the least Jacobian determinant; corner Jacobian, edge ratio, angles.

A cell is invalid where the Jacobian determinant of its map is <= 0. Validity is computed at the corners, at the other
nodes (mid-nodes, centres), and at the common integration points: 2 per direction for lines, quadrangles and hexahedra,
2 and 3 for quadratic ones; 1 for a triangle, 3, 6 and 7 for a quadratic one; 1 for a tetrahedron, 4 and 14 for a
quadratic one; 3 by 2 for a prism, and 7 by 3; conical products for pyramids.
These sets are symmetric, so that the order in which a cell lists its nodes does not matter. The determinant of a
surface cell is the component of its normal along the cell's mean normal, that of a line the component of its tangent
along the mean tangent. These are samples, not a bound: between them the determinant may be lower.

At a pyramid's apex the gradient depends on the direction of approach; its limits along the four edges that meet there
are used. On a ray x = u w, y = v w, w = 1 - z the gradient is linear in w (constant for PYRAM5, whose base corners
therefore give the same value), so that the limit is exactly 2 g(w) - g(2 w).

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

Notation: dN (p, n, dim) gradients of the shape functions at p samples; a *way* 2 e + s runs along edge e from its end
s; x (3, n, k) are the nodes of k cells. Vectors have their components first, arrays (3, ...), so that each component is
contiguous: numpy's own functions take them along the last axis, which takes several times as long for many of them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from functools import cache, cached_property
from itertools import combinations, pairwise
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient
from lacmesh.threads import in_threads

#: (family, order) -> degrees of the rules in use; 3 points a direction integrate to degree 5, 2 to degree 3
_DEGREES = {
    ("TRIA", 1): (1,),
    ("TRIA", 2): (2, 4, 5),
    ("TETRA", 1): (1,),
    ("TETRA", 2): (2, 5),
    ("PENTA", 1): (2,),
    ("PENTA", 2): (2, 5),
}
#: round-off of a determinant, in units of the largest coordinate times the cell's extent to the power dim - 1
_ROUND_OFF = 32 * np.finfo(float).eps
#: numbers of nodes at a time, so that what is computed of a piece of the cells stays in the cache
_PIECE = 1 << 11


class Validity(NamedTuple):
    """Least determinants (k,) at the corners, at the other nodes, at the integration points; see `validity`.

    A linear cell has no other nodes: the value at its corners is repeated there.
    """

    corner: Floats
    node: Floats
    point: Floats

    @property
    def least(self) -> Floats:
        """(k,): the least over all samples."""
        return np.minimum(np.minimum(self.corner, self.node), self.point)


def validity(name: str, x: Floats, plane: bool = False) -> Floats:
    """(k,): least Jacobian determinant over corners, mid-nodes and integration points of cells at x (k, n_nodes, 3).

    It is relative to the mean of its absolute value over the integration points: 1 for a parallelepiped or a straight
    simplex, -1 for an inverted one, 0 for values within round-off of zero. The cell is valid if this is positive (NaN
    coordinates give NaN). `plane`: surface cells are measured relative to +z, not to their own mean normal. Points, and
    cells of higher order than 2, give 1.

    >>> x = np.array([CELLS["TETRA10"].reference])
    >>> round(float(validity("TETRA10", x)[0]), 12)
    1.0
    >>> x[0, 4] = [0.2, 0, 0]  # a mid-node beyond the quarter of its edge
    >>> bool(validity("TETRA10", x)[0] < 0)
    True
    """
    return validity_at(name, x, plane).least


def validity_at(name: str, x: Floats, plane: bool = False) -> Validity:
    """Compute `validity` separately for the corners, the other nodes and the integration points."""
    return validity_among(name, *as_points(x), plane)


def validity_of(mesh: Mesh, cells: Ints | None = None) -> Floats:
    """(k,): `validity` of some cells of a mesh, or of all; surface cells relative to their own normal."""
    chosen = np.arange(mesh.n_cells) if cells is None else np.asarray(cells)
    by_cell = np.ones(mesh.n_cells)
    for kind, which, nodes in mesh.select(chosen):
        by_cell[which] = validity_among(kind, mesh.points, nodes).least
    return by_cell[chosen]


def validity_among(name: str, points: Floats, nodes: Ints, plane: bool = False) -> Validity:
    """Compute `validity_at` for cells with `nodes` (k, n) among `points` (p, 3)."""
    if name not in CELLS or not CELLS[name].dim:
        return Validity(*np.ones((3, len(nodes))))
    dN, places = _samples(name)
    return Validity(*by_pieces(lambda x: _least(dN, places, x, plane), points, nodes, 3))


def as_points(x: Floats) -> tuple[Floats, Ints]:
    """Points (k n, 3) and nodes (k, n) of cells with nodes at x (k, n, 3)."""
    k, n = np.shape(x)[:2]
    return np.asarray(x, dtype=float).reshape(-1, 3), np.arange(k * n).reshape(k, n)


def by_pieces(measure: Callable[[Floats], Any], points: Floats, nodes: Ints, rows: int) -> NDArray:
    """(rows, c): what `measure` gives for cells with `nodes` (c, n) among `points` (p, 3), a few cells at a time.

    `measure` takes the nodes x (3, n, k) of some cells, and returns so many arrays (k,). It runs in threads.
    """
    out = np.empty((rows, len(nodes)))
    size = max(1, _PIECE // nodes.shape[1])

    def run(part: slice) -> None:
        with np.errstate(all="ignore"):
            for start in range(part.start, part.stop, size):
                piece = slice(start, min(start + size, part.stop))
                out[:, piece] = measure(np.ascontiguousarray(points[nodes[piece]].transpose(2, 1, 0)))

    in_threads(run, len(nodes))
    return out


def _least(dN: NDArray, places: tuple[Ints, Ints, Ints], x: Floats, plane: bool) -> NDArray:
    """(3, k): the rows of a `Validity` for cells at x (3, n, k)."""
    det = determinants(dN, x, places[2], plane)
    extent = (x.max(axis=1) - x.min(axis=1)).max(axis=0)
    nothing = _ROUND_OFF * np.abs(x).max(axis=(0, 1)) * extent ** (dN.shape[2] - 1)
    mean = np.abs(det[places[2]]).mean(axis=0)
    least = np.stack([det[rows].min(axis=0) for rows in places])
    least[np.abs(least) <= nothing] = 0
    return np.divide(least, mean, out=least, where=least != 0)


@cache
def _samples(name: str) -> tuple[NDArray, tuple[Ints, Ints, Ints]]:
    """dN (p, n, dim) at the samples, equal ones once; indices of corners, other nodes and integration points."""
    cell = CELLS[name]
    nodes = np.array(cell.reference)
    apex = cell.family == "PYRAM"
    degrees = _DEGREES.get((cell.family, cell.order)) or ((3,) if cell.order == 1 else (3, 5))
    inner = np.concatenate([rule(cell.family, degree)[0] for degree in degrees])
    corner = nodes[: 4 if apex else cell.n_corners]
    parts = [gradient(name, corner), gradient(name, nodes[cell.n_corners :]), gradient(name, inner)]
    if apex:
        rays = np.array([(u, v) for u in (-1, 1) for v in (-1, 1)])
        near, far = (gradient(name, np.column_stack([rays * w, np.full(4, 1 - w)])) for w in (0.25, 0.5))
        parts[0] = np.concatenate([parts[0], 2 * near - far])
    ends = np.cumsum([0, *(len(g) for g in parts)])
    all_rows = np.concatenate(parts)
    _, first, same = np.unique(np.round(all_rows, 12), axis=0, return_index=True, return_inverse=True)
    corners, others, inside = (np.unique(same.ravel()[a:b]) for a, b in pairwise(ends))
    return all_rows[first], (corners, others if len(others) else corners, inside)


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
        circles = [facet.corners for facet in cell.facets]
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
        plane, way = cells.corners.frames.T
        a, b = (cells.directions[:, ways] for ways in cells.corners.planes[plane].T)
        least = dot(cross(a, b), cells.directions[:, way]).min(axis=0)
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


def dot(a: Floats, b: Floats) -> NDArray[np.floating]:
    """Inner products (...) of vectors (3, ...)."""
    out = np.asarray(a[0] * b[0])
    out += a[1] * b[1]
    out += a[2] * b[2]
    return out


def norm(a: Floats) -> NDArray[np.floating]:
    """Lengths (...) of vectors (3, ...)."""
    return np.asarray(np.sqrt(dot(a, a)))


def cross(a: Floats, b: Floats) -> Floats:
    """Cross products (3, ...) of vectors (3, ...)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for s, t, u in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[t], b[u], out=out[s])
        out[s] -= a[u] * b[t]
    return out


def over(a: NDArray, b: NDArray) -> NDArray:
    """a / b, and a where b is 0."""
    return np.asarray(a / (b + (b == 0)))


def determinants(dN: NDArray, x: Floats, inside: NDArray[np.integer], plane: bool = False) -> NDArray[np.floating]:
    """(p, k): Jacobian determinants of cells with nodes x (3, n, k), at p points with gradients dN (p, n, dim).

    That of a surface is the component of its normal along the mean of the normals at the points `inside`, or along +z
    if `plane`; that of a line is the component of its tangent along the mean tangent.
    """
    p, n, dim = dN.shape
    J = (dN.transpose(2, 0, 1).reshape(dim * p, n) @ x).reshape(3, dim, p, -1).transpose(1, 0, 2, 3)
    if dim == 3:
        return dot(J[0], cross(J[1], J[2]))
    along = J[0] if dim == 1 else cross(J[0], J[1])
    if dim == 2 and plane:
        return np.asarray(along[2])
    mean = along[:, inside].sum(axis=1)
    return dot(along, over(mean, norm(mean))[:, None])
