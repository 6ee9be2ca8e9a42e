"""Errors against the size of the mesh: tables of a case, charts of a case and of a family."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from verification.pages.blocks import ReportBlock, TableCell, TableRow, table
from verification.pages.charts import COLOURS, Chart, Line, Plot
from verification.records import Level, Result
from verification.report import words
from verification.report.tables import grouped
from verification.running.folder import CaseResult

Sizes = tuple[tuple[float, int], ...]


def tables(results: Iterable[Result]) -> Iterator[ReportBlock]:
    """Sizes, errors and pairwise rates; below them the fitted rates, and what is wanted. One for each row of meshes."""
    groups = grouped((tuple((v.h, v.unknowns) for v in r.levels), r) for r in results if r.levels)
    for sizes, group in groups.items():
        yield _table(sizes, group)


def _table(sizes: Sizes, results: Sequence[Result]) -> ReportBlock:
    names = ["level", "h", "unknowns"]
    for result in results:
        names += [result.quantity, "rate"]
    rows = [_row(k, size, [r.levels[k] for r in results]) for k, size in enumerate(sizes)]
    fitted = [text for r in results for text in ("", words.rate(r.value) if words.is_rate(r) else "")]
    wanted = [text for r in results for text in ("", _wanted(r))]
    foot = (TableRow(("fitted", "", "", *fitted)), TableRow(("expected", "", "", *wanted)))
    return table(names, rows, numbers=names, foot=foot)


def _row(k: int, size: tuple[float, int], levels: Sequence[Level]) -> TableRow:
    h, unknowns = size
    cells = [TableCell(str(k + 1), k + 1), TableCell(f"{h:.3g}", h), TableCell(f"{unknowns:,}", unknowns)]
    for level in levels:
        cells += TableCell(words.error(level.error), level.error), TableCell(words.rate(level.rate), level.rate)
    return TableRow(cells)


def _wanted(r: Result) -> str:
    return "" if r.expected is None or not words.is_rate(r) else f"≥ {words.rate(r.expected)}"


def chart_of(done: CaseResult) -> Chart | None:
    """All errors of a case in one chart, beside the rates that are wanted; None where there are none."""
    lines = [_line(r.quantity, r) for r in done.results if len(r.levels) > 1]
    wanted = {r.expected for r in done.results if words.is_rate(r) and r.expected}
    ends = tuple(sorted({min(wanted), max(wanted)})) if wanted else ()
    return Chart(_plot(f"{done.case}: errors", lines), ends) if lines else None


def charts_of(cases: Iterable[CaseResult]) -> Iterator[Chart]:
    """A chart for each quantity and rate that is wanted, with the cases as its lines."""
    groups = grouped(((r.quantity, r.expected), (done, r)) for done in cases for r in done.results if len(r.levels) > 1)
    for (quantity, wanted), group in groups.items():
        is_rate = wanted is not None and words.is_rate(group[0][1])
        title = f"{quantity}, rate wanted {wanted:.4g}" if is_rate else quantity
        for k in range(0, len(group), COLOURS):
            part = group[k : k + COLOURS]
            lines = [_line(done.case, r) for done, r in part]
            count = f" ({k // COLOURS + 1} of {math.ceil(len(group) / COLOURS)})" if len(group) > COLOURS else ""
            slopes = (wanted,) if wanted and words.is_rate(part[0][1]) else ()
            yield Chart(_plot(f"{title}{count}", lines), slopes, tuple(d.id for d, _ in part))


def _line(label: str, r: Result) -> Line:
    return Line(label, tuple(v.h for v in r.levels), tuple(v.error for v in r.levels))


def _plot(title: str, lines: Sequence[Line]) -> Plot:
    return Plot("convergence", title, "h", "", tuple(lines), log_x=True, log_y=True)
