"""Derivative of the force of a traction at one contact point: a kernel for the loop over points (`tangent`).

A pressure p and a traction t_alpha along the tangents of the slave (`shear`) act as q = p n + tau, tau = t_alpha
e_alpha, on x and as -q on x_bar, and with the arms r m_a on the slave's face, so that the moments balance:

    F.v = w [ q.(v - v_bar) + r m_a.dv/dxi^a ],        m_a = (a^a.n) (N.tau) N - (tau.a^a) n

and, along normals that do not lean on the slave's face,        m_a = (a^a.n) tau - (N.n) (tau.a^a) N.

The displacement changes it by

    dF.v = dw q.(v - v_bar) + w [ dq.(v - v_bar) - (q.dv_bar/dxi^b) dxi_bar^b ]
           + (dw r m_a + w dr m_a + w r dm_a).dv/dxi^a

with dn, dr, dxi_bar and dw of the point (`chain`), with the tangents' change

    dtau = -n (tau.dn) + (n x tau) spin,     spin = e_2.(c^a dt_a - (n.a_1) dn) / (a_1.e_1)

where dt_a = dv/dxi^a are the changes of the face's own tangents, and with

    dN = -a^b (N.dt_b),     da^a = -(a^a.dt_b) a^b - (a^a.dN) N

In a plane e_2 and the second tangent are its normal, along which nothing changes: there is no spin.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.contact.chain import GAP, NORMAL, SLIDE, STRETCH, cross, dot, dual_of, tangents_of
from lacsolver.contact.shear import Tangents

#: rows of derivatives: of q, of the arms r m_a
_TRACTION, _ARMS = 0, 3


class Shear(NamedTuple):
    """Tractions of macro-elements, `t` (m, 2), and at the points of a loop the tangents that they act along.

    `e` (n, 3): e_1; `c` (n, 2): components of a_1. Or, for the slip since another state, `slip` (n, 2), and its
    derivative `slope` (n, 2, 2) by xi_bar; t is then 0 where none is asked.
    """

    t: Floats
    e: Floats
    c: Floats
    slip: Floats
    slope: Floats

    @classmethod
    def of(cls, t: Floats, frames: Tangents) -> Shear:
        """Return tractions t (m, d - 1) along the tangents at the points of a loop."""
        e, c, none = _padded(frames.e[:, 0], 3), _padded(frames.c, 2), np.empty((0, 2))
        return cls(_padded(t, 2), e, c, none, np.empty((0, 2, 2)))

    @classmethod
    def since(cls, which: NDArray[np.bool_], slip: Floats, slope: Floats) -> Shear:
        """Return slips (n, d - 1) since another state, of macro-elements `which` (m,); `slope` (n, d - 1, d - 1)."""
        none = np.empty((0, 3)), np.empty((0, 2))
        return cls(_padded(which[:, None].astype(float), 2), *none, _padded(slip, 2), _padded(slope, 2))


def _padded(values: Floats, k: int) -> NDArray[np.floating]:
    """Return values (n, ...) with zeros up to k in each of the other dimensions."""
    out = np.zeros((len(values), *(k,) * (values.ndim - 1)))
    out[tuple(slice(size) for size in values.shape)] = values
    return out


class _Traction(NamedTuple):
    """A pressure and a traction at a point, with their weight, and what they depend on; `arms`: m_1, m_2.

    `crossed`: n x tau; `c`: components of a_1 over a_1.e_1; `lean`: n.a_1 over it; `leans`: if n leans on the face.
    """

    p: float
    tau: Any
    crossed: Any
    n: Any
    N: Any
    e_2: Any
    dual: Any
    arms: Any
    c: Any
    lean: float
    leans: bool


@kernel
def _combined(f: float, a: Any, g: float, b: Any) -> Any:
    """Return f a + g b."""
    return f * a[0] + g * b[0], f * a[1] + g * b[1], f * a[2] + g * b[2]


@kernel(borrows=True)
def asks(shear: Any, p: Any, macro: int, of_macros: bool, of_nodes: bool) -> Any:
    """Return what is asked of a macro-element: its own derivatives, and those of the forces on nodes.

    Forces without pressure and traction are not; without pressures, p (0,), slips are where `shear.t` is not 0.
    """
    pressed = len(p) > 0 and p[macro] != 0.0
    if len(shear) > 0:
        pressed = pressed or shear.t[macro, 0] != 0.0 or shear.t[macro, 1] != 0.0
    return of_macros and (len(p) > 0 or pressed), of_nodes and pressed


@kernel(borrows=True)
def add_slip(shear: Any, q: Any, w: Any, n: int, d: int, rows: Any, K: Any) -> None:
    """Add what a point of weight w gives to the derivative of the slip since another state, K (d - 1, n)."""
    for k in range(d - 1):
        slip = shear.slip[q, k]
        for j in range(n):
            K[k, j] += w * slip * rows[STRETCH, j]
        for c in range(d - 1):
            slope = shear.slope[q, k, c]
            for j in range(n):
                K[k, j] += w * slope * rows[SLIDE + c, j]


@kernel(borrows=True)
def _traction(skins: Any, points: Any, shear: Any, q: Any, s: Any, k_s: int, load: Any, d: int, dN: Any) -> Any:
    """Return the traction at point q of slave face s under a `load`: pressure and t_alpha, times the weight."""
    n = (points.normal[q, 0], points.normal[q, 1], points.normal[q, 2])
    e_1 = (shear.e[q, 0], shear.e[q, 1], shear.e[q, 2])
    e_2 = cross(n, e_1)
    t_1, t_2 = tangents_of(skins.x, skins.nodes_s, s, k_s, dN)
    dual = dual_of((t_1, t_2), d)
    if d == 2:
        t_2 = (0.0, 0.0, 1.0)
    N = cross(t_1, t_2)
    size = 1.0 / np.sqrt(dot(N, N))
    N = (N[0] * size, N[1] * size, N[2] * size)
    a_1 = _combined(shear.c[q, 0], t_1, shear.c[q, 1], t_2)
    along = dot(a_1, e_1)
    tau = _combined(load[1], e_1, load[2], e_2)
    out, share, leans = dot(N, tau), dot(N, n), len(skins.normals) == 0
    if leans:
        arms = (
            _combined(dot(dual[0], n) * out, N, -dot(tau, dual[0]), n),
            _combined(dot(dual[1], n) * out, N, -dot(tau, dual[1]), n),
        )
    else:
        arms = (
            _combined(dot(dual[0], n), tau, -share * dot(tau, dual[0]), N),
            _combined(dot(dual[1], n), tau, -share * dot(tau, dual[1]), N),
        )
    c = (shear.c[q, 0] / along, shear.c[q, 1] / along)
    return _Traction(load[0], tau, cross(n, tau), n, N, e_2, dual, arms, c, dot(n, a_1) / along, leans)


@kernel
def _change_of_arm(at: Any, a: Any, dn: Any, dt: Any, dN: Any, dtau: Any) -> Any:
    """Return dm_a of the dual vector a."""
    da = _combined(-dot(a, dt[0]), at.dual[0], -dot(a, dt[1]), at.dual[1])
    da = _combined(1.0, da, -dot(a, dN), at.N)
    if not at.leans:
        share, along = dot(at.N, at.n), dot(at.tau, a)
        change = (dot(dN, at.n) + dot(at.N, dn)) * along + share * (dot(dtau, a) + dot(at.tau, da))
        drawn = _combined(dot(da, at.n) + dot(a, dn), at.tau, dot(a, at.n), dtau)
        return _combined(1.0, _combined(1.0, drawn, -change, at.N), -share * along, dN)
    out, lean = dot(at.N, at.tau), dot(a, at.n)
    change = (dot(da, at.n) + dot(a, dn)) * out + lean * (dot(dN, at.tau) + dot(at.N, dtau))
    leans = _combined(change, at.N, lean * out, dN)
    back = _combined(dot(da, at.tau) + dot(a, dtau), at.n, dot(a, at.tau), dn)
    return _combined(1.0, leans, -1.0, back)


@kernel(borrows=True)
def _add_change(at: Any, rows: Any, j: int, dt: Any, r: Any, d: int, out: Any) -> None:
    """Add to column j of the rows `out` what dn, of column j of `rows`, and dt_a add to dq and to r dm_a."""
    dn = (rows[NORMAL, j], rows[NORMAL + 1, j], rows[NORMAL + 2, j])
    dN = _combined(-dot(at.N, dt[0]), at.dual[0], -dot(at.N, dt[1]), at.dual[1])
    spin = at.c[0] * dot(at.e_2, dt[0]) + at.c[1] * dot(at.e_2, dt[1]) - at.lean * dot(at.e_2, dn)
    dtau = _combined(-dot(at.tau, dn), at.n, spin, at.crossed)
    first = _change_of_arm(at, at.dual[0], dn, dt, dN, dtau)
    second = _change_of_arm(at, at.dual[1], dn, dt, dN, dtau)
    for i in range(d):
        out[_TRACTION + i, j] += at.p * dn[i] + dtau[i]
        out[_ARMS + i, j] += r * first[i]
        out[_ARMS + 3 + i, j] += r * second[i]


@kernel(borrows=True)
def add_traction(
    skins: Any, points: Any, shear: Any, q: Any, s: Any, load: Any, sizes: Any, d: int, room: Any, K: Any
) -> None:
    """Add what point q of slave face s gives to the derivative of the forces on its nodes, K; `load` of `_traction`."""
    k_s, _, k = sizes
    rows, out, dN, r = room.rows, room.force, room.dN_s, points.ray[q]
    at = _traction(skins, points, shear, q, s, k_s, load, d, dN)
    force = _combined(at.p, at.n, 1.0, at.tau)
    for j in range(d * k):
        arm = rows[GAP, j] + r * rows[STRETCH, j]
        if len(points.slope) > 0:
            arm += points.slope[q, 0] * rows[SLIDE, j] + points.slope[q, 1] * rows[SLIDE + 1, j]
        for i in range(d):
            out[_TRACTION + i, j] = force[i] * rows[STRETCH, j]
            out[_ARMS + i, j], out[_ARMS + 3 + i, j] = at.arms[0][i] * arm, at.arms[1][i] * arm
    if len(points.edges.nu) == 0:
        none = (0.0, 0.0, 0.0)
        for a in range(k_s):
            for i in range(d):
                x, y, z = (1.0 if i == 0 else 0.0), (1.0 if i == 1 else 0.0), (1.0 if i == 2 else 0.0)
                dt = ((dN[a, 0] * x, dN[a, 0] * y, dN[a, 0] * z), (dN[a, 1] * x, dN[a, 1] * y, dN[a, 1] * z))
                _add_change(at, rows, d * a + i, dt, r, d, out)
        for j in range(d * k_s, d * k):  # of the master's nodes, and of the normals
            _add_change(at, rows, j, (none, none), r, d, out)
    _add_to_nodes(out, force, sizes, d, room, K)


@kernel(borrows=True)
def _add_to_nodes(out: Any, force: Any, sizes: Any, d: int, room: Any, K: Any) -> None:
    """Add the derivatives `out` of a traction and of its arms to the forces on the nodes of both faces, K."""
    k_s, k_m, k = sizes
    for i in range(d):
        for a in range(k_s):
            N, first, second = room.N_s[a], room.dN_s[a, 0], room.dN_s[a, 1]
            for j in range(d * k):
                arms = first * out[_ARMS + i, j] + second * out[_ARMS + 3 + i, j]
                K[d * a + i, j] += N * out[_TRACTION + i, j] + arms
        for b in range(k_m):
            M, first, second = room.N_m[b], room.dN_m[b, 0] * force[i], room.dN_m[b, 1] * force[i]
            for j in range(d * k):
                slide = first * room.rows[SLIDE, j] + second * room.rows[SLIDE + 1, j]
                K[d * (k_s + b) + i, j] -= M * out[_TRACTION + i, j] + slide
