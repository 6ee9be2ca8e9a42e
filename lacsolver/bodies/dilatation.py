"""Mean dilatation of any law: the cells of a law with one change of volume, the mean over the cell.

In place of F a law gets F~ = s F with s^3 = J~ / J, and J~ = v / V the mean of J over the cell (v, V: its deformed and
undeformed volume); at small strains it gets H~ = H + (<tr H> - tr H) I / 3, with < > the mean over the cell (Simo,
Taylor and Pister, Variational and projection methods for the volume constraint in finite deformation elasto-plasticity,
1985, with one pressure and one dilatation for a cell). Of its response P~, A~ and Y = F^-T, the first and the second
derivative of the cell's energy int w(F~) dV have

    pi = s/3 P~ : F     M = s^2 A~ : F + [s P~]     c = s^2 F : A~ : F + [3 pi]     p = <pi> / J~
    P = s P~ + (p J - pi) Y
    A_sitj = s^2 A~ - (M_si Y_tj + Y_si M_tj) / 3 + (c / 9 + [p J]) Y_si Y_tj + [(pi - p J) Y_sj Y_ti]
    R = M / 3 - c / 9 Y     G = J Y / v     b = sum W c / 9 - [p v]

with R, G and b the terms of the whole cell, see `assembly`. At small strains F, Y, J, J~ and s are 1, v is V, and the
terms in brackets are absent. J - 1 and s - 1 are computed without cancellation: small strains keep their digits.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.assembly import NO_MEAN, MeanTerms
from lacsolver.bodies.deformation import change_of_volume, inverse_transposed


def dilated(H: Floats, W: Floats, finite: bool) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the gradients H~ (c, q, 3, 3) that a law gets for H (c, q, 3, 3) of weights W (c, q), and s (c, q)."""
    out, stretch = np.empty(H.shape), np.ones(W.shape)
    _dilate(finite, H, W, out, stretch)
    return out, stretch


def add_mean_pressure(finite: bool, H: Floats, W: Floats, stretch: Floats, P: Floats, A: Floats) -> MeanTerms:
    """Turn the response P~ (c, q, 3, 3), A~ (c, q, 3, 3, 3, 3) of a law into P and A in place; return the cells' terms.

    H, W and `stretch`: those of `dilated`. A may be empty; then the terms are, too.
    """
    terms = MeanTerms(np.empty(H.shape), np.empty(H.shape), np.zeros(len(H))) if len(A) else NO_MEAN
    _add_mean_pressure(finite, H, W, stretch, P, A, terms)
    return terms


def dilated_constants(A: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating], float]:
    """Return A and R of a constant tangent A~ (3, 3, 3, 3) at small strains, and b over the volume of the cell."""
    A, one = np.array(A[None, None]), np.zeros((1, 1, 3, 3))
    terms = add_mean_pressure(False, one, np.ones((1, 1)), np.ones((1, 1)), one.copy(), A)
    return A[0, 0], terms.R[0, 0], float(terms.b[0])


@kernel
def _volumes(finite: bool, H: Any, W: Any) -> Any:
    """Return V of a cell with gradients H (q, 3, 3), and v - V, at small strains V <tr H>."""
    V = grown = 0.0
    for q in range(len(W)):
        V += W[q]
        grown += W[q] * (change_of_volume(H[q]) if finite else H[q, 0, 0] + H[q, 1, 1] + H[q, 2, 2])
    return V, grown


@kernel
def _dilate(finite: bool, H: Any, W: Any, out: Any, stretch: Any) -> None:
    """Fill `out` and `stretch` of `dilated`; inverted points, and cells inverted as a whole, stay as they are."""
    for e in range(len(H)):
        V, grown = _volumes(finite, H[e], W[e])
        mean = grown / V
        j = np.log1p(mean) if finite else 0.0
        for q in range(len(W[e])):
            h, more = H[e, q], 0.0
            if finite:
                change = change_of_volume(h)
                if change > -1.0 and mean > -1.0:
                    more = np.expm1((j - np.log1p(change)) / 3.0)
                stretch[e, q] = 1.0 + more
            else:
                more = (mean - h[0, 0] - h[1, 1] - h[2, 2]) / 3.0
            for s in range(3):
                for i in range(3):
                    out[e, q, s, i] = stretch[e, q] * h[s, i]
                out[e, q, s, s] += more


@kernel
def _add_mean_pressure(finite: bool, H: Any, W: Any, stretch: Any, P: Any, A: Any, terms: Any) -> None:
    """Fill the arrays of `add_mean_pressure`. Those of a cell that is inverted at a point mean nothing."""
    F, Y, Z, pi = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(W.shape[1])
    wanted = len(A) > 0
    for e in range(len(H)):
        V, grown = _volumes(finite, H[e], W[e])
        v, p = (V + grown if finite else V), 0.0
        for q in range(len(pi)):
            pi[q] = P[e, q, 0, 0] + P[e, q, 1, 1] + P[e, q, 2, 2]
            if finite:
                for s in range(3):
                    for i in range(3):
                        pi[q] += P[e, q, s, i] * H[e, q, s, i]
            pi[q] *= stretch[e, q] / 3.0
            p += W[e, q] * pi[q] / v
        for q in range(len(pi)):
            J = 1.0
            for i in range(3):
                for s in range(3):
                    Y[s, i] = F[s, i] = 1.0 if s == i else 0.0
                    if finite:
                        F[s, i] += H[e, q, s, i]
            if finite:
                J += inverse_transposed(H[e, q], Y)
            scale, inner = stretch[e, q], (p * J if finite else 0.0)
            if wanted:
                c = _mean_of_tangent(scale * scale, scale if finite else 0.0, F, P[e, q], A[e, q], Z)
                for s in range(3):
                    for i in range(3):
                        terms.R[e, q, s, i] = Z[s, i] / 3.0 - c / 9.0 * Y[s, i]
                        terms.G[e, q, s, i] = J * Y[s, i] / v
                        Z[s, i] = 0.5 * (c / 9.0 + inner) * Y[s, i] - Z[s, i] / 3.0
                terms.b[e] += W[e, q] * c / 9.0
                _put_tangent(scale * scale, pi[q] - inner if finite else 0.0, Y, Z, A[e, q])
            for s in range(3):
                for i in range(3):
                    P[e, q, s, i] = scale * P[e, q, s, i] + (p * J - pi[q]) * Y[s, i]
        if wanted and finite:
            terms.b[e] -= p * v


@kernel
def _mean_of_tangent(scale: float, of_stress: float, F: Any, P: Any, A: Any, M: Any) -> float:
    """Fill M = scale A : F + of_stress P, and return c = M : F."""
    c = 0.0
    for s in range(3):
        for i in range(3):
            a = A[s, i]
            M[s, i] = of_stress * P[s, i] + scale * (
                a[0, 0] * F[0, 0] + a[0, 1] * F[0, 1] + a[0, 2] * F[0, 2]
                + a[1, 0] * F[1, 0] + a[1, 1] * F[1, 1] + a[1, 2] * F[1, 2]
                + a[2, 0] * F[2, 0] + a[2, 1] * F[2, 1] + a[2, 2] * F[2, 2]
            )  # fmt: skip
            c += M[s, i] * F[s, i]
    return c


@kernel
def _put_tangent(scale: float, of_inverse: float, Y: Any, Z: Any, A: Any) -> None:
    """Turn A (3, 3, 3, 3) into scale A + Z_si Y_tj + Y_si Z_tj + of_inverse Y_sj Y_ti."""
    for s in range(3):
        y0, y1, y2 = of_inverse * Y[s, 0], of_inverse * Y[s, 1], of_inverse * Y[s, 2]
        for i in range(3):
            y, z = Y[s, i], Z[s, i]
            for t in range(3):
                x = Y[t, i]
                A[s, i, t, 0] = scale * A[s, i, t, 0] + z * Y[t, 0] + y * Z[t, 0] + x * y0
                A[s, i, t, 1] = scale * A[s, i, t, 1] + z * Y[t, 1] + y * Z[t, 1] + x * y1
                A[s, i, t, 2] = scale * A[s, i, t, 2] + z * Y[t, 2] + y * Z[t, 2] + x * y2
