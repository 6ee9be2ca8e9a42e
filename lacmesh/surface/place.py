"""Quadrature points on the pieces of a surface in space: where they are in both faces, their weights and gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from lacmesh.mesh import Floats, Ints
from lacmesh.surface.clip import Pieces, centroid
from lacmesh.surface.fit import correct, functions, integrals, vertices_in_faces
from lacmesh.surface.maps import CURVED, at
from lacmesh.surface.patches import Patches
from lacmesh.surface.project import in_face, ray
from lacmesh.surface.rules import (
    CENTROID,
    EDGE_POINTS,
    ELLIPSE,
    FAN3,
    FAN30,
    FITTED,
    N_FUNCTIONS,
    RADIAL_POINTS,
    edge_step,
    points_of,
    triangle_rule,
)


class Placed(NamedTuple):
    """Points, a row each: piece, places (n, 2) in both faces, weight, unit normal, gap; `met`: the ray hit the master."""

    piece: Ints
    xi_slave: Floats
    xi_master: Floats
    weight: Floats
    normal: Floats
    gap: Floats
    met: Ints


def place(
    pieces: Pieces,
    code: Ints,
    slave: Patches,
    master: Patches,
    type_slave: Ints,
    type_master: Ints,
    normals: Floats | None,
) -> Placed:
    """Points of pieces (in the order given) by rules `code`; `normals` (f, 9, 3): maps of smoothed normals, or None.

    `type_slave`, `type_master` (pieces,): types of the faces (codes).
    """
    count = points_of(code, np.diff(pieces.start))
    first = np.concatenate([[0], np.cumsum(count)])
    table = [triangle_rule(k) for k in range(FAN3, FAN30 + 1)]
    size = np.cumsum([0] * FAN3 + [0, *(len(w) for _, w in table)])
    X, w = np.concatenate([X for X, _ in table]), np.concatenate([w for _, w in table])
    H = np.empty((0, 9, 3)) if normals is None else normals
    twist = distortion(pieces, slave, master) * (code >= FITTED)
    line = [np.polynomial.legendre.leggauss(int(n)) for n in (*EDGE_POINTS, *RADIAL_POINTS)]
    T = (np.concatenate([X for X, _ in line]) + 1) / 2
    wt = np.concatenate([w for _, w in line]) / 2
    at_T = np.cumsum([0, *EDGE_POINTS, *RADIAL_POINTS])
    made = _place_all(
        pieces.slave, pieces.master, pieces.start, pieces.vertices, pieces.edges, code, first, int(count.max(initial=0)), size, X, w,
        slave.face, slave.n, slave.xi, slave.y, slave.G, slave.kind, H,
        master.face, master.n, master.xi, master.x, master.G, master.kind, slave.centre, slave.e,
        edge_step(twist), N_FUNCTIONS[type_slave], N_FUNCTIONS[type_master], T, wt, at_T,
    )  # fmt: skip
    return Placed(np.repeat(np.arange(len(code)), count), *made)


def distortion(pieces: Pieces, slave: Patches, master: Patches) -> Floats:
    """(k,): how far the Jacobian of either patch of a piece varies, against its mean; 1 for faces with curved sides.

    The master's as it is projected into the slave's plane.
    """
    out = np.ones(len(pieces.slave))
    straight = (slave.kind[slave.face[pieces.slave]] < CURVED) & (master.kind[master.face[pieces.master]] < CURVED)
    s, m = pieces.slave[straight], pieces.master[straight]
    y = np.matmul(master.x[m], np.swapaxes(slave.e[s], 1, 2)[:, :, :2])
    out[straight] = np.maximum(_twist(slave.y[..., :2], slave.n)[s], _twist(y, master.n[m]))
    return out


def _twist(y: Floats, n: Ints) -> Floats:
    a, b = y[:, 1] + y[:, 2] - y[:, 0] - y[:, 3], y[:, 2] + y[:, 3] - y[:, 0] - y[:, 1]
    d = y[:, 0] + y[:, 2] - y[:, 1] - y[:, 3]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(n == 4, (abs(_det(a, d)) + abs(_det(d, b))) / abs(_det(a, b)), 0.0)


def _det(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


@njit(cache=True, error_model="numpy")
def plane_rule(p, n, code, size, X, w, out, weight):
    """Points (., 2) and weights of a rule on a convex polygon p of n vertices, into `out` and `weight`; their number."""
    if code == CENTROID or code == ELLIPSE:
        x, y = centroid(p, n)
        area = 0.0
        xx = 0.0
        xy = 0.0
        yy = 0.0
        for k in range(1, n - 1):
            ax, ay = p[0, 0] - x, p[0, 1] - y
            bx, by = p[k, 0] - x, p[k, 1] - y
            cx, cy = p[k + 1, 0] - x, p[k + 1, 1] - y
            t = ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2
            sx, sy = ax + bx + cx, ay + by + cy
            area += t
            xx += t * (ax * ax + bx * bx + cx * cx + sx * sx) / 12
            xy += t * (ax * ay + bx * by + cx * cy + sx * sy) / 12
            yy += t * (ay * ay + by * by + cy * cy + sy * sy) / 12
        if code == CENTROID:
            out[0, 0], out[0, 1], weight[0] = x, y, area
            return 1
        a = np.sqrt(max(2 * xx / area, 0.0))
        b = 2 * xy / area / a if a > 0 else 0.0
        c = np.sqrt(max(2 * yy / area - b * b, 0.0))
        half = np.sqrt(3.0) / 2
        for k in range(3):
            cosine = 1.0 if k == 0 else -0.5
            sine = 0.0 if k == 0 else (half if k == 1 else -half)
            out[k, 0] = x + a * cosine
            out[k, 1] = y + b * cosine + c * sine
            weight[k] = area / 3
        return 3
    m = 0
    for k in range(1, n - 1):
        ax, ay = p[k, 0] - p[0, 0], p[k, 1] - p[0, 1]
        bx, by = p[k + 1, 0] - p[0, 0], p[k + 1, 1] - p[0, 1]
        t = (ax * by - ay * bx) / 2
        for j in range(size[code], size[code + 1]):
            out[m, 0] = p[0, 0] + X[j, 0] * ax + X[j, 1] * bx
            out[m, 1] = p[0, 1] + X[j, 0] * ay + X[j, 1] * by
            weight[m] = t * w[j]
            m += 1
    return m


@njit(cache=True, error_model="numpy")
def normal_at(H, face, du, dv, u, v):
    """Unit normal of a face at (u, v): the true one, or the smoothed one where there are maps H; and the Jacobian."""
    n0 = du[1] * dv[2] - du[2] * dv[1]
    n1 = du[2] * dv[0] - du[0] * dv[2]
    n2 = du[0] * dv[1] - du[1] * dv[0]
    jacobian = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    size = jacobian
    if len(H):
        (n0, n1, n2), _, _ = at(H[face], 2, u, v)
        size = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    return (n0 / size, n1 / size, n2 / size), jacobian


@njit(cache=True, error_model="numpy")
def _project(x, n, centre, e, out):
    for k in range(n):
        for a in range(2):
            out[k, a] = (
                (x[k, 0] - centre[0]) * e[a, 0] + (x[k, 1] - centre[1]) * e[a, 1] + (x[k, 2] - centre[2]) * e[a, 2]
            )


@njit(cache=True, error_model="numpy")
def _locate(corner, n, local):
    """Origin and scale of the arguments of functions on a piece, in the slave face and in the master's."""
    for side in range(2):
        u, v, size = 0.0, 0.0, 0.0
        for k in range(n):
            u += corner[k, 2 * side] / n
            v += corner[k, 2 * side + 1] / n
        for k in range(n):
            size = max(size, abs(corner[k, 2 * side] - u), abs(corner[k, 2 * side + 1] - v))
        local[3 * side], local[3 * side + 1], local[3 * side + 2] = u, v, size


@njit(cache=True, error_model="numpy")
def _place_all(
    slave, master, start, vertices, edges, code, first, most, size, X, w,
    face_s, n_s, xi_s, y_s, G_s, kind_s, H,
    face_m, n_m, xi_m, x_m, G_m, kind_m, centre, e,
    step, k_s, k_m, T, wt, at_T,
):  # fmt: skip
    total = first[-1]
    out_s = np.empty((total, 2))
    out_m = np.empty((total, 2))
    weight = np.empty(total)
    normal = np.empty((total, 3))
    gap = np.empty(total)
    met = np.empty(total, np.bool_)
    p = np.empty((most, 2))
    area = np.empty(most)
    y_m = np.empty((4, 2))
    corner = np.empty((48, 4))
    local = np.empty(6)
    phi = np.empty((20, max(most, 1)))
    target = np.empty(20)
    work = np.empty(20)
    for k in range(len(slave)):
        s, m = slave[k], master[k]
        polygon = vertices[start[k] : start[k + 1]]
        n = plane_rule(polygon, len(polygon), code[k] % FITTED, size, X, w, p, area)
        _project(x_m[m], n_m[m], centre[s], e[s], y_m)
        fs, fm = face_s[s], face_m[m]
        for j in range(n):
            row = first[k] + j
            u, v, ratio = in_face(y_s[s], n_s[s], xi_s[s], p[j, 0], p[j, 1])
            x, du, dv = at(G_s[fs], kind_s[fs], u, v)
            unit, jacobian = normal_at(H, fs, du, dv, u, v)
            um, vm, _ = in_face(y_m, n_m[m], xi_m[m], p[j, 0], p[j, 1])
            hit, um, vm, g = ray(G_m[fm], kind_m[fm], x, unit, um, vm)
            out_s[row, 0], out_s[row, 1] = u, v
            out_m[row, 0], out_m[row, 1] = um, vm
            weight[row] = area[j] * abs(ratio) * jacobian
            normal[row, 0], normal[row, 1], normal[row, 2] = unit
            gap[row] = g
            met[row] = hit and weight[row] < np.inf
        if code[k] >= FITTED:
            vertices_in_faces(
                polygon, edges[start[k] : start[k + 1]], y_s[s], n_s[s], xi_s[s], y_m, n_m[m], xi_m[m],
                G_s[fs], kind_s[fs], G_m[fm], kind_m[fm], centre[s], e[s], corner,
            )  # fmt: skip
            c = len(polygon)
            _locate(corner, c, local)
            curved = kind_s[fs] == CURVED or kind_m[fm] == CURVED or k_s[k] > 3 or k_m[k] > 3
            i = min(step[k] + 2 * (k_s[k] > 3 or k_m[k] > 3), len(at_T) - 4)
            r = len(at_T) - (2 if curved else 3)
            integrals(
                corner, edges[start[k] : start[k + 1]], c, G_s[fs], kind_s[fs], k_s[k], G_m[fm], kind_m[fm], k_m[k], e[s],
                local, T[at_T[i] : at_T[i + 1]], wt[at_T[i] : at_T[i + 1]], T[at_T[r] : at_T[r + 1]],
                wt[at_T[r] : at_T[r + 1]], target, work,
            )  # fmt: skip
            for j in range(n):
                row = first[k] + j
                work[0] = 1.0
                functions((out_s[row, 0] - local[0]) / local[2], (out_s[row, 1] - local[1]) / local[2], k_s[k], work, 1)
                functions(
                    (out_m[row, 0] - local[3]) / local[5],
                    (out_m[row, 1] - local[4]) / local[5],
                    k_m[k],
                    work,
                    1 + k_s[k],
                )
                for i in range(1 + k_s[k] + k_m[k]):
                    phi[i, j] = work[i]
            correct(weight, first[k], n, phi, 1 + k_s[k] + k_m[k], target)
    return out_s, out_m, weight, normal, gap, met
