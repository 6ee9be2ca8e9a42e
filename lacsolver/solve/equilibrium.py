"""Equilibrium at one time: which macro-elements are in contact, at what pressure, and the displacement.

    K q = f - B^T p                                                    (26), (35)
    0 <= p_m, 0 <= G_m(q), p_m G_m = 0                                 (27), (29)

K, B and D do not change here; `newton` is for those that do. It is a semi-smooth Newton method on p_m - max(0, p_m -
c_m G_m / w_m) = 0 (32), (33): some rows are held closed, G_m = 0, the others are open, p_m = 0, and one linear system
gives the next q and p; closed rows that press stay closed, open ones that overlap are closed (which is the sign of
p_m - c_m G_m / w_m, whatever c_m). That is block principal pivoting (Portugal, Judice and Vicente 1994), kept finite by
Murty's rule, one change at a time and the first first, where whole exchanges do not get on. Systems are solved loosely
until a set comes back, then as exactly as numbers allow. What ends the loop is the defect of the conditions and of the
balance, not that the set stays.

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

#: what a loose solve leaves of the residual, and how many there are
_LOOSE, _LOOSE_SOLVES = 0.1, 12
#: exchanges of all rows that want it without fewer of them, before one row alone changes
_BLOCKS = 3
#: gaps are known to this much of the coordinates, and a row of forces to this much of what it sums
ROUNDING = 1e-14
#: a free motion is stopped by rows that move with it by this much of those that move most, and a load carried to it
_STOPPED = 1e-8


@dataclass(frozen=True, eq=False)
class Contact:
    """All rows of all zones at some place, a row each (m,): `rows` (B, D, w), `G` there, `paired`, `held` (equalities).

    `c` (m,): stress per length, see above. `stuck` (m,): rows that would be paired, and that no unknown moves: their
    gaps are what is prescribed.
    """

    rows: Rows
    G: NDArray[np.floating]
    paired: NDArray[np.bool_]
    held: NDArray[np.bool_]
    c: NDArray[np.floating]
    stuck: NDArray[np.bool_] | None = None

    @property
    def covered(self) -> NDArray[np.bool_]:
        """(m,): rows that face their master."""
        return self.paired if self.stuck is None else self.paired | self.stuck

    def next(self, active: NDArray[np.bool_], p: Floats) -> NDArray[np.bool_]:
        """(m,): the rows to close after a solve with `active` ones closed: those that press, and those that overlap."""
        return self.paired & (self.held | np.where(active, p > 0, self.G < 0))

    def at(self, G: Floats) -> Contact:
        """The same rows with other gaps."""
        return replace(self, G=G)

    def defects(self, p: Floats) -> NDArray[np.floating]:
        """(m,): how far p and G of each row are from the conditions, as a gap."""
        gap = np.where(self.paired, self.G / self.rows.w, 0.0)
        free = np.minimum(np.where(self.paired, p / self.c, 0.0), gap)
        return np.where(self.held, gap, free)

    def defect(self, p: Floats) -> float:
        """The largest of them, in size."""
        return float(np.abs(self.defects(p)).max(initial=0.0))


class Outcome(NamedTuple):
    """Where a search for equilibrium ended: `converged`, the iterate, its contact, the defects of each iteration.

    `defects`: (balance, gap) after each linear solve, relative. `products`: with K^-1. `settled`: the last so many
    solves were with one set.
    """

    converged: bool
    iterate: Iterate
    contact: Contact
    defects: tuple[tuple[float, float], ...]
    products: int
    settled: int = 0


@dataclass(frozen=True)
class Limits:
    """`tolerance` of both defects, `max_iterations`; `length`, of the coordinates that gaps are found from anew.

    It is 0 where gaps are linear: then they are known to rounding of the displacements alone. `moved`: how far what is
    prescribed moves, which gaps are compared with beside q.
    """

    tolerance: float
    max_iterations: int
    length: float
    moved: float = 0.0

    def size(self, q: Floats) -> float:
        """The length that gaps are compared with at q (n,)."""
        return max(float(np.abs(q).max(initial=0.0)), self.moved, ROUNDING * self.length, 1e-300)

    def allowed(self, q: Floats) -> float:
        """The gap that may be left at q (n,): the tolerance of that length, or rounding."""
        return max(self.tolerance * self.size(q), ROUNDING * max(self.size(q), self.length))

    def goal(self, reduction: float, moved: float) -> Goal:
        """How exactly to solve for gaps."""
        return Goal(reduction, 1e-3 * self.tolerance, 1e-4 * ROUNDING * self.length, moved)


class Terms(NamedTuple):
    """The sizes (n,) of what each force is summed from, and the diagonal K (n,), in whose scaling solves are exact."""

    size: Floats
    K: Floats

    def rounding(self) -> NDArray[np.floating]:
        """(n,): the force that rounding leaves of each sum, D^1/2 max |D^-1/2 size|."""
        scale = np.sqrt(np.where(self.K > 0, self.K, 1.0))
        return ROUNDING * float((self.size / scale).max(initial=0.0)) * scale


def balance(r: Floats, force: float, terms: Callable[[], Terms] | None, tolerance: float) -> float:
    """How far forces are off, relative to the largest `force`, or to what rounding leaves of the sums.

    r (n,): what is left of each sum of forces. `terms()`, None if sums are exact: what is summed, which is asked for
    only where the tolerance is not met.
    """
    off = np.abs(r) / max(force, 1e-300)
    if terms is not None and off.max(initial=0.0) > tolerance:
        off = np.abs(r) / np.maximum(force, terms().rounding() / tolerance)
    return float(off.max(initial=0.0))


#: contact at q
At = Callable[[Floats], Contact]
#: told of each iteration: number, closed rows, balance, gap
Told = Callable[[int, int, float, float], None]


def find_equilibrium(
    K: Stiffness,
    f: Floats,
    at: At,
    start: Iterate,
    limits: Limits,
    *,
    free: Floats | None = None,
    turning: csr_array | None = None,
    told: Told | None = None,
) -> Outcome:
    """Equilibrium under forces f (n,), from a guess, where rows are the same for all q and gaps linear.

    The stiffness is that of `K`, and `turning` (n, n) if there is some, on a few unknowns: what was added to K for
    motions of bodies that cost little energy. `free` (n, r): these and those that cost none, which `K` has as well.

    A set that stays after a loose solve is solved exactly in the same iteration: it goes on with the same system.
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
    R: Floats, contact: Contact, active: NDArray[np.bool_], f: Floats, resistance: Floats | None = None
) -> NDArray[np.bool_]:
    """(m,): a set, with rows added so that no body that is free, by motions R (n, r), moves along its load f (n,).

    Each is the row that is reached first as the body goes, if it is reached before the body comes to rest by itself:
    `resistance` (r, r), none by default, is the stiffness that turning forces give to the motions. A load that no row
    stops is left to what follows.
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
    """(r, k): an orthonormal basis of what A (m, r) does not see."""
    if not len(A):
        return np.eye(A.shape[1])
    _, size, V = np.linalg.svd(A)
    return np.asarray(V[(size > _STOPPED * size.max(initial=0.0)).sum() :].T)


class Pivots:
    """Which rows change places. Block principal pivoting, kept finite by Murty's rule.

    All rows that want to change do, as long as the number of them falls now and then; else one alone does, the first,
    until fewer want to than ever before. A set is solved loosely when it is met first, and a few times in all.
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
        """The next set, after a solve."""
        changes = np.flatnonzero(active != wanted)
        if not exact or not len(changes):
            return wanted
        self._loose = 0  # from here on numbers of changes are compared
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
    """How far the forces f - (K + turning) q - B^T p are from 0, see `balance`."""
    inner, pressing = K @ q + (0.0 if turning is None else turning @ q), rows.B_T @ p
    force = max(float(np.abs(v).max(initial=0.0)) for v in (f, inner, pressing))

    def terms() -> Terms:
        size = abs(K) @ np.abs(q) + (0.0 if turning is None else abs(turning) @ np.abs(q))
        return Terms(np.abs(f) + size + abs(rows.B_T) @ np.abs(p), K.diagonal())

    return balance(f - inner - pressing, force, terms, tolerance)


def stiffness_of_rows(K: Stiffness, rows: Rows) -> NDArray[np.floating]:
    """c (m,): w (b K b^T) / (b b^T)^2, stress per length; 1 where a row is zero or has no stiffness."""
    touched = rows.touched
    B = rows.B[:, touched]
    energy = np.asarray(((B @ K.K[touched][:, touched]).multiply(B)).sum(axis=1)).ravel()
    size = np.asarray(B.multiply(B).sum(axis=1)).ravel()
    with np.errstate(invalid="ignore", divide="ignore"):
        c = rows.w * energy / size**2
    return np.where(np.isfinite(c) & (c > 0), c, 1.0)


def at_start(contact: Contact, closed: NDArray[np.bool_]) -> Iterate:
    """The iterate of an undeformed body whose rows `closed` (m,) are in contact."""
    m, n = contact.rows.B.shape
    return Iterate(np.zeros(n), np.zeros(m), closed & contact.paired | contact.held & contact.paired)
