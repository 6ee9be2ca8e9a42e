"""Self-intersections and overlaps of a skin: triangles in space, segments in the plane.

Faces are split into flat pieces that share their nodes with the pieces of neighbouring faces (a quadratic face is split
at its mid-nodes), so that the test follows a curved skin. Two pieces whose boxes intersect cross when an edge of one,
or its centre, enters the interior of the other. Along an edge the distance to the other's plane and the barycentric
coordinates in it are linear, so that each condition holds on an interval: the pieces cross if all intervals intersect.

Pieces that share nodes need no special treatment: their common corner or edge is on the boundary of both, not inside.
Pieces that touch only at their boundaries do not cross. Distances below EPSILON of a piece's size count as zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.topology.boxes import meeting_each_other
from lacmesh.topology.skin import FACE_TYPES, Faces

Array = NDArray[Any]
#: distances to a plane below this part of a piece's size are zero
EPSILON = 1e-9
#: a point is inside a piece when its barycentric coordinates are above this
INSIDE = 1e-7

#: pieces of each face, by their places among the face's nodes
PIECES = {
    "SEG2": ((0, 1),),
    "SEG3": ((0, 2), (2, 1)),
    "TRIA3": ((0, 1, 2),),
    "TRIA6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "TRIA7": ((0, 3, 6), (3, 1, 6), (1, 4, 6), (4, 2, 6), (2, 5, 6), (5, 0, 6)),
    "QUAD4": ((0, 1, 2), (0, 2, 3)),
    "QUAD8": ((0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6), (4, 6, 7)),
    "QUAD9": (
        (0, 4, 8), (4, 1, 8), (1, 5, 8), (5, 2, 8), (2, 6, 8), (6, 3, 8), (3, 7, 8), (7, 0, 8),
    ),
}  # fmt: skip


def crossing(points: Floats, faces: Faces) -> Ints:
    """(k, 2): pairs of faces i < j that cross or overlap; points (n, 3), in the plane z = 0 for segments."""
    nodes, face = pieces_of(faces)
    if not len(face):
        return np.empty((0, 2), np.int64)
    x = np.ascontiguousarray(points[nodes])
    start = np.searchsorted(face, np.arange(len(faces) + 1))
    low, high = np.minimum.reduceat(x.min(axis=1), start[:-1]), np.maximum.reduceat(x.max(axis=1), start[:-1])
    room = EPSILON * (high - low).max(axis=1, keepdims=True)
    pairs = np.column_stack(meeting_each_other(low - room, high + room))
    pairs = pairs[_cross_each(x, start, pairs)]
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def pieces_of(faces: Faces) -> tuple[Ints, Ints]:
    """(nodes (p, 2 or 3), face (p,)): the flat pieces of faces of one dimension, face by face."""
    parts, owner = [], []
    for code in np.unique(faces.type):
        rows = np.flatnonzero(faces.type == code)
        places = np.array(PIECES[FACE_TYPES[code]])
        parts.append(faces.nodes[rows][:, places].reshape(-1, places.shape[1]))
        owner.append(np.repeat(rows, len(places)))
    if not parts:
        return np.empty((0, 3), np.int64), np.empty(0, np.int64)
    nodes, face = np.concatenate(parts), np.concatenate(owner)
    order = np.argsort(face, kind="stable")
    return nodes[order], face[order]


@kernel
def _cross_each(x: Array, start: Array, pairs: Array) -> Array:
    """(k,): True for pairs of faces that have pieces that cross."""
    m = x.shape[1]
    rows, values = np.empty((m, 3)), np.empty((m + 1, m + 2))
    hit = np.zeros(len(pairs), np.bool_)
    for k in range(len(pairs)):
        for i in range(start[pairs[k, 0]], start[pairs[k, 0] + 1]):
            for j in range(start[pairs[k, 1]], start[pairs[k, 1] + 1]):
                if not hit[k] and not _apart(x, i, j):
                    hit[k] = _reaches(x, i, j, rows, values) or _reaches(x, j, i, rows, values)
    return hit


@kernel
def _apart(x: Array, i: int, j: int) -> bool:
    """True if the boxes of two pieces are separated by more than round-off."""
    for s in range(3):
        low, high, other_low, other_high = x[i, 0, s], x[i, 0, s], x[j, 0, s], x[j, 0, s]
        for c in range(1, x.shape[1]):
            low, high = min(low, x[i, c, s]), max(high, x[i, c, s])
            other_low, other_high = min(other_low, x[j, c, s]), max(other_high, x[j, c, s])
        room = 1e-6 * (high - low + other_high - other_low)
        if low > other_high + room or other_low > high + room:
            return True
    return False


@kernel
def _plane(x: Array, j: int, rows: Array) -> float:
    """Write what maps a position, relative to its first corner, to the distance from piece j and its coordinates there.

    `rows` (c, 3): the row of the signed distance, then those of the barycentric coordinates. Returns the piece's size,
    0 if it is degenerate.
    """
    m = x.shape[1]
    a0, a1, a2 = x[j, 1, 0] - x[j, 0, 0], x[j, 1, 1] - x[j, 0, 1], x[j, 1, 2] - x[j, 0, 2]
    if m == 2:
        square = a0 * a0 + a1 * a1 + a2 * a2
        if not square > 0.0:
            return 0.0
        size = np.sqrt(square)
        rows[0, 0], rows[0, 1], rows[0, 2] = a1 / size, -a0 / size, 0.0
        rows[1, 0], rows[1, 1], rows[1, 2] = a0 / square, a1 / square, a2 / square
        return size
    b0, b1, b2 = x[j, 2, 0] - x[j, 0, 0], x[j, 2, 1] - x[j, 0, 1], x[j, 2, 2] - x[j, 0, 2]
    n0, n1, n2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    square = n0 * n0 + n1 * n1 + n2 * n2
    if not square > 0.0:
        return 0.0
    length = np.sqrt(square)
    rows[0, 0], rows[0, 1], rows[0, 2] = n0 / length, n1 / length, n2 / length
    rows[1, 0] = (b1 * n2 - b2 * n1) / square
    rows[1, 1] = (b2 * n0 - b0 * n2) / square
    rows[1, 2] = (b0 * n1 - b1 * n0) / square
    rows[2, 0] = (n1 * a2 - n2 * a1) / square
    rows[2, 1] = (n2 * a0 - n0 * a2) / square
    rows[2, 2] = (n0 * a1 - n1 * a0) / square
    return np.sqrt(max(a0 * a0 + a1 * a1 + a2 * a2, b0 * b0 + b1 * b1 + b2 * b2))


@kernel
def _reaches(x: Array, i: int, j: int, rows: Array, values: Array) -> bool:
    """True if an edge of piece i (of x (k, m, 3)), or its centre, enters piece j; `rows`, `values`: work arrays."""
    m = x.shape[1]
    size = _plane(x, j, rows)
    if not size > 0.0:
        return False
    # for each corner of i, and its centre: what must be positive inside j
    for c in range(m):
        rest = 1.0
        for r in range(m):
            value = 0.0
            for s in range(3):
                value += rows[r, s] * (x[i, c, s] - x[j, 0, s])
            if r == 0:
                values[c, 0], values[c, 1] = EPSILON * size - value, EPSILON * size + value
            else:
                values[c, 1 + r] = value - INSIDE
                rest -= value
        values[c, m + 1] = rest - INSIDE
    for r in range(m + 2):
        values[m, r] = 0.0
        for c in range(m):
            values[m, r] += values[c, r] / m
    for edge in range(m + 1):
        a, b = edge, (edge + 1) % m
        if edge == m:
            a, b = m, m
        if m == 2 and edge == 1:
            continue
        low, high = 0.0, 1.0
        for r in range(m + 2):
            f, g = values[a, r], values[b, r]
            if not (f >= 0.0 or g >= 0.0):
                high = -1.0
                break
            if f < 0.0:
                low = max(low, f / (f - g))
            elif g < 0.0:
                high = min(high, f / (f - g))
        if low <= high:
            return True
    return False
