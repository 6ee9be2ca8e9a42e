"""The maps of faces as polynomials, so that one compiled function serves every type of face, and heights over faces.

x(u, v) = sum_k G_k m_k(u, v) over the nine monomials m = 1, u, v, u^2, uv, v^2, u^2 v, u v^2, u^2 v^2, which span the
shape functions of every face (SEG: v = 0). G (f, 9, 3) follows from the nodes and is exact up to rounding. A face's map
is AFFINE (triangles with straight sides, parallelograms), BILINEAR (quadrangles with straight sides) or CURVED.

A linear face of a curved skin is flat, and misses the skin by up to h^2 / 8R. The height of the smooth surface, along
the face's outward normal, is a field b(xi) = sum_i N_i(xi) b_i with N_i the functions of SEG3, TRIA6 and QUAD9, and of
a segment and a triangle cubics that are 0 at the nodes of these. It is 0 at the corners, which lie on the skin, except
at those that a cut has put inside a face of the original mesh. The heights b_i are computed by `lacmesh.smooth`. Faces
of quadratic types are curved themselves and have no height, unless they are straight.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats, Ints, codes
from lacmesh.reference.shapes import shape
from lacmesh.topology.skin import FACE_TYPES, N_NODES, TYPE_CODE

if TYPE_CHECKING:
    from lacmesh.surface.record import Surface

AFFINE, BILINEAR, CURVED = range(3)
#: what is left of a coefficient that rounding alone made: of the face's size, and of its coordinates
_ROUNDING = (1e-13, 1e-15)
#: a face with straight sides that is out of its plane by no more of its size has the rule of a plane one; beyond, the
#: rule of a warped one gives the same to rounding, so that forces do not jump where bodies bend
FLAT = 1e-10
#: the same of a face with curved sides, whose rules differ: on the way to an equilibrium on flat skins faces are bent
#: by what iterations leave
NEARLY_FLAT = 1e-5
N_MONOMIALS = 9
#: the first monomial of third degree
_CUBIC = 6
#: powers of u and of v in the monomials, and in u^3 and v^3, which heights have too
_POWERS = np.array([[0, 1, 0, 2, 1, 0, 2, 1, 2, 3, 0], [0, 0, 1, 0, 1, 2, 1, 2, 2, 0, 3]])


class NormalMaps(NamedTuple):
    """Maps that the normals of contact follow from, beside the slave's faces themselves.

    G (f, 9, 3): of normals, by slave face or, `of_master`, by master face, where a ray ends; (f, 9, 2): of the slopes
    of the slave's smooth surface to its faces; (0, 9, 3): none, as normals are the slave faces' own.
    """

    G: Floats
    of_master: bool = False

    @classmethod
    def none(cls) -> NormalMaps:
        """Return those of the slave faces' own normals."""
        return cls(np.empty((0, N_MONOMIALS, 3)))

    @property
    def are_normals(self) -> bool:
        """True for maps of normals."""
        return len(self.G) > 0 and self.G.shape[2] == 3


def monomials(X: Floats, n: int = N_MONOMIALS, along: int | None = None) -> Floats:
    """(..., n): the first n monomials at reference points X (..., 2), or their derivatives along an axis.

    >>> monomials(np.array([2.0, 3.0])).astype(int).tolist()
    [1, 2, 3, 4, 6, 9, 12, 18, 36]
    """
    powers = [np.stack([1 + 0 * x, x, x * x, x * x * x], axis=-1) for x in (X[..., 0], X[..., 1])]
    if along is not None:
        x = X[..., along]
        powers[along] = np.stack([0 * x, 1 + 0 * x, 2 * x, 3 * x * x], axis=-1)
    return powers[0][..., _POWERS[0, :n]] * powers[1][..., _POWERS[1, :n]]


@cache
def basis(code: int) -> NDArray[np.floating]:
    """(9, n_nodes): coefficients of a face type's shape functions in the monomials, exact multiples of 1/8."""
    line = np.array([-1.0, 0.0, 1.0])
    name = FACE_TYPES[code]
    if name.startswith("SEG"):
        X, used = np.stack([line, 0 * line], axis=1), [0, 1, 3]
        N = shape(name, X[:, :1])
    else:
        X, used = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2), list(range(N_MONOMIALS))
        N = shape(name, X)
    out = np.zeros((N_MONOMIALS, N_NODES[code]))
    out[used] = np.round(np.linalg.solve(monomials(X)[:, used], N) * 8) / 8
    return out


def coefficients(surface: Surface) -> Floats:
    """G (f, 9, 3): coefficients of the map of each face."""
    return interpolated(surface.faces.type, surface.x[surface.faces.nodes])


def interpolated(types: Ints, values: Floats) -> Floats:
    """(f, 9, k): coefficients of fields with `values` (f, 9, k) at the nodes of faces of some `types` (f,), codes."""
    G = np.empty((len(types), N_MONOMIALS, values.shape[2]))
    for code in codes(types):
        rows, C = np.flatnonzero(types == code), basis(code)
        G[rows] = C @ values[rows, : C.shape[1]]
    return G


def kinds(G: Floats, corners: Ints) -> tuple[Ints, Floats, Floats]:
    """Kind, warp and curvature (f,) of maps G of faces with the given numbers of corners.

    Warp is the deviation from a plane, curvature the part of the map that is neither affine nor bilinear. Both are
    relative to the size of the face, and 0 if they are mere rounding.
    """
    size = np.linalg.norm(G[:, 1], axis=1) + np.linalg.norm(G[:, 2], axis=1)
    part = np.linalg.norm(G, axis=2)
    least = _ROUNDING[0] * size + _ROUNDING[1] * np.abs(G).max(axis=(1, 2))
    bent = part[:, 3:].copy()
    bent[:, 1] = np.where(corners == 4, 0.0, bent[:, 1])
    curved = bent.max(axis=1) > least
    kind = np.where(curved, CURVED, np.where((corners == 4) & (part[:, 4] > least), BILINEAR, AFFINE))
    across = np.stack([-G[:, 1, 1], G[:, 1, 0], 0 * G[:, 1, 0]], axis=1)
    normal = np.where((corners == 2)[:, None], across, np.cross(G[:, 1], G[:, 2]))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    out_of_plane = np.abs(np.einsum("fks,fs->fk", G[:, 3:], normal)).max(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        warp = np.where(out_of_plane <= least, 0.0, out_of_plane / size)
        return kind, warp, np.where(curved, bent.sum(axis=1) / size, 0.0)


@kernel(borrows=True)
def at(G: Any, kind: int, u: float, v: float) -> Any:
    """x(u, v) of one face with map G (9, 3), and its derivatives along u and v: three triples."""
    if kind == AFFINE:
        return (
            (
                G[0, 0] + u * G[1, 0] + v * G[2, 0],
                G[0, 1] + u * G[1, 1] + v * G[2, 1],
                G[0, 2] + u * G[1, 2] + v * G[2, 2],
            ),
            (G[1, 0], G[1, 1], G[1, 2]),
            (G[2, 0], G[2, 1], G[2, 2]),
        )
    if kind == BILINEAR:
        a = (G[1, 0] + v * G[4, 0], G[1, 1] + v * G[4, 1], G[1, 2] + v * G[4, 2])
        x = (
            G[0, 0] + u * a[0] + v * G[2, 0],
            G[0, 1] + u * a[1] + v * G[2, 1],
            G[0, 2] + u * a[2] + v * G[2, 2],
        )
        return x, a, (G[2, 0] + u * G[4, 0], G[2, 1] + u * G[4, 1], G[2, 2] + u * G[4, 2])
    x0, a0, b0 = curved(G, 0, u, v)
    x1, a1, b1 = curved(G, 1, u, v)
    x2, a2, b2 = curved(G, 2, u, v)
    return (x0, x1, x2), (a0, a1, a2), (b0, b1, b2)


@kernel(borrows=True)
def curved(G: Any, s: int, u: float, v: float) -> Any:
    """Coordinate s of x and its derivatives, from all nine monomials."""
    c0 = G[0, s] + v * (G[2, s] + v * G[5, s])
    c1 = G[1, s] + v * (G[4, s] + v * G[7, s])
    c2 = G[3, s] + v * (G[6, s] + v * G[8, s])
    d0 = G[2, s] + 2 * v * G[5, s]
    d1 = G[4, s] + 2 * v * G[7, s]
    d2 = G[6, s] + 2 * v * G[8, s]
    return c0 + u * (c1 + u * c2), c1 + 2 * u * c2, d0 + u * (d1 + u * d2)


#: steps of Newton's method
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
        u, v = _stepped(kind, u, v, su, sv, longest)
        if longest < 1e-9 or (kind == AFFINE and step == 1):
            met = True
            break
    y, du, dv = at(G, kind, u, v)
    return met, u, v, (y[0] - x[0]) * n[0] + (y[1] - x[1]) * n[1] + (y[2] - x[2]) * n[2]


@kernel
def _stepped(kind: int, u: float, v: float, su: float, sv: float, longest: float) -> Any:
    """Return (u, v) after Newton's step (-su, -sv), whose largest part is `longest`: at most 1 on curved faces."""
    if longest > 1.0 and kind != AFFINE:
        return u - su / longest, v - sv / longest
    return u - su, v - sv


@kernel(borrows=True)
def foot(G: Any, kind: int, H: Any, x: Any, u: float, v: float) -> Any:
    """Point of a face of map G whose normal, of map H, goes through x: (met, u, v, distance, normal), from a guess.

    Newton's method for y(u, v) - x along n, with steps of at most 1, as in `ray`; the distance is along the unit n.
    """
    met = False
    for _ in range(_MOST):
        d, du, dv, n = _off_foot(G, kind, H, x, u, v)
        det = triple(n, du, dv)
        if det == 0.0:
            break
        su, sv = triple(n, d, dv) / det, triple(n, du, d) / det
        longest = max(abs(su), abs(sv))
        if not longest < np.inf:
            break
        u, v = _stepped(kind, u, v, su, sv, longest)
        if longest < 1e-9:
            met = True
            break
    d, _, _, n = _off_foot(G, kind, H, x, u, v)
    return met, u, v, d[0] * n[0] + d[1] * n[1] + d[2] * n[2], n


@kernel(borrows=True)
def _off_foot(G: Any, kind: int, H: Any, x: Any, u: float, v: float) -> Any:
    """Vector d from x to the point (u, v) of a face, its derivatives but for parts along n, and the unit normal n.

    The derivatives are of d - r n at the length r = d.n, which is 0 at the foot.
    """
    y, du, dv = at(G, kind, u, v)
    h, hu, hv = at(H, CURVED, u, v)
    size = np.sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2])
    n = (h[0] / size, h[1] / size, h[2] / size)
    d = (y[0] - x[0], y[1] - x[1], y[2] - x[2])
    r = (d[0] * n[0] + d[1] * n[1] + d[2] * n[2]) / size
    du = (du[0] - r * hu[0], du[1] - r * hu[1], du[2] - r * hu[2])
    dv = (dv[0] - r * hv[0], dv[1] - r * hv[1], dv[2] - r * hv[2])
    return d, du, dv, n


@kernel
def triple(a: Any, b: Any, c: Any) -> Any:
    """Return a.(b x c)."""
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])


def values(G: Floats, face: Ints, xi: Floats) -> NDArray[np.floating]:
    """(n, k): values of maps G (f, 9, k) at reference points xi (n, 2) of faces (n,); (f, 11, k) with u^3 and v^3."""
    return np.asarray((monomials(xi, G.shape[1])[:, None] @ G[face])[:, 0])


def slopes(G: Floats, face: Ints, xi: Floats, dim: int) -> NDArray[np.floating]:
    """(n, k, dim): derivatives of maps, as in `values`, by `dim` reference coordinates at points xi (n, 2) of faces."""
    along = np.stack([monomials(xi, G.shape[1], axis) for axis in range(dim)], axis=1)
    return np.swapaxes(along @ G[face], 1, 2)


#: the quadratic type whose functions carry the height of a face
QUADRATIC = {
    "SEG2": "SEG3", "SEG3": "SEG3", "TRIA3": "TRIA6", "TRIA6": "TRIA6", "TRIA7": "TRIA6", "QUAD4": "QUAD9",
    "QUAD8": "QUAD9", "QUAD9": "QUAD9",
}  # fmt: skip
#: the same by the codes of the types
_QUADRATIC_CODE = np.array([TYPE_CODE[QUADRATIC.get(name, name)] for name in FACE_TYPES])
#: types with heights in both directions
QUADRANGLES = np.flatnonzero(np.equal(_QUADRATIC_CODE, TYPE_CODE["QUAD9"]))
#: most nodes of such a type, and most functions of heights
N_NODES_OF_HEIGHTS, N_HEIGHTS = 9, 10
#: coefficients of the cubics in the monomials, u^3 and v^3. On its edge a cubic is t (1 - t) (2 t - 1), with t the part
#: of the way from corner to corner, and 0 on the other edges; the last of a triangle is 0 on all edges
_CUBICS = {
    "SEG3": np.array([[0, 1, 0, 0, 0, 0, 0, 0, 0, -1, 0]]) / 4,
    "TRIA6": np.array([
        [0, -1, 0, 3, 2, 0, -3, -1, 0, -2, 0],
        [0, 0, 0, 0, 0, 0, -1, 1, 0, 0, 0],
        [0, 0, 1, 0, -2, -3, 1, 3, 0, 0, 2],
        [0, 0, 0, 0, 1, 0, -1, -1, 0, 0, 0],
    ]),
    "QUAD9": np.zeros((0, 11)),
}  # fmt: skip


@cache
def basis_of_heights(name: str) -> NDArray[np.floating]:
    """(11, n): coefficients of the functions of heights over a type of face: at nodes, then cubics."""
    quadratic = np.pad(basis(TYPE_CODE[QUADRATIC[name]]), ((0, 2), (0, 0)))
    return np.concatenate([quadratic, _CUBICS[QUADRATIC[name]].T], axis=1)


def functions_of_heights(name: str, X: Floats) -> NDArray[np.floating]:
    """(n, k): the functions of heights over a type of face at reference points X (n, dim)."""
    X = np.pad(X, ((0, 0), (0, 2 - X.shape[1])))
    return np.asarray(monomials(X, N_MONOMIALS + 2) @ basis_of_heights(name))


@dataclass(frozen=True, eq=False)
class Height:
    """The heights of a surface's faces (f,).

    `type` (f,): codes in skin.FACE_TYPES; `value` (f, 10): heights at the nodes of each face's quadratic type, in their
    order, and factors of cubics, padded with 0; `lean` (f, 9, 2): slopes of the smooth surface's normals to the face
    at those nodes, None: those of the heights. `taken` (f,): faces with the same number, 0 or more, are taken as one
    smooth shape although they turn by more than the crease angle; None if there are none. `doubt` (f,): how far the
    heights of faces of free form may be off (`lacmesh.smooth`), over the size of the faces; None: not known.
    """

    type: Ints
    value: Floats
    lean: Floats | None = None
    taken: Ints | None = None
    doubt: Floats | None = None

    @property
    def degree(self) -> int:
        """Degree of the heights as polynomials in the plane of a face."""
        if np.isin(self.type, QUADRANGLES).any():
            return 4
        return 3 if self._map[:, _CUBIC:].any() else 2

    def take(self, rows: Ints) -> Height:
        """Return the heights of some of the faces."""
        rest: list[Any] = [part if part is None else part[rows] for part in (self.lean, self.taken, self.doubt)]
        return Height(self.type[rows], self.value[rows], *rest)

    def at(self, face: Ints, xi: Floats) -> NDArray[np.floating]:
        """(n,): heights at reference points xi (n, 2) of faces (n,)."""
        return values(self._map, face, xi)[:, 0]

    def slope(self, face: Ints, xi: Floats) -> NDArray[np.floating]:
        """(n, 2): derivatives of the heights by the faces' reference coordinates; the second is 0 on segments."""
        return slopes(self._map, face, xi, 2)[:, 0]

    @cached_property
    def _map(self) -> NDArray[np.floating]:
        """(f, 11, 1): coefficients of the heights."""
        G = np.zeros((len(self.type), N_MONOMIALS + 2, 1))
        for code in codes(self.type):
            rows, C = np.flatnonzero(self.type == code), basis_of_heights(FACE_TYPES[code])
            G[rows] = C @ self.value[rows, : C.shape[1], None]
        return G

    @cached_property
    def leans(self) -> NDArray[np.floating]:
        """(f, 9, 2): coefficients of the slopes of the normals."""
        return interpolated(_QUADRATIC_CODE[self.type], self.slopes_at_nodes if self.lean is None else self.lean)

    @property
    def slopes_at_nodes(self) -> NDArray[np.floating]:
        """(f, 9, 2): slopes of the heights at the nodes of each face's quadratic type, padded with 0."""
        out = np.zeros((len(self.type), N_NODES_OF_HEIGHTS, 2))
        for code in codes(self.type):
            rows, X = np.flatnonzero(self.type == code), padded_nodes(FACE_TYPES[_QUADRATIC_CODE[code]])
            at = self.slope(np.repeat(rows, len(X)), np.tile(X, (len(rows), 1)))
            out[rows, : len(X)] = at.reshape(len(rows), len(X), 2)
        return out


def padded_nodes(name: str) -> NDArray[np.floating]:
    """(n, 2): reference coordinates of the nodes of a type of face; the second is 0 on segments."""
    X = np.array(CELLS[name].reference, dtype=float)
    return np.pad(X, ((0, 0), (0, 2 - X.shape[1])))
