"""Distribution of nodes over processes by recursive coordinate bisection.

Each box of nodes is divided across its longest side, in the ratio of the processes on both sides. Berger and Bokhari,
IEEE Trans. Comput. C-36 (1987) 570-580. Coordinates are compared on a lattice that divides the longest side of the box
in 2^20, so that nodes in one plane of the model are in one plane here, wherever the model lies and in whatever units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.communicator import SERIAL, Communicator
from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints, Mesh

Bools = NDArray[np.bool_]
#: planes of the lattice along the longest side of a box
_PLANES = 2**20
#: two sides whose lengths differ by less are of one length, relative to the longer one
_EQUAL = 1e-6
#: bits of a digit of a plane, and the number of digits below the highest one
_BITS, _DIGITS = 7, 2


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
    return distribute_points(mesh.points, mesh.node_number, n)


def distribute_points(points: Floats, number: Ints, n: int, comm: Communicator = SERIAL) -> Ints:
    """Return the rank (k,) that owns each of the points (k, 3) that this process has.

    `number` (k,): how messages name them. Raises DataError for coordinates that are not finite.
    """
    x = np.ascontiguousarray(points.T)
    _check_finite(x, number, comm)
    return bisect(x, n, comm)


def check_count(mesh: Mesh, n: int) -> None:
    """Raise RequestError unless a mesh can have n parts."""
    if not 1 <= n <= max(mesh.n_nodes, 1):
        raise RequestError(f"a mesh of {mesh.n_nodes:,} nodes has from 1 to {mesh.n_nodes:,} parts, not {n:,}")


def bisect(x: Floats, n: int, comm: Communicator = SERIAL) -> Ints:
    """Return the box (k,), 0 to n - 1, that each of the points x (3, k) belongs to.

    Of several processes each gives its own points, in the order of all, and gets their boxes.
    """
    box = np.zeros(x.shape[1], np.int32)
    left = [(np.arange(x.shape[1]), x, int(comm.total(np.array(x.shape[1]))), 0, n)]
    while left:
        nodes, x, size, first, count = left.pop()
        if count == 1:
            box[nodes] = first
            continue
        low = count // 2
        below = size * low // count
        lower = _come_first(x, below, comm)
        left.append((nodes[lower], np.compress(lower, x, axis=1), below, first, low))
        left.append((nodes[~lower], np.compress(~lower, x, axis=1), size - below, first + low, count - low))
    return box


def _come_first(x: Floats, size: int, comm: Communicator) -> Bools:
    """Return a mask (k,) of the first `size` (>= 1) of the points x (3, k) along the longest side of their box.

    Of points in one plane across it the other coordinates decide, of points at one place their order.
    """
    corner, upper = extent(x, comm)
    sides = upper - corner
    longest = sides.max()
    axis = int(np.argmax(sides >= (1 - _EQUAL) * longest))
    first = np.zeros(x.shape[1], bool)
    tied: Ints = np.arange(x.shape[1])
    for k in (axis, (axis + 1) % 3, (axis + 2) % 3):
        plane = np.rint((x[k, tied] - corner[k]) / (longest or 1.0) * _PLANES).astype(np.int32)
        last, size = _nth(plane, size, comm)
        first[tied[plane < last]] = True
        tied = tied[plane == last]
    first[tied[: max(size - comm.before(len(tied)), 0)]] = True
    return first


def extent(x: Floats, comm: Communicator) -> tuple[Floats, Floats]:
    """Return the lower and the upper corner (3,) of the box of the points x (3, k) of all processes."""
    ends = np.stack([-x.min(axis=1, initial=np.inf), x.max(axis=1, initial=-np.inf)])
    least, upper = comm.greatest(ends)
    return -least, upper


def _nth(plane: Ints, n: int, comm: Communicator) -> tuple[int, int]:
    """Return the n-th smallest (n >= 1) of the planes (k,) of all processes, and n less the number of smaller ones.

    The counts of each digit are added up, from the highest to the lowest: few numbers, however many planes there are.
    """
    key = 0
    for shift in range(_DIGITS * _BITS, -1, -_BITS):
        digit = plane >> shift
        count = np.cumsum(comm.total(np.bincount(digit, minlength=1 << _BITS)))
        last = int(np.searchsorted(count, n))
        n -= int(count[last - 1]) if last else 0
        key += last << shift
        plane = plane[digit == last] & ((1 << shift) - 1)
    return key, n


def _check_finite(x: Floats, number: Ints, comm: Communicator) -> None:
    """Raise DataError if one of the points x (3, k) has no place, or all of them no finite extent."""
    with np.errstate(over="ignore", invalid="ignore"):
        lower, upper = extent(x, comm)
        finite = np.isfinite(upper - lower).all()
    if not finite and int(comm.total(np.array(x.shape[1]))):
        far = np.nan_to_num(np.abs(x), nan=np.inf).max(axis=0, initial=0.0)
        farthest = far.max(initial=0.0)
        here = farthest == comm.greatest(np.array(farthest)) and len(far) > 0
        node = int(comm.greatest(np.array(number[far.argmax()] if here else -1, np.int64)))
        raise DataError(f"node {node} has a coordinate that is not finite, or is huge; repair or remove it")
