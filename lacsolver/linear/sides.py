"""Inputs of a linear solver: the matrix in CSR form, and right-hand sides."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats
from lacsolver.linear.protocol import Matrix


def by_rows(K: Matrix) -> csr_array:
    """Return the matrix as CSR with sorted indices and summed duplicates, without a copy if it is so already."""
    csr = csr_array(K)
    if not csr.has_canonical_format:
        csr = csr.copy() if csr is K else csr
        csr.sum_duplicates()
    return csr


def right_hand_sides(b: Floats, n: int) -> Floats:
    """Return b as float64 (n,) or (n, k). Raises RequestError for another shape, DataError if it is not finite."""
    b = np.asarray(b, float)
    if b.ndim not in (1, 2) or len(b) != n:
        raise RequestError(f"a right-hand side is ({n},) or ({n}, k), not {b.shape}")
    if not np.isfinite(b).all():
        row = int(np.argwhere(~np.isfinite(b))[0][0])
        raise DataError(f"the right-hand side has an entry that is no number, in row {row}; look at the loads there")
    return b
