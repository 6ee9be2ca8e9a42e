"""Matrices of blocks on the unknowns of all nodes, for multigrid: embedded, added to and restricted by pieces.

A copy of all blocks takes as much memory as the stiffness itself, so that temporary arrays have the size of a piece.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from lacmesh.mesh import Floats, Ints

#: number of blocks that are copied at once
_PIECE = 1 << 17


def with_held(K: bsr_array, free: Ints, own: NDArray[np.bool_] | None = None) -> bsr_array:
    """Return K (n, n) with a multiple of the identity at the unknowns that are not `free`, the mean of K's diagonal.

    `own`: mask of the rows of blocks that are wanted, all if None; others are left empty.
    """
    b, on = K.blocksize[0], np.zeros(K.shape[0], bool)
    on[free] = True
    mean = float(K.diagonal()[free].mean()) if len(free) else 1.0
    on = on.reshape(-1, b)
    held = np.logical_not(on.any(axis=1))
    row = np.repeat(np.arange(len(on), dtype=K.indices.dtype), np.diff(K.indptr))
    wanted = ~(held[row] | held[K.indices])
    if own is not None:
        wanted &= own[row]
        held &= own
    kept = np.flatnonzero(wanted)
    length = np.bincount(row[kept], minlength=len(on)) + held
    indptr = np.concatenate([[0], np.cumsum(length)]).astype(K.indptr.dtype)
    at = np.ones(indptr[-1], bool)
    at[indptr[:-1][held]] = False
    indices, data = np.empty(len(at), K.indices.dtype), np.zeros((len(at), b, b))
    indices[at], indices[~at] = K.indices[kept], np.flatnonzero(held)
    places = np.flatnonzero(at)
    for first in range(0, len(kept), _PIECE):
        data[places[first : first + _PIECE]] = K.data[kept[first : first + _PIECE]]
    partly = np.logical_not(on.all(axis=1))
    cut = partly[row[kept]] | partly[K.indices[kept]]
    data[places[cut]] *= on[row[kept[cut]]][:, :, None] & on[K.indices[kept[cut]]][:, None, :]
    made = bsr_array((data, indices, indptr), shape=K.shape)
    add_to_diagonal(made, np.where(on.ravel(), 0.0, mean))
    return made


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
