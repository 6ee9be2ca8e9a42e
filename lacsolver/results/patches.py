"""Patches of macro-elements around each one, from the nodes that they share (`touch`, 1 for a node of a macro-element).

The matrices (rows, columns) have 1 for what belongs together, and 0 elsewhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from lacmesh.mesh import Floats

Bools = NDArray[np.bool_]

#: largest number of rings of a patch
_RINGS = 8


def patches_of(touch: csr_array, many: int, least: int, trust: Floats) -> csr_array:
    """Return the patch of each macro-element in `touch`, (n, n), with as many rings as it takes to have enough.

    Enough are `many`, if `trust` (n,) makes their effective number (Kish's) at least `least`.
    """
    near = ones(touch.T @ touch)
    patch = near
    for _ in range(_RINGS - 1):
        effective = (patch @ trust) ** 2 / np.maximum(patch @ trust**2, np.finfo(float).tiny)
        small = (np.diff(patch.indptr) < many) | (effective < least)
        before, patch = patch.nnz, ones(patch + scaled(patch, small, 1.0) @ near)
        if patch.nnz == before:  # no row is small, or those that are have all that is connected with them
            break
    return patch


def scaled(A: csr_array, rows: Floats | Bools | float, columns: Floats | Bools | float) -> csr_array:
    """Return diag(rows) A diag(columns) for A (n, m)."""
    left, right = np.broadcast_to(rows, A.shape[0]), np.broadcast_to(columns, A.shape[1])
    data = A.data * np.repeat(left, np.diff(A.indptr)) * right[A.indices]
    return csr_array((data, A.indices, A.indptr), shape=A.shape, copy=True)


def nodes_of(touch: csr_array, macros: Bools) -> Bools:
    """Return a mask (k,), True for the nodes of some macro-elements."""
    return np.asarray(touch @ macros.astype(float) > 0)


def beside(touch: csr_array, macros: Bools, rings: int) -> Bools:
    """Return a mask (n,) of some macro-elements and the given number of rings of node neighbours around them."""
    for _ in range(rings):
        macros = touch.T @ nodes_of(touch, macros).astype(float) > 0
    return macros


def only(touch: csr_array, macros: Bools) -> csr_array:
    """Return the matrix with the columns of some macro-elements, and all others empty."""
    return ones(scaled(touch, 1.0, macros))


def ones(matrix: coo_array | csr_array) -> csr_array:
    """Return a matrix with 1 where the given one is not 0."""
    matrix = matrix.tocsr()
    matrix.eliminate_zeros()
    matrix.data[:] = 1.0
    return matrix
