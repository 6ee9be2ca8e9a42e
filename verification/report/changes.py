"""Changes from one run to another, result by result."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from verification.pages.blocks import ReportBlock, TableRow, as_markdown, table, title
from verification.records import Result
from verification.report import words
from verification.report.judging import SAID, verdict
from verification.running.folder import CaseResult, Run

#: a value that differs by more, of itself, has changed; an error that is greater by more has grown
CHANGED, GROWN = 0.05, 0.01
#: of what is allowed: a change that is smaller is rounding
ROUNDING = 0.01


@dataclass(frozen=True)
class Pair:
    """A result of two runs; None where one of them is without it."""

    case: str
    quantity: str
    before: Result | None
    after: Result | None


def compare(before: Run, after: Run) -> str:
    """Differences between two runs as Markdown; the first line gives their number."""
    pairs = paired(before, after)
    kinds = {name: own for name, holds in _KINDS if (own := [p for p in pairs if holds(p)])}
    different = {id(p) for own in kinds.values() for p in own}
    counts = ", ".join(f"{len(own)} {name}" for name, own in kinds.items())
    first = f"{len(different):,} of {words.count(len(pairs), 'result')} differ{'' if len(different) != 1 else 's'}"
    lines = [f"{first}: {counts}." if different else f"No result differs, of {len(pairs):,}.", _versions(before, after)]
    shown = (block for name, own in kinds.items() for block in (title(name.capitalize(), 3), _table(own)))
    return "\n\n".join([*lines, *([as_markdown(shown)] if kinds else [])])


def paired(before: Run, after: Run) -> list[Pair]:
    """All results of both, in the order of the second, then those that it lacks."""
    old, new = _results(before.done), _results(after.done)
    keys = dict.fromkeys([*new, *old])
    return [Pair(case, quantity, old.get((case, quantity)), new.get((case, quantity))) for case, quantity in keys]


def _results(cases: Iterable[CaseResult]) -> Mapping[tuple[str, str], Result]:
    """By case and quantity; of a quantity that a case has twice, the second is numbered. No outcome is a result."""
    results: dict[tuple[str, str], Result] = {}
    seen: Counter[tuple[str, str]] = Counter()
    for done in cases:
        for result in (*done.results, *_outcome(done)):
            seen[done.id, result.quantity] += 1
            again = seen[done.id, result.quantity]
            results[done.id, f"{result.quantity} ({again})" if again > 1 else result.quantity] = result
    return results


def _outcome(done: CaseResult) -> tuple[Result, ...]:
    if not done.failure:
        return ()
    return (Result("outcome", math.nan, None, None, False, "", done.failure, "informative"),)


def _appeared(p: Pair) -> bool:
    return p.before is None


def _vanished(p: Pair) -> bool:
    return p.after is None


def _falls_short(p: Pair) -> bool:
    return p.before is not None and p.after is not None and p.before.passed and not p.after.passed


def _met_now(p: Pair) -> bool:
    return p.before is not None and p.after is not None and not p.before.passed and p.after.passed


def _changed(p: Pair) -> bool:
    """True if a value changed by more than 5 %, and by more than rounding within what is allowed."""
    if p.before is None or p.after is None:
        return False
    old, new = p.before.value, p.after.value
    if math.isnan(old) or math.isnan(new):
        return math.isnan(old) != math.isnan(new)
    allowed = {"equal": p.after.tolerance, "at most": p.after.expected}.get(p.after.bound) or 0.0
    return abs(new - old) > max(CHANGED * abs(old), ROUNDING * abs(allowed))


def _grown(p: Pair) -> bool:
    """True if the error has grown on the finest mesh that both runs have."""
    ends = finest(p)
    return ends is not None and ends[1] > ends[0] * (1 + GROWN)


def finest(p: Pair) -> tuple[float, float] | None:
    """Errors of both runs on the finest mesh that both have."""
    if p.before is None or p.after is None:
        return None
    old = {(level.h, level.unknowns): level.error for level in p.before.levels}
    both = [(level.h, old[level.h, level.unknowns], level.error) for level in p.after.levels
            if (level.h, level.unknowns) in old]  # fmt: skip
    return min(both)[1:] if both else None


_KINDS: tuple[tuple[str, Callable[[Pair], bool]], ...] = (
    ("fall short now", _falls_short),
    ("met now", _met_now),
    ("appeared", _appeared),
    ("vanished", _vanished),
    ("values changed", _changed),
    ("errors grown", _grown),
)


def _versions(before: Run, after: Run) -> str:
    versions = [
        f"{run.version} ({run.environment.get('commit', 'commit unknown')}, suite {run.suite})"
        for run in (before, after)
    ]
    return f"Before: {versions[0]}; after: {versions[1]}."


def _table(pairs: Iterable[Pair]) -> ReportBlock:
    names = ("case", "quantity", "before", "after", "error before", "error after", "verdict")
    return table(names, [_row(p) for p in pairs], numbers=names[2:6])


def _row(p: Pair) -> TableRow:
    ends = finest(p)
    errors = [words.error(e) for e in ends] if ends else ["", ""]
    said = [SAID[verdict(r)] for r in (p.before, p.after) if r is not None]
    values = [words.value_of(r) if r is not None else "" for r in (p.before, p.after)]
    return TableRow((p.case, p.quantity, *values, *errors, " → ".join(dict.fromkeys(said))))
