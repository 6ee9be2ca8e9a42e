"""Connected components of a graph."""

from __future__ import annotations

import numpy as np

from lacmesh.mesh import Ints

#: nodes and edges from which on scipy is quicker, with the tenth of a second that importing it takes
_MANY = 60_000


def label_components(i: Ints, j: Ints, n: int) -> Ints:
    """(n,): the connected component of each of n nodes, joined by edges from i (e,) to j (e,); numbered by first nodes.

    >>> label_components(np.array([0, 3]), np.array([2, 1]), 5)
    array([0, 1, 0, 1, 2])
    """
    if n + len(i) > _MANY:
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        graph = coo_matrix((np.ones(len(i), bool), (i, j)), shape=(n, n))
        return np.asarray(connected_components(graph, directed=False)[1], np.int64)
    first = list(range(n))  # on the way to the first node of the component
    for a, b in zip(i.tolist(), j.tolist(), strict=True):
        a, b = _root(first, a), _root(first, b)
        first[max(a, b)] = min(a, b)
    return np.unique([_root(first, a) for a in range(n)], return_inverse=True)[1]


def _root(first: list[int], a: int) -> int:
    while first[a] != a:
        first[a] = first[first[a]]
        a = first[a]
    return a
