"""Vectors of many cells, component first: arrays (3, ...) with the cells along the last axis, the contiguous one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Verdict's infinity, and what it reports where a definition divides by nothing
LARGEST = 1e30
#: round-off relative to the quantities that a number is made of (Verdict takes it absolute, in the mesh's own unit)
ROUND_OFF = 10 * np.finfo(float).eps


def cross(a: NDArray, b: NDArray) -> NDArray:
    """(3, ...): cross products; np.cross is several times slower for many vectors."""
    (ax, ay, az), (bx, by, bz) = a, b
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def dot(a: NDArray, b: NDArray) -> NDArray:
    """(...): inner products."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def triple(a: NDArray, b: NDArray, c: NDArray) -> NDArray:
    """(...): the determinant of three vectors, a.(b x c)."""
    return dot(a, cross(b, c))


def norm(a: NDArray) -> NDArray:
    """(...): lengths."""
    return np.sqrt(dot(a, a))


def unit(a: NDArray) -> NDArray:
    """(3, ...): normalised vectors; those without length stay zero."""
    length = norm(a)
    return np.divide(a, length, out=np.zeros_like(a), where=length > 0)


def angle(a: NDArray, b: NDArray) -> NDArray:
    """(...): angles between vectors in degrees, 0 to 180; NaN where a vector has no length."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.degrees(np.arccos(np.clip(dot(a, b) / (norm(a) * norm(b)), -1, 1)))


def ratio(a: NDArray, b: NDArray, nothing: NDArray | float = 0.0, otherwise: float = LARGEST) -> NDArray:
    """(...): a / b where b is larger than `nothing`, `otherwise` elsewhere."""
    return np.divide(a, b, out=np.full(np.broadcast(a, b).shape, otherwise), where=b > nothing)


def bounded(a: NDArray) -> NDArray:
    """(...): values clipped to [-LARGEST, LARGEST]; NaN, where the definition is void, becomes LARGEST."""
    return np.where(np.isnan(a), LARGEST, np.clip(a, -LARGEST, LARGEST))


def nodes_first(x: NDArray) -> NDArray:
    """(n, 3, k): nodes x (k, n, 3) of cells, transposed so that each coordinate is contiguous along the cells."""
    return np.ascontiguousarray(np.asarray(x, dtype=float).transpose(1, 2, 0))
