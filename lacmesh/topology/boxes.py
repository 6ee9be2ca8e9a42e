"""Pairs of intersecting boxes, by a compiled tree over the boxes. Cost grows as n log n and with the pairs found.

The tree is a complete binary tree over boxes along the axes, in the order of a Morton curve. It is asked for the boxes
that meet prisms, which are boxes with axes of their own: a node is opened if none of these axes separates it from the
prism. No box in a prism can be missed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.threads import in_threads

#: boxes in a leaf
LEAF = 4
_BITS = 20
#: pairs of boxes up to which each is compared with each: a small model is checked before the tree could be compiled
_FEW = 1 << 19
#: coordinates beyond are taken as this one; round-off of a box, against its coordinates
_FARTHEST, _ROUNDING = 1e300, 1e-15


class Boxes(NamedTuple):
    """Boxes by their centres (b, 3) and half their sides (b, 3), minus infinity where there is no box."""

    centre: Floats
    half: Floats

    @classmethod
    def between(cls, low: Floats, high: Floats) -> Boxes:
        """Return the boxes between corners (b, 3), as much larger as rounding may make them smaller."""
        low, high = np.clip(low, -_FARTHEST, _FARTHEST), np.clip(high, -_FARTHEST, _FARTHEST)
        empty = ~(low <= high).all(axis=1, keepdims=True)
        half = (high - low) / 2 + _ROUNDING * np.maximum(np.abs(low), np.abs(high))
        return cls(np.where(empty, 0.0, (low + high) / 2), np.where(empty, -np.inf, half))


class Pairs(NamedTuple):
    """Pairs of prisms and boxes: the boxes that prism s meets are `other[start[s] : start[s + 1]]`, ascending."""

    start: Ints
    other: Ints

    @property
    def first(self) -> Ints:
        """The prism of each pair."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))


def meeting(low: Floats, high: Floats, other_low: Floats, other_high: Floats) -> tuple[Ints, Ints]:
    """(i, j): all pairs of intersecting boxes, i of the first set (low, high (n, 3)) and j of the other.

    Boxes that only touch intersect. A box with a NaN coordinate intersects nothing.
    """
    i: Ints
    j: Ints
    if len(low) * len(other_low) <= _FEW:
        i, j = np.nonzero(np.ones((len(low), len(other_low)), bool))
    else:
        order = along_curve(low, high)  # so that what is near is near in memory
        axes = np.tile(np.eye(3), (len(low), 1, 1))
        pairs = boxes_in(Boxes.between(low[order], high[order]), axes, other_low, other_high)
        i, j = order[pairs.first], pairs.other
    for k in range(3):
        meets = (low[i, k] <= other_high[j, k]) & (high[i, k] >= other_low[j, k])
        i, j = i[meets], j[meets]
    return i, j


def meeting_each_other(low: Floats, high: Floats) -> tuple[Ints, Ints]:
    """(i, j), i < j: all pairs of intersecting boxes (low, high (n, 3)) of one set, as in `meeting`."""
    i, j = meeting(low, high, low, high)
    return i[i < j], j[i < j]


def along_curve(low: Floats, high: Floats) -> Ints:
    """(n,): the order of boxes along a Morton curve through their centres: neighbours are near each other."""
    x = np.nan_to_num((low + high) / 2, nan=0.0, posinf=0.0, neginf=0.0)
    extent = np.ptp(x, axis=0).max()
    cell = ((x - x.min(axis=0)) / (extent if extent > 0 else 1.0) * (2**_BITS - 1)).astype(np.uint64)
    code = np.zeros(len(x), np.uint64)
    for axis, spread in enumerate(cell.T):
        for shift, mask in (
            (32, 0x1F00000000FFFF),
            (16, 0x1F0000FF0000FF),
            (8, 0x100F00F00F00F00F),
            (4, 0x10C30C30C30C30C3),
            (2, 0x1249249249249249),
        ):
            spread = (spread | (spread << np.uint64(shift))) & np.uint64(mask)
        code |= spread << np.uint64(axis)
    return np.argsort(code.astype(np.int64), kind="stable")


def boxes_in(prisms: Boxes, axes: Floats, low: Floats, high: Floats) -> Pairs:
    """Find the boxes between corners low, high (n, 3) that meet prisms with unit vectors `axes` (p, 3, 3)."""
    if not len(low) or not len(prisms.half):
        return Pairs(np.zeros(len(prisms.half) + 1, np.int64), np.empty(0, np.int64))
    order = along_curve(low, high)
    width = 1 << max(0, (-(-len(low) // LEAF) - 1).bit_length())  # leaves of the tree
    more = width * LEAF - len(low)
    lows, highs = (
        [reduce(np.pad(x[order], ((0, more), (0, 0)), constant_values=np.nan).reshape(width, LEAF, 3), axis=1)]
        for x, reduce in ((low, np.fmin.reduce), (high, np.fmax.reduce))
    )
    while len(lows[0]) > 1:
        lows.insert(0, np.fmin(lows[0][::2], lows[0][1::2]))
        highs.insert(0, np.fmax(highs[0][::2], highs[0][1::2]))
    nodes, boxes = Boxes.between(np.concatenate(lows), np.concatenate(highs)), Boxes.between(low, high)
    order = np.append(order, np.full(more, -1))

    def run(rows: slice) -> Pairs:
        start = np.zeros(rows.stop - rows.start + 1, np.int64)
        other = np.empty(12 * len(start) + 64, np.int64)
        count = _query(rows.start, prisms, axes, nodes, order, boxes, start, other)
        if count > len(other):
            other = np.empty(count, np.int64)
            _query(rows.start, prisms, axes, nodes, order, boxes, start, other)
        shift = len(low) * np.repeat(np.arange(len(start) - 1), np.diff(start))
        return Pairs(start, np.sort(shift + other[:count]) - shift)

    parts = in_threads(run, len(prisms.half))
    return Pairs(joined_starts([part.start for part in parts]), np.concatenate([part.other for part in parts]))


def joined_starts(starts: list[Ints]) -> Ints:
    """Join several lists of starts, each from 0, into one for the concatenated rows."""
    return np.append(0, np.cumsum(np.concatenate([np.diff(start) for start in starts])))


@kernel
def _meets(prisms: Any, axes: Any, s: int, boxes: Any, k: int) -> Any:
    """True if no axis of prism s separates it from box k."""
    x = boxes.centre[k, 0] - prisms.centre[s, 0]
    y = boxes.centre[k, 1] - prisms.centre[s, 1]
    z = boxes.centre[k, 2] - prisms.centre[s, 2]
    half = boxes.half[k]
    for a in range(3):
        axis = axes[s, a]
        apart = axis[0] * x + axis[1] * y + axis[2] * z
        reach = prisms.half[s, a] + abs(axis[0]) * half[0] + abs(axis[1]) * half[1] + abs(axis[2]) * half[2]
        if not abs(apart) <= reach:
            return False
    return True


@kernel
def _query(first: int, prisms: Any, axes: Any, nodes: Any, order: Any, boxes: Any, start: Any, other: Any) -> Any:
    """Fill `start` and `other` for the prisms from `first` on; return the number of pairs.

    Node k of the tree has children 2k + 1 and 2k + 2; `order`: the boxes leaf by leaf, -1 where there is none. If there
    are more pairs than there is room, call again with more.
    """
    first_leaf = len(nodes.centre) // 2
    stack = np.empty(128, np.int64)
    count = 0
    for row in range(len(start) - 1):
        s = first + row
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            if not _meets(prisms, axes, s, nodes, node):
                continue
            if node < first_leaf:
                stack[top] = 2 * node + 1
                stack[top + 1] = 2 * node + 2
                top += 2
                continue
            for k in range((node - first_leaf) * LEAF, (node - first_leaf + 1) * LEAF):
                m = order[k]
                if m >= 0 and _meets(prisms, axes, s, boxes, m):
                    if count < len(other):
                        other[count] = m
                    count += 1
        start[row + 1] = count
    return count
