"""Results as tables: the results of a case, the worst of a family, what others published."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TypeVar

from verification.pages.blocks import ReportBlock, TableCell, TableRow, Verdict, table
from verification.records import Published, Result
from verification.report import words
from verification.report.judging import SAID, as_good, counted, used, verdict
from verification.running.folder import CaseResult

K = TypeVar("K")
V = TypeVar("V")
_BOUNDS = {"equal": "equal", "at most": "at most", "at least": "at least", "informative": "for information"}


def grouped(pairs: Iterable[tuple[K, V]]) -> dict[K, list[V]]:
    """The values of each key, in the order of their first.

    >>> grouped([("a", 1), ("b", 2), ("a", 3)])
    {'a': [1, 3], 'b': [2]}
    """
    groups: dict[K, list[V]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def judged(said: Verdict) -> TableCell:
    """A verdict."""
    return TableCell(SAID[said], verdict=said)


def whole(value: int) -> TableCell:
    """A count."""
    return TableCell(f"{value:,}", value)


def seconds(value: float) -> TableCell:
    """A time."""
    return TableCell(words.seconds(value), value)


def _to(done: CaseResult) -> TableCell:
    """A case, with the way to it."""
    return TableCell(done.id, link=done.id)


def _value(r: Result) -> TableCell:
    return TableCell(words.value_of(r), r.value)


def results_of(results: Sequence[Result]) -> ReportBlock:
    """All that a case found, and what must come out."""
    names = ("quantity", "value", "must be", "expected", "tolerance", "verdict", "source", "reason")
    wide = ("quantity", "source", "reason")
    return table(names, [_result(r) for r in results], numbers=("value", "expected", "tolerance"), wide=wide)


def _result(r: Result) -> TableRow:
    expected = TableCell(words.expected_of(r), r.expected)
    tolerance = TableCell(words.bound(r.tolerance or None), r.tolerance)
    ends = judged(verdict(r)), r.source, words.reason_of(r)
    return TableRow((r.quantity, _value(r), _BOUNDS[r.bound], expected, tolerance, *ends), verdict(r))


def missed(cases: Sequence[CaseResult]) -> ReportBlock | None:
    """Table of failures: cases without an outcome, then missed results; None where there are none."""
    names = ("case", "quantity", "value", "must be", "reason")
    failed = TableCell("no outcome", verdict="none")
    rows = [TableRow((_to(done), failed, "", "", done.failure), "none") for done in cases if done.failure]
    rows += [
        TableRow((_to(done), r.quantity, _value(r), words.must_be(r), words.reason_of(r)), "missed")
        for done in cases
        for r in done.results
        if not r.passed
    ]
    return table(names, rows, numbers=("value", "must be"), wide=("quantity", "reason")) if rows else None


def worst(cases: Iterable[CaseResult], most: int = 0) -> ReportBlock | None:
    """Table of the worst result of each quantity relative to its bound; the range of informative quantities.

    `most`: how many quantities are listed, none of them informative. None where there are none.
    """
    names = ("quantity", "results", "met", "worst", "must be", "case")
    results = [(done, r) for done in cases for r in done.results]
    groups = grouped(
        ((r.quantity, r.bound, None if r.bound == "equal" else r.expected), (done, r)) for done, r in results
    )
    order = list(dict.fromkeys(quantity for quantity, *_ in groups))
    sets = sorted(groups.values(), key=lambda g: order.index(g[0][1].quantity))
    listed = [g for g in sets if g[0][1].bound != "informative"]
    if not most:
        listed += [g for g in sets if g[0][1].bound == "informative"]
    rows = [_worst(group) for group in listed[: most or None]]
    return table(names, rows, numbers=("results", "met", "worst", "must be"), wide=("quantity",)) if rows else None


def _worst(group: list[tuple[CaseResult, Result]]) -> TableRow:
    results = [r for _, r in group]
    start = results[0].quantity, whole(len(group))
    if results[0].bound == "informative":
        span = words.span([r.value for r in results], words.rate if words.is_rate(results[0]) else words.number)
        return TableRow((*start, "", span, "for information", ""), "informative")
    done, r = max(group, key=lambda pair: used(pair[1]))
    met = sum(own.passed for own in results)
    cells = (*start, whole(met), _value(r), words.must_be(r), TableCell(done.case, link=done.id))
    return TableRow(cells, "met" if met == len(group) else "missed")


def index(cases: Iterable[CaseResult]) -> ReportBlock:
    """The cases of a family, in a line each."""
    names = ("case", "what", "met", "missed", "for information", "levels", "time", "verdict")
    numbers = ("met", "missed", "for information", "levels", "time")
    return table(names, [_index(done) for done in cases], numbers=numbers, wide=("what",))


def _index(done: CaseResult) -> TableRow:
    n = counted([done])
    counts = map(whole, (n.met, n.missed, n.informative, done.levels))
    case = TableCell(done.case, link=done.id)
    return TableRow((case, done.description, *counts, seconds(done.seconds), judged(n.verdict)), n.verdict)


def sources(cases: Iterable[CaseResult]) -> ReportBlock:
    """Table of the references that results are compared with, and how many results are met."""
    names = ("reference", "families", "results", "met", "missed")
    compared = grouped(
        (r.source, (done.family, r.passed)) for done in cases for r in done.results if r.bound != "informative"
    )
    rows = []
    for source, results in sorted(compared.items(), key=lambda item: -len(item[1])):
        met, count = sum(passed for _, passed in results), len(results)
        families = ", ".join(dict.fromkeys(name for name, _ in results))
        rows.append(
            TableRow((source, families, *map(whole, (count, met, count - met))), "met" if met == count else "missed")
        )
    return table(names, rows, numbers=("results", "met", "missed"), wide=("reference",))


def beside(cases: Iterable[CaseResult]) -> Iterator[tuple[CaseResult, Result, Published]]:
    """Each published result with the one of the run."""
    for done in cases:
        for result in done.results:
            for published in result.published:
                yield done, result, published


def published(cases: Iterable[CaseResult], *, with_case: bool = True) -> ReportBlock | None:
    """Results of the run beside those that others published; None where there are none."""
    names = ("case", "quantity", "here", "published", "by", "better", "where")
    start = 0 if with_case else 1
    rows = [TableRow(_published(*row)[start:]) for row in beside(cases)]
    return table(names[start:], rows, numbers=("here", "published"), wide=("quantity", "by", "where")) if rows else None


def _published(done: CaseResult, r: Result, p: Published) -> tuple[TableCell | str, ...]:
    theirs = words.rate(p.value) if words.is_rate(r) else words.number(p.value)
    good = as_good(r, p)
    better = "" if good is None else "same" if r.value == p.value else "here" if good else "theirs"
    return (_to(done), r.quantity, _value(r), TableCell(theirs, p.value), p.who, better, p.source)


def ranges(cases: Iterable[CaseResult]) -> ReportBlock | None:
    """Results of the run beside published ones: a line for each quantity and who published it; None without any."""
    names = ("family", "quantity", "results", "here", "published", "by", "as good here")
    groups = grouped(((done.family, r.quantity, p.who), (r, p)) for done, r, p in beside(cases))
    rows = [_range(*key, group) for key, group in groups.items()]
    numbers = ("results", "here", "published", "as good here")
    return table(names, rows, numbers=numbers, wide=("quantity", "by")) if rows else None


def _range(family: str, quantity: str, who: str, group: Sequence[tuple[Result, Published]]) -> TableRow:
    form = words.rate if words.is_rate(group[0][0]) else words.number
    said = [good for r, p in group if (good := as_good(r, p)) is not None]
    here, theirs = (words.span(values, form) for values in ([r.value for r, _ in group], [p.value for _, p in group]))
    cells = (family, quantity, whole(len(group)), here, theirs, who)
    return TableRow((*cells, f"{sum(said)} of {len(said)}" if said else ""))


def peers(cases: Iterable[CaseResult]) -> ReportBlock | None:
    """Who published results, of what family, and whose are better; None where nobody did."""
    names = ("family", "who", "results", "as good here", "better there", "only beside")
    groups = grouped(((done.family, p.who), as_good(result, p)) for done, result, p in beside(cases))
    rows = [
        TableRow((TableCell(family, link=family), who, *map(whole, (len(said), *map(said.count, (True, False, None))))))
        for (family, who), said in groups.items()
    ]
    return table(names, rows, numbers=names[2:], wide=("who",)) if rows else None
