"""The text of a case file: TOML, each record with the card that it comes from in a comment."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lacsolver.case.case import Case
from lacsolver.case.keys import section_of, sections_of
from lacsolver.decks.draft import Record


def case_text(head: Iterable[str], top: dict[str, Any], records: Iterable[Record]) -> str:
    """Return the text of a case: comment lines, keys of the top, then the records in the order of a case's sections."""
    order = list(sections_of(Case))
    lines = [*(f"# {line}" for line in head), *_keys(top)]
    for record in sorted(records, key=lambda one: order.index(one.section)):
        lines += ["", *_record(record)]
    return "\n".join(lines) + "\n"


def _record(record: Record) -> list[str]:
    header = section_of(sections_of(Case)[record.section]).header
    of = record.card.of if record.card else None
    comment = [f"# *{of.name} ({Path(of.file).name}, line {of.line})"] if of else []
    return [*comment, header, *_keys(record.keys)]


def _keys(keys: dict[str, Any]) -> list[str]:
    return [f"{name} = {written(value)}" for name, value in keys.items()]


def written(value: Any) -> str:
    r"""Return a value as TOML.

    >>> written([[0, 1.5], [1.0, 2e-9]]), written(True), written('a "b"\n')
    ('[[0, 1.5], [1.0, 2e-09]]', 'true', '"a \\"b\\"\\n"')
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{"".join(c if c.isprintable() else _escape(c) for c in escaped)}"'
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(written, value))}]"
    return repr(value)


def _escape(character: str) -> str:
    return {"\n": "\\n", "\t": "\\t"}.get(character, f"\\u{ord(character) & 0xFFFF:04X}")
