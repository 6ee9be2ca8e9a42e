"""Split of an .inp file into cards: a keyword line with its parameters, and the lines that follow it, as arrays.

Keyword lines begin with one asterisk, comments with two; a keyword line that ends with a comma continues on the next
line. *INCLUDE inserts another file in its place, data lines included, as does the parameter INPUT of a card.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lacmesh.deck import DeckInstance, Lines, key_of
from lacmesh.errors import ReadError
from lacmesh.formats.source import SourceFile
from lacmesh.formats.text import AS_INTEGERS, AS_REALS, bad_line, decoded, integers, parsed, values_in_lines
from lacmesh.mesh import Floats, Ints, mask_of

#: What a comment line with a part of lacmesh's note begins with.
NOTE = "** lacmesh: "
_NOTE_LINE = re.compile(rb"^" + re.escape(NOTE.encode()) + rb"(.*)\n?", re.MULTILINE)
_COMMENT = re.compile(rb"^[ \t]*\*\*[^\n]*", re.MULTILINE)
_KEYWORD_LINE = re.compile(rb"^[ \t]*\*(?!\*)[^\n]*\n?", re.MULTILINE)
_PARAMETER = re.compile(r'\s*([^,="]+?)\s*(?:=\s*("[^"]*"|[^,]*?)\s*)?(?:,|$)')
#: A field that is a number, as no parameter without a value is.
_NUMBERS = re.compile(r"(?:^|,)\s*[-+.0-9][-+.0-9eEdD]*\s*(?:,|$)")
#: Cards of which the parameter INPUT names a file with their data lines.
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")
#: Largest number of a node or an element: both programs read nine digits.
LARGEST = 999_999_999
_FACE = re.compile(rb"^[ \t]*(\d{1,18})[ \t]*,[ \t]*([A-Za-z]\w*)[ \t]*,?[ \t]*\r?$", re.MULTILINE)
_NUMBER = re.compile(r"[+-]?\d{1,18}")
_SOLID_LINE = re.compile(rb"[^\n]*\S[^\n]*\n")
#: Files inside files: how deep, and how many in all; characters of a keyword line.
_DEEPEST, _MOST_FILES, _LONGEST = 16, 10_000, 4096


class Span(NamedTuple):
    """Lines that follow each other in a file: its bytes `begin` to `end`, and the number of the first line."""

    path: Path
    data: bytes
    begin: int
    end: int
    line: int

    @property
    def values(self) -> bytes:
        """The lines, each with its end, and blank ones in place of comments."""
        text = self.data[self.begin : self.end]
        if b"*" in text:
            text = _COMMENT.sub(b"", text)
        return text if text.endswith(b"\n") else text + b"\n"

    @property
    def note(self) -> str:
        """What the lines have of lacmesh's note."""
        return "".join(decoded(match[1].rstrip()) for match in _NOTE_LINE.finditer(self.data, self.begin, self.end))

    def lines(self, *, comments_alone: bool = False) -> Lines:
        """Return the lines as text, each with its end, without lacmesh's note; or the comments among them."""
        data = self.data[self.begin : self.end]
        if comments_alone:
            data = b"\n".join([*_COMMENT.findall(data), b""])
        text = _NOTE_LINE.sub(b"", data).decode(errors="surrogateescape")
        return Lines(text if not text or text.endswith("\n") else text + "\n", str(self.path), self.line)


@dataclass
class Card:
    """A keyword (`name`, in capitals with single blanks; `key`, without them), its parameters, the lines below it."""

    name: str
    key: str
    options: dict[str, str]
    head: Span
    body: list[Span] = field(default_factory=list)

    def text(self) -> bytes:
        """Return all data lines; comments among them are blank lines."""
        return b"".join(span.values for span in self.body)

    def rows(self) -> list[bytes]:
        """Return the data lines that are not blank."""
        return [row for row in self.text().splitlines() if row.strip()]

    def error(self, message: str, at: int | None = None) -> ReadError:
        """Make the error for an offset in `text`, or for the keyword line."""
        rest = -1 if at is None else at
        for span in self.body if rest >= 0 else ():
            text = span.values
            if rest < len(text):
                line = span.line + text.count(b"\n", 0, rest)
                return ReadError(span.path, message, f"line {line}")
            rest -= len(text)
        return ReadError(self.head.path, message, f"line {self.head.line}")


class Cards:
    """Cards of a file and of those that it includes, in order; `start`: the lines before the first."""

    def __init__(self, path: Path) -> None:
        """Read the files. Raises ReadError."""
        self.cards: list[Card] = []
        self.start: list[Span] = []
        self._folder, self._n_files = path.parent, 0
        self._add_file(path, ())
        if not self.cards:
            raise ReadError(path, "holds no keyword line (as *NODE)")

    def _add_file(self, path: Path, including: tuple[Path, ...]) -> None:
        """Add the cards of one file; `including`: the files that include it."""
        self._n_files += 1
        if self._n_files > _MOST_FILES:
            raise ReadError(path, f"includes more than {_MOST_FILES} files")
        data = bytes(SourceFile(path).data)
        begin, line = 0, 1
        for match in _KEYWORD_LINE.finditer(data):
            start = match.start()
            self._add_lines(Span(path, data, begin, start, line))
            line += data.count(b"\n", begin, start)
            text, begin = _with_continuation(path, data, start, match.end(), line)
            keyword, _, rest = text[1:].partition(",")
            name = " ".join(keyword.split()).upper()
            parameters = _PARAMETER.finditer(rest) if rest.strip() else ()
            options = {"".join(match[1].split()).upper(): match[2] or "" for match in parameters}
            card = Card(name, name.replace(" ", ""), options, Span(path, data, start, begin, line))
            line += data.count(b"\n", start, begin)
            if card.key != "INCLUDE":
                self.cards.append(card)
            if card.key == "INCLUDE" or (card.key in _WITH_INPUT and "INPUT" in card.options):
                self._include(card, (*including, path.resolve()))
        self._add_lines(Span(path, data, begin, len(data), line))

    def _add_lines(self, span: Span) -> None:
        """Add lines to the body of the last card."""
        if span.begin < span.end:
            (self.cards[-1].body if self.cards else self.start).append(span)

    def _include(self, card: Card, chain: tuple[Path, ...]) -> None:
        name = card.options.get("INPUT", "").strip('"')
        if not name:
            raise card.error("*INCLUDE should name a file: *INCLUDE, INPUT=name")
        path = next((p for p in (card.head.path.parent / name, self._folder / name) if p.is_file()), None)
        if path is None:
            raise card.error(f"the file {name!r}, which is included here, is not there")
        if path.resolve() in chain or len(chain) >= _DEEPEST:
            what = "includes itself" if path.resolve() in chain else f"is the {_DEEPEST}th file inside others"
            raise card.error(f"the file {name!r}, which is included here, {what}")
        self._add_file(path, chain)


def _with_continuation(path: Path, data: bytes, start: int, end: int, line: int) -> tuple[str, int]:
    """Return the text of a keyword line joined with its continuation lines, and where the last of them ends.

    A line with a number among its fields is data: CalculiX takes a comma at the end of a keyword line for nothing.
    """
    text = decoded(data[start:end]).strip()
    while text.endswith(",") and end < len(data) and len(text) <= _LONGEST:
        begin, end = end, data.find(b"\n", end) + 1 or len(data)
        more = decoded(data[begin:end]).strip()
        if more.startswith("*") or not more or _NUMBERS.search(more):
            return text, begin
        text += more
    if len(text) > _LONGEST:
        raise ReadError(path, f"this keyword line has more than {_LONGEST} characters", f"line {line}")
    return text, end


# ---- data lines of *NODE, *ELEMENT, *NSET, *ELSET and *SURFACE


class Members(NamedTuple):
    """Members of a set, or elements of a surface with the label of one of their faces.

    `listed`: numbers (k,), a range of numbers, or the name of a set; `of`: "node" or "element", what they are.
    """

    listed: Ints | range | str
    of: str
    face: str = ""

    def raised(self, inside: DeckInstance) -> Members:
        """Return the members with the numbers and names that those of an instance have in the mesh."""
        by, listed = inside.nodes if self.of == "node" else inside.elements, self.listed
        if isinstance(listed, str):
            return self._replace(listed=key_of(inside.prefix) + key_of(listed))
        if isinstance(listed, range):
            return self._replace(listed=range(listed.start + by, listed.stop + by, listed.step))
        return self._replace(listed=listed + by)


def node_lines(card: Card) -> tuple[Ints, Floats]:
    """Return numbers (n,) and coordinates (n, 3) of the nodes of a card; missing ones are 0. Raises ReadError."""
    text = card.text()
    counts = values_in_lines(text)
    counts = counts[counts > 0]
    values = parsed(text.translate(AS_REALS), np.float64)
    even = values is not None and len(counts) and counts.min() == counts.max() >= 2
    if values is not None and even and len(values) == counts.sum():  # no field between commas is empty
        table = values.reshape(len(counts), -1)[:, :4]
    else:
        table = _uneven_table(card, text)
    with np.errstate(invalid="ignore"):
        number = table[:, 0].astype(np.int64)
    possible = (number == table[:, 0]) & (number > 0) & (number <= LARGEST)
    finite = np.isfinite(table).all(axis=1)
    if not (possible & finite).all():
        row = int((possible & finite).argmin())
        message = f"the coordinates of node {number[row]} are not finite numbers"
        if not possible[row]:
            message = f"a node's number should be an integer from 1 to {LARGEST}, not {table[row, 0]:g}"
        raise card.error(message, [match.start() for match in _SOLID_LINE.finditer(text)][row])
    return number, np.pad(table[:, 1:], ((0, 0), (0, 4 - table.shape[1])))


def _uneven_table(card: Card, text: bytes) -> Floats:
    """Numbers (n, 4) of lines of unequal length, read one by one; those that are left out are 0."""
    rows = []
    for line in _SOLID_LINE.finditer(text.replace(b"D", b"e").replace(b"d", b"e")):
        fields = [field.strip() or b"0" for field in line[0].split(b",")[:4]]
        try:
            rows.append([float(field) for field in fields] + [0.0] * (4 - len(fields)))
        except ValueError:
            shown = decoded(text[line.start() : line.end()]).strip()[:60]
            raise card.error(f"{shown!r} should be a node's number and its coordinates", line.start()) from None
    return np.array(rows, float).reshape(-1, 4)


def element_lines(card: Card, n_nodes: int) -> tuple[Ints, Ints]:
    """Elements of a card as rows (k, 1 + n_nodes) of number and nodes; an element may continue over several lines.

    If all lines have equally many numbers, more than an element needs, the surplus is left out, as CalculiX does (the
    orientation node of a beam); the second array, (k,), counts what was left out of each row. Raises ReadError.
    """
    text, width = card.text(), 1 + n_nodes
    values = integers(text)
    if values is None:
        at = bad_line(text.translate(AS_INTEGERS), np.int64)
        shown = decoded(text[at:].split(b"\n", 1)[0]).strip()[:60]
        raise card.error(f"{shown!r} should be an element's number and its nodes'", at)
    counts = values_in_lines(text)
    ends = np.cumsum(counts)
    widest = int(counts.max(initial=0))
    if len(ends) and ends[-1] != len(values):
        raise card.error("there are fields without a number among these elements", 0)
    if widest > width and set(np.unique(counts).tolist()) <= {0, widest}:
        rows = values.reshape(-1, widest)[:, :width]
    else:
        widest = width
        wrong = np.flatnonzero(~mask_of(len(values) + 1, [0], ends)[width::width])
        if len(wrong):
            line = int(np.searchsorted(ends, wrong[0] * width, side="right"))
            at = sum(len(row) + 1 for row in text.split(b"\n", line + 1)[:line])
            raise card.error(f"an element here should have {n_nodes} nodes, and the next one begin a line", at)
        if more := len(values) % width:
            message = f"element {values[-more]} has {more - 1} nodes, and should have {n_nodes}"
            raise card.error(message, len(text) - 1)
        rows = values.reshape(-1, width)
    possible = (rows > 0) & (rows <= LARGEST)
    if not possible.all():
        wrong = rows[~possible][0]
        raise card.error(f"numbers of elements and nodes run from 1 to {LARGEST}, and one here is {wrong}")
    return rows, np.full(len(rows), widest - width)


def members_of(card: Card, of: str) -> list[Members]:
    """Return the members that the data lines of a set or a surface list. Raises ReadError.

    A line of a surface is an element or a set, and a face; of a surface of nodes the first field is read alone.
    """
    text, generated, surface = card.text(), "GENERATE" in card.options, card.key == "SURFACE"
    rows = _FACE.findall(text) if surface and of == "element" else []
    if rows and len(rows) == int(np.count_nonzero(values_in_lines(text))):
        number = np.array([row[0] for row in rows], dtype="S").astype(np.int64)
        face = np.array([row[1].upper() for row in rows], dtype="S")
        return [Members(number[face == label], of, decoded(bytes(label))) for label in sorted(set(face.tolist()))]
    if not generated and not surface and (listed := integers(text)) is not None:
        return [Members(listed, of)]
    members: list[Members] = []
    numbers: list[int] = []
    for line in _SOLID_LINE.finditer(text):
        fields = [part.strip() for part in decoded(line[0]).split(",")]
        label = ""
        if surface:
            if not fields[0]:
                raise card.error("a surface's line should begin with an element or a set of elements", line.start())
            label = fields[1].upper() if len(fields) > 1 and of == "element" else ""
            fields = fields[:1]
        fields = [part for part in fields if part]
        if generated and fields:
            if len(fields) not in (2, 3) or not all(_NUMBER.fullmatch(text) for text in fields):
                shown = ", ".join(fields)[:60]
                raise card.error(f"{shown!r} should be first, last, step of numbers to generate", line.start())
            first, last, step = (*map(int, fields), 1)[:3]
            if step < 1:
                raise card.error(f"the step of numbers to generate is {step}, and should be 1 or more", line.start())
            members.append(Members(range(first, last + 1, step), of))
            continue
        numbers += [int(text) for text in fields if _NUMBER.fullmatch(text) and not surface]
        members += [Members(text, of, label) for text in fields if not _NUMBER.fullmatch(text)]
        members += [Members(np.array([int(text)]), of, label) for text in fields if _NUMBER.fullmatch(text) and surface]
    return [Members(np.array(numbers, np.int64), of), *members] if numbers else members
