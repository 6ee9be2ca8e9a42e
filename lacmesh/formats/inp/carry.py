"""The cards of a deck that are no part of the mesh, in a new file: word for word, but where a cut makes them wrong.

A line that names an element which was cut, or nodes between which there are new ones, by number is refused: a set says
what is meant. A force on each node of a set stays on the nodes that it had.

`flattened` makes of a deck of parts and instances one without: what is written once its mesh has changed, and what
lacsolver reads. Nodes and elements have the numbers of the mesh, in cards of their own for each instance. A set or
surface `Set` of an instance `Part-1-1` is `Part-1-1_Set`, for both programs, as neither takes a point in a name of a
deck without parts; where the mesh has no name of the instance before it (one instance alone), it is `Set`. Names and
numbers in cards of the assembly, of the model and of the steps are rewritten. Sections and other cards of a part are
written once for each instance, behind the cards of the model, where CalculiX knows the materials that they name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.deck import INP_CARD, DataLine, Deck, DeckCard, DeckInstance, Lines, key_of
from lacmesh.errors import DataError
from lacmesh.formats.inp.elements import FRAMES
from lacmesh.formats.text import labels
from lacmesh.indices import Index
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
_ON_NODES = frozenset(
    ("TEMPERATURE", "VELOCITY", "DISPLACEMENT", "PRESSURE", "MASSFLOW", "TOTALPRESSURE", "FIELD", "POREPRESSURE")
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
    head = re.sub(
        _parameter(name), lambda found: f",{found[1]}{name}={value}{found[2] or ''}", card.head, count=1, flags=re.I
    )
    return replace(card, head=head, options={**card.options, name: value})


def _parameter(name: str) -> str:
    """Pattern of a parameter with the comma before it: the blanks before its name, and what follows its value."""
    return r",(\s*)" + r"\s*".join(name) + r'\s*(?:=\s*(?:"[^"]*"|[^,"\r\n]*))?(?=(\s*?)(?:,|\r|\n|$))'


# ---- decks of parts and instances

#: Characters of a name in both programs.
NAME = 80
#: Cards of a part that name its sets in ELSET and NSET, its orientations in NAME and ORIENTATION, and nothing else.
_OF_PARTS = frozenset(
    ("SOLIDSECTION", "SHELLSECTION", "MEMBRANESECTION", "SURFACESECTION", "COHESIVESECTION", "MASS", "ROTARYINERTIA",
     "HOURGLASSSTIFFNESS", "TRANSVERSESHEARSTIFFNESS")
)  # fmt: skip
#: The same, where a line is of directions in space, which a rotated instance would turn.
_WITH_DIRECTIONS = frozenset(("ORIENTATION", "BEAMSECTION", "BEAMGENERALSECTION", "SPRING", "DASHPOT"))
_BY_ELEMENT = ("DLOAD", "DFLUX", "FILM", "RADIATE", "MODELCHANGE", "ELPRINT", "NORMAL")
#: Cards whose lines begin with a node or an element, which without an instance is one of the assembly's.
_FIRST = ("BOUNDARY", "CLOAD", "CFLUX", "TEMPERATURE", "INITIALCONDITIONS", *_BY_ELEMENT)
#: A card that a deck without parts cannot have, the line at fault, if it is in one, and why.
Refusal = tuple[DeckCard, DataLine | None, str]
#: Parameters that name sets, surfaces and nodes.
_NAMING = frozenset(
    ("ELSET", "NSET", "REFNODE", "ROTNODE", "TIENSET", "PINNSET", "SLAVE", "MASTER", "SURFACE", "SURFACENAME", "REGION")
)


def flattened(deck: Deck) -> tuple[Deck, tuple[Refusal, ...]]:
    """Return a deck with instances of parts as one without, and what it lacks of that; one without them as it is."""
    if not deck.instances:
        return deck, ()
    flat, written = _Flat(deck), {k for k, _, _ in deck.instance_numbers}
    before: list[DeckCard] = []
    model: list[DeckCard] = []
    of_parts: list[DeckCard] = []
    steps: list[DeckCard] = []
    part: str | None = None  # key of the part that is open
    instance: DeckInstance | None = None
    for k, card in enumerate(deck.cards):
        name = key_of(card.options.get("NAME", ""))
        part = name if card.key == "PART" else None if card.key == "ENDPART" else part
        if card.key in ("INSTANCE", "ENDINSTANCE"):
            instance = flat.instances.get(name) if card.key == "INSTANCE" else None
        if card.key in (*FRAMES, "NSET", "ELSET", "SURFACE"):  # sets are written from the mesh
            if last := steps or model or before:
                last[-1] = replace(last[-1], body=(*last[-1].body, *card.comments))
        elif card.key in ("NODE", "ELEMENT"):
            if card.key == "ELEMENT" and k not in written and part in (None, *flat.parts):
                why = "these elements say more than their nodes, or are no cells, and cannot be numbered anew"
                flat.refused.append((card, None, f"{why}; put them into a deck without parts"))
        elif part is not None or instance is not None:
            of_parts += flat.of_instances(card, part, instance)
        elif steps or card.key == "STEP":
            steps.append(flat.rewritten(card))
        elif not model and card.key in ("HEADING", "PREPRINT"):
            before.append(card)
        else:
            model.append(flat.rewritten(card))
    return replace(
        deck,
        cards=(*before, *flat.of_mesh(), *model, *of_parts, *steps),
        groups={(kind, key_of(flat.labels[group])): group for (kind, _), group in deck.groups.items()},
        labels=flat.labels,
        numbers_differ="",
        instances=(),
        instance_numbers=(),
    ), tuple(flat.refused)


class _Flat:
    """Cards, names and numbers of a deck with instances in one without; `refused`: what that cannot have."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        self.refused: list[Refusal] = []
        self.instances = {key_of(one.name): one for one in deck.instances}
        largest = [0, 0]
        for k, numbers, _ in deck.instance_numbers:
            of = deck.cards[k].key == "ELEMENT"
            largest[of] = max(largest[of], int(numbers.max(initial=0)))
        end = deck.assembly_offset if any(deck.assembly_offset) else tuple(largest)
        ends = [*((one.nodes, one.elements) for one in deck.instances[1:]), end]
        self._ends = dict(zip(self.instances, ends, strict=True))  # the largest numbers of each instance
        known = {key: group for (_, key), group in deck.groups.items()}
        self.labels = labels(dict.fromkeys(known.values()), "A-Za-z0-9_-", NAME, first="A-Za-z_")
        self._by_key = {key: self.labels[group] for key, group in known.items()}
        self._renamed = {key: label for key, label in self._by_key.items() if label != known[key]}
        self.parts = {key_of(one.part) for one in deck.instances}

    def of_mesh(self) -> Iterator[DeckCard]:
        """Yield the cards of nodes and elements in the order of the mesh, then those of sets and surfaces, empty."""
        for k, numbers, index in self.deck.instance_numbers:
            card = without_option(self.deck.cards[k], "ELSET", "NSET", "SYSTEM", "INPUT")
            yield replace(card, body=card.comments, numbers=numbers, index=index)
        for kind, group in dict.fromkeys((kind, group) for (kind, _), group in self.deck.groups.items()):
            surface = kind in ("NODE", "ELEMENT")
            keyword, names = ("SURFACE", {"NAME": group, "TYPE": kind}) if surface else (kind, {kind: group})
            place = next((card for card in self.deck.cards if card.key == keyword), self.deck.cards[0])
            options = {option: self.labels.get(name, name) for option, name in names.items()}
            head = ", ".join([f"*{keyword}", *(f"{option}={value}" for option, value in options.items())])
            yield DeckCard(keyword, options, place.file, place.line, f"{head}\n")

    def of_instances(self, card: DeckCard, part: str | None, instance: DeckInstance | None) -> Iterator[DeckCard]:
        """Yield a card of a part, or of an instance alone, once for each instance of it; a part may have none."""
        if instance is None and part not in self.parts:
            return
        if card.key not in _OF_PARTS | _WITH_DIRECTIONS:
            why = "it stands in a part, and lacmesh does not know which of its names and numbers are the part's"
            self.refused.append((card, None, f"{why}; move it to the assembly"))
            return
        for one in self.deck.instances:
            if one is not instance and (instance is not None or key_of(one.part) != part):
                continue
            if one.rotated and card.key in _WITH_DIRECTIONS:
                why = f"it has directions, which the rotation of instance {one.name} turns"
                self.refused.append((card, None, f"{why}; place this instance without a rotation"))
                continue
            new = card
            for option in ("ELSET", "NSET", "NAME", "ORIENTATION"):
                value = card.options.get(option, "").strip('"')
                if option in ("ELSET", "NSET") and option in card.options:
                    new = with_option(new, option, self._by_key.get(key_of(one.prefix + value), value))
                elif one.prefix and value:
                    new = with_option(new, option, one.prefix.replace(".", "_") + value)
            yield new

    def rewritten(self, card: DeckCard) -> DeckCard:
        """Return a card of the assembly, of the model or of a step with other names and numbers."""
        elements = card.key in _BY_ELEMENT or (card.key == "INITIALCONDITIONS" and not is_on_nodes(card))
        for option, value in card.options.items():
            if option in _NAMING or "." in value:
                new = self._in_mesh(value, False)
                card = card if new == value else with_option(card, option, new)
        body = tuple(part._replace(text="".join(self._lines(card, part, elements))) for part in card.body)
        return replace(card, body=body)

    def _lines(self, card: DeckCard, part: Lines, elements: bool) -> Iterable[str]:
        """Yield the lines of a part of a card's body with other names and numbers."""
        for line in part.each():
            if not line.is_data:
                yield line.text
                continue
            fields = line.text.rstrip("\r\n").split(",")
            if card.key in _FIRST and NUMBER.fullmatch(fields[0].strip()):
                offset = self.deck.assembly_offset[elements]
                if self.deck.numbers_differ and not offset:
                    why = "so that a number may mean several; name a set, or write instance.number"
                    self.refused.append((card, line, f"{self.deck.numbers_differ}, {why}"))
                fields[0] = str(int(fields[0]) + offset)
            for k, text in enumerate(fields):
                new = self._in_mesh(text.strip(), elements)
                fields[k] = text if new == text.strip() else text.replace(text.strip(), new)
            yield ",".join(fields) + "\n"

    def _in_mesh(self, text: str, elements: bool) -> str:
        """Return what stands for a name in the assembly, or for a number after the name of an instance.

        A number that is beyond those of its instance stays, and is then the name of nothing.
        """
        if label := self._renamed.get(key_of(text)):
            return label
        before, point, rest = text.replace('"', "").rpartition(".")
        one = self.instances.get(key_of(before)) if point else None
        if one is None:
            return text
        if NUMBER.fullmatch(rest.strip()):
            number = int(rest) + (one.elements if elements else one.nodes)
            return str(number) if number <= self._ends[key_of(before)][elements] else text
        return self._by_key.get(key_of(one.prefix + rest), text)
