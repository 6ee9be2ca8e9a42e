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

At a point, H_si = du_s/dX_i is (3, 3) in every model. Stress and tangent of both laws have one form,

    P = Y S,    S = 2 mu E + lambda q I
    A_sitj = dP_si/dF_tj = lambda Y_si Y_tj + m Y_sj Y_ti + delta_st X_ij + Z_st delta_ij

| law | Y | q | m | X | Z |
|---|---|---|---|---|---|
| Saint Venant-Kirchhoff | F | tr E | mu | S | mu F F^T |
| neo-Hookean | F^-T | ln J | mu - lambda ln J | mu I | 0 |

Stress and energy are computed from E = (H + H^T + H^T H) / 2 and ln J = ln det(I + 2 E) / 2, by log1p, so that small
strains keep their digits, and a rotation causes no stress and no energy: with ln J of F, tr E - ln J would be rounding.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.deformation import change_of_volume, green_lagrange, inverse_transposed, log_of_volume
from lacsolver.bodies.material import Elastic, PointResponse


class Hyperelastic(Elastic):
    """A law of finite strains with the constants of `Elastic`. Raises DataError as that does."""

    finite = True
    n_history: ClassVar[int] = 0

    def respond(self, H: Floats, history: Floats, tangent: bool = True) -> PointResponse:
        """Return the response to gradients H (k, 3, 3), with an empty tangent unless it is asked for."""
        stress, energy = np.empty(H.shape), np.empty(len(H))
        A = np.empty((len(H) if tangent else 0, 3, 3, 3, 3))
        _respond(isinstance(self, NeoHookean), *self.lame, H, stress, A, energy)
        return PointResponse(stress, A, energy, history)


class SaintVenantKirchhoff(Hyperelastic):
    """Linear in the Green-Lagrange strain: S = lambda tr E I + 2 mu E. It has no mean dilatation."""

    takes_mean = False


class NeoHookean(Hyperelastic):
    """Compressible rubber: S = mu (I - C^-1) + lambda ln J C^-1."""


@kernel
def _respond(neo_hookean: bool, lam: float, mu: float, H: Any, stress: Any, A: Any, energy: Any) -> None:
    """Fill stress (k, 3, 3), energy (k,), and A (k, 3, 3, 3, 3) unless it is empty. Where J <= 0 all are 0."""
    E, S, Y = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    X, Z = np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(len(H)):
        h = H[k]
        if not change_of_volume(h) > -1.0:
            energy[k] = 0.0
            stress[k] = 0.0
            if len(A):
                A[k] = 0.0
            continue
        green_lagrange(h, E)
        trace = E[0, 0] + E[1, 1] + E[2, 2]
        if neo_hookean:
            inverse_transposed(h, Y)
            q = log_of_volume(E)
            m, energy[k] = mu - lam * q, mu * (trace - q) + 0.5 * lam * q * q
        else:
            q, m, square = trace, mu, 0.0
            for s in range(3):
                for i in range(3):
                    Y[s, i] = h[s, i] + 1.0 if s == i else h[s, i]
                    square += E[s, i] ** 2
            energy[k] = 0.5 * lam * q * q + mu * square
        for s in range(3):
            for i in range(3):
                S[s, i] = 2.0 * mu * E[s, i]
            S[s, s] += lam * q
        for s in range(3):
            for i in range(3):
                stress[k, s, i] = Y[s, 0] * S[0, i] + Y[s, 1] * S[1, i] + Y[s, 2] * S[2, i]
                if neo_hookean:
                    X[s, i] = mu if s == i else 0.0
                else:
                    X[s, i] = S[s, i]
                    Z[s, i] = mu * (Y[s, 0] * Y[i, 0] + Y[s, 1] * Y[i, 1] + Y[s, 2] * Y[i, 2])
        if len(A):
            _put_tangent(lam, m, X, Y, Z, A[k])


@kernel
def _put_tangent(lam: float, m: float, X: Any, Y: Any, Z: Any, A: Any) -> None:
    """Fill A (3, 3, 3, 3) from X, Y and Z."""
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
