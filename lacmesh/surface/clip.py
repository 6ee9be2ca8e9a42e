"""Narrow phase: what a slave patch and a master patch share, as polygons in the slave's mean plane.

The master's corners are projected along the slave's normal, and the polygon clipped by the slave's edges (Sutherland
and Hodgman, Comm. ACM 17, 1974). A patch whose projection is not convex goes as two triangles, cut at the corner that
goes in. A part counts where the master faces the slave (normals opposed), no farther ahead or behind than asked, and
larger than _LEAST of the slave patch: no two vertices are compared, so that edges and corners that coincide, or nearly
do, cost nothing but slivers. Where several parts lie over one another the nearest keeps the place, so that the parts
of a slave patch never add up to more than the patch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from lacmesh.mesh import Floats, Ints
from lacmesh.surface.patches import Patches
from lacmesh.surface.search import Pairs, Reach

#: a part smaller than this, against its slave patch, is rounding
_LEAST = 1e-14
#: parts that overlap by less than this, against the slave patch, are neighbours
_OVERLAP = 1e-11
#: cosine of the steepest pair that still faces
_FACING = 1e-6
_ROOM = 40
#: parts that layers may break the parts of a slave patch into, each: beyond, faces cross one another at random
_FRAGMENTS = 64
#: what made an edge: edge k of the slave patch, edge k of the master patch (+ MASTER), or no edge of either (CHORD)
MASTER, CHORD = 4, 8


class Pieces(NamedTuple):
    """Parts that a slave and a master patch share, a row each, by slave patch: `slave`, `master` (patches).

    `vertices[start[k] : start[k + 1]]` (., 2): polygon k, counter-clockwise and convex, in the slave patch's frame;
    `edges`: what made the edge that leaves each vertex (slave edge 0 to 3, master edge + 4, or 8). `area` (k,).
    """

    slave: Ints
    master: Ints
    start: Ints
    vertices: Floats
    edges: Ints
    area: Floats

    def largest_share(self) -> Floats:
        """(k,): the largest triangle of each polygon's fan from its first vertex, against the polygon."""
        if not len(self.slave):
            return np.empty(0)
        first = np.repeat(self.start[:-1], np.diff(self.start))
        a = self.vertices - self.vertices[first]
        b = np.roll(a, -1, axis=0)
        twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        twice[self.start[1:] - 1] = 0
        return np.maximum.reduceat(twice, self.start[:-1]) / 2 / self.area

    def take(self, rows: Ints) -> Pieces:
        """Some of the pieces, in the order of `rows`."""
        count = np.diff(self.start)[rows]
        start = np.concatenate([[0], np.cumsum(count)])
        at = np.arange(start[-1]) + np.repeat(self.start[rows] - start[:-1], count)
        return Pieces(self.slave[rows], self.master[rows], start, self.vertices[at], self.edges[at], self.area[rows])


def clip(pairs: Pairs, slave: Patches, master: Patches, reach: Reach) -> Pieces:
    """The parts of candidates that lie within reach."""
    parts, total = 64, 3 * (len(slave.n) + len(master.n)) + 64
    size = 5 * total
    while True:
        room = (
            np.empty((parts, _ROOM, 2)), np.zeros((parts, _ROOM), np.int8), np.zeros(parts, np.int64),
            np.empty((parts, 3)), np.empty(parts, np.int64), np.empty(parts), np.empty(parts), np.empty(parts, np.int64),
        )  # fmt: skip
        made = (
            np.empty(total, np.int64), np.empty(total, np.int64), np.empty(total), np.empty(total + 1, np.int64),
            np.empty((size, 2)), np.empty(size, np.int8),
        )  # fmt: skip
        pieces, corners, most = _clip_all(
            pairs.start, pairs.master, slave.n, slave.centre, slave.e, slave.y, slave.area, master.n, master.x,
            reach.ahead, reach.behind, reach.deep, reach.limit, *room, *made,
        )  # fmt: skip
        if most >= 0 and pieces <= total and corners <= size:
            break
        parts = 4 * parts if most < 0 else parts
        total, size = max(total, pieces), max(size, corners)
    s, m, area, first, vertices, edges = made
    return Pieces(s[:pieces], m[:pieces], first[: pieces + 1], vertices[:corners], edges[:corners], area[:pieces])


@njit(cache=True, error_model="numpy")
def area_of(p, n):
    """Area of a polygon p (., 2) of n vertices; from its first vertex, so that a small one far away keeps digits."""
    twice = 0.0
    for k in range(1, n - 1):
        twice += (p[k, 0] - p[0, 0]) * (p[k + 1, 1] - p[0, 1]) - (p[k, 1] - p[0, 1]) * (p[k + 1, 0] - p[0, 0])
    return twice / 2


@njit(cache=True, error_model="numpy")
def centroid(p, n):
    """Centroid of a convex polygon; the mean of its vertices where it has hardly an area."""
    x = 0.0
    y = 0.0
    twice = 0.0
    mx = 0.0
    my = 0.0
    size = 0.0
    for k in range(n):
        mx += p[k, 0] / n
        my += p[k, 1] / n
        size = max(size, abs(p[k, 0] - p[0, 0]), abs(p[k, 1] - p[0, 1]))
    for k in range(1, n - 1):
        ax = p[k, 0] - p[0, 0]
        ay = p[k, 1] - p[0, 1]
        bx = p[k + 1, 0] - p[0, 0]
        by = p[k + 1, 1] - p[0, 1]
        t = ax * by - ay * bx
        twice += t
        x += t * (ax + bx)
        y += t * (ay + by)
    if not twice > 1e-9 * size * size:
        return mx, my
    return p[0, 0] + x / (3 * twice), p[0, 1] + y / (3 * twice)


@njit(cache=True, error_model="numpy")
def cut_by_line(p, label, n, ax, ay, bx, by, mark, side, q, made):
    """The part of convex polygon p (n vertices) to the left of the line a -> b (right where side = -1), into q.

    The new edge is labelled `mark`. Returns the number of vertices.
    """
    m = 0
    nx = -(by - ay) * side
    ny = (bx - ax) * side
    if nx == 0.0 and ny == 0.0:  # two corners in one place bound nothing: all is inside, nothing outside
        if side < 0:
            return 0
        for k in range(n):
            q[k, 0] = p[k, 0]
            q[k, 1] = p[k, 1]
            made[k] = label[k]
        return n
    before = (p[n - 1, 0] - ax) * nx + (p[n - 1, 1] - ay) * ny
    for k in range(n):
        last = k - 1 if k > 0 else n - 1
        here = (p[k, 0] - ax) * nx + (p[k, 1] - ay) * ny
        if (before < 0) != (here < 0):
            t = before / (before - here)
            q[m, 0] = p[last, 0] + t * (p[k, 0] - p[last, 0])
            q[m, 1] = p[last, 1] + t * (p[k, 1] - p[last, 1])
            made[m] = label[last] if here >= 0 else mark
            m += 1
        if here >= 0:
            q[m, 0] = p[k, 0]
            q[m, 1] = p[k, 1]
            made[m] = label[k]
            m += 1
        before = here
    return m


@njit(cache=True, error_model="numpy")
def cut_by_polygon(p, label, n, by, n_by, offset, work, work_label):
    """The part of convex polygon p inside convex polygon `by`, in place; `work`: room. Returns its vertices.

    Edge k of `by` labels what it makes with offset + k, or with CHORD where offset is CHORD.
    """
    for k in range(n_by):
        other = k + 1 if k + 1 < n_by else 0
        mark = offset if offset == CHORD else offset + k
        m = cut_by_line(p, label, n, by[k, 0], by[k, 1], by[other, 0], by[other, 1], mark, 1, work, work_label)
        if m < 3 or m > _ROOM - 2:
            return 0
        for j in range(m):
            p[j, 0] = work[j, 0]
            p[j, 1] = work[j, 1]
            label[j] = work_label[j]
        n = m
    return n


@njit(cache=True, error_model="numpy")
def project(x, n, centre, e, out):
    """Corners of a master patch in a slave's frame, in the reverse order: (p, q, height)."""
    for k in range(n):
        for a in range(3):
            out[n - 1 - k, a] = (
                (x[k, 0] - centre[0]) * e[a, 0] + (x[k, 1] - centre[1]) * e[a, 1] + (x[k, 2] - centre[2]) * e[a, 2]
            )


@njit(cache=True, error_model="numpy")
def outside(y, n, by, n_by):
    """Whether some edge of convex polygon `by` has all of y on its outer side."""
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


@njit(cache=True, error_model="numpy")
def _parts_of(y, n, places):
    """How a projected patch is clipped: `places` (2, 4) rows of corners; returns parts, and corners of each."""
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


@njit(cache=True, error_model="numpy")
def facing_plane(y, n):
    """Height over a slave's frame of a master patch's mean plane: h = c0 + c1 p + c2 q; whether it faces the slave."""
    if n == 3:
        ux, uy, uz = y[1, 0] - y[0, 0], y[1, 1] - y[0, 1], y[1, 2] - y[0, 2]
        vx, vy, vz = y[2, 0] - y[0, 0], y[2, 1] - y[0, 1], y[2, 2] - y[0, 2]
    else:
        ux, uy, uz = y[2, 0] - y[0, 0], y[2, 1] - y[0, 1], y[2, 2] - y[0, 2]
        vx, vy, vz = y[3, 0] - y[1, 0], y[3, 1] - y[1, 1], y[3, 2] - y[1, 2]
    nx = uy * vz - uz * vy
    ny = uz * vx - ux * vz
    nz = ux * vy - uy * vx
    if not nz > _FACING * np.sqrt(nx * nx + ny * ny + nz * nz):
        return False, 0.0, 0.0, 0.0
    c1 = -nx / nz
    c2 = -ny / nz
    c0 = 0.0
    for k in range(n):
        c0 += (y[k, 2] - c1 * y[k, 0] - c2 * y[k, 1]) / n
    return True, c0, c1, c2


@njit(cache=True, error_model="numpy")
def _tidy(shape, label, count, k, least):
    """Take out of part k the vertices that add no area (coincident, or on a straight side).

    Of two edges that become one the longer names it.
    """
    n = count[k]
    j = 0
    while j < n and n > 3:
        a = j - 1 if j > 0 else n - 1
        b = j + 1 if j + 1 < n else 0
        ux, uy = shape[k, j, 0] - shape[k, a, 0], shape[k, j, 1] - shape[k, a, 1]
        vx, vy = shape[k, b, 0] - shape[k, j, 0], shape[k, b, 1] - shape[k, j, 1]
        if ux * vy - uy * vx > least:
            j += 1
            continue
        if vx * vx + vy * vy > ux * ux + uy * uy:
            label[k, a] = label[k, j]
        n -= 1
        for c in range(j, n):
            shape[k, c, 0] = shape[k, c + 1, 0]
            shape[k, c, 1] = shape[k, c + 1, 1]
            label[k, c] = label[k, c + 1]
        j = max(j - 1, 0)
    count[k] = n


@njit(cache=True, error_model="numpy")
def _overlap(shape, count, plane, a, b, least, room, label, work, work_label):
    """Area that parts a and b share, and which of them is farther from the slave there."""
    if outside(shape[a], count[a], shape[b], count[b]) or outside(shape[b], count[b], shape[a], count[a]):
        return 0.0, a
    for k in range(count[a]):
        room[k, 0] = shape[a, k, 0]
        room[k, 1] = shape[a, k, 1]
    n = cut_by_polygon(room, label, count[a], shape[b], count[b], CHORD, work, work_label)
    if n < 3:
        return 0.0, a
    area = area_of(room, n)
    if not area > least:
        return 0.0, a
    x, y = centroid(room, n)
    ha = abs(plane[a, 0] + plane[a, 1] * x + plane[a, 2] * y)
    hb = abs(plane[b, 0] + plane[b, 1] * x + plane[b, 2] * y)
    if abs(ha - hb) <= 1e-9 * (ha + hb):
        return area, max(a, b)
    return area, a if ha > hb else b


@njit(cache=True, error_model="numpy")
def _subtract(shape, label, count, plane, who, parts, far, near, least, work, work_label, rest, rest_label):
    """Take part `near` out of part `far`: what is left goes on as new parts. Returns the number of parts, -1: no room."""
    n = count[far]
    for k in range(n):
        rest[k, 0] = shape[far, k, 0]
        rest[k, 1] = shape[far, k, 1]
        rest_label[k] = label[far, k]
    count[far] = 0
    for k in range(count[near]):
        j = k + 1 if k + 1 < count[near] else 0
        ax, ay, bx, by = shape[near, k, 0], shape[near, k, 1], shape[near, j, 0], shape[near, j, 1]
        m = cut_by_line(rest, rest_label, n, ax, ay, bx, by, CHORD, -1, work, work_label)
        if m > 2 and area_of(work, m) > least:
            if parts == len(count):
                return -1
            who[parts] = who[far]
            plane[parts] = plane[far]
            for c in range(m):
                shape[parts, c, 0] = work[c, 0]
                shape[parts, c, 1] = work[c, 1]
                label[parts, c] = work_label[c]
            count[parts] = m
            _tidy(shape, label, count, parts, least)
            parts += 1
        m = cut_by_line(rest, rest_label, n, ax, ay, bx, by, CHORD, 1, work, work_label)
        if m < 3:
            break
        n = m
        for c in range(n):
            rest[c, 0] = work[c, 0]
            rest[c, 1] = work[c, 1]
            rest_label[c] = work_label[c]
    return parts


@njit(cache=True, error_model="numpy")
def _any_overlap(shape, label, count, plane, who, parts, least, work, work_label, rest, low, high, order):
    """Whether any two parts lie over one another: a sweep along the first axis (sorted by Shell's method)."""
    for a in range(parts):
        low[a], high[a], order[a] = np.inf, -np.inf, a
        for k in range(count[a]):
            low[a] = min(low[a], shape[a, k, 0])
            high[a] = max(high[a], shape[a, k, 0])
    step = 1
    while 3 * step < parts:
        step = 3 * step + 1
    while step > 0:
        for i in range(step, parts):
            a = order[i]
            k = i
            while k >= step and low[order[k - step]] > low[a]:
                order[k] = order[k - step]
                k -= step
            order[k] = a
        step //= 3
    for i in range(parts):
        a = order[i]
        for j in range(i + 1, parts):
            b = order[j]
            if low[b] >= high[a]:
                break
            if who[a] != who[b]:
                area, _ = _overlap(shape, count, plane, a, b, least, rest, label, work, work_label)
                if area > least:
                    return True
    return False


@njit(cache=True, error_model="numpy")
def _nearest_only(
    shape, label, count, plane, who, parts, least, overlap, work, work_label, rest, rest_label, low, high, order
):
    """Where parts lie over one another, keep the nearest. Returns the number of parts (some empty), -1: no room."""
    if not _any_overlap(shape, rest_label, count, plane, who, parts, overlap, work, work_label, rest, low, high, order):
        return parts
    a = 1
    most = _FRAGMENTS * parts
    while a < parts < most:
        for b in range(a):
            if count[a] == 0:
                break
            if count[b] == 0 or who[a] == who[b]:
                continue
            area, far = _overlap(shape, count, plane, a, b, overlap, rest, rest_label, work, work_label)
            if area > overlap:
                near = a + b - far
                parts = _subtract(
                    shape, label, count, plane, who, parts, far, near, least, work, work_label, rest, rest_label
                )
                if parts < 0:
                    return -1
        a += 1
    return parts


@njit(cache=True, error_model="numpy")
def _collect(
    candidate, begin, end, centre, e, y_s, n_s, n_m, x_m, least, ahead, behind, deep, limit,
    shape, label, count, plane, who, work, work_label, y, places,
):  # fmt: skip
    """The parts that one slave patch shares with its candidates. Returns their number, -1: no room."""
    parts = 0
    for c in range(begin, end):
        m = candidate[c]
        n = n_m[m]
        project(x_m[m], n, centre, e, y)
        if outside(y, n, y_s, n_s):
            continue
        faces, c0, c1, c2 = facing_plane(y, n)
        if not faces:
            continue
        pieces, corners = _parts_of(y, n, places)
        for k in range(pieces):
            if parts == len(count):
                return -1
            for j in range(corners):
                at = places[k, j]
                shape[parts, j, 0] = y[at, 0]
                shape[parts, j, 1] = y[at, 1]
                # corners are reversed: the edge that leaves corner `at` is edge n - 2 - at of the patch
                whole = places[k, j + 1 if j + 1 < corners else 0] == (at + 1) % n
                label[parts, j] = MASTER + (2 * n - 2 - at) % n if whole else CHORD
            if not area_of(shape[parts], corners) > least:
                continue
            v = cut_by_polygon(shape[parts], label[parts], corners, y_s, n_s, 0, work, work_label)
            if v < 3 or not area_of(shape[parts], v) > least:
                continue
            px, py = centroid(shape[parts], v)
            # inside the patch's own range of heights, so that the tree's boxes cannot disagree
            h = c0 + c1 * px + c2 * py
            h = min(max(h, min(y[0, 2], y[1, 2], y[2, 2], y[n - 1, 2])), max(y[0, 2], y[1, 2], y[2, 2], y[n - 1, 2]))
            if h <= ahead and -h <= min(behind + deep[m], limit):
                count[parts] = v
                _tidy(shape, label, count, parts, least)
                plane[parts, 0] = c0
                plane[parts, 1] = c1
                plane[parts, 2] = c2
                who[parts] = m
                parts += 1
    return parts


@njit(cache=True, error_model="numpy")
def _clip_all(
    start, candidate, n_s, centre, e, y_s, area_s, n_m, x_m, ahead, behind, deep, limit,
    shape, label, count, plane, who, low, high, order, slave, master, area, first, vertices, edges,
):  # fmt: skip
    """Fill the last six arrays. Returns how many pieces and vertices there are, and the parts of the fullest patch.

    Where one is more than there is room for, nothing beyond the room is written: call again with more.
    """
    total = 0
    size = 0
    fullest = 0
    work = np.empty((_ROOM, 2))
    rest = np.empty((_ROOM, 2))
    work_label = np.zeros(_ROOM, np.int8)
    rest_label = np.zeros(_ROOM, np.int8)
    y = np.empty((4, 3))
    places = np.empty((2, 4), np.int64)
    first[0] = 0
    for s in range(len(n_s)):
        least = _LEAST * area_s[s]
        parts = _collect(
            candidate, start[s], start[s + 1], centre[s], e[s], y_s[s], n_s[s], n_m, x_m, least,
            ahead[s], behind[s], deep, limit, shape, label, count, plane, who, work, work_label, y, places,
        )  # fmt: skip
        if parts > 1:
            parts = _nearest_only(
                shape, label, count, plane, who, parts, least, _OVERLAP * area_s[s],
                work, work_label, rest, rest_label, low, high, order,
            )  # fmt: skip
        if parts < 0:
            return total, size, -1
        fullest = max(fullest, parts)
        for k in range(parts):
            if count[k] == 0:
                continue
            v = count[k]
            if total < len(slave) and size + v <= len(edges):
                slave[total] = s
                master[total] = who[k]
                area[total] = area_of(shape[k], v)
                for j in range(v):
                    vertices[size + j, 0] = shape[k, j, 0]
                    vertices[size + j, 1] = shape[k, j, 1]
                    edges[size + j] = label[k, j]
                first[total + 1] = size + v
            size += v
            total += 1
    return total, size, fullest
