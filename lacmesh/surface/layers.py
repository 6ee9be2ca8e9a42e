"""Parts of one slave patch that lie over one another: the nearest keeps the place, compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.surface.polygon import CHORD, ROOM, area_of, centroid, copy, cut_by_line, cut_by_polygon, outside, tidy

#: parts that layers may break the parts of a slave patch into, each: beyond, faces cross one another at random
_FRAGMENTS = 64


class Parts(NamedTuple):
    """Room for the parts of one slave patch, a row each: polygon `shape` (., ROOM, 2) of `size` vertices and `label`.

    `plane` (., 3): height c0 + c1 p + c2 q of the master over the slave; `who`: the master patch. `low`, `high`,
    `order`: room to sort them. `work`, `rest` (ROOM, 2) and their labels: room for polygons on the way.
    """

    shape: Floats
    label: NDArray[np.int8]
    size: Ints
    plane: Floats
    who: Ints
    low: Floats
    high: Floats
    order: Ints
    work: Floats
    work_label: NDArray[np.int8]
    rest: Floats
    rest_label: NDArray[np.int8]


def make_room(n: int) -> Parts:
    """Room for n parts."""
    return Parts(
        np.empty((n, ROOM, 2)),
        np.zeros((n, ROOM), np.int8),
        np.zeros(n, np.int64),
        np.empty((n, 3)),
        np.empty(n, np.int64),
        np.empty(n),
        np.empty(n),
        np.empty(n, np.int64),
        np.empty((ROOM, 2)),
        np.zeros(ROOM, np.int8),
        np.empty((ROOM, 2)),
        np.zeros(ROOM, np.int8),
    )


@kernel
def nearest_only(of: Any, n: int, least: float, overlap: float) -> Any:
    """Where the n parts lie over one another, keep the nearest. Returns their number (some empty); -1: no room.

    `least`: an area that is rounding; `overlap`: one that neighbours may share.
    """
    if not _any_overlap(of, n, overlap):
        return n
    a = 1
    most = _FRAGMENTS * n
    while a < n < most:
        for b in range(a):
            if of.size[a] == 0:
                break
            if of.size[b] == 0 or of.who[a] == of.who[b]:
                continue
            area, far = _overlap(of, a, b, overlap)
            if area > overlap:
                n = _subtract(of, n, far, a + b - far, least)
                if n < 0:
                    return -1
        a += 1
    return n


@kernel
def _overlap(of: Any, a: int, b: int, least: float) -> Any:
    """Area that parts a and b share, and which of them is farther from the slave there."""
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
    """Take part `near` out of part `far`: what is left goes on as new parts. Returns their number; -1: no room."""
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
            of.plane[n] = of.plane[far]
            copy(of.work, of.work_label, out, of.shape[n], of.label[n])
            of.size[n] = tidy(of.shape[n], of.label[n], out, least)
            n += 1
        m = cut_by_line(of.rest, of.rest_label, m, ax, ay, bx, by1, CHORD, 1, of.work, of.work_label)
        if m < 3:
            break
        copy(of.work, of.work_label, m, of.rest, of.rest_label)
    return n


@kernel
def _any_overlap(of: Any, n: int, least: float) -> Any:
    """Whether any two parts lie over one another: a sweep along the first axis."""
    for a in range(n):
        of.low[a], of.high[a], of.order[a] = np.inf, -np.inf, a
        for k in range(of.size[a]):
            of.low[a] = min(of.low[a], of.shape[a, k, 0])
            of.high[a] = max(of.high[a], of.shape[a, k, 0])
    _sort(of.order, of.low, n)
    for i in range(n):
        a = of.order[i]
        for j in range(i + 1, n):
            b = of.order[j]
            if of.low[b] >= of.high[a]:
                break
            if of.who[a] != of.who[b]:
                area, _ = _overlap(of, a, b, least)
                if area > least:
                    return True
    return False


@kernel
def _sort(order: Any, key: Any, n: int) -> None:
    """Shell's method: a handful of parts nearly always, and never slow."""
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
