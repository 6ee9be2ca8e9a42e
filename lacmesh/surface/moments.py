"""Exact integrals of the functions of a plane face with straight sides over a piece, from the piece's edges.

Over a piece P the functions of a face are polynomials f in its reference coordinates (u, v), and by Green's theorem

    int_P f dA = sum over edges  int F dv,   F = int f J du,   J = J0 + Ju u + Jv v the Jacobian,

where F is a polynomial too. An edge that is one of the face's own, or any edge of an affine face, is straight in (u,
v): a few Gauss points are exact. On any other edge the integrand is analytic in the arc length t, up to the points
where the Jacobian would vanish on its line, the zeros of the discriminant of the inverse map, a quadratic in t. The
error of n Gauss points is rho^(-2 n), with rho the sum of the half axes of the ellipse through the nearest of these
points with foci at the ends of the edge (Trefethen, SIAM Review 50, 2008): so the number needed is known beforehand.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacmesh.surface.project import in_quadrangle, quadrangle, wedge

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
