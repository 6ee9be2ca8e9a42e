"""Search for an equilibrium: one driver that takes trials from an iteration, judges them, and stops it.

An iteration is a generator of trials that goes on for ever, or ends where it cannot continue: the active set on one
linearisation (`active_set`), or Newton's method with a new linearisation for each trial (`newton`). Only the driver
knows the tolerances to stop at, the number of iterations, and the callback for each iteration.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.contact.laws import Bools
from lacsolver.equilibrium.state import Iterate
from lacsolver.saddle.contact_system import ContactSystem
from lacsolver.saddle.tolerances import ConvergenceTolerance, Residual

#: number of last iterations whose rows an outcome keeps, to tell what alternates
_RECENT = 8
#: callback for each iteration: number, closed rows, balance, gap
IterationCallback = Callable[[int, int, float, float], None]


class Trial(NamedTuple):
    """One iterate, whose active set is that of its last solve, with its contact rows and residuals.

    `applications`: number of applications of K^-1 for it; `exact`: False after an inexact solve, which does not count
    as converged; `solves`: number of active sets that were solved for it.
    """

    iterate: Iterate
    contact: ContactSystem
    residual: Residual
    applications: int = 0
    exact: bool = True
    solves: int = 1


class Outcome(NamedTuple):
    """Result of a search for equilibrium: `converged`, the last iterate, its contact rows, and residuals.

    `residuals`: relative residuals (balance, gap) after each linear solve. `applications`: number of applications of
    K^-1. `n_unchanged_sets`: number of last solves with the same active set. `recent`: of the last iterations, the
    covered measure (m,) of each row, 0 where it is not paired, and the active set (m,). `trials`: their number.
    """

    converged: bool
    iterate: Iterate
    contact: ContactSystem
    residuals: tuple[tuple[float, float], ...]
    applications: int
    n_unchanged_sets: int = 0
    recent: tuple[tuple[Floats, Bools], ...] = ()
    trials: int = 0


def search(
    trials: Iterable[Trial], tolerance: ConvergenceTolerance, report: IterationCallback | None = None
) -> Outcome:
    """Take trials until one is an equilibrium, until there are no more, or up to the largest number of iterations.

    The active sets of one linear problem count as one iteration there.
    """
    residuals: list[tuple[float, float]] = []
    converged, applications, unchanged, before = False, 0, 0, None
    recent: deque[tuple[Floats, Bools]] = deque(maxlen=_RECENT)
    number = 0
    for number, trial in enumerate(trials, 1):
        closed = trial.iterate.active
        now = trial.residual.relative, trial.residual.gap
        residuals += [*[residuals[-1] if residuals else now] * (trial.solves - 1), now]
        applications += trial.applications
        same = trial.solves == 1 and before is not None and np.array_equal(before, closed)
        recent.append((np.where(trial.contact.above_threshold, trial.contact.rows.w, 0.0), closed))
        before, unchanged = closed, unchanged + 1 if same else 1
        if report is not None:
            report(len(residuals), int((closed & ~trial.contact.along_tangents).sum()), *residuals[-1])
        converged = trial.exact and tolerance.fulfilled(trial.residual, trial.iterate.q)
        if converged or number >= tolerance.max_iterations:
            break
    return Outcome(
        converged, trial.iterate, trial.contact, tuple(residuals), applications, unchanged, tuple(recent), number
    )
