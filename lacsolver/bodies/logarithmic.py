"""Logarithmic strain E = ln(F^T F) / 2, and the stress and tangent of an energy w(E) with respect to F.

In the frame of the eigenvectors N of C = F^T F, with eigenvalues c and f = ln / 2,

    E_ab = f(c_a) delta_ab,   dE_ab = f[c_a, c_b] dC_ab,   d2E_ab = sum_c f[c_a, c_c, c_b] (dC_ac dC_cb + dC_ac dC_cb)

with the divided differences of f (Daleckii and Krein; Miehe and Lambrecht, Algorithms for computation of stresses and
elasticity moduli in terms of Seth-Hill's family of generalized strain tensors, 2001). With T = dw/dE and D = d2w/dE2:

    S_ab = 2 f[c_a, c_b] T_ab                                                          second Piola stress
    M_abcd = 4 f[c_a, c_b] f[c_c, c_d] D_abcd + 4 sum T_ef df[...]                     its tangent, 2 dS/dC
    P_si = F_sj S_ji,     A_sitj = dP_si/dF_tj = delta_st S_ij + F_sk F_tl M_kilj

Divided differences of eigenvalues near one another are summed from Taylor's series, so that nothing is lost where they
coincide; E is computed from F - I by log1p, so that small strains keep their digits and a rotation causes none.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.kernels import kernel

#: spread of three eigenvalues, relative to their mean, below which a divided difference is summed from a series, and
#: its number of terms: 0.1^16 is round-off
_NEAR, _TERMS = 0.1, 16
#: sweeps of Jacobi's method; five suffice for a matrix of three rows
_SWEEPS = 12


@kernel
def eigenvectors(C: Any, N: Any) -> None:
    """Fill N with the eigenvectors of C (3, 3), its columns, and leave the eigenvalues on the diagonal of C.

    Jacobi's rotations: a direction that C does not couple with others keeps its place.
    """
    for a in range(3):
        for b in range(3):
            N[a, b] = 1.0 if a == b else 0.0
    for _ in range(_SWEEPS):
        rest = C[0, 1] ** 2 + C[0, 2] ** 2 + C[1, 2] ** 2
        if rest == 0.0:
            break
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if C[p, q] == 0.0:
                continue
            tau = (C[q, q] - C[p, p]) / (2.0 * C[p, q])
            t = 1.0 / (abs(tau) + np.sqrt(1.0 + tau * tau))
            if tau < 0.0:
                t = -t
            cos = 1.0 / np.sqrt(1.0 + t * t)
            sin = t * cos
            for k in range(3):
                x, y = C[k, p], C[k, q]
                C[k, p], C[k, q] = cos * x - sin * y, sin * x + cos * y
            for k in range(3):
                x, y = C[p, k], C[q, k]
                C[p, k], C[q, k] = cos * x - sin * y, sin * x + cos * y
                x, y = N[k, p], N[k, q]
                N[k, p], N[k, q] = cos * x - sin * y, sin * x + cos * y
            C[p, q] = C[q, p] = 0.0


@kernel
def first_difference(a: float, b: float) -> float:
    """Return f[a, b] of f = ln / 2."""
    x = (a - b) / b
    return 0.5 * (np.log1p(x) / x if abs(x) > 1e-8 else 1.0 - 0.5 * x) / b


@kernel
def second_difference(a: float, b: float, c: float) -> float:
    """Return f[a, b, c] of f = ln / 2, whatever the order of a, b and c."""
    low, high = min(a, b, c), max(a, b, c)
    mean = (a + b + c) / 3.0
    if high - low > _NEAR * mean:
        middle = a + b + c - low - high
        return (first_difference(middle, high) - first_difference(low, middle)) / (high - low)
    x, y, z = (a - mean) / mean, (b - mean) / mean, (c - mean) / mean
    pairs, product = x * y + y * z + z * x, x * y * z
    before2, before1, now = 0.0, 0.0, 1.0  # complete symmetric sums of x, y, z, of orders k - 2, k - 1, k
    total, sign = 0.0, -1.0
    for k in range(2, _TERMS + 2):
        total += sign * now / k
        now, before1, before2 = -pairs * before1 + product * before2, now, before1
        sign = -sign
    return 0.5 * total / mean**2


@kernel
def stress_and_tangent(F: Any, c: Any, N: Any, G: Any, T: Any, D: Any, wanted: bool, P: Any, A: Any, M: Any) -> None:
    """Fill P (3, 3) and, if `wanted`, A (3, 3, 3, 3) of an energy of the strain of F = F' G, with respect to F'.

    c (3,), N (3, 3): eigenvalues and eigenvectors of F^T F; T (3, 3), D (3, 3, 3, 3): stress and tangent in their
    frame. M (2, 3, 3, 3, 3) is overwritten.
    """
    S, U, V = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    first = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            first[a, b] = first_difference(c[a], c[b])
            S[a, b] = 2.0 * first[a, b] * T[a, b]
            U[a, b] = F[a, 0] * N[0, b] + F[a, 1] * N[1, b] + F[a, 2] * N[2, b]
            V[a, b] = G[a, 0] * N[0, b] + G[a, 1] * N[1, b] + G[a, 2] * N[2, b]
    for s in range(3):
        for i in range(3):
            P[s, i] = 0.0
            for a in range(3):
                for b in range(3):
                    P[s, i] += U[s, a] * S[a, b] * V[i, b]
    if not wanted:
        return
    _second_piola_tangent(c, first, T, D, M[0])
    for k in range(4):
        _turn_last(U if k % 2 else V, M[k % 2], A if k == 3 else M[1 - k % 2])
    for i in range(3):
        for j in range(3):
            x = 0.0
            for a in range(3):
                for b in range(3):
                    x += V[i, a] * S[a, b] * V[j, b]
            for s in range(3):
                A[s, i, s, j] += x


@kernel
def _second_piola_tangent(c: Any, first: Any, T: Any, D: Any, M: Any) -> None:
    """Fill M (3, 3, 3, 3) = 2 dS/dC in the frame of the eigenvectors."""
    for a in range(3):
        for b in range(3):
            for k in range(3):
                for m in range(3):
                    M[a, b, k, m] = 4.0 * first[a, b] * first[k, m] * D[a, b, k, m]
    for a in range(3):
        for b in range(3):
            if T[a, b] == 0.0:
                continue
            for k in range(3):
                v = 2.0 * T[a, b] * second_difference(c[a], c[k], c[b])
                M[a, k, k, b] += v
                M[k, a, k, b] += v
                M[a, k, b, k] += v
                M[k, a, b, k] += v


@kernel
def _turn_last(Q: Any, M: Any, out: Any) -> None:
    """Fill out_jabc = Q_jd M_abcd: the last index is turned and becomes the first."""
    for a in range(3):
        for b in range(3):
            for c in range(3):
                x, y, z = M[a, b, c, 0], M[a, b, c, 1], M[a, b, c, 2]
                for j in range(3):
                    out[j, a, b, c] = Q[j, 0] * x + Q[j, 1] * y + Q[j, 2] * z
