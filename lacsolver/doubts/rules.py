"""The rules that doubt a run, by when they are asked.

undeformed   before the first step, by `run`, `solve`, `march` and `validate`: what is fatal refuses the case
guess        by `validate` alone, for what a run finds out at its end
matrices     of a problem that is not solved in steps: of matrices and natural modes
step         after each converged step; a rule warns once
end          after the last step
failed       after a step without an equilibrium
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence

from lacmesh.errors import LacmeshWarning
from lacsolver.doubts.crushed import Crushed
from lacsolver.doubts.determined import stiffer, undetermined
from lacsolver.doubts.dipping import Dipping
from lacsolver.doubts.energy import Energies, dissipation
from lacsolver.doubts.held import beyond_a_cell, hardly_held
from lacsolver.doubts.inertia import inertia
from lacsolver.doubts.locking import locking
from lacsolver.doubts.neighbours import alternating, faceted
from lacsolver.doubts.opening import Opening, may_open
from lacsolver.doubts.overlap import (
    Covered,
    NeverFacing,
    across_a_gap,
    covered,
    deepest_overlap,
    facing,
    inside,
    overlapping,
    widest_gap,
)  # fmt: skip
from lacsolver.doubts.run import Before, Doubt, Rule, Run, Watching
from lacsolver.doubts.sectors import beyond_sector, leaves_sector
from lacsolver.doubts.sliding import ClosedAndSlid, TurnedFar, touching_at_start
from lacsolver.equilibrium.state import State
from lacsolver.problem.problem import Problem
from lacsolver.results.results import Restart
from lacsolver.space.places import wrong


def folded(run: Run) -> Iterator[Doubt]:
    """Yield a doubt about cells that the last step has folded, of which the solver knows."""
    if run.state.folded:
        yield Doubt(run.state.folded)


WHEN: dict[str, list[Rule | type[Watching]]] = {
    "undeformed": [
        *(locking, inside, facing, beyond_sector, undetermined),
        *(across_a_gap, overlapping, covered, inertia),
    ],
    "guess": [stiffer, may_open],
    "matrices": [locking, undetermined],
    "step": [leaves_sector, folded],
    "end": [
        *(NeverFacing, Covered, Energies, dissipation, Crushed, ClosedAndSlid, TurnedFar, Dipping),
        *(hardly_held, faceted, alternating, Opening, beyond_a_cell),
    ],
    "failed": [Crushed, Dipping],
}


class Doubts:
    """The rules asked along one run: warnings, and CaseError for what is fatal. `texts`: of all warnings so far."""

    def __init__(self, problem: Problem) -> None:
        """Ask the rules of undeformed bodies. Raises CaseError."""
        run = self._run = Run(problem, problem.joints)
        self.texts: list[str] = []
        self._doubted: set[Rule | type[Watching]] = set()
        self.ask("undeformed")
        every = dict.fromkeys(rule for rules in WHEN.values() for rule in rules)
        self._watching = {rule: rule(run) for rule in every if isinstance(rule, type)}
        run.before = Before(touching_at_start(run), {})
        self.overlap = {pair.name: deepest_overlap(run, pair) for pair in run.pairs}
        self.bridged = {pair.name: widest_gap(run, pair) for pair in run.pairs if pair.tie}
        run.faces.clear()

    def continued(self, start: Restart) -> None:
        """Go on from a restart."""
        self._run.before = Before.of(start)

    def after(self, state: State) -> None:
        """Ask the rules of a step that has converged, and let the others look at it. Raises CaseError."""
        self._run.last = state
        self.ask("step")
        for rule in self._watching.values():
            rule.look(self._run)
        self._run.before = Before.of(state)

    def ask(self, when: str) -> None:
        """Ask the rules of a time of the run and warn of their doubts. Raises CaseError for the first fatal one."""
        texts: list[str] = []
        for rule in WHEN[when]:
            found = texts_of((self._watching[rule] if isinstance(rule, type) else rule)(self._run))
            texts += found if when != "step" or rule not in self._doubted else []
            self._doubted |= {rule} if found else set()
        self.texts += warned(self._run, texts)


def check(problem: Problem, when: str) -> None:
    """Ask rules without a memory about a problem and warn of their doubts. Raises CaseError for the first fatal one."""
    run = Run(problem, problem.joints)
    warned(run, texts_of(asked(run, when)))


def asked(run: Run, *when: str) -> Iterator[Doubt]:
    """Yield the doubts of rules without a memory."""
    for rule in (rule for one in when for rule in WHEN[one]):
        yield from () if isinstance(rule, type) else rule(run)


def texts_of(doubts: Iterator[Doubt]) -> list[str]:
    """Return the texts of doubts. Raises CaseError for the first fatal one."""
    texts = []
    for doubt in doubts:
        if doubt.fatal:
            assert doubt.record is not None
            raise wrong(doubt.record, doubt.text)
        texts.append(doubt.text)
    return texts


def warned(run: Run, texts: Sequence[str]) -> tuple[str, ...]:
    """Warn of the texts of all processes, and return them."""
    every = tuple(run.problem.space.share.texts(texts))
    for text in every:
        warnings.warn(LacmeshWarning(text), stacklevel=5)
    return every
