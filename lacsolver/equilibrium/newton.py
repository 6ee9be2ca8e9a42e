"""Newton's method for equilibrium with a stiffness or contact that depends on the displacement.

At q, with the residual r of forces without contact, one linear system gives the next displacement and pressures:

    K dq + C(p) dq + B_A^T p = r,   D_A dq = G_A        C: geometric stiffness of contact, follower loads, rigid bodies

and the signs of p and G give the next active set, as in `active_set`. A step is shortened if it inverts cells, or if
its merit is worse than those of the last few iterations. The merit function is a force: the largest unbalanced force,
plus a fraction of the largest force that would close the remaining gaps, by c_m of each. An active set that is met
again although the merit has not fallen indicates a cycle: then the linear problem is kept, and its active set found by
block pivoting, which is finite, before anything is linearised again.

Linear systems are solved inexactly, to a fraction of the nonlinear residual, so that the last iterations converge
quadratically.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.bodies.finite import InadmissibleError
from lacsolver.contact.laws import Bools
from lacsolver.equilibrium.active_set import close_rows_against_rigid_modes, solve_set
from lacsolver.equilibrium.search import Trial
from lacsolver.linear import LinearError
from lacsolver.linear.vectors import products
from lacsolver.results.state import Iterate
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.operator import Operator, product
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.tolerances import ConvergenceTolerance, ForceTerms, Residual, balance

#: step lengths that are tried, in this order
_STEP_LENGTHS = (1.0, 0.5, 0.25, 0.125, 0.0625)
#: number of last iterations whose largest merit a step may not exceed (non-monotone line search)
_WINDOW = 4
#: reduction of the least merit in so many iterations below which a step may not increase the merit
_SLOW = 0.8
#: weight of gaps in the merit function: stiffness of the body behind a macro-element, as a fraction of its skin's
_GAP_WEIGHT = 0.1
#: a search that does not make its least merit so much smaller in so many iterations is given up, in favour of a
#: smaller time step
_PROGRESS, _PATIENCE = 0.1, 10
#: with damping the merit may rise, as a body snaps through; but a search in which it falls and rises again so often
#: without a new least one goes in circles
_RISES = 3
#: relative tolerance of a linear solve: largest value, and factor on the nonlinear residual
_LOOSE, _FACTOR = 1e-4, 0.1
#: largest number of active sets of one linear problem
_MAX_SETS = 20


@dataclass(frozen=True, eq=False)
class Linearization:
    """Forces and contact at some q, and their derivatives, which are computed when they are asked for.

    `r` (n,): residual of forces without contact; `size`: the largest force. `terms()`: terms that the forces are summed
    from, for their round-off; None if forces are exact. `stiffness(damping, definite)`: returns K at q plus `damping`
    times that of the undeformed bodies, factorised; negative energies are accepted unless `definite`.
    `geometric_stiffness`: returns C (n, n) at pressures p (m,), None if there is none. `free` (n, k): rigid-body modes
    that only contact constrains.
    """

    r: NDArray[np.floating]
    size: float
    contact: ContactSystem
    stiffness: Callable[[float, bool], Operator]
    geometric_stiffness: Callable[[Floats], csr_array | None]
    free: NDArray[np.floating]
    terms: Callable[[], ForceTerms] | None = None


#: function for the linearisation at q; raises InadmissibleError
Linearize = Callable[[Floats], Linearization]


class _State(NamedTuple):
    q: NDArray[np.floating]
    p: NDArray[np.floating]
    active: Bools
    there: Linearization
    residual: Residual


class Damping:
    """Artificial viscous damping: pseudo-transient continuation (Kelley and Keyes 1998), for a distant equilibrium.

    A fraction of the undeformed bodies' stiffness, `start` at first, is added to K, and decreases with the residual:
    the motion of a body in a viscous medium. Residuals may grow on the way.
    """

    def __init__(self, start: float) -> None:
        self._start, self._first = start, np.nan

    def fraction(self, merits: list[float]) -> float:
        """Return the fraction for the next step, after steps with these merits; the first is that of the start."""
        if len(merits) < 2:
            return self._start
        return self._start * min(1.0, merits[-1] / merits[1])


def newton_iterates(
    linearize: Linearize,
    start: Iterate,
    tolerance: ConvergenceTolerance,
    *,
    predictor: Linearization | None = None,
    exact: bool = False,
    damping: Damping | None = None,
) -> Iterator[Trial]:
    """Yield the trials of Newton's method from a start; it ends where no step helps, or too many in a row did not.

    `predictor`: linearisation to use at the start, whose residual is not comparable with others. `exact`: solve each
    linear system to round-off, which pays if one factor of K serves them all. With `damping` no line search is made.

    Raises InadmissibleError if the start itself inverts cells.
    """
    now = _start(linearize(start.q) if predictor is None else predictor, start, tolerance)
    sets, merits, spent = _Sets(), [np.inf if predictor is not None else now.residual.merit], 0
    active = now.active
    while True:
        again = sets.record(active, now.residual.merit) <= now.residual.merit  # it comes back, and nothing is better
        limit = min(_MAX_SETS, tolerance.max_iterations - spent) if again else 1
        fraction = 0.0 if damping is None else damping.fraction(merits)
        reduction = 0.0 if exact or now.there.contact.exact else _reduction(now.residual)
        step = _newton_step(now, active, tolerance, reduction, fraction, limit)
        worst = np.inf if damping is not None else _acceptable(merits)
        then = None if step is None else _line_search(linearize, now, step, tolerance, worst)
        if step is None or then is None:
            yield Trial(Iterate(now.q, now.p, active), now.there.contact, now.residual, exact=False)
            return
        now, spent = then, spent + step.solves
        yield Trial(
            Iterate(now.q, now.p, now.active), now.there.contact, now.residual, step.applications, solves=step.solves
        )
        merits.append(now.residual.merit)
        if _hopeless(merits) if damping is None else _circling(merits):
            return
        active = now.there.contact.next_active(now.active, now.p)


def _start(there: Linearization, start: Iterate, tolerance: ConvergenceTolerance) -> _State:
    """Return the state to start from, without pressures on rows that are open."""
    active = there.contact.start_active(start.active)
    p = np.where(active, start.p, 0.0)
    return _State(start.q, p, active, there, residual_of(there, start.q, p, active, tolerance))


def _reduction(residual: Residual) -> float:
    """Return the reduction that a linear solve is worth at a state."""
    return min(_LOOSE, _FACTOR * max(residual.balance, residual.gap))


class _Step(NamedTuple):
    """Step of a linear problem: dq, pressures, its active set, number of sets solved, and of applications of K^-1."""

    dq: NDArray[np.floating]
    p: NDArray[np.floating]
    active: Bools
    solves: int
    applications: int


def _newton_step(
    now: _State, active: Bools, tolerance: ConvergenceTolerance, reduction: float, damping: float, limit: int
) -> _Step | None:
    """Return the step from a state; None if the tangent is singular, or the system cannot be solved."""
    there, moved = now.there, tolerance.scale(now.q)
    for definite in (True, False):  # an iterative backend finds out late that the tangent is not positive definite
        with suppress(LinearError):
            K = there.stiffness(damping, definite)
            C, R = there.geometric_stiffness(now.p), there.free
            resistance = products(tolerance.vectors, R, product(K, R, C))
            load = tolerance.vectors.dots(R.T, there.r)
            closed = close_rows_against_rigid_modes(R, there.contact, active, load, resistance)
            closed = tolerance.vectors.same(closed)
            G, S = there.contact.equations(now.p, closed)
            problem = SaddleProblem(K, there.contact.rows, np.flatnonzero(closed), there.r, G, S, C)
            return _Step(*solve_set(problem, there.contact, now.p, tolerance, reduction, moved, limit))
    return None


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
    linearize: Linearize, now: _State, step: _Step, tolerance: ConvergenceTolerance, worst: float
) -> _State | None:
    """Backtracking line search: return the first state whose merit is at most `worst`, else the best one.

    None if all step lengths invert a cell.
    """
    best = None
    for length in _STEP_LENGTHS:
        q, p = now.q + length * step.dq, now.p + length * (step.p - now.p)
        try:
            there = linearize(q)
        except InadmissibleError:
            continue
        then = _State(q, p, step.active, there, residual_of(there, q, p, step.active, tolerance))
        if best is None or then.residual.merit < best.residual.merit:
            best = then
        if then.residual.merit <= worst:
            break
    return best


class _Sets:
    """The active sets that were solved, with the merit at each."""

    def __init__(self) -> None:
        self._merit: dict[bytes, float] = {}
        self._last = b""

    def record(self, active: Bools, merit: float) -> float:
        """Record a set and its merit; return what the merit was when it was left for another one, inf if never."""
        key = active.tobytes()
        before = self._merit.get(key, np.inf) if key != self._last else np.inf
        self._merit[key], self._last = merit, key
        return before


def residual_of(there: Linearization, q: Floats, p: Floats, active: Bools, tolerance: ConvergenceTolerance) -> Residual:
    """Return the residuals of forces and gaps of a state."""
    contact, vectors = there.contact, tolerance.vectors
    forces = contact.rows.B_T @ p
    largest = max(there.size, vectors.largest(forces))
    off, gaps = there.r - forces, contact.residuals(p, active)
    closing = contact.rows.B_T @ (contact.skin * gaps)
    merit = vectors.largest(off) + _GAP_WEIGHT * vectors.largest(closing)
    gap = float(np.abs(gaps).max(initial=0.0)) / tolerance.scale(q)
    return Residual(balance(off, largest, there.terms, tolerance), gap, merit)
