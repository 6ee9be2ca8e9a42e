"""The line of every key of a TOML text.

`tomllib` checks and reads the text, but keeps no positions. This module scans a text that tomllib has accepted, so that
it need not be checked again: it is enough to tell keys, strings, brackets and comments apart. A path leads to a value
in the document that tomllib returns: `("contact", 0, "slave")` is the slave of the first [[contact]].
"""

from __future__ import annotations

import re
import tomllib
from bisect import bisect_left
from collections.abc import Iterator

KeyPath = tuple[str | int, ...]

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_STRING = re.compile(
    r'"""(?:\\.|[^\\])*?"""(?:"{1,2}(?!"))?'
    r"|'''.*?'''(?:'{1,2}(?!'))?"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'",
    re.DOTALL,
)
_PLAIN = re.compile(r"[^,\]}#\r\n]+")


class Lines:
    """The lines of the keys of a TOML text."""

    def __init__(self, text: str) -> None:
        self._text, self._at = text, 0
        self._breaks = [m.start() for m in re.finditer("\n", text)]
        self._line: dict[KeyPath, int] = {}
        self._count: dict[KeyPath, int] = {}
        table: KeyPath = ()
        while self._next(_BLANK):
            if self._next() == "[":
                table = self._header()
            else:
                self._pair(table)

    def __getitem__(self, path: KeyPath) -> int | None:
        """Return the line of a path, counted from 1.

        If the path is absent, the line is that of the nearest table around it; None if there is none.
        """
        around = (path[:size] for size in range(len(path), 0, -1))
        return next((self._line[one] for one in around if one in self._line), None)

    def __iter__(self) -> Iterator[KeyPath]:
        return iter(self._line)

    def _next(self, pattern: re.Pattern[str] | None = None) -> str:
        """Return the character at the present position, "" at the end, past a pattern that is there."""
        if pattern is not None:
            match = pattern.match(self._text, self._at)
            assert match, "tomllib accepted this text"
            self._at = match.end()
        return self._text[self._at : self._at + 1]

    def _mark(self, path: KeyPath, at: int) -> None:
        line = bisect_left(self._breaks, at) + 1
        for size in range(1, len(path) + 1):
            self._line.setdefault(path[:size], line)

    def _header(self) -> KeyPath:
        """Read `[a.b]` or `[[a.b]]` and return its path. A name of several tables means the last of them."""
        start, several = self._at, self._text.startswith("[[", self._at)
        self._at += 1 + several
        path: KeyPath = ()
        *outer, last = self._key()
        for key in outer:
            path = self._last((*path, key))
        path = (*path, last)
        if several:
            self._count[path] = self._count.get(path, 0) + 1
        path = self._last(path)
        self._mark(path, start)
        self._at += 1 + several
        return path

    def _last(self, path: KeyPath) -> KeyPath:
        return (*path, self._count[path] - 1) if path in self._count else path

    def _pair(self, table: KeyPath) -> None:
        """Read `a.b = value`."""
        start = self._at
        path = (*table, *self._key())
        self._mark(path, start)
        self._at += 1
        self._next(_SPACE)
        self._value(path)

    def _key(self) -> KeyPath:
        """Read a dotted key up to the mark behind it (`=` or `]`), and return its parts."""
        parts: KeyPath = ()
        while not parts or self._next() == ".":
            self._at += bool(parts)
            quoted, start = self._next(_SPACE) in "\"'", self._at
            self._next(_STRING if quoted else _BARE)
            word = self._text[start : self._at]
            parts += (tomllib.loads(f"key = {word}")["key"] if quoted else word,)
            self._next(_SPACE)
        return parts

    def _value(self, path: KeyPath) -> None:
        """Read a value, with the items of a list or the pairs of an inline table."""
        self._mark(path, self._at)
        first, item = self._next(), 0
        if first not in "[{":
            self._next(_STRING if first in "\"'" else _PLAIN)
            return
        self._at += 1
        while self._next(_BLANK) not in "]}":
            if first == "[":
                self._value((*path, item))
            else:
                self._pair(path)
            item += 1
            if self._next(_BLANK) == ",":
                self._at += 1
        self._at += 1
