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

Mean dilatation: K is set to 0 here, and the pressure of the mean change of volume is added (`dilatation`).
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
from lacsolver.bodies.logarithmic import eigenvectors, stress_and_tangent
from lacsolver.bodies.material import PLACES, Elastic, PointResponse

#: largest growth of the accumulated plastic strain in a step. Forces of a metal that hardly hardens are bounded, so
#: that an iterate that is far off may balance them; steps that follow a load are much smaller
LARGEST_FLOW = 1.0
#: excess of q over the yield stress, relative to it, that is round-off of a state on the yield surface
_ON = 1e-11
#: Newton's method for the strain across plane stress: relative tolerance, largest number of iterations
_CLOSE, _STEPS = 1e-15, 80
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

    def respond(
        self, H: Floats, history: Floats, *, plane_stress: bool = False, tangent: bool = True, mean: bool = False
    ) -> PointResponse:
        """Return the response to gradients H (k, 3, 3), with an empty tangent unless it is asked for.

        In plane stress H_22 is filled in, and the tangent is without the direction 22. `mean`: without what the change
        of volume causes, for `dilatation.with_mean_pressure`.
        """
        stress, energy, new = np.empty(H.shape), np.empty(len(H)), np.empty(history.shape)
        A = np.empty((len(H) if tangent else 0, 3, 3, 3, 3))
        constants = self.constants
        if mean:
            constants = constants._replace(bulk=0.0)
        _respond(constants, self.finite, plane_stress, H, np.ascontiguousarray(history), stress, A, energy, new)
        return PointResponse(stress, A, energy, new)


class FinitePlastic(Plastic):
    """Elastic and plastic at finite strains, see above."""

    finite: ClassVar[bool] = True
    n_history: ClassVar[int] = 16


class _Work(NamedTuple):
    """Arrays of a point in the frame of its trial strain `E` (3, 3), whose axes are the columns of `N`.

    `ep`: plastic strain; `T`: stress; `n`: direction of flow; `D` (3, 3, 3, 3): dT/dE.
    """

    E: Floats
    N: Floats
    ep: Floats
    T: Floats
    n: Floats
    D: Floats


@kernel
def _respond(
    constants: Any, finite: bool, plane_stress: bool, H: Any, history: Any, stress: Any, A: Any, energy: Any, new: Any
) -> None:
    """Fill stress (k, 3, 3), energy (k,), the new history, H_22 of plane stress, A unless it is empty."""
    E, N, ep, T, n = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    work = _Work(E, N, ep, T, n, np.empty((3, 3, 3, 3)))
    F, G, c, M = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty((2, 3, 3, 3, 3))
    flow, none = np.empty((3, 3)), np.empty((3, 3, 3, 3))
    wanted = len(A) > 0
    for k in range(len(H)):
        for m in range(6):
            i, j = _ROWS[m], _COLUMNS[m]
            ep[i, j] = ep[j, i] = history[k, 1 + m]
        if finite:
            _log_strain(H[k], history[k], plane_stress, work, F, G, c)
        else:
            for i in range(3):
                for j in range(3):
                    E[i, j] = 0.5 * (H[k, i, j] + H[k, j, i]) - ep[i, j]
        dp, energy[k] = _step(constants, history[k, 0], plane_stress, wanted, work)
        new[k, 0] = history[k, 0] + dp
        if plane_stress:
            H[k, 2, 2] = np.expm1(E[2, 2] - np.log1p(G[2, 2] - 1.0)) if finite else E[2, 2] + ep[2, 2]
        if not finite:
            for m in range(6):
                new[k, 1 + m] = history[k, 1 + m] + np.sqrt(1.5) * dp * n[_ROWS[m], _COLUMNS[m]]
            for i in range(3):
                for j in range(3):
                    stress[k, i, j] = T[i, j]
                    if wanted:
                        for a in range(3):
                            for b in range(3):
                                A[k, i, j, a, b] = work.D[i, j, a, b]
            continue
        if plane_stress:
            c[2] = np.exp(2.0 * E[2, 2])
            F[2, 2] = np.exp(E[2, 2])
        stress_and_tangent(F, c, N, G, T, work.D, wanted, stress[k], A[k] if wanted else none, M)
        _put_flow(dp, N, n, flow, history[k], new[k])


@kernel
def _log_strain(H: Any, history: Any, plane_stress: bool, work: Any, F: Any, G: Any, c: Any) -> None:
    """Fill F = F_e of the trial state, G = F_p^-1, c and N of F^T F, E on its axes, and turn ep into that frame."""
    E, N, ep, T, _, _ = work
    for i in range(3):
        for j in range(3):
            T[i, j] = history[7 + 3 * i + j]
            G[i, j] = T[i, j] + (1.0 if i == j else 0.0)
    for i in range(3):  # F_e - I = H G + (G - I)
        for j in range(3):
            F[i, j] = H[i, 0] * G[0, j] + H[i, 1] * G[1, j] + H[i, 2] * G[2, j] + T[i, j]
    if plane_stress:
        F[2, 2] = 0.0
    for i in range(3):
        for j in range(i + 1):
            E[i, j] = 0.5 * (F[i, j] + F[j, i] + F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j])
            E[j, i] = E[i, j]
    for i in range(3):
        F[i, i] += 1.0
    eigenvectors(E, N)
    for a in range(3):
        c[a] = 1.0 + 2.0 * E[a, a]
        for b in range(3):
            E[a, b] = 0.5 * np.log1p(2.0 * E[a, a]) if a == b else 0.0
    _rotate(ep, N, T)
    for a in range(3):
        for b in range(3):
            ep[a, b] = T[a, b]


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
    axes, e, y = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            flow[i, j] = 0.0
            for a in range(3):
                for b in range(3):
                    flow[i, j] += np.sqrt(1.5) * dp * N[i, a] * n[a, b] * N[j, b]
            y[i, j] = flow[i, j]
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
def _step(constants: Any, p: float, plane_stress: bool, wanted: bool, work: Any) -> Any:
    """Fill T and n, and D if it is wanted, of a trial strain E after (ep, p); return dp and the energy.

    In plane stress E_22, such that T_22 = 0, is filled in: T_22 grows with E_22, and the root stays between bounds.
    """
    E, D = work.E, work.D
    if not plane_stress:
        return _return(constants, p, wanted, work)
    K, G = constants.bulk, constants.shear
    E[2, 2] = -(K - 2.0 / 3.0 * G) / (K + 4.0 / 3.0 * G) * (E[0, 0] + E[1, 1])
    size = abs(E[0, 0]) + abs(E[1, 1]) + abs(E[0, 1])
    low, high = -np.inf, np.inf
    dp, energy = _return(constants, p, True, work)
    for _ in range(_STEPS):
        across = work.T[2, 2]
        step = across / D[2, 2, 2, 2]
        if across > 0.0:
            high = E[2, 2]
        else:
            low = E[2, 2]
        if abs(step) <= _CLOSE * (abs(E[2, 2]) + size):
            break
        x = E[2, 2] - step
        if not low < x < high:
            x = 0.5 * (low + high)
        if x == E[2, 2]:
            break
        E[2, 2] = x
        dp, energy = _return(constants, p, True, work)
    work.T[2, 2] = 0.0
    if wanted:
        _without_across(D)
    return dp, energy


@kernel
def _without_across(D: Any) -> None:
    """Eliminate E_22 from D (3, 3, 3, 3) by T_22 = 0."""
    row, stiff = np.empty((3, 3)), D[2, 2, 2, 2]
    for i in range(3):
        for j in range(3):
            row[i, j] = D[2, 2, i, j]
    for i in range(3):
        for j in range(3):
            for a in range(3):
                for b in range(3):
                    D[i, j, a, b] -= row[i, j] * row[a, b] / stiff


@kernel
def _return(constants: Any, p: float, wanted: bool, work: Any) -> Any:
    """Fill T and n of a trial strain E after (ep, p), and D if it is wanted; return dp and the energy per volume."""
    E, _, ep, T, n, D = work
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
