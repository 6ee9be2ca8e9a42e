"""Convex polygons in the plane, compiled: area, centroid, and clipping by lines and by one another.

A polygon is the first n rows of an array (room, 2), counter-clockwise; `label[k]` names the edge that leaves vertex k.
Clipping follows Sutherland and Hodgman (Comm. ACM 17, 1974). Vertices are never compared with each other: edges and
corners that coincide, or nearly do, lead to slivers and no other harm.
"""

from __future__ import annotations

from typing import Any

from lacmesh.kernels import kernel

#: vertices that a polygon may have
ROOM = 40
#: what made an edge: edge k of the slave patch, edge k of the master patch (+ MASTER), or no edge of either (CHORD)
MASTER, CHORD = 4, 8
#: against its extent squared, an area that tells nothing of where the centroid is
_THIN = 1e-9


@kernel
def area_of(p: Any, n: int) -> Any:
    """Area of a polygon, computed relative to its first vertex, so that a small one far from 0 keeps its digits."""
    twice = 0.0
    for k in range(1, n - 1):
        twice += (p[k, 0] - p[0, 0]) * (p[k + 1, 1] - p[0, 1]) - (p[k, 1] - p[0, 1]) * (p[k + 1, 0] - p[0, 0])
    return twice / 2


@kernel
def centroid(p: Any, n: int) -> Any:
    """Centroid of a polygon; the mean of its vertices if the area is negligible."""
    x = y = twice = mx = my = size = 0.0
    for k in range(n):
        mx += p[k, 0] / n
        my += p[k, 1] / n
        size = max(size, abs(p[k, 0] - p[0, 0]), abs(p[k, 1] - p[0, 1]))
    for k in range(1, n - 1):
        ax, ay = p[k, 0] - p[0, 0], p[k, 1] - p[0, 1]
        bx, by = p[k + 1, 0] - p[0, 0], p[k + 1, 1] - p[0, 1]
        t = ax * by - ay * bx
        twice += t
        x += t * (ax + bx)
        y += t * (ay + by)
    if not twice > _THIN * size * size:
        return mx, my
    return p[0, 0] + x / (3 * twice), p[0, 1] + y / (3 * twice)


@kernel
def copy(p: Any, label: Any, n: int, q: Any, q_label: Any) -> None:
    """Copy polygon p and its labels to q."""
    for k in range(n):
        q[k, 0] = p[k, 0]
        q[k, 1] = p[k, 1]
        q_label[k] = label[k]


@kernel
def cut_by_line(
    p: Any, label: Any, n: int, ax: float, ay: float, bx: float, by: float, mark: int, side: int, q: Any, q_label: Any
) -> Any:
    """Write the part of polygon p left of the line a -> b (right if side = -1) into q; return its number of vertices.

    The new edge is labelled `mark`.
    """
    nx = -(by - ay) * side
    ny = (bx - ax) * side
    if nx == 0.0 and ny == 0.0:  # two corners in one place bound nothing: all is inside, nothing outside
        if side < 0:
            return 0
        copy(p, label, n, q, q_label)
        return n
    m = 0
    before = (p[n - 1, 0] - ax) * nx + (p[n - 1, 1] - ay) * ny
    for k in range(n):
        last = k - 1 if k > 0 else n - 1
        here = (p[k, 0] - ax) * nx + (p[k, 1] - ay) * ny
        if (before < 0) != (here < 0):
            t = before / (before - here)
            q[m, 0] = p[last, 0] + t * (p[k, 0] - p[last, 0])
            q[m, 1] = p[last, 1] + t * (p[k, 1] - p[last, 1])
            q_label[m] = label[last] if here >= 0 else mark
            m += 1
        if here >= 0:
            q[m, 0] = p[k, 0]
            q[m, 1] = p[k, 1]
            q_label[m] = label[k]
            m += 1
        before = here
    return m


@kernel
def cut_by_polygon(p: Any, label: Any, n: int, by: Any, n_by: int, offset: int, work: Any, work_label: Any) -> Any:
    """Clip polygon p by polygon `by` in place; return its number of vertices, 0 if nothing is left. `work`: a buffer.

    An edge made by edge k of `by` is labelled offset + k, or CHORD if offset is CHORD.
    """
    for k in range(n_by):
        other = k + 1 if k + 1 < n_by else 0
        mark = offset if offset == CHORD else offset + k
        m = cut_by_line(p, label, n, by[k, 0], by[k, 1], by[other, 0], by[other, 1], mark, 1, work, work_label)
        if m < 3 or m > ROOM - 2:
            return 0
        copy(work, work_label, m, p, label)
        n = m
    return n


@kernel
def outside(y: Any, n: int, by: Any, n_by: int) -> Any:
    """True if some edge of polygon `by` separates it from y: all of y lies on the outer side of that edge."""
    for k in range(n_by):
        j = k + 1 if k + 1 < n_by else 0
        nx = -(by[j, 1] - by[k, 1])
        ny = by[j, 0] - by[k, 0]
        inside = False
        for c in range(n):
            if (y[c, 0] - by[k, 0]) * nx + (y[c, 1] - by[k, 1]) * ny > 0:
                inside = True
                break
        if not inside and (nx != 0.0 or ny != 0.0):
            return True
    return False


@kernel
def tidy(p: Any, label: Any, n: int, least: float) -> Any:
    """Remove vertices that add no area (coincident, or on a straight side); return the number of those left.

    Two edges that become one get the label of the longer.
    """
    j = 0
    while j < n and n > 3:
        a = j - 1 if j > 0 else n - 1
        b = j + 1 if j + 1 < n else 0
        ux, uy = p[j, 0] - p[a, 0], p[j, 1] - p[a, 1]
        vx, vy = p[b, 0] - p[j, 0], p[b, 1] - p[j, 1]
        if ux * vy - uy * vx > least:
            j += 1
            continue
        if vx * vx + vy * vy > ux * ux + uy * uy:
            label[a] = label[j]
        n -= 1
        for c in range(j, n):
            p[c, 0] = p[c + 1, 0]
            p[c, 1] = p[c + 1, 1]
            label[c] = label[c + 1]
        j = max(j - 1, 0)
    return n
