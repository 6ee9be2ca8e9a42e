"""Derivatives at one contact point, by the displacements of the nodes that it knows: kernels for loops over points.

A contact point knows the nodes a of its slave face, with the shape functions N_a, the nodes b of its master face, with
M_b, and with smoothed normals the normals h_a at the nodes of its slave face, or h_b at those of its master face. Its
slave coordinates are fixed, and its ray x + r n meets the master's face at xi_bar:

    tau_b dxi_bar^b - n dr = dx + r dn - dx_bar         dx = N_a v_a, dx_bar = M_b v_b at fixed xi_bar

This gives the motion of the point on the master and the change of the ray's length r. The gap of the smooth surfaces,
whose heights move with their faces, changes by dg = dr - (db_m/dxi^b) dxi_bar^b. The change of the normal is

    dn = -a^k (N . dv/dxi^k)                            the face's own normal N, a^k the dual vectors of its tangents
    dn = P N_a dh_a,  P = (1 - n n^T) / |H|             smoothed, n = H / |H|, H = N_a h_a
    dn = P M_b dh_b + n_b dxi_bar^b                     the same of the master's face, n_b = dn/dxi_bar^b

As n is that at the end of the ray, tau_b - r n_b then stands for tau_b above, and P M_b dh_b for dn.

That of a smooth surface, n along N - a^k s_k, leans on the face's own and moves with it at fixed slopes s_k:

    dn = c_k (n . dv/dxi^k) - (n . c_k) (N - (N . n) n) (N . dv/dxi^k) - n (n . c_k) (n . dv/dxi^k),  c_k = -a^k

and in the current measure the weight changes by dw/w = a^k . dv/dxi^k (+ v_r / r in axisymmetry). A point on the edge
of a mortar segment, which moves by V (`edges`), has V in place of dw/w, and no other derivative.

Each derivative is a row of coefficients of the local unknowns: components of v_a, then of v_b, then of h_a or h_b.

Compiled, the kernels take one point p. As they stand they take an array of points (n,) whose faces are of the same two
types, too: then every number of a point is an array (n,), and each of its arrays has a last axis (n,).
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
    (faces, 9): their nodes. `normal_of` (faces, 9): rows of `normals` (k, 3) at the nodes of the slave's faces, or
    `of_master` of the master's; (0, 9) where the slave's faces have their own. `bases` (types, 9, 9): shape functions
    in monomials; `n_nodes` (types,).
    """

    x: Floats
    type_s: Ints
    type_m: Ints
    nodes_s: Ints
    nodes_m: Ints
    normal_of: Ints
    normals: Floats
    of_master: bool
    bases: Floats
    n_nodes: Ints


class MovingEdges(NamedTuple):
    """Velocities of the edges of mortar segments at points on them (n,); of length 0 for points that are on none.

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


class LoopPoints(NamedTuple):
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
    """Arrays for one point: shape functions (9,) and their gradients (9, 2) of both sides, and its rows.

    `N`, `dN`: those at another point of one side. `force`: rows of the derivatives of a traction (`tractions`).
    """

    N_s: Floats
    N_m: Floats
    N: Floats
    dN_s: Floats
    dN_m: Floats
    dN: Floats
    rows: Floats
    force: Floats


@kernel
def new_room(n: Any) -> Any:
    """Return the arrays for one point, n = (), or for an array of n points, n = (n,)."""
    N, dN = np.empty((3, 9) + n), np.empty((3, 9, 2) + n)  # noqa: RUF005 (numba unpacks no tuples)
    rows, force = np.empty((N_ROWS, MOST_UNKNOWNS) + n), np.empty((9, MOST_UNKNOWNS) + n)  # noqa: RUF005
    return Room(N[0], N[1], N[2], dN[0], dN[1], dN[2], rows, force)


@kernel(borrows=True)
def shapes(bases: Any, code: int, k: int, u: float, v: float, N: Any, dN: Any) -> None:
    """Write the shape functions (9,) of a face of type `code` with k nodes at (u, v), and their derivatives (9, 2)."""
    for a in range(k):
        C = bases[code, a]
        b0, b1, b2 = C[0] + u * (C[1] + u * C[3]), C[2] + u * (C[4] + u * C[6]), C[5] + u * (C[7] + u * C[8])
        N[a] = b0 + v * (b1 + v * b2)
        dN[a, 0] = C[1] + 2 * u * C[3] + v * (C[4] + 2 * u * C[6] + v * (C[7] + 2 * u * C[8]))
        dN[a, 1] = b1 + 2 * v * b2


@kernel(borrows=True)
def tangents_of(x: Any, nodes: Any, face: int, k: int, dN: Any) -> Any:
    """Return the tangents of a face with k nodes along its reference coordinates, two triples."""
    t0 = t1 = t2 = s0 = s1 = s2 = 0.0
    for a in range(k):
        i = nodes[face, a]
        t0 += dN[a, 0] * x[i, 0]
        t1 += dN[a, 0] * x[i, 1]
        t2 += dN[a, 0] * x[i, 2]
        s0 += dN[a, 1] * x[i, 0]
        s1 += dN[a, 1] * x[i, 1]
        s2 += dN[a, 1] * x[i, 2]
    return (t0, t1, t2), (s0, s1, s2)


@kernel
def cross(a: Any, b: Any) -> Any:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def dot(a: Any, b: Any) -> Any:
    """Return a.b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def dual_of(tau: Any, d: int) -> Any:
    """Return the dual vectors of two tangents (of the first alone if d is 2)."""
    t, s = tau
    if d == 2:
        size = dot(t, t)
        return (t[0] / size, t[1] / size, t[2] / size), (0.0, 0.0, 0.0)
    tt, ts, ss = dot(t, t), dot(t, s), dot(s, s)
    det = tt * ss - ts * ts
    return (
        ((ss * t[0] - ts * s[0]) / det, (ss * t[1] - ts * s[1]) / det, (ss * t[2] - ts * s[2]) / det),
        ((tt * s[0] - ts * t[0]) / det, (tt * s[1] - ts * t[1]) / det, (tt * s[2] - ts * t[2]) / det),
    )


@kernel
def _inverse(tau: Any, n: Any, d: int) -> Any:
    """Return the rows of the inverse of the matrix with columns tau, -n: those of the tangents, and that of -n."""
    t, s = tau
    if d == 2:
        det = t[1] * n[0] - t[0] * n[1]
        return (-n[1] / det, n[0] / det, 0.0), (0.0, 0.0, 0.0), (-t[1] / det, t[0] / det, 0.0)
    sn, nt, ts = cross(n, s), cross(t, n), cross(t, s)
    det = dot(t, sn)
    return (
        (sn[0] / det, sn[1] / det, sn[2] / det),
        (nt[0] / det, nt[1] / det, nt[2] / det),
        (ts[0] / det, ts[1] / det, ts[2] / det),
    )


@kernel(borrows=True)
def n_normals(skins: Any, k_s: int, k_m: int) -> int:
    """Return the number of normals that a point on a slave face with k_s nodes and a master face with k_m knows."""
    if len(skins.normals) == 0:
        return 0
    return k_m if skins.of_master else k_s


@kernel(borrows=True)
def differentiate(skins: Any, points: Any, p: Any, s: Any, m: Any, types: Any, d: int, room: Any) -> None:
    """Write the shape functions at point p of slave face s and master face m, and the rows of its derivatives.

    `types`: those of the two faces.
    """
    type_s, type_m = types
    sizes = (skins.n_nodes[type_s], skins.n_nodes[type_m])
    shapes(skins.bases, type_s, sizes[0], points.xi_s[p, 0], points.xi_s[p, 1], room.N_s, room.dN_s)
    shapes(skins.bases, type_m, sizes[1], points.xi_m[p, 0], points.xi_m[p, 1], room.N_m, room.dN_m)
    k_n = n_normals(skins, sizes[0], sizes[1])
    room.rows[:, : d * (sizes[0] + sizes[1] + k_n)] = 0.0
    if len(points.edges.nu) > 0:
        _move(skins.bases, points.edges, p, types, sizes, d, room)
        return
    n = (points.normal[p, 0], points.normal[p, 1], points.normal[p, 2])
    if points.current == 1 or k_n == 0:
        tau = tangents_of(skins.x, skins.nodes_s, s, sizes[0], room.dN_s)
        dual = dual_of(tau, d)
        if points.current == 1:
            _stretch(skins, points.radial, s, sizes[0], d, dual, room)
        if k_n == 0:
            _turn(sizes[0], d, dual, own_normal(tau, d), n, room)
    tau = tangents_of(skins.x, skins.nodes_m, m, sizes[1], room.dN_m)
    if skins.of_master:
        along = _turn_smoothly(skins, m, k_n, d * (sizes[0] + sizes[1]), room.N_m, room.dN_m, d, n, room)
        tau = _less(tau[0], points.ray[p], along[0]), _less(tau[1], points.ray[p], along[1])
        _slide(skins, points, p, tau, sizes, d, n, room)
        _turn_by_sliding(along, d * (sizes[0] + sizes[1] + k_n), d, room)
        return
    if k_n > 0:
        _turn_smoothly(skins, s, k_n, d * (sizes[0] + sizes[1]), room.N_s, room.dN_s, d, n, room)
    _slide(skins, points, p, tau, sizes, d, n, room)


@kernel
def _less(a: Any, r: Any, b: Any) -> Any:
    """Return a - r b."""
    return a[0] - r * b[0], a[1] - r * b[1], a[2] - r * b[2]


@kernel
def _is_there(x: Any) -> Any:
    """Return True for a number that is not 0, as it stands for any of an array."""
    return x != 0.0


_is_there.plain = np.any


@kernel(borrows=True)
def _move(bases: Any, edges: Any, p: Any, types: Any, sizes: Any, d: int, room: Any) -> None:
    """Write V as the row of dw / w: all that an edge changes is how much of the slave is integrated over."""
    (k_s, k_m), rows, N = sizes, room.rows, room.N
    if d == 2:
        for a in range(k_s):
            for j in range(d):
                rows[STRETCH, d * a + j] -= room.N_s[a] * edges.nu[p, j]
    s, m = edges.patch_s[p], edges.patch_m[p]
    for c in range(2 if d == 2 else 4):
        if _is_there(edges.turned[p, c, 0]) or _is_there(edges.turned[p, c, 1]) or _is_there(edges.turned[p, c, 2]):
            shapes(bases, types[0], k_s, edges.corners_s[s, c, 0], edges.corners_s[s, c, 1], N, room.dN)
            for a in range(k_s):
                for j in range(d):
                    rows[STRETCH, d * a + j] += N[a] * edges.turned[p, c, j]
        share = edges.share[p, c]
        if _is_there(share):
            shapes(bases, types[1], k_m, edges.corners_m[m, c, 0], edges.corners_m[m, c, 1], N, room.dN)
            for b in range(k_m):
                for j in range(d):
                    rows[STRETCH, d * (k_s + b) + j] += N[b] * share * edges.nu[p, j]


@kernel(borrows=True)
def _stretch(skins: Any, radial: int, s: Any, k_s: int, d: int, dual: Any, room: Any) -> None:
    """Write the row of dw / w."""
    N, dN, rows = room.N_s, room.dN_s, room.rows
    r = 0.0
    for a in range(k_s):
        for j in range(d):
            rows[STRETCH, d * a + j] = dual[0][j] * dN[a, 0] + dual[1][j] * dN[a, 1]
        r += N[a] * skins.x[skins.nodes_s[s, a], 0]
    if radial == 1:
        for a in range(k_s):
            rows[STRETCH, d * a] += N[a] / r


@kernel
def own_normal(tau: Any, d: int) -> Any:
    """Return the unit normal of a face with two tangents (with the first alone if d is 2)."""
    t, s = tau
    if d == 2:
        size = np.sqrt(t[0] * t[0] + t[1] * t[1])
        return t[1] / size, -t[0] / size, 0.0 * t[0]
    N = cross(t, s)
    size = np.sqrt(dot(N, N))
    return N[0] / size, N[1] / size, N[2] / size


@kernel(borrows=True)
def _turn(k_s: int, d: int, dual: Any, N: Any, n: Any, room: Any) -> None:
    """Write the rows of dn, the change of a normal that leans on the face's own, N."""
    share, dN = dot(N, n), room.dN_s
    leans = (N[0] - share * n[0], N[1] - share * n[1], N[2] - share * n[2])
    along = (dot(dual[0], n), dot(dual[1], n))
    for a in range(k_s):
        out = along[0] * dN[a, 0] + along[1] * dN[a, 1]
        for i in range(d):
            c = out * n[i] - dual[0][i] * dN[a, 0] - dual[1][i] * dN[a, 1]
            for j in range(d):
                room.rows[NORMAL + i, d * a + j] = c * n[j] + out * leans[i] * N[j]


@kernel(borrows=True)
def _turn_smoothly(skins: Any, face: Any, k: int, first: int, N: Any, dN: Any, d: int, n: Any, room: Any) -> Any:
    """Write the rows of dn, the change of k interpolated nodal normals; return dn/dxi, two triples.

    `N` (9,), `dN` (9, 2): the shape functions at the point of the `face`; `first`: the first unknown of the normals.
    """
    h0 = h1 = h2 = 0.0
    for a in range(k):
        i = skins.normal_of[face, a]
        h0 += N[a] * skins.normals[i, 0]
        h1 += N[a] * skins.normals[i, 1]
        h2 += N[a] * skins.normals[i, 2]
    size = np.sqrt(h0 * h0 + h1 * h1 + h2 * h2)
    for i in range(d):
        for j in range(d):
            P = ((1.0 if i == j else 0.0) - n[i] * n[j]) / size
            for a in range(k):
                room.rows[NORMAL + i, first + d * a + j] = P * N[a]
    u, v = tangents_of(skins.normals, skins.normal_of, face, k, dN)
    u, v = _less(u, dot(u, n), n), _less(v, dot(v, n), n)
    return (u[0] / size, u[1] / size, u[2] / size), (v[0] / size, v[1] / size, v[2] / size)


@kernel(borrows=True)
def _turn_by_sliding(along: Any, n: int, d: int, room: Any) -> None:
    """Add to the rows of dn what the slide on the master adds, where n changes by `along`, two triples; n columns."""
    rows = room.rows
    for k in range(d - 1):
        for i in range(d):
            turn = along[k][i]
            for j in range(n):
                rows[NORMAL + i, j] += turn * rows[SLIDE + k, j]


@kernel(borrows=True)
def _slide(skins: Any, points: Any, p: Any, tau: Any, sizes: Any, d: int, n: Any, room: Any) -> None:
    """Write the rows of dxi_bar and dg, from those of dn; `tau`: tangents of the master."""
    k_s, k_m = sizes
    rows = room.rows
    # dn acts on the slave's nodes, or on the normals
    k_n = n_normals(skins, k_s, k_m)
    low, high = (0, d * k_s) if k_n == 0 else (d * (k_s + k_m), d * (k_s + k_m + k_n))
    inverse = _inverse(tau, n, d)
    for k in range(d):
        of, at = (inverse[2], GAP) if k == d - 1 else (inverse[k], SLIDE + k)
        r = points.ray[p]
        for j in range(low, high):
            turned = of[0] * rows[NORMAL, j] + of[1] * rows[NORMAL + 1, j] + of[2] * rows[NORMAL + 2, j]
            rows[at, j] += r * turned
        for i in range(d):
            for a in range(k_s):
                rows[at, d * a + i] += room.N_s[a] * of[i]
            for b in range(k_m):
                rows[at, d * (k_s + b) + i] -= room.N_m[b] * of[i]
    if len(points.slope) > 0:
        for k in range(d - 1):
            for j in range(max(d * (k_s + k_m), high)):
                rows[GAP, j] -= points.slope[p, k] * rows[SLIDE + k, j]
