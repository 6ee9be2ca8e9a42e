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
        self._text = text
        self._breaks = [m.start() for m in re.finditer("\n", text)]
        self._line: dict[KeyPath, int] = {}
        self._count: dict[KeyPath, int] = {}
        self._read()

    def __getitem__(self, path: KeyPath) -> int | None:
        """Return the line of a path, counted from 1.

        If the path is absent, the line is that of the nearest table around it; None if there is none.
        """
        for size in range(len(path), 0, -1):
            if path[:size] in self._line:
                return self._line[path[:size]]
        return None

    def __iter__(self) -> Iterator[KeyPath]:
        return iter(self._line)

    def _mark(self, path: KeyPath, at: int) -> None:
        line = bisect_left(self._breaks, at) + 1
        for size in range(1, len(path) + 1):
            self._line.setdefault(path[:size], line)

    def _read(self) -> None:
        table: KeyPath = ()
        at = _end(_BLANK, self._text, 0)
        while at < len(self._text):
            if self._text[at] == "[":
                at, table = self._header(at)
            else:
                at = self._pair(at, table)
            at = _end(_BLANK, self._text, at)

    def _header(self, start: int) -> tuple[int, KeyPath]:
        """Read `[a.b]` or `[[a.b]]`; return its end and the path. A name of several tables means the last of them."""
        several = self._text.startswith("[[", start)
        keys, at = self._key(_end(_SPACE, self._text, start + 1 + several))
        path: KeyPath = ()
        for key in keys[:-1]:
            path = self._last((*path, key))
        path = (*path, keys[-1])
        if several:
            self._count[path] = self._count.get(path, 0) + 1
        path = self._last(path)
        self._mark(path, start)
        return at + 1 + several, path

    def _last(self, path: KeyPath) -> KeyPath:
        return (*path, self._count[path] - 1) if path in self._count else path

    def _pair(self, start: int, table: KeyPath) -> int:
        """Read `a.b = value` and return the position of its end."""
        keys, at = self._key(start)
        self._mark((*table, *keys), start)
        return self._value(_end(_SPACE, self._text, at + 1), (*table, *keys))

    def _key(self, at: int) -> tuple[KeyPath, int]:
        """Return the parts of a dotted key, and the position of the next mark (`=` or `]`)."""
        parts: KeyPath = ()
        while True:
            match = _BARE.match(self._text, at) or _STRING.match(self._text, at)
            assert match, "tomllib accepted this text"
            word = match.group()
            parts += (word if word[0] not in "\"'" else tomllib.loads(f"key = {word}")["key"],)
            at = _end(_SPACE, self._text, match.end())
            if self._text[at] != ".":
                return parts, at
            at = _end(_SPACE, self._text, at + 1)

    def _value(self, at: int, path: KeyPath) -> int:
        self._mark(path, at)
        if self._text[at] == "[":
            return self._items(at, path)
        if self._text[at] == "{":
            return self._inline(at, path)
        return _end(_STRING if self._text[at] in "\"'" else _PLAIN, self._text, at)

    def _items(self, at: int, path: KeyPath) -> int:
        at, item = _end(_BLANK, self._text, at + 1), 0
        while self._text[at] != "]":
            at = self._next(self._value(at, (*path, item)))
            item += 1
        return at + 1

    def _inline(self, at: int, path: KeyPath) -> int:
        at = _end(_BLANK, self._text, at + 1)
        while self._text[at] != "}":
            at = self._next(self._pair(at, path))
        return at + 1

    def _next(self, at: int) -> int:
        """Return the position of the next item or the end of the list, past the comma if there is one."""
        at = _end(_BLANK, self._text, at)
        return _end(_BLANK, self._text, at + 1) if self._text[at] == "," else at


def _end(pattern: re.Pattern[str], text: str, at: int) -> int:
    match = pattern.match(text, at)
    assert match, "tomllib accepted this text"
    return match.end()
