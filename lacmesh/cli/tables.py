"""Tables of text on a terminal or in a file: a heading, a line under it, and rows in columns.

Names come from files and are escaped, cell by cell.
"""

from __future__ import annotations

import shutil
import sys
import textwrap
import unicodedata

from lacmesh.cli.program import coloured, on_one_line

#: number of columns of a file, which has no width of its own
_IN_A_FILE = 160
_BETWEEN = "   "
#: columns of numbers, which are aligned to the right
_NUMBERS = ("before", "after", "added", "cells", "number", "nodes", "own nodes")


class Table:
    """Rows under a heading; columns of numbers are aligned to the right: those with a + before their name, and some."""

    def __init__(self, *columns: str) -> None:
        self._right = [name.startswith("+") or name in _NUMBERS for name in columns]
        self._rows = [[on_one_line(name.removeprefix("+")) for name in columns]]
        self._colours = [""]

    def add_row(self, *cells: str, colour: str = "") -> None:
        """Add a row; `colour`: that of its first cell on a terminal, as for `coloured`."""
        self._rows.append([on_one_line(cell) for cell in cells])
        self._colours.append(colour)

    def add_section(self) -> None:
        """Leave a line free before the next row."""
        self.add_row(*("" for _ in self._right))

    def print(self) -> None:
        """Print the table as wide as its text, at most as wide as the terminal: what is longer is wrapped."""
        out = getattr(sys.stdout, "out", sys.stdout)  # past what escapes lines: colours are no names
        widths = self._fitting(shutil.get_terminal_size().columns if out.isatty() else _IN_A_FILE)
        rule = "─" if "utf" in (out.encoding or "utf-8").lower() else "-"
        print(file=out)
        for number, (cells, colour) in enumerate(zip(self._rows, self._colours, strict=True)):
            for line in self._lines(cells, widths, colour):
                print(f" {line}".rstrip(), file=out)
            if number == 0:
                print(f" {rule * (sum(widths) + len(_BETWEEN) * (len(widths) - 1))}", file=out)
        print(file=out)

    def _fitting(self, room: int) -> list[int]:
        """Return the widths of the columns: what does not fit into the room is taken from the widest column of text."""
        widths = [max(map(_width, column)) for column in zip(*self._rows, strict=True)]
        text = [k for k, right in enumerate(self._right) if not right]
        over = sum(widths) + len(_BETWEEN) * (len(widths) - 1) + 2 - room
        while over > 0 and text:
            widest = max(text, key=lambda k: widths[k])
            if widths[widest] == 1:
                break
            widths[widest], over = widths[widest] - 1, over - 1
        return widths

    def _lines(self, cells: list[str], widths: list[int], colour: str) -> list[str]:
        """Return the lines of a row."""
        parts = [
            [cell] if right else textwrap.wrap(cell, max(width, 1), break_on_hyphens=False) or [""]
            for cell, width, right in zip(cells, widths, self._right, strict=True)
        ]
        lines = []
        for k in range(max(map(len, parts))):
            line = [part[k] if k < len(part) else "" for part in parts]
            space = [" " * (width - _width(cell)) for cell, width in zip(line, widths, strict=True)]
            shown = [coloured(line[0], colour, sys.stdout) if colour and k == 0 else line[0], *line[1:]]
            padded = zip(space, shown, self._right, strict=True)
            lines.append(_BETWEEN.join(pad + cell if right else cell + pad for pad, cell, right in padded))
        return lines


def _width(text: str) -> int:
    """Return the number of columns that a text takes on a terminal."""
    return len(text) + sum(unicodedata.east_asian_width(c) in "WF" for c in text if not c.isascii())
