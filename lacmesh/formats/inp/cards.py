"""Split of an .inp file into cards: a keyword line with its parameters, and the data lines that follow it.

Keyword lines begin with one asterisk, comments with two; a keyword line that ends with a comma continues on the next
line. *INCLUDE inserts another file in its place, data lines included, as does the parameter INPUT of a card.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

from lacmesh.errors import ReadError
from lacmesh.formats.source import SourceFile
from lacmesh.formats.text import decoded

#: Files inside files: how deep, and how many in all.
_DEEPEST, _MOST_FILES = 16, 10_000
#: Characters of a keyword line.
_LONGEST = 4096
_SOLID = re.compile(rb"\S")
_PARAMETER = re.compile(r'\s*([^,="]+?)\s*(?:=\s*("[^"]*"|[^,]*?)\s*)?(?:,|$)')
#: A field that is a number, as no parameter without a value is.
_NUMBERS = re.compile(r"(?:^|,)\s*[-+.0-9][-+.0-9eEdD]*\s*(?:,|$)")
#: Cards of which the parameter INPUT names a file with their data lines.
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")


class Span(NamedTuple):
    """Data lines: bytes `begin` to `end` of a file."""

    source: SourceFile
    begin: int
    end: int


@dataclass
class Card:
    """A keyword (`name`, in capitals without blanks; `shown`, with them), its parameters, its data lines.

    `head`: the keyword line; `body`: all lines up to the next one, comments included; `spans`: the data among them.
    """

    name: str
    shown: str
    parameters: dict[str, str]
    head: Span
    spans: list[Span] = field(default_factory=list)
    body: list[Span] = field(default_factory=list)

    @property
    def source(self) -> SourceFile:
        """The file that the keyword line stands in."""
        return self.head.source

    @property
    def at(self) -> int:
        """Offset of the keyword line in its file."""
        return self.head.begin

    def text(self) -> bytes:
        """All data lines, each terminated by a line end."""
        parts = [bytes(s.source.data[s.begin : s.end]) for s in self.spans]
        return b"".join(p if p.endswith(b"\n") else p + b"\n" for p in parts)

    def error(self, message: str, place: int | None = None) -> ReadError:
        """Make the error for an offset in `text`, or for the keyword line."""
        if place is None or not self.spans:
            return self.source.error(message, self.at)
        sizes = [s.end - s.begin + (s.end == s.begin or s.source.data[s.end - 1 : s.end] != b"\n") for s in self.spans]
        starts = [0, *accumulate(sizes)][:-1]
        k = max(0, bisect_right(starts, place) - 1)
        span = self.spans[k]
        return span.source.error(message, min(span.begin + place - starts[k], max(span.begin, span.end - 1)))


def label(text: str) -> tuple[str, str]:
    """Name for display, and name for comparison: blanks and case are significant between quotes only.

    >>> label("Top Face"), label('"Top Face"')
    (('TopFace', 'TOPFACE'), ('Top Face', '"Top Face"'))
    """
    text = text.strip()
    if len(text) > 1 and text[0] == text[-1] == '"':
        return text[1:-1], text
    shown = "".join(text.split())
    return shown, shown.upper()


def cards(path: Path, said: list[str]) -> tuple[list[Card], list[Span]]:
    """The cards of a file and of those that it includes, in order, and the lines before the first. Raises ReadError."""
    walk = _Walk(path)
    walk.walk(SourceFile(path), ())
    if not walk.cards:
        raise ReadError(path, "holds no keyword line (as *NODE)")
    if walk.stray:
        said.append("the text before the first keyword line is no card")
    return walk.cards, walk.start


class _Walk:
    """Walks through a file and the files that it includes."""

    def __init__(self, path: Path) -> None:
        self.home = path.parent
        self.cards: list[Card] = []
        self.start: list[Span] = []
        self.n_files = 0
        self.stray = False

    def walk(self, source: SourceFile, inside: tuple[Path, ...]) -> None:
        """Add the cards of one file; `inside`: the files that include it."""
        self.n_files += 1
        if self.n_files > _MOST_FILES:
            raise ReadError(source.path, f"includes more than {_MOST_FILES} files")
        begin = 0
        for at, end in _starred(source):
            start = source.data.rfind(b"\n", begin, at) + 1 or begin
            self._add_data(source, begin, start)
            begin = end
            if source.data[at + 1 : at + 2] == b"*":
                self._add_lines(source, start, end)
                continue
            text, begin = _keyword_line(source, at, end)
            card = _card(Span(source, start, begin), text)
            if card.name == "INCLUDE":
                self._include(card, source, at, inside)
            else:
                self.cards.append(card)
                if card.name in _WITH_INPUT and "INPUT" in card.parameters:
                    self._include(card, source, at, inside)
        self._add_data(source, begin, source.size)

    def _add_lines(self, source: SourceFile, begin: int, end: int) -> None:
        """Add lines of any kind to the body of the last card, as one span with those that they follow."""
        body = self.cards[-1].body if self.cards else self.start
        if begin == end:
            return
        if body and body[-1].source is source and body[-1].end == begin:
            body[-1] = body[-1]._replace(end=end)
        else:
            body.append(Span(source, begin, end))

    def _add_data(self, source: SourceFile, begin: int, end: int) -> None:
        self._add_lines(source, begin, end)
        if not _SOLID.search(source.data, begin, end):
            return
        if not self.cards:
            self.stray = True
            return
        self.cards[-1].spans.append(Span(source, begin, end))

    def _include(self, card: Card, source: SourceFile, at: int, inside: tuple[Path, ...]) -> None:
        name = card.parameters.get("INPUT", "").strip('"')
        if not name:
            raise source.error("*INCLUDE should name a file: *INCLUDE, INPUT=name", at)
        path = next((p for p in (source.path.parent / name, self.home / name) if p.is_file()), None)
        if path is None:
            raise source.error(f"the file {name!r}, which is included here, is not there", at)
        chain = (*inside, source.path.resolve())
        if path.resolve() in chain or len(chain) >= _DEEPEST:
            what = "includes itself" if path.resolve() in chain else f"is the {_DEEPEST}th file inside others"
            raise source.error(f"the file {name!r}, which is included here, {what}", at)
        self.walk(SourceFile(path), chain)


def _starred(source: SourceFile) -> Iterator[tuple[int, int]]:
    """Yield the offset of the asterisk and the end of each line that begins with one."""
    at = source.data.find(b"*")
    end = 0  # of the line looked at last
    while at >= 0:
        line = source.data.rfind(b"\n", end, at) + 1 or end
        end = source.data.find(b"\n", at) + 1 or source.size
        if not source.data[line:at].strip():
            yield at, end
        at = source.data.find(b"*", end)


def _keyword_line(source: SourceFile, at: int, end: int) -> tuple[str, int]:
    """Text of a keyword line joined with its continuation lines, and the offset where the last of them ends.

    A line with a number among its fields is data: CalculiX takes a comma at the end of a keyword line for nothing.
    """
    text = decoded(bytes(source.data[at:end])).strip()
    while text.endswith(",") and end < source.size:
        begin, end = end, source.data.find(b"\n", end) + 1 or source.size
        more = decoded(bytes(source.data[begin:end])).strip()
        if more.startswith("*") or not more or _NUMBERS.search(more):
            return text, begin
        text += more
        if len(text) > _LONGEST:
            break
    if len(text) > _LONGEST:
        raise source.error(f"this keyword line has more than {_LONGEST} characters", at)
    return text, end


def _card(head_span: Span, text: str) -> Card:
    head, _, rest = text[1:].partition(",")
    shown = " ".join(head.split()).upper()
    parameters = {}
    if rest.strip():
        for parameter in _PARAMETER.finditer(rest):
            parameters["".join(parameter[1].split()).upper()] = parameter[2] or ""
    return Card(shown.replace(" ", ""), shown, parameters, head_span)
