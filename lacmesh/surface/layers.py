"""Overlapping parts of one slave patch: only the nearest is kept at each point, compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.surface.polygon import CHORD, ROOM, area_of, centroid, copy, cut_by_line, cut_by_polygon, outside, tidy

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
    return FragmentBuffers(
        np.empty((n, ROOM, 2)),
        np.zeros((n, ROOM), np.int8),
        np.zeros(n, np.int64),
        np.empty((n, 3)),
        np.empty(n, np.int64),
        np.empty((n, 2)),
        np.empty((n, 2)),
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.empty((ROOM, 2)),
        np.zeros(ROOM, np.int8),
        np.empty((ROOM, 2)),
        np.zeros(ROOM, np.int8),
    )


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
