"""The text of a case file: TOML, each record with the card that it comes from in a comment."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lacsolver.case.case import Case
from lacsolver.case.keys import sections_of
from lacsolver.case.toml import section_text
from lacsolver.decks.draft import Record


def case_text(head: Iterable[str], top: dict[str, Any], records: Iterable[Record]) -> str:
    """Return the text of a case: comment lines, keys of the top, then the records in the order of a case's sections."""
    order = list(sections_of(Case))
    ordered = sorted(records, key=lambda one: order.index(one.section))
    return "\n".join([section_text("", top, head), *map(_record, ordered)])


def _record(record: Record) -> str:
    header = sections_of(Case)[record.section].SECTION.header
    of = record.card.of if record.card else None
    comment = [f"*{of.name} ({Path(of.file).name}, line {of.line})"] if of else []
    return section_text(header, record.keys, comment)
