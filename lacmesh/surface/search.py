"""Broad phase: which master patches may lie over a slave patch, found in a tree of boxes.

A slave patch looks along its normal: what it may face lies in a prism, its bounding rectangle in its own plane swept
from `behind` to `ahead`. The tree is a complete binary tree over the boxes of the master's patches, in the order of a
Morton curve; a node is opened where its box meets the prism (separating axes: the three of the prism). Nothing that
lies in the prism can be missed, whatever the sizes of faces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from lacmesh.mesh import Floats, Ints
from lacmesh.surface.patches import Patches

#: patches in a leaf
_LEAF = 4
_BITS = 10


class Tree(NamedTuple):
    """Boxes of a complete binary tree, (nodes, 3) each: node k has children 2k + 1 and 2k + 2; `order`: the patches.

    The last (nodes + 1) / 2 nodes are leaves, each of _LEAF entries of `order` (-1 where there is none).
    """

    centre: Floats
    half: Floats
    order: Ints


class Pairs(NamedTuple):
    """Candidates: those of slave patch s are `master[start[s] : start[s + 1]]`, ascending."""

    start: Ints
    master: Ints


class Reach(NamedTuple):
    """How far a slave patch looks along its normal: up to `ahead` (slave patches,), and behind itself as far as `behind`
    (slave patches,) and the master patch's `deep` (master patches,) added, but no more than `limit`.
    """

    ahead: Floats
    behind: Floats
    deep: Floats
    limit: float


def build_tree(p: Patches) -> Tree:
    """The tree over some patches."""
    low, high = _extent(p.x, p.n)
    order = np.argsort(_morton((low + high) / 2), kind="stable")
    leaves = max(1, -(-len(order) // _LEAF))
    width = 1 << (leaves - 1).bit_length()
    order = np.concatenate([order, np.full(width * _LEAF - len(order), -1)])
    lows = np.where((order >= 0)[:, None], low[order], np.inf)
    highs = np.where((order >= 0)[:, None], high[order], -np.inf)
    levels = [(lows.reshape(width, _LEAF, 3).min(axis=1), highs.reshape(width, _LEAF, 3).max(axis=1))]
    while len(levels[0][0]) > 1:
        a, b = levels[0]
        levels.insert(0, (np.minimum(a[::2], a[1::2]), np.maximum(b[::2], b[1::2])))
    low, high = (np.concatenate([level[k] for level in levels]) for k in range(2))
    empty = ~(low <= high)
    with np.errstate(invalid="ignore"):
        centre, half = np.where(empty, 0.0, (low + high) / 2), np.where(empty, -np.inf, (high - low) / 2)
    return Tree(centre, half, order)


def _morton(x: Floats) -> Ints:
    """(p,): places along a Morton curve of points (p, 3)."""
    extent = np.ptp(x, axis=0).max()
    cell = ((x - x.min(axis=0)) / (extent if extent > 0 else 1.0) * (2**_BITS - 1)).astype(np.int64)
    code = np.zeros(len(x), np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


def candidates(slave: Patches, master: Patches, reach: Reach) -> Pairs:
    """Master patches whose boxes meet the prisms of slave patches."""
    if not len(slave.n) or not len(master.n):
        return Pairs(np.zeros(len(slave.n) + 1, np.int64), np.empty(0, np.int64))
    tree = build_tree(master)
    low, high = _extent(slave.y, slave.n)
    low[:, 2] -= np.minimum(reach.behind + reach.deep.max(initial=0.0), reach.limit)
    high[:, 2] += reach.ahead
    middle, half = (low + high) / 2, (high - low) / 2
    half += 1e-12 * (half[:, :1] + half[:, 1:2] + half[:, 2:])
    origin = slave.centre + (slave.e * middle[:, :, None]).sum(axis=1)
    low, high = _extent(master.x, master.n)
    start = np.zeros(len(slave.n) + 1, np.int64)
    found = np.empty(12 * len(slave.n) + 64, np.int64)
    while True:
        count = _query(origin, slave.e, half, *tree, _LEAF, (low + high) / 2, (high - low) / 2, start, found)
        if count <= len(found):
            return Pairs(start, found[:count])
        found = np.empty(count, np.int64)


def _extent(x: Floats, n: Ints) -> tuple[Floats, Floats]:
    """Least and greatest coordinates of patches with n corners at x (p, 4, 3)."""
    low, high = np.minimum(x[:, 0], x[:, 1]), np.maximum(x[:, 0], x[:, 1])
    for k in (2, 3):
        corner = np.where((n > k)[:, None], x[:, k], x[:, 0])
        np.minimum(low, corner, out=low)
        np.maximum(high, corner, out=high)
    return low, high


@njit(cache=True, error_model="numpy")
def _meets(origin, e, half, s, centre, box, k):
    """Whether box k meets prism s, seen along the prism's axes."""
    x, y, z = centre[k, 0] - origin[s, 0], centre[k, 1] - origin[s, 1], centre[k, 2] - origin[s, 2]
    for a in range(3):
        apart = e[s, a, 0] * x + e[s, a, 1] * y + e[s, a, 2] * z
        reach = half[s, a] + abs(e[s, a, 0]) * box[k, 0] + abs(e[s, a, 1]) * box[k, 1] + abs(e[s, a, 2]) * box[k, 2]
        if not abs(apart) <= reach:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _sort(values, begin, end):
    """Insertion: the lists are short."""
    for i in range(begin + 1, end):
        value = values[i]
        k = i
        while k > begin and values[k - 1] > value:
            values[k] = values[k - 1]
            k -= 1
        values[k] = value


@njit(cache=True, error_model="numpy")
def _query(origin, e, half, centre, box, order, leaf, own_centre, own_box, start, found):
    """Fill `start` and `found`. Returns how many there are: where more than there is room for, call again with more."""
    first_leaf = len(centre) // 2
    stack = np.empty(128, np.int64)
    count = 0
    start[0] = 0
    for s in range(len(origin)):
        stack[0] = 0
        top = 1
        begin = count
        while top > 0:
            top -= 1
            node = stack[top]
            if not _meets(origin, e, half, s, centre, box, node):
                continue
            if node < first_leaf:
                stack[top] = 2 * node + 1
                stack[top + 1] = 2 * node + 2
                top += 2
                continue
            for k in range((node - first_leaf) * leaf, (node - first_leaf + 1) * leaf):
                m = order[k]
                if m >= 0 and _meets(origin, e, half, s, own_centre, own_box, m):
                    if count < len(found):
                        found[count] = m
                    count += 1
        if count <= len(found):
            _sort(found, begin, count)
        start[s + 1] = count
    return count
