"""The cards of a deck that are no part of the mesh, in a new file: word for word, but where a cut makes them wrong.

A line that names an element which was cut, or nodes between which there are new ones, by number is refused: a set says
what is meant. A force on each node of a set stays on the nodes that it had.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.deck import INP_CARD, DataLine, Deck, DeckCard
from lacmesh.errors import DataError
from lacmesh.formats.ids import Index
from lacmesh.mesh import Ints, Mesh, mask_of
from lacmesh.topology.skin import Faces, cells_of_dim, find_owners

NUMBER = re.compile(r"[0-9]{1,9}")
#: Cards of loads on elements; a load on a face of an element, as P3, F1NU, EDNOR2.
_LOADS = ("DLOAD", "DFLUX", "FILM", "RADIATE")
_ON_FACE = re.compile(r"(P|HP|TRVEC|TRSHR|F|R|S|VP|SP|EDLD|EDNOR|EDSHR|EDTRA|EDMOM)[1-6]((NU|FC|CR)?.*)", re.I)
#: Cards whose lines are of an element each, and of nodes each.
_OF_ELEMENTS = ("DISTRIBUTION", "NORMAL", "INITIALCONDITIONS")
_OF_NODES = ("BOUNDARY", "TEMPERATURE", "NODALTHICKNESS", "INITIALCONDITIONS")
#: Initial conditions of nodes; all others are of elements and their integration points.
_ON_NODES = (
    "TEMPERATURE",
    "VELOCITY",
    "DISPLACEMENT",
    "PRESSURE",
    "MASSFLOW",
    "TOTALPRESSURE",
    "FIELD",
    "POREPRESSURE",
)


class Carrier:
    """Carries the cards of a deck into a mesh that was made of it; `clauses`: of the warning.

    `elements`: numbers of the deck's elements that are cells; `gone`: of those that were cut. The first child of a cell
    has its number, so that an element is the one that was read if its corners are, or copies of them.
    """

    def __init__(self, deck: Deck, mesh: Mesh, lenient: bool, clauses: list[str]) -> None:
        self.deck, self.mesh, self.read, self.lenient, self.clauses = deck, mesh, deck.mesh, lenient, clauses
        own = np.flatnonzero(self.read.cell_data.get(INP_CARD, np.full(self.read.n_cells, -1)) >= 0)
        self.elements: Ints = self.read.cell_number[own]
        at = Index(mesh.cell_number).places(self.elements)
        before, after = _corners(self.read)[own], _corners(mesh)[at]
        same = before == after
        rows = np.flatnonzero(~same.all(axis=1))
        copies = (mesh.points[before[rows]] == mesh.points[after[rows]]).all(axis=2) & (after[rows] >= 0)
        same[rows] |= copies
        self.gone: Ints = np.sort(self.elements[(at < 0) | ~same.all(axis=1)])
        self.changed = bool(len(self.gone)) or mesh.n_nodes > self.read.n_nodes

    def refuse(self, card: DeckCard, line: DataLine | None, why: str, instead: str) -> None:
        """Raise DataError with the card and its line; if that is allowed, note it, and what is written `instead`."""
        file, number = (card.file, card.line) if line is None else (line.file, line.line)
        text = f"{file}, line {number}: *{card.name}: {why}"
        if not self.lenient:
            raise DataError(f"{text}; --lenient (lenient=True) goes on with a warning")
        self.clauses.append(f"{text}; {instead}")

    def carried(self, card: DeckCard) -> Iterator[str]:
        """Yield the text of a card in a new file, keyword line first. Raises DataError for a line that is refused."""
        yield card.head
        for line in (line for part in card.body for line in part.each()):
            yield from self._line(card, line) if self.changed and line.is_data else [line.text]
        if self.changed and card.key in _OF_NODES and (card.key != "INITIALCONDITIONS" or is_on_nodes(card)):
            numbered = [line for line in card.data if NUMBER.fullmatch(line.fields[0])]
            if numbered and self._has_nodes_between([int(line.fields[0]) for line in numbered]):
                why = "it gives nodes by number, and the mesh has new nodes between them; give a set of nodes"
                self.refuse(card, numbered[0], why, "its new nodes get none")

    def _line(self, card: DeckCard, line: DataLine) -> list[str]:
        """Return what a line of a card becomes. Raises DataError."""
        if why := self._wrong(card, line.fields):
            self.refuse(card, line, why, "the line is left out")
            return []
        if card.key in ("CLOAD", "CFLUX") and (nodes := self._nodes_before(line.fields[0])) is not None:
            return [", ".join([str(number), *line.fields[1:]]) + "\n" for number in nodes.tolist()]
        return [line.text]

    def _wrong(self, card: DeckCard, fields: tuple[str, ...]) -> str:
        """Return why a line cannot be carried, and what to give instead; empty if it can."""
        first = fields[0]
        number = bool(NUMBER.fullmatch(first))
        if card.key in _LOADS and self._is_gone(first):
            if number:
                return f"element {first} was cut; give a set of elements, or a surface with *DSLOAD"
            if len(fields) > 1 and _ON_FACE.fullmatch(fields[1]):
                return f"elements of {first} were cut, and have no face {fields[1]}; give a surface with *DSLOAD"
        elif card.key == "EQUATION" and (names := [name for name in fields if self._nodes_before(name) is not None]):
            return f"it lists the node set {names[0]}, which the cut made larger; list its nodes by number"
        elif card.key == "MODELCHANGE" and card.options.get("TYPE", "ELEMENT").upper() == "ELEMENT":
            if gone := [name for name in fields if NUMBER.fullmatch(name) and self._is_gone(name)]:
                return f"element {gone[0]} was cut; give a set of elements"
        elif card.key in _OF_ELEMENTS and not is_on_nodes(card) and number and self._is_gone(first):
            return f"element {first} was cut, and its children have other nodes and integration points"
        return ""

    def _is_gone(self, name: str) -> bool:
        """True for the number of an element that was cut, or the name of a set with one."""
        if NUMBER.fullmatch(name):
            return bool((self.gone == int(name)).any())
        group = self.deck.element_group(name)
        cells: Ints = self.read.cell_groups[group] if group else np.empty(0, np.int64)
        return bool(np.isin(self.read.cell_number[cells], self.gone).any())

    def _nodes_before(self, name: str) -> Ints | None:
        """Return the numbers of the nodes that a set had if it has more or fewer now, else None."""
        group = None if NUMBER.fullmatch(name) else self.deck.node_group(name)
        if group is None or group not in self.mesh.node_groups:
            return None
        nodes = self.read.node_groups[group]
        return self.read.node_number[nodes] if len(nodes) != len(self.mesh.node_groups[group]) else None

    def _has_nodes_between(self, numbers: list[int]) -> bool:
        """True if there are new nodes on a facet whose corners are all given, or a copy of one of these nodes."""
        read, mesh = self.read, self.mesh
        named = np.isin(read.node_number, numbers)
        new = set(map(tuple, mesh.points[read.n_nodes :].tolist()))
        if any(tuple(point) in new for point in read.points[named].tolist()):
            return True
        raised = max(CELLS[t].order for t in mesh.cells_by_type) > max(CELLS[t].order for t in read.cells_by_type)
        parts = []
        for cell_type, nodes, _ in cells_of_dim(read, read.dim):
            if raised and (named[nodes].sum(axis=1) > 1).any():
                return True  # of a cell whose order was raised, all edges have new nodes
            for facet in CELLS[cell_type].facets:
                corners = facet.nodes[: CELLS[facet.type].n_corners]
                parts.append((facet.type, nodes[named[nodes[:, corners]].all(axis=1)][:, facet.nodes]))
        faces = Faces.join(parts)
        owners = find_owners(faces, cells_of_dim(mesh, mesh.dim), mesh.n_nodes)
        return not mask_of(len(faces), owners.face[owners.same]).all()


def _corners(mesh: Mesh) -> Ints:
    """(n_cells, 8): corners of each cell, padded with -1."""
    table = np.full((mesh.n_cells, 8), -1)
    for cell_type, cells, nodes in mesh.select(np.arange(mesh.n_cells)):
        n = ALL_CELLS[cell_type].n_corners
        table[cells, :n] = nodes[:, :n]
    return table


def is_on_nodes(card: DeckCard) -> bool:
    """True for initial conditions of nodes."""
    return "".join(card.options.get("TYPE", "").upper().split()) in _ON_NODES


def without_option(card: DeckCard, *names: str) -> DeckCard:
    """The card without some of its parameters."""
    head = card.head
    for name in names:
        if name in card.options:
            head = re.sub(_parameter(name), r"\2", head, count=1, flags=re.I)
    return replace(card, head=head, options={name: value for name, value in card.options.items() if name not in names})


def with_option(card: DeckCard, name: str, value: str) -> DeckCard:
    """The card with another value of a parameter that it has."""
    head = re.sub(_parameter(name), rf",\1{name}={value}\2", card.head, count=1, flags=re.I)
    return replace(card, head=head, options={**card.options, name: value})


def _parameter(name: str) -> str:
    """Pattern of a parameter with the comma before it: the blanks before its name, and what follows its value."""
    return r",(\s*)" + r"\s*".join(name) + r'\s*(?:=\s*(?:"[^"]*"|[^,"\r\n]*))?(?=(\s*?)(?:,|\r|\n|$))'
