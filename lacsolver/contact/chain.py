"""Derivatives at one contact point, by the displacements of the nodes that it knows: kernels for loops over points.

A contact point knows the nodes a of its slave face, with the shape functions N_a, the nodes b of its master face, with
M_b, and with smoothed normals the normals h_a at the nodes of its slave face. Its slave coordinates are fixed, and its
ray x + r n meets the master's face at xi_bar:

    tau_b dxi_bar^b - n dr = dx + r dn - dx_bar         dx = N_a v_a, dx_bar = M_b v_b at fixed xi_bar

This gives the motion of the point on the master and the change of the ray's length r. The gap of the smooth surfaces,
whose heights move with their faces, changes by dg = dr - (db_m/dxi^b) dxi_bar^b. The change of the normal is

    dn = -a^k (n . dv/dxi^k)                            the face's own normal, a^k the dual vectors of its tangents
    dn = P N_a dh_a,  P = (1 - n n^T) / |H|             smoothed, n = H / |H|, H = N_a h_a

and in the current measure the weight changes by dw/w = a^k . dv/dxi^k (+ v_r / r in axisymmetry). A point on the edge
of a mortar segment, which moves by V (`edges`), has V in place of dw/w, and no other derivative.

Each derivative is a row of coefficients of the local unknowns: components of v_a, then of v_b, then of h_a.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints

#: largest number of local unknowns: those of two faces with nine nodes each, and of nine normals
MOST_UNKNOWNS = 81
#: rows of derivatives of a point: dn, the change of the normal; dxi_bar; dg; dw / w
NORMAL, SLIDE, GAP, STRETCH = 0, 3, 5, 6
N_ROWS = 7


class Skins(NamedTuple):
    """Both skins, with the numbers of nodes and normals that the local unknowns of a point are found by.

    `x` (n, 3): coordinates of the nodes of both skins; `type_s`, `type_m`: types of the faces; `nodes_s`, `nodes_m`
    (faces, 9): their nodes; `normal_of` (slave faces, 9): rows of `normals` (k, 3), the smoothed normals, or (0, 9) and
    (0, 3) where the faces have their own. `bases` (types, 9, 9): shape functions in monomials; `n_nodes` (types,).
    """

    x: Floats
    type_s: Ints
    type_m: Ints
    nodes_s: Ints
    nodes_m: Ints
    normal_of: Ints
    normals: Floats
    bases: Floats
    n_nodes: Ints


class MovingEdges(NamedTuple):
    """How fast the edges of mortar segments move at points on them (n,); of length 0 for points that are on none.

    V = sum_c turned_c . u(corner c of the slave's patch) + nu . sum_c share_c u(corner c of the master's patch), minus
    nu . u(x) in a plane. `patch_s`, `patch_m`: rows of the patches, whose corners are at `corners_s`, `corners_m`
    (patches, 4, 2) in their faces; `turned` (n, 4, 3); `share` (n, 4); `nu` (n, 3).
    """

    patch_s: Ints
    patch_m: Ints
    corners_s: Floats
    corners_m: Floats
    turned: Floats
    share: Floats
    nu: Floats

    @staticmethod
    def none() -> MovingEdges:
        """Return those of points that are on no edge."""
        row, corners = np.empty(0, np.int64), np.empty((0, 4, 2))
        return MovingEdges(row, row, corners, corners, np.empty((0, 4, 3)), np.empty((0, 4)), np.empty((0, 3)))


class Points(NamedTuple):
    """Contact points of a loop (n,): reference coordinates in both faces, and what is linearised about.

    `normal` (n, 3); `ray`: length of the ray from face to face; `slope` (n, 2): derivatives of the master's height,
    (0, 2) without heights. `current`, `radial`: 1 if weights change with the area of the slave, and with its radius.
    """

    xi_s: Floats
    xi_m: Floats
    normal: Floats
    ray: Floats
    slope: Floats
    current: int
    radial: int
    edges: MovingEdges


class Room(NamedTuple):
    """Arrays for one point: shape functions `N` and gradients `dN` of both sides, (2, 9) and (2, 9, 2); its rows."""

    N: Floats
    dN: Floats
    rows: Floats


def room() -> Room:
    """Return the arrays for one point."""
    return Room(np.empty((2, 9)), np.empty((2, 9, 2)), np.empty((N_ROWS, MOST_UNKNOWNS)))


@kernel
def shapes(basis: Any, n_nodes: int, u: float, v: float, N: Any, dN: Any) -> None:
    """Write the shape functions (9,) of a face at (u, v), and their derivatives (9, 2)."""
    for a in range(n_nodes):
        c0, c1, c2 = basis[a, 0], basis[a, 1], basis[a, 2]
        c3, c4, c5 = basis[a, 3], basis[a, 4], basis[a, 5]
        c6, c7, c8 = basis[a, 6], basis[a, 7], basis[a, 8]
        N[a] = c0 + u * (c1 + u * c3) + v * (c2 + u * (c4 + u * c6) + v * (c5 + u * (c7 + u * c8)))
        dN[a, 0] = c1 + 2 * u * c3 + v * (c4 + 2 * u * c6 + v * (c7 + 2 * u * c8))
        dN[a, 1] = c2 + u * (c4 + u * c6) + 2 * v * (c5 + u * (c7 + u * c8))


@kernel
def tangent_vector(x: Any, nodes: Any, n_nodes: int, dN: Any, k: int) -> Any:
    """Return the tangent of a face along its reference coordinate k, a triple."""
    t0 = t1 = t2 = 0.0
    for a in range(n_nodes):
        i = nodes[a]
        t0 += dN[a, k] * x[i, 0]
        t1 += dN[a, k] * x[i, 1]
        t2 += dN[a, k] * x[i, 2]
    return t0, t1, t2


@kernel
def _cross(a: Any, b: Any) -> Any:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _dual(t: Any, s: Any, d: int) -> Any:
    """Return the dual vectors of tangents t and s (of t alone if d is 2)."""
    if d == 2:
        size = _dot(t, t)
        return (t[0] / size, t[1] / size, t[2] / size), (0.0, 0.0, 0.0)
    tt, ts, ss = _dot(t, t), _dot(t, s), _dot(s, s)
    det = tt * ss - ts * ts
    return (
        ((ss * t[0] - ts * s[0]) / det, (ss * t[1] - ts * s[1]) / det, (ss * t[2] - ts * s[2]) / det),
        ((tt * s[0] - ts * t[0]) / det, (tt * s[1] - ts * t[1]) / det, (tt * s[2] - ts * t[2]) / det),
    )


@kernel
def _inverse(t: Any, s: Any, n: Any, d: int) -> Any:
    """Return the rows of the inverse of the matrix with columns t, s, -n (t and -n if d is 2), that of -n last."""
    if d == 2:
        det = t[1] * n[0] - t[0] * n[1]
        return (-n[1] / det, n[0] / det, 0.0), (0.0, 0.0, 0.0), (-t[1] / det, t[0] / det, 0.0)
    sn, nt, ts = _cross(n, s), _cross(t, n), _cross(t, s)
    det = _dot(t, sn)
    return (
        (sn[0] / det, sn[1] / det, sn[2] / det),
        (nt[0] / det, nt[1] / det, nt[2] / det),
        (ts[0] / det, ts[1] / det, ts[2] / det),
    )


@kernel
def differentiate(skins: Any, points: Any, p: int, s: int, m: int, d: int, made: Any) -> None:
    """Write the shape functions at point p of slave face s and master face m, and the rows of its derivatives."""
    k_s, k_m = skins.n_nodes[skins.type_s[s]], skins.n_nodes[skins.type_m[m]]
    N, dN = made.N, made.dN
    shapes(skins.bases[skins.type_s[s]], k_s, points.xi_s[p, 0], points.xi_s[p, 1], N[0], dN[0])
    shapes(skins.bases[skins.type_m[m]], k_m, points.xi_m[p, 0], points.xi_m[p, 1], N[1], dN[1])
    made.rows[:] = 0.0
    if len(points.edges.nu) > 0:
        _move(skins, points.edges, p, s, m, d, made)
        return
    n = (points.normal[p, 0], points.normal[p, 1], points.normal[p, 2])
    smooth = len(skins.normals) > 0
    if points.current == 1 or not smooth:
        first = tangent_vector(skins.x, skins.nodes_s[s], k_s, dN[0], 0)
        other = tangent_vector(skins.x, skins.nodes_s[s], k_s, dN[0], 1)
        duals = _dual(first, other, d)
        if points.current == 1:
            _stretch(skins, points.radial, s, k_s, d, duals, made)
        if not smooth:
            _turn(k_s, d, duals, n, made)
    if smooth:
        _turn_smoothly(skins, s, k_s, k_m, d, n, made)
    _slide(skins, points, p, m, (k_s, k_m, d), n, made)


@kernel
def _move(skins: Any, edges: Any, p: int, s: int, m: int, d: int, made: Any) -> None:
    """Write V as the row of dw / w: all that an edge changes is how much of the slave is integrated over."""
    k_s, k_m = skins.n_nodes[skins.type_s[s]], skins.n_nodes[skins.type_m[m]]
    row, N, dN = made.rows[STRETCH], np.empty(9), np.empty((9, 2))
    for c in range(4):
        if edges.turned[p, c, 0] != 0.0 or edges.turned[p, c, 1] != 0.0 or edges.turned[p, c, 2] != 0.0:
            xi = edges.corners_s[edges.patch_s[p], c]
            shapes(skins.bases[skins.type_s[s]], k_s, xi[0], xi[1], N, dN)
            for a in range(k_s):
                for j in range(d):
                    row[d * a + j] += N[a] * edges.turned[p, c, j]
        if edges.share[p, c] != 0.0:
            xi = edges.corners_m[edges.patch_m[p], c]
            shapes(skins.bases[skins.type_m[m]], k_m, xi[0], xi[1], N, dN)
            for b in range(k_m):
                for j in range(d):
                    row[d * (k_s + b) + j] += N[b] * edges.share[p, c] * edges.nu[p, j]
    if d == 2:
        for a in range(k_s):
            for j in range(d):
                row[d * a + j] -= made.N[0, a] * edges.nu[p, j]


@kernel
def _stretch(skins: Any, radial: int, s: int, k_s: int, d: int, duals: Any, made: Any) -> None:
    """Write the row of dw / w."""
    N, dN, row = made.N[0], made.dN[0], made.rows[STRETCH]
    r = 0.0
    for a in range(k_s):
        for j in range(d):
            row[d * a + j] = duals[0][j] * dN[a, 0] + duals[1][j] * dN[a, 1]
        r += N[a] * skins.x[skins.nodes_s[s, a], 0]
    if radial == 1:
        for a in range(k_s):
            row[d * a] += N[a] / r


@kernel
def _turn(k_s: int, d: int, duals: Any, n: Any, made: Any) -> None:
    """Write the rows of dn, the change of the face's own normal."""
    dN, rows = made.dN[0], made.rows
    for a in range(k_s):
        for i in range(d):
            c = -(duals[0][i] * dN[a, 0] + duals[1][i] * dN[a, 1])
            for j in range(d):
                rows[NORMAL + i, d * a + j] = c * n[j]


@kernel
def _turn_smoothly(skins: Any, s: int, k_s: int, k_m: int, d: int, n: Any, made: Any) -> None:
    """Write the rows of dn, the change of the interpolated nodal normals."""
    N, rows, first = made.N[0], made.rows, d * (k_s + k_m)
    h0 = h1 = h2 = 0.0
    for a in range(k_s):
        i = skins.normal_of[s, a]
        h0 += N[a] * skins.normals[i, 0]
        h1 += N[a] * skins.normals[i, 1]
        h2 += N[a] * skins.normals[i, 2]
    size = np.sqrt(h0 * h0 + h1 * h1 + h2 * h2)
    for a in range(k_s):
        for i in range(d):
            for j in range(d):
                rows[NORMAL + i, first + d * a + j] = ((1.0 if i == j else 0.0) - n[i] * n[j]) * N[a] / size


@kernel
def _slide(skins: Any, points: Any, p: int, m: int, sizes: Any, n: Any, made: Any) -> None:
    """Write the rows of dxi_bar and dg, from those of dn."""
    k_s, k_m, d = sizes
    N, M, rows = made.N[0], made.N[1], made.rows
    tau = tangent_vector(skins.x, skins.nodes_m[m], k_m, made.dN[1], 0)
    tau_2 = tangent_vector(skins.x, skins.nodes_m[m], k_m, made.dN[1], 1)
    inverse = _inverse(tau, tau_2, n, d)
    for k in range(d):
        a_k = inverse[2] if k == d - 1 else (inverse[0] if k == 0 else inverse[1])
        row = rows[GAP] if k == d - 1 else rows[SLIDE + k]
        for i in range(d):
            row += points.ray[p] * a_k[i] * rows[NORMAL + i]
        for a in range(k_s):
            for j in range(d):
                row[d * a + j] += N[a] * a_k[j]
        for b in range(k_m):
            for j in range(d):
                row[d * (k_s + b) + j] -= M[b] * a_k[j]
    if len(points.slope):
        for k in range(d - 1):
            rows[GAP] -= points.slope[p, k] * rows[SLIDE + k]
