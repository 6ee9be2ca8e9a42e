"""Convex polygons in the plane, compiled: area, centroid, clipping by lines and by one another, and overlaps.

A polygon is the first n rows of an array (room, 2), counter-clockwise; `label[k]` names the edge that leaves vertex k.
Clipping follows Sutherland and Hodgman (Comm. ACM 17, 1974). Vertices are never compared with each other: edges and
corners that coincide, or nearly do, lead to slivers and no other harm. Of overlapping parts of one slave patch only the
nearest is kept at each point.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints

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


#: parts that layers may break the parts of a slave patch into, each: beyond, faces cross one another at random
_FRAGMENTS = 64


class FragmentBuffers(NamedTuple):
    """Buffers for the parts of one slave patch, one per row: polygon `shape` (., ROOM, 2), its `size` and `label`s.

    `plane` (., 3): height c0 + c1 p + c2 q of the master over the slave; `who`: the master patch. `low`, `high`
    (., 2), `order`, `held`: buffers of the sweep. `work`, `rest` (ROOM, 2) and their labels: buffers for intermediate
    polygons.
    """

    shape: Floats
    label: NDArray[np.int8]
    size: Ints
    plane: Floats
    who: Ints
    low: Floats
    high: Floats
    order: Ints
    held: Ints
    work: Floats
    work_label: NDArray[np.int8]
    rest: Floats
    rest_label: NDArray[np.int8]


def make_room(n: int) -> FragmentBuffers:
    """Allocate buffers for n parts."""
    low, high, order, held = np.empty((n, 2)), np.empty((n, 2)), np.empty(n, np.int64), np.empty(n, np.int64)
    return FragmentBuffers(
        np.empty((n, ROOM, 2)), np.zeros((n, ROOM), np.int8), np.zeros(n, np.int64), np.empty((n, 3)),
        np.empty(n, np.int64), low, high, order, held, np.empty((ROOM, 2)), np.zeros(ROOM, np.int8),
        np.empty((ROOM, 2)), np.zeros(ROOM, np.int8),
    )  # fmt: skip


@kernel
def nearest_only(of: Any, n: int, least: float, overlap: float) -> Any:
    """Keep the nearest part wherever the n parts overlap; return the number of parts, some empty, or -1 without room.

    `least`: area below which a part is rounding; `overlap`: area that neighbours may share.
    """
    for a in range(n):
        _measure(of, a)
        of.order[a] = a
    _sort(of.order, of.low[:, 0], n)
    n_open = 0  # parts `of.held` lie nowhere over one another, and reach as far as the sweep along the first axis
    whole, most = n, _FRAGMENTS * n
    for i in range(whole):
        a = of.order[i]
        n_open = _let_go(of, n_open, of.low[a, 0])
        rest = n  # what is broken off from here on is set down in its turn
        while True:
            n = _set_down(of, n, a, n_open, least, overlap)
            if n < 0 or n >= most:
                return n
            if of.size[a]:
                of.held[n_open] = a
                n_open += 1
            if rest == n:
                break
            a = rest
            rest += 1
    return n


@kernel
def _measure(of: Any, a: int) -> None:
    """Compute the extent of part a along both axes."""
    for axis in range(2):
        of.low[a, axis], of.high[a, axis] = np.inf, -np.inf
        for k in range(of.size[a]):
            of.low[a, axis] = min(of.low[a, axis], of.shape[a, k, axis])
            of.high[a, axis] = max(of.high[a, axis], of.shape[a, k, axis])


@kernel
def _let_go(of: Any, n_open: int, low: float) -> Any:
    """Drop held parts that are empty or end before `low` along the first axis; return the number of those kept."""
    kept = 0
    for k in range(n_open):
        b = of.held[k]
        if of.size[b] and of.high[b, 0] > low:
            of.held[kept] = b
            kept += 1
    return kept


@kernel
def _set_down(of: Any, n: int, a: int, n_open: int, least: float, overlap: float) -> Any:
    """Resolve overlaps of part a with the held parts: the nearer cuts the other; return the number, -1 without room."""
    low, high = of.low, of.high
    left, right, bottom, top = low[a, 0], high[a, 0], low[a, 1], high[a, 1]
    for k in range(n_open):
        b = of.held[k]
        if high[b, 1] <= bottom or low[b, 1] >= top or high[b, 0] <= left or low[b, 0] >= right:
            continue
        if of.size[b] == 0 or of.who[a] == of.who[b]:
            continue
        area, far = _overlap(of, a, b, overlap)
        if area > overlap:
            n = _subtract(of, n, far, a + b - far, least)
            if n < 0 or far == a:
                break
    return n


@kernel
def _overlap(of: Any, a: int, b: int, least: float) -> Any:
    """Common area of parts a and b, and the one of them that is farther from the slave there."""
    p, q = of.shape[a], of.shape[b]
    if outside(p, of.size[a], q, of.size[b]) or outside(q, of.size[b], p, of.size[a]):
        return 0.0, a
    copy(p, of.label[a], of.size[a], of.rest, of.rest_label)
    n = cut_by_polygon(of.rest, of.rest_label, of.size[a], q, of.size[b], CHORD, of.work, of.work_label)
    if n < 3:
        return 0.0, a
    area = area_of(of.rest, n)
    if not area > least:
        return 0.0, a
    x, y = centroid(of.rest, n)
    ha = abs(of.plane[a, 0] + of.plane[a, 1] * x + of.plane[a, 2] * y)
    hb = abs(of.plane[b, 0] + of.plane[b, 1] * x + of.plane[b, 2] * y)
    if abs(ha - hb) <= 1e-9 * (ha + hb):  # as near as each other: the one with the lower number stays
        return area, max(a, b)
    return area, a if ha > hb else b


@kernel
def _subtract(of: Any, n: int, far: int, near: int, least: float) -> Any:
    """Subtract part `near` from part `far`, leaving new parts; return the number of parts, -1 without room."""
    m = of.size[far]
    copy(of.shape[far], of.label[far], m, of.rest, of.rest_label)
    of.size[far] = 0
    by = of.shape[near]
    for k in range(of.size[near]):
        j = k + 1 if k + 1 < of.size[near] else 0
        ax, ay, bx, by1 = by[k, 0], by[k, 1], by[j, 0], by[j, 1]
        out = cut_by_line(of.rest, of.rest_label, m, ax, ay, bx, by1, CHORD, -1, of.work, of.work_label)
        if out > 2 and area_of(of.work, out) > least:
            if n == len(of.size):
                return -1
            of.who[n] = of.who[far]
            for c in range(3):  # one by one: quicker to compile
                of.plane[n, c] = of.plane[far, c]
            copy(of.work, of.work_label, out, of.shape[n], of.label[n])
            of.size[n] = tidy(of.shape[n], of.label[n], out, least)
            _measure(of, n)
            n += 1
        m = cut_by_line(of.rest, of.rest_label, m, ax, ay, bx, by1, CHORD, 1, of.work, of.work_label)
        if m < 3:
            break
        copy(of.work, of.work_label, m, of.rest, of.rest_label)
    return n


@kernel
def _sort(order: Any, key: Any, n: int) -> None:
    """Sort `order` by `key` with Shell's method: nearly always a handful of parts, and never slow for many."""
    step = 1
    while 3 * step < n:
        step = 3 * step + 1
    while step > 0:
        for i in range(step, n):
            a = order[i]
            k = i
            while k >= step and key[order[k - step]] > key[a]:
                order[k] = order[k - step]
                k -= step
            order[k] = a
        step //= 3
