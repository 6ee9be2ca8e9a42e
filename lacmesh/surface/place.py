"""Quadrature on mortar segments (pieces) in space: the rule for each piece, and its points.

A piece is a convex polygon in the slave's mean plane. The integrands are the shape functions of both faces and the gap,
which are polynomials in the plane if both faces are affine: then a rule of their degree is exact. Rules of degree 1 and
2 need no triangles: the centroid, and three points on the ellipse of inertia (every polygon has one that is exact to
degree 2, and inside every convex polygon: Kannan, Lovasz, Simonovits, Discrete Comput. Geom. 13, 1995). Higher rules
are used on a fan of triangles, which has its apex at the centroid where no rule is exact, as along normals that turn.

On general quadrangles the functions are no polynomials in the plane, and a rule that integrates them to 1e-10 needs a
hundred points per triangle. Here a few points are used, with weights corrected (`fit`) such that every function of both
faces, and of the heights over them, has its exact integral over the piece: what a rule left would depend on how the
piece is divided into triangles, and this on the last bits of coordinates.

A point has coordinates in both faces, a weight, a normal and a gap.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.surface.clip import Pieces, mean_plane, project
from lacmesh.surface.fit import fit
from lacmesh.surface.maps import AFFINE, CURVED, FLAT, NEARLY_FLAT, NormalMaps, at, curved, foot, in_face, inverse, ray
from lacmesh.surface.moments import Gauss, SegmentFace, gauss_rules, in_plane
from lacmesh.surface.patches import Patches
from lacmesh.surface.polygon import ROOM, centroid
from lacmesh.threads import in_threads
from lacmesh.topology.skin import FACE_TYPES

Bools = NDArray[np.bool_]

CENTROID, ELLIPSE, FAN3, FAN6, FAN7, FAN12, FAN16, FAN30 = range(8)
#: added to the code of a rule whose weights are fitted, and of one on the fan around the centroid, which has no first
#: vertex: what it leaves of integrands that are no polynomials does not depend on how corners are numbered
FITTED, AROUND = 8, 16
#: degree that each rule is exact to
DEGREE = (1, 2, 2, 4, 5, 6, 8, 9)
#: degree of the shape functions of each type of face in its reference coordinates
FUNCTION_DEGREE = np.array(
    [{"POI1": 0, "SEG2": 1, "SEG3": 2, "TRIA3": 1, "TRIA6": 2, "TRIA7": 3, "QUAD4": 2, "QUAD8": 3}.get(t, 4)
     for t in FACE_TYPES]
)  # fmt: skip
#: how many functions of a type of face, beside the constant, a fit takes (moments.functions)
N_FUNCTIONS = np.array(
    [{"TRIA3": 2, "QUAD4": 3, "TRIA6": 5, "TRIA7": 7, "QUAD8": 7, "QUAD9": 8}.get(t, 1) for t in FACE_TYPES]
)
#: share of a fan that one triangle has almost alone, and that it may have where all are to count
_ALONE, _AMONG_OTHERS = 0.95, 0.8


class Placed(NamedTuple):
    """Points, one per row: piece, coordinates (n, 2) in both faces, weight, unit normal, gap; `met`: ray hits master.

    `first` (pieces + 1,): the first point of each piece, in the order in which they were placed.
    """

    first: Ints
    piece: Ints
    xi_slave: Floats
    xi_master: Floats
    weight: Floats
    normal: Floats
    gap: Floats
    met: Bools


class Fans(NamedTuple):
    """Rules on the triangles of a fan, one after the other: that of code k is in rows start[k] to start[k + 1].

    `X` (., 2) in the reference triangle; `w` (.,), of sum 1 for each rule.
    """

    X: Floats
    w: Floats
    start: Ints


@cache
def fan_rules() -> Fans:
    """Return all fan rules; those of CENTROID and ELLIPSE, which need no triangles, are empty."""
    table = [rule("TRIA", d) if k >= FAN3 else (np.empty((0, 2)), np.empty(0)) for k, d in enumerate(DEGREE)]
    start = np.cumsum([0, *(len(w) for _, w in table)])
    return Fans(np.concatenate([X for X, _ in table]), 2 * np.concatenate([w for _, w in table]), start)


class Sides(NamedTuple):
    """Properties of one side that determine the rules of pieces: type, and kind and warp of the faces (maps.kinds).

    `whole`: the patch is not half of a quadrangle with a re-entrant corner; `functions`: how many a fit takes.
    """

    type: Ints
    kind: Ints
    warp: Floats
    whole: Bools
    functions: Ints


def pair_rule(slave: Sides, master: Sides, vertices: Ints, share: Floats, turned: Floats, least: int = 0) -> Ints:
    """Choose the rules of pieces with the given numbers of vertices; return their codes.

    `share`: of the largest triangle in each piece's fan (if it is all of it, the points of the others do not count);
    `turned`: deviation of the normals from the slave face's own; `least`: degree that is exact in any case.
    """
    degree = np.maximum(np.maximum(FUNCTION_DEGREE[slave.type], FUNCTION_DEGREE[master.type]), least)
    code = np.where(degree <= 1, CENTROID, np.where(degree <= 2, ELLIPSE, FAN6))
    curved = (slave.kind == CURVED) | (master.kind == CURVED)
    bend = np.maximum(np.maximum(slave.warp, turned), np.where(master.kind == CURVED, master.warp, 0.0))
    bent = bend > np.where(curved, NEARLY_FLAT, FLAT)
    code = np.where(bent, np.where(degree <= 2, FAN6, FAN12), code)
    affine = (slave.kind == AFFINE) & (master.kind == AFFINE)
    fit = slave.whole & master.whole & ~affine
    fitted = _fitted(1 + slave.functions + master.functions, vertices, share)
    around = np.where(fit & ~curved, FITTED + AROUND, np.where(vertices > 3, AROUND, 0))
    return np.where(affine & ~bent, code, np.where(fit & ~bent, fitted, code + around))


def _fitted(functions: Ints, vertices: Ints, share: Floats) -> Ints:
    """Codes of fitted rules with at least as many points as functions, on the triangles that count."""
    single = share > _ALONE
    few = np.where((vertices > 4) & (share < _AMONG_OTHERS), FAN3, np.where(single, FAN7, FAN6))
    some = np.where(single, FAN12, FAN6)
    many = np.where(single, FAN30, FAN16)
    return np.where(functions <= 7, few, np.where(functions <= 11, some, many)) + FITTED


def points_of(code: Ints, vertices: Ints) -> Ints:
    """Number of points of rules, by their codes, on pieces with the given numbers of vertices."""
    each = np.diff(fan_rules().start)
    each[CENTROID], each[ELLIPSE] = 1, 3
    base = code % FITTED
    triangles = np.where(code >= AROUND, vertices, vertices - 2)
    return np.where(base <= ELLIPSE, each[base], each[base] * triangles)


_MOST_FUNCTIONS = 20
#: what must be left of a function that a fit takes, against the bend (`fit`)
_COUNTS = 0.1


def place(
    pieces: Pieces, order: Ints, code: Ints, slave: Patches, master: Patches, functions: Ints, bend: Floats,
    H: NormalMaps,
) -> Placed:  # fmt: skip
    """Place quadrature points on pieces, in the given `order`, by rules `code`.

    `functions` (pieces, 2): numbers of fitted functions of the slave face and of the master's. `bend` (pieces,): warp
    of the slave face, or variation of its normals. `H`: `normals.normal_maps`.
    """
    count = points_of(code, np.diff(pieces.start))[order]
    first = np.concatenate([[0], np.cumsum(count)])
    n = int(first[-1])
    empty = (np.empty((n, 2)), np.empty((n, 2)), np.empty(n), np.empty((n, 3)), np.empty(n), np.empty(n, np.bool_))
    out = Placed(first, np.repeat(order, count), *empty)
    tables = fan_rules(), gauss_rules() if (code % AROUND >= FITTED).any() else Gauss(np.empty(0), np.empty(0))

    def run(rows: slice) -> None:
        _place_all(rows.start, rows.stop, pieces, order, code, slave, master, functions, bend, H, *tables, out)

    in_threads(run, len(order))
    return out


@kernel
def plane_rule(p: Any, n: int, code: int, fans: Any, out: Any, weight: Any) -> Any:
    """Write points (., 2) and weights of a rule on a convex polygon of n vertices; return their number."""
    base = code % FITTED
    if base <= ELLIPSE:
        return _ellipse_rule(p, n, base, out, weight)
    around = code >= AROUND
    x, y = centroid(p, n) if around else (p[0, 0], p[0, 1])
    m = 0
    for k in range(0 if around else 1, n if around else n - 1):
        after = k + 1 if k + 1 < n else 0
        ax, ay = p[k, 0] - x, p[k, 1] - y
        bx, by = p[after, 0] - x, p[after, 1] - y
        t = (ax * by - ay * bx) / 2
        for j in range(fans.start[base], fans.start[base + 1]):
            out[m, 0] = x + fans.X[j, 0] * ax + fans.X[j, 1] * bx
            out[m, 1] = y + fans.X[j, 0] * ay + fans.X[j, 1] * by
            weight[m] = t * fans.w[j]
            m += 1
    return m


@kernel
def _ellipse_rule(p: Any, n: int, code: int, out: Any, weight: Any) -> Any:
    """Write the centroid, or three points on the ellipse of inertia (twice the second moments over the area)."""
    x, y = centroid(p, n)
    area = xx = xy = yy = 0.0
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


@kernel(borrows=True)
def end_of_ray(
    H: Any, face: int, other: int, x: Any, du: Any, dv: Any, u: float, v: float, G: Any, kind: int, um: float, vm: float
) -> Any:
    """End of the ray from the point (u, v) of a slave face: (met, um, vm, length, unit normal, Jacobian).

    The point is at x, with tangents du, dv. `G`, `kind`: map of the master's face `other`; (um, vm): a first guess
    there; H: `normals.normal_maps`.
    """
    unit, jacobian = normal_at(H, face, du, dv, u, v)
    if H.of_master:
        met, um, vm, length, unit = foot(G, kind, H.G[other], x, um, vm)
    else:
        met, um, vm, length = ray(G, kind, x, unit, um, vm)
    return met, um, vm, length, unit, jacobian


@kernel(borrows=True)
def normal_at(H: Any, face: int, du: Any, dv: Any, u: float, v: float) -> Any:
    """Unit normal of a face with tangents du, dv at (u, v), and the Jacobian; H: `normals.normal_maps`.

    It is the face's own where normals are the master's.
    """
    n0 = du[1] * dv[2] - du[2] * dv[1]
    n1 = du[2] * dv[0] - du[0] * dv[2]
    n2 = du[0] * dv[1] - du[1] * dv[0]
    jacobian = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    size = jacobian
    if H.of_master:
        return (n0 / size, n1 / size, n2 / size), jacobian
    if len(H.G) and H.G.shape[2] == 3:
        (n0, n1, n2), _, _ = at(H.G[face], CURVED, u, v)
    elif len(H.G):
        bu, bv = curved(H.G[face], 0, u, v)[0], curved(H.G[face], 1, u, v)[0]
        t0, t1, t2 = bu * dv[0] - bv * du[0], bu * dv[1] - bv * du[1], bu * dv[2] - bv * du[2]
        m0, m1, m2 = n0 / jacobian, n1 / jacobian, n2 / jacobian
        n0, n1, n2 = n0 - (t1 * m2 - t2 * m1), n1 - (t2 * m0 - t0 * m2), n2 - (t0 * m1 - t1 * m0)
    if len(H.G):
        size = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    return (n0 / size, n1 / size, n2 / size), jacobian


@kernel(borrows=True)
def _has_own_normals(H: Any, face: int) -> Any:
    """True if the normals of a face are its own; H: `normals.normal_maps`."""
    own = len(H.G) == 0 or H.G.shape[2] == 2
    for k in range(H.G.shape[1] if own and len(H.G) else 0):
        own = own and H.G[face, k, 0] == 0.0 and H.G[face, k, 1] == 0.0
    return own


@kernel(borrows=True)
def _is_straight(patch: Any) -> Any:
    """True if a side's patch coincides with its face, seen along the normal: straight sides, not half a quadrangle."""
    return patch.kind == AFFINE or (patch.kind < CURVED and patch.n == 4)


@kernel(borrows=True)
def _in_plane(
    u: float, v: float, um: float, vm: float, area: float, slave: Any, master: Any, e: Any, fitted: bool
) -> Any:
    """Project the point (u, v) of the slave onto the master along the plane's normal: (um, vm, weight in the plane).

    The true faces are used, unlike in `in_face`, which straightens their sides. (um, vm): a first guess, which is kept
    unless `fitted`.
    """
    x, du, dv = at(slave.G, slave.kind, u, v)
    if fitted:
        _, um, vm, _ = ray(master.G, master.kind, x, (e[2, 0], e[2, 1], e[2, 2]), um, vm)
    return um, vm, area * _across(du, dv, e)


@kernel
def _across(du: Any, dv: Any, e: Any) -> Any:
    """Area spanned by du and dv, seen along the normal of a frame."""
    au, bu = in_plane(du, e)
    av, bv = in_plane(dv, e)
    return abs(au * bv - av * bu)


@kernel(borrows=True)
def _raised(
    u: float, v: float, um: float, vm: float, weight: float, slave: Any, master: Any, e: Any, H: Any, f: int, other: int
) -> Any:
    """Turn a point's values in the plane into those on the true slave face: (um, vm, weight, normal, gap, met).

    The master point (um, vm) and the gap are found along the normal; `f`, `other`: rows of the two faces.
    """
    x, du, dv = at(slave.G, slave.kind, u, v)
    hit, um, vm, gap, unit, jacobian = end_of_ray(H, f, other, x, du, dv, u, v, master.G, master.kind, um, vm)
    return um, vm, weight * jacobian / _across(du, dv, e), unit, gap, hit


@kernel
def _side(patch: int, of: Any, y: Any, k: int) -> Any:
    """Make the `SegmentFace` of a piece on a patch with corners y in the slave's plane, with k fitted functions."""
    face, n, xi = of.face[patch], of.n[patch], of.xi[patch]
    return SegmentFace(of.G[face], of.kind[face], n, xi, y, inverse(y, n, xi), k)


@kernel(costly=10)  # compiles as long as 4 million numbers take as they stand
def _place_all(
    begin: int, end: int, pieces: Any, order: Any, code: Any, slaves: Any, masters: Any, functions: Any, bend: Any,
    H: Any, fans: Any, gauss: Any, out: Any,
) -> None:  # fmt: skip
    """Fill `out` for the pieces order[begin:end]."""
    most = 1  # points of a piece
    for row in range(begin, end):
        most = max(most, out.first[row + 1] - out.first[row])
    p, area, y_m = np.empty((most, 2)), np.empty(most), np.empty((4, 3))
    room = (
        np.empty((ROOM, 4)),
        np.empty(_MOST_FUNCTIONS),
        np.empty(_MOST_FUNCTIONS),
        np.empty((_MOST_FUNCTIONS, most)),
    )
    for row in range(begin, end):
        k = order[row]
        s, m = pieces.slave[k], pieces.master[k]
        polygon = pieces.vertices[pieces.start[k] : pieces.start[k + 1]]
        n = plane_rule(polygon, len(polygon), code[k], fans, p, area)
        project(masters.x[m], masters.n[m], slaves.centre[s], slaves.e[s], False, y_m)
        slave, master = _side(s, slaves, slaves.y[s], functions[k, 0]), _side(m, masters, y_m, functions[k, 1])
        fitted = code[k] % AROUND >= FITTED
        straight = _is_straight(slave) and _is_straight(master)
        _in_faces(out, out.first[row], n, p, area, slave, master, slaves.e[s], straight, fitted)
        if fitted:
            rows = slice(out.first[row], out.first[row] + n)
            edges = pieces.edges[pieces.start[k] : pieces.start[k + 1]]
            fit(
                polygon, edges, slave, master, slaves.centre[s], slaves.e[s], gauss, out.xi_slave[rows],
                out.xi_master[rows], out.weight[rows], _COUNTS * bend[k], room,
            )  # fmt: skip
        fs, fm = slaves.face[s], masters.face[m]
        flat = straight and _has_own_normals(H, fs) and slaves.warp[fs] == 0 and masters.warp[fm] == 0
        plane = mean_plane(y_m, masters.n[m])
        _on_faces(out, out.first[row], n, p, slave, master, slaves.e[s], H, fs, fm, flat, plane)


@kernel(borrows=True)
def _in_faces(
    out: Any, first: int, n: int, p: Any, area: Any, slave: Any, master: Any, e: Any, straight: bool, fitted: bool
) -> None:
    """Write the coordinates in both faces, and the weights in the plane, of the n points p of a piece."""
    # arrays by themselves: what is taken out of a tuple for each point costs more than the point
    xi_slave, xi_master, weight = out.xi_slave, out.xi_master, out.weight
    patch_s, patch_m = slave.patch, master.patch
    for j in range(n):
        i = first + j
        u, v, ratio = in_face(patch_s, p[j, 0], p[j, 1])
        um, vm, _ = in_face(patch_m, p[j, 0], p[j, 1])
        w = area[j]
        if not straight:
            um, vm, w = _in_plane(u, v, um, vm, w * abs(ratio), slave, master, e, fitted)
        xi_slave[i, 0], xi_slave[i, 1], xi_master[i, 0], xi_master[i, 1], weight[i] = u, v, um, vm, w


@kernel(borrows=True)
def _on_faces(
    out: Any, first: int, n: int, p: Any, slave: Any, master: Any, e: Any, H: Any, fs: int, fm: int, flat: bool,
    plane: Any,
) -> None:  # fmt: skip
    """Write the weights on the true slave face, the normals and the gaps of the n points p of a piece."""
    xi_slave, xi_master, weight, normal, gap, met = (
        out.xi_slave, out.xi_master, out.weight, out.normal, out.gap, out.met,
    )  # fmt: skip
    unit = (e[2, 0], e[2, 1], e[2, 2])
    _, c0, c1, c2 = plane
    for j in range(n):
        i = first + j
        if flat:
            g, hit = c0 + c1 * p[j, 0] + c2 * p[j, 1], True
        else:
            um, vm, w, unit, g, hit = _raised(
                xi_slave[i, 0], xi_slave[i, 1], xi_master[i, 0], xi_master[i, 1], weight[i], slave, master, e, H,
                fs, fm,
            )  # fmt: skip
            xi_master[i, 0], xi_master[i, 1], weight[i] = um, vm, w
        gap[i], met[i] = g, hit and abs(weight[i]) < np.inf and abs(g) < np.inf  # a folded face has no fit
        normal[i, 0], normal[i, 1], normal[i, 2] = unit
