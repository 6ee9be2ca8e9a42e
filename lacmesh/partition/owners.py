"""Distribution of nodes over processes: recursive bisection of the coordinates, or METIS on the graph of nodes.

Bisection divides each box of nodes across its longest side, in the ratio of the processes on both sides. Berger and
Bokhari, IEEE Trans. Comput. C-36 (1987) 570-580. Coordinates are compared on a lattice that divides the longest side of
the box in 2^20, so that nodes in one plane of the model are in one plane here, wherever it lies and in whatever units.
METIS cuts few edges of the graph. Karypis and Kumar, SIAM J. Sci. Comput. 20 (1998) 359-392. It needs pymetis.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.topology.skin import cells_of_dim

#: bits of the planes of the lattice along the longest side of a box
_BITS = 20
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
    _check_count(mesh, n)
    with np.errstate(over="ignore", invalid="ignore"):
        finite = np.isfinite(np.ptp(mesh.points, axis=0)).all() if mesh.n_nodes else True
    if not finite:
        node = mesh.node_number[np.nan_to_num(np.abs(mesh.points), nan=np.inf).max(axis=1).argmax()]
        raise DataError(f"node {node} has a coordinate that is not finite, or is huge; repair or remove it")
    return bisect(np.ascontiguousarray(mesh.points.T), n)


def _check_count(mesh: Mesh, n: int) -> None:
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
        lower = _lower_points(x, len(nodes) * low // count)
        left.append((nodes[lower], np.compress(lower, x, axis=1), first, low))
        left.append((nodes[~lower], np.compress(~lower, x, axis=1), first + low, count - low))
    return box


def _lower_points(x: Floats, size: int) -> NDArray[np.bool_]:
    """Return a mask (k,) of the first `size` (>= 1) of the points x (3, k) along the longest side of their box.

    Of points in one plane across it the other coordinates decide, of points at one place their order.
    """
    corner = x.min(axis=1)
    sides = x.max(axis=1) - corner
    longest = sides.max()
    axis = int(np.argmax(sides >= (1 - _EQUAL) * longest))
    key = np.zeros(x.shape[1], np.int64)
    for k in (axis, (axis + 1) % 3, (axis + 2) % 3):
        key <<= _BITS + 1
        key += np.rint((x[k] - corner[k]) / (longest or 1.0) * 2**_BITS).astype(np.int64)
    last = np.partition(key, size - 1)[size - 1]
    lower = key < last
    lower[np.flatnonzero(key == last)[: size - np.count_nonzero(lower)]] = True
    return lower


def distribute_by_metis(mesh: Mesh, n: int) -> Ints:
    """Return the rank (n_nodes,), 0 to n - 1, that owns each node, by METIS.

    Raises RequestError if pymetis is not installed or there are fewer nodes than ranks, DataError if METIS leaves a
    rank without nodes.
    """
    try:
        import pymetis
    except ImportError:
        raise RequestError("the method metis needs pymetis: pip install 'lacmesh[metis]'") from None
    from scipy.sparse import coo_array

    _check_count(mesh, n)
    cells = list(cells_of_dim(mesh, mesh.dim))
    node = np.concatenate([np.empty(0, np.int64), *(nodes.ravel() for _, nodes, _ in cells)])
    cell = np.concatenate([np.empty(0, np.int64), *(np.repeat(index, nodes.shape[1]) for _, nodes, index in cells)])
    member = coo_array((np.ones(len(node), np.int32), (cell, node)), shape=(mesh.n_cells, mesh.n_nodes)).tocsr()
    graph = (member.T @ member).tocsr()  # nodes that share a cell of the highest dimension
    graph.setdiag(0)
    graph.eliminate_zeros()
    owner = np.asarray(pymetis.part_graph(n, xadj=graph.indptr, adjncy=graph.indices)[1], np.int32)
    count = np.bincount(owner, minlength=n)
    if not count.all():
        raise DataError(f"METIS leaves {np.count_nonzero(count == 0)} of {n} parts without nodes; ask for fewer parts")
    return owner
