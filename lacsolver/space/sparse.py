"""Sparse matrices from entries (rows, columns and values of shapes that broadcast), and columns that rows join."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from lacmesh.mesh import Ints
from lacmesh.topology.bodies import label_components


def sparse(shape: tuple[int, int], *entries: tuple[Any, Any, Any]) -> csr_array:
    """Return the matrix of some entries, each (rows, columns, values), whose shapes broadcast; those of one place add.

    >>> sparse((2, 2), (0, [0, 1], 1.0), (1, 1, 2.0), (1, 1, 3.0)).toarray().tolist()
    [[1.0, 1.0], [0.0, 5.0]]
    """
    spread = [np.broadcast_arrays(*entry) for entry in entries]
    row, column, value = (np.concatenate([part[k].ravel() for part in spread]) for k in range(3))
    return coo_array((value, (row, column)), shape=shape).tocsr()


def sparse_blocks(n: int, parts: Iterable[tuple[Any, Any]]) -> csr_array:
    """Return the matrix (n, n) of some blocks at some unknowns, each (unknowns (..., k), values (..., k, k))."""
    entries = [(np.asarray(at)[..., :, None], np.asarray(at)[..., None, :], block) for at, block in parts]
    return sparse((n, n), *entries) if entries else csr_array((n, n))


def joined_columns(A: csr_array) -> Ints:
    """Return the connected component (n,) of each column of A (m, n); a row joins the columns of its entries.

    Components are numbered by their first columns.

    >>> joined_columns(sparse((2, 4), (0, [0, 2], 1.0), (1, [3], 1.0))).tolist()
    [0, 1, 0, 2]
    """
    m, n = A.shape
    row = np.repeat(np.arange(m), np.diff(A.indptr))
    return label_components(A.indices, n + row, n + m)[:n]
