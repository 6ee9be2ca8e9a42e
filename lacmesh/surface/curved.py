"""Integrals of the shape functions of plane faces with curved sides over a mortar segment, from its edges.

    int_P f dA = sum over edges  int_0^1 int_0^1 (f J)(xi_0 + r (xi(t) - xi_0)) r dr  (xi(t) - xi_0) x xi'(t) dt,

polynomial in r, analytic in t: an edge that belongs to a face is straight in that face's reference coordinates; in the
other face it is found by a ray through each of its points. Vertices are first moved to the intersections of the true
sides.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacmesh.surface.maps import CURVED, at
from lacmesh.surface.moments import functions
from lacmesh.surface.polygon import CHORD, MASTER
from lacmesh.surface.project import in_face, ray

_STEPS = 30
#: Gauss points along an edge, and from the middle of a piece to it (tests/surface/test_points.py)
_ALONG, _ACROSS = 24, 6


class SegmentFace(NamedTuple):
    """One side of a mortar segment: the map `G` (9, 3) of its face, of a `kind`; its patch; `k` functions to integrate.

    The patch has `n` corners, at `xi` (4, 2) in the face and at `y` (4, .) in the slave's plane; `patch`: its
    `project.inverse`.
    """

    G: Floats
    kind: int
    n: int
    xi: Floats
    y: Floats
    patch: Any
    k: int


@kernel
def in_plane(d: Any, e: Any) -> Any:
    """Components of a vector along the first two axes of a frame."""
    return d[0] * e[0, 0] + d[1] * e[0, 1] + d[2] * e[0, 2], d[0] * e[1, 0] + d[1] * e[1, 1] + d[2] * e[1, 2]


@kernel
def along(a: Any, b: Any, u: float, v: float) -> Any:
    """Parameter on the line a -> b of the orthogonal projection of the point (u, v)."""
    d0, d1 = b[0] - a[0], b[1] - a[1]
    return ((u - a[0]) * d0 + (v - a[1]) * d1) / (d0 * d0 + d1 * d1)


@kernel
def _crossing(one: Any, a0: Any, a1: Any, two: Any, b0: Any, b1: Any, e: Any, s: float, t: float) -> Any:
    """Intersect two curves, seen along e's normal, by Newton's method: x(a0 + s (a1 - a0)), x(b0 + t (b1 - b0)).

    The first lies in face `one`, the second in face `two`; (s, t) is the first guess. Returns (converged, s, t).
    """
    for _ in range(_STEPS):
        x, xu, xv = at(one.G, one.kind, a0[0] + s * (a1[0] - a0[0]), a0[1] + s * (a1[1] - a0[1]))
        y, yu, yv = at(two.G, two.kind, b0[0] + t * (b1[0] - b0[0]), b0[1] + t * (b1[1] - b0[1]))
        f, g = in_plane((x[0] - y[0], x[1] - y[1], x[2] - y[2]), e)
        fs, gs = _moved(xu, xv, a1[0] - a0[0], a1[1] - a0[1], e)
        ft, gt = _moved(yu, yv, b1[0] - b0[0], b1[1] - b0[1], e)
        det = ft * gs - fs * gt
        ds = (f * gt - ft * g) / det
        dt = (f * gs - fs * g) / det
        s += ds
        t += dt
        size = abs(ds) + abs(dt)
        if not size < 2.0:
            return False, s, t
        if size < 1e-12:
            return True, s, t
    return False, s, t


@kernel
def _moved(xu: Any, xv: Any, du: float, dv: float, e: Any) -> Any:
    """Displacement in a frame's plane of a point of a face with derivatives xu, xv when (u, v) moves by (du, dv)."""
    pu, qu = in_plane(xu, e)
    pv, qv = in_plane(xv, e)
    return pu * du + pv * dv, qu * du + qv * dv


@kernel
def _speed(xu: Any, xv: Any, du: float, dv: float, yu: Any, yv: Any, e: Any) -> Any:
    """Velocity of (u, v) in a face with derivatives yu, yv of the point that follows, along e's normal, another face's.

    That point, in a face with derivatives xu, xv, moves with (du, dv).
    """
    p, q = _moved(xu, xv, du, dv, e)
    au, bu = in_plane(yu, e)
    av, bv = in_plane(yv, e)
    det = au * bv - av * bu
    return (p * bv - av * q) / det, (au * q - p * bu) / det


@kernel
def vertices_in_faces(polygon: Any, edges: Any, slave: Any, master: Any, centre: Any, e: Any, out: Any) -> None:
    """Write the reference coordinates (n, 4) of a piece's vertices: two in the slave face, two in the master's.

    On faces with curved sides the vertices are moved to the intersections of the true sides.
    """
    n = len(polygon)
    for k in range(n):
        p, q = polygon[k, 0], polygon[k, 1]
        out[k, 0], out[k, 1], _ = in_face(slave.patch, p, q)
        out[k, 2], out[k, 3], _ = in_face(master.patch, p, q)
    if slave.kind < CURVED and master.kind < CURVED:
        return
    for k in range(n):
        before, after = edges[k - 1 if k > 0 else n - 1], edges[k]
        low, high = min(before, after), max(before, after)
        if low < MASTER <= high < CHORD and _meet_at_crossing(low, high - MASTER, slave, master, e, out[k]):
            continue
        _meet_along_normal(polygon[k], low >= MASTER and high < CHORD, high < MASTER, slave, master, centre, e, out[k])


@kernel
def _meet_at_crossing(i: int, j: int, slave: Any, master: Any, e: Any, out: Any) -> Any:
    """Move a vertex to the intersection of edge i of the slave and edge j of the master; False if there is none."""
    a0, a1 = slave.xi[i], slave.xi[(i + 1) % slave.n]
    b0, b1 = master.xi[j], master.xi[(j + 1) % master.n]
    s, t = along(a0, a1, out[0], out[1]), along(b0, b1, out[2], out[3])
    converged, s, t = _crossing(slave, a0, a1, master, b0, b1, e, s, t)
    if not (converged and -0.2 < s < 1.2 and -0.2 < t < 1.2):
        return False
    out[0], out[1] = a0[0] + s * (a1[0] - a0[0]), a0[1] + s * (a1[1] - a0[1])
    out[2], out[3] = b0[0] + t * (b1[0] - b0[0]), b0[1] + t * (b1[1] - b0[1])
    return True


@kernel
def _meet_along_normal(
    vertex: Any, of_master: bool, of_slave: bool, slave: Any, master: Any, centre: Any, e: Any, out: Any
) -> None:
    """Project a vertex along the frame's normal into the face of which it is no corner; into both if of neither."""
    unit = (e[2, 0], e[2, 1], e[2, 2])
    x = (
        centre[0] + vertex[0] * e[0, 0] + vertex[1] * e[1, 0],
        centre[1] + vertex[0] * e[0, 1] + vertex[1] * e[1, 1],
        centre[2] + vertex[0] * e[0, 2] + vertex[1] * e[1, 2],
    )
    if of_slave:
        x, _, _ = at(slave.G, slave.kind, out[0], out[1])
    if of_master:
        x, _, _ = at(master.G, master.kind, out[2], out[3])
    else:
        _, out[2], out[3], _ = ray(master.G, master.kind, x, unit, out[2], out[3])
    if not of_slave:
        _, out[0], out[1], _ = ray(slave.G, slave.kind, x, unit, out[0], out[1])


@kernel
def _fan(
    side: Any, e: Any, local: Any, u: float, v: float, du: float, dv: float, weight: float, rules: Any, first: int,
    target: Any, work: Any,
) -> None:  # fmt: skip
    """Add to target[first:] the integrals over the sliver from `local` to (u, v), with the far side (du, dv).

    target[0] takes the area if first is 1.
    """
    u0, v0, scale = local
    a, b = u - u0, v - v0
    turn = (a * dv - b * du) * weight
    start = _ACROSS * (_ACROSS - 1) // 2
    for j in range(start, start + _ACROSS):
        r = rules.t[j]
        _, xu, xv = at(side.G, side.kind, u0 + r * a, v0 + r * b)
        pu, qu = in_plane(xu, e)
        pv, qv = in_plane(xv, e)
        mass = turn * rules.w[j] * r * (pu * qv - pv * qu)
        functions(r * a / scale, r * b / scale, side.k, work, 0)
        if first == 1:
            target[0] += mass
        for i in range(side.k):
            target[first + i] += mass * work[i]


@kernel
def curved_integrals(
    corner: Any, edges: Any, n: int, slave: Any, master: Any, e: Any, at_slave: Any, at_master: Any, rules: Any,
    target: Any, work: Any,
) -> None:  # fmt: skip
    """Add to `target` the integrals over a piece of 1, of slave.k functions of the slave, of master.k of the master.

    `corner` (n, 4): vertices in both faces; `at_*`: origin and scale of the functions' arguments in each face.
    """
    unit = (e[2, 0], e[2, 1], e[2, 2])
    start = _ALONG * (_ALONG - 1) // 2
    for k in range(n):
        j = k + 1 if k + 1 < n else 0
        d = corner[j] - corner[k]
        lead = MASTER <= edges[k] < CHORD
        for i in range(start, start + _ALONG):
            t, w = rules.t[i], rules.w[i]
            u, v = corner[k, 0] + t * d[0], corner[k, 1] + t * d[1]
            um, vm = corner[k, 2] + t * d[2], corner[k, 3] + t * d[3]
            if lead:
                x, xu, xv = at(master.G, master.kind, um, vm)
                _, u, v, _ = ray(slave.G, slave.kind, x, unit, u, v)
                _, yu, yv = at(slave.G, slave.kind, u, v)
                mu, mv = d[2], d[3]
                su, sv = _speed(xu, xv, mu, mv, yu, yv, e)
            else:
                x, xu, xv = at(slave.G, slave.kind, u, v)
                _, um, vm, _ = ray(master.G, master.kind, x, unit, um, vm)
                _, yu, yv = at(master.G, master.kind, um, vm)
                su, sv = d[0], d[1]
                mu, mv = _speed(xu, xv, su, sv, yu, yv, e)
            _fan(slave, e, at_slave, u, v, su, sv, w, rules, 1, target, work)
            _fan(master, e, at_master, um, vm, mu, mv, w, rules, 1 + slave.k, target, work)
