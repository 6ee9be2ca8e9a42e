"""Equilibrium at one time for a constant stiffness: active set, pressures and displacement.

    K q = f - B^T p                                                    (26), (35)
    0 <= p_m, 0 <= G_m(q), p_m G_m = 0                                 (27), (29)

K, B and D are constant here; `newton` is for those that change. This is a semi-smooth Newton method on p_m - max(0,
p_m - c_m G_m / w_m) = 0 (32), (33): some rows are held closed, G_m = 0, the others are open, p_m = 0, and one linear
system gives the next q and p; closed rows under pressure stay closed, open rows that overlap are closed (this is the
sign of p_m - c_m G_m / w_m, whatever c_m). It is block principal pivoting (Portugal, Judice and Vicente 1994), which is
made finite by Murty's rule, one exchange at a time, the first row first, where block exchanges make no progress.
Systems are solved inexactly until an active set is met again, then to round-off. The loop ends when the residuals of
the contact conditions and of the balance are small enough, and not because the set is unchanged.

c_m = w_m (b K b^T) / (b b^T)^2 with b the row of B: the stiffness of the macro-element's own skin, stress per length,
so that no constant depends on units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.results.state import Iterate
from lacsolver.solve.schur import Goal, Rows, solve_rows
from lacsolver.solve.stiffness import Stiffness

#: reduction of the residual in an inexact solve, and largest number of such solves
_LOOSE, _LOOSE_SOLVES = 0.1, 12
#: block exchanges allowed while the number of violated rows does not fall, before Murty's single exchange
_BLOCKS = 3
#: relative round-off of gaps, to the coordinates, and of forces, to the terms that they are summed from
ROUNDING = 1e-14
#: relative tolerance for the rank of the active rows on the rigid-body modes, and for the load left along them
_STOPPED = 1e-8


@dataclass(frozen=True, eq=False)
class ContactSystem:
    """Contact rows of all zones at some q, (m,): `rows` (B, D, w), `G` at q, `paired`, `held` (equalities).

    `c` (m,): stress per length, see above. `stuck` (m,): covered rows that no unknown moves, so that their gaps follow
    from prescribed displacements.
    """

    rows: Rows
    G: NDArray[np.floating]
    paired: NDArray[np.bool_]
    held: NDArray[np.bool_]
    c: NDArray[np.floating]
    stuck: NDArray[np.bool_] | None = None

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Mask (m,) of rows that are covered by their master, with or without unknowns."""
        return self.paired if self.stuck is None else self.paired | self.stuck

    def next(self, active: NDArray[np.bool_], p: Floats) -> NDArray[np.bool_]:
        """Return the next active set (m,) after a solve with `active`: rows under pressure, open rows that overlap."""
        return self.paired & (self.held | np.where(active, p > 0, self.G < 0))

    def at(self, G: Floats) -> ContactSystem:
        """Return these rows with other gap integrals G."""
        return replace(self, G=G)

    def defects(self, p: Floats) -> NDArray[np.floating]:
        """Return the residual (m,) of the contact conditions for p and G of each row, as a length."""
        gap = np.where(self.paired, self.G / self.rows.w, 0.0)
        free = np.minimum(np.where(self.paired, p / self.c, 0.0), gap)
        return np.where(self.held, gap, free)

    def defect(self, p: Floats) -> float:
        """Return the largest magnitude of `defects`."""
        return float(np.abs(self.defects(p)).max(initial=0.0))


class Outcome(NamedTuple):
    """Result of a search for equilibrium: `converged`, the last iterate, its contact rows, and residuals.

    `defects`: relative residuals (balance, gap) after each linear solve. `products`: number of applications of K^-1.
    `settled`: number of last solves with the same active set.
    """

    converged: bool
    iterate: Iterate
    contact: ContactSystem
    defects: tuple[tuple[float, float], ...]
    products: int
    settled: int = 0


@dataclass(frozen=True)
class Limits:
    """Convergence criteria: `tolerance` of both residuals, and `max_iterations`.

    `length`: size of the coordinates from which gaps are recomputed, whose round-off limits them; 0 if gaps are linear,
    with only the round-off of displacements. `moved`: largest prescribed displacement, part of the scale of gaps.
    """

    tolerance: float
    max_iterations: int
    length: float
    moved: float = 0.0

    def size(self, q: Floats) -> float:
        """Return the scale of gaps at q (n,), a length."""
        return max(float(np.abs(q).max(initial=0.0)), self.moved, ROUNDING * self.length, 1e-300)

    def allowed(self, q: Floats) -> float:
        """Return the gap that may remain at q (n,): the tolerance times the scale, or round-off."""
        return max(self.tolerance * self.size(q), ROUNDING * max(self.size(q), self.length))

    def goal(self, reduction: float, moved: float) -> Goal:
        """Return the tolerance of a linear solve, with a reduction and the scale `moved` of gaps."""
        return Goal(reduction, 1e-3 * self.tolerance, 1e-4 * ROUNDING * self.length, moved)


class ForceTerms(NamedTuple):
    """Sums (n,) of the magnitudes of each force's terms, and the diagonal K (n,), in whose scaling solves are exact."""

    size: Floats
    K: Floats

    def rounding(self) -> NDArray[np.floating]:
        """Return the round-off of each sum of forces (n,), ROUNDING D^1/2 max |D^-1/2 size|, with D the diagonal."""
        scale = np.sqrt(np.where(self.K > 0, self.K, 1.0))
        return ROUNDING * float((self.size / scale).max(initial=0.0)) * scale


def balance(r: Floats, force: float, terms: Callable[[], ForceTerms] | None, tolerance: float) -> float:
    """Return the residual of the force balance relative to the largest `force`, or to the round-off of the sums.

    r (n,): residual of each sum of forces. `terms()`: terms of the sums, computed only if the tolerance is not met;
    None if the sums are exact.
    """
    off = np.abs(r) / max(force, 1e-300)
    if terms is not None and off.max(initial=0.0) > tolerance:
        off = np.abs(r) / np.maximum(force, terms().rounding() / tolerance)
    return float(off.max(initial=0.0))


#: function for the contact rows at q
ContactOf = Callable[[Floats], ContactSystem]
#: callback for each iteration: number, closed rows, balance, gap
IterationCallback = Callable[[int, int, float, float], None]


def find_equilibrium(
    K: Stiffness,
    f: Floats,
    at: ContactOf,
    start: Iterate,
    limits: Limits,
    *,
    free: Floats | None = None,
    turning: csr_array | None = None,
    told: IterationCallback | None = None,
) -> Outcome:
    """Find the equilibrium under forces f (n,) from a start, for rows that are constant and gaps linear in q.

    The stiffness is `K` plus `turning` (n, n), if given, which acts on few unknowns: it removes the stabilisation added
    to K for rigid-body motions of little energy. `free` (n, r): these motions and those without energy, `K.R`, which is
    the default.

    If an inexact solve leaves the active set unchanged, the same system is solved to full accuracy in the same
    iteration.
    """
    stiffness = K.K if turning is None else csr_array(K.K + turning)
    free = K.R if free is None else free
    resistance = free.T @ (stiffness @ free)
    q, p, _ = start
    contact = at(q)
    active = start.active & contact.paired | contact.held & contact.paired
    p = np.where(active, p, 0.0)
    pivots = Pivots()
    defects: list[tuple[float, float]] = []
    products, last, settled = 0, None, 0
    for number in range(1, limits.max_iterations + 1):
        if free.shape[1]:
            active = stopped(free, contact, active, f - stiffness @ q, resistance)
        here = contact
        wanted = here.G + here.rows.D @ q
        for reduction in (pivots.begin(active), 0.0):
            goal, acting = limits.goal(reduction, limits.moved), f if turning is None else f - turning @ q
            made = solve_rows(K, here.rows, np.flatnonzero(active), acting, wanted, q, p, goal, turning)
            q, p, products = made.q, made.p, products + made.products
            contact = at(q)
            closed, defect = contact.next(active, p), contact.defect(p)
            if reduction == 0 or not np.array_equal(closed, active):
                break
        settled = settled + 1 if last is not None and np.array_equal(last, active) else 1
        off = _balance(K.K, turning, contact.rows, f, q, p, limits.tolerance)
        last, gap = active, defect / limits.size(q)
        defects.append((off, gap))
        if told is not None:
            told(number, int(active.sum()), off, gap)
        done = off <= limits.tolerance and defect <= limits.allowed(q)
        if done and reduction == 0:
            return Outcome(True, Iterate(q, p, active), contact, tuple(defects), products, settled)
        active = closed if done else pivots.next(active, closed, reduction == 0)
    return Outcome(False, Iterate(q, p, active), contact, tuple(defects), products, settled)


def stopped(
    R: Floats, contact: ContactSystem, active: NDArray[np.bool_], f: Floats, resistance: Floats | None = None
) -> NDArray[np.bool_]:
    """Return the active set (m,) with rows added until no rigid-body mode R (n, r) moves along its load f (n,).

    Each added row is the first that the moving body reaches, provided that it reaches it before it comes to rest by
    itself: `resistance` (r, r), none by default, is the stiffness along the modes from follower forces and the like. A
    load along a mode that no row constrains remains.
    """
    if not R.shape[1]:
        return active
    active, moves, carried, load = active.copy(), contact.rows.D @ R, contact.rows.B @ R, R.T @ f
    for _ in range(R.shape[1]):
        free, loaded = _null_space(moves[active]), _null_space(carried[active])
        along = free @ (free.T @ (loaded @ (loaded.T @ load)))
        closing = moves @ along
        nearing = contact.paired & ~active & (closing > _STOPPED * np.abs(closing).max(initial=0.0))
        if not nearing.any() or np.linalg.norm(along) <= _STOPPED * np.linalg.norm(load):
            break
        way = np.where(nearing, contact.G / np.where(nearing, closing, 1.0), np.inf)
        resisted = 0.0 if resistance is None else along @ resistance @ along
        if resisted > 0 and along @ load < resisted * way.min():
            break
        active[way.argmin()] = True
    return active


def _null_space(A: Floats) -> NDArray[np.floating]:
    """Return an orthonormal basis (r, k) of the null space of A (m, r)."""
    if not len(A):
        return np.eye(A.shape[1])
    _, size, V = np.linalg.svd(A)
    return np.asarray(V[(size > _STOPPED * size.max(initial=0.0)).sum() :].T)


class Pivots:
    """Update of the active set by block principal pivoting, made finite by Murty's rule.

    All violated rows are exchanged as long as their number falls within a few steps; otherwise only the first one is,
    until fewer rows than ever before are violated. A set is solved inexactly when it is met for the first time, and
    only a limited number of times in all.
    """

    def __init__(self) -> None:
        self._seen: set[bytes] = set()
        self._fewest, self._patience, self._loose = np.inf, _BLOCKS, _LOOSE_SOLVES

    def begin(self, active: NDArray[np.bool_]) -> float:
        """Take up a set; return the tolerance it is first solved to: 0 (exactly), or a loose one."""
        key = active.tobytes()
        loose = key not in self._seen and self._loose > 0
        self._seen.add(key)
        self._loose -= loose
        return _LOOSE if loose else 0.0

    def next(self, active: NDArray[np.bool_], wanted: NDArray[np.bool_], exact: bool) -> NDArray[np.bool_]:
        """Return the next active set after a solve that asks for the set `wanted`."""
        changes = np.flatnonzero(active != wanted)
        if not exact or not len(changes):
            return wanted
        self._loose = 0  # from here on the numbers of changes are compared, which needs exact solves
        if len(changes) < self._fewest:
            self._fewest, self._patience = len(changes), _BLOCKS
            return wanted
        if self._patience > 0:
            self._patience -= 1
            return wanted
        out = active.copy()
        out[changes[0]] = wanted[changes[0]]
        return out


def _balance(
    K: csr_array, turning: csr_array | None, rows: Rows, f: Floats, q: Floats, p: Floats, tolerance: float
) -> float:
    """Return the relative residual of the forces f - (K + turning) q - B^T p, see `balance`."""
    inner, pressing = K @ q + (0.0 if turning is None else turning @ q), rows.B_T @ p
    force = max(float(np.abs(v).max(initial=0.0)) for v in (f, inner, pressing))

    def terms() -> ForceTerms:
        size = abs(K) @ np.abs(q) + (0.0 if turning is None else abs(turning) @ np.abs(q))
        return ForceTerms(np.abs(f) + size + abs(rows.B_T) @ np.abs(p), K.diagonal())

    return balance(f - inner - pressing, force, terms, tolerance)


def stiffness_of_rows(K: Stiffness, rows: Rows) -> NDArray[np.floating]:
    """Return c (m,) = w (b K b^T) / (b b^T)^2, stress per length; 1 where a row is zero or has no stiffness."""
    touched = rows.touched
    B = rows.B[:, touched]
    energy = np.asarray(((B @ K.K[touched][:, touched]).multiply(B)).sum(axis=1)).ravel()
    size = np.asarray(B.multiply(B).sum(axis=1)).ravel()
    with np.errstate(invalid="ignore", divide="ignore"):
        c = rows.w * energy / size**2
    return np.where(np.isfinite(c) & (c > 0), c, 1.0)


def at_start(contact: ContactSystem, closed: NDArray[np.bool_]) -> Iterate:
    """Return the iterate of the undeformed bodies, with the rows `closed` (m,) in contact."""
    m, n = contact.rows.B.shape
    return Iterate(np.zeros(n), np.zeros(m), closed & contact.paired | contact.held & contact.paired)
