"""Advancing front: pairs found from their neighbours (PANG: Gander and Japhet, ACM Trans. Math. Softw. 40, 2013).

From an intersecting pair, the front floods the master's neighbours as long as they intersect the same slave face; the
slave face's own neighbours then start from the masters it intersected. Parts that a front cannot reach (another part of
either surface, beyond a hole, or another layer) are seeded again from the tree: every slave face is tested against the
candidates from the tree, and floods on from those that the front has not tried. So the result is the pairs of the tree
without those that do not intersect. (The manual's 3.3.2.1 repairs the same weakness by trying every pair.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Ints
from lacmesh.surface.clip import FACING, mean_plane, project
from lacmesh.surface.patches import Patches
from lacmesh.surface.polygon import outside
from lacmesh.surface.search import Pairs


def advance(slave: Patches, master: Patches, pairs: Pairs, beyond_s: Ints, beyond_m: Ints) -> Pairs:
    """Find the pairs of patches with intersecting projections.

    `pairs`: candidates from the tree; `beyond_*` (f, 4): neighbours of the faces.
    """
    of_s, of_m = (np.searchsorted(p.face, np.arange(len(p.G) + 1)) for p in (slave, master))
    room = 2 * len(pairs.master) + 64
    while True:
        s, m = np.empty(room, np.int64), np.empty(room, np.int64)
        count = _advance(pairs, slave, master, of_s, of_m, beyond_s, beyond_m, s, m)
        if count <= room:
            break
        room = count
    s, m = s[:count], m[:count]
    order = np.lexsort((m, s))
    start = np.searchsorted(s[order], np.arange(len(slave.n) + 1))
    return Pairs(start, m[order])


@kernel
def _meet(f: int, g: int, slave: Any, master: Any, of_s: Any, of_m: Any, s: Any, m: Any, count: int, y: Any) -> Any:
    """Append the pairs of patches of faces f and g that intersect and face each other; return the number of pairs."""
    for a in range(of_s[f], of_s[f + 1]):
        for b in range(of_m[g], of_m[g + 1]):
            project(master.x[b], master.n[b], slave.centre[a], slave.e[a], True, y)
            if slave.n[a] == 2:  # segments: they face where the reversed master runs as the slave does
                if not (y[1, 0] > y[0, 0] and y[0, 0] < slave.y[a, 1, 0] and y[1, 0] > slave.y[a, 0, 0]):
                    continue
            elif outside(y, master.n[b], slave.y[a], slave.n[a]) or not mean_plane(y, master.n[b])[0] > FACING:
                continue
            if count < len(s):
                s[count], m[count] = a, b
            count += 1
    return count


@kernel
def _advance(
    pairs: Any, slave: Any, master: Any, of_s: Any, of_m: Any, beyond_s: Any, beyond_m: Any, s: Any, m: Any
) -> Any:
    """Fill s and m with the pairs; return their number. If that exceeds the room, call again with more."""
    count = 0
    y = np.empty((4, 3))
    queue = np.empty(len(beyond_s), np.int64)
    seed = np.full(len(beyond_s), -1, np.int64)  # a master face that a neighbour met
    known = np.zeros(len(beyond_s), np.bool_)
    tried = np.full(len(beyond_m), -1, np.int64)  # the slave face that a master face was last tried with
    flood = np.empty(len(beyond_m) + 1, np.int64)
    for root in range(len(beyond_s)):
        if known[root]:
            continue
        known[root] = True
        queue[0] = root
        head, tail = 0, 1
        while head < tail:
            f = queue[head]
            head += 1
            met = -1
            top = 0
            if seed[f] >= 0:
                flood[0] = seed[f]
                tried[seed[f]] = f
                top = 1
            at = pairs.start[of_s[f]]
            end = pairs.start[of_s[f + 1]]
            while True:
                while top > 0:
                    top -= 1
                    g = flood[top]
                    before = count
                    count = _meet(f, g, slave, master, of_s, of_m, s, m, count, y)
                    if count == before:
                        continue
                    met = g
                    for k in range(4):
                        other = beyond_m[g, k]
                        if other >= 0 and tried[other] != f:
                            tried[other] = f
                            flood[top] = other
                            top += 1
                # repair: a face in reach that the front has not tried
                while at < end and tried[master.face[pairs.master[at]]] == f:
                    at += 1
                if at == end:
                    break
                flood[0] = master.face[pairs.master[at]]
                tried[flood[0]] = f
                top = 1
            for k in range(4):
                other = beyond_s[f, k]
                if other >= 0:
                    if seed[other] < 0:
                        seed[other] = met
                    if not known[other]:
                        known[other] = True
                        queue[tail] = other
                        tail += 1
    return count
