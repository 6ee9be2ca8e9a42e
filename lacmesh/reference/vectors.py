"""Vectors with their components first: arrays (3, ...), so that each component is contiguous; and determinants of maps.

numpy's own functions take vectors along the last axis, which takes several times as long for many of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.floating]


def dot(a: Vectors, b: Vectors) -> NDArray[np.floating]:
    """Inner products (...) of vectors (3, ...)."""
    out = np.asarray(a[0] * b[0])
    out += a[1] * b[1]
    out += a[2] * b[2]
    return out


def norm(a: Vectors) -> NDArray[np.floating]:
    """Lengths (...) of vectors (3, ...)."""
    return np.asarray(np.sqrt(dot(a, a)))


def cross(a: Vectors, b: Vectors) -> Vectors:
    """Cross products (3, ...) of vectors (3, ...)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for s, t, u in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[t], b[u], out=out[s])
        out[s] -= a[u] * b[t]
    return out


def over(a: NDArray, b: NDArray) -> NDArray:
    """a / b, and a where b is 0."""
    return np.asarray(a / (b + (b == 0)))


def determinants(dN: NDArray, x: Vectors, inside: NDArray[np.integer], plane: bool = False) -> NDArray[np.floating]:
    """(p, k): Jacobian determinants of cells with nodes x (3, n, k), at p points with gradients dN (p, n, dim).

    That of a surface is the component of its normal along the mean of the normals at the points `inside`, or along +z
    if `plane`; that of a line is the component of its tangent along the mean tangent.
    """
    p, n, dim = dN.shape
    J = (dN.transpose(2, 0, 1).reshape(dim * p, n) @ x).reshape(3, dim, p, -1).transpose(1, 0, 2, 3)
    if dim == 3:
        return dot(J[0], cross(J[1], J[2]))
    along = J[0] if dim == 1 else cross(J[0], J[1])
    if dim == 2 and plane:
        return np.asarray(along[2])
    mean = along[:, inside].sum(axis=1)
    return dot(along, over(mean, norm(mean))[:, None])
