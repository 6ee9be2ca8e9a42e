"""Mean dilatation: cells of the neo-Hookean law, and of laws that yield, with one volume change: the mean of J.

With j = ln (v / V), v and V the deformed and undeformed volumes of the cell, F is replaced by F (e^j / J)^(1/3), whose
determinant is e^j at every point. The energy of a cell is

    int mu/2 (beta tr C - 3) - mu j + lambda/2 j^2 dV,    beta = (e^j / J)^(2/3)

(Simo, Taylor and Pister, Variational and projection methods for the volume constraint in finite deformation
elasto-plasticity, 1985, with one pressure and one dilatation for a cell). Its first derivative has, beside the
deviator, one pressure p for the cell:

    P = F^-T (2 mu beta dev E + p J I),   p v = int mu (beta tr C / 3 - 1) + lambda j dV
    A_sitj = mu beta delta_st delta_ij + m Y_sj Y_ti + Z_si Y_tj + Y_si Z_tj,   Y = F^-T
    m = mu beta tr C / 3 - p J,   Z = (mu beta tr C / 9 + p J / 2) Y - 2/3 mu beta F
    R = 2/3 F^-T 2 mu beta dev E,   G = J Y / v,   b = int 2/9 mu beta tr C + lambda dV - p v

with R, G and b the terms of the whole cell, see `assembly`.

A law whose stress is a deviator and a pressure p = K ln J apart, as that of metals in logarithmic strain
(`bodies.plastic`), gets K j in place of K ln J, and nothing else changes (`with_mean_pressure`):

    P = P_dev + K j V/v J Y,   A_sitj = dev + K j V/v J (Y_si Y_tj - Y_sj Y_ti),   G = J Y / v,   b = K V (1 - j)

and at small strains, with the mean j of tr H: P = P_dev + K j I, A = dev, G = I / V, b = K V.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.assembly import NO_MEAN, MeanTerms
from lacsolver.bodies.hyperelastic import NeoHookean, cofactors, strain
from lacsolver.bodies.material import PointResponse
from lacsolver.bodies.plastic import Plastic


def mean_response(law: NeoHookean, H: Floats, W: Floats, tangent: bool) -> tuple[PointResponse, MeanTerms]:
    """Return the response (c q) at the points of cells to gradients H (c, q, 3, 3), and the terms of the cells.

    W (c, q): weights of the points. Tangent and terms are empty unless they are asked for.
    """
    stress, energy, terms = np.empty(H.shape), np.empty(W.shape), NO_MEAN
    A = np.empty((*H.shape, 3, 3) if tangent else (0, 0, 3, 3, 3, 3))
    if tangent:
        terms = MeanTerms(np.empty(H.shape), np.empty(H.shape), np.empty(len(H)))
    _respond_by_cells(*law.lame, H, W, stress, A, energy, terms)
    answer = PointResponse(
        stress.reshape(-1, 3, 3), A.reshape(-1, 3, 3, 3, 3), energy.ravel(), np.empty((energy.size, 0))
    )
    return answer, terms


@kernel
def _respond_by_cells(lam: float, mu: float, H: Any, W: Any, stress: Any, A: Any, energy: Any, terms: Any) -> None:
    """Fill the arrays of `mean_response`. Those of a cell that is inverted at a point mean nothing."""
    n_points = H.shape[1]
    change, beta = np.empty(n_points), np.empty(n_points)
    E, F, Y, Z = np.empty((n_points, 3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(H)):
        p, b, v = _dilate(lam, mu, H[e], W[e], E, change, beta, energy[e])
        if len(A):
            terms.b[e] = b
        for q in range(n_points):
            J, soft = 1.0 + change[q], mu * beta[q]
            for s in range(3):
                for i in range(3):
                    F[s, i] = H[e, q, s, i]
                F[s, s] += 1.0
            det = cofactors(F, Y)
            third = np.trace(E[q]) / 3.0
            for s in range(3):
                for i in range(3):
                    Y[s, i] /= det
            for s in range(3):
                for i in range(3):
                    along = Y[s, 0] * E[q, 0, i] + Y[s, 1] * E[q, 1, i] + Y[s, 2] * E[q, 2, i] - third * Y[s, i]
                    stress[e, q, s, i] = 2.0 * soft * along + p * J * Y[s, i]
            if len(A):
                m = soft * (1.0 + 2.0 * third)
                factor = m / 3.0 + 0.5 * p * J
                for s in range(3):
                    for i in range(3):
                        Z[s, i] = factor * Y[s, i] - 2.0 / 3.0 * soft * F[s, i]
                        terms.R[e, q, s, i] = 2.0 / 3.0 * (stress[e, q, s, i] - p * J * Y[s, i])
                        terms.G[e, q, s, i] = J * Y[s, i] / v
                _put_tangent(soft, m - p * J, Y, Z, A[e, q])


@kernel
def _put_tangent(soft: float, m: float, Y: Any, Z: Any, A: Any) -> None:
    """Fill A (3, 3, 3, 3) at a point."""
    for s in range(3):
        for i in range(3):
            y, z = Y[s, i], Z[s, i]
            for t in range(3):
                w = m * Y[t, i]
                for j in range(3):
                    A[s, i, t, j] = w * Y[s, j] + z * Y[t, j] + y * Z[t, j]
            A[s, i, s, i] += soft


@kernel
def _dilate(lam: float, mu: float, H: Any, W: Any, E: Any, change: Any, beta: Any, energy: Any) -> Any:
    """Fill E (q, 3, 3), J - 1, beta and energy (q,) of a cell with gradients H (q, 3, 3); return (p, b, v)."""
    V = grown = 0.0
    for q in range(len(W)):
        strain(H[q], E[q])
        change[q] = _change(H[q])
        V += W[q]
        grown += W[q] * change[q]
    j, v = np.log1p(grown / V), V + grown
    p = b = 0.0
    for q in range(len(W)):
        x = 2.0 / 3.0 * (j - np.log1p(change[q]))
        third = 2.0 / 3.0 * np.trace(E[q])  # tr C / 3 - 1
        beta[q] = np.exp(x)
        more = np.expm1(x) * (1.0 + third) + third  # beta tr C / 3 - 1
        p += W[q] * (mu * more + lam * j)
        b += W[q] * (2.0 / 3.0 * mu * (1.0 + more) + lam)
        energy[q] = 1.5 * mu * more - mu * j + 0.5 * lam * j * j
    return p / v, b - p, v


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


def with_mean_pressure(
    law: Plastic, H: Floats, W: Floats, deviator: PointResponse, tangent: bool
) -> tuple[PointResponse, MeanTerms]:
    """Add the pressure of the mean change of volume of cells with gradients H (c, q, 3, 3) to a response (c q).

    W (c, q): weights of the points. `deviator`: the response without any pressure, whose arrays are overwritten. The
    terms of the cells are empty unless the tangent is asked for.
    """
    stress, energy = deviator.stress.reshape(H.shape), deviator.energy.reshape(W.shape)
    A: Floats = np.empty((0, 0, 3, 3, 3, 3))
    terms = NO_MEAN
    if tangent:
        A = deviator.tangent.reshape(*H.shape, 3, 3)
        terms = MeanTerms(np.zeros(H.shape), np.empty(H.shape), np.empty(len(H)))
    _add_pressure(law.constants.bulk, law.finite, H, W, stress, A, energy, terms)
    return deviator, terms


@kernel
def _add_pressure(K: float, finite: bool, H: Any, W: Any, stress: Any, A: Any, energy: Any, terms: Any) -> None:
    """Add the pressure of the mean change of volume to stress, A and energy; fill the terms of the tangent."""
    Y = np.empty((3, 3))
    for e in range(len(H)):
        V = grown = 0.0
        for q in range(len(W[e])):
            V += W[e, q]
            grown += W[e, q] * (_change(H[e, q]) if finite else H[e, q, 0, 0] + H[e, q, 1, 1] + H[e, q, 2, 2])
        j = np.log1p(grown / V) if finite else grown / V
        v = V + grown if finite else V
        if len(A):
            terms.b[e] = K * V * (1.0 - j) if finite else K * V
        for q in range(len(W[e])):
            for s in range(3):
                for i in range(3):
                    Y[s, i] = 1.0 if s == i else 0.0
            if finite:
                _cofactors_of_deformed(H[e, q], Y)
            energy[e, q] += 0.5 * K * j * j
            p = K * j * V / v
            for s in range(3):
                for i in range(3):
                    stress[e, q, s, i] += p * Y[s, i]
                    if len(A):
                        terms.G[e, q, s, i] = Y[s, i] / v
            if len(A) and finite:
                _add_change_of_cofactors(p, _change(H[e, q]) + 1.0, Y, A[e, q])


@kernel
def _cofactors_of_deformed(H: Any, Y: Any) -> None:
    """Fill Y with the cofactors J F^-T of F = I + H."""
    F = np.empty((3, 3))
    for s in range(3):
        for i in range(3):
            F[s, i] = H[s, i] + (1.0 if s == i else 0.0)
    cofactors(F, Y)


@kernel
def _add_change_of_cofactors(p: float, J: float, Y: Any, A: Any) -> None:
    """Add p dY/dF of the cofactors Y of F, whose determinant is J: p (Y_si Y_tj - Y_sj Y_ti) / J."""
    for s in range(3):
        for i in range(3):
            for t in range(3):
                for j in range(3):
                    A[s, i, t, j] += p / J * (Y[s, i] * Y[t, j] - Y[s, j] * Y[t, i])
