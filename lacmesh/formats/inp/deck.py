"""Interpretation of the cards of an .inp file, one by one, into scopes: parts, their instances, the assembly."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lacmesh.deck import DeckInstance
from lacmesh.formats.inp import data as inp_data
from lacmesh.formats.inp.cards import Card, Span, cards, label
from lacmesh.formats.inp.data import Members, key
from lacmesh.formats.inp.scope import ElementCard, NodeCard, Scope, SurfaceCard, raised
from lacmesh.formats.inp.types import LINE, NO_CELL, POINT, element
from lacmesh.formats.text import decoded, values_in_lines
from lacmesh.mesh import Floats, Ints

#: Cards that make nodes or elements, or move them, and that are not read.
_NOT_READ = {
    "NGEN": "makes nodes",
    "NFILL": "makes nodes",
    "NCOPY": "makes nodes",
    "NMAP": "moves nodes",
    "ELGEN": "makes elements",
    "ELCOPY": "makes elements",
    "SYSTEM": "turns coordinates",
    "SYMMETRICMODELGENERATION": "makes elements",
}
#: Cards whose members are listed by number.
_OF_MEMBERS = {"NSET", "ELSET", "SURFACE"}
_LARGEST = 10**9


@dataclass
class InputDeck:
    """Content of a file: the `scope` of its mesh, all its cards and the lines before them, messages, the heading.

    `whole`: cards whose data lines say more than the cells made of them, as orientation nodes of beams. `largest`: the
    largest number of an element that is no cell. `apart`, `instances`, `own`: as those of a `Deck`.
    """

    scope: Scope = field(default_factory=Scope)
    cards: list[Card] = field(default_factory=list)
    start: list[Span] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    heading: list[str] = field(default_factory=list)
    whole: list[Card] = field(default_factory=list)
    largest: int = 0
    apart: str = ""
    instances: list[DeckInstance] = field(default_factory=list)
    own: tuple[int, int] = (0, 0)


def read_model(path: Path) -> InputDeck:
    """Read the model in a file, with all instances merged into one scope. Raises ReadError."""
    model = InputDeck()
    model.cards, model.start = cards(path, model.said)
    n_instances = sum(c.name == "INSTANCE" for c in model.cards)
    reader = _Reader(model, n_instances, n_instances > 1 or _same_names(model.cards))
    for card in _sets_after_own_nodes(model.cards):
        reader.take(card)
    return reader.finish()


def _sets_after_own_nodes(listed: list[Card]) -> list[Card]:
    """Cards in the order of reading: an assembly's sets and surfaces stand behind its own first nodes or elements.

    A set without INSTANCE lists the assembly's own nodes, which may follow it in the file; only they tell by how much
    their numbers are raised. Everything else keeps its place.
    """
    of_assembly = _after_instances(listed)
    places = {name: [k for k in of_assembly if listed[k].name == name] for name in ("NODE", "ELEMENT")}
    first = (places["NODE"] or places["ELEMENT"] or [0])[0]
    early = [k for k in of_assembly if k < first and listed[k].name in _OF_MEMBERS]
    early = [k for k in early if not listed[k].parameters.get("INSTANCE")]
    if not early:
        return listed
    others = [card for k, card in enumerate(listed[: first + 1]) if k not in set(early)]
    return [*others, *(listed[k] for k in early), *listed[first + 1 :]]


def _same_names(listed: list[Card]) -> bool:
    """True if an assembly has a set or a surface of the same name as one of its parts."""
    outside = set(_after_instances(listed))
    of_assembly = {_named(listed[k]) for k in outside}
    of_parts = {_named(card) for k, card in enumerate(listed) if k not in outside}
    return bool(of_assembly & of_parts - {("", "")})


def _named(card: Card) -> tuple[str, str]:
    """Kind and name of the set or surface that a card makes, or adds to."""
    option = {"NODE": "NSET", "ELEMENT": "ELSET", "SURFACE": "NAME"}.get(card.name, card.name)
    name = card.parameters.get(option, "") if card.name in (*_OF_MEMBERS, "NODE", "ELEMENT") else ""
    return (option, key(name)) if name else ("", "")


def _after_instances(listed: list[Card]) -> list[int]:
    """Places of the cards of an assembly that follow one of its instances, and are inside none."""
    places = []
    inside = follows = False
    for k, card in enumerate(listed):
        if card.name in ("PART", "INSTANCE"):
            inside = True
        elif card.name in ("ENDPART", "ENDINSTANCE"):
            inside = False
            follows = follows or card.name == "ENDINSTANCE"
        elif follows and not inside:
            places.append(k)
    return places


def _instance_key(name: str) -> str:
    """Return the name of an instance for comparison, the same with quotes and without."""
    return key(label(name)[0])


class _Reader:
    """Processes cards one by one; those outside parts go to the model's own scope."""

    def __init__(self, model: InputDeck, n_instances: int, prefixed: bool) -> None:
        """`prefixed`: names of instances precede those of their sets."""
        self.model = model
        self.n_instances = n_instances
        self.prefixed = prefixed
        self.parts: dict[str, Scope] = {}
        self.instances: dict[str, DeckInstance] = {}
        self.here = self.model.scope
        self.own: DeckInstance | None = None  # of the assembly's own nodes and elements, once it has some
        self.instance: Card | None = None
        self.second_part: Card | None = None
        self.spare = 0
        self.too_long: dict[str, int] = {}
        self.elsewhere = False  # a file without parts that names instances
        self.n_no_cell: dict[str, int] = {}
        self.other_surfaces: dict[str, None] = {}

    def take(self, card: Card) -> None:
        """Process one card. Raises ReadError."""
        if card.name in _HANDLERS:
            _HANDLERS[card.name](self, card)
        elif card.name in _NOT_READ:
            what = _NOT_READ[card.name]
            raise card.error(f"*{card.shown} {what}, which is not read; write all nodes and elements out")

    def finish(self) -> InputDeck:
        """Complete the model after the last card. Raises ReadError."""
        if self.instance is not None:
            raise self.instance.error("this *INSTANCE has no *END INSTANCE")
        if self.parts and not self.n_instances:
            if self.second_part is not None:
                raise self.second_part.error("there are several parts and no assembly: say *INSTANCE where each stands")
            self.model.scope.add(next(iter(self.parts.values())), "", 0, 0)
        if self.spare:
            self.model.said.append(f"the orientation nodes of {self.spare} beams are left out")
        for name, n in self.too_long.items():
            self.model.said.append(f"{n} elements of type {name} list more nodes than these have: the first are taken")
        if self.elsewhere:
            self.model.said.append("sets name an instance, and this file has no parts: they are read without it")
        for name, n in self.n_no_cell.items():
            self.model.said.append(f"{n} elements of type {name} are no cells, and left out of the mesh")
        if self.other_surfaces:
            self.model.said.append(f"no groups are made of: {', '.join('*' + name for name in self.other_surfaces)}")
        return self.model

    def _raise(self) -> tuple[int, int]:
        """Offsets of the node and element numbers defined here: the assembly's follow those of its instances."""
        if self.here is not self.model.scope or not self.instances:
            return 0, 0
        if self.own is None:
            self.model.own = self.model.scope.largest()
            self.own = DeckInstance("", "", "", *self.model.own, False)
            self.model.apart = "the assembly has nodes or elements of its own, whose numbers are raised"
        return self.own.nodes, self.own.elements

    def _node(self, card: Card) -> None:
        number, points = inp_data.nodes(card)
        system = card.parameters.get("SYSTEM", "R").upper()[:1] or "R"
        if system == "S":
            raise card.error("spherical coordinates of nodes (SYSTEM=S) are not read")
        if system == "C":
            angle = np.radians(points[:, 1])
            points = np.stack([points[:, 0] * np.cos(angle), points[:, 0] * np.sin(angle), points[:, 2]], axis=1)
        number = number + self._raise()[0]
        self.here.nodes.append(NodeCard(card, number, points))
        if card.parameters.get("NSET"):
            self.here.add_to("node", card.parameters["NSET"], card, Members(number, (), ()))

    def _element(self, card: Card) -> None:
        name = card.parameters.get("TYPE", "").strip('"').upper()
        if not name:
            raise card.error("*ELEMENT should say its TYPE")
        cell = element(name)
        if cell is None:
            if not NO_CELL.fullmatch(name):
                raise card.error(f"elements of type {name[:40]} are not known to lacmesh; take them out of the file")
            n = int(np.count_nonzero(values_in_lines(card.text())))
            self.n_no_cell[name] = self.n_no_cell.get(name, 0) + n
            self.model.whole.append(card)
            self.model.largest = max(self.model.largest, _largest_of(card))
            if card.parameters.get("ELSET"):
                self.here.add_to("element", card.parameters["ELSET"], card)
            return
        rows, lost = inp_data.elements(card, len(cell.nodes))
        self._count_lost(name, cell.kind == LINE, lost)
        if cell.kind in (LINE, POINT) or lost.any():
            self.model.whole.append(card)
        if len(rows) and (rows.min() < 1 or rows.max() >= _LARGEST):
            wrong = rows[(rows < 1) | (rows >= _LARGEST)][0]
            raise card.error(f"numbers of elements and nodes run from 1 to {_LARGEST - 1}, and one here is {wrong}")
        by = self._raise()
        number, nodes = rows[:, 0] + by[1], rows[:, 1:] + by[0]
        self.here.elements.append(ElementCard(card, cell, number, nodes))
        if card.parameters.get("ELSET"):
            self.here.add_to("element", card.parameters["ELSET"], card, Members(number, (), ()))

    def _count_lost(self, name: str, is_line: bool, lost: Ints) -> None:
        """Count elements that list surplus nodes; one surplus node of a line is the orientation node of a beam."""
        beams = int(np.count_nonzero(lost == 1)) if is_line else 0
        self.spare += beams
        others = int(np.count_nonzero(lost)) - beams
        if others:
            self.too_long[name] = self.too_long.get(name, 0) + others

    def _set(self, card: Card) -> None:
        of = "node" if card.name == "NSET" else "element"
        name = card.parameters.get(card.name, "")
        if not name.strip('" '):
            raise card.error(f"*{card.name} should say the set's name: *{card.name}, {card.name}=name")
        instance = self._of(card)
        by = (instance.nodes if of == "node" else instance.elements) if instance else 0
        prefix = key(instance.prefix) if instance else ""
        listed = inp_data.members(card)
        if self.instances and instance is not None and not card.parameters.get("INSTANCE"):
            listed = self._with_instances(listed, of)
        elements = card.parameters.get("ELSET", "") if of == "node" else ""
        self.here.add_to(of, name, card, raised(listed, by, prefix), prefix + key(elements) if elements else "")

    def _of(self, card: Card) -> DeckInstance | None:
        """Instance that a card of the assembly refers to, the assembly's own if it names none; None elsewhere."""
        name = card.parameters.get("INSTANCE", "")
        if name and not self.parts and not self.n_instances:
            self.elsewhere, name = True, ""
        if name:
            if _instance_key(name) not in self.instances:
                raise card.error(f"there is no instance named {name}")
            return self.instances[_instance_key(name)]
        if self.here is not self.model.scope or not self.instances:
            return None
        return self.own or DeckInstance("", "", "", 0, 0, False)

    def _with_instances(self, listed: Members, of: str) -> Members:
        """Resolve members named with their instance: `I.5` is number 5 of instance I, `I.SET` its set SET."""
        numbers, names = listed.numbers.tolist(), []
        by_own = (self.own.nodes if of == "node" else self.own.elements) if self.own else 0
        for name in listed.names:
            before, _, rest = name.rpartition(".")
            instance = self.instances.get(_instance_key(before)) if before else None
            if instance is not None and rest.strip().isdigit():
                by = instance.nodes if of == "node" else instance.elements
                numbers.append(int(rest) + by - by_own)
            else:
                names.append(self._plain(name))
        return Members(np.array(numbers, np.int64), listed.ranges, tuple(names))

    def _plain(self, name: str) -> str:
        """Name in the model's scope, which has no prefix of the instance if there is only one."""
        before, _, rest = name.rpartition(".")
        instance = self.instances.get(_instance_key(before)) if before else None
        return name if instance is None else instance.prefix + rest

    def _surface(self, card: Card) -> None:
        shown, known_as = label(card.parameters.get("NAME", ""))
        surface_type = card.parameters.get("TYPE", "ELEMENT").upper()
        if not shown:
            raise card.error("*SURFACE should say the surface's name: *SURFACE, NAME=name")
        if surface_type not in ("ELEMENT", "NODE") or {"COMBINE", "CROP"} & set(card.parameters):
            other = f"SURFACE of type {surface_type}" if surface_type not in ("ELEMENT", "NODE") else "SURFACE, COMBINE"
            self.other_surfaces[other] = None
            return
        own = self._of(card)
        entries = inp_data.faces(card) if surface_type == "ELEMENT" else self._of_nodes(card)
        by = 0 if own is None else own.elements if surface_type == "ELEMENT" else own.nodes
        named = [(face, self._plain(which) if isinstance(which, str) else which + by) for face, which in entries]
        surface = SurfaceCard(shown, card, named, surface_type == "NODE")
        if (surface_type, known_as) in self.here.surfaces:
            raise card.error(f"there are two surfaces of type {surface_type} named {shown!r}")
        self.here.surfaces[surface_type, known_as] = surface

    def _of_nodes(self, card: Card) -> list[tuple[str, Ints | str]]:
        """Entries of a surface of nodes: the node or node set at the start of each line (areas may follow)."""
        entries: list[tuple[str, Ints | str]] = []
        for line in card.text().splitlines():
            word = decoded(line.split(b",")[0]).strip()
            if line.strip():
                entries.append(("", np.array([int(word)]) if re.fullmatch(r"[0-9]{1,18}", word) else word))
        return entries

    def _part(self, card: Card) -> None:
        name = card.parameters.get("NAME", "")
        if key(name) in self.parts:
            raise card.error(f"there are two parts named {name}")
        if self.parts and self.second_part is None:
            self.second_part = card
        self.here = self.parts[key(name)] = Scope()

    def _end_part(self, card: Card) -> None:
        self.here = self.model.scope

    def _instance(self, card: Card) -> None:
        """Begin an instance: cards inside it are added to a copy of its part."""
        part, name = card.parameters.get("PART", ""), card.parameters.get("NAME", "")
        if key(part) not in self.parts:
            raise card.error(f"there is no part named {part!r} above this *INSTANCE")
        if _instance_key(name) in self.instances or self.instance is not None:
            raise card.error(f"the instance {name!r} is there already, or inside another")
        self.instance = card
        self.here = Scope()
        self.here.add(self.parts[key(part)], "", 0, 0)

    def _end_instance(self, card: Card) -> None:
        if self.instance is None:
            raise card.error("there is no *INSTANCE above this *END INSTANCE")
        begin, scope, whole = self.instance, self.here, self.model.scope
        shown = label(begin.parameters.get("NAME", ""))[0]
        moved = [NodeCard(n.card, n.number, _placed(begin, n.points)) for n in scope.nodes]
        scope.nodes = moved
        by = whole.largest()
        prefix = f"{shown}." if self.prefixed else ""
        whole.add(scope, prefix, *by)
        turned = len([row for row in begin.text().splitlines() if row.strip()]) > 1
        instance = DeckInstance(shown, begin.parameters.get("PART", ""), prefix, *by, turned)
        self.instances[_instance_key(shown)] = instance
        self.model.instances.append(instance)
        if len(self.instances) > 1 or any(by):
            self.model.apart = f"there are {len(self.instances)} instances of parts"
        elif begin.text().strip():
            self.model.apart = f"the instance {shown} stands elsewhere than its part"
        if any(by):
            self.model.said.append(f"the numbers of instance {shown} are raised, nodes by {by[0]} and cells by {by[1]}")
        self.instance, self.here = None, whole

    def _heading(self, card: Card) -> None:
        self.model.heading += [line.strip() for line in card.text().decode("latin-1").splitlines() if line.strip()]


#: name of a card -> what reads it
_HANDLERS: Mapping[str, Callable[[_Reader, Card], None]] = {
    "NODE": _Reader._node,
    "ELEMENT": _Reader._element,
    "NSET": _Reader._set,
    "ELSET": _Reader._set,
    "SURFACE": _Reader._surface,
    "PART": _Reader._part,
    "ENDPART": _Reader._end_part,
    "INSTANCE": _Reader._instance,
    "ENDINSTANCE": _Reader._end_instance,
    "HEADING": _Reader._heading,
}


def _largest_of(card: Card) -> int:
    """The largest number that begins a data line; lines that continue an element may only make it larger."""
    words = (line.split(b",", 1)[0].strip() for line in card.text().splitlines())
    return max((int(word) for word in words if re.fullmatch(rb"[0-9]{1,9}", word)), default=0)


def _placed(card: Card, points: Floats) -> Floats:
    """Points of a part in the position of its instance: translated, then rotated about an axis (a, b) by degrees."""
    rows = [row for row in card.text().splitlines() if row.strip()]
    values = []
    for row in rows[:2]:
        try:
            values.append([float(f) for f in row.split(b",") if f.strip()])
        except ValueError:
            raise card.error(f"{row.decode('latin-1').strip()[:60]!r} should be where the instance stands") from None
    if values:
        points = points + np.array([*values[0], 0.0, 0.0, 0.0][:3])
    if len(values) > 1:
        if len(values[1]) != 7:
            raise card.error("the rotation of an instance should be two points of its axis, and an angle")
        points = _turned(points, np.array(values[1][:3]), np.array(values[1][3:6]), np.radians(values[1][6]))
    return points


def _turned(points: Floats, a: Floats, b: Floats, angle: float) -> Floats:
    """Rotate points about the axis from a to b by an angle in radians (Rodrigues' formula)."""
    axis = (b - a) / np.linalg.norm(b - a)
    x = points - a
    along = (x @ axis)[:, None] * axis
    return a + along + np.cos(angle) * (x - along) + np.sin(angle) * np.cross(axis, x)
