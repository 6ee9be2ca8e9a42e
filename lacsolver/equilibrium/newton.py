"""Newton's method for equilibrium with a stiffness or contact that depends on the displacement.

At q, with the residual r of forces without contact, one linear system gives the next displacement and pressures:

    K dq + C(p) dq + B_A^T p = r,   D_A dq = G_A        C: geometric stiffness of contact, follower loads, rigid bodies,
                                                           and the change of K since it was factorised

and the signs of p and G give the next active set, as in `active_set`. A step is shortened if it inverts cells, or if
its merit is worse than those of the last few iterations. The merit function is a force: the largest unbalanced force,
plus a fraction of the largest force that would close the remaining gaps, by c_m of each. An active set that is met
again although the merit has not fallen indicates a cycle: then the linear problem is kept, and its active set found by
block pivoting, which is finite, before anything is linearised again. With friction pivoting may cycle too, and then
`splitting` finds the set; from the first cycle on, and where a search makes no progress, every linear problem is solved
whole, and its step is taken in full: the merit may rise then for an iteration or two.

Linear systems are solved inexactly, to a fraction of the nonlinear residual, so that the last iterations converge
quadratically; the last one, whose step should reach the tolerance, to a small part of that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.equilibrium.active_set import (
    BLOCKS_OF_NEWTON,
    LOOSE_WITH_SPRINGS,
    Pivots,
    close_rows_against_rigid_modes,
    stiffness_along,
)
from lacsolver.equilibrium.search import Trial
from lacsolver.equilibrium.splitting import split
from lacsolver.equilibrium.state import Iterate
from lacsolver.linear import LinearError
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.operator import Operator
from lacsolver.saddle.row_set import OUT, RowSet
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import ConvergenceTolerance, LinearTolerance, Residual, equilibrium_residual

if TYPE_CHECKING:
    from lacsolver.equilibrium.load_step import Linearization

#: step lengths that are tried, in this order
_STEP_LENGTHS = (1.0, 0.5, 0.25, 0.125, 0.0625)
#: number of last iterations whose largest merit a step may not exceed (non-monotone line search)
_WINDOW = 4
#: reduction of the least merit in so many iterations below which a step may not increase the merit
_SLOW = 0.8
#: reduction of the merit in so many iterations, each with another set, above which the linear problem's set is found
_WANDERS = 0.1
#: weight of gaps in the merit function: stiffness of the body behind a macro-element, as a fraction of its skin's
_GAP_WEIGHT = 0.1
#: a search that does not make its least merit so much smaller in so many iterations is given up, in favour of a
#: smaller time step
_PROGRESS, _PATIENCE = 0.1, 10
#: with damping the merit may rise, as a body snaps through; but a search in which it falls and rises again so often
#: without a new least one goes in circles
_RISES = 3


class _Forcing(NamedTuple):
    """Tolerance of linear solves: `most` of the right-hand side, and `part` of it over the nonlinear residual.

    As the residual falls, so does the tolerance (Eisenstat, Walker 1996).
    """

    most: float
    part: float


#: with a factor for each stiffness; with one factor for all, where solves are most of the cost; and that with friction
_TIGHT, _OF_CONSTANT, _WITH_FRICTION = _Forcing(1e-4, 0.03), _Forcing(0.2, 0.1), _Forcing(1e-3, 0.03)
#: residual, relative to the tolerance, to which the linear system of a step that is to be the last is solved
_LAST = 1e-4
#: merit with which a set comes back, over that with which it was left, above which it is one of a cycle
_BETTER = 0.5
#: largest number of active sets of one linear problem; with friction, where no proof says that pivoting ends
_MAX_SETS, _MAX_SETS_WITH_FRICTION = 100, 6


#: function for the linearisation at q; raises InadmissibleError
Linearize = Callable[[Floats], "Linearization"]


def newton_iterates(
    linearize: Linearize,
    start: Iterate,
    tolerance: ConvergenceTolerance,
    *,
    predictor: Linearization | None = None,
    damping: float = 0.0,
    constant: bool = False,
) -> Iterator[Trial]:
    """Yield the trials of Newton's method from a start; it ends where no step helps, or too many in a row did not.

    `predictor`: linearisation to use at the start, whose residual is not comparable with others. `damping`: artificial
    viscous damping for a distant equilibrium, as a fraction of the undeformed bodies' stiffness, see `_damping_of`; no
    line search is made then, and residuals may grow on the way. `constant`: True if K does not depend on q.

    Raises InadmissibleError if the start itself inverts cells.
    """
    there = linearize(start.q) if predictor is None else predictor
    forcing = (_WITH_FRICTION if there.contact.sheared else _OF_CONSTANT) if constant else _TIGHT
    now, rows = _start(there, start, tolerance)
    sets, merits, spent, whole = _Sets(), [np.inf if predictor is not None else now.residual.merit], 0, False
    wanders, vain = False, False
    while True:
        again = _BETTER * sets.record(rows, now.residual.merit) <= now.residual.merit  # it comes back, hardly better
        if again and there.contact.sheared and not whole:
            whole, merits = True, merits if damping else [np.inf]
        wanders = not (vain or there.contact.sheared) and (wanders or sets.wander(merits))
        most = _MAX_SETS_WITH_FRICTION if there.contact.sheared else _MAX_SETS
        limit = most if again or whole or wanders else 1
        reduction = 0.0 if there.contact.exact else _reduction(now.residual, forcing, tolerance.tolerance)
        reduction = min(reduction, LOOSE_WITH_SPRINGS) if wanders else reduction
        goal = tolerance.linear(reduction, tolerance.of_rows(there.contact.rows.B, now.iterate.q))
        first = predictor is not None and spent == 0 and bool(there.contact.sheared)
        step = _newton_step(there, now.iterate.p, rows, goal, _damping_of(damping, merits), limit, first)
        worst = np.inf if damping or whole else _acceptable(merits)
        then = None if step is None else _line_search(linearize, now.iterate, step, tolerance, worst)
        if step is None or then is None:
            yield now._replace(iterate=now.iterate._replace(active=rows.active), exact=False, applications=0, solves=1)
            return
        now, there = then
        spent += now.solves
        vain = vain or step.solves >= _MAX_SETS  # the set of a linear problem is not found
        yield now
        merits.append(now.residual.merit)
        if _circling(merits) if damping else _hopeless(merits):
            if damping or whole or not there.contact.sheared:
                return
            whole, merits = True, [np.inf]
        contact, (q, p, _) = there.contact, now.iterate
        rows = contact.next_rows(step.rows, p, tolerance.gaps(contact.rows.B, q))


def _start(there: Linearization, start: Iterate, tolerance: ConvergenceTolerance) -> tuple[Trial, RowSet]:
    """Return the trial to start from, without pressures on rows that are open, and its row set."""
    rows = there.contact.first_rows(start.active, start.p)
    start = Iterate(start.q, np.where(rows.state, start.p, 0.0), rows.active)
    return Trial(start, there.contact, residual_of(there, start, tolerance)), rows


def _reduction(residual: Residual, forcing: _Forcing, tolerance: float) -> float:
    """Return the reduction that a linear solve is worth at a state; a step to below the tolerance is nearly exact."""
    worst = max(residual.balance, residual.gap)
    reduction = min(forcing.most, forcing.part * worst)
    return reduction if reduction * worst > tolerance else min(forcing.most, _LAST * tolerance / max(worst, tolerance))


def _damping_of(start: float, merits: list[float]) -> float:
    """Return the damping of the next step, after steps with these merits; the first is that of the start.

    Pseudo-transient continuation (Kelley and Keyes 1998), the motion of a body in a viscous medium: `start` at first,
    it decreases with the residual.
    """
    return start if len(merits) < 2 else start * min(1.0, merits[-1] / merits[1])


class _Step(NamedTuple):
    """Step dq of a linear problem, with its pressures and row set; numbers of sets and applications of K^-1."""

    dq: NDArray[np.floating]
    p: NDArray[np.floating]
    rows: RowSet
    solves: int
    applications: int

    def part(self, before: _Step, part: float) -> _Step:
        """Return the step at a part of the way from one before."""
        if part == 1:
            return self
        return self._replace(dq=before.dq + part * (self.dq - before.dq), p=before.p + part * (self.p - before.p))


def _newton_step(
    there: Linearization, p: Floats, rows: RowSet, goal: LinearTolerance, damping: float, limit: int, first: bool
) -> _Step | None:  # fmt: skip
    """Return the step of a linear problem, whose row set is updated until it is consistent, in `limit` solves.

    p (m,): pressures of the geometric stiffness. `first`: True for the first step from a predictor, see `_let_go`.
    None if the tangent is singular, or the system cannot be solved.
    """
    contact = there.contact
    for definite in (True, False):  # an iterative backend finds out late that the tangent is not positive definite
        with suppress(LinearError):
            K = there.stiffness(damping, definite)
            C = _total(there.geometric_stiffness(p), there.change(K))
            R = there.modes(K)
            resistance, load = _resistance(there, K, R, rows, p), K.vectors.dots(R.T, there.r)
            step, pivots = _Step(np.zeros_like(there.r), p, rows, 0, 0), Pivots(contact, blocks=BLOCKS_OF_NEWTON)
            while True:
                now = close_rows_against_rigid_modes(R, contact, step.rows, p, load, resistance).same(K.vectors.same)
                before = step._replace(rows=now)
                step = _solved(there, pivots.softened(contact), K, C, before, there.r, goal)
                if limit == 1 and not first:
                    return step
                then, after = (contact.with_gaps(contact.G - contact.rows.D @ one.dq) for one in (before, step))
                part, wanted = pivots.wanted(step.rows, then, before.p, after, step.p, goal.threshold(0.0))
                if first and (let_go := _let_go(there, p, step, wanted)) is not None:
                    rows, held = let_go
                    r = there.r - contact.rows.B_T @ held
                    alone = _solved(there, contact, K, C, step._replace(rows=rows), r, goal)
                    return alone._replace(p=alone.p + held, rows=wanted)
                step = step.part(before, part)
                if not pivots.springs and wanted.equals(step.rows):
                    return step
                if step.solves >= limit and pivots.springs:
                    return _solved(there, contact, K, C, step._replace(rows=wanted), there.r, goal)
                if step.solves >= limit:
                    found = None if limit == 1 or not contact.sheared else _split(there, K, step, wanted)
                    if found is None:
                        return step
                    C = _total(there.geometric_stiffness(found[0]), there.change(K))
                    return _solved(there, contact, K, C, step._replace(p=found[0], rows=found[1]), there.r, goal)
                following = pivots.next(step.rows, wanted, True, step.p, K.vectors.largest(step.dq))
                if following is None:
                    return step
                step = step._replace(rows=following)
    return None


def _resistance(there: Linearization, K: Operator, R: Floats, rows: RowSet, p: Floats) -> NDArray[np.floating]:
    """Return the stiffness (r, r) along modes R (n, r), under pressures p (m,).

    Of these those count that stay, in compression: the others are of a set that is left.
    """
    if not R.shape[1]:
        return np.zeros((0, 0))
    stays = there.contact.lawful(np.where(rows.state != OUT, p, 0.0))
    return stiffness_along(K, R, _total(there.geometric_stiffness(stays), there.change(K)))


def _split(there: Linearization, K: Operator, step: _Step, wanted: RowSet) -> tuple[Floats, RowSet] | None:
    """Return pressures and the row set of a linear problem with friction for which pivoting found none, or None."""
    rows = (step.rows.state != OUT) | (wanted.state != OUT)
    return split(K, there.r, there.contact, there.free, rows)


def _solved(
    there: Linearization, contact: ContactSystem, K: Operator, C: csr_array | None, before: _Step, r: Floats,
    goal: LinearTolerance,
) -> _Step:  # fmt: skip
    """Return the step with the row set and from the pressures of one before, under the unbalanced forces r (n_q,)."""
    linear = contact.linear(before.rows, before.p)
    h = linear.load(r, contact.rows.B_T)
    problem = SaddleProblem(K, linear.rows, linear.active, h, linear.G, linear.S, C)
    dq, p, more, _ = solve_saddle(problem, np.zeros_like(h), linear.reduced(before.p), goal)
    return _Step(dq, linear.full(p), before.rows, before.solves + 1, before.applications + more)


def _let_go(there: Linearization, p: Floats, step: _Step, wanted: RowSet) -> tuple[RowSet, Floats] | None:
    """Return rows for a first step with skins let go, and the contact forces p (m,) that act on them instead; or None.

    It is for a first step in which most of what stuck under pressures p (m,) would slide: the rows of one configuration
    say little about skins that slide over several faces. Bodies then go where they are moved to under the contact
    forces of before, and meet there. Not where only contact holds them.
    """
    tractions = None if there.free.shape[1] else there.contact.sliding_tractions(p, step.rows, wanted)
    if tractions is None:
        return None
    rows = there.contact.first_rows(np.zeros(len(p), bool), np.zeros_like(p))  # those that are always closed
    return rows, np.where(rows.state, 0.0, tractions)


def _total(A: csr_array | None, B: csr_array | None) -> csr_array | None:
    """Return A + B, where None stands for no entries."""
    return B if A is None else A if B is None else csr_array(A + B)


def _acceptable(merits: list[float]) -> float:
    """Return the merit that a step may have: the largest of the last few, or the last one where they go to and fro."""
    slow = min(merits[-_WINDOW:]) > _SLOW * min(merits[:-_WINDOW], default=np.inf)
    return merits[-1] if slow else max(merits[-_WINDOW:])


def _hopeless(merits: list[float]) -> bool:
    """Return True if the least merit has not become clearly less in the last iterations."""
    return min(merits[-_PATIENCE:]) > _PROGRESS * min(merits[:-_PATIENCE], default=np.inf)


def _circling(merits: list[float]) -> bool:
    """Return True if the merits fall and rise again and again without a new least one.

    >>> _circling([9.0, 1.0, 5.0, 50.0, 500.0, 30.0, 3.0]), _circling([9.0, 1.0, 5.0, 2.0, 6.0, 2.0, 5.0, 3.0, 4.0])
    (False, True)
    """
    since = np.array(merits[int(np.argmin(merits)) :])
    falls = np.diff(since) < 0
    return bool((falls[:-1] & ~falls[1:]).sum() >= _RISES)


def _line_search(
    linearize: Linearize, now: Iterate, step: _Step, tolerance: ConvergenceTolerance, worst: float
) -> tuple[Trial, Linearization] | None:
    """Backtracking line search: return the first state whose merit is at most `worst`, else the best one.

    None if all step lengths invert a cell.
    """
    best = None
    for length in _STEP_LENGTHS:
        iterate = Iterate(now.q + length * step.dq, now.p + length * (step.p - now.p), step.rows.active)
        try:
            there = linearize(iterate.q)
        except InadmissibleError:
            continue
        residual = residual_of(there, iterate, tolerance)
        if best is None or residual.merit < best[0].residual.merit:
            trial = Trial(iterate, there.contact, residual, step.applications, solves=step.solves)
            best = trial, there
        if residual.merit <= worst:
            break
    return best


class _Sets:
    """The row sets that were solved, with the merit at each."""

    def __init__(self) -> None:
        self._merit: dict[bytes, float] = {}
        self._last = b""
        self._changes = 0

    def record(self, rows: RowSet, merit: float) -> float:
        """Record a set and its merit; return what the merit was when it was left for another one, inf if never."""
        key = rows.state.tobytes()
        before = self._merit.get(key, np.inf) if key != self._last else np.inf
        self._changes = self._changes + 1 if key != self._last else 0
        self._merit[key], self._last = merit, key
        return before

    def wander(self, merits: list[float]) -> bool:
        """Return True if each of the last few steps changed the set, and their merits hardly fell."""
        return self._changes > _WINDOW and min(merits[-_WINDOW:]) > _WANDERS * max(merits[-_WINDOW:])


def residual_of(there: Linearization, at: Iterate, tolerance: ConvergenceTolerance) -> Residual:
    """Return the residuals of forces and gaps of an iterate."""
    contact, vectors = there.contact, tolerance.vectors
    forces = contact.rows.B_T @ at.p
    largest = np.maximum(there.size, vectors.largest_of_body(forces))
    off, gaps = there.r - forces, contact.residuals(at.p, at.active)
    closing = contact.rows.B_T @ (contact.skin_stiffness * gaps)
    merit = vectors.largest(off) + _GAP_WEIGHT * vectors.largest(closing)
    gap = tolerance.relative_gap(gaps, contact.rows.B, at.q)
    balance, relative = equilibrium_residual(off, largest, there.terms, tolerance, at.q)
    return Residual(balance, gap, merit, relative)
