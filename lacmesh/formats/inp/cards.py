"""Split of an .inp file into cards: a keyword line with its parameters, and the lines that follow it, as arrays.

Keyword lines begin with one asterisk, comments with two; a keyword line that ends with a comma continues on the next
line. *INCLUDE inserts another file in its place, data lines included, as does the parameter INPUT of a card.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lacmesh.deck import DeckCard, DeckInstance, Lines, key_of
from lacmesh.errors import ReadError, reading
from lacmesh.formats.text import decoded, integers
from lacmesh.mesh import Floats, Ints

#: What a comment line with a part of lacmesh's note begins with.
NOTE = "** lacmesh: "
NOTE_LINE = re.compile(rf"^{re.escape(NOTE)}(.*)\n", re.MULTILINE)
_KEYWORD_LINE = re.compile(r"^[ \t]*\*(?!\*)[^\n]*\n", re.MULTILINE)
_PARAMETER = re.compile(r'\s*([^,="]+?)\s*(?:=\s*("[^"]*"|[^,]*?)\s*)?(?:,|$)')
#: A field that is a number, as no parameter without a value is.
_NUMBERS = re.compile(r"(?:^|,)\s*[-+.0-9][-+.0-9eEdD]*\s*(?:,|$)")
#: Cards of which the parameter INPUT names a file with their data lines.
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")
#: Largest number of a node or an element: both programs read nine digits.
LARGEST = 999_999_999
_NUMBER = re.compile(r"[+-]?\d{1,18}")
_SOLID_LINE = re.compile(rb"[^\n]*\S[^\n]*\n")
#: Files inside files: how deep, and how many in all; characters of a keyword line.
_DEEPEST, _MOST_FILES, _LONGEST = 16, 10_000, 4096


class Cards:
    """Cards of a file and of those that it includes, in order; `start`: the lines before the first."""

    def __init__(self, path: Path) -> None:
        """Read the files. Raises ReadError."""
        self._heads: list[DeckCard] = []
        self._bodies: list[list[Lines]] = [[]]  # first the lines before all cards
        self._folder, self._n_files = path.parent, 0
        self._add_file(path, ())
        if not self._heads:
            raise ReadError(path, "holds no keyword line (as *NODE)")
        self.start, *bodies = map(tuple, self._bodies)
        self.cards = [replace(card, body=body) for card, body in zip(self._heads, bodies, strict=True)]

    def _add_file(self, path: Path, including: tuple[Path, ...]) -> None:
        """Add the cards of one file; `including`: the files that include it."""
        self._n_files += 1
        if self._n_files > _MOST_FILES:
            raise ReadError(path, f"includes more than {_MOST_FILES} files")
        with reading(path):
            text = path.read_bytes().decode(errors="surrogateescape")
        text += "" if text.endswith("\n") else "\n"
        begin, line = 0, 1
        for match in _KEYWORD_LINE.finditer(text):
            self._add_lines(Lines(text[begin : match.start()], str(path), line))
            line += text.count("\n", begin, match.start())
            head, begin = _with_continuation(path, text, match.start(), match.end(), line)
            keyword, _, rest = head[1:].partition(",")
            name = " ".join(keyword.split()).upper()
            parameters = _PARAMETER.finditer(rest) if rest.strip() else ()
            options = {"".join(match[1].split()).upper(): match[2] or "" for match in parameters}
            card = DeckCard(name, options, str(path), line, text[match.start() : begin], index=len(self._heads))
            line += card.head.count("\n")
            if card.key != "INCLUDE":
                self._heads.append(card)
                self._bodies.append([])
            if card.key == "INCLUDE" or (card.key in _WITH_INPUT and "INPUT" in card.options):
                self._include(card, (*including, path.resolve()))
        self._add_lines(Lines(text[begin:], str(path), line))

    def _add_lines(self, lines: Lines) -> None:
        """Add lines to the body of the last card."""
        if lines.text:
            self._bodies[-1].append(lines)

    def _include(self, card: DeckCard, chain: tuple[Path, ...]) -> None:
        name = card.options.get("INPUT", "").strip('"')
        if not name:
            raise card.error("*INCLUDE should name a file: *INCLUDE, INPUT=name")
        path = next((p for p in (Path(card.file).parent / name, self._folder / name) if p.is_file()), None)
        if path is None:
            raise card.error(f"the file {name!r}, which is included here, is not there")
        if path.resolve() in chain or len(chain) >= _DEEPEST:
            what = "includes itself" if path.resolve() in chain else f"is the {_DEEPEST}th file inside others"
            raise card.error(f"the file {name!r}, which is included here, {what}")
        self._add_file(path, chain)


def _with_continuation(path: Path, text: str, start: int, end: int, line: int) -> tuple[str, int]:
    """Return a keyword line joined with its continuation lines, and where the last of them ends.

    A line with a number among its fields is data: CalculiX takes a comma at the end of a keyword line for nothing.
    """
    head = _legible(text[start:end])
    while head.endswith(",") and end < len(text) and len(head) <= _LONGEST:
        begin, end = end, text.find("\n", end) + 1
        more = _legible(text[begin:end])
        if more.startswith("*") or not more or _NUMBERS.search(more):
            return head, begin
        head += more
    if len(head) > _LONGEST:
        raise ReadError(path, f"this keyword line has more than {_LONGEST} characters", f"line {line}")
    return head, end


def _legible(line: str) -> str:
    """A line without the blanks around it; what is not UTF-8 in it is latin-1."""
    return decoded(line.encode(errors="surrogateescape")).strip()


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


def node_lines(card: DeckCard) -> tuple[Ints, Floats]:
    """Return numbers (n,) and coordinates (n, 3) of the nodes of a card; missing ones are 0. Raises ReadError."""
    text, rows = card.values, []
    for line in _SOLID_LINE.finditer(text.replace(b"D", b"e").replace(b"d", b"e")):
        fields = line[0].split(b",", 4)[:4]
        try:
            rows.append([float(field.strip() or b"0") for field in fields] + [0.0] * (4 - len(fields)))
        except ValueError:
            shown = decoded(text[line.start() : line.end()]).strip()[:60]
            raise card.error(f"{shown!r} should be a node's number and its coordinates", line.start()) from None
    table = np.array(rows, float).reshape(-1, 4)
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
    return number, table[:, 1:]


def element_lines(card: DeckCard, n_nodes: int) -> tuple[Ints, int]:
    """Elements of a card as rows (k, 1 + n_nodes) of number and nodes; an element may continue over several lines.

    If all lines have equally many numbers, more than an element needs, the surplus is left out, as CalculiX does (the
    orientation node of a beam), and counted in the second value. Raises ReadError.
    """
    text, width = card.values, 1 + n_nodes
    listed, begins, sizes = list[list[int]](), list[int](), set[int]()
    for line in _SOLID_LINE.finditer(text):
        try:
            if b"_" in line[0]:  # which Python takes for a part of a number
                raise ValueError
            numbers = list(map(int, line[0].strip().removesuffix(b",").split(b",")))
        except ValueError:
            shown = decoded(line[0]).strip()[:60]
            raise card.error(f"{shown!r} should be an element's number and its nodes'", line.start()) from None
        sizes.add(len(numbers))
        if listed and len(listed[-1]) < width:
            listed[-1] += numbers
        else:
            listed.append(numbers)
            begins.append(line.start())
    surplus = max(sizes, default=0) - width if len(sizes) == 1 else 0
    if surplus > 0:
        listed = [row[:width] for row in listed]
    for row, at in zip(listed, begins, strict=True):
        if len(row) > width:
            raise card.error(f"an element here should have {n_nodes} nodes, and the next one begin a line", at)
        if not 0 < min(row) <= max(row) <= LARGEST:
            wrong = min(row) if min(row) < 1 else max(row)
            raise card.error(f"numbers of elements and nodes run from 1 to {LARGEST}, and one here is {wrong}", at)
    if listed and len(listed[-1]) < width:
        message = f"element {listed[-1][0]} has {len(listed[-1]) - 1} nodes, and should have {n_nodes}"
        raise card.error(message, len(text) - 1)
    return np.array(listed, np.int64).reshape(-1, width), max(surplus, 0)


def members_of(card: DeckCard, of: str) -> list[Members]:
    """Return the members that the data lines of a set or a surface list. Raises ReadError.

    A line of a surface is an element or a set, and a face; of a surface of nodes the first field is read alone.
    """
    text, generated, surface = card.values, "GENERATE" in card.options, card.key == "SURFACE"
    if not generated and not surface and (listed := integers(text)) is not None:
        return [Members(listed, of)]
    members: list[Members] = []
    numbers: dict[str, list[int]] = {}  # by the label of a face
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
        for field in fields:
            if not _NUMBER.fullmatch(field):
                members.append(Members(field, of, label))
            elif label or not surface:
                numbers.setdefault(label, []).append(int(field))
            else:
                members.append(Members(np.array([int(field)]), of))
    return [*(Members(np.array(listed), of, label) for label, listed in sorted(numbers.items())), *members]
