"""Clipping and quadrature in the plane (`clip` and `place` are those in space): mortar segments are intervals.

Notation: t in [0, 1] along a slave patch, s along a normal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints, mask_of, places_of
from lacmesh.surface.clip import FACING
from lacmesh.surface.fit import correct
from lacmesh.surface.maps import AFFINE, NEARLY_FLAT, NormalMaps
from lacmesh.surface.patches import Bools, Patches, Reach
from lacmesh.surface.place import FITTED, Placed
from lacmesh.topology.boxes import Pairs

_LEAST = 1e-13
#: neighbours on a slave patch may share this much of it
_OVERLAP = 1e-12
_STEPS = 60
#: points of a fitted part: one for each function of both faces, and two more
_FIT_POINTS = 7


class Intervals(NamedTuple):
    """Mortar segments, one per row: the patches `slave`, `master`, and `ends` (k, 2) in the slave face."""

    slave: Ints
    master: Ints
    ends: Floats


def clip_lines(pairs: Pairs, slave: Patches, master: Patches, reach: Reach) -> Intervals:
    """Clip the candidate pairs; return the parts sorted along each slave patch, only the nearest where they overlap."""
    s, m = pairs.first, pairs.other
    d = master.x[m, :2] - slave.x[s, :1]
    length = slave.area[s]
    along = (slave.x[s, 1] - slave.x[s, 0]) / length[:, None]
    t = np.einsum("kcs,ks->kc", d, along) / length[:, None]
    h = np.einsum("kcs,ks->kc", d, slave.e[s, 2])
    # a master that faces the slave runs against it
    width = t[:, 0] - t[:, 1]
    facing = width * length > FACING * master.area[m]
    low, high = np.maximum(t[:, 1], 0.0), np.minimum(t[:, 0], 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = (h[:, 0] - h[:, 1]) / width
        middle = h[:, 1] + slope * ((low + high) / 2 - t[:, 1])
        h0 = h[:, 1] - slope * t[:, 1]
    keep = facing & (high - low > _LEAST) & (middle <= reach.ahead[s])
    keep &= -middle <= np.minimum(reach.behind[s] + reach.deep[m], reach.limit)
    s, m, low, high = _nearest_only(s[keep], m[keep], low[keep], high[keep], h0[keep], slope[keep])
    order = np.lexsort((low, s))
    s, m, low, high = s[order], m[order], low[order], high[order]
    return Intervals(s, m, np.sort(_in_face(slave, s, np.stack([low, high], axis=1)), axis=1))


def _nearest_only(s: Ints, m: Ints, low: Floats, high: Floats, h0: Floats, slope: Floats) -> tuple[NDArray, ...]:
    """Keep the nearest interval wherever intervals [low, high] of one slave patch overlap; heights are h0 + slope t."""
    order = np.lexsort((low, s))
    s, m, low, high, h0, slope = s[order], m[order], low[order], high[order], h0[order], slope[order]
    clashing = (s[1:] == s[:-1]) & (_highest(s, high)[:-1] > low[1:] + _OVERLAP)
    clash = mask_of(int(s.max(initial=-1)) + 1, s[1:][clashing])
    over = clash[s]
    if not over.any():
        return s, m, low, high
    row, *ends = _nearest_cells(s[over], low[over], high[over], h0[over], slope[over])
    parts = (s[over][row], m[over][row], *ends)
    s, m, low, high = (np.concatenate([v[~over], w]) for v, w in zip((s, m, low, high), parts, strict=True))
    return s, m, low, high


def _highest(s: Ints, high: Floats) -> Floats:
    """(k,): running maximum of `high` within each patch; s ascends. Computed by ranks, so that no digits are lost."""
    order = np.argsort(high)
    rank = places_of(order, len(s))
    return high[order[np.maximum.accumulate(s * len(s) + rank) - s * len(s)]]


def _nearest_cells(s: Ints, low: Floats, high: Floats, h0: Floats, slope: Floats) -> tuple[Ints, Floats, Floats]:
    """Divide patches at all interval ends; return (nearest interval, start, end) of each covered cell."""
    ends, patch = np.concatenate([low, high]), np.concatenate([s, s])
    order = np.lexsort((ends, patch))
    ends, patch = ends[order], patch[order]
    new = np.append(True, (ends[1:] != ends[:-1]) | (patch[1:] != patch[:-1]))
    place = np.empty(len(order), np.int64)
    place[order] = np.cumsum(new) - 1
    cut = ends[new]
    first, last = np.split(place, 2)
    row = np.repeat(np.arange(len(s)), last - first)
    cell = np.arange(len(row)) - np.repeat(np.cumsum(last - first) - last, last - first)
    far = np.abs(h0[row] + slope[row] * ((cut[cell] + cut[cell + 1]) / 2))
    order = np.lexsort((row, far, cell))
    row, cell = row[order], cell[order]
    best = np.append(True, cell[1:] != cell[:-1]) & (cut[cell + 1] - cut[cell] > _LEAST)
    row, cell = row[best], cell[best]
    return row, cut[cell], cut[cell + 1]


def _in_face(slave: Patches, s: Ints, t: Floats) -> Floats:
    """Reference coordinates of the face points that project to t (k, 2) on the patches' chords; ends map to ends."""
    a, b = slave.xi[s, 0, 0][:, None], slave.xi[s, 1, 0][:, None]
    u = a + t * (b - a)
    G = slave.G[slave.face[s]]
    along = (slave.x[s, 1] - slave.x[s, 0]) / slave.area[s][:, None] ** 2
    G1 = np.einsum("kms,ks->km", G - 0.0, along)
    G1[:, 0] -= (slave.x[s, 0] * along).sum(axis=1)
    for _ in range(_STEPS):
        f = G1[:, :1] + u * (G1[:, 1:2] + u * G1[:, 3:4]) - t
        slope = G1[:, 1:2] + 2 * u * G1[:, 3:4]
        step = np.divide(f, slope, out=np.zeros_like(f), where=np.abs(slope) > 1e-12 * np.abs(b - a) ** -1)
        u = np.clip(u - step, np.minimum(a, b), np.maximum(a, b))
        if not (np.abs(step) > 1e-15).any():
            break
    return np.where(t <= 0, a, np.where(t >= 1, b, u))


def gauss_points(slave: Patches, master: Patches, parts: Intervals, degree: Ints, radius: bool, smooth: Bools) -> Ints:
    """(k,): number of Gauss points of each part, for shape functions of the given `degree` on the two faces.

    `smooth` (k,): True if the normals are not the slave face's own. Exact if the mid-nodes of both faces are at the
    middle. On straight lines with a mid-node off the middle the weights are fitted (FITTED is added): as many points as
    functions, and a few more. On curved lines 4.
    """
    fs, fm = slave.face[parts.slave], master.face[parts.master]
    even = (slave.kind[fs] == AFFINE) & (master.kind[fm] == AFFINE)
    straight = (slave.warp[fs] <= NEARLY_FLAT) & (master.warp[fm] <= NEARLY_FLAT) & ~smooth
    exact = (degree + radius) // 2 + 1
    return np.where(even & ~smooth, exact, np.where(straight, _FIT_POINTS + FITTED, 4))


def place_lines(
    parts: Intervals, code: Ints, slave: Patches, master: Patches, H: NormalMaps, radius: float | None
) -> Placed:
    """Place points on parts by rules `code` (gauss_points); weights include 2 pi r, r = `radius` + x, unless None.

    `H`: maps of the slave's normals (`normals.normal_maps`).
    """
    first, piece, X, w = _rows(code % FITTED)
    s, m = parts.slave[piece], parts.master[piece]
    fs, fm = slave.face[s], master.face[m]
    low, high = parts.ends[piece, 0], parts.ends[piece, 1]
    u = low + X * (high - low)
    x, d = _at(slave.G[fs], u)
    um, gap, met, n = ends_of_rays(H, fs, fm, x, d, u, master.G[fm], master.xi[m, :2, 0].mean(axis=1))
    weight = w * (high - low) * np.linalg.norm(d, axis=1)
    if radius is not None:
        weight = weight * 2 * np.pi * (radius + x[:, 0])
    for k in np.flatnonzero(code >= FITTED):
        rows = slice(first[k], first[k + 1])
        if met[rows].all():
            maps = slave.G[slave.face[parts.slave[k]]], master.G[master.face[parts.master[k]]]
            _fit(*maps, parts.ends[k], n[first[k]], radius, u[rows], um[rows], weight[rows])
    xi_s, xi_m = (np.stack([v, np.zeros_like(v)], axis=1) for v in (u, um))
    return Placed(first, piece, xi_s, xi_m, weight, n, gap, met)


def ends_of_rays(
    H: NormalMaps, face: Ints, other: Ints, x: Floats, d: Floats, u: Floats, G: Floats, um: Floats
) -> tuple[Floats, Floats, NDArray[np.bool_], Floats]:
    """Ends of rays from points u (n,) of slave faces, at x (n, 3) with tangents d (n, 3): (um, length, met, normal).

    `face`, `other` (n,): the faces of slave and master; `G` (n, 9, 3): maps of the latter; `um` (n,): a first guess.
    """
    if H.of_master:
        return _feet(G, H.G[other], x, um)
    n = _normals_at(H, face, d, u)
    return *meet(G, x, n, um), n


def _normals_at(H: NormalMaps, face: Ints, d: Floats, u: Floats) -> NDArray[np.floating]:
    """(n, 3): unit normals at u (n,) of slave faces (n,) with tangents d (n, 3)."""
    n = np.stack([d[:, 1], -d[:, 0], np.zeros(len(d))], axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        if H.are_normals:
            n = _at(H.G[face], u)[0]
        elif len(H.G):
            n = n - _at(H.G[face], u)[0][:, :1] * d / np.linalg.norm(d, axis=1, keepdims=True)
        return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))


def _fit(
    G: Floats, H: Floats, ends: Floats, n: Floats, radius: float | None, u: Floats, um: Floats, weight: Floats
) -> None:
    """Correct the weights of points u, um in the master, of a straight part to integrate u, u^2, um, um^2 exactly.

    `G`, `H` (9, 3): the maps; `ends` (2,): the part in the slave. The integrands are polynomials in each face's own u.
    """
    x, _ = _at(np.broadcast_to(G, (2, 9, 3)), ends)
    ends_m, _, met = meet(np.broadcast_to(H, (2, 9, 3)), x, np.broadcast_to(n, (2, 3)), um[[0, -1]])
    if not met.all():
        return
    along = np.array([-n[1], n[0], 0.0])
    place, w = np.polynomial.legendre.leggauss(_FIT_POINTS)
    targets, functions = [], []
    for (a, b), K, v in ((ends, G, u), (ends_m, H, um)):
        middle, half = (a + b) / 2, (b - a) / 2
        at, d = _at(np.broadcast_to(K, (len(place), 9, 3)), middle + half * place)
        size = (d @ along) * half * w
        if radius is not None:  # that of the slave's point, which lies across from the master's
            size = size * 2 * np.pi * (radius + x[0, 0] + ((at - x[0]) @ along) * along[0])
        size *= np.sign(size.sum())
        targets += [size.sum(), place @ size, place**2 @ size]
        local = (v - middle) / half
        functions += [np.ones_like(local), local, local**2]
    phi = np.array([*functions[:3], *functions[4:]])
    correct(weight, len(weight), phi, len(phi), np.array([*targets[:3], *targets[4:]]), 0.0, 1)


def _rows(count: Ints) -> tuple[Ints, Ints, Floats, Floats]:
    """Gauss points, `count` (parts,) of them: first point of each part; part, abscissa in [0, 1], weight of each."""
    first = np.concatenate([[0], np.cumsum(count)])
    piece = np.repeat(np.arange(len(count)), count)
    within = np.arange(len(piece)) - first[piece]
    X, w = np.zeros(len(piece)), np.zeros(len(piece))
    for n in np.unique(count):
        place, weight = np.polynomial.legendre.leggauss(int(n))
        at = count[piece] == n
        X[at], w[at] = (place[within[at]] + 1) / 2, weight[within[at]] / 2
    return first, piece, X, w


def _at(G: Floats, u: Floats) -> tuple[Floats, Floats]:
    u = u[:, None]
    return G[:, 0] + u * (G[:, 1] + u * G[:, 3]), G[:, 1] + 2 * u * G[:, 3]


def meet(G: Floats, x: Floats, n: Floats, u: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Intersect lines through x (k, 3) along n with segments of maps G, from a guess u: (u, distance along n, met)."""
    across = np.stack([-n[:, 1], n[:, 0], np.zeros(len(n))], axis=1)
    met = np.zeros(len(u), bool)
    for _ in range(_STEPS):
        y, d = _at(G, u)
        with np.errstate(invalid="ignore", divide="ignore"):
            step = ((y - x) * across).sum(axis=1) / (d * across).sum(axis=1)
        met = np.abs(step) < 1e-13
        u = u - np.clip(step, -1.0, 1.0)
        if not (np.abs(step) > 1e-15).any():
            break
    met |= np.abs(step) < 1e-10
    y, _ = _at(G, u)
    return u, ((y - x) * n).sum(axis=1), met


def _feet(G: Floats, H: Floats, x: Floats, u: Floats) -> tuple[Floats, Floats, NDArray[np.bool_], Floats]:
    """Points of segments of maps G whose normals, of maps H, go through x (k, 3): (u, distance, met, unit normal).

    Newton's method from a guess u, as in `meet`: the segment's tangent is that of y - r n at the length r.
    """
    for _ in range(_STEPS):
        y, d = _at(G, u)
        h, dh = _at(H, u)
        size = np.linalg.norm(h, axis=1)[:, None]
        n = h / size
        r = ((y - x) * n).sum(axis=1)
        across = np.stack([-n[:, 1], n[:, 0], np.zeros(len(n))], axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            step = ((y - x) * across).sum(axis=1) / ((d - r[:, None] * dh / size) * across).sum(axis=1)
        met = np.abs(step) < 1e-10
        if not (np.abs(step) > 1e-15).any():
            break
        u = u - np.clip(step, -1.0, 1.0)
    return u, r, met, n
