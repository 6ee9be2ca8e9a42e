"""Sparsity pattern of the stiffness in block-CSR form: pairs of nodes that share a cell.

The pattern depends on the mesh alone. It is built once, and values are written into it whenever the tangent changes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Ints


class Pattern(NamedTuple):
    """Block rows of nodes: row i holds the nodes `indices[indptr[i]:indptr[i + 1]]`, ascending, i itself among them.

    A node of no cell has an empty row.
    """

    indptr: Ints
    indices: Ints


def node_pattern(cells: Iterable[Ints], n_nodes: int) -> Pattern:
    """Return the pattern of cells given as arrays of nodes (k, n), one array per type.

    >>> node_pattern([np.array([[0, 2], [2, 1]])], 4)
    Pattern(indptr=array([0, 2, 4, 7, 7], dtype=int32), indices=array([0, 2, 1, 2, 0, 1, 2], dtype=int32))
    """
    cells = list(cells)
    nodes = np.concatenate([np.empty(0, np.int32), *(c.ravel() for c in cells)]).astype(np.int32)
    sizes = np.repeat([c.shape[1] for c in cells], [len(c) for c in cells]).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(sizes)])
    indptr, indices = symbolic(first, nodes, n_nodes)
    if len(indices) <= np.iinfo(np.int32).max:  # scipy wants one type for both
        return Pattern(indptr.astype(np.int32), indices)
    return Pattern(indptr, indices.astype(np.int64))


@kernel
def cells_of_nodes(first: Any, nodes: Any, n_nodes: int) -> Any:
    """Return the cells of each node, ascending: starts (n_nodes + 1,) and cells.

    Cell e has the nodes nodes[first[e]:first[e + 1]].
    """
    start = np.zeros(n_nodes + 2, np.int64)
    for k in range(len(nodes)):
        start[nodes[k] + 2] += 1
    for i in range(n_nodes):
        start[i + 2] += start[i + 1]
    cells = np.empty(len(nodes), np.int32)
    for e in range(len(first) - 1):
        for k in range(first[e], first[e + 1]):
            i = nodes[k]
            cells[start[i + 1]] = e
            start[i + 1] += 1
    return start[:-1], cells


@kernel
def symbolic(first: Any, nodes: Any, n_nodes: int) -> Any:
    """Return the row starts (n_nodes + 1,), int64, and the ascending columns, int32, of the pattern."""
    start, cells = cells_of_nodes(first, nodes, n_nodes)
    seen = np.full(n_nodes, -1, np.int32)
    indptr = np.zeros(n_nodes + 1, np.int64)
    for i in range(n_nodes):
        count = 0
        for c in range(start[i], start[i + 1]):
            e = cells[c]
            for k in range(first[e], first[e + 1]):
                if seen[nodes[k]] != i:
                    seen[nodes[k]] = i
                    count += 1
        indptr[i + 1] = indptr[i] + count
    indices = np.empty(indptr[-1], np.int32)
    end = indptr.copy()
    seen[:] = -1
    for i in range(n_nodes):  # the pattern is symmetric: every row gets its columns in ascending order
        for c in range(start[i], start[i + 1]):
            e = cells[c]
            for k in range(first[e], first[e + 1]):
                j = nodes[k]
                if seen[j] != i:
                    seen[j] = i
                    indices[end[j]] = i
                    end[j] += 1
    return indptr, indices
