"""Narrow phase: the common parts of slave and master patches, as polygons in the slave's mean plane.

The master's corners are projected along the slave's normal, and the polygon is clipped by the slave's edges. A patch
with a non-convex projection is split into two triangles at its re-entrant corner. A part is kept if the master faces
the slave (opposite normals) within the search distances ahead and behind, and if it is larger than _LEAST of the slave
patch. Where several parts overlap, the nearest is kept (`polygon`), so that the areas of the parts of a slave patch
never add up to more than the patch.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.surface.patches import Patches, Reach
from lacmesh.surface.polygon import (
    CHORD,
    MASTER,
    area_of,
    centroid,
    cut_by_polygon,
    make_room,
    nearest_only,
    outside,
    tidy,
)
from lacmesh.threads import in_threads
from lacmesh.topology.boxes import Pairs, joined_starts

#: a part smaller than this, against its slave patch, is rounding, and so is a corner that adds no more: one that last
#: bits make on a straight side would add a triangle to a fan
_LEAST = 1e-12
#: parts that overlap by less than this, against the slave patch, are neighbours
_OVERLAP = 1e-11
#: cosine of the steepest pair that still faces
FACING = 1e-6


class Pieces(NamedTuple):
    """Mortar segments: common parts of a slave and a master patch, sorted by slave patch: `slave`, `master` (patches).

    `vertices[start[k] : start[k + 1]]` (., 2): polygon k, counter-clockwise and convex, in the slave patch's frame;
    `edges`: origin of the edge that leaves each vertex (slave edge 0 to 3, master edge + 4, or 8). `area` (k,).
    """

    slave: Ints
    master: Ints
    start: Ints
    vertices: Floats
    edges: Ints
    area: Floats

    def largest_share(self) -> Floats:
        """(k,): area of the largest triangle in each polygon's fan from its first vertex, over that of the polygon."""
        if not len(self.slave):
            return np.empty(0)
        first = np.repeat(self.start[:-1], np.diff(self.start))
        a = self.vertices - self.vertices[first]
        b = np.roll(a, -1, axis=0)
        twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        twice[self.start[1:] - 1] = 0
        return np.maximum.reduceat(twice, self.start[:-1]) / 2 / self.area


def clip(pairs: Pairs, slave: Patches, master: Patches, reach: Reach) -> Pieces:
    """Clip the candidate pairs; return the common parts within the search distances."""
    clipped = in_threads(lambda rows: _clip_rows(rows, pairs, slave, master, reach), len(slave.n))
    s, m, _, vertices, edges, area = (np.concatenate(v) for v in zip(*clipped, strict=True))
    return Pieces(s, m, joined_starts([p.start for p in clipped]), vertices, edges, area)


def _clip_rows(rows: slice, pairs: Pairs, slave: Patches, master: Patches, reach: Reach) -> Pieces:
    parts, total = 64, 6 * (rows.stop - rows.start) + 64
    size = 5 * total
    while True:
        slaves, masters, start = np.empty(total, np.int64), np.empty(total, np.int64), np.zeros(total + 1, np.int64)
        out = Pieces(slaves, masters, start, np.empty((size, 2)), np.empty(size, np.int8), np.empty(total))
        pieces, corners, enough = _clip_all(rows.start, rows.stop, pairs, slave, master, reach, make_room(parts), out)
        if enough and pieces <= total and corners <= size:
            break
        parts *= 1 if enough else 4
        total, size = max(total, pieces), max(size, corners)
    lengths = pieces, pieces, pieces + 1, corners, corners, pieces
    return Pieces._make(column[:length] for column, length in zip(out, lengths, strict=True))


@kernel
def project(x: Any, n: int, centre: Any, e: Any, back: bool, out: Any) -> None:
    """Write the corners of a master patch in a slave's frame, (p, q, height), into `out`.

    `back`: in reverse order, which is counter-clockwise there.
    """
    for k in range(n):
        for a in range(3):
            out[n - 1 - k if back else k, a] = (
                (x[k, 0] - centre[0]) * e[a, 0] + (x[k, 1] - centre[1]) * e[a, 1] + (x[k, 2] - centre[2]) * e[a, 2]
            )


@kernel
def mean_plane(y: Any, n: int) -> Any:
    """Mean plane of n corners (p, q, height): cosine of its inclination; c0, c1, c2 of its height c0 + c1 p + c2 q."""
    if n == 3:
        ux, uy, uz = y[1, 0] - y[0, 0], y[1, 1] - y[0, 1], y[1, 2] - y[0, 2]
        vx, vy, vz = y[2, 0] - y[0, 0], y[2, 1] - y[0, 1], y[2, 2] - y[0, 2]
    else:
        ux, uy, uz = y[2, 0] - y[0, 0], y[2, 1] - y[0, 1], y[2, 2] - y[0, 2]
        vx, vy, vz = y[3, 0] - y[1, 0], y[3, 1] - y[1, 1], y[3, 2] - y[1, 2]
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    c1 = -nx / nz
    c2 = -ny / nz
    c0 = 0.0
    for k in range(n):
        c0 += (y[k, 2] - c1 * y[k, 0] - c2 * y[k, 1]) / n
    return nz / np.sqrt(nx * nx + ny * ny + nz * nz), c0, c1, c2


@kernel
def _convex_parts(y: Any, n: int, places: Any) -> Any:
    """Split a projected patch into convex parts; return their number, and that of the corners of each.

    `places` (2, 4) takes the indices of the corners of each part.
    """
    for k in range(n):
        places[0, k] = k
    if n == 3:
        return 1, 3
    worst = 0
    least = np.inf
    scale = 0.0
    for k in range(4):
        a = (k + 3) % 4
        b = (k + 1) % 4
        turn = (y[k, 0] - y[a, 0]) * (y[b, 1] - y[k, 1]) - (y[k, 1] - y[a, 1]) * (y[b, 0] - y[k, 0])
        scale = max(scale, abs(turn))
        if turn < least:
            least = turn
            worst = k
    if least >= -1e-14 * scale:
        return 1, 4
    for k in range(3):
        places[0, k] = (worst + k) % 4
    places[1, 0] = worst
    places[1, 1] = (worst + 2) % 4
    places[1, 2] = (worst + 3) % 4
    return 2, 3


@kernel
def _collect(s: int, pairs: Any, slave: Any, master: Any, reach: Any, of: Any, y: Any, places: Any) -> Any:
    """Write the common parts of slave patch s and its candidates into `of`; return their number, -1 without room."""
    parts = 0
    n_s, y_s = slave.n[s], slave.y[s]
    least = _LEAST * slave.area[s]
    for c in range(pairs.start[s], pairs.start[s + 1]):
        m = pairs.other[c]
        n = master.n[m]
        project(master.x[m], n, slave.centre[s], slave.e[s], True, y)
        if outside(y, n, y_s, n_s):
            continue
        cosine, c0, c1, c2 = mean_plane(y, n)
        if not cosine > FACING:
            continue
        low = min(y[0, 2], y[1, 2], y[2, 2], y[n - 1, 2])
        high = max(y[0, 2], y[1, 2], y[2, 2], y[n - 1, 2])
        pieces, corners = _convex_parts(y, n, places)
        for k in range(pieces):
            if parts == len(of.size):
                return -1
            p, label = of.shape[parts], of.label[parts]
            for j in range(corners):
                at = places[k, j]
                p[j, 0] = y[at, 0]
                p[j, 1] = y[at, 1]
                # corners are reversed: the edge that leaves corner `at` is edge n - 2 - at of the patch
                whole = places[k, j + 1 if j + 1 < corners else 0] == (at + 1) % n
                label[j] = MASTER + (2 * n - 2 - at) % n if whole else CHORD
            if not area_of(p, corners) > least:
                continue
            v = cut_by_polygon(p, label, corners, y_s, n_s, 0, of.work, of.work_label)
            if v < 3 or not area_of(p, v) > least:
                continue
            px, py = centroid(p, v)
            # inside the patch's own range of heights, so that the tree's boxes cannot disagree
            h = min(max(c0 + c1 * px + c2 * py, low), high)
            if h <= reach.ahead[s] and -h <= min(reach.behind[s] + reach.deep[m], reach.limit):
                of.size[parts] = tidy(p, label, v, least)
                of.plane[parts, 0] = c0
                of.plane[parts, 1] = c1
                of.plane[parts, 2] = c2
                of.who[parts] = m
                parts += 1
    return parts


@kernel
def _clip_all(begin: int, end: int, pairs: Any, slave: Any, master: Any, reach: Any, of: Any, out: Any) -> Any:
    """Fill `out` for slave patches begin to end; return (pieces, vertices, True if `of` was large enough).

    If there are more than `out` has room for, nothing beyond its end is written: call again with more room.
    """
    total = 0
    size = 0
    y = np.empty((4, 3))
    places = np.empty((2, 4), np.int64)
    for s in range(begin, end):
        parts = _collect(s, pairs, slave, master, reach, of, y, places)
        if parts > 1:
            parts = nearest_only(of, parts, _LEAST * slave.area[s], _OVERLAP * slave.area[s])
        if parts < 0:
            return total, size, False
        for k in range(parts):
            v = of.size[k]
            area = area_of(of.shape[k], v)
            if not area > 0:  # nothing is left of it, or what rounding left has no area
                continue
            if total < len(out.slave) and size + v <= len(out.edges):
                out.slave[total] = s
                out.master[total] = of.who[k]
                out.area[total] = area
                for j in range(v):
                    out.vertices[size + j, 0] = of.shape[k, j, 0]
                    out.vertices[size + j, 1] = of.shape[k, j, 1]
                    out.edges[size + j] = of.label[k, j]
                out.start[total + 1] = size + v
            size += v
            total += 1
    return total, size, True
