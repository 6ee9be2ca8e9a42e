"""Laws of finite strains: hyperelastic, isotropic, with the constants of `Elastic`.

For small strains they agree with `Elastic`.

| law | energy per reference volume |
|---|---|
| Saint Venant-Kirchhoff | lambda/2 (tr E)^2 + mu E:E |
| neo-Hookean, compressible | mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)^2 |

F = I + du/dX, C = F^T F, E = (C - I)/2, J = det F. The neo-Hookean law is that of Bonet and Wood, Nonlinear continuum
mechanics for finite element analysis, 1997, section 5.4.3: of the several laws of that name, one whose stress is
unbounded in compression, J -> 0, and that needs no constants beyond young and poisson. Saint Venant-Kirchhoff softens
in compression (the force in a bar is largest at a length of 1/sqrt 3 = 58 % and 0 at a length of 0): it is meant for
large rotations with small strains.

Nearly incompressible bodies lock in linear cells (`bodies.locking`). With `mean_dilatation` a linear cell of several
points of neo-Hookean law has one constraint, on the mean of J over the cell (`dilatation`).

Thermal expansion splits F = F_e theta, theta = 1 + expansion (T - T0). The energy above is a function of F_e, per
volume of the warm, stress-free body: W = theta^3 W_e(F / theta).

At a point, H_si = du_s/dX_i is (3, 3) in every model: H_22 is 0 in plane strain, and the hoop u_x / r in axisymmetry;
in plane stress it is solved for here from P_22 = 0. The tangents of both laws have one form,

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

from typing import Any, ClassVar, NamedTuple

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.material import Elastic, PointResponse

#: Newton's method for the stretch across plane stress: relative tolerance of ln F_22, largest number of iterations
_CLOSE, _STEPS = 1e-15, 60


class Hyperelastic(Elastic):
    """A law of finite strains with the constants of `Elastic`. Raises DataError as that does."""

    finite = True
    n_history: ClassVar[int] = 0

    def respond(self, H: Floats, history: Floats, *, plane_stress: bool = False, tangent: bool = True) -> PointResponse:
        """Return the response to gradients H (k, 3, 3), with an empty tangent unless it is asked for.

        In plane stress H_22 is filled in, and the tangent is without the direction 22.
        """
        stress, energy = np.empty(H.shape), np.empty(len(H))
        A = np.empty((len(H) if tangent else 0, 3, 3, 3, 3))
        _respond(isinstance(self, NeoHookean), *self.lame, plane_stress, H, stress, A, energy)
        return PointResponse(stress, A, energy, history)


class SaintVenantKirchhoff(Hyperelastic):
    """Linear in the Green-Lagrange strain: S = lambda tr E I + 2 mu E. It has no mean dilatation."""

    takes_mean = False


class NeoHookean(Hyperelastic):
    """Compressible rubber: S = mu (I - C^-1) + lambda ln J C^-1."""


class _Work(NamedTuple):
    """Arrays (3, 3) of a point: `F`, `E`, first Piola stress `P`, and Y, X, Z of the tangent."""

    F: Floats
    E: Floats
    P: Floats
    Y: Floats
    X: Floats
    Z: Floats


@kernel
def _respond(
    neo_hookean: bool, lam: float, mu: float, plane_stress: bool, H: Any, stress: Any, A: Any, energy: Any
) -> None:
    """Fill stress (k, 3, 3), energy (k,), A (k, 3, 3, 3, 3) unless it is empty, and H_22 of plane stress."""
    F, E, P = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    work = _Work(F, E, P, np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)))
    for k in range(len(H)):
        for s in range(3):
            for i in range(3):
                F[s, i] = H[k, s, i]
        lam_k, m, energy[k] = _stress_and_tangent(neo_hookean, lam, mu, plane_stress, work)
        if plane_stress:
            H[k, 2, 2] = F[2, 2] - 1.0
        for s in range(3):
            for i in range(3):
                stress[k, s, i] = P[s, i]
        if len(A):
            _put_tangent(lam_k, m, work, A[k])


@kernel
def _put_tangent(lam: float, m: float, work: Any, A: Any) -> None:
    """Fill A (3, 3, 3, 3) from Y, X and Z."""
    _, _, _, Y, X, Z = work
    for s in range(3):
        for i in range(3):
            y = lam * Y[s, i]
            for t in range(3):
                z = m * Y[t, i]
                for j in range(3):
                    A[s, i, t, j] = y * Y[t, j] + z * Y[s, j]
                A[s, i, t, i] += Z[s, t]
            for j in range(3):
                A[s, i, s, j] += X[i, j]


@kernel
def _stress_and_tangent(neo_hookean: bool, lam: float, mu: float, plane_stress: bool, work: Any) -> Any:
    """Fill `work`, whose F comes in as F - I; return (lam, m, energy per volume). Where J <= 0 all are 0."""
    F, E, P, Y, X, Z = work
    if plane_stress:
        F[2, 2] = 0.0
    strain(F, E)
    if plane_stress:
        E[2, 2], F[2, 2] = _across(E, neo_hookean, lam, mu)
    for s in range(3):
        F[s, s] += 1.0
    J = cofactors(F, Y)
    if not J > 0.0:
        P[:] = 0.0
        X[:] = 0.0
        Y[:] = 0.0
        Z[:] = 0.0
        return 0.0, 0.0, 0.0
    if neo_hookean:
        m, energy = _neo_hookean(E, J, lam, mu, P, Y, X, Z)
    else:
        m, energy = _kirchhoff(F, E, lam, mu, P, Y, X, Z)
    if plane_stress:
        y = Y[2, 2]
        lam -= (lam * y) ** 2 / ((lam + m) * y * y + X[2, 2] + Z[2, 2])
    return lam, m, energy


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
def _across(E: Any, neo_hookean: bool, lam: float, mu: float) -> Any:
    """Return E_22 and H_22 of plane stress, for an E with 0 there; NaN where no stretch gives P_22 = 0.

    Saint Venant-Kirchhoff: lam tr E + 2 mu E_22 = 0. Neo-Hookean, with F_22 = e^x: mu (e^2x - 1) + lam (ln J_2 + x) =
    0, with J_2 of the plane. The left side is convex in x and increasing at 0, so that Newton's iterates descend
    monotonically to the root after the first, whatever the sign of lam.
    """
    if not neo_hookean:
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
