"""Exact integrals of the functions of a plane face over a piece, from the piece's edges.

With straight sides, the functions of a face are polynomials f in its reference coordinates (u, v). By Green's theorem

    int_P f dA = sum over edges  int F dv,   F = int f J du,   J = J0 + Ju u + Jv v the Jacobian,

where F is a polynomial too. An edge that is one of the face's own, or any edge of an affine face, is straight in (u,
v): a few Gauss points are exact. On any other edge the integrand is analytic in the arc length t, up to the points
where the Jacobian would vanish on its line, the zeros of the discriminant of the inverse map, a quadratic in t. The
error of n Gauss points is rho^(-2 n), with rho the sum of the half axes of the ellipse through the nearest of these
points with foci at the ends of the edge (Trefethen, SIAM Review 50, 2008): so the number needed is known beforehand.

With curved sides,

    int_P f dA = sum over edges  int_0^1 int_0^1 (f J)(xi_0 + r (xi(t) - xi_0)) r dr  (xi(t) - xi_0) x xi'(t) dt,

polynomial in r, analytic in t: an edge that belongs to a face is straight in that face's reference coordinates; in the
other face it is found by a ray through each of its points. Vertices are first moved to the intersections of the true
sides.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacmesh.surface.maps import CURVED, at, in_face, in_quadrangle, quadrangle, ray, wedge
from lacmesh.surface.polygon import CHORD, MASTER

#: Gauss points on an edge that no place where the Jacobian vanishes is near enough to need more
_MOST = 40
#: minus the logarithm of what the points on an edge may leave
_LEFT = 32.0


class Gauss(NamedTuple):
    """Gauss rules of 1, 2, ... points on [0, 1], one after the other: that with n points starts at n (n - 1) / 2."""

    t: Floats
    w: Floats


@cache
def gauss_rules() -> Gauss:
    """Return the rules of up to 40 points."""
    rules = [np.polynomial.legendre.leggauss(n) for n in range(1, _MOST + 1)]
    return Gauss(np.concatenate([(t + 1) / 2 for t, _ in rules]), np.concatenate([w / 2 for _, w in rules]))


@kernel
def functions(u: float, v: float, k: int, out: Any, first: int) -> None:
    """Write the first k of u, v, uv, u^2, v^2, u^2 v, u v^2, u^2 v^2 into out[first:]."""
    out[first], out[first + 1] = u, v
    if k > 2:
        out[first + 2] = u * v
    if k > 3:
        out[first + 3], out[first + 4] = u * u, v * v
    if k > 5:
        out[first + 5], out[first + 6] = u * u * v, u * v * v
    if k > 7:
        out[first + 7] = u * u * v * v


@kernel
def points_needed(c: Any, a: Any, b: Any, d: Any, p: Any, q: Any, least: int) -> Any:
    """Number of Gauss points that integrate a function analytic in a quadrangle's coordinates along p -> q."""
    half = ((q[0] - p[0]) / 2, (q[1] - p[1]) / 2)
    r = (p[0] + half[0] - c[0], p[1] + half[1] - c[1])
    alpha, beta, gamma = wedge(half, d), wedge(r, d) - wedge(a, b), wedge(a, d)
    square, line, constant = alpha * alpha, 2 * alpha * beta + 4 * gamma * wedge(half, b), beta * beta
    constant += 4 * gamma * wedge(r, b)
    # the roots' sum of distances to the ends of [-1, 1], the least of both
    if square > 1e-16 * abs(constant):
        inside = line * line - 4 * square * constant
        far = np.sqrt(abs(inside)) / (2 * square)
        middle = -line / (2 * square)
        if inside < 0:
            axis = (np.hypot(middle - 1, far) + np.hypot(middle + 1, far)) / 2
        else:
            axis = max(abs(abs(middle) - far), 1.0)
    elif abs(line) > 1e-8 * abs(constant):
        axis = max(abs(constant / line), 1.0)
    else:
        return least
    rho = axis + np.sqrt(axis * axis - 1)
    n = _LEFT / 2 / np.log(rho)
    # the functions grow on the ellipse like rho to their degree
    return min(int(n) + least, _MOST) if n < _MOST else _MOST


@kernel
def _add(u: float, v: float, dv: float, j0: float, ju: float, jv: float, k: int, first: int, target: Any) -> None:
    """Add to target[first:] the contributions of a boundary point to the integrals of k functions.

    target[0] takes the area if first is 1.
    """
    j = j0 + jv * v
    f0 = dv * u * (j + ju * u / 2)
    f1 = dv * u * u * (j / 2 + ju * u / 3)
    if first == 1:
        target[0] += f0
    target[first] += f1
    target[first + 1] += v * f0
    if k > 2:
        target[first + 2] += v * f1
    if k > 3:
        f2 = dv * u * u * u * (j / 3 + ju * u / 4)
        target[first + 3] += f2
        target[first + 4] += v * v * f0
        if k > 5:
            target[first + 5] += v * f2
            target[first + 6] += v * v * f1
        if k > 7:
            target[first + 7] += v * v * f2


@kernel
def straight_integrals(
    polygon: Any, corner: Any, edges: Any, own: int, y: Any, n: int, local: Any, k: int, first: int, rules: Any,
    target: Any,
) -> None:  # fmt: skip
    """Add to target[first:] the integrals over a polygon of k functions of a face with corners y (n, .) in its plane.

    `corner` (., 2): the polygon's vertices in the face's coordinates; edges own to own + 3 are the face's; `local`:
    origin and scale of the functions' arguments. target[0] takes the area if first is 1.
    """
    u0, v0, h = local
    place, share = rules.t, rules.w
    c, a, b, d = quadrangle(y)
    if n == 3:
        j0 = wedge((y[1, 0] - y[0, 0], y[1, 1] - y[0, 1]), (y[2, 0] - y[0, 0], y[2, 1] - y[0, 1]))
        ju = jv = 0.0
    else:
        ju, jv = wedge(a, d), wedge(d, b)
        j0 = wedge(a, b) + ju * u0 + jv * v0
    ju, jv = ju * h, jv * h
    bilinear = n == 4 and abs(ju) + abs(jv) > 1e-14 * abs(j0)
    least = 4 if k > 7 else 3
    m = len(polygon)
    for i in range(m):
        j = i + 1 if i + 1 < m else 0
        p, q = (polygon[i, 0], polygon[i, 1]), (polygon[j, 0], polygon[j, 1])
        straight = not bilinear or own <= edges[i] < own + 4
        points = least if straight else points_needed(c, a, b, d, p, q, least)
        start = points * (points - 1) // 2
        step = (q[0] - p[0], q[1] - p[1])
        du, dv = corner[j, 0] - corner[i, 0], corner[j, 1] - corner[i, 1]
        for g in range(start, start + points):
            t = place[g]
            if straight:
                u, v = corner[i, 0] + t * du, corner[i, 1] + t * dv
            else:
                u, v, jacobian = in_quadrangle(c, a, b, d, p[0] + t * step[0], p[1] + t * step[1])
                dv = wedge((a[0] + v * d[0], a[1] + v * d[1]), step) / jacobian
            _add((u - u0) / h, (v - v0) / h, share[g] * dv * h, j0, ju, jv, k, first, target)


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
