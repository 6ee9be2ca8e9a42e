"""The deck behind a mesh: every card of the .inp file that it was read from, in order, as plain text with its place.

`lacmesh.formats.inp` reads and writes it; lacsolver takes materials, loads and steps from it. A card's nodes and
elements are in the mesh alone: each cell has, in `cell_data["inp_card"]`, the index of the card that made it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from lacmesh.errors import ReadError
from lacmesh.mesh import Ints, Mesh

#: data of cells: `DeckCard.index` of the card of each cell, -1 for a cell of no card; a cut hands it to the children
INP_CARD = "inp_card"
_COMMENT = re.compile(r"^[ \t]*\*\*[^\n]*\n", re.MULTILINE)
_QUOTED = re.compile(r'\s*".*"\s*', re.DOTALL)


class DataLine(NamedTuple):
    """A line, word for word, and its place."""

    text: str
    file: str
    line: int

    @property
    def is_data(self) -> bool:
        """True if the line is neither blank nor a comment."""
        return bool(self.text.strip()) and not self.text.lstrip().startswith("**")

    @property
    def fields(self) -> tuple[str, ...]:
        """Fields of the line: the text between commas, without blanks around it; a comma at the end adds no field.

        >>> DataLine("Nfix, 1,3 ,\\n", "a.inp", 7).fields
        ('Nfix', '1', '3')
        """
        fields = tuple(part.strip() for part in self.text.split(","))
        return fields[:-1] if len(fields) > 1 and not fields[-1] else fields


class Lines(NamedTuple):
    """Lines that follow each other in a file, word for word: comments, blank lines and data; `line` is the first's."""

    text: str
    file: str
    line: int

    def each(self) -> Iterator[DataLine]:
        """Iterate over the lines, with their ends."""
        for k, text in enumerate(self.text.splitlines(keepends=True)):
            yield DataLine(text, self.file, self.line + k)


@dataclass(frozen=True)
class DeckCard:
    """A card: its keyword line and the lines up to the next one, with their place.

    `name`: the keyword in capitals with single blanks, "SOLID SECTION". `options`: the keyword line's parameters, by
    name in capitals, with their values as written ("" without one), quotes included. `head`: the keyword line, word for
    word, with its continuation lines. `body`: the lines that follow it, by the files that they stand in; that of a
    *NODE, and of an *ELEMENT whose cells say the same, has comments alone. `numbers`: of the nodes or elements that
    the card makes, None for any other card, and where those of the mesh differ (`Deck.numbers_differ`). `index`: what
    the cells of an *ELEMENT have in `cell_data["inp_card"]`.
    """

    name: str
    options: Mapping[str, str]
    file: str
    line: int
    head: str
    body: tuple[Lines, ...] = ()
    numbers: Ints | None = None
    index: int = -1

    @property
    def key(self) -> str:
        """Name without blanks, by which cards are compared: both programs ignore blanks."""
        return self.name.replace(" ", "")

    @property
    def place(self) -> str:
        """File and line of the keyword line, for a message."""
        return f"{self.file}, line {self.line}"

    @cached_property
    def data(self) -> tuple[DataLine, ...]:
        """The data lines, without comments and blank lines."""
        lines = (line for part in self.body for line in part.each() if line.is_data)
        return tuple(line._replace(text=line.text.rstrip("\r\n")) for line in lines)

    @property
    def comments(self) -> tuple[Lines, ...]:
        """The comments of the body."""
        found = (_COMMENT.findall(part.text) if "**" in part.text else () for part in self.body)
        return tuple(part._replace(text="".join(lines)) for part, lines in zip(self.body, found, strict=True))

    @property
    def values(self) -> bytes:
        """The lines of the body as one text; comments are blank lines."""
        text = "".join(part.text for part in self.body)
        return (_COMMENT.sub("\n", text) if "**" in text else text).encode(errors="surrogateescape")

    @property
    def rows(self) -> list[bytes]:
        """The data lines as in `values`."""
        return [row for row in self.values.splitlines() if row.strip()]

    def error(self, message: str, at: int | None = None) -> ReadError:
        """Make the error for a byte of `values`, or for the keyword line."""
        if at is not None:
            row = self.values.count(b"\n", 0, at)
            for part in self.body:
                if row < (n := part.text.count("\n")):
                    return ReadError(part.file, message, f"line {part.line + row}")
                row -= n
        return ReadError(self.file, message, f"line {self.line}")


class DeckInstance(NamedTuple):
    """An instance of a part: by how much numbers of its nodes and elements are raised in the mesh.

    `prefix`: what precedes the names of its sets there. `rotated`: its part is rotated.
    """

    name: str
    part: str
    prefix: str
    nodes: int
    elements: int
    rotated: bool = False


@dataclass(frozen=True, eq=False)
class Deck:
    """All cards of a deck in order, *INCLUDE resolved, and the mesh as it was read.

    `start`: the lines before the first card. `mesh`: the mesh as read, which `Mesh.deck` of a later mesh still refers
    to. `groups`: kind of a set ("NSET", "ELSET") or surface ("ELEMENT", "NODE"), and its name for comparison (`key_of`)
    -> name of the mesh's group. One of cells holds the cells of an element set and the skin cells of a surface of that
    name. `labels`: names of groups in the deck where they are not those of the mesh.
    `numbers_differ`: why the numbers on cards are not those of the mesh (instances), else empty. Of a deck with
    `instances`, `instance_numbers`: place of a card of nodes or elements, their numbers in the mesh and the index of
    the card, once for each instance; `assembly_offset`: by how much the assembly's numbers are raised.
    """

    path: str
    cards: tuple[DeckCard, ...]
    mesh: Mesh
    start: tuple[Lines, ...] = ()
    groups: Mapping[tuple[str, str], str] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    numbers_differ: str = ""
    instances: tuple[DeckInstance, ...] = ()
    instance_numbers: tuple[tuple[int, Ints, int], ...] = ()
    assembly_offset: tuple[int, int] = (0, 0)

    @property
    def model(self) -> tuple[DeckCard, ...]:
        """The cards before the first *STEP."""
        return self.cards[: next((k for k, card in enumerate(self.cards) if card.key == "STEP"), len(self.cards))]

    @property
    def steps(self) -> tuple[tuple[DeckCard, ...], ...]:
        """The cards of each step, from its *STEP up to the card before the next one."""
        begins = [k for k, card in enumerate(self.cards) if card.key == "STEP"]
        return tuple(self.cards[a:b] for a, b in zip(begins, [*begins[1:], len(self.cards)], strict=True))

    def named(self, *keys: str) -> Iterator[DeckCard]:
        """Iterate over the cards of some names (`DeckCard.key`), in order."""
        return (card for card in self.cards if card.key in keys)

    def groups_of(self, *kinds: str) -> dict[str, str]:
        """Return the groups of sets or surfaces of some kinds, by their names for comparison."""
        return {key: group for (kind, key), group in self.groups.items() if kind in kinds}

    def node_group(self, name: str) -> str | None:
        """Name of the mesh's group of nodes that a card means by `name`; None if there is no such node set."""
        return self.groups.get(("NSET", key_of(name)))

    def element_group(self, name: str) -> str | None:
        """Name of the mesh's group of cells that a card means by `name`; None if there is no such element set."""
        return self.groups.get(("ELSET", key_of(name)))

    def surface_group(self, name: str) -> tuple[str, str] | None:
        """Type of the surface that a card means by `name`, and its group: ELEMENT, of cells; NODE, of nodes."""
        groups = ((kind, self.groups.get((kind, key_of(name)))) for kind in ("ELEMENT", "NODE"))
        return next(((kind, group) for kind, group in groups if group is not None), None)


def key_of(name: str) -> str:
    """Name of a set or surface in the form used for comparison: case and blanks count between quotes only.

    >>> key_of(" Top face"), key_of('"Top face"')
    ('TOPFACE', '"Top face"')
    """
    return name.strip() if _QUOTED.fullmatch(name) else shown_name(name).upper()


def shown_name(name: str) -> str:
    """Name of a set or surface as a group has it: without quotes, or without blanks."""
    return name.strip()[1:-1] if _QUOTED.fullmatch(name) else "".join(name.split())
