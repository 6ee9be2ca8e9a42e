"""Kernels on vectors, and the choice of the form in which a kernel of many cells runs.

A vector is a tuple of three numbers where a kernel is compiled, of three arrays (k,) where it runs as it stands, on all
cells at once; or an array (3,) or (3, k). A kernel that is made of these and has no `if` on such numbers is therefore
its own plain form, as fast as numpy is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints

#: Verdict's infinity, and what it reports where a definition divides by nothing
LARGEST = 1e30
#: round-off relative to the quantities that a number is made of (Verdict takes it absolute, in the mesh's own unit)
ROUND_OFF = float(10 * np.finfo(float).eps)
#: cells at a time, so that a piece stays in the cache
PIECE = 1 << 12
#: from so many cells on it pays to load the compiled kernels
COMPILED_FROM = 1 << 15


@kernel
def choose(condition: Any, a: Any, b: Any) -> Any:
    """a where the condition holds, b elsewhere; both are computed."""
    return a if condition else b


choose.plain = np.where


@kernel
def edge(points: Any, row: Any, i: int, j: int) -> Any:
    """Vector from node i to node j of the cell with the nodes `row`, among points (n, 3) or (n, 3, k)."""
    a, b = row[i], row[j]
    return points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]


@kernel
def minus(a: Any, b: Any) -> Any:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def dot(a: Any, b: Any) -> Any:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Any, b: Any) -> Any:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def norm(a: Any) -> Any:
    """Length."""
    return np.sqrt(dot(a, a))


@kernel
def over(a: Any, b: Any) -> Any:
    """a / b, and a where b is 0."""
    return a / (b + (b == 0))


@kernel
def corner_angle(before: Any, after: Any) -> Any:
    """Angle in degrees, 0 to 180, between an edge that ends in a corner and one that leaves it; NaN without length."""
    cosine = -dot(before, after) / (norm(before) * norm(after))
    return np.degrees(np.arccos(np.minimum(np.maximum(cosine, -1.0), 1.0)))


def nodes_first(x: NDArray) -> NDArray:
    """(n, 3, k): nodes x (k, n, 3) of cells, transposed so that each coordinate is contiguous along the cells."""
    return np.ascontiguousarray(np.asarray(x, dtype=float).transpose(1, 2, 0))


def in_columns(fill: Any, points: Floats, nodes: Ints, count: int, *tables: Any) -> NDArray:
    """(count, c): the columns that `fill` writes for cells with `nodes` (c, n) among points (p, 3).

    `fill` is a kernel of points, nodes, `tables` and the output: compiled for many cells, as it stands for few.
    """
    if len(nodes) >= COMPILED_FROM:
        from lacmesh.kernels.threads import in_threads

        out = np.empty((len(nodes), count))
        in_threads(lambda part: fill(points, nodes[part], *tables, out[part]), len(nodes))
        return out.T
    out = np.empty((count, len(nodes)))
    row = np.arange(nodes.shape[1])[None]
    for start in range(0, len(nodes), PIECE):
        piece = slice(start, start + PIECE)
        fill.py_func(nodes_first(points[nodes[piece]]), row, *tables, out[None, :, piece])
    return out
