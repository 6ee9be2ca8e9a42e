"""Metals that yield: von Mises' criterion, isotropic hardening by a table, and linear kinematic hardening.

The elastic strain e = E - ep, the back stress X = 2/3 H ep and the accumulated plastic strain p = int sqrt(2/3) |dep|
give, for energies K/2 (tr e)^2 + G dev e : dev e + H/3 ep : ep,

    T = K tr e I + 2 G dev e,      f = sqrt(3/2) |dev T - X| - Y(p) <= 0,      dep = 3/2 dp (dev T - X) / Y

A step goes from (ep, p) along its trial state, that of no flow, straight back to the yield surface (radial return,
implicit Euler: Simo and Hughes, Computational inelasticity, 1998, sections 2 and 3.3). With q = sqrt(3/2) |dev T - X|
of the trial state and n the unit tensor along dev T - X,

    q - (3 G + H) dp = Y(p + dp),     dep = sqrt(3/2) dp n
    D = K I I + 2 G beta (1 - I I / 3) - 2 G gamma n n
    beta = 1 - 3 G dp / q,     gamma = 3 G / (3 G + H + Y') - 3 G dp / q

Small strains: E is the symmetric part of H. Finite strains: F = F_e F_p, E = ln(F_e^T F_e) / 2 of the trial state F_e =
F F_p^-1, and F_p becomes exp(dep) F_p, so that the plastic volume stays as it is; e and the yield surface are those
above, and T is along E (Weber and Anand 1990; Eterovic and Bathe, A hyperelastic-based large strain elasto-plastic
constitutive formulation, 1990). For isotropic hardening T is Kirchhoff's stress, turned. The tangent is the derivative
of the stress of the step, and symmetric: the step minimises the sum of energy and dissipation (`logarithmic`).

The energy dissipated is int Y dp; what H stores comes back when the flow is reversed, and is a part of the energy.

History of a point: p, then ep (6) in the order of `space.COMPONENTS` (tensor components); at finite strains p, ep, and
the nine components of F_p^-1 - I row by row. All are 0 at the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import DataError
from lacmesh.kernels import kernel
from lacmesh.mesh import Floats
from lacsolver.bodies.deformation import green_lagrange
from lacsolver.bodies.logarithmic import eigenvectors, stress_and_tangent
from lacsolver.bodies.material import PLACES, Elastic, PointResponse

#: largest growth of the accumulated plastic strain in a step. Forces of a metal that hardly hardens are bounded, so
#: that an iterate that is far off may balance them; steps that follow a load are much smaller
LARGEST_FLOW = 1.0
#: excess of q over the yield stress, relative to it, that is round-off of a state on the yield surface
_ON = 1e-11
_ROWS = np.array([i for i, _ in PLACES])
_COLUMNS = np.array([j for _, j in PLACES])


class PlasticConstants(NamedTuple):
    """Constants of a law for kernels: bulk modulus K, shear modulus G, H, and the table of Y (k,) at p (k,)."""

    bulk: float
    shear: float
    kinematic: float
    stress: Floats
    strain: Floats


@dataclass(frozen=True)
class Plastic(Elastic):
    """Elastic and plastic at small strains, see above.

    `hardening`: rows (yield stress, plastic strain), the first at a plastic strain of 0; linear between them, constant
    after the last: one row is perfect plasticity. `kinematic`: H of kinematic hardening, a stress. Linear cells of
    several points take the mean dilatation, since plastic flow keeps the volume. Raises DataError.

    >>> steel = Plastic(young=200e3, poisson=0.3, hardening=((250.0, 0.0), (300.0, 0.1)))
    >>> steel.yield_stress(np.array([0.05, 1.0])).tolist()
    [275.0, 300.0]
    """

    hardening: Sequence[tuple[float, float]] = ()
    kinematic: float = 0.0
    mean_dilatation: bool = True

    n_history: ClassVar[int] = 7

    def __post_init__(self) -> None:
        super().__post_init__()
        table = np.array(self.hardening, float)
        if not (table.ndim == 2 and table.shape[1] == 2 and np.isfinite(table).all()):
            raise DataError(f"hardening is rows of a yield stress and a plastic strain, not {self.hardening}")
        if (
            table[0, 1] != 0.0
            or np.any(np.diff(table[:, 1]) <= 0)
            or table[0, 0] <= 0
            or np.any(np.diff(table[:, 0]) < 0)
        ):
            message = "hardening has yield stresses above 0 that do not fall, at plastic strains that grow from 0"
            raise DataError(f"{message}, not {self.hardening}")
        if not (np.isfinite(self.kinematic) and self.kinematic >= 0):
            raise DataError(f"kinematic is a stress, 0 or more, not {self.kinematic}")

    @property
    def constants(self) -> PlasticConstants:
        """The constants for kernels."""
        lam, mu = self.lame
        stress, strain = np.array(self.hardening, float).T
        stress, strain = np.ascontiguousarray(stress), np.ascontiguousarray(strain)
        return PlasticConstants(lam + 2 / 3 * mu, mu, float(self.kinematic), stress, strain)

    def yield_stress(self, p: Floats) -> NDArray[np.floating]:
        """Return the yield stress at accumulated plastic strains p."""
        stress, strain = np.array(self.hardening, float).T
        return np.interp(p, strain, stress)

    def dissipated(self, p: Floats) -> NDArray[np.floating]:
        """Return the energy dissipated per volume up to accumulated plastic strains p, int Y dp."""
        stress, strain = np.array(self.hardening, float).T
        whole = np.concatenate([[0.0], np.cumsum(np.diff(strain) * (stress[1:] + stress[:-1]) / 2)])
        k = np.searchsorted(strain, p, side="right") - 1
        return np.asarray(whole[k] + (p - strain[k]) * (stress[k] + self.yield_stress(p)) / 2)

    def respond(self, H: Floats, history: Floats, tangent: bool = True) -> PointResponse:
        """Return the response to gradients H (k, 3, 3), with an empty tangent unless it is asked for."""
        stress, energy, new = np.empty(H.shape), np.empty(len(H)), np.empty(history.shape)
        A = np.empty((len(H) if tangent else 0, 3, 3, 3, 3))
        respond = _respond_finite if self.finite else _respond_small
        respond(self.constants, H, np.ascontiguousarray(history), stress, A, energy, new)
        return PointResponse(stress, A, energy, new)


class FinitePlastic(Plastic):
    """Elastic and plastic at finite strains, see above."""

    finite: ClassVar[bool] = True
    n_history: ClassVar[int] = 16


@kernel
def _respond_small(constants: Any, H: Any, history: Any, stress: Any, A: Any, energy: Any, new: Any) -> None:
    """Fill stress (k, 3, 3), energy (k,), the new history, and A (k, 3, 3, 3, 3) unless it is empty."""
    E, ep, n, none = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3, 3, 3))
    wanted = len(A) > 0
    for k in range(len(H)):
        _unpack(history[k], ep)
        for i in range(3):
            for j in range(3):
                E[i, j] = 0.5 * (H[k, i, j] + H[k, j, i]) - ep[i, j]
        dp, energy[k] = _return(constants, history[k, 0], wanted, E, ep, stress[k], n, A[k] if wanted else none)
        new[k, 0] = history[k, 0] + dp
        for m in range(6):
            new[k, 1 + m] = history[k, 1 + m] + np.sqrt(1.5) * dp * n[_ROWS[m], _COLUMNS[m]]


@kernel
def _respond_finite(constants: Any, H: Any, history: Any, stress: Any, A: Any, energy: Any, new: Any) -> None:
    """Fill stress (k, 3, 3), energy (k,), the new history, and A (k, 3, 3, 3, 3) unless it is empty.

    The return is along the axes N of the trial strain.
    """
    E, N, ep, turned = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    T, n, D, c = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3, 3, 3)), np.empty(3)
    F, G, M = np.empty((3, 3)), np.empty((3, 3)), np.empty((2, 3, 3, 3, 3))
    wanted = len(A) > 0
    for k in range(len(H)):
        _log_strain(H[k], history[k], E, N, F, G, c)
        _unpack(history[k], ep)
        _rotate(ep, N, turned)
        dp, energy[k] = _return(constants, history[k, 0], wanted, E, turned, T, n, D)
        new[k, 0] = history[k, 0] + dp
        stress_and_tangent(F, c, N, G, T, D, wanted, stress[k], A[k] if wanted else D, M)
        _put_flow(dp, N, n, T, history[k], new[k])


@kernel
def _unpack(history: Any, ep: Any) -> None:
    """Fill ep (3, 3) with the plastic strain of a history."""
    for m in range(6):
        i, j = _ROWS[m], _COLUMNS[m]
        ep[i, j] = ep[j, i] = history[1 + m]


@kernel
def _log_strain(H: Any, history: Any, E: Any, N: Any, F: Any, G: Any, c: Any) -> None:
    """Fill F = F_e of the trial state, G = F_p^-1, c and N of F^T F, and E on its axes."""
    for i in range(3):
        for j in range(3):
            G[i, j] = history[7 + 3 * i + j]
    for i in range(3):  # F_e - I = H + (G - I) + H (G - I)
        for j in range(3):
            F[i, j] = H[i, j] + G[i, j] + H[i, 0] * G[0, j] + H[i, 1] * G[1, j] + H[i, 2] * G[2, j]
    green_lagrange(F, E)
    for i in range(3):
        F[i, i] += 1.0
        G[i, i] += 1.0
    eigenvectors(E, N)
    for a in range(3):
        c[a] = 1.0 + 2.0 * E[a, a]
        for b in range(3):
            E[a, b] = 0.5 * np.log1p(2.0 * E[a, a]) if a == b else 0.0


@kernel
def _rotate(B: Any, N: Any, out: Any) -> None:
    """Fill out = N^T B N."""
    for a in range(3):
        for b in range(3):
            out[a, b] = 0.0
            for i in range(3):
                for j in range(3):
                    out[a, b] += N[i, a] * B[i, j] * N[j, b]


@kernel
def _put_flow(dp: float, N: Any, n: Any, flow: Any, old: Any, new: Any) -> None:
    """Write the plastic strain after a flow dp along n, in the frame N, and F_p^-1 exp(-dep) - I."""
    axes, e = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            flow[i, j] = 0.0
            for a in range(3):
                for b in range(3):
                    flow[i, j] += np.sqrt(1.5) * dp * N[i, a] * n[a, b] * N[j, b]
    for m in range(6):
        new[1 + m] = old[1 + m] + flow[_ROWS[m], _COLUMNS[m]]
    eigenvectors(flow, axes)
    for i in range(3):  # exp(-dep) - I
        for j in range(3):
            e[i, j] = 0.0
            for a in range(3):
                e[i, j] += axes[i, a] * np.expm1(-flow[a, a]) * axes[j, a]
    for i in range(3):
        for j in range(3):
            x = old[7 + 3 * i + j] + e[i, j]
            for a in range(3):
                x += old[7 + 3 * i + a] * e[a, j]
            new[7 + 3 * i + j] = x


@kernel
def _return(constants: Any, p: float, wanted: bool, E: Any, ep: Any, T: Any, n: Any, D: Any) -> Any:
    """Fill the stress T, the direction of flow n, and D = dT/dE (3, 3, 3, 3) if it is wanted.

    E (3, 3): elastic strain of the trial state after (ep, p). Return dp and the energy per volume.
    """
    K, G, back = constants.bulk, constants.shear, 2.0 / 3.0 * constants.kinematic
    change = E[0, 0] + E[1, 1] + E[2, 2]
    square = 0.0
    for i in range(3):
        for j in range(3):
            T[i, j] = 2.0 * G * (E[i, j] - (change / 3.0 if i == j else 0.0))
            n[i, j] = T[i, j] - back * ep[i, j]
            square += n[i, j] ** 2
    size = np.sqrt(square)
    q, dp, slope, along = np.sqrt(1.5) * size, 0.0, 0.0, 0.0
    limit = _yield_stress(constants.stress, constants.strain, p)
    if q > limit * (1.0 + _ON):
        dp, slope = _increment(q, p, 3.0 * G + constants.kinematic, constants.stress, constants.strain)
        along = 3.0 * G * dp / q
    elastic = stored = 0.0
    for i in range(3):
        for j in range(3):
            n[i, j] = n[i, j] / size if dp > 0.0 else 0.0
            T[i, j] -= 2.0 * G * np.sqrt(1.5) * dp * n[i, j]
            elastic += T[i, j] ** 2
            stored += (ep[i, j] + np.sqrt(1.5) * dp * n[i, j]) ** 2
    for i in range(3):
        T[i, i] += K * change
    if wanted:
        lead = 3.0 * G / (3.0 * G + constants.kinematic + slope) - along if dp > 0.0 else 0.0
        _put_tangent(K, G, 2.0 * G * (1.0 - along), 2.0 * G * lead, n, D)
    return dp, 0.5 * K * change * change + 0.25 * elastic / G + 0.5 * back * stored


@kernel
def _put_tangent(K: float, G: float, soft: float, less: float, n: Any, D: Any) -> None:
    """Fill D = K I I + soft (1 - I I / 3) - less n n."""
    for i in range(3):
        for j in range(3):
            for a in range(3):
                for b in range(3):
                    D[i, j, a, b] = -less * n[i, j] * n[a, b]
    for i in range(3):
        for j in range(3):
            D[i, i, j, j] += K - soft / 3.0
            D[i, j, i, j] += 0.5 * soft
            D[i, j, j, i] += 0.5 * soft


@kernel
def _yield_stress(stress: Any, strain: Any, p: float) -> float:
    """Return the yield stress at p."""
    k = len(strain) - 1
    while k > 0 and p < strain[k]:
        k -= 1
    if k == len(strain) - 1:
        return stress[k]
    return stress[k] + (stress[k + 1] - stress[k]) / (strain[k + 1] - strain[k]) * (p - strain[k])


@kernel
def _increment(q: float, p: float, stiff: float, stress: Any, strain: Any) -> Any:
    """Return dp of q - stiff dp = Y(p + dp), and Y' there."""
    k, last = 0, len(strain) - 1
    while k < last and p >= strain[k + 1]:
        k += 1
    while True:
        slope = (stress[k + 1] - stress[k]) / (strain[k + 1] - strain[k]) if k < last else 0.0
        dp = (q - stress[k] - slope * (p - strain[k])) / (stiff + slope)
        if k == last or p + dp <= strain[k + 1]:
            return dp, slope
        k += 1
