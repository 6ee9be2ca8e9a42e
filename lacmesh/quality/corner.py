"""The corner Jacobian: one number for the quality of a cell, scaled for each type to 1 for its ideal cell.

At a corner the tangents of the edges are normalised and their determinant is computed (Knupp, Int. J. Numer. Meth.
Engng 48, 2000); the ideal cells are the equilateral triangle and tetrahedron, the square and the cube, the prism with
an equilateral base and the pyramid with equilateral sides. At a pyramid's apex, where four edges meet, each set of
three consecutive edges counts; for the ideal pyramid they give the same value as the corners of the base. The tangents
of a quadratic cell are those of its curved edges.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints, Mesh

#: family -> the determinant at a corner of its ideal cell
IDEAL = {
    "TRIA": np.sqrt(3) / 2,
    "QUAD": 1.0,
    "TETRA": np.sqrt(0.5),
    "HEXA": 1.0,
    "PENTA": np.sqrt(3) / 2,
    "PYRAM": np.sqrt(0.5),
}
_PIECE = 1 << 13


@cache
def frames(name: str) -> Ints:
    """(corners, dim): the edges that leave each corner, in right-handed order; 2 e + s is edge e from its end s.

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


@cache
def _tangents(name: str) -> NDArray:
    """(corners, dim, n_nodes): weights of the nodes in the tangents of the edges in `frames`."""
    return np.array([[_weights(name, *divmod(way, 2)) for way in row] for row in frames(name).tolist()])


def _weights(name: str, edge: int, end: int) -> NDArray:
    """(n_nodes,): weights of the nodes in the derivative of an edge at one of its ends, by a parameter in [0, 1]."""
    cell = CELLS[name]
    start, end = cell.edges[edge][end], cell.edges[edge][1 - end]
    out = np.zeros(cell.n_nodes)
    out[[start, end]] = (-1, 1) if cell.order == 1 else (-3, -1)
    if cell.order == 2:
        out[cell.n_corners + edge] = 4
    return out


def corner_jacobian(name: str, x: Floats, plane: bool = False) -> Floats:
    """(k,): least scaled Jacobian over the corners of cells with nodes at x (k, n_nodes, 3); 1 ideal, <= 0 invalid.

    For surface cells the sign is relative to their own mean normal, or to +z if `plane`. Points and lines give 1.

    >>> float(corner_jacobian("QUAD4", np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]]))[0])
    1.0
    """
    cell = CELLS.get(name)
    if cell is None or cell.dim < 2:
        return np.ones(len(x))
    out = np.empty(len(x))
    for start in range(0, len(x), _PIECE):
        piece = x[start : start + _PIECE]
        if cell.dim == 3:
            corners = [_volume(_unit(weights @ piece)) for weights in _tangents(name)]
        else:
            corners = _areas([_unit(weights @ piece) for weights in _tangents(name)], plane)
        out[start : start + _PIECE] = np.min(corners, axis=0) / IDEAL[cell.family]
    return out


def _unit(t: NDArray) -> NDArray:
    """Normalise tangents (k, dim, 3); those without length stay zero."""
    size = np.sqrt((t * t).sum(axis=-1, keepdims=True))
    return np.divide(t, size, out=np.zeros_like(t), where=size > 0)


def _cross(a: NDArray, b: NDArray) -> NDArray:
    """(3, k): cross products of vectors (k, 3); np.cross is several times slower for many vectors."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _volume(t: NDArray) -> NDArray:
    return (_cross(t[:, 0], t[:, 1]) * t[:, 2].T).sum(axis=0)


def _areas(tangents: list[NDArray], plane: bool) -> list[NDArray]:
    normals = [_cross(t[:, 0], t[:, 1]) for t in tangents]
    if plane:
        return [n[2] for n in normals]
    mean = _unit(np.sum(normals, axis=0).T[:, None])[:, 0].T
    return [(n * mean).sum(axis=0) for n in normals]


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
