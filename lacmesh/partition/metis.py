"""Distribution of nodes over processes by METIS, which cuts few edges of the graph of nodes that share a cell.

Karypis and Kumar, SIAM J. Sci. Comput. 20 (1998) 359-392. Needs pymetis.
"""

from __future__ import annotations

import numpy as np

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Ints, Mesh
from lacmesh.partition.bisection import check_count
from lacmesh.topology.skin import cells_of_dim


def distribute_by_metis(mesh: Mesh, n: int) -> Ints:
    """Return the rank (n_nodes,), 0 to n - 1, that owns each node, by METIS.

    Raises RequestError if pymetis is not installed or there are fewer nodes than ranks, DataError if METIS leaves a
    rank without nodes.
    """
    try:
        import pymetis
    except ImportError:
        raise RequestError("the method metis needs pymetis: pip install 'lacmesh[metis]'") from None
    check_count(mesh, n)
    start, neighbour = _graph(mesh)
    owner = np.asarray(pymetis.part_graph(n, xadj=start, adjncy=neighbour)[1], np.int32)
    count = np.bincount(owner, minlength=n)
    if not count.all():
        raise DataError(f"METIS leaves {np.count_nonzero(count == 0)} of {n} parts without nodes; ask for fewer parts")
    return owner


def _graph(mesh: Mesh) -> tuple[Ints, Ints]:
    """Return the graph of nodes that share a cell of the highest dimension: (start (n_nodes + 1,), neighbours)."""
    from scipy.sparse import coo_array

    node: list[Ints] = [np.empty(0, np.int64)]
    cell: list[Ints] = [np.empty(0, np.int64)]
    for _, nodes, index in cells_of_dim(mesh, mesh.dim):
        node.append(nodes.ravel())
        cell.append(np.repeat(index, nodes.shape[1]))
    pairs = np.concatenate(cell), np.concatenate(node)
    member = coo_array((np.ones(len(pairs[0]), np.int32), pairs), shape=(mesh.n_cells, mesh.n_nodes)).tocsr()
    shared = (member.T @ member).tocsr()
    shared.setdiag(0)
    shared.eliminate_zeros()
    return shared.indptr, shared.indices
