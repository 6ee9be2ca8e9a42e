"""Newton's method for equilibrium with a stiffness or contact that depends on the displacement.

At q, with the residual r of forces without contact, one linear system gives the next displacement and pressures:

    K dq + C(p) dq + B_A^T p = r,   D_A dq = G_A        C: geometric stiffness of contact, follower loads, rigid bodies

and the signs of p and G give the next active set, as in `equilibrium`. A step is shortened if it inverts cells, or if
its merit is worse than those of the last few iterations. The merit function is a force: the largest unbalanced force,
plus a fraction of the largest force that would close the remaining gaps, by c_m of each. An active set that is met
again although the merit has not fallen indicates a cycle: then the linear problem is kept, and its active set found by
block pivoting, which is finite, before anything is linearised again.

Linear systems are solved inexactly, to a fraction of the nonlinear residual, so that the last iterations converge
quadratically.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.bodies.finite import InadmissibleError
from lacsolver.linear import LinearError
from lacsolver.results.state import Iterate
from lacsolver.solve.equilibrium import (
    ContactSystem,
    ForceTerms,
    IterationCallback,
    Limits,
    Outcome,
    Pivots,
    balance,
    stopped,
)
from lacsolver.solve.schur import Goal, solve_rows
from lacsolver.solve.stiffness import Stiffness

#: step lengths that are tried, in this order
_PARTS = (1.0, 0.5, 0.25, 0.125, 0.0625)
#: number of last iterations whose largest merit a step may not exceed (non-monotone line search)
_REMEMBERED = 4
#: weight of gaps in the merit function: stiffness of the body behind a macro-element, as a fraction of its skin's
_BEHIND = 0.1
#: iterations without a new least merit after which a search is given up, in favour of a smaller time step
_PATIENCE = 10
#: relative tolerance of a linear solve: largest value, and factor on the nonlinear residual
_LOOSE, _PART = 1e-4, 0.1
#: largest number of active sets of one linear problem
_SETS = 20


@dataclass(frozen=True, eq=False)
class Place:
    """Linearisation at some q. `r` (n,): residual of forces without contact; `size`: the largest force.

    `terms()`: terms that the forces are summed from, for their round-off; None if forces are exact.
    `stiffness(drag, definite)`: returns K at q plus `drag` times that of the undeformed bodies, factorised; negative
    energies are accepted unless `definite`. `turning`: returns C (n, n) at pressures p (m,), None if there is none.
    `free` (n, k): rigid-body motions that only contact constrains.
    """

    r: NDArray[np.floating]
    size: float
    contact: ContactSystem
    stiffness: Callable[[float, bool], Stiffness]
    turning: Callable[[Floats], csr_array | None]
    free: NDArray[np.floating]
    terms: Callable[[], ForceTerms] | None = None


#: function for the linearisation at q; raises InadmissibleError
Linearize = Callable[[Floats], Place]


class _Defect(NamedTuple):
    """Residuals of a state: relative ones of forces and gaps, and the merit `whole`, which has both as one force."""

    balance: float
    gap: float
    whole: float


class _State(NamedTuple):
    q: NDArray[np.floating]
    p: NDArray[np.floating]
    place: Place
    defect: _Defect


def follow(
    at: Linearize,
    start: Iterate,
    limits: Limits,
    *,
    first: Place | None = None,
    exact: bool = False,
    drag: float = 0.0,
    told: IterationCallback | None = None,
) -> Outcome:
    """Find the equilibrium by Newton's method from a start. `first`: linearisation to use there, such as a prediction.

    `exact`: solve each linear system to round-off, which pays if one factor of K serves them all. `drag`: fraction of
    the undeformed bodies' stiffness that is added to K at first, and decreases with the residual: pseudo-transient
    continuation (Kelley and Keyes 1998), the motion of a body in a viscous medium, which reaches a distant equilibrium
    if there is none close by, and accepts residuals that grow on the way.

    Raises InadmissibleError if the start itself inverts cells.
    """
    place = at(start.q) if first is None else first
    active = place.contact.paired & (start.active | place.contact.held)
    scale, p = _Scale(limits, exact), np.where(active, start.p, 0.0)
    now = _State(start.q, p, place, scale.defect(place, start.q, p))
    sets, products, met, last, settled = _Sets(), 0, False, None, 0
    history = [np.inf if first is not None else now.defect.whole]  # the residual of a prediction is not comparable
    defects: list[tuple[float, float]] = []
    while not met and len(defects) < limits.max_iterations:
        cycles = sets.record(active, now.defect.whole) <= now.defect.whole  # it comes back, and nothing is better
        most = min(_SETS, limits.max_iterations - len(defects)) if cycles else 1
        part = drag * min(1.0, now.defect.whole / history[1]) if drag and len(history) > 1 else drag
        worst = np.inf if drag else max(history[-_REMEMBERED:])
        made = _solved(now, active, scale, part, most)
        then = None if made is None else _best(at, now, made, scale, worst)
        if made is None or then is None:
            defects.append((now.defect.balance, now.defect.gap))
            break
        defects += [(now.defect.balance, now.defect.gap)] * (made.solves - 1)
        defects.append((then.defect.balance, then.defect.gap))
        now, active, products, met = then, made.active, products + made.products, scale.met(then)
        same = made.solves == 1 and last is not None and np.array_equal(last, active)
        last, settled = active, settled + 1 if same else 1
        if told is not None:
            told(len(defects), int(active.sum()), *defects[-1])
        history.append(now.defect.whole)
        if not drag and min(history[-_PATIENCE:]) > min(history[:-_PATIENCE], default=np.inf):
            break
        active = active if met else now.place.contact.next(active, now.p)
    return Outcome(met, Iterate(now.q, now.p, active), now.place.contact, tuple(defects), products, settled)


class _Made(NamedTuple):
    """Step of a linear problem: dq, pressures, its active set, number of sets solved, and of applications of K^-1."""

    dq: NDArray[np.floating]
    p: NDArray[np.floating]
    active: NDArray[np.bool_]
    solves: int
    products: int


def _solved(now: _State, active: NDArray[np.bool_], scale: _Scale, drag: float, most: int) -> _Made | None:
    """Return the step from a state; None if the tangent is singular, or the system cannot be solved."""
    for definite in (True, False):  # an iterative backend finds out late that the tangent is not positive definite
        with suppress(LinearError):
            K = now.place.stiffness(drag, definite)
            turning = now.place.turning(now.p)
            return _settled(K, now, turning, _stopped(K, now, turning, active), scale, most)
    return None


def _stopped(K: Stiffness, now: _State, turning: csr_array | None, active: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the active set with rows added until no rigid-body mode moves along its load, see `stopped`."""
    R = now.place.free
    resistance = R.T @ (K.K @ R if turning is None else K.K @ R + turning @ R)
    return stopped(R, now.place.contact, active, now.place.r, resistance)


def _settled(
    K: Stiffness, now: _State, turning: csr_array | None, active: NDArray[np.bool_], scale: _Scale, most: int
) -> _Made:
    """Solve the linear problem with `active`, and update the set until it is consistent, in at most `most` solves."""
    place, contact, goal, pivots, products, p = now.place, now.place.contact, scale.goal(now), Pivots(), 0, now.p
    for count in range(1, most + 1):
        start = np.zeros_like(now.q)
        made = solve_rows(K, contact.rows, np.flatnonzero(active), place.r, contact.G, start, p, goal, turning)
        p, products = made.p, products + made.products
        closed = contact.at(contact.G - contact.rows.D @ made.q).next(active, p)
        if count == most or np.array_equal(closed, active):
            break
        active = pivots.next(active, closed, exact=True)
    return _Made(made.q, p, active, count, products)


def _best(at: Linearize, now: _State, made: _Made, scale: _Scale, worst: float) -> _State | None:
    """Backtracking line search: return the first state whose merit is at most `worst`, else the best one.

    None if all step lengths invert a cell.
    """
    best = None
    for part in _PARTS:
        q, p = now.q + part * made.dq, now.p + part * (made.p - now.p)
        try:
            place = at(q)
        except InadmissibleError:
            continue
        then = _State(q, p, place, scale.defect(place, q, p))
        if best is None or then.defect.whole < best.defect.whole:
            best = then
        if then.defect.whole <= worst:
            break
    return best


class _Sets:
    """The active sets that were solved, with the merit at each."""

    def __init__(self) -> None:
        self._met: dict[bytes, float] = {}
        self._last = b""

    def record(self, active: NDArray[np.bool_], defect: float) -> float:
        """Record a set and its defect; return what the defect was when it was left for another one, inf if never."""
        key = active.tobytes()
        before = self._met.get(key, np.inf) if key != self._last else np.inf
        self._met[key], self._last = defect, key
        return before


class _Scale:
    """Scales of forces and gaps, for residuals and tolerances."""

    def __init__(self, limits: Limits, exact: bool) -> None:
        self.limits, self._exact = limits, exact

    def defect(self, place: Place, q: Floats, p: Floats) -> _Defect:
        """Return the residuals of forces and gaps."""
        pressing = place.contact.rows.B_T @ p
        force = max(place.size, float(np.abs(pressing).max(initial=0.0)))
        off, off_by = place.r - pressing, place.contact.defects(p)
        closing = place.contact.rows.B_T @ (place.contact.c * off_by)
        gap = float(np.abs(off_by).max(initial=0.0)) / self.limits.size(q)
        whole = float(np.abs(off).max(initial=0.0)) + _BEHIND * float(np.abs(closing).max(initial=0.0))
        return _Defect(balance(off, force, place.terms, self.limits.tolerance), gap, whole)

    def met(self, now: _State) -> bool:
        """True if a state is an equilibrium, to the tolerance or to the round-off of coordinates."""
        limits = self.limits
        return now.defect.balance <= limits.tolerance and now.defect.gap <= limits.allowed(now.q) / limits.size(now.q)

    def goal(self, now: _State) -> Goal:
        """Return the tolerance of the linear solve at a state."""
        reduction = 0.0 if self._exact else min(_LOOSE, _PART * max(now.defect.balance, now.defect.gap))
        return self.limits.goal(reduction, self.limits.size(now.q))
