"""Bodies of a mesh: cells that share nodes, one with the next."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Ints

Array = NDArray[Any]
#: numbers below which bodies are found as the code stands, in milliseconds: to load numba takes longer
_SMALL = 8_000


def label_bodies(cells: Iterable[Ints], n_nodes: int) -> Ints:
    """(n_nodes,): the body of each node, numbered from 0 by their first nodes; -1 for nodes of no cell.

    `cells`: parts (k, n), the nodes of cells, padded with -1. Compiled: several times faster than scipy.

    >>> label_bodies([np.array([[0, 4], [1, 3]]), np.array([[4, 5, -1]])], 6)
    array([ 0,  1, -1,  1,  0,  0])
    """
    parent = np.full(n_nodes, -1, np.int64)
    for nodes in cells:
        _join(nodes, parent)
    return np.asarray(_number(parent))


@kernel
def _top(parent: Array, node: int) -> int:
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@kernel(least=_SMALL)
def _join(cells: Array, parent: Array) -> None:
    """Join the nodes of each cell in a forest: `parent` (n_nodes,), -1 for nodes of no cell so far."""
    for cell in range(len(cells)):
        first = cells[cell, 0]
        if parent[first] < 0:
            parent[first] = first
        a = _top(parent, first)
        for k in range(1, cells.shape[1]):
            node = cells[cell, k]
            if node < 0:
                break
            if parent[node] < 0:
                parent[node] = a
                continue
            b = _top(parent, node)
            if b < a:
                parent[a] = b
                a = b
            else:
                parent[b] = a


@kernel(least=_SMALL)
def _number(parent: Array) -> Array:
    """(n_nodes,): the trees of a forest, numbered by their first nodes."""
    body = np.full(len(parent), -1, np.int64)
    count = 0
    for node in range(len(parent)):
        if parent[node] < 0:
            continue
        root = _top(parent, node)
        if body[root] < 0:
            body[root] = count
            count += 1
        body[node] = body[root]
    return body
