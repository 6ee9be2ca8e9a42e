"""A law at a point: stress, and the terms of its tangent, from the gradient of displacement.

H_si = du_s/dX_i is (3, 3) in every model: H_22 is 0 in plane strain, and the hoop u_x / r in axisymmetry; in plane
stress it is solved for here from P_22 = 0. Under thermal expansion the reference is the warm, stress-free body: L and W
are taken on it (`apply_thermal_stretch`), and F stands for F_e. The tangents of both laws have one form,

    A_sitj = dP_si/dF_tj = lam Y_si Y_tj + m Y_sj Y_ti + delta_st X_ij + Z_st delta_ij

| law | Y | m | X | Z |
|---|---|---|---|---|
| Saint Venant-Kirchhoff | F | mu | S | mu F F^T |
| neo-Hookean | F^-T | mu - lambda ln J | mu I | 0 |

and so has the tangent of plane stress: when F_22 is eliminated, lam becomes lambda - (lambda Y_22)^2 / A_2222, and
nothing else changes, since Y is block-diagonal.

Stress is computed from E = (H + H^T + H^T H) / 2 and ln J = ln det(I + 2 E) / 2, by log1p, so that small strains keep
their digits and a rotation causes no stress.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.finite.laws import NEO_HOOKEAN

#: Newton's method for the stretch across plane stress: relative tolerance of ln F_22, largest number of iterations
_CLOSE, _STEPS = 1e-15, 60


class Work(NamedTuple):
    """Arrays (3, 3) that `stress_and_tangent` fills: `F`, `E`, first Piola stress `P`, and Y, X, Z of the tangent."""

    F: Floats
    E: Floats
    P: Floats
    Y: Floats
    X: Floats
    Z: Floats


@kernel
def work() -> Any:
    """Allocate the arrays for `stress_and_tangent`."""
    F, E, P = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    return Work(F, E, P, np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)))


@kernel
def apply_thermal_stretch(theta: Any, L: Any, W: Any) -> None:
    """Scale gradients L (q, rows, n) and weights W (q,) of a cell, in place, to the warm, stress-free cell.

    theta (q,): thermal stretch, the same in every direction.
    """
    for q in range(len(W)):
        for i in range(L.shape[1]):
            for a in range(L.shape[2]):
                L[q, i, a] /= theta[q]
        W[q] *= theta[q] ** 3


@kernel
def gradient(nodes: Any, e: int, u: Any, L: Any, dim: int, axisymmetric: bool, theta: float, H: Any) -> None:
    """Fill H (3, 3) with F_e - I in cell e of nodes (c, n), displaced by u (n_nodes, dim); L (rows, n) at the point."""
    h00 = h01 = h02 = h10 = h11 = h12 = h20 = h21 = h22 = 0.0
    for a in range(nodes.shape[1]):
        p = nodes[e, a]
        u0, u1, g0, g1 = u[p, 0], u[p, 1], L[0, a], L[1, a]
        h00 += u0 * g0
        h01 += u0 * g1
        h10 += u1 * g0
        h11 += u1 * g1
        if dim == 3:
            u2, g2 = u[p, 2], L[2, a]
            h02 += u0 * g2
            h12 += u1 * g2
            h20 += u2 * g0
            h21 += u2 * g1
            h22 += u2 * g2
        elif axisymmetric:
            h22 += u0 * L[2, a]
    less = (1.0 - theta) / theta
    H[0, 0], H[0, 1], H[0, 2] = h00 + less, h01, h02
    H[1, 0], H[1, 1], H[1, 2] = h10, h11 + less, h12
    H[2, 0], H[2, 1], H[2, 2] = h20, h21, h22 + less


@kernel
def stress_and_tangent(kind: int, lam: float, mu: float, plane_stress: bool, work: Any) -> Any:
    """Fill `work`, whose F comes in as F - I; return (lam, m, energy per volume, True if J > 0)."""
    F, E, P, Y, X, Z = work
    if plane_stress:
        F[2, 2] = 0.0
    strain(F, E)
    if plane_stress:
        E[2, 2], F[2, 2] = _across(E, kind, lam, mu)
    for s in range(3):
        F[s, s] += 1.0
    J = cofactors(F, Y)
    if not J > 0.0:
        return lam, mu, 0.0, False
    if kind == NEO_HOOKEAN:
        m, energy = _neo_hookean(E, J, lam, mu, P, Y, X, Z)
    else:
        m, energy = _kirchhoff(F, E, lam, mu, P, Y, X, Z)
    if plane_stress:
        y = Y[2, 2]
        lam -= (lam * y) ** 2 / ((lam + m) * y * y + X[2, 2] + Z[2, 2])
    return lam, m, energy, True


@kernel
def strain(H: Any, E: Any) -> None:
    """Fill E = (H + H^T + H^T H) / 2."""
    for i in range(3):
        for j in range(i + 1):
            E[i, j] = 0.5 * (H[i, j] + H[j, i] + H[0, i] * H[0, j] + H[1, i] * H[1, j] + H[2, i] * H[2, j])
            E[j, i] = E[i, j]


@kernel
def _change(E: Any) -> float:
    """Return det(I + 2 E) - 1."""
    trace = E[0, 0] + E[1, 1] + E[2, 2]
    pairs = E[0, 0] * E[1, 1] - E[0, 1] ** 2 + E[1, 1] * E[2, 2] - E[1, 2] ** 2 + E[0, 0] * E[2, 2] - E[0, 2] ** 2
    det = (
        E[0, 0] * (E[1, 1] * E[2, 2] - E[1, 2] * E[2, 1])
        - E[0, 1] * (E[1, 0] * E[2, 2] - E[1, 2] * E[2, 0])
        + E[0, 2] * (E[1, 0] * E[2, 1] - E[1, 1] * E[2, 0])
    )
    return 2.0 * trace + 4.0 * pairs + 8.0 * det


@kernel
def _across(E: Any, kind: int, lam: float, mu: float) -> Any:
    """Return E_22 and H_22 of plane stress, for an E with 0 there; NaN where no stretch gives P_22 = 0.

    Saint Venant-Kirchhoff: lam tr E + 2 mu E_22 = 0. Neo-Hookean, with F_22 = e^x: mu (e^2x - 1) + lam (ln J_2 + x) =
    0, with J_2 of the plane. The left side is convex in x and increasing at 0, so that Newton's iterates descend
    monotonically to the root after the first, whatever the sign of lam.
    """
    if kind != NEO_HOOKEAN:
        across = -lam / (lam + 2.0 * mu) * (E[0, 0] + E[1, 1])
        return across, 2.0 * across / (1.0 + np.sqrt(1.0 + 2.0 * across))
    plane, x = 0.5 * np.log1p(_change(E)), 0.0
    for _ in range(_STEPS):
        step = (mu * np.expm1(2.0 * x) + lam * (plane + x)) / (2.0 * mu * np.exp(2.0 * x) + lam)
        x -= step
        if abs(step) <= _CLOSE * (1.0 + abs(x)):
            return 0.5 * np.expm1(2.0 * x), np.expm1(x)
    return np.nan, np.nan


@kernel
def cofactors(F: Any, Y: Any) -> float:
    """Fill Y with the cofactors of F and return det F."""
    for s in range(3):
        a, b = (s + 1) % 3, (s + 2) % 3
        for i in range(3):
            c, d = (i + 1) % 3, (i + 2) % 3
            Y[s, i] = F[a, c] * F[b, d] - F[a, d] * F[b, c]
    return F[0, 0] * Y[0, 0] + F[0, 1] * Y[0, 1] + F[0, 2] * Y[0, 2]


@kernel
def _neo_hookean(E: Any, J: float, lam: float, mu: float, P: Any, Y: Any, X: Any, Z: Any) -> Any:
    """Fill P = F^-T (2 mu E + lam ln J I), Y, X and Z; return m and the energy. Y comes in as the cofactors of F."""
    log = 0.5 * np.log1p(_change(E))
    trace = E[0, 0] + E[1, 1] + E[2, 2]
    for s in range(3):
        for i in range(3):
            Y[s, i] /= J
            X[s, i] = Z[s, i] = 0.0
        X[s, s] = mu
    for s in range(3):
        for i in range(3):
            along = Y[s, 0] * E[0, i] + Y[s, 1] * E[1, i] + Y[s, 2] * E[2, i]
            P[s, i] = 2.0 * mu * along + lam * log * Y[s, i]
    return mu - lam * log, mu * (trace - log) + 0.5 * lam * log * log


@kernel
def _kirchhoff(F: Any, E: Any, lam: float, mu: float, P: Any, Y: Any, X: Any, Z: Any) -> Any:
    """Fill P = F S, Y, X and Z; return m and the energy."""
    trace = E[0, 0] + E[1, 1] + E[2, 2]
    square = 0.0
    for s in range(3):
        for i in range(3):
            Y[s, i] = F[s, i]
            X[s, i] = 2.0 * mu * E[s, i]
            Z[s, i] = mu * (F[s, 0] * F[i, 0] + F[s, 1] * F[i, 1] + F[s, 2] * F[i, 2])
            square += E[s, i] ** 2
        X[s, s] += lam * trace
    for s in range(3):
        for i in range(3):
            P[s, i] = F[s, 0] * X[0, i] + F[s, 1] * X[1, i] + F[s, 2] * X[2, i]
    return mu, 0.5 * lam * trace * trace + mu * square
