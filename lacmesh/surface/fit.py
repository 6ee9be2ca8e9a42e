"""Weights that integrate every shape function of both faces exactly over a piece, on faces of any shape in the plane.

Over a piece P the functions of the slave face are polynomials in its reference coordinates, and so are those of the
master face in its own; in the plane neither are. Their integrals over P follow from the piece's edges alone,

    int_P f dA = sum over edges  int_0^1 int_0^1 (f J)(xi_0 + r (xi(t) - xi_0)) r dr  (xi(t) - xi_0) x xi'(t) dt,

polynomial in r, analytic in t: an edge that belongs to a face is straight in its reference coordinates, and in the
other's it follows from a ray through each of its points. (So the sides of plane faces may be curved, too: vertices are
first moved to where the true sides cross.) The weights of a plain rule on P are then corrected,

    w_q (1 + c_q),  sum_q w_q c_q^2 least,  sum_q w_q (1 + c_q) f(q) = int_P f  for every function f of either face,

by orthogonalising the functions (modified Gram-Schmidt); a function that depends on those before it, as where both
faces are the same, is left out.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from lacmesh.surface.clip import CHORD, MASTER
from lacmesh.surface.maps import CURVED, at
from lacmesh.surface.project import in_face, ray

#: what is left of a function, against itself, for it to count as one more
_INDEPENDENT = 1e-10
_STEPS = 30


@njit(cache=True, error_model="numpy")
def functions(u, v, k, out, first):
    """The first k of u, v, uv, u^2, v^2, u^2 v, u v^2, u^2 v^2 into out[first:]."""
    out[first], out[first + 1] = u, v
    if k > 2:
        out[first + 2] = u * v
    if k > 3:
        out[first + 3], out[first + 4] = u * u, v * v
    if k > 5:
        out[first + 5], out[first + 6] = u * u * v, u * v * v
    if k > 7:
        out[first + 7] = u * u * v * v


@njit(cache=True, error_model="numpy")
def _in_plane(d, e):
    """Components of a vector along the first two axes of a frame."""
    return d[0] * e[0, 0] + d[1] * e[0, 1] + d[2] * e[0, 2], d[0] * e[1, 0] + d[1] * e[1, 1] + d[2] * e[1, 2]


@njit(cache=True, error_model="numpy")
def _cross_over(G, kind, a0, a1, H, kind_h, b0, b1, e, s, t):
    """Where the curve x(a0 + s (a1 - a0)) of one face crosses, seen along e's normal, one of another: (found, s, t)."""
    for _ in range(_STEPS):
        x, xu, xv = at(G, kind, a0[0] + s * (a1[0] - a0[0]), a0[1] + s * (a1[1] - a0[1]))
        y, yu, yv = at(H, kind_h, b0[0] + t * (b1[0] - b0[0]), b0[1] + t * (b1[1] - b0[1]))
        f, g = _in_plane((x[0] - y[0], x[1] - y[1], x[2] - y[2]), e)
        pu, qu = _in_plane(xu, e)
        pv, qv = _in_plane(xv, e)
        fs, gs = pu * (a1[0] - a0[0]) + pv * (a1[1] - a0[1]), qu * (a1[0] - a0[0]) + qv * (a1[1] - a0[1])
        pu, qu = _in_plane(yu, e)
        pv, qv = _in_plane(yv, e)
        ft, gt = pu * (b1[0] - b0[0]) + pv * (b1[1] - b0[1]), qu * (b1[0] - b0[0]) + qv * (b1[1] - b0[1])
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


@njit(cache=True, error_model="numpy")
def vertices_in_faces(polygon, edges, y_s, n_s, xi_s, y_m, n_m, xi_m, G_s, kind_s, G_m, kind_m, centre, e, out):
    """Reference coordinates (n, 4) of a piece's vertices: two in the slave face, two in the master's.

    On faces with curved sides the vertices move to where the true sides meet.
    """
    n = len(polygon)
    for k in range(n):
        p, q = polygon[k, 0], polygon[k, 1]
        out[k, 0], out[k, 1], _ = in_face(y_s, n_s, xi_s, p, q)
        out[k, 2], out[k, 3], _ = in_face(y_m, n_m, xi_m, p, q)
    if kind_s < CURVED and kind_m < CURVED:
        return
    unit = (e[2, 0], e[2, 1], e[2, 2])
    for k in range(n):
        before, after = edges[k - 1 if k > 0 else n - 1], edges[k]
        x = (
            centre[0] + polygon[k, 0] * e[0, 0] + polygon[k, 1] * e[1, 0],
            centre[1] + polygon[k, 0] * e[0, 1] + polygon[k, 1] * e[1, 1],
            centre[2] + polygon[k, 0] * e[0, 2] + polygon[k, 1] * e[1, 2],
        )
        of_slave = before < MASTER and after < MASTER
        of_master = MASTER <= before < CHORD and MASTER <= after < CHORD
        if before < CHORD and after < CHORD and not of_slave and not of_master:
            i, j = min(before, after), max(before, after) - MASTER
            a0, a1 = xi_s[i], xi_s[(i + 1) % n_s]
            b0, b1 = xi_m[j], xi_m[(j + 1) % n_m]
            s = along(a0, a1, out[k, 0], out[k, 1])
            t = along(b0, b1, out[k, 2], out[k, 3])
            found, s, t = _cross_over(G_s, kind_s, a0, a1, G_m, kind_m, b0, b1, e, s, t)
            if found and -0.2 < s < 1.2 and -0.2 < t < 1.2:
                out[k, 0], out[k, 1] = a0[0] + s * (a1[0] - a0[0]), a0[1] + s * (a1[1] - a0[1])
                out[k, 2], out[k, 3] = b0[0] + t * (b1[0] - b0[0]), b0[1] + t * (b1[1] - b0[1])
                continue
        if of_slave or not of_master:
            if of_slave:
                x, _, _ = at(G_s, kind_s, out[k, 0], out[k, 1])
            _, out[k, 2], out[k, 3], _ = ray(G_m, kind_m, x, unit, out[k, 2], out[k, 3])
        if of_master or not of_slave:
            if of_master:
                x, _, _ = at(G_m, kind_m, out[k, 2], out[k, 3])
            _, out[k, 0], out[k, 1], _ = ray(G_s, kind_s, x, unit, out[k, 0], out[k, 1])


@njit(cache=True, error_model="numpy")
def along(a, b, u, v):
    """Where on the line a -> b a point's foot lies."""
    d0, d1 = b[0] - a[0], b[1] - a[1]
    return ((u - a[0]) * d0 + (v - a[1]) * d1) / (d0 * d0 + d1 * d1)


@njit(cache=True, error_model="numpy")
def _fan(G, kind, e, u0, v0, scale, u, v, du, dv, weight, k, R, wr, first, target, work):
    """Add to target[first:] the integrals over the sliver from (u0, v0) to (u, v), whose far side moves by (du, dv).

    target[0] takes the area where first is 1.
    """
    a, b = u - u0, v - v0
    turn = (a * dv - b * du) * weight
    for j in range(len(R)):
        r = R[j]
        _, xu, xv = at(G, kind, u0 + r * a, v0 + r * b)
        pu, qu = _in_plane(xu, e)
        pv, qv = _in_plane(xv, e)
        mass = turn * wr[j] * r * (pu * qv - pv * qu)
        functions(r * a / scale, r * b / scale, k, work, 0)
        if first == 1:
            target[0] += mass
        for i in range(k):
            target[first + i] += mass * work[i]


@njit(cache=True, error_model="numpy")
def integrals(corner, edges, n, G_s, kind_s, k_s, G_m, kind_m, k_m, e, local, T, wt, R, wr, target, work):
    """Exact integrals over a piece: of 1, of k_s functions of the slave face, of k_m of the master's, into `target`.

    `corner` (n, 4): vertices in both faces; `local` (6,): origin and scale of the functions' arguments in either face.
    """
    unit = (e[2, 0], e[2, 1], e[2, 2])
    target[: 1 + k_s + k_m] = 0.0
    for k in range(n):
        j = k + 1 if k + 1 < n else 0
        d0, d1, d2, d3 = (
            corner[j, 0] - corner[k, 0], corner[j, 1] - corner[k, 1], corner[j, 2] - corner[k, 2], corner[j, 3] - corner[k, 3],
        )  # fmt: skip
        lead = MASTER <= edges[k] < CHORD
        for i in range(len(T)):
            t = T[i]
            u, v = corner[k, 0] + t * d0, corner[k, 1] + t * d1
            um, vm = corner[k, 2] + t * d2, corner[k, 3] + t * d3
            if lead:
                x, xu, xv = at(G_m, kind_m, um, vm)
                _, u, v, _ = ray(G_s, kind_s, x, unit, u, v)
                _, yu, yv = at(G_s, kind_s, u, v)
                su, sv = _speed(xu, xv, d2, d3, yu, yv, e)
                mu, mv = d2, d3
            else:
                x, xu, xv = at(G_s, kind_s, u, v)
                _, um, vm, _ = ray(G_m, kind_m, x, unit, um, vm)
                _, yu, yv = at(G_m, kind_m, um, vm)
                mu, mv = _speed(xu, xv, d0, d1, yu, yv, e)
                su, sv = d0, d1
            _fan(G_s, kind_s, e, local[0], local[1], local[2], u, v, su, sv, wt[i], k_s, R, wr, 1, target, work)
            _fan(G_m, kind_m, e, local[3], local[4], local[5], um, vm, mu, mv, wt[i], k_m, R, wr, 1 + k_s, target, work)


@njit(cache=True, error_model="numpy")
def _speed(xu, xv, du, dv, yu, yv, e):
    """How fast (u, v) moves in a face with derivatives yu, yv while x moves with (du, dv) in another, seen along e."""
    pu, qu = _in_plane(xu, e)
    pv, qv = _in_plane(xv, e)
    p, q = pu * du + pv * dv, qu * du + qv * dv
    au, bu = _in_plane(yu, e)
    av, bv = _in_plane(yv, e)
    det = au * bv - av * bu
    return (p * bv - av * q) / det, (au * q - p * bu) / det


@njit(cache=True, error_model="numpy")
def correct(weight, first, n, phi, k, target):
    """Multiply weights [first, first + n) so that functions phi (k, n) have the integrals `target`; phi is used up.

    Returns the largest relative change.
    """
    kept = 0
    for j in range(k):
        size = 0.0
        for q in range(n):
            size += weight[first + q] * phi[j, q] * phi[j, q]
        t = target[j]
        for _ in range(2):
            for i in range(kept):
                c = 0.0
                for q in range(n):
                    c += weight[first + q] * phi[j, q] * phi[i, q]
                for q in range(n):
                    phi[j, q] -= c * phi[i, q]
                t -= c * target[i]
        left = 0.0
        for q in range(n):
            left += weight[first + q] * phi[j, q] * phi[j, q]
        if left > _INDEPENDENT * _INDEPENDENT * size and kept < n:
            left = np.sqrt(left)
            for q in range(n):
                phi[kept, q] = phi[j, q] / left
            target[kept] = t / left
            kept += 1
    for i in range(kept):
        c = target[i]
        for q in range(n):
            c -= weight[first + q] * phi[i, q]
        target[i] = c
    most = 0.0
    for q in range(n):
        c = 0.0
        for i in range(kept):
            c += target[i] * phi[i, q]
        most = max(most, abs(c))
        phi[0, q] = c
    if not most < np.inf:
        return most
    for q in range(n):
        weight[first + q] *= 1 + phi[0, q]
    return most
