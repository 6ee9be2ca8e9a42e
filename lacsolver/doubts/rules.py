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
from collections.abc import Iterable, Iterator

from lacmesh.errors import LacmeshWarning
from lacsolver.doubts.determined import undetermined
from lacsolver.doubts.held import beyond_a_cell, hardly_held
from lacsolver.doubts.materials import Crushed, locking
from lacsolver.doubts.motion import Energies, dissipation, inertia
from lacsolver.doubts.neighbours import alternating, faceted
from lacsolver.doubts.opening import closed_at_an_angle, may_close_at_an_angle
from lacsolver.doubts.overlap import Covered, across_a_gap, covered, facing, inside, overlapping
from lacsolver.doubts.run import Doubt, Rule, Run, Watching
from lacsolver.doubts.sectors import beyond_sector, leaves_sector
from lacsolver.doubts.steps import closed_and_slid, dips, folded, touching_at_start, turned_far
from lacsolver.equilibrium.state import CONTACT, State
from lacsolver.problem.problem import Problem
from lacsolver.results.results import Restart
from lacsolver.space.places import wrong

WHEN: dict[str, list[Rule | type[Watching]]] = {
    "undeformed": [
        *(locking, inside, facing, beyond_sector, undetermined),
        *(across_a_gap, overlapping, covered, inertia),
    ],
    "guess": [may_close_at_an_angle],
    "matrices": [locking, undetermined],
    "step": [leaves_sector, folded, closed_and_slid, turned_far, dips],
    "end": [
        *(Covered, Energies, dissipation, Crushed),
        *(hardly_held, faceted, alternating, closed_at_an_angle, beyond_a_cell),
    ],
    "failed": [Crushed],
}


class Doubts:
    """The rules asked along one `run`: warnings, and CaseError for what is fatal. `texts`: of all warnings so far."""

    def __init__(self, problem: Problem) -> None:
        self.run = Run(problem, problem.joints)
        self.texts: list[str] = []
        self._doubted: set[Rule | type[Watching]] = set()
        watching = (rule for rules in WHEN.values() for rule in rules if isinstance(rule, type))
        self._watching = {rule: rule(self.run) for rule in watching}

    def ask(self, when: str) -> None:
        """Ask the rules of a time of the run and warn of their doubts. Raises CaseError for the first fatal one."""
        texts: list[str] = []
        for rule in WHEN[when]:
            found = texts_of((self._watching[rule] if isinstance(rule, type) else rule)(self.run))
            texts += found if when != "step" or rule not in self._doubted else []
            self._doubted |= {rule} if found else set()
        for text in self.run.space.share.texts(texts):
            warnings.warn(LacmeshWarning(text), stacklevel=4)
            self.texts.append(text)

    def continued(self, start: Restart) -> None:
        """Go on from a restart."""
        self.run.touched = {name: status >= CONTACT for name, status in start.status.items()}
        self.run.rigid = start.rigid

    def after(self, state: State) -> None:
        """Ask the rules of a step that has converged, and let the others look at it. Raises CaseError."""
        run, run.last = self.run, state
        run.touched = run.touched or touching_at_start(run)
        run.faces.clear()
        self.ask("step")
        for rule in self._watching.values():
            rule.look(run)
        run.touched, run.rigid = {zone.name: zone.status >= CONTACT for zone in state.zones}, state.rigid


def asked(run: Run, *when: str) -> Iterator[Doubt]:
    """Yield the doubts of rules that watch no steps."""
    for rule in (rule for one in when for rule in WHEN[one]):
        yield from () if isinstance(rule, type) else rule(run)


def texts_of(doubts: Iterable[Doubt]) -> list[str]:
    """Return the texts of doubts. Raises CaseError for the first fatal one."""
    texts = []
    for doubt in doubts:
        if doubt.fatal:
            assert doubt.record is not None
            raise wrong(doubt.record, doubt.text)
        texts.append(doubt.text)
    return texts
