"""Results as tables: the results of a case, the worst of a family, what others published."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from lacmesh.report.blocks import Table, TableCell, TableRow, Verdict, columns
from verification.records import Published, Result
from verification.report import words
from verification.report.judging import SAID, as_good, counted, used, verdict
from verification.running.folder import CaseResult

_BOUNDS = {"equal": "equal", "at most": "at most", "at least": "at least", "informative": "for information"}


def place(done: CaseResult) -> TableCell:
    """A case, with the way to it."""
    return TableCell(done.id, link=done.id)


def judged(said: Verdict) -> TableCell:
    """A verdict."""
    return TableCell(SAID[said], verdict=said)


def results_of(results: Sequence[Result]) -> Table:
    """All that a case found, and what must come out."""
    names = ("quantity", "value", "must be", "expected", "tolerance", "verdict", "source", "reason")
    heads = columns(names, numbers=("value", "expected", "tolerance"), wide=("quantity", "source", "reason"))
    return Table(heads, tuple(_result(result) for result in results))


def _result(r: Result) -> TableRow:
    tolerance = words.bound(r.tolerance or None)
    cells = (
        r.quantity,
        TableCell(words.value_of(r), r.value),
        _BOUNDS[r.bound],
        TableCell(words.expected_of(r), _sort(r.expected)),
        TableCell(tolerance, _sort(r.tolerance)),
        judged(verdict(r)),
        r.source,
        words.reason_of(r),
    )
    return TableRow.of(cells, verdict(r))


def _sort(value: float | None) -> float:
    return math.nan if value is None else value


def missed(cases: Iterable[CaseResult]) -> Table:
    """Table of failures: cases without an outcome, then missed results."""
    names = ("case", "quantity", "value", "must be", "reason")
    heads = columns(names, numbers=("value", "must be"), wide=("quantity", "reason"))
    cases = tuple(cases)
    rows = [
        TableRow.of((place(d), TableCell("no outcome", verdict="none"), "", "", d.failure), "none")
        for d in cases
        if d.failure
    ]
    short = ((done, result) for done in cases for result in done.results if not result.passed)
    rows += [TableRow.of((place(d), *_short(r)), "missed") for d, r in short]
    return Table(heads, tuple(rows))


def _short(r: Result) -> tuple[TableCell | str, ...]:
    return (r.quantity, TableCell(words.value_of(r), r.value), words.must_be(r), words.reason_of(r))


def worst(cases: Iterable[CaseResult], most: int = 0) -> Table:
    """Table of the worst result of each quantity relative to its bound; the range of informative quantities."""
    names = ("quantity", "results", "met", "worst", "must be", "case")
    heads = columns(names, numbers=("results", "met", "worst", "must be"), wide=("quantity",))
    groups: dict[tuple[str, str, float | None], list[tuple[CaseResult, Result]]] = {}
    for done in cases:
        for r in done.results:
            groups.setdefault((r.quantity, r.bound, None if r.bound == "equal" else r.expected), []).append((done, r))
    order = list(dict.fromkeys(quantity for quantity, *_ in groups))
    sets = sorted(groups.values(), key=lambda g: order.index(g[0][1].quantity))
    held = [g for g in sets if g[0][1].bound != "informative"]
    if not most:
        held += [g for g in sets if g[0][1].bound == "informative"]
    return Table(heads, tuple(_worst(group) for group in held[: most or None]))


def _worst(group: list[tuple[CaseResult, Result]]) -> TableRow:
    results = [r for _, r in group]
    if results[0].bound == "informative":
        span = words.span([r.value for r in results], words.rate if words.is_rate(results[0]) else words.number)
        blank = ""
        return TableRow.of(
            (results[0].quantity, _whole(len(group)), blank, span, "for information", blank), "informative"
        )
    done, r = max(group, key=lambda pair: used(pair[1]))
    met = sum(own.passed for own in results)
    cells = (
        r.quantity,
        _whole(len(group)),
        _whole(met),
        TableCell(words.value_of(r), r.value),
        words.must_be(r),
        TableCell(done.case, link=done.id),
    )
    return TableRow.of(cells, "met" if met == len(group) else "missed")


def _whole(value: int) -> TableCell:
    return TableCell(f"{value:,}", value)


def index(cases: Iterable[CaseResult]) -> Table:
    """The cases of a family, in a line each."""
    names = ("case", "what", "met", "missed", "for information", "levels", "time", "verdict")
    heads = columns(names, numbers=("met", "missed", "for information", "levels", "time"), wide=("what",))
    return Table(heads, tuple(_index(done) for done in cases))


def _index(done: CaseResult) -> TableRow:
    n = counted([done])
    cells = (
        TableCell(done.case, link=done.id),
        done.description,
        _whole(n.met),
        _whole(n.missed),
        _whole(n.informative),
        _whole(done.levels),
        TableCell(words.seconds(done.seconds), done.seconds),
        judged(n.verdict),
    )
    return TableRow.of(cells, n.verdict)


def sources(cases: Iterable[CaseResult]) -> Table:
    """Table of the references that results are compared with, and how many results are met."""
    names = ("reference", "families", "results", "met", "missed")
    heads = columns(names, numbers=("results", "met", "missed"), wide=("reference",))
    compared: dict[str, list[tuple[str, bool]]] = {}
    for done in cases:
        for r in done.results:
            if r.bound != "informative":
                compared.setdefault(r.source, []).append((done.family, r.passed))
    rows = []
    for source, found in sorted(compared.items(), key=lambda item: -len(item[1])):
        met = sum(passed for _, passed in found)
        families = ", ".join(dict.fromkeys(name for name, _ in found))
        cells = (source, families, _whole(len(found)), _whole(met), _whole(len(found) - met))
        rows.append(TableRow.of(cells, "met" if met == len(found) else "missed"))
    return Table(heads, tuple(rows))


def beside(cases: Iterable[CaseResult]) -> Iterator[tuple[CaseResult, Result, Published]]:
    """Each published result with the one of the run."""
    for done in cases:
        for result in done.results:
            for published in result.published:
                yield done, result, published


def published(cases: Iterable[CaseResult], *, with_case: bool = True) -> Table:
    """Results of the run beside those that others published."""
    names = ("case", "quantity", "here", "published", "by", "better", "where")
    heads = columns(names, numbers=("here", "published"), wide=("quantity", "by", "where"))
    start = 0 if with_case else 1
    return Table(heads[start:], tuple(TableRow.of(_published(*row)[start:]) for row in beside(cases)))


def _published(done: CaseResult, r: Result, p: Published) -> tuple[TableCell | str, ...]:
    theirs = words.rate(p.value) if words.is_rate(r) else words.number(p.value)
    good = as_good(r, p)
    better = "" if good is None else "same" if r.value == p.value else "here" if good else "theirs"
    return (
        place(done),
        r.quantity,
        TableCell(words.value_of(r), r.value),
        TableCell(theirs, p.value),
        p.who,
        better,
        p.source,
    )


def ranges(cases: Iterable[CaseResult]) -> Table:
    """Results of the run beside published ones: a line for each quantity and who published it."""
    names = ("family", "quantity", "results", "here", "published", "by", "as good here")
    heads = columns(names, numbers=("results", "here", "published", "as good here"), wide=("quantity", "by"))
    groups: dict[tuple[str, str, str], list[tuple[Result, Published]]] = {}
    for done, r, p in beside(cases):
        groups.setdefault((done.family, r.quantity, p.who), []).append((r, p))
    return Table(heads, tuple(_range(*key, group) for key, group in groups.items()))


def _range(family: str, quantity: str, who: str, group: Sequence[tuple[Result, Published]]) -> TableRow:
    form = words.rate if words.is_rate(group[0][0]) else words.number
    said = [good for r, p in group if (good := as_good(r, p)) is not None]
    here, theirs = (words.span(values, form) for values in ([r.value for r, _ in group], [p.value for _, p in group]))
    cells = (family, quantity, _whole(len(group)), here, theirs, who)
    return TableRow.of((*cells, f"{sum(said)} of {len(said)}" if said else ""))


def peers(cases: Iterable[CaseResult]) -> Table:
    """Who published results, of what family, and whose are better."""
    names = ("family", "who", "results", "as good here", "better there", "only beside")
    heads = columns(names, numbers=("results", "as good here", "better there", "only beside"), wide=("who",))
    groups: dict[tuple[str, str], list[bool | None]] = {}
    for done, result, theirs in beside(cases):
        groups.setdefault((done.family, theirs.who), []).append(as_good(result, theirs))
    rows = []
    for (family, who), said in groups.items():
        counts = (len(said), said.count(True), said.count(False), said.count(None))
        rows.append(TableRow.of((TableCell(family, link=family), who, *map(_whole, counts))))
    return Table(heads, tuple(rows))
