"""Projection of points: from a patch's plane into its face, and along a ray onto a face's true geometry."""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.surface.maps import AFFINE, at

_MOST = 40


@kernel
def quadrangle(y: Any) -> Any:
    """Coefficients c, a, b, d, two components each, of the bilinear map y = c + s a + t b + s t d with corners y."""
    return (
        ((y[0, 0] + y[1, 0] + y[2, 0] + y[3, 0]) / 4, (y[0, 1] + y[1, 1] + y[2, 1] + y[3, 1]) / 4),
        ((y[1, 0] + y[2, 0] - y[0, 0] - y[3, 0]) / 4, (y[1, 1] + y[2, 1] - y[0, 1] - y[3, 1]) / 4),
        ((y[2, 0] + y[3, 0] - y[0, 0] - y[1, 0]) / 4, (y[2, 1] + y[3, 1] - y[0, 1] - y[1, 1]) / 4),
        ((y[0, 0] + y[2, 0] - y[1, 0] - y[3, 0]) / 4, (y[0, 1] + y[2, 1] - y[1, 1] - y[3, 1]) / 4),
    )


@kernel
def wedge(a: Any, b: Any) -> Any:
    """The third component of the cross product of two vectors of a plane."""
    return a[0] * b[1] - a[1] * b[0]


@kernel
def in_quadrangle(c: Any, a: Any, b: Any, d: Any, p: float, q: float) -> Any:
    """(s, t) of the point (p, q) of a plane quadrangle, and the Jacobian of its map there.

    Eliminating t from r = s a + t b + s t d gives (a x d) s^2 - (r x d - a x b) s - r x b = 0. The discriminant is the
    square of the Jacobian, so that its sign selects the root. One step of Newton's method removes the rounding.
    """
    r = (p - c[0], q - c[1])
    turn = 1.0 if wedge(a, b) >= 0 else -1.0
    A, B, C = wedge(a, d), wedge(r, d) - wedge(a, b), wedge(r, b)
    root = turn * np.sqrt(max(B * B + 4 * A * C, 0.0))
    s = -2 * C / (B - root) if turn * B < 0 else (B + root) / (2 * A)
    x, y = b[0] + s * d[0], b[1] + s * d[1]
    square = x * x + y * y
    t = ((r[0] - s * a[0]) * x + (r[1] - s * a[1]) * y) / square if square > 0 else 0.0
    f = (s * a[0] + t * b[0] + s * t * d[0] - r[0], s * a[1] + t * b[1] + s * t * d[1] - r[1])
    along_s, along_t = (a[0] + t * d[0], a[1] + t * d[1]), (x, y)
    jacobian = wedge(along_s, along_t)
    ds, dt = wedge(f, along_t) / jacobian, wedge(along_s, f) / jacobian
    if abs(ds) + abs(dt) < 1e-3:  # false for NaN, too: where the Jacobian is 0
        s -= ds
        t -= dt
    return s, t, wedge((a[0] + t * d[0], a[1] + t * d[1]), (b[0] + s * d[0], b[1] + s * d[1]))


@kernel
def inverse(y: Any, n: int, xi: Any) -> Any:
    """Data of a patch for `in_face`: n; c, a, b, d as from `quadrangle`; origin and steps in its face.

    `y` (4, .), `xi` (4, 2): corners of the patch in its plane and in the face; the map between is affine on triangles
    and bilinear on quadrangles, which are rectangles of their face's reference square, or all of it.
    """
    if n == 3:
        a, b = (y[1, 0] - y[0, 0], y[1, 1] - y[0, 1]), (y[2, 0] - y[0, 0], y[2, 1] - y[0, 1])
        along_s = (xi[1, 0] - xi[0, 0], xi[1, 1] - xi[0, 1])
        along_t = (xi[2, 0] - xi[0, 0], xi[2, 1] - xi[0, 1])
        return n, (y[0, 0], y[0, 1]), a, b, (0.0, 0.0), (xi[0, 0], xi[0, 1]), along_s, along_t
    c, a, b, d = quadrangle(y)
    half_u, half_v = (xi[2, 0] - xi[0, 0]) / 2, (xi[2, 1] - xi[0, 1]) / 2
    return n, c, a, b, d, (xi[0, 0] + half_u, xi[0, 1] + half_v), (half_u, 0.0), (0.0, half_v)


@kernel
def in_face(patch: Any, p: float, q: float) -> Any:
    """Reference coordinates (u, v) in its face of a point (p, q) of a patch's plane; determinant d(u, v) / d(p, q).

    `patch`: the result of `inverse`.
    """
    n, c, a, b, d, origin, along_s, along_t = patch
    if n == 3:
        jacobian, r = wedge(a, b), (p - c[0], q - c[1])
        s, t = wedge(r, b) / jacobian, wedge(a, r) / jacobian
    else:
        s, t, jacobian = in_quadrangle(c, a, b, d, p, q)
    u = origin[0] + s * along_s[0] + t * along_t[0]
    v = origin[1] + s * along_s[1] + t * along_t[1]
    return u, v, wedge(along_s, along_t) / jacobian


@kernel(borrows=True)
def ray(G: Any, kind: int, x: Any, n: Any, u: float, v: float) -> Any:
    """Intersect the line through x along n with a face of map G: (met, u, v, distance along n), from a first guess.

    Newton's method, with steps of at most 1 in reference coordinates. It is not met if there is no convergence (the
    face is parallel to n).
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
