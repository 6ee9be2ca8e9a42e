"""Where points are: in a patch's plane and in its face, and where a ray meets a face's true geometry."""

from __future__ import annotations

import numpy as np
from numba import njit

from lacmesh.surface.maps import AFFINE, at

_MOST = 40


@njit(cache=True, error_model="numpy")
def in_face(y, n, xi, p, q):
    """Reference coordinates (u, v) in its face of a point (p, q) of a patch's plane, and d(u, v) / d(p, q).

    `y` (4, .), `xi` (4, 2): corners of the patch in its plane and in the face; the map between is affine on triangles
    and bilinear on quadrangles, whose closed form (a quadratic equation) Newton's steps make exact.
    """
    if n == 3:
        ax, ay, bx, by = y[1, 0] - y[0, 0], y[1, 1] - y[0, 1], y[2, 0] - y[0, 0], y[2, 1] - y[0, 1]
        det = ax * by - ay * bx
        s = ((p - y[0, 0]) * by - (q - y[0, 1]) * bx) / det
        t = ((q - y[0, 1]) * ax - (p - y[0, 0]) * ay) / det
        au, av, bu, bv = xi[1, 0] - xi[0, 0], xi[1, 1] - xi[0, 1], xi[2, 0] - xi[0, 0], xi[2, 1] - xi[0, 1]
        return xi[0, 0] + s * au + t * bu, xi[0, 1] + s * av + t * bv, (au * bv - av * bu) / det
    cx, cy = (y[0, 0] + y[1, 0] + y[2, 0] + y[3, 0]) / 4, (y[0, 1] + y[1, 1] + y[2, 1] + y[3, 1]) / 4
    ax, ay = (y[1, 0] + y[2, 0] - y[0, 0] - y[3, 0]) / 4, (y[1, 1] + y[2, 1] - y[0, 1] - y[3, 1]) / 4
    bx, by = (y[2, 0] + y[3, 0] - y[0, 0] - y[1, 0]) / 4, (y[2, 1] + y[3, 1] - y[0, 1] - y[1, 1]) / 4
    dx, dy = (y[0, 0] + y[2, 0] - y[1, 0] - y[3, 0]) / 4, (y[0, 1] + y[2, 1] - y[1, 1] - y[3, 1]) / 4
    det = ax * by - ay * bx
    s = ((p - cx) * by - (q - cy) * bx) / det
    t = ((q - cy) * ax - (p - cx) * ay) / det
    jacobian = det
    for _ in range(_MOST):
        rx = cx + s * ax + t * bx + s * t * dx - p
        ry = cy + s * ay + t * by + s * t * dy - q
        sx, sy, tx, ty = ax + t * dx, ay + t * dy, bx + s * dx, by + s * dy
        jacobian = sx * ty - sy * tx
        ds = (rx * ty - ry * tx) / jacobian
        dt = (sx * ry - sy * rx) / jacobian
        s -= ds
        t -= dt
        if not abs(ds) + abs(dt) > 1e-9:
            break
    jacobian = (ax + t * dx) * (by + s * dy) - (ay + t * dy) * (bx + s * dx)
    # the patch is a rectangle of its face's reference square, or all of it
    half_u, half_v = (xi[2, 0] - xi[0, 0]) / 2, (xi[2, 1] - xi[0, 1]) / 2
    u = xi[0, 0] + (s + 1) * half_u
    v = xi[0, 1] + (t + 1) * half_v
    return u, v, half_u * half_v / jacobian


@njit(cache=True, error_model="numpy")
def ray(G, kind, x, n, u, v):
    """Where the line through x along n meets a face with map G: (met, u, v, distance along n), from a first guess.

    Newton's method, its step at most 1 in reference coordinates. Not met: no convergence (the face is parallel to n).
    """
    # two directions across n: Duff and others, J. Comput. Graph. Tech. 6, 2017
    sign = 1.0 if n[2] >= 0 else -1.0
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    t0, t1, t2 = 1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]
    r0, r1, r2 = b, sign + n[1] * n[1] * a, -n[1]
    met = False
    for step in range(_MOST):
        y, du, dv = at(G, kind, u, v)
        d0, d1, d2 = y[0] - x[0], y[1] - x[1], y[2] - x[2]
        f = d0 * t0 + d1 * t1 + d2 * t2
        g = d0 * r0 + d1 * r1 + d2 * r2
        fu = du[0] * t0 + du[1] * t1 + du[2] * t2
        fv = dv[0] * t0 + dv[1] * t1 + dv[2] * t2
        gu = du[0] * r0 + du[1] * r1 + du[2] * r2
        gv = dv[0] * r0 + dv[1] * r1 + dv[2] * r2
        det = fu * gv - fv * gu
        if det == 0.0:
            break
        su = (f * gv - fv * g) / det
        sv = (fu * g - f * gu) / det
        longest = max(abs(su), abs(sv))
        if not longest < np.inf:
            break
        if longest > 1.0 and kind != AFFINE:
            su /= longest
            sv /= longest
        u -= su
        v -= sv
        if longest < 1e-9 or (kind == AFFINE and step == 1):
            met = True
            break
    y, du, dv = at(G, kind, u, v)
    return met, u, v, (y[0] - x[0]) * n[0] + (y[1] - x[1]) * n[1] + (y[2] - x[2]) * n[2]
