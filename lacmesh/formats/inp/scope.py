"""Scopes of an .inp file: the nodes, elements, sets and surfaces that a part defines, by number and by name.

A file without parts is one scope. An instance of a part is that part's scope merged into the assembly's: its numbers
are raised past those taken, its names preceded by the instance's name and a point, as Abaqus writes them.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lacmesh.errors import did_you_mean
from lacmesh.formats.inp.cards import Card, label
from lacmesh.formats.inp.data import Members, key
from lacmesh.formats.inp.types import DeckElement
from lacmesh.mesh import Floats, Ints, concatenated, positions

#: Sets inside sets: how deep.
_DEEPEST = 500


@dataclass
class NodeCard:
    """Nodes of one card: numbers (n,), coordinates (n, 3)."""

    card: Card
    number: Ints
    points: Floats


@dataclass
class ElementCard:
    """Elements of one card: their type (None if they are no cells), numbers (k,), nodes (k, n) by number."""

    card: Card
    element: DeckElement | None
    number: Ints
    nodes: Ints


@dataclass
class Set:
    """A set of nodes or elements: its name, the members its cards list, and element sets whose nodes it contains."""

    shown: str
    card: Card
    members: list[Members] = field(default_factory=list)
    of_elements: list[str] = field(default_factory=list)


@dataclass
class SurfaceCard:
    """A surface: its name, and for each entry the label of a face, and elements by number or the name of a set.

    `of_nodes`: its entries are nodes, or sets of nodes, and have no label.
    """

    shown: str
    card: Card
    entries: list[tuple[str, Ints | str]]
    of_nodes: bool = False


@dataclass
class Scope:
    """Everything that one part, or a file without parts, defines.

    Keys are names in the form used for comparison (`inp.scan.label`), for surfaces preceded by their type, ELEMENT or
    NODE.
    """

    nodes: list[NodeCard] = field(default_factory=list)
    elements: list[ElementCard] = field(default_factory=list)
    node_sets: dict[str, Set] = field(default_factory=dict)
    element_sets: dict[str, Set] = field(default_factory=dict)
    surfaces: dict[tuple[str, str], SurfaceCard] = field(default_factory=dict)

    def sets(self, of: str) -> dict[str, Set]:
        """The sets of nodes ("node") or of elements ("element")."""
        return self.node_sets if of == "node" else self.element_sets

    def add_to(self, of: str, name: str, card: Card, members: Members | None = None, elements: str = "") -> None:
        """Add members to a set, which need not exist yet."""
        shown, known_as = label(name)
        known = self.sets(of).setdefault(known_as, Set(shown, card))
        if members is not None:
            known.members.append(members)
        if elements:
            known.of_elements.append(key(elements))

    def largest(self) -> tuple[int, int]:
        """The largest number of a node, and of an element; 0 where there is none."""
        return (
            max((int(n.number.max()) for n in self.nodes if len(n.number)), default=0),
            max((int(e.number.max()) for e in self.elements if len(e.number)), default=0),
        )

    def add(self, other: Scope, prefix: str, nodes: int, elements: int) -> None:
        """Merge another scope into this one: numbers raised by `nodes` and `elements`, names preceded by `prefix`."""
        self.nodes += [NodeCard(n.card, n.number + nodes, n.points) for n in other.nodes]
        self.elements += [ElementCard(e.card, e.element, e.number + elements, e.nodes + nodes) for e in other.elements]
        before = key(prefix)
        for of, by in (("node", nodes), ("element", elements)):
            for name, old in other.sets(of).items():
                merged = self.sets(of).setdefault(before + name, Set(prefix + old.shown, old.card))
                merged.members += [raised(m, by, before) for m in old.members]
                merged.of_elements += [before + n for n in old.of_elements]
        for (surface_type, name), surface in other.surfaces.items():
            by = nodes if surface.of_nodes else elements
            entries = [(f, before + key(w) if isinstance(w, str) else w + by) for f, w in surface.entries]
            self.surfaces[surface_type, before + name] = SurfaceCard(
                prefix + surface.shown, surface.card, entries, surface.of_nodes
            )


def raised(members: Members, by: int, prefix: str) -> Members:
    """Members with numbers raised by `by`, and names preceded by a prefix."""
    ranges = tuple(range(r.start + by, r.stop + by, r.step) for r in members.ranges)
    return Members(members.numbers + by, ranges, tuple(prefix + key(n) for n in members.names))


class Resolver:
    """Resolves sets, nested ones too, into numbers; `present`: existing numbers, sorted, of "node" and "element"."""

    def __init__(self, scope: Scope, present: dict[str, Ints], nodes_of: NodesOf) -> None:
        self.scope = scope
        self.present = present
        self._nodes_of = nodes_of
        self._found: dict[tuple[str, str], Ints] = {}
        self._open: list[tuple[str, str]] = []
        #: members that do not exist, and were left out
        self.strays = 0

    def numbers(self, of: str, name: str, card: Card) -> Ints:
        """Sorted numbers in a set; `card`: the card that refers to it, for the error. Raises ReadError."""
        known_as = self._known(of, name, card)
        at = (of, known_as)
        if at in self._found:
            return self._found[at]
        if at in self._open or len(self._open) >= _DEEPEST:
            raise card.error(f"the set {name!r} contains itself, or too many sets inside one another")
        self._open.append(at)
        listed_set = self.scope.sets(of)[known_as]
        parts: list[Ints] = [np.empty(0, np.int64)]
        for listed in listed_set.members:
            parts.append(self.existing(of, listed.numbers))
            parts += [self._generated(of, r) for r in listed.ranges]
            parts += [self.numbers(of, n, listed_set.card) for n in listed.names]
        parts += [self._nodes_of(self.numbers("element", n, listed_set.card)) for n in listed_set.of_elements]
        self._open.pop()
        self._found[at] = ordered(np.concatenate(parts))
        return self._found[at]

    def _known(self, of: str, name: str, card: Card) -> str:
        sets = self.scope.sets(of)
        if key(name) in sets:
            return key(name)
        if name in sets:  # a key already
            return name
        shown = [s.shown for s in sets.values()]
        raise card.error(f"there is no set of {of}s named {name!r}{did_you_mean(name, shown)}")

    def existing(self, of: str, numbers: Ints) -> Ints:
        """Select the numbers that exist; the others are counted in `strays`."""
        present = self.present[of]
        if not len(present) or not len(numbers):
            self.strays += len(numbers)
            return numbers[:0]
        if numbers is present or np.array_equal(numbers, present):
            return numbers
        known = positions(present, numbers) >= 0
        self.strays += int((~known).sum())
        return numbers[known]

    def _generated(self, of: str, r: range) -> Ints:
        present = self.present[of]
        inside = present[np.searchsorted(present, r.start) : np.searchsorted(present, r.stop)]
        return inside[(inside - r.start) % r.step == 0]


def ordered(numbers: Ints) -> Ints:
    """Distinct numbers, sorted; np.unique takes ten times as long for millions."""
    if (numbers[1:] > numbers[:-1]).all():
        return numbers
    numbers = np.sort(numbers)
    return numbers[np.append(True, numbers[1:] != numbers[:-1])]


class NodesOf:
    """Lookup of the nodes of elements, all by number."""

    def __init__(self, elements: Iterable[ElementCard]) -> None:
        self._cells = [e for e in elements if e.element is not None]

    def __call__(self, numbers: Ints) -> Ints:
        """Sorted numbers of the nodes of the elements `numbers`, all of which must exist."""
        number, begin, width, nodes = self._rows
        row = np.searchsorted(number, numbers)
        count = width[row]
        places = np.repeat(begin[row] - (np.cumsum(count) - count), count) + np.arange(count.sum())
        return ordered(nodes[places])

    @cached_property
    def _rows(self) -> tuple[Ints, Ints, Ints, Ints]:
        """Elements sorted by number: the number, where its nodes begin, how many; the nodes of all."""
        number = concatenated(e.number for e in self._cells)
        width = concatenated(np.full(e.nodes.shape[0], e.nodes.shape[1]) for e in self._cells)
        nodes = concatenated(e.nodes.ravel() for e in self._cells)
        order = np.argsort(number, kind="stable")
        return number[order], (np.cumsum(width) - width)[order], width[order], nodes
