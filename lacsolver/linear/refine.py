"""Iterative refinement: a direct backend's solution, its residual always measured and, where that is poor, reduced.

The measure is the backward error |r| / (|x| + |b|) in the scaling by D = diag K, which knows no units: D^-1/2 r and
D^-1/2 b against D^1/2 x, column by column. It costs one product with K, a twentieth of a solve.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.linear.errors import LinearError
from lacsolver.linear.protocol import Matrix

#: a backward error that is not worth a step of refinement, some units of rounding
_GOOD = 4e-15
#: one that is an error of the backend, or of a matrix that is not symmetric
_WRONG = 1e-11
_STEPS = 3


def refined(K: Matrix, scale: Floats, solve: Callable[[Floats], Floats], b: Floats) -> Floats:
    """x with K x = b, b (n, ...), from a solver that may be inexact; scale (n,): D^-1/2.

    Raises LinearError if refinement does not bring the residual down.
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
    """The largest |r| / (|x| + |b|) of all columns, in the scaling; 0 for b = 0."""
    scale = scale.reshape(-1, *(1,) * (b.ndim - 1))
    size = np.linalg.norm(x / scale, axis=0) + np.linalg.norm(b * scale, axis=0)
    left = np.linalg.norm(r * scale, axis=0)
    return float(np.max(np.where(left == 0, 0.0, left / np.where(size == 0, 1.0, size)), initial=0.0))
