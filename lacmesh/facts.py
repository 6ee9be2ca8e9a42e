"""Short descriptions of records: a name and a few facts, as text for a prompt and as HTML for a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

#: most lines of a description, its title included
_LINES = 10
_WIDTH = 110


def facts_text(title: str, facts: Mapping[str, str]) -> str:
    """Return the title, and a line for each fact, ten lines at most.

    >>> print(facts_text("Mesh", {"nodes": "4", "cells": "1 QUAD4"}))
    Mesh
      nodes  4
      cells  1 QUAD4
    """
    wide = max(map(len, facts), default=0)
    rows = [_cut(f"  {name:<{wide}}  {told}") for name, told in facts.items()]
    if len(rows) >= _LINES:
        rows = [*rows[: _LINES - 2], f"  and {len(rows) - _LINES + 2} more"]
    return "\n".join([title, *rows])


def facts_html(title: str, facts: Mapping[str, str], picture: str = "") -> str:
    """Return a small table of the facts; `picture`: HTML that is put below it."""
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th><td style="text-align:left">{escape(told)}</td></tr>'
        for name, told in facts.items()
    )
    return f"<div><b>{escape(title)}</b><table>{rows}</table>{picture}</div>"


def listed(names: Iterable[str], most: int = 6) -> str:
    """Return names in a row, the first ones of many.

    >>> listed(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    names = list(names)
    left = len(names) - most
    return ", ".join(names) if left <= 0 else f"{', '.join(names[:most])} and {left} more"


def _cut(line: str) -> str:
    return line if len(line) <= _WIDTH else line[: _WIDTH - 3] + "..."
