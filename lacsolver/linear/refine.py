"""Iterative refinement: the residual of a direct solution is always measured, and reduced if it is too large.

The measure is the backward error |r| / (|x| + |b|) in the scaling by D = diag K, which is independent of units:
D^-1/2 r and D^-1/2 b against D^1/2 x, column by column. It costs one product with K, a twentieth of a solve.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.linear.errors import LinearError
from lacsolver.linear.protocol import Matrix

#: backward error that needs no refinement, a few units of round-off
_GOOD = 4e-15
#: backward error above which the backend has failed, or the matrix is not symmetric
_WRONG = 1e-11
_STEPS = 3


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
