"""The deck behind a mesh: every card of the .inp file that it was read from, in order, as plain text with its place.

Only `lacmesh.formats.inp` makes it and writes it again; a cut notes here what it replaced, and who solves a deck reads
materials, loads and steps from it. A card's nodes and elements are not repeated here: they are in the mesh.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lacmesh.mesh import Ints, Mesh, fixed, positions

if TYPE_CHECKING:
    from lacmesh.cutting.assemble import NewNodes


class DataLine(NamedTuple):
    """A data line, word for word, and its place; comments and blank lines are none."""

    text: str
    file: str
    line: int

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


@dataclass(frozen=True)
class DeckCard:
    """A card: its keyword line and the lines up to the next one, with their place.

    `name`: the keyword in capitals with single blanks, "SOLID SECTION". `options`: the keyword line's parameters, by
    name in capitals, with their values as written ("" without one), quotes included. `head`: the keyword line, word for
    word, with its continuation lines. `body`: the lines that follow it, by the files that they stand in; that of a
    *NODE, and of an *ELEMENT whose cells say the same, has comments alone. `numbers`: of the nodes or elements that
    the card makes, None for any other card, and where those of the mesh are others (`Deck.apart`).
    """

    name: str
    options: Mapping[str, str]
    file: str
    line: int
    head: str
    body: tuple[Lines, ...] = ()
    numbers: Ints | None = None

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
        lines = []
        for part in self.body:
            for k, text in enumerate(part.text.splitlines()):
                if text.strip() and not text.lstrip().startswith("**"):
                    lines.append(DataLine(text, part.file, part.line + k))
        return tuple(lines)


@dataclass(frozen=True)
class DeckInstance:
    """An instance of a part: by how much numbers of its nodes and elements are raised in the mesh, `prefix`: what
    stands before the names of its sets there. `turned`: it is rotated.
    """

    name: str
    part: str
    prefix: str
    nodes: int
    elements: int
    turned: bool


@dataclass(frozen=True, eq=False)
class Deck:
    """All cards of a deck in order, *INCLUDE resolved, and the mesh as it was read.

    `start`: the lines before the first card. `mesh`: the mesh as read, which `Mesh.deck` of a later mesh still refers
    to. `node_sets`, `element_sets`: name for comparison (`key_of`) -> name of the group of the mesh; `surfaces`: the
    same for ("ELEMENT" or "NODE", name). A group of cells holds the cells of an element set and the skin cells of a
    surface of the same name. `apart`: why the numbers on cards are not those of the mesh (instances), else empty.
    Of a deck with `instances`, `placed`: the index of each card of nodes or elements and their numbers in the mesh, in
    the order of this, once for each instance; `own`: by how much numbers of the assembly's own nodes and elements are
    raised.
    What the mesh went through since: `child` (c,), `root` (c,): numbers of the elements that took the place of
    elements of the deck, and of these; `added`: the new nodes, in order.
    """

    path: str
    cards: tuple[DeckCard, ...]
    mesh: Mesh
    start: tuple[Lines, ...] = ()
    node_sets: Mapping[str, str] = field(default_factory=dict)
    element_sets: Mapping[str, str] = field(default_factory=dict)
    surfaces: Mapping[tuple[str, str], str] = field(default_factory=dict)
    apart: str = ""
    instances: tuple[DeckInstance, ...] = ()
    placed: tuple[tuple[int, Ints], ...] = ()
    own: tuple[int, int] = (0, 0)
    child: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    root: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    added: tuple[NewNodes, ...] = ()

    def __post_init__(self) -> None:
        for name in ("child", "root"):
            object.__setattr__(self, name, fixed(getattr(self, name)))

    @property
    def model(self) -> tuple[DeckCard, ...]:
        """The cards before the first *STEP."""
        first = next((k for k, card in enumerate(self.cards) if card.key == "STEP"), len(self.cards))
        return self.cards[:first]

    @property
    def steps(self) -> tuple[tuple[DeckCard, ...], ...]:
        """The cards of each step, from its *STEP up to the card before the next one."""
        begins = [k for k, card in enumerate(self.cards) if card.key == "STEP"]
        return tuple(self.cards[a:b] for a, b in zip(begins, [*begins[1:], len(self.cards)], strict=True))

    def named(self, *keys: str) -> Iterator[DeckCard]:
        """Iterate over the cards of some names (`DeckCard.key`), in order."""
        return (card for card in self.cards if card.key in keys)

    def node_group(self, name: str) -> str | None:
        """Name of the mesh's group of nodes that a card means by `name`; None if there is no such node set."""
        return self.node_sets.get(key_of(name))

    def element_group(self, name: str) -> str | None:
        """Name of the mesh's group of cells that a card means by `name`; None if there is no such element set."""
        return self.element_sets.get(key_of(name))

    def surface_group(self, name: str) -> tuple[str, str] | None:
        """Type of the surface that a card means by `name`, and its group: ELEMENT, of cells; NODE, of nodes."""
        groups = [(kind, self.surfaces[kind, key_of(name)]) for kind in ("ELEMENT", "NODE")
                 if (kind, key_of(name)) in self.surfaces]  # fmt: skip
        return groups[0] if groups else None

    def roots_of(self, numbers: Ints) -> Ints:
        """The numbers of the deck's elements that elements, by number, are or are parts of; their own where of none."""
        order = np.argsort(self.child, kind="stable")
        at = positions(self.child[order], numbers)
        roots = numbers.copy()
        roots[at >= 0] = self.root[order][at[at >= 0]]
        return roots

    def followed(self, child: Ints, parent: Ints, added: tuple[NewNodes, ...]) -> Deck:
        """The deck of a mesh in which elements were replaced, both by number (c,), and nodes were added."""
        keep = ~np.isin(self.child, parent)
        return replace(
            self,
            child=np.append(self.child[keep], child),
            root=np.append(self.root[keep], self.roots_of(parent)),
            added=(*self.added, *added),
        )


def key_of(name: str) -> str:
    """Name of a set or surface in the form used for comparison: case and blanks count between quotes only.

    >>> key_of(" Top face"), key_of('"Top face"')
    ('TOPFACE', '"Top face"')
    """
    name = name.strip()
    return name if len(name) > 1 and name[0] == name[-1] == '"' else "".join(name.split()).upper()
