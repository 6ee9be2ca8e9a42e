"""Errors against the size of the mesh: tables of a case, charts of a case and of a family."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from lacmesh.report.blocks import Chart, Column, Line, Plot, Table, TableCell, TableRow
from lacmesh.report.charts import COLOURS
from verification.records import Level, Result
from verification.report import words
from verification.running.folder import CaseResult

Sizes = tuple[tuple[float, int], ...]


def tables(results: Iterable[Result]) -> Iterator[Table]:
    """Sizes, errors and pairwise rates; below them the fitted rates, and what is wanted. One for each row of meshes."""
    groups: dict[Sizes, list[Result]] = {}
    for result in results:
        if result.levels:
            groups.setdefault(tuple((v.h, v.unknowns) for v in result.levels), []).append(result)
    for sizes, group in groups.items():
        yield _table(sizes, group)


def _table(sizes: Sizes, results: Sequence[Result]) -> Table:
    columns = [Column("level", number=True), Column("h", number=True), Column("unknowns", number=True)]
    for result in results:
        columns += [Column(result.quantity, number=True), Column("rate", number=True)]
    rows = [_row(k, size, [r.levels[k] for r in results]) for k, size in enumerate(sizes)]
    fitted = [text for r in results for text in ("", words.rate(r.value) if words.is_rate(r) else "")]
    wanted = [text for r in results for text in ("", _wanted(r))]
    foot = (
        TableRow.of(("fitted", "", "", *fitted)),
        TableRow.of(("expected", "", "", *wanted)),
    )
    return Table(tuple(columns), tuple(rows), foot)


def _row(k: int, size: tuple[float, int], levels: Sequence[Level]) -> TableRow:
    h, unknowns = size
    cells = [TableCell(str(k + 1), k + 1), TableCell(f"{h:.3g}", h), TableCell(f"{unknowns:,}", unknowns)]
    for level in levels:
        cells += TableCell(words.error(level.error), level.error), TableCell(words.rate(level.rate), _known(level.rate))
    return TableRow.of(cells)


def _wanted(r: Result) -> str:
    return "" if r.expected is None or not words.is_rate(r) else f"≥ {words.rate(r.expected)}"


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def chart_of(done: CaseResult) -> Chart | None:
    """All errors of a case in one chart, beside the rates that are wanted; None where there are none."""
    lines = [_line(r.quantity, r) for r in done.results if len(r.levels) > 1]
    wanted = {r.expected for r in done.results if words.is_rate(r) and r.expected}
    ends = tuple(sorted({min(wanted), max(wanted)})) if wanted else ()
    return Chart(_plot(f"{done.case}: errors", lines), ends) if lines else None


def charts_of(cases: Iterable[CaseResult]) -> Iterator[Chart]:
    """A chart for each quantity and rate that is wanted, with the cases as its lines."""
    groups: dict[tuple[str, float | None], list[tuple[CaseResult, Result]]] = {}
    for done in cases:
        for r in done.results:
            if len(r.levels) > 1:
                groups.setdefault((r.quantity, r.expected), []).append((done, r))
    for (quantity, wanted), group in groups.items():
        for k in range(0, len(group), COLOURS):
            part = group[k : k + COLOURS]
            lines = [_line(done.case, r) for done, r in part]
            count = f" ({k // COLOURS + 1} of {math.ceil(len(group) / COLOURS)})" if len(group) > COLOURS else ""
            title = (
                quantity
                if wanted is None or not words.is_rate(group[0][1])
                else f"{quantity}, rate wanted {wanted:.4g}"
            )
            slopes = (wanted,) if wanted and words.is_rate(part[0][1]) else ()
            yield Chart(_plot(f"{title}{count}", lines), slopes, tuple(d.id for d, _ in part))


def _line(label: str, r: Result) -> Line:
    return Line(label, tuple(v.h for v in r.levels), tuple(v.error for v in r.levels))


def _plot(title: str, lines: Sequence[Line]) -> Plot:
    return Plot("convergence", title, "h", "", tuple(lines), log_x=True, log_y=True)
