"""Mean dilatation: a neo-Hookean cell with one volume change, the mean of J over the cell.

With j = ln (v / V), v and V the deformed and undeformed volumes of the cell, F is replaced by F (e^j / J)^(1/3), whose
determinant is e^j at every point. The energy of a cell is

    int mu/2 (beta tr C - 3) - mu j + lambda/2 j^2 dV,    beta = (e^j / J)^(2/3)

(Simo, Taylor and Pister, Variational and projection methods for the volume constraint in finite deformation
elasto-plasticity, 1985, with one pressure and one dilatation for a cell). Its first derivative has, beside the
deviator, one pressure p for the cell; with g = F^-T L, h = F L, and gm = int J g dV / v the derivative of j,

    P = F^-T (2 mu beta dev E + p J I),   p v = int mu (beta tr C / 3 - 1) + lambda j dV
    K = int mu beta delta_st L_a.L_b + m g_at g_bs + z_as g_bt + g_as z_bt dV + r gm^T + gm r^T + b gm gm^T
    m = mu beta tr C / 3 - p J,   z = (mu beta tr C / 9 + p J / 2) g - 2/3 mu beta h
    r = 2/3 int F^-T 2 mu beta dev E L dV,   b = int 2/9 mu beta tr C + lambda dV - p v
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.finite.point import cofactors, gradient, strain


class Mean(NamedTuple):
    """Quantities at each integration point q of a cell: `F`, `E` (q, 3, 3), `change` J - 1 and `beta` (q,)."""

    F: Floats
    E: Floats
    change: Floats
    beta: Floats


@kernel
def mean_of(n_points: int) -> Any:
    """Allocate the arrays for a cell of `n_points` integration points."""
    return Mean(np.empty((n_points, 3, 3)), np.empty((n_points, 3, 3)), np.empty(n_points), np.empty(n_points))


@kernel
def dilate(nodes: Any, e: int, u: Any, L: Any, W: Any, theta: Any, kind: Any, lam: float, mu: float, mean: Any) -> Any:
    """Fill `mean` for cell e and return (p, b, energy, v, True if J > 0 at every point).

    L and W are those that `point.apply_thermal_stretch` leaves.
    """
    V = grown = 0.0
    for q in range(len(W)):
        F, hot = mean.F[q], theta[q] if len(theta) else 1.0
        gradient(nodes, e, u, L[q], kind.dim, kind.axisymmetric, hot, F)
        strain(F, mean.E[q])
        mean.change[q] = _change(F)
        for s in range(3):
            F[s, s] += 1.0
        if not mean.change[q] > -1.0:
            return 0.0, 0.0, 0.0, 0.0, False
        V += W[q]
        grown += W[q] * mean.change[q]
    j, v = np.log1p(grown / V), V + grown
    p = b = energy = 0.0
    for q in range(len(W)):
        x = 2.0 / 3.0 * (j - np.log1p(mean.change[q]))
        third = 2.0 / 3.0 * np.trace(mean.E[q])  # tr C / 3 - 1
        mean.beta[q] = np.exp(x)
        more = np.expm1(x) * (1.0 + third) + third  # beta tr C / 3 - 1
        p += W[q] * (mu * more + lam * j)
        b += W[q] * (2.0 / 3.0 * mu * (1.0 + more) + lam)
        energy += W[q] * (1.5 * mu * more - mu * j + 0.5 * lam * j * j)
    return p / v, b - p, energy, v, True


@kernel
def _change(H: Any) -> float:
    """Return det(I + H) - 1."""
    trace = H[0, 0] + H[1, 1] + H[2, 2]
    pairs = H[0, 0] * H[1, 1] - H[0, 1] * H[1, 0] + H[1, 1] * H[2, 2] - H[1, 2] * H[2, 1]
    pairs += H[0, 0] * H[2, 2] - H[0, 2] * H[2, 0]
    det = (
        H[0, 0] * (H[1, 1] * H[2, 2] - H[1, 2] * H[2, 1])
        - H[0, 1] * (H[1, 0] * H[2, 2] - H[1, 2] * H[2, 0])
        + H[0, 2] * (H[1, 0] * H[2, 1] - H[1, 1] * H[2, 0])
    )
    return trace + pairs + det


@kernel
def stress_and_tangent_mean(q: int, p: float, mu: float, mean: Any, work: Any) -> Any:
    """Fill `work` at point q of a cell with pressure p, and return (m, the factor of g in z)."""
    F, E, P, Y, X, Z = work
    for s in range(3):
        for i in range(3):
            F[s, i], E[s, i] = mean.F[q, s, i], mean.E[q, s, i]
    J, soft = 1.0 + mean.change[q], mu * mean.beta[q]
    third = np.trace(E) / 3.0
    det = cofactors(F, Y)
    for s in range(3):
        for i in range(3):
            Y[s, i] /= det
            X[s, i] = Z[s, i] = 0.0
        X[s, s] = soft
    for s in range(3):
        for i in range(3):
            along = Y[s, 0] * E[0, i] + Y[s, 1] * E[1, i] + Y[s, 2] * E[2, i] - third * Y[s, i]
            P[s, i] = 2.0 * soft * along + p * J * Y[s, i]
    m = soft * (1.0 + 2.0 * third)
    return m - p * J, m / 3.0 + 0.5 * p * J


@kernel
def put_mean(
    q: int, W: float, p: float, mu: float, factor: float, mean: Any, work: Any, L: Any, dim: int, axisymmetric: bool,
    z: Any, r: Any, gm: Any,
) -> None:  # fmt: skip
    """Fill W z (dim, n) and add to r and v gm (dim, n) at point q; `work` comes from `stress_and_tangent_mean`."""
    F, _, P, Y, _, _ = work
    J, soft = 1.0 + mean.change[q], mu * mean.beta[q]
    for s in range(dim):
        for a in range(L.shape[1]):
            g = h = d = 0.0
            for i in range(dim):
                g += Y[s, i] * L[i, a]
                h += F[s, i] * L[i, a]
                d += P[s, i] * L[i, a]
            if axisymmetric and s == 0:
                g += Y[2, 2] * L[2, a]
                h += F[2, 2] * L[2, a]
                d += P[2, 2] * L[2, a]
            z[s, a] = W * (factor * g - 2.0 / 3.0 * soft * h)
            r[s, a] += 2.0 / 3.0 * W * (d - p * J * g)
            gm[s, a] += W * J * g
