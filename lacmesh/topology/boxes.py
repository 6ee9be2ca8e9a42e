"""Pairs of intersecting boxes, by a compiled tree over the boxes. Cost grows as n log n and with the pairs found."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints

Array = NDArray[Any]
#: boxes in a leaf
LEAF = 4
_BITS = 20
#: pairs of boxes up to which each is compared with each: a small model is checked before the tree could be compiled
_FEW = 1 << 19


def meeting(low: Floats, high: Floats, other_low: Floats, other_high: Floats) -> tuple[Ints, Ints]:
    """(i, j): all pairs of intersecting boxes, i of the first set (low, high (n, 3)) and j of the other.

    Boxes that only touch intersect. A box with a NaN coordinate intersects nothing.
    """
    if len(low) * len(other_low) <= _FEW:
        return _compared(low, high, other_low, other_high)
    # both along one curve, so that what is near is near in memory
    mine, other = along_curve(low, high), along_curve(other_low, other_high)
    tree = bounding_tree(other_low[other], other_high[other])
    i, j = _query(low[mine], high[mine], other_low[other], other_high[other], *tree, False)
    return mine[i], other[j]


def meeting_each_other(low: Floats, high: Floats) -> tuple[Ints, Ints]:
    """(i, j), i < j: all pairs of intersecting boxes (low, high (n, 3)) of one set, as in `meeting`."""
    if len(low) ** 2 <= _FEW:
        i, j = _compared(low, high, low, high)
        return i[i < j], j[i < j]
    order = along_curve(low, high)
    low, high = low[order], high[order]
    i, j = (order[rows] for rows in _query(low, high, low, high, *bounding_tree(low, high), True))
    return np.minimum(i, j), np.maximum(i, j)


def _compared(low: Floats, high: Floats, other_low: Floats, other_high: Floats) -> tuple[Ints, Ints]:
    """(i, j): all pairs of intersecting boxes, each compared with each."""
    meets = np.ones((len(low), len(other_low)), bool)
    for k in range(3):
        meets &= (low[:, k, None] <= other_high[:, k]) & (high[:, k, None] >= other_low[:, k])
    i, j = np.nonzero(meets)
    return i, j


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


def bounding_tree(low: Floats, high: Floats) -> tuple[Floats, Floats, Ints]:
    """(low, high, last) of the nodes of a complete binary tree; each leaf bounds LEAF boxes, in the order given.

    `last`: the index after the last box below a node.
    """
    width = 1 << max(0, (-(-len(low) // LEAF) - 1).bit_length())
    more = ((0, width * LEAF - len(low)), (0, 0))
    low = np.pad(low, more, constant_values=np.inf).reshape(width, LEAF, 3)
    high = np.pad(high, more, constant_values=-np.inf).reshape(width, LEAF, 3)
    lows, highs = [np.fmin.reduce(low, axis=1)], [np.fmax.reduce(high, axis=1)]
    last = [np.arange(1, width + 1) * LEAF]
    while len(lows[0]) > 1:
        last.insert(0, last[0][1::2])
        lows.insert(0, np.fmin(lows[0][::2], lows[0][1::2]))
        highs.insert(0, np.fmax(highs[0][::2], highs[0][1::2]))
    return np.concatenate(lows), np.concatenate(highs), np.concatenate(last)


@kernel
def _meet(low: Array, high: Array, i: int, other_low: Array, other_high: Array, j: int) -> bool:
    for k in range(3):  # noqa: SIM110 (compiled: a generator would cost)
        if not (low[i, k] <= other_high[j, k] and high[i, k] >= other_low[j, k]):
            return False
    return True


@kernel
def _query(
    low: Array,
    high: Array,
    other_low: Array,
    other_high: Array,
    tree_low: Array,
    tree_high: Array,
    last: Array,
    each_other: bool,
) -> tuple[Array, Array]:
    first_leaf = len(tree_low) // 2
    pairs = np.empty((max(16, 6 * len(low)), 2), np.int64)
    stack = np.empty(128, np.int64)
    count = 0
    for i in range(len(low)):
        after = i + 1 if each_other else 0
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            if last[node] <= after or not _meet(low, high, i, tree_low, tree_high, node):
                continue
            if node < first_leaf:
                stack[top], stack[top + 1] = 2 * node + 1, 2 * node + 2
                top += 2
                continue
            for j in range(max(after, last[node] - LEAF), min(last[node], len(other_low))):
                if _meet(low, high, i, other_low, other_high, j):
                    if count == len(pairs):
                        more = np.empty((2 * count, 2), np.int64)
                        for pair in range(count):
                            more[pair, 0], more[pair, 1] = pairs[pair, 0], pairs[pair, 1]
                        pairs = more
                    pairs[count, 0], pairs[count, 1] = i, j
                    count += 1
    return pairs[:count, 0], pairs[:count, 1]
