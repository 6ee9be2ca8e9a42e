"""Broad phase: candidate master patches for each slave patch, found in a tree of boxes.

The search region of a slave patch is a prism: its bounding rectangle in its own plane, swept along its normal from
`behind` to `ahead`. The tree is a complete binary tree over the boxes of the master's patches, in the order of a Morton
curve; a node is opened if its box intersects the prism (separating axes: the three of the prism). No patch in the prism
can be missed, whatever the sizes of faces.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.surface.patches import Patches
from lacmesh.threads import in_threads
from lacmesh.topology.boxes import LEAF, along_curve, bounding_tree

T = TypeVar("T")


class Boxes(NamedTuple):
    """Boxes by their centres (b, 3) and half their sides (b, 3)."""

    centre: Floats
    half: Floats


class Tree(NamedTuple):
    """Complete binary tree of boxes, (nodes, 3) each: node k has children 2k + 1 and 2k + 2; `order`: the patches.

    The last (nodes + 1) / 2 nodes are leaves, each of LEAF entries of `order` (-1 where there is none).
    """

    centre: Floats
    half: Floats
    order: Ints


class Pairs(NamedTuple):
    """Candidate pairs: the masters of slave patch s are `master[start[s] : start[s + 1]]`, ascending."""

    start: Ints
    master: Ints


class Reach(NamedTuple):
    """Search distances of slave patches along their normals: `ahead` (slave patches,), and a distance behind.

    The latter is `behind` (slave patches,) plus the master patch's `deep` (master patches,), but at most `limit`.
    """

    ahead: Floats
    behind: Floats
    deep: Floats
    limit: float


def build_tree(p: Patches) -> Tree:
    """Build the tree over some patches."""
    low, high = _extent(p.x, p.n)
    order = along_curve(low, high)
    low, high, last = bounding_tree(low[order], high[order])
    order = np.concatenate([order, np.full(int(last[0]) - len(order), -1)])
    empty = ~(low <= high)
    with np.errstate(invalid="ignore"):
        centre, half = np.where(empty, 0.0, (low + high) / 2), np.where(empty, -np.inf, (high - low) / 2)
    return Tree(centre, half, order)


def candidates(slave: Patches, master: Patches, reach: Reach) -> Pairs:
    """Find the master patches whose boxes intersect the prisms of slave patches."""
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
    prisms = Boxes(origin, half)
    boxes = Boxes((low + high) / 2, (high - low) / 2)

    def run(rows: slice) -> Pairs:
        start = np.zeros(rows.stop - rows.start + 1, np.int64)
        masters = np.empty(12 * len(start) + 64, np.int64)
        count = _query(rows.start, prisms, slave.e, tree, boxes, start, masters)
        if count > len(masters):
            masters = np.empty(count, np.int64)
            _query(rows.start, prisms, slave.e, tree, boxes, start, masters)
        return Pairs(start, masters[:count])

    parts = in_parts(run, len(slave.n))
    return Pairs(joined_starts([p.start for p in parts]), np.concatenate([p.master for p in parts]))


def in_parts(run: Callable[[slice], T], count: int) -> list[T]:
    """Call `run` on slices of the rows 0 to `count`, one in each thread; return the results in order."""
    parts: dict[tuple[int, int], T] = {}

    def keep(rows: slice) -> None:
        parts[rows.start, rows.stop] = run(rows)

    in_threads(keep, count)
    return [parts[key] for key in sorted(parts)]


def joined_starts(starts: list[Ints]) -> Ints:
    """Join several lists of starts, each from 0, into one for the concatenated rows."""
    before = np.cumsum([0, *(int(s[-1]) for s in starts)])
    return np.concatenate([*(s[:-1] + b for s, b in zip(starts, before, strict=False)), before[-1:]])


def _extent(x: Floats, n: Ints) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates of patches with n corners at x (p, 4, 3)."""
    low, high = np.minimum(x[:, 0], x[:, 1]), np.maximum(x[:, 0], x[:, 1])
    for k in (2, 3):
        corner = np.where((n > k)[:, None], x[:, k], x[:, 0])
        np.minimum(low, corner, out=low)
        np.maximum(high, corner, out=high)
    return low, high


@kernel
def _meets(prisms: Any, e: Any, s: int, boxes: Any, k: int) -> Any:
    """True if no axis of prism s separates it from box k."""
    x = boxes.centre[k, 0] - prisms.centre[s, 0]
    y = boxes.centre[k, 1] - prisms.centre[s, 1]
    z = boxes.centre[k, 2] - prisms.centre[s, 2]
    half = boxes.half[k]
    for a in range(3):
        axis = e[s, a]
        apart = axis[0] * x + axis[1] * y + axis[2] * z
        reach = prisms.half[s, a] + abs(axis[0]) * half[0] + abs(axis[1]) * half[1] + abs(axis[2]) * half[2]
        if not abs(apart) <= reach:
            return False
    return True


@kernel
def _sort(values: Any, begin: int, end: int) -> None:
    """Sort values[begin:end] with Shell's method: nearly always a few values, and never slow for many."""
    step = 1
    while 9 * step < end - begin:
        step = 3 * step + 1
    while step > 0:
        for i in range(begin + step, end):
            value = values[i]
            k = i
            while k >= begin + step and values[k - step] > value:
                values[k] = values[k - step]
                k -= step
            values[k] = value
        step //= 3


@kernel
def _query(first: int, prisms: Any, e: Any, tree: Any, boxes: Any, start: Any, masters: Any) -> Any:
    """Fill `start` and `masters` for the prisms from `first` on; return the number of pairs.

    If that exceeds the room, call again with more.
    """
    first_leaf = len(tree.centre) // 2
    stack = np.empty(128, np.int64)
    count = 0
    for row in range(len(start) - 1):
        s = first + row
        stack[0] = 0
        top = 1
        begin = count
        while top > 0:
            top -= 1
            node = stack[top]
            if not _meets(prisms, e, s, tree, node):
                continue
            if node < first_leaf:
                stack[top] = 2 * node + 1
                stack[top + 1] = 2 * node + 2
                top += 2
                continue
            for k in range((node - first_leaf) * LEAF, (node - first_leaf + 1) * LEAF):
                m = tree.order[k]
                if m >= 0 and _meets(prisms, e, s, boxes, m):
                    if count < len(masters):
                        masters[count] = m
                    count += 1
        if count <= len(masters):
            _sort(masters, begin, count)
        start[row + 1] = count
    return count
