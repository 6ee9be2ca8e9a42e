"""How the pieces that an interface is integrated over move: their edges that the master makes, and what lies there.

A piece ends where an edge of a master patch stands along the mean normal e of the slave patch. With y on that edge over
x, at h = (y - x).e, and nu in the patch's plane across it, out of the piece, the edge moves over the slave by

    V = nu.(dy - dx) - h nu.de,      de = -sum_a a^a (e.dt_a)

where t_a are the chords that the patch's normal is made of and a^a their dual vectors. What is integrated changes by
what it is there, times V, along the edge (Leibniz). Between two master faces that is left of both which they do not
share: with normals other than e each is met prolonged. At the master's rim it is all of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats, Ints
from lacmesh.reference.shapes import gradient, shape
from lacmesh.surface import ContactPoints, Surface
from lacmesh.surface.maps import NEARLY_FLAT
from lacmesh.surface.normals import normals_of
from lacmesh.surface.patches import Patches, patches
from lacmesh.surface.points import smooth_gap
from lacsolver.contact.interface import by_type, places, tangents

#: steps of Newton's method for places in faces; after one so small there is no other: it converges quadratically
_STEPS, _DONE = 12, 1e-7
#: Gauss points of an edge, and their weights, on [0, 1]
_AT, _WEIGHT = (np.polynomial.legendre.leggauss(3) + np.array([[1.0], [0.0]])) / 2
#: a part of an edge shorter than this, against the patch, is rounding
_LEAST = 1e-10
#: rays meet a face, prolonged by so much, or leave the edge out
_BEYOND = 0.5


class Edges(NamedTuple):
    """Points of edges (n,), their weight a length times what an area weighs; `moving` (n, n_dof): V."""

    points: ContactPoints
    moving: csr_array


class _Ends(NamedTuple):
    """Points of edges, a row each: rows of the slave's and the master's patches, what counts (`size`: a length, 1 in
    the plane), `s` (n, 2) places in the slave patch, `share` (n, 4) of the master patch's corners, `nu` (n, 3).
    """

    slave: Ints
    master: Ints
    size: Floats
    s: Floats
    share: Floats
    nu: Floats


def edges_of(
    face: Ints, other: Ints, slave: Surface, master: Surface, dim: int, nodal: Floats | None, axisymmetric: bool
) -> Edges:
    """The edges of pieces, those that do more than cancel. `face`, `other`: of slave and master, pairs that share some.

    `nodal` (f, 9, dim): smoothed normals, None for true ones. Macro-elements of the points are slave faces.
    """
    s, m = patches(slave), patches(master)
    a, b = _pairs(np.unique(face * np.int64(len(master)) + other), s, m, len(master))
    ends = (_in_plane if dim == 2 else _in_space)(s, m, a, b, _counting(s, m, a, b, master, nodal is not None))
    return _placed(ends, s, m, slave, master, dim, nodal, axisymmetric)


def _pairs(key: Ints, s: Patches, m: Patches, n: int) -> tuple[Ints, Ints]:
    """Patches of pairs of faces, n times the slave's plus the master's."""
    face, other = np.divmod(key, np.int64(n))
    count = _count(m, other)
    each = _count(s, face) * count
    row = np.repeat(np.arange(len(key)), each)
    at = np.arange(len(row)) - np.repeat(np.cumsum(each) - each, each)
    first = np.searchsorted(s.face, face)[row], np.searchsorted(m.face, other)[row]
    return first[0] + at // count[row], first[1] + at % count[row]


def _count(p: Patches, face: Ints) -> Ints:
    return np.searchsorted(p.face, face, side="right") - np.searchsorted(p.face, face)


def _counting(s: Patches, m: Patches, a: Ints, b: Ints, master: Surface, smooth: bool) -> NDArray[np.bool_]:
    """(pairs, 4): whether the edge from each corner of the master's patch (that corner, in the plane) counts.

    The rim does; all do in front of slave faces whose normals are not those of their plane, and on curved masters.
    """
    several = np.bincount(m.face, minlength=len(master)) > 1
    bent = smooth | (s.warp[s.face[a]] > NEARLY_FLAT) | several[m.face[b]]
    there = np.arange(4) < m.n[b][:, None]
    return there & (bent[:, None] | (master.neighbours[m.face[b]] < 0))


def _in_plane(s: Patches, m: Patches, a: Ints, b: Ints, counts: NDArray[np.bool_]) -> _Ends:
    """Corners of the master that stand over the inside of the slave's chord."""
    t = np.einsum("kcs,ks->kc", m.x[b, :2] - s.x[a, :1], s.e[a, 0]) / s.area[a][:, None]
    row, corner = np.nonzero((t > _LEAST) & (t < 1 - _LEAST) & counts[:, :2])
    out = np.sign(t[row, corner] - t[row, 1 - corner])
    place = np.stack([2 * t[row, corner] - 1, np.zeros(len(row))], axis=1)
    return _Ends(a[row], b[row], np.ones(len(row)), place, np.eye(4)[corner], out[:, None] * s.e[a[row], 0])


def _in_space(s: Patches, m: Patches, a: Ints, b: Ints, counts: NDArray[np.bool_]) -> _Ends:
    """Gauss points of the parts of the master's edges over the slave's patch."""
    row, corner = np.nonzero(counts)
    a, b = a[row], b[row]
    after = (corner + 1) % m.n[b]
    plane = np.einsum("kcs,kas->kca", m.x[b] - s.centre[a][:, None], s.e[a, :2])
    k = np.arange(len(row))
    start, along = plane[k, corner], plane[k, after] - plane[k, corner]
    low, high = _within(start, along, s.y[a, :, :2], s.n[a])
    middle = (plane * (np.arange(4) < m.n[b][:, None])[..., None]).sum(axis=1) / m.n[b][:, None]
    length = np.linalg.norm(along, axis=1)
    k = np.flatnonzero((high - low) * length > _LEAST * np.sqrt(s.area[a]))
    across = np.stack([along[k, 1], -along[k, 0]], axis=1) / length[k, None]
    across *= np.sign((across * (start[k] - middle[k])).sum(axis=1))[:, None]
    nu = np.einsum("ka,kas->ks", across, s.e[a[k], :2])
    size = ((high - low) * length)[k, None] * _WEIGHT
    k, part = np.repeat(k, len(_AT)), (low[k, None] + (high - low)[k, None] * _AT).ravel()
    share = np.zeros((len(k), 4))
    share[np.arange(len(k)), corner[k]], share[np.arange(len(k)), after[k]] = 1 - part, part
    place = _in_patch(start[k] + part[:, None] * along[k], s.y[a[k], :, :2], s.n[a[k]])
    return _Ends(a[k], b[k], size.ravel(), place, share, np.repeat(nu, len(_AT), axis=0))


def _within(start: Floats, along: Floats, y: Floats, n: Ints) -> tuple[Floats, Floats]:
    """From where to where lines start + t along, t in [0, 1], lie in convex polygons y (k, 4, 2) of n corners."""
    low, high = np.zeros(len(start)), np.ones(len(start))
    k = np.arange(len(start))
    for c in range(4):
        p, q = y[:, c], y[k, (c + 1) % n]
        side = np.stack([p[:, 1] - q[:, 1], q[:, 0] - p[:, 0]], axis=1)  # inward: polygons turn left
        f, df = (side * (start - p)).sum(axis=1), (side * along).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = -f / df
        there = c < n
        low = np.where(there & (df > 0), np.maximum(low, t), low)
        high = np.where(there & (df < 0), np.minimum(high, t), high)
        high = np.where(there & (df == 0) & (f < 0), low, high)
    return low, high


def _in_patch(p: Floats, y: Floats, n: Ints) -> NDArray[np.floating]:
    """(k, 2): reference places in patches with corners y (k, 4, 2) of points p (k, 2)."""
    out = np.zeros((len(p), 2))
    for name, count in (("TRIA3", 3), ("QUAD4", 4)):
        rows = np.flatnonzero(n == count)
        s = np.full((len(rows), 2), 1 / 3 if count == 3 else 0.0)
        for _ in range(_STEPS if len(rows) else 0):
            J = np.einsum("kna,knd->kda", gradient(name, s), y[rows, :count])
            off = p[rows] - np.einsum("kn,knd->kd", shape(name, s), y[rows, :count])
            step = np.linalg.solve(J, off[..., None])[..., 0]
            s += step
            if np.abs(step).max(initial=0.0) < _DONE:
                break
        out[rows] = s
    return out


def _placed(
    ends: _Ends, s: Patches, m: Patches, slave: Surface, master: Surface, dim: int, nodal: Floats | None,
    axisymmetric: bool,
) -> Edges:  # fmt: skip
    """Points of edges, where rays from the slave meet the master there, and how edges move."""
    corners = _corner_shares(s, ends)
    xi = np.einsum("kc,kcx->kx", corners, s.xi[ends.slave])
    face, other = s.face[ends.slave], m.face[ends.master]
    if dim == 2:
        _over(s, ends, slave, xi)
    xi_m = np.einsum("kc,kcx->kx", ends.share, m.xi[ends.master])
    tau = tangents(slave, face, xi)
    true = normals_of(tau)
    normal = _normal(slave, face, xi, true, dim, nodal)
    x = places(slave, face, xi)
    xi_m, gap, met = _meet(master, other, x, normal, xi_m, dim)
    ratio = 1 / np.abs((tau[:, :, 0] * s.e[ends.slave, 0]).sum(axis=1)) if dim == 2 else _ratio(s, ends)
    weight = ends.size * np.linalg.norm(true, axis=1) * ratio
    if axisymmetric:
        weight = weight * 2 * np.pi * x[:, 0]
    keep = np.flatnonzero(met)
    made = ContactPoints(
        face[keep], face[keep], other[keep], xi[keep], xi_m[keep], weight[keep], normal[keep], gap[keep], gap[keep],
        np.zeros((0, 5), np.int64), axisymmetric,
    )  # fmt: skip
    made = replace(made, gap=smooth_gap(made, slave, master))
    few = _Ends(ends.slave[keep], ends.master[keep], ends.size[keep], ends.s[keep], ends.share[keep], ends.nu[keep])
    own = (xi[keep, None], np.ones((len(keep), 1))) if dim == 2 else (s.xi[few.slave], corners[keep])
    return Edges(made, _moving(few, own, s, m, slave, master, dim))


def _over(s: Patches, ends: _Ends, slave: Surface, xi: Floats) -> None:
    """Places in the faces of points over places on the patches' chords, from guesses, which they take the place of."""
    a, face = ends.slave, s.face[ends.slave]
    want = s.x[a, 0] + ((1 + ends.s[:, 0]) / 2 * s.area[a])[:, None] * s.e[a, 0]
    for _ in range(_STEPS if len(a) else 0):
        off = ((want - places(slave, face, xi)) * s.e[a, 0]).sum(axis=1)
        step = off / (tangents(slave, face, xi)[:, :, 0] * s.e[a, 0]).sum(axis=1)
        xi[:, 0] += np.clip(step, -_BEYOND, _BEYOND)
        if np.abs(step).max() < _DONE:
            break


def _corner_shares(s: Patches, ends: _Ends) -> NDArray[np.floating]:
    """(n, 4): shape functions of the slave patches' corners."""
    out = np.zeros((len(ends.slave), 4))
    for name, count in (("SEG2", 2), ("TRIA3", 3), ("QUAD4", 4)):
        rows = np.flatnonzero(s.n[ends.slave] == count)
        if len(rows):
            out[rows, :count] = shape(name, ends.s[rows, : 1 if count == 2 else 2])
    return out


def _ratio(s: Patches, ends: _Ends) -> NDArray[np.floating]:
    """(n,): area of the face's reference coordinates over that of the patch's plane."""
    out = np.empty(len(ends.slave))
    for name, count in (("TRIA3", 3), ("QUAD4", 4)):
        rows = np.flatnonzero(s.n[ends.slave] == count)
        dN = gradient(name, ends.s[rows])
        over, under = (
            np.linalg.det(np.einsum("kna,knd->kda", dN, v[ends.slave[rows], :count, :2])) for v in (s.xi, s.y)
        )
        out[rows] = np.abs(over / under)
    return out


def _normal(
    slave: Surface, face: Ints, xi: Floats, true: Floats, dim: int, nodal: Floats | None
) -> NDArray[np.floating]:
    """(n, 3): unit normals at points of the slave; `true` (n, 3): those of the faces, of any size."""
    n = true
    if nodal is not None:
        n = np.zeros((len(face), 3))
        for rows, name, nodes in by_type(slave, face):
            n[rows, :dim] = np.einsum(
                "pa,pas->ps", shape(name, xi[rows, : slave.dim]), nodal[face[rows], : nodes.shape[1]]
            )
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def _meet(
    master: Surface, face: Ints, x: Floats, n: Floats, xi: Floats, dim: int
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.bool_]]:
    """Where rays from x (k, 3) along n meet faces, prolonged, from guesses xi: places, distances, whether they do."""
    xi, gap, start = xi.copy(), np.zeros(len(x)), xi
    step = np.zeros((len(x), dim))
    for _ in range(_STEPS if len(x) else 0):
        tau = tangents(master, face, xi)
        off = x + gap[:, None] * n - places(master, face, xi)
        A = np.concatenate([tau, -n[:, :, None]], axis=2)[:, :dim]
        good = np.abs(np.linalg.det(A)) > 1e-300
        step = np.zeros((len(x), dim))
        step[good] = np.linalg.solve(A[good], off[good, :dim, None])[..., 0]
        xi[:, : dim - 1] += np.clip(step[:, :-1], -1.0, 1.0)
        gap = gap + step[:, -1]
        if np.abs(step).max(initial=0.0) < _DONE:
            break
    met = (np.abs(step[:, :-1]).max(axis=1, initial=0.0) < _DONE) & (np.abs(xi - start).max(axis=1) < _BEYOND)
    return xi, gap, met & np.isfinite(gap)


def _moving(
    ends: _Ends, own: tuple[Floats, Floats], s: Patches, m: Patches, slave: Surface, master: Surface, dim: int
) -> csr_array:
    """(n, n_dof): V. `own`: places in slave faces (n, k, 2) that x is a sum of, and their shares (n, k)."""
    a, b, nu, e = ends.slave, ends.master, ends.nu, s.e[ends.slave, 2]
    y = np.einsum("kc,kcs->ks", ends.share, m.x[b])
    k = own[1].shape[1]
    x = places(slave, np.repeat(s.face[a], k), own[0].reshape(-1, 2)).reshape(len(a), k, 3)
    h = ((y - np.einsum("kc,kcs->ks", own[1], x)) * e).sum(axis=1)
    chords = _chords(s.n[a], dim)
    t = np.einsum("kac,kcs->kas", chords, s.x[a])
    dual = np.linalg.solve(np.einsum("kas,kbs->kab", t, t), np.einsum("kas,ks->ka", t, nu)[..., None])[..., 0]
    turned = np.einsum("k,ka,kac->kc", h, dual, chords)
    made = _of_nodes(slave, s.face[a], s.xi[a], turned[..., None] * e[:, None], dim)
    made = made + _of_nodes(slave, s.face[a], own[0], -own[1][..., None] * nu[:, None], dim)
    return csr_array(made + _of_nodes(master, m.face[b], m.xi[b], ends.share[..., None] * nu[:, None], dim))


def _chords(n: Ints, dim: int) -> NDArray[np.floating]:
    """(k, 1 or 2, 4): the chords of patches that their mean normal is made of, by corners."""
    if dim == 2:
        return np.tile([[[-1.0, 1.0, 0.0, 0.0]]], (len(n), 1, 1))
    three, four = [[-1, 0, 1, 0], [1, -1, 0, 0]], [[-1, 0, 1, 0], [0, -1, 0, 1]]
    return np.where((n == 3)[:, None, None], np.array(three, float), np.array(four, float))


def _of_nodes(surface: Surface, face: Ints, xi: Floats, value: Floats, dim: int) -> csr_array:
    """(n, n_dof): the sum of `value` (n, k, 3) times what moves at places xi (n, k, 2) of faces (n,)."""
    row, column, data = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty(0)]
    for rows, name, nodes in by_type(surface, face):
        own = xi[rows]
        N = shape(name, own.reshape(-1, 2)[:, : surface.dim]).reshape(*own.shape[:2], -1)
        column.append((dim * nodes[:, :, None] + np.arange(dim)).ravel())
        row.append(np.repeat(np.arange(len(face))[rows], nodes.shape[1] * dim))
        data.append(np.einsum("kcn,kcs->kns", N, value[rows, :, :dim]).ravel())
    at = np.concatenate(row), np.concatenate(column)
    return csr_array((np.concatenate(data), at), shape=(len(face), dim * len(surface.x)))
