"""Distribution of nodes over processes by recursive coordinate bisection.

Each box of nodes is divided across its longest side, in the ratio of the processes on both sides. Berger and Bokhari,
IEEE Trans. Comput. C-36 (1987) 570-580. Coordinates are compared on a lattice that divides the longest side of the box
in 2^20, so that nodes in one plane of the model are in one plane here, wherever the model lies and in whatever units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints, Mesh

Bools = NDArray[np.bool_]
#: planes of the lattice along the longest side of a box
_PLANES = 2**20
#: two sides whose lengths differ by less are of one length, relative to the longer one
_EQUAL = 1e-6


def distribute_nodes(mesh: Mesh, n: int) -> Ints:
    """Return the rank (n_nodes,), 0 to n - 1, that owns each node, so that all ranks own about as many nodes.

    All nodes are distributed together, whatever body they belong to, and those of no cell too; the result does not
    depend on the position or the units of the model. Nodes at one place are taken in the order of the mesh. Raises
    RequestError if there are fewer nodes than ranks, DataError for coordinates that are not finite.

    >>> row = Mesh.create([[0, 0], [4, 0], [1, 0], [3, 0], [2, 0]], [("POI1", [[0]])])
    >>> distribute_nodes(row, 2)
    array([0, 1, 0, 1, 1], dtype=int32)
    """
    check_count(mesh, n)
    x = np.ascontiguousarray(mesh.points.T)
    _check_finite(mesh, x)
    return bisect(x, n)


def check_count(mesh: Mesh, n: int) -> None:
    """Raise RequestError unless a mesh can have n parts."""
    if not 1 <= n <= max(mesh.n_nodes, 1):
        raise RequestError(f"a mesh of {mesh.n_nodes:,} nodes has from 1 to {mesh.n_nodes:,} parts, not {n:,}")


def bisect(x: Floats, n: int) -> Ints:
    """Return the box (k,), 0 to n - 1, that each of the points x (3, k) belongs to."""
    box = np.zeros(x.shape[1], np.int32)
    left = [(np.arange(x.shape[1]), x, 0, n)]
    while left:
        nodes, x, first, count = left.pop()
        if count == 1:
            box[nodes] = first
            continue
        low = count // 2
        lower = _come_first(x, len(nodes) * low // count)
        left.append((nodes[lower], np.compress(lower, x, axis=1), first, low))
        left.append((nodes[~lower], np.compress(~lower, x, axis=1), first + low, count - low))
    return box


def _come_first(x: Floats, size: int) -> Bools:
    """Return a mask (k,) of the first `size` (>= 1) of the points x (3, k) along the longest side of their box.

    Of points in one plane across it the other coordinates decide, of points at one place their order.
    """
    corner, sides = x.min(axis=1), np.ptp(x, axis=1)
    longest = sides.max()
    axis = int(np.argmax(sides >= (1 - _EQUAL) * longest))
    first = np.zeros(x.shape[1], bool)
    tied: Ints = np.arange(x.shape[1])
    for k in (axis, (axis + 1) % 3, (axis + 2) % 3):
        plane = np.rint((x[k, tied] - corner[k]) / (longest or 1.0) * _PLANES).astype(np.int32)
        last = np.partition(plane, size - 1)[size - 1]
        before = tied[plane < last]
        first[before] = True
        size -= len(before)
        tied = tied[plane == last]
    first[tied[:size]] = True
    return first


def _check_finite(mesh: Mesh, x: Floats) -> None:
    """Raise DataError if a node of a mesh, at x (3, n_nodes), has no place, or the model no finite size."""
    with np.errstate(over="ignore", invalid="ignore"):
        finite = not mesh.n_nodes or np.isfinite(np.ptp(x, axis=1)).all()
    if not finite:
        far = np.nan_to_num(np.abs(mesh.points), nan=np.inf).max(axis=1)
        number = mesh.node_number[int(far.argmax())]
        raise DataError(f"node {number} has a coordinate that is not finite, or is huge; repair or remove it")
