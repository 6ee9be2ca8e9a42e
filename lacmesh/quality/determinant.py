"""Validity: the Jacobian determinant of a cell's map, where solvers evaluate it. A cell is invalid where it is <= 0.

It is computed at the corners, at the other nodes (mid-nodes, centres), and at the common integration points: 2 per
direction for lines, quadrangles and hexahedra, 2 and 3 for quadratic ones; 1 for a triangle, 3, 6 and 7 for a quadratic
one; 1 for a tetrahedron, 4 and 14 for a quadratic one; 3 by 2 for a prism, and 7 by 3; conical products for pyramids.
These sets are symmetric, so that the order in which a cell lists its nodes does not matter. The determinant of a
surface cell is the component of its normal along the cell's mean normal, that of a line the component of its tangent
along the mean tangent. These are samples, not a bound: between them the determinant may be lower.

At a pyramid's apex the gradient depends on the direction of approach; its limits along the four edges that meet there
are used. On a ray x = u w, y = v w, w = 1 - z the gradient is linear in w (constant for PYRAM5, whose base corners
therefore give the same value), so that the limit is exactly 2 g(w) - g(2 w).

Notation: dN (p, n, dim) gradients of the shape functions at p samples.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient
from lacmesh.reference.vectors import determinants
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
