"""Matrices of blocks on the unknowns of all nodes, for multigrid: copied once, added to and restricted in place."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints


def with_held(K: bsr_array, free: Ints, own: NDArray[np.bool_] | None = None) -> bsr_array:
    """Return K (n, n) with a multiple of the identity at the unknowns that are not `free`, the mean of K's diagonal.

    `own`: mask of the rows of blocks that are wanted, all if None; others are left empty.
    """
    b, on = K.blocksize[0], np.zeros(K.shape[0], bool)
    on[free] = True
    mean = float(K.diagonal()[free].mean()) if len(free) else 1.0
    on = np.reshape(on, (-1, b))
    wanted, free_node = np.ones(len(on), bool) if own is None else own, np.asarray(on.any(axis=1))
    rows = wanted & free_node
    size = int((np.repeat(rows, np.diff(K.indptr)) & free_node[K.indices]).sum() + (wanted & ~free_node).sum())
    blocks = np.empty((size, b, b)), np.empty(size, K.indices.dtype), np.zeros_like(K.indptr)
    _copy_held(K.indptr, K.indices, K.data, on, wanted, mean, *blocks)
    return bsr_array(blocks, shape=K.shape)


@kernel
def _copy_held(
    indptr: Any, indices: Any, data: Any, on: Any, wanted: Any, mean: float, blocks: Any, columns: Any, ends: Any
) -> None:
    """Fill `blocks`, `columns` and `ends` with the wanted rows of blocks, see `with_held`."""
    b, end = data.shape[1], 0
    for i in range(len(on)):
        first = indptr[i] if wanted[i] and on[i].any() else indptr[i + 1]
        for k in range(first, indptr[i + 1]):
            j = indices[k]
            if not on[j].any():
                continue
            columns[end] = j
            for s in range(b):
                for t in range(b):
                    blocks[end, s, t] = data[k, s, t] if on[i, s] and on[j, t] else 0.0
                if i == j and not on[i, s]:
                    blocks[end, s, s] = mean
            end += 1
        if wanted[i] and not on[i].any():
            columns[end] = i
            for s in range(b):
                for t in range(b):
                    blocks[end, s, t] = mean if s == t else 0.0
            end += 1
        ends[i + 1] = end


def add_to_diagonal(K: bsr_array, values: Floats) -> None:
    """Add `values` (n,) to the diagonal of K in place; each value that is not 0 has its block in K."""
    b = K.blocksize[0]
    row = np.repeat(np.arange(K.shape[0] // b, dtype=K.indices.dtype), np.diff(K.indptr))
    at = np.flatnonzero(row == K.indices)
    for s in range(b):
        K.data[at, s, s] += values[b * row[at] + s]


def only_rows(K: bsr_array, kept: NDArray[np.bool_]) -> bsr_array:
    """Return K without the blocks of the rows that are not `kept` (rows of blocks,)."""
    length = np.diff(K.indptr)
    if not length[~kept].any():
        return K
    of_kept = np.repeat(kept, length)
    indptr = np.concatenate([[0], np.cumsum(np.where(kept, length, 0))]).astype(K.indptr.dtype)
    return bsr_array((K.data[of_kept], K.indices[of_kept], indptr), shape=K.shape)


def submatrix(K: bsr_array, unknowns: Ints) -> csr_array:
    """Return the rows and columns of K at some unknowns (k,)."""
    b = K.blocksize[0]
    nodes = np.unique(unknowns // b)
    number = csr_array((np.arange(len(K.indices)), K.indices, K.indptr), shape=(K.shape[0] // b,) * 2)
    own = csr_array(number[nodes][:, nodes])
    blocks = bsr_array((K.data[own.data], own.indices, own.indptr), shape=(b * len(nodes),) * 2)
    at = b * np.searchsorted(nodes, unknowns // b) + unknowns % b
    return csr_array(blocks.tocsr()[at][:, at])
