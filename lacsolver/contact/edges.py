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

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface
from lacmesh.surface.clip import project
from lacmesh.surface.lines import ends_of_rays
from lacmesh.surface.maps import NEARLY_FLAT, NormalMaps, at, in_face, in_quadrangle, inverse, quadrangle, wedge
from lacmesh.surface.normals import turning
from lacmesh.surface.patches import Patches, patches
from lacmesh.surface.place import end_of_ray
from lacsolver.contact.chain import LoopPoints, MovingEdges
from lacsolver.contact.faces import places, tangents

#: Newton's method for the point of a curved line above its chord: most steps, and the step after which none follows
_STEPS, _DONE = 12, 1e-7
#: Gauss points of an edge, and their weights, on [0, 1]
_AT, _WEIGHT = (np.polynomial.legendre.leggauss(3) + np.array([[1.0], [0.0]])) / 2
#: a part of an edge shorter than this, relative to the patch, is round-off
_LEAST = 1e-10
#: how far beyond a face, in reference coordinates, a ray may meet its extension; points beyond are left out
_BEYOND = 0.5


class EdgePoints(NamedTuple):
    """Quadrature points on edges (n,), with weights for line integrals, on faces `slave` and `master`.

    `gap`: between the smooth surfaces.
    """

    slave: Ints
    master: Ints
    points: LoopPoints
    weight: Floats
    gap: Floats


class _Placed(NamedTuple):
    """Points on edges, one row each: the patches `a`, `b` of slave and master, and what is computed of each point.

    `met`: True where the ray meets the master's face or its extension; the others as in `EdgePoints` and `MovingEdges`.
    """

    a: Ints
    b: Ints
    xi_s: Floats
    xi_m: Floats
    normal: Floats
    ray: Floats
    weight: Floats
    met: NDArray[np.bool_]
    turned: Floats
    share: Floats
    nu: Floats

    @staticmethod
    def empty(a: Ints, b: Ints) -> _Placed:
        """Return arrays to be filled for points on edges of the patches a and b."""
        n = len(a)
        two, three = (np.zeros((n, k)) for k in (2, 3))
        return _Placed(
            a, b, two, two.copy(), three, np.zeros(n), np.zeros(n), np.zeros(n, bool), np.zeros((n, 4, 3)),
            np.zeros((n, 4)), three.copy(),
        )  # fmt: skip


def edges_of(
    face: Ints, other: Ints, slave: Surface, master: Surface, dim: int, H: NormalMaps, axisymmetric: bool
) -> EdgePoints:
    """Return quadrature points on the segment edges whose contributions do not cancel between neighbours.

    `face`, `other`: pairs of slave and master faces that have mortar segments in common. `H`: maps of normals
    (`lacmesh.surface.normals.normal_maps`).
    """
    s, m = patches(slave), patches(master)
    a, b = _pairs(np.unique(face * np.int64(len(master)) + other), s, m, len(master))
    counts = _counting(s, m, a, b, master, turning(H, len(slave))[s.face[a]])
    placed = _in_plane(s, m, a, b, counts, slave, H, axisymmetric) if dim == 2 else _in_space(s, m, a, b, counts, H)
    return _kept(placed, s, m, slave, master)


def _kept(placed: _Placed, s: Patches, m: Patches, slave: Surface, master: Surface) -> EdgePoints:
    """Return the points whose rays meet the master."""
    p = placed
    if not placed.met.all():
        keep = np.flatnonzero(placed.met)
        p = _Placed._make(of_all[keep] for of_all in placed)
    edges = MovingEdges(p.a, p.b, s.xi, m.xi, p.turned, p.share, p.nu)
    points = LoopPoints(p.xi_s, p.xi_m, p.normal, p.ray, np.empty((0, 2)), 1, 0, edges)
    gap = p.ray - slave.heights(s.face[p.a], p.xi_s) - master.heights(m.face[p.b], p.xi_m)
    return EdgePoints(s.face[p.a], m.face[p.b], points, p.weight, gap)


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


def _counting(
    s: Patches, m: Patches, a: Ints, b: Ints, master: Surface, smooth: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return a mask (pairs, 4) of the master patch's edges, by first corner, that do not cancel (corners in the plane).

    These are edges on the boundary of the master; and all edges if normals differ from those of the slave's plane, as
    those of `smooth` (pairs,) do, or if the master is curved.
    """
    several = np.bincount(m.face, minlength=len(master)) > 1
    bent = smooth | (s.warp[s.face[a]] > NEARLY_FLAT) | several[m.face[b]]
    there = np.arange(4) < m.n[b][:, None]
    return there & (bent[:, None] | (master.neighbours[m.face[b]] < 0))


def _in_plane(
    s: Patches, m: Patches, a: Ints, b: Ints, counts: NDArray[np.bool_], slave: Surface, H: NormalMaps,
    axisymmetric: bool,
) -> _Placed:  # fmt: skip
    """Return the corners of the master that project into the inside of the slave's chord."""
    t = np.einsum("kcs,ks->kc", m.x[b, :2] - s.x[a, :1], s.e[a, 0]) / s.area[a][:, None]
    row, corner = np.nonzero((t > _LEAST) & (t < 1 - _LEAST) & counts[:, :2])
    a, b, there, e = a[row], b[row], t[row, corner], s.e[a[row]]
    face, other = s.face[a], m.face[b]
    xi = _above(s.x[a, 0] + (there * s.area[a])[:, None] * e[:, 0], s, a, there, slave)
    tau, x = tangents(slave, face, xi)[:, :, 0], places(slave, face, xi)
    start = m.xi[b, corner, 0]
    u, distance, met, n = ends_of_rays(H, face, other, x, tau, xi[:, 0], m.G[other], start)
    share = np.eye(4)[corner]
    nu = np.sign(there - t[row, 1 - corner])[:, None] * e[:, 0]
    weight = np.linalg.norm(tau, axis=1) / np.abs((tau * e[:, 0]).sum(axis=1))
    weight = weight * 2 * np.pi * x[:, 0] if axisymmetric else weight
    # V of the end of a segment: the height of the master's corner over it, times how the chord's normal turns
    h, along = ((m.x[b, corner] - x) * e[:, 2]).sum(axis=1), (s.x[a, 1] - s.x[a, 0])
    turn = h * (along * nu).sum(axis=1) / (along * along).sum(axis=1)
    turned = np.zeros((len(a), 4, 3))
    turned[:, 0], turned[:, 1] = -turn[:, None] * e[:, 2], turn[:, None] * e[:, 2]
    xi_m = np.stack([u, np.zeros(len(u))], axis=1)
    return _Placed(
        a, b, xi, xi_m, n, distance, weight, met & (np.abs(u - start) < _BEYOND) & np.isfinite(distance), turned, share,
        nu,
    )  # fmt: skip


def _above(want: Floats, s: Patches, a: Ints, t: Floats, slave: Surface) -> NDArray[np.floating]:
    """Return reference points (n, 2) of the slave's faces above points `want` (n, 3), at t on the chords of patches."""
    xi = s.xi[a, 0] + t[:, None] * (s.xi[a, 1] - s.xi[a, 0])
    face, along = s.face[a], s.e[a, 0]
    for _ in range(_STEPS if len(a) else 0):
        off = ((want - places(slave, face, xi)) * along).sum(axis=1)
        step = off / (tangents(slave, face, xi)[:, :, 0] * along).sum(axis=1)
        xi[:, 0] += np.clip(step, -_BEYOND, _BEYOND)
        if np.abs(step).max() < _DONE:
            break
    return xi


def _in_space(s: Patches, m: Patches, a: Ints, b: Ints, counts: NDArray[np.bool_], H: NormalMaps) -> _Placed:
    """Return Gauss points of the parts of the master's edges that project into the slave's patch."""
    low_high = np.zeros((len(a), 4, 2))
    _clip_edges(s, m, a, b, counts, low_high)
    row, corner = np.nonzero(low_high[:, :, 1] > low_high[:, :, 0])
    out = _Placed.empty(np.repeat(a[row], len(_AT)), np.repeat(b[row], len(_AT)))
    _place_on_edges(s, m, H, np.ascontiguousarray(corner), low_high[row, corner], _AT, _WEIGHT, out)
    return out


@kernel
def _clip_edges(s: Any, m: Any, a: Any, b: Any, counts: Any, low_high: Any) -> None:
    """Write the interval of [0, 1] in which each edge of the master's patches b, by first corner, lies in a's patch."""
    y = np.empty((4, 3))
    for k in range(len(a)):
        own, n = a[k], m.n[b[k]]
        project(m.x[b[k]], n, s.centre[own], s.e[own], False, y)
        for c in range(n):
            if counts[k, c]:
                after = c + 1 if c + 1 < n else 0
                along = (y[after, 0] - y[c, 0], y[after, 1] - y[c, 1])
                low, high = _inside((y[c, 0], y[c, 1]), along, s.y[own], s.n[own])
                length = np.sqrt(along[0] * along[0] + along[1] * along[1])
                if (high - low) * length > _LEAST * np.sqrt(s.area[own]):
                    low_high[k, c, 0], low_high[k, c, 1] = low, high


@kernel
def _inside(start: Any, along: Any, y: Any, n: int) -> Any:
    """Return the ends of the interval of t in [0, 1] in which start + t along lies in a convex polygon y (n, .)."""
    low, high = 0.0, 1.0
    for c in range(n):
        after = c + 1 if c + 1 < n else 0
        side = (y[c, 1] - y[after, 1], y[after, 0] - y[c, 0])  # inward: polygons turn left
        f = side[0] * (start[0] - y[c, 0]) + side[1] * (start[1] - y[c, 1])
        df = side[0] * along[0] + side[1] * along[1]
        if df > 0:
            low = max(low, -f / df)
        elif df < 0:
            high = min(high, -f / df)
        elif f < 0:
            high = low
    return low, high


@kernel(costly=2)  # compiles as long as a million numbers take as they stand
def _place_on_edges(s: Any, m: Any, H: Any, corner: Any, low_high: Any, abscissa: Any, weight: Any, out: Any) -> None:
    """Fill `out` with the Gauss points of parts of edges, from low to high (k, 2) on the edge from `corner` (k,)."""
    y, own = np.empty((4, 3)), np.empty(4)
    for k in range(len(corner)):
        for g in range(len(abscissa)):
            i = len(abscissa) * k + g
            a, b, c = out.a[i], out.b[i], corner[k]
            n, n_m, e = s.n[a], m.n[b], s.e[a]
            after = c + 1 if c + 1 < n_m else 0
            project(m.x[b], n_m, s.centre[a], e, False, y)
            low, high = low_high[k, 0], low_high[k, 1]
            part = low + (high - low) * abscissa[g]
            out.share[i, c], out.share[i, after] = 1 - part, part
            across = _outward(y, n_m, c, after)
            for j in range(3):
                out.nu[i, j] = across[0] * e[0, j] + across[1] * e[1, j]
            p = (y[c, 0] + part * (y[after, 0] - y[c, 0]), y[c, 1] + part * (y[after, 1] - y[c, 1]))
            height = (1 - part) * y[c, 2] + part * y[after, 2] - _corner_shares(s.y[a], n, p, own)
            _turn_patch(s.x[a], n, e, out.nu[i], height, own, out.turned[i])
            size = (high - low) * across[2] * weight[g]
            _place_point(s, m, H, i, p, size, out)


@kernel(borrows=True)
def _outward(y: Any, n: int, c: int, after: int) -> Any:
    """Return the unit normal of an edge of a polygon y (n, .), in its plane, outward, and the edge's length."""
    along = (y[after, 0] - y[c, 0], y[after, 1] - y[c, 1])
    length = np.sqrt(along[0] * along[0] + along[1] * along[1])
    mid = (0.0, 0.0)
    for k in range(n):
        mid = (mid[0] + y[k, 0] / n, mid[1] + y[k, 1] / n)
    nu = (along[1] / length, -along[0] / length)
    outward = nu[0] * (y[c, 0] - mid[0]) + nu[1] * (y[c, 1] - mid[1]) >= 0
    return (nu[0], nu[1], length) if outward else (-nu[0], -nu[1], length)


@kernel(borrows=True)
def _corner_shares(y: Any, n: int, p: Any, out: Any) -> Any:
    """Write the shape functions of the corners of a patch y (n, 3) at the point p of its plane; return its height."""
    out[:] = 0.0
    if n == 3:
        u, v = (y[1, 0] - y[0, 0], y[1, 1] - y[0, 1]), (y[2, 0] - y[0, 0], y[2, 1] - y[0, 1])
        r, area = (p[0] - y[0, 0], p[1] - y[0, 1]), wedge(u, v)
        out[1], out[2] = wedge(r, v) / area, wedge(u, r) / area
        out[0] = 1 - out[1] - out[2]
    else:
        c, u, v, d = quadrangle(y)
        s, t, _ = in_quadrangle(c, u, v, d, p[0], p[1])
        out[0], out[1] = (1 - s) * (1 - t) / 4, (1 + s) * (1 - t) / 4
        out[2], out[3] = (1 + s) * (1 + t) / 4, (1 - s) * (1 + t) / 4
    height = 0.0
    for k in range(n):
        height += out[k] * y[k, 2]
    return height


@kernel(borrows=True)
def _turn_patch(x: Any, n: int, e: Any, nu: Any, height: float, own: Any, turned: Any) -> None:
    """Write what the corners of a slave's patch x (n, 3) add to V: -h nu.de, and -nu.dx.

    The normal e of the patch is that of two chords: of its diagonals, or of the first and the last edge of a triangle.
    """
    i, j = (0, 1) if n == 3 else (1, 3)
    t0 = (x[2, 0] - x[0, 0], x[2, 1] - x[0, 1], x[2, 2] - x[0, 2])
    if n == 3:
        t1 = (x[0, 0] - x[1, 0], x[0, 1] - x[1, 1], x[0, 2] - x[1, 2])
    else:
        t1 = (x[3, 0] - x[1, 0], x[3, 1] - x[1, 1], x[3, 2] - x[1, 2])
    g00, g01, g11 = t0[0] * t0[0] + t0[1] * t0[1] + t0[2] * t0[2], 0.0, 0.0
    f0 = f1 = 0.0
    for k in range(3):
        g01 += t0[k] * t1[k]
        g11 += t1[k] * t1[k]
        f0 += t0[k] * nu[k]
        f1 += t1[k] * nu[k]
    det = g00 * g11 - g01 * g01
    d0, d1 = height * (g11 * f0 - g01 * f1) / det, height * (g00 * f1 - g01 * f0) / det
    for k in range(3):
        for c in range(n):
            turned[c, k] = -own[c] * nu[k]
        turned[0, k] -= d0 * e[2, k]
        turned[2, k] += d0 * e[2, k]
        turned[i, k] += (d1 if n == 3 else -d1) * e[2, k]
        turned[j, k] -= (d1 if n == 3 else -d1) * e[2, k]


@kernel(borrows=True)
def _place_point(s: Any, m: Any, H: Any, i: int, p: Any, size: float, out: Any) -> None:
    """Fill row i of `out` with the point of the slave's face over p, in the plane of its patch, and where its ray ends.

    `size`: length of the edge times the Gauss weight.
    """
    a, b = out.a[i], out.b[i]
    face, other = s.face[a], m.face[b]
    u, v, ratio = in_face(inverse(s.y[a], s.n[a], s.xi[a]), p[0], p[1])
    x, du, dv = at(s.G[face], s.kind[face], u, v)
    um = vm = 0.0
    for c in range(m.n[b]):
        um += out.share[i, c] * m.xi[b, c, 0]
        vm += out.share[i, c] * m.xi[b, c, 1]
    met, u_end, v_end, distance, unit, jacobian = end_of_ray(
        H, face, other, x, du, dv, u, v, m.G[other], m.kind[other], um, vm
    )
    out.xi_s[i, 0], out.xi_s[i, 1], out.xi_m[i, 0], out.xi_m[i, 1] = u, v, u_end, v_end
    out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = unit
    out.ray[i], out.weight[i] = distance, size * abs(ratio) * jacobian
    near = abs(u_end - um) < _BEYOND and abs(v_end - vm) < _BEYOND
    out.met[i] = met and near and abs(distance) < np.inf
