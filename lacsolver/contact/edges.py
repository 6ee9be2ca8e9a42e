"""Moving edges of the mortar segments of an interface: quadrature points on the master's edges, and their velocity V.

A mortar segment ends at the projection of an edge of a master patch along the mean normal e of the slave patch. With y
on that edge above x on the slave, at the height h = (y - x).e, and nu the outward normal of the segment's edge in the
plane of the patch, the edge moves over the slave by

    V = nu.(dy - dx) - h nu.de,      de = -sum_a a^a (e.dt_a)

where t_a are the chords that define the patch's normal and a^a their dual vectors. An integral over the segment changes
by the integral of its integrand times V along the edge (Leibniz, or Reynolds). On an edge between two master faces the
contributions of the two segments cancel, except for the difference between the integrands: with normals other than e
the rays meet extensions of the two faces beyond their edge. At the boundary of the master nothing cancels.
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

#: Newton's method for reference points in faces: most steps, and the step after which none follows, since convergence
#: is quadratic
_STEPS, _DONE = 12, 1e-7
#: Gauss points of an edge, and their weights, on [0, 1]
_AT, _WEIGHT = (np.polynomial.legendre.leggauss(3) + np.array([[1.0], [0.0]])) / 2
#: a part of an edge shorter than this, relative to the patch, is round-off
_LEAST = 1e-10
#: how far beyond a face, in reference coordinates, a ray may meet its extension; points beyond are left out
_BEYOND = 0.5


class Edges(NamedTuple):
    """Quadrature points on edges (n,), with weights for line integrals; `moving` (n, n_dof): V as a matrix of u."""

    points: ContactPoints
    moving: csr_array


class _Ends(NamedTuple):
    """Quadrature points on edges, one row each.

    `slave`, `master`: rows of their patches; `size`: length of the edge times the Gauss weight, 1 in the plane; `s`
    (n, 2): reference points in the slave patch; `share` (n, 4): weights of the master patch's corners; `nu` (n, 3).
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
    """Return quadrature points on the segment edges whose contributions do not cancel between neighbours.

    `face`, `other`: pairs of slave and master faces that have mortar segments in common. `nodal` (f, 9, dim): smoothed
    normals, None for the faces' own. The field `macro` of the points holds slave faces.
    """
    s, m = patches(slave), patches(master)
    a, b = _pairs(np.unique(face * np.int64(len(master)) + other), s, m, len(master))
    ends = (_in_plane if dim == 2 else _in_space)(s, m, a, b, _counting(s, m, a, b, master, nodal is not None))
    return _placed(ends, s, m, slave, master, dim, nodal, axisymmetric)


def _pairs(key: Ints, s: Patches, m: Patches, n: int) -> tuple[Ints, Ints]:
    """Return the slave and master patches of pairs of faces, whose keys are n times the slave face plus the master."""
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
    """Return a mask (pairs, 4) of the master patch's edges, by first corner, that do not cancel (corners in the plane).

    These are edges on the boundary of the master; and all edges if the slave's normals differ from those of its plane,
    or if the master is curved.
    """
    several = np.bincount(m.face, minlength=len(master)) > 1
    bent = smooth | (s.warp[s.face[a]] > NEARLY_FLAT) | several[m.face[b]]
    there = np.arange(4) < m.n[b][:, None]
    return there & (bent[:, None] | (master.neighbours[m.face[b]] < 0))


def _in_plane(s: Patches, m: Patches, a: Ints, b: Ints, counts: NDArray[np.bool_]) -> _Ends:
    """Return the corners of the master that project into the inside of the slave's chord."""
    t = np.einsum("kcs,ks->kc", m.x[b, :2] - s.x[a, :1], s.e[a, 0]) / s.area[a][:, None]
    row, corner = np.nonzero((t > _LEAST) & (t < 1 - _LEAST) & counts[:, :2])
    out = np.sign(t[row, corner] - t[row, 1 - corner])
    place = np.stack([2 * t[row, corner] - 1, np.zeros(len(row))], axis=1)
    return _Ends(a[row], b[row], np.ones(len(row)), place, np.eye(4)[corner], out[:, None] * s.e[a[row], 0])


def _in_space(s: Patches, m: Patches, a: Ints, b: Ints, counts: NDArray[np.bool_]) -> _Ends:
    """Return Gauss points of the parts of the master's edges that project into the slave's patch."""
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
    """Return the ends of the interval of t in [0, 1] in which start + t along lies in a convex polygon.

    The polygons y (k, 4, 2) have n (k,) corners.
    """
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
    """Return the reference coordinates (k, 2) of points p (k, 2) in patches with corners y (k, 4, 2)."""
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
    """Return the points on the edges where rays from the slave meet the master, and the edges' V."""
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
    """Move xi to the points of slave faces above given points of the patches' chords, by Newton's method, in place."""
    a, face = ends.slave, s.face[ends.slave]
    want = s.x[a, 0] + ((1 + ends.s[:, 0]) / 2 * s.area[a])[:, None] * s.e[a, 0]
    for _ in range(_STEPS if len(a) else 0):
        off = ((want - places(slave, face, xi)) * s.e[a, 0]).sum(axis=1)
        step = off / (tangents(slave, face, xi)[:, :, 0] * s.e[a, 0]).sum(axis=1)
        xi[:, 0] += np.clip(step, -_BEYOND, _BEYOND)
        if np.abs(step).max() < _DONE:
            break


def _corner_shares(s: Patches, ends: _Ends) -> NDArray[np.floating]:
    """Return the shape functions (n, 4) of the slave patches' corners."""
    out = np.zeros((len(ends.slave), 4))
    for name, count in (("SEG2", 2), ("TRIA3", 3), ("QUAD4", 4)):
        rows = np.flatnonzero(s.n[ends.slave] == count)
        if len(rows):
            out[rows, :count] = shape(name, ends.s[rows, : 1 if count == 2 else 2])
    return out


def _ratio(s: Patches, ends: _Ends) -> NDArray[np.floating]:
    """Return the ratio (n,) of area in the face's reference coordinates to area in the patch's plane."""
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
    """Return unit normals (n, 3) at points of the slave; `true` (n, 3): the faces' own normals, of any length."""
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
    """Intersect rays from x (k, 3) along n with faces or their extensions, by Newton's method from guesses xi.

    Returns the reference points, the distances, and a mask that is True where an intersection was found.
    """
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
    """Return V as a matrix (n, n_dof). `own`: points in slave faces (n, k, 2) and weights (n, k), whose sum is x."""
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
    """Return the chords that define the patches' mean normals, as weights of their corners, (k, 1 or 2, 4)."""
    if dim == 2:
        return np.tile([[[-1.0, 1.0, 0.0, 0.0]]], (len(n), 1, 1))
    three, four = [[-1, 0, 1, 0], [1, -1, 0, 0]], [[-1, 0, 1, 0], [0, -1, 0, 1]]
    return np.where((n == 3)[:, None, None], np.array(three, float), np.array(four, float))


def _of_nodes(surface: Surface, face: Ints, xi: Floats, value: Floats, dim: int) -> csr_array:
    """Return as a matrix (n, n_dof) the sum over k of `value` (n, k, 3) . u at points xi (n, k, 2) of faces (n,)."""
    row, column, data = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty(0)]
    for rows, name, nodes in by_type(surface, face):
        own = xi[rows]
        N = shape(name, own.reshape(-1, 2)[:, : surface.dim]).reshape(*own.shape[:2], -1)
        column.append((dim * nodes[:, :, None] + np.arange(dim)).ravel())
        row.append(np.repeat(np.arange(len(face))[rows], nodes.shape[1] * dim))
        data.append(np.einsum("kcn,kcs->kns", N, value[rows, :, :dim]).ravel())
    at = np.concatenate(row), np.concatenate(column)
    return csr_array((np.concatenate(data), at), shape=(len(face), dim * len(surface.x)))
