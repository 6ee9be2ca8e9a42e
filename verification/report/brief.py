"""A report in short, for a page of the documentation."""

from __future__ import annotations

from collections.abc import Iterator

from verification.pages.blocks import ReportBlock, as_markdown, command, prose, title
from verification.report import outline, tables
from verification.report.outline import by_family, families_table, title_of, titled, verdict_sentence
from verification.running.folder import Run

#: quantities of a family that are listed
MOST = 8


def summary(run: Run) -> str:
    """Markdown: how many results of each family are met, which are missed, the worst ones, published ones beside."""
    return as_markdown(_summary(run)) + "\n"


def _summary(run: Run) -> Iterator[ReportBlock]:
    yield prose(verdict_sentence(run))
    yield command(outline.command(run))
    yield families_table(run, verdicts=False)
    yield from titled("What fell short", tables.missed(run.done) or prose("Nothing."), level=3)
    yield title("The worst of each quantity", 3)
    for name, cases in by_family(run.done).items():
        yield from titled(title_of(name), tables.worst(cases, MOST), level=4)
    yield from titled("Published results", tables.ranges(run.done), level=3)
