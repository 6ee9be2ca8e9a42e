"""A report in short, for a page of the documentation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from lacmesh.report.blocks import Command, Simple, Table, Text, Title
from lacmesh.report.markdown import blocks
from verification.report import tables
from verification.report.outline import by_family, command, families_table, title_of, verdict_sentence
from verification.running.folder import Run

#: quantities of a family that are listed
MOST = 8


def summary(run: Run) -> str:
    """Markdown: how many results of each family are met, which are missed, the worst ones, published ones beside."""
    return "\n\n".join(blocks(_summary(run))) + "\n"


def _summary(run: Run) -> Iterator[Simple]:
    yield Text(verdict_sentence(run))
    yield Command(command(run))
    yield _narrow(families_table(run))
    yield Title("What fell short", 3)
    short = tables.missed(run.done)
    yield short if short.rows else Text("Nothing.")
    yield Title("The worst of each quantity", 3)
    for name, cases in by_family(run.done).items():
        found = tables.worst(cases, MOST)
        if found.rows:
            yield Title(title_of(name), 4)
            yield found
    others = tables.ranges(run.done)
    if others.rows:
        yield Title("Published results", 3)
        yield others


def _narrow(table: Table) -> Table:
    """Without the verdict, which the counts say."""
    rows = tuple(replace(row, cells=row.cells[:-1]) for row in table.rows)
    return Table(table.columns[:-1], rows)
