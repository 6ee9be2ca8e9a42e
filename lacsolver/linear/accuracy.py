"""Inputs and accuracy of a linear solver: its matrix, its right-hand sides, and the residual of a solution.

The residual of a direct solution is always measured, and reduced by iterative refinement if it is too large. The
measure is the backward error |r| / (|x| + |b|) in the scaling by D = diag K, which is independent of units: D^-1/2 r
and D^-1/2 b against D^1/2 x, column by column. It costs one product with K, a twentieth of a solve.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.sparse import bsr_array, csr_array

from lacmesh.errors import DataError, RequestError
from lacmesh.mesh import Floats
from lacsolver.linear.errors import LinearError

Matrix: TypeAlias = csr_array | bsr_array

#: default residual of an iterative backend, relative to the right-hand side
TOLERANCE = 1e-12
#: backward error that needs no refinement, a few units of round-off
_GOOD = 4e-15
#: backward error above which the backend has failed, or the matrix is not symmetric
_WRONG = 1e-11
_STEPS = 3


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


def refined(K: Matrix, scale: Floats, solve: Callable[[Floats], Floats], b: Floats) -> Floats:
    """Return x with K x = b, b (n, ...), from a solver that may be inexact; scale (n,): D^-1/2.

    Raises LinearError if refinement does not reduce the residual enough.
    """
    if not b.size:
        return b.copy()
    x = solve(b)
    r = b - K @ x
    error = backward_error(scale, x, r, b)
    for _ in range(_STEPS):
        if error <= _GOOD:
            return x
        better = x + solve(r)
        remains = b - K @ better
        now = backward_error(scale, better, remains, b)
        if not now < error:
            break
        x, r, error = better, remains, now
    if not error <= _WRONG:
        message = f"the linear solver's residual stays at {error:.1e} of the forces it sums"
        raise LinearError(f"{message}; try another backend, and look for materials or sizes far apart")
    return x


def backward_error(scale: Floats, x: Floats, r: Floats, b: Floats) -> float:
    """Return the largest scaled |r| / (|x| + |b|) of all columns; 0 for a column with r = 0."""
    scale = scale.reshape(-1, *(1,) * (b.ndim - 1))
    size = np.linalg.norm(x / scale, axis=0) + np.linalg.norm(b * scale, axis=0)
    left = np.linalg.norm(r * scale, axis=0)
    return float(np.max(np.where(left == 0, 0.0, left / np.where(size == 0, 1.0, size)), initial=0.0))


def solves(K: Matrix, d: Floats, solve: Callable[[Floats], Floats]) -> bool:
    """True if a solver solves K x = b, for one b, as well as refinement can mend; d (n,): a positive diagonal."""
    scale = 1 / np.sqrt(d)
    b = np.random.default_rng(2).normal(size=len(d)) / scale
    with np.errstate(over="ignore", invalid="ignore"):
        x = solve(b.copy())
        return bool(backward_error(scale, x, b - K @ x, b) <= _WRONG)
