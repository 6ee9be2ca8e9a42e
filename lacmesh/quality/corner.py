"""Measures at the corners of every cell of dimension 2 and 3, linear or curved: corner Jacobian, edge ratio, angles.

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

Notation: a *way* 2 e + s runs along edge e from its end s; t (ways, 3) are the tangents of the ways.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.quality.vectors import PIECE, choose, cross, dot, in_columns, nodes_first, norm, over

#: family -> the determinant at a corner of its ideal cell
IDEAL = {
    "TRIA": np.sqrt(3) / 2,
    "QUAD": 1.0,
    "TETRA": np.sqrt(0.5),
    "HEXA": 1.0,
    "PENTA": np.sqrt(3) / 2,
    "PYRAM": np.sqrt(0.5),
}
#: points and weights that measure a curved edge, on [0, 1] (Gauss, 3 points)
_GAUSS_AT = 0.5 + np.sqrt(0.15) * np.array([-1, 0, 1])
_GAUSS_WEIGHT = np.array([5, 8, 5]) / 18


class Corners(NamedTuple):
    """Corners of a cell type. `edges` (e, 2): their ends; `mid`: place of the first mid-node, 0 if they are straight.

    `frames` (corners, dim): the ways that leave each corner. `angles` (a, 3): -1 and two ways out of a corner of a
    surface cell; of a solid a way along an edge, and those along the next edges of the two facets that meet there.
    """

    edges: Ints
    mid: int
    frames: Ints
    angles: Ints


@cache
def corners_of(name: str) -> Corners:
    """Return the corners of a cell type."""
    cell = CELLS[name]
    mid = cell.n_corners if cell.order == 2 else 0
    return Corners(np.array(cell.edges), mid, _frames(name), _angles_of(name))


def _angles_of(name: str) -> Ints:
    cell = CELLS[name]
    way = {ends: 2 * k + s for k, edge in enumerate(cell.edges) for s, ends in enumerate((edge, edge[::-1]))}
    if cell.dim == 2:
        circles = [tuple(range(cell.n_corners))]
    else:
        circles = [f.nodes[: CELLS[CELLS[f.type].linear].n_corners] for f in cell.facets]
    pairs = [(way[t[k], t[k - 1]], way[t[k], t[(k + 1) % len(t)]]) for t in circles for k in range(len(t))]
    if cell.dim == 2:
        return np.array([(-1, *pair) for pair in pairs])
    beside: dict[int, list[int]] = {}
    for a, b in pairs:
        beside.setdefault(a, []).append(b)
        beside.setdefault(b, []).append(a)
    return np.array([(along, *others) for along, others in beside.items() if len(others) == 2])


def _frames(name: str) -> Ints:
    """(corners, dim): the ways that leave each corner, in right-handed order.

    An apex counts four times, each time without one of its edges.
    """
    cell = CELLS[name]
    ref = np.array(cell.reference)
    rows = []
    for c in range(cell.n_corners):
        ways = [2 * k + edge.index(c) for k, edge in enumerate(cell.edges) if c in edge]
        for some in combinations(ways, cell.dim):
            along = [ref[cell.edges[way // 2][1 - way % 2]] - ref[c] for way in some]
            rows.append((some[1], some[0], *some[2:]) if np.linalg.det(along) < 0 else some)
    return np.array(rows)


def corner_jacobian(name: str, x: Floats, plane: bool = False) -> Floats:
    """(k,): least scaled Jacobian over the corners of cells with nodes at x (k, n_nodes, 3); 1 ideal, <= 0 invalid.

    For surface cells the sign is relative to their own mean normal, or to +z if `plane`. Points and lines give 1.

    >>> float(corner_jacobian("QUAD4", np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]]))[0])
    1.0
    """
    cell = CELLS.get(name)
    if cell is None or cell.dim < 2:
        return np.ones(len(x))
    edges, mid, frames, _ = corners_of(name)
    out = np.empty(len(x))
    for start in range(0, len(x), PIECE):
        piece = slice(start, start + PIECE)
        points = nodes_first(x[piece])
        t = np.empty((2 * len(edges), *points.shape[1:]))
        _tangents.py_func(points, np.arange(cell.n_nodes), edges, mid, t)
        out[piece] = _least_jacobian.py_func(t, frames, plane)
    return out / IDEAL[cell.family]


def corner_measures(name: str, points: Floats, nodes: Ints) -> Floats:
    """(4, c): corner Jacobian, edge ratio, least and largest angle of cells with `nodes` (c, n) among points (p, 3).

    >>> x, nodes = np.array(CELLS["TETRA4"].reference), np.arange(4)[None]
    >>> [round(float(value), 6) for value in corner_measures("TETRA4", x, nodes)[:, 0]]
    [0.707107, 1.414214, 54.73561, 90.0]
    """
    out = in_columns(_corners, points, nodes, 4, *corners_of(name))
    out[0] /= IDEAL[CELLS[name].family]
    return out


@kernel
def _corners(points: Any, nodes: Any, edges: Any, mid: int, frames: Any, angles: Any, out: Any) -> None:
    """Write the `corner_measures` of each cell into a row of `out`; the corner Jacobian is not scaled."""
    t = np.empty((2 * len(edges),) + points.shape[1:])  # noqa: RUF005 (numba unpacks no tuple here)
    for cell in range(len(nodes)):
        _tangents(points, nodes[cell], edges, mid, t)
        out[cell, 1] = _edge_ratio(t, mid > 0)
        out[cell, 2], out[cell, 3] = _angles(t, angles)
        out[cell, 0] = _least_jacobian(t, frames, False)


@kernel
def _tangents(points: Any, row: Any, edges: Any, mid: int, t: Any) -> None:
    """Write the tangents of all ways into t, as derivatives by a parameter of the edge; a straight edge is its own."""
    for e in range(len(edges)):
        i, j = row[edges[e, 0]], row[edges[e, 1]]
        for s in range(3):
            if mid:
                middle = 4 * points[row[mid + e], s]
                t[2 * e, s] = middle - 3 * points[i, s] - points[j, s]
                t[2 * e + 1, s] = middle - 3 * points[j, s] - points[i, s]
            else:
                t[2 * e, s] = points[j, s] - points[i, s]
                t[2 * e + 1, s] = -t[2 * e, s]


@kernel
def _edge_ratio(t: Any, curved: bool) -> Any:
    """Longest edge over the shortest; infinite if an edge has no length."""
    shortest, longest = np.inf, 0.0
    for e in range(len(t) // 2):
        length = _length(t[2 * e], t[2 * e + 1]) if curved else norm(t[2 * e])
        shortest, longest = np.minimum(shortest, length), np.maximum(longest, length)
    return choose(shortest > 0, longest / shortest, np.inf)


@kernel
def _length(a: Any, b: Any) -> Any:
    """Length of a curved edge with tangents a and b at its ends; along it the derivative is linear, from a to -b."""
    length = 0.0
    for g in range(3):
        near, far = 1 - _GAUSS_AT[g], _GAUSS_AT[g]
        length = length + _GAUSS_WEIGHT[g] * norm(
            (near * a[0] - far * b[0], near * a[1] - far * b[1], near * a[2] - far * b[2])
        )
    return length


@kernel
def _angles(t: Any, angles: Any) -> Any:
    """Least and largest angle in degrees."""
    low, high = np.inf, -np.inf  # of the cosines
    for k in range(len(angles)):
        along, i, j = angles[k, 0], angles[k, 1], angles[k, 2]
        a, b = (t[i, 0], t[i, 1], t[i, 2]), (t[j, 0], t[j, 1], t[j, 2])
        if along >= 0:
            a, b = cross(t[along], a), cross(t[along], b)
        square = dot(a, a) * dot(b, b)
        cosine = choose(square > 0, dot(a, b) / np.sqrt(square), np.nan)
        low, high = np.fmin(low, cosine), np.fmax(high, cosine)
    known = low <= high
    least, largest = np.minimum(np.maximum(high, -1.0), 1.0), np.minimum(np.maximum(low, -1.0), 1.0)
    return (
        choose(known, np.degrees(np.arccos(least)), np.nan),
        choose(known, np.degrees(np.arccos(largest)), np.nan),
    )


@kernel
def _least_jacobian(t: Any, frames: Any, plane: bool) -> Any:
    """Least determinant of the normalised tangents of a corner; of a surface, of them and the mean normal, or +z."""
    for k in range(len(t)):
        length = norm(t[k])
        for s in range(3):
            t[k, s] = over(t[k, s], length)
    least = np.inf
    x, y, z = 0.0, 0.0, 0.0
    for k in range(len(frames)):
        normal = cross(t[frames[k, 0]], t[frames[k, 1]])
        if frames.shape[1] == 3:
            least = np.minimum(least, dot(normal, t[frames[k, 2]]))
        else:
            x, y, z = x + normal[0], y + normal[1], z + normal[2]
    if frames.shape[1] == 3:
        return least
    if plane:
        x, y, z = 0.0, 0.0, 1.0
    for k in range(len(frames)):
        normal = cross(t[frames[k, 0]], t[frames[k, 1]])
        least = np.minimum(least, dot(normal, (x, y, z)))
    return over(least, norm((x, y, z)))


def worst(mesh: Mesh, cells: Ints) -> float:
    """Least corner Jacobian of some cells of a mesh; NaN if there are none to measure.

    Cells of a plane mesh are measured relative to their own orientation, because many meshes list them clockwise.
    """
    least = [
        corner_jacobian(kind, mesh.points[nodes]).min()
        for kind, _, nodes in mesh.select(cells)
        if kind in CELLS and CELLS[kind].dim > 1
    ]
    return float(min(least)) if least else float("nan")
