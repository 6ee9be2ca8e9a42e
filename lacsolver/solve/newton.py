"""Equilibrium where stiffness or contact change with the displacement: Newton's method on forces, gaps and set at once.

At q, with forces r that nothing but contact balances, one linear system gives the next displacement and pressures:

    K dq + C(p) dq + B_A^T p = r,   D_A dq = G_A              C: how contact, followers, rigid bodies turn forces

and the set of closed rows follows its signs, as in `equilibrium`. A step that leaves forces and gaps worse than they
were in the last few, or turns cells inside out, is taken in part: the largest force out of balance, and a part of the
largest that it takes to close the gaps that should be, by c_m of each, make one number without a unit to choose. Sets
that come back without that number having fallen are a cycle: then the linear problem is held, and its set found by
block pivoting, which ends, before anything is linearised again.

Systems are solved as exactly as the state is worth: to a part of what forces and gaps are off, so that the last
iterations converge quadratically.
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
from lacsolver.solve.equilibrium import Contact, Limits, Outcome, Pivots, Terms, Told, balance, stopped
from lacsolver.solve.schur import Goal, solve_rows
from lacsolver.solve.stiffness import Stiffness

#: parts of a step that are tried, one after the other
_PARTS = (1.0, 0.5, 0.25, 0.125, 0.0625)
#: a step may leave things no worse than they were in the worst of so many
_REMEMBERED = 4
#: stiffness of what is behind a macro-element's own skin, of that skin's: what a gap counts for among forces
_BEHIND = 0.1
#: steps without a new least defect after which a search is given up: a smaller step in time does better
_PATIENCE = 10
#: what a solve leaves of the residual: at most, and of the defect
_LOOSE, _PART = 1e-4, 0.1
#: a held linear problem is given up after so many sets
_SETS = 20


@dataclass(frozen=True, eq=False)
class Place:
    """Bodies and contact at some q. `r` (n,): forces that nothing balances but contact; `size`: the largest there is.

    `terms()`, None if forces are exact: what they are summed from, which rounding goes with.
    `stiffness(drag, definite)`: makes K there, with a part of the undeformed bodies' added, factorised; where it need
    not be `definite`, with no notice of negative energies. `turning`: makes C (n, n) at pressures p (m,), None where
    there is none. `free` (n, k): motions of whole bodies that nothing but contact stops.
    """

    r: NDArray[np.floating]
    size: float
    contact: Contact
    stiffness: Callable[[float, bool], Stiffness]
    turning: Callable[[Floats], csr_array | None]
    free: NDArray[np.floating]
    terms: Callable[[], Terms] | None = None


#: the place at q; raises InadmissibleError
At = Callable[[Floats], Place]


class _Defect(NamedTuple):
    """How far a state is from equilibrium: forces and gaps, relative; `whole`: both as one force."""

    balance: float
    gap: float
    whole: float


class _State(NamedTuple):
    q: NDArray[np.floating]
    p: NDArray[np.floating]
    place: Place
    defect: _Defect


def follow(
    at: At,
    start: Iterate,
    limits: Limits,
    *,
    first: Place | None = None,
    exact: bool = False,
    drag: float = 0.0,
    told: Told | None = None,
) -> Outcome:
    """Equilibrium from a guess. `first`: what to take for the place there, for instance foreseen from another one.

    `exact`: solve each system as exactly as numbers allow, which is worth it where one factor of K serves them all.
    `drag`: of the undeformed bodies' stiffness, added to K at first, and less as the defect falls: pseudo-transient
    continuation (Kelley and Keyes 1998), the way of a body in a viscous medium, which goes on to another equilibrium
    where there is none near by, and takes no notice of forces that grow on the way.

    Raises InadmissibleError where the guess itself turns cells inside out.
    """
    place = at(start.q) if first is None else first
    active = place.contact.paired & (start.active | place.contact.held)
    scale, p = _Scale(limits, exact), np.where(active, start.p, 0.0)
    now = _State(start.q, p, place, scale.defect(place, start.q, p))
    sets, products, met, last, settled = _Sets(), 0, False, None, 0
    history = [np.inf if first is not None else now.defect.whole]  # what is foreseen has defects of its own
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
    """The step of a linear problem: dq, pressures, its set, how many sets were solved, and products with K^-1."""

    dq: NDArray[np.floating]
    p: NDArray[np.floating]
    active: NDArray[np.bool_]
    solves: int
    products: int


def _solved(now: _State, active: NDArray[np.bool_], scale: _Scale, drag: float, most: int) -> _Made | None:
    """The step from a state; None where the tangent is singular, or the system cannot be solved."""
    for definite in (True, False):  # an iterative backend finds out late that the tangent is not positive definite
        with suppress(LinearError):
            K = now.place.stiffness(drag, definite)
            turning = now.place.turning(now.p)
            return _settled(K, now, turning, _stopped(K, now, turning, active), scale, most)
    return None


def _stopped(K: Stiffness, now: _State, turning: csr_array | None, active: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A set, with rows added so that no free body moves along its load farther than to where it comes to rest."""
    R = now.place.free
    resistance = R.T @ (K.K @ R if turning is None else K.K @ R + turning @ R)
    return stopped(R, now.place.contact, active, now.place.r, resistance)


def _settled(
    K: Stiffness, now: _State, turning: csr_array | None, active: NDArray[np.bool_], scale: _Scale, most: int
) -> _Made:
    """One solve with `active`, or as many as it takes, up to `most`, to find the set that goes with the step."""
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


def _best(at: At, now: _State, made: _Made, scale: _Scale, worst: float) -> _State | None:
    """The first part of a step that leaves things no worse than `worst`, else the best; None if none is admissible."""
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
    """The sets that were solved, and how far off things were then."""

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
    """What forces and gaps are compared with."""

    def __init__(self, limits: Limits, exact: bool) -> None:
        self.limits, self._exact = limits, exact

    def defect(self, place: Place, q: Floats, p: Floats) -> _Defect:
        """How far forces and gaps are off."""
        pressing = place.contact.rows.B_T @ p
        force = max(place.size, float(np.abs(pressing).max(initial=0.0)))
        off, off_by = place.r - pressing, place.contact.defects(p)
        closing = place.contact.rows.B_T @ (place.contact.c * off_by)
        gap = float(np.abs(off_by).max(initial=0.0)) / self.limits.size(q)
        whole = float(np.abs(off).max(initial=0.0)) + _BEHIND * float(np.abs(closing).max(initial=0.0))
        return _Defect(balance(off, force, place.terms, self.limits.tolerance), gap, whole)

    def met(self, now: _State) -> bool:
        """Whether a state is an equilibrium, to the tolerance or to rounding of coordinates."""
        limits = self.limits
        return now.defect.balance <= limits.tolerance and now.defect.gap <= limits.allowed(now.q) / limits.size(now.q)

    def goal(self, now: _State) -> Goal:
        """How exactly to solve at a state."""
        reduction = 0.0 if self._exact else min(_LOOSE, _PART * max(now.defect.balance, now.defect.gap))
        return self.limits.goal(reduction, self.limits.size(now.q))
