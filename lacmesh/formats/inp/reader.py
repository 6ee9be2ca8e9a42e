"""Reading .inp: each card goes to its handler, those of a part once for each of its instances."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from lacmesh.deck import INP_CARD, Deck, DeckCard, DeckInstance, Lines, key_of, shown_name
from lacmesh.errors import ReadError, some
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.inp.cards import NOTE, NOTE_LINE, Cards, Members, element_lines, members_of, node_lines
from lacmesh.formats.inp.elements import LINE, NO_CELL, PLANE, POINT, element, plane_of, type_of
from lacmesh.formats.inp.sets import OF_KIND, ElementCard, NamedSet, Resolver, SetKey, Sides, with_surfaces
from lacmesh.mesh import Floats, Ints, Mesh, concatenated

#: DeckCards that make nodes or elements, or move them, and that are not read.
_NOT_READ = {
    **dict.fromkeys(("NGEN", "NFILL", "NCOPY"), "makes nodes"),
    **dict.fromkeys(("ELGEN", "ELCOPY", "SYMMETRICMODELGENERATION"), "makes elements"),
    "NMAP": "moves nodes",
    "SYSTEM": "turns coordinates",
}
#: DeckCards that make sets, and the parameter with the name.
_NAMES = {"NODE": "NSET", "ELEMENT": "ELSET", "NSET": "NSET", "ELSET": "ELSET", "SURFACE": "NAME"}
#: Whose numbers and names are those of the file.
_PLAIN = DeckInstance("", "", "", 0, 0)


def read(path: Path) -> Mesh:
    """Read the mesh in an .inp file of Abaqus or CalculiX. Raises ReadError, with the file and the line.

    All cards are in `Mesh.deck`. One LacmeshWarning names what is read otherwise than it stands.
    """
    return _Reader(path).mesh()


class _Reader:
    """Reads the cards of a deck one by one: nodes, elements and sets with the numbers and names of the mesh."""

    def __init__(self, path: Path) -> None:
        """Read all cards. Raises ReadError."""
        self.path = path
        self.builder = MeshBuilder(path, cell="element")
        self.warnings = self.builder.warnings
        files = Cards(path)
        self.cards, self.start = files.cards, files.start
        if any(line.is_data for lines in self.start for line in lines.each()):
            self.warnings.append("the text before the first keyword line is no card")
        self.nodes: list[tuple[int, DeckCard, Ints, Floats]] = []  # index of the card, the card, numbers, points
        self.elements: list[ElementCard] = []
        self.sets: dict[SetKey, NamedSet] = {}
        self.heading: list[str] = []
        self.whole: set[int] = set()  # indices of cards whose lines say more than their cells, as of beams
        self.largest = 0  # number of an element that is no cell
        self.instances: dict[str, DeckInstance] = {}
        self.numbers_differ = ""
        self.assembly = _PLAIN  # raised once the assembly has nodes or elements
        self._counts: Counter[str] = Counter()  # warnings with a place for their count
        self._read_all()
        self.warnings += [text.replace("{}", str(n)) for text, n in self._counts.items()]
        if not self.nodes:
            raise ReadError(path, "has no nodes: there is no *NODE")

    # ---- cards, parts and instances

    def _read_all(self) -> None:
        """Read the cards: those of a part at its instances, or behind all if it has none. Raises ReadError."""
        parts: dict[str, list[int]] = {}
        inside: list[int] | None = None  # cards of the part or the instance that is open
        instance: DeckCard | None = None
        late: list[int] = []  # sets of an assembly, whose nodes and elements may follow them
        for k, card in enumerate(self.cards):
            name, part = card.options.get("NAME", ""), card.options.get("PART", "")
            if card.key == "PART":
                if key_of(name) in parts:
                    raise card.error(f"there are two parts named {name}")
                inside = parts[key_of(name)] = []
            elif card.key == "INSTANCE":
                if key_of(part) not in parts:
                    raise card.error(f"there is no part named {part!r} above this *INSTANCE")
                if _instance_key(name) in self.instances or instance is not None:
                    raise card.error(f"the instance {name!r} is there already, or inside another")
                instance, inside = card, [*parts[key_of(part)]]
            elif card.key == "ENDINSTANCE":
                if instance is None or inside is None:
                    raise card.error("there is no *INSTANCE above this *END INSTANCE")
                self._read_instance(instance, inside)
                instance = inside = None
            elif card.key == "ENDPART":
                inside = None
            elif inside is not None:
                inside.append(k)
            elif self.instances and card.key in ("NSET", "ELSET", "SURFACE"):
                late.append(k)
            else:
                if self.instances and self.assembly is _PLAIN and card.key in ("NODE", "ELEMENT"):
                    self.assembly = DeckInstance("", "", "", *self._largest())  # numbers past those of the instances
                    self.numbers_differ = "the assembly has nodes or elements of its own, whose numbers are raised"
                self._read(k, self.assembly)
        if instance is not None:
            raise instance.error("this *INSTANCE has no *END INSTANCE")
        if parts and not self.instances:
            if len(parts) > 1:
                second = [card for card in self.cards if card.key == "PART"][1]
                raise second.error("there are several parts and no assembly: say *INSTANCE where each stands")
            late = next(iter(parts.values()))
        for k in late:
            self._read(k, self.assembly)

    def _has_prefixes(self) -> bool:
        """True if names of instances precede those of their sets.

        So they do if there are several, or an assembly has a set or surface of the same name as its part.
        """
        ends = [k for k, card in enumerate(self.cards) if card.key == "ENDINSTANCE"]
        names: list[set[SetKey]] = []
        for cards in (self.cards[: ends[0]], self.cards[ends[0] :]):
            options = ((_NAMES.get(card.key, ""), card.options) for card in cards)
            names.append({(option, key_of(given[option])) for option, given in options if given.get(option)})
        return len(ends) > 1 or bool(names[0] & names[1])

    def _largest(self) -> tuple[int, int]:
        """The largest number of a node, and of an element; 0 where there is none."""
        nodes = max((int(number.max(initial=0)) for _, _, number, _ in self.nodes), default=0)
        return nodes, max((int(one.number.max(initial=0)) for one in self.elements), default=0)

    def _read_instance(self, card: DeckCard, cards: list[int]) -> None:
        """Read the cards of an instance, of its part first. Raises ReadError."""
        name = shown_name(card.options.get("NAME", ""))
        by = self._largest()
        placement = card.rows
        prefix = f"{name}." if self._has_prefixes() else ""
        one = DeckInstance(name, card.options["PART"], prefix, *by, len(placement) > 1)
        before, raised = len(self.nodes), len(self.cards) * len(self.instances)
        for k in cards:
            self._read(k, one, raised)
        self.nodes[before:] = [(k, c, number, _in_place(card, points)) for k, c, number, points in self.nodes[before:]]
        self.instances[_instance_key(name)] = one
        if len(self.instances) > 1 or any(by):
            self.numbers_differ = f"there are {len(self.instances)} instances of parts"
        elif placement:
            self.numbers_differ = f"the instance {name} stands elsewhere than its part"
        if any(by):
            self.warnings.append(f"the numbers of instance {name} are raised, nodes by {by[0]} and cells by {by[1]}")

    def _read(self, index: int, inside: DeckInstance, raised: int = 0) -> None:
        """Read one card; its numbers and names are those of an instance, its index is `raised`. Raises ReadError."""
        card = self.cards[index]
        if card.key in _NOT_READ:
            what = _NOT_READ[card.key]
            raise card.error(f"*{card.name} {what}, which is not read; write all nodes and elements out")
        if card.key == "HEADING":
            self.heading += [row.decode("latin-1").strip() for row in card.rows]
        elif card.key in _NAMES:
            read = {"NODE": self._node, "ELEMENT": self._element}.get(card.key, self._set)
            read(index + raised, card, inside)

    # ---- nodes and elements

    def _node(self, index: int, card: DeckCard, inside: DeckInstance) -> None:
        number, points = node_lines(card)
        system = card.options.get("SYSTEM", "R").upper()[:1] or "R"
        if system == "S":
            raise card.error("spherical coordinates of nodes (SYSTEM=S) are not read")
        if system == "C":
            angle = np.radians(points[:, 1])
            points = np.stack([points[:, 0] * np.cos(angle), points[:, 0] * np.sin(angle), points[:, 2]], axis=1)
        self.nodes.append((index, card, number + inside.nodes, points))
        if card.options.get("NSET"):
            self._add_to("NSET", card.options["NSET"], card, inside, [Members(number, "node").raised(inside)])

    def _element(self, index: int, card: DeckCard, inside: DeckInstance) -> None:
        name, elset = type_of(card.options), card.options.get("ELSET")
        if not name:
            raise card.error("*ELEMENT should say its TYPE")
        known = element(name)
        if known is None:
            if not NO_CELL.fullmatch(name):
                raise card.error(f"elements of type {name[:40]} are not known to lacmesh; take them out of the file")
            words = [row.split(b",", 1)[0].strip() for row in card.rows]
            self._counts[f"{{}} elements of type {name} are no cells, and left out of the mesh"] += len(words)
            self.whole.add(index)
            numbers = (int(word) for word in words if re.fullmatch(rb"[0-9]{1,9}", word))
            self.largest = max(self.largest, *numbers, 0)  # lines that continue an element may only make it larger
            if elset:
                self._add_to("ELSET", elset, card, inside, [])
            return
        rows, surplus = element_lines(card, len(known.nodes))
        if surplus:
            text = f"{{}} elements of type {name} list more nodes than these have: the first are taken"
            is_beam = known.kind == LINE and surplus == 1
            self._counts["the orientation nodes of {} beams are left out" if is_beam else text] += len(rows)
        if known.kind in (LINE, POINT) or surplus:
            self.whole.add(index)
        number = rows[:, 0]
        nodes = rows[:, 1:] + inside.nodes
        self.elements.append(ElementCard(card, index, known, number + inside.elements, nodes, surplus))
        if elset:
            self._add_to("ELSET", elset, card, inside, [Members(number, "element").raised(inside)])

    # ---- sets and surfaces

    def _add_to(self, kind: str, name: str, card: DeckCard, inside: DeckInstance, members: list[Members]) -> None:
        """Add members to a set, which need not exist yet."""
        at = kind, key_of(inside.prefix) + key_of(name)
        self.sets.setdefault(at, NamedSet(inside.prefix + shown_name(name), card)).members += members

    def _set(self, index: int, card: DeckCard, inside: DeckInstance) -> None:
        """Read a set, or a surface."""
        surface = card.key == "SURFACE"
        kind = card.options.get("TYPE", "ELEMENT").upper() if surface else card.key
        what, option = ("surface", "NAME") if surface else ("set", card.key)
        name = card.options.get(option, "")
        if not name.strip('" '):
            raise card.error(f"*{card.key} should say the {what}'s name: *{card.key}, {option}=name")
        if kind not in OF_KIND or (surface and {"COMBINE", "CROP"} & set(card.options)):
            shown = f"SURFACE of type {kind}" if kind not in OF_KIND else "SURFACE, COMBINE"
            self._counts[f"no groups are made of: *{shown}"] += 1
            return
        if surface and (kind, key_of(inside.prefix) + key_of(name)) in self.sets:
            raise card.error(f"there are two surfaces of type {kind} named {shown_name(name)!r}")
        members = members_of(card, OF_KIND[kind])
        if card.key == "NSET" and card.options.get("ELSET"):
            members.append(Members(card.options["ELSET"], "element"))
        self._add_to(kind, name, card, inside, self._in_mesh(card, members, inside))

    def _in_mesh(self, card: DeckCard, members: list[Members], inside: DeckInstance) -> list[Members]:
        """Members with the numbers and names of the mesh."""
        name = card.options.get("INSTANCE", "")
        if name and not any(one.key in ("PART", "INSTANCE") for one in self.cards):
            self._counts["sets name an instance, and this file has no parts: they are read without it"] = 1
            return members
        if name and _instance_key(name) not in self.instances:
            raise card.error(f"there is no instance named {name}")
        one = self.instances[_instance_key(name)] if name else inside
        raised = []
        for part in members:
            # in a card of the assembly `I.5` is number 5 of instance I, `I.SET` its set SET
            before, _, rest = part.listed.rpartition(".") if isinstance(part.listed, str) else ("", "", "")
            inner = self.instances.get(_instance_key(before)) if before and not one.prefix else None
            if inner is not None:
                number = re.fullmatch(r"[0-9]{1,18}", rest.strip())
                part = part._replace(listed=np.array([int(rest)]) if number else rest)
            raised.append(part.raised(inner or one))
        return raised

    # ---- the mesh and its deck

    def mesh(self) -> Mesh:
        """Return the mesh, with its deck. Raises ReadError."""
        builder = self.builder
        for _, card, number, points in self.nodes:
            builder.nodes(number, points, error=card.error)
        for cells in self.elements:
            rows = cells.nodes[:, np.argsort(cells.element.nodes)]
            index = np.full(len(rows), cells.index)
            builder.cells(cells.element.type, cells.number, rows, error=cells.card.error, inp_card=index)
        resolver = Resolver(self.sets, concatenated(number for _, _, number, _ in self.nodes), self.elements)
        for (kind, key), one in self.sets.items():
            if kind in ("NSET", "ELSET"):
                builder.group("node" if kind == "NSET" else "cell", one.shown, resolver.numbers(kind, key, one.card))
            elif kind == "NODE":
                for members in one.members:
                    builder.group("node", one.shown, resolver.members(members, one.card))
        planes = {plane_of(type_of(e.card.options)) for e in self.elements if e.element.kind == PLANE and len(e.number)}
        spaces = {one.element.space for one in self.elements}
        solid = any(points[:, 2].any() for *_, points in self.nodes) or (3 in spaces and 2 not in spaces)
        parts = [*self.start, *(part for card in self.cards for part in card.body)]
        if text := "".join(
            line.rstrip() for part in parts if NOTE in part.text for line in NOTE_LINE.findall(part.text)
        ):
            builder.read_note(text)
        mesh = builder.mesh(
            lambda mesh: self._with_surfaces(self._with_middle_second(mesh), resolver),
            name=self.heading[0] if len(self.heading) == 1 else "mesh",
            plane=planes.pop() if len(planes) == 1 else "",
            space_dim=3 if solid else 2,
        )
        return replace(mesh, deck=self._deck(mesh))

    def _with_surfaces(self, mesh: Mesh, resolver: Resolver) -> Mesh:
        order = np.argsort(mesh.cell_number, kind="stable")

        def sides(surface: NamedSet, members: Members) -> Sides:
            number = resolver.members(members, surface.card)
            cells = np.sort(order[np.searchsorted(mesh.cell_number, number, sorter=order)])
            return members.face, cells, surface.card

        surfaces = {
            one.shown: [sides(one, members) for members in one.members]
            for (kind, _), one in self.sets.items()
            if kind == "ELEMENT"
        }
        if resolver.strays:
            text = "members of sets and surfaces are no nodes or cells of the mesh, and left out"
            self.warnings.append(f"{resolver.strays} {text}")
        largest = max(self.largest, int(mesh.cell_number.max(initial=0)))
        card, which = np.unique(mesh.cell_data.get(INP_CARD, np.empty(0, np.int64)), return_inverse=True)
        kind_of = {one.index: one.element.kind for one in self.elements}
        kinds = np.array([kind_of[index] for index in card.tolist()], np.int64)[which]
        return with_surfaces(mesh, kinds, surfaces, largest, self.warnings)

    def _with_middle_second(self, mesh: Mesh) -> Mesh:
        """The mesh with lines whose middle node is listed last, as gmsh writes them, in lacmesh's order.

        Elements that list a node twice, which is legal (a collapsed brick is a wedge), are reported and kept.
        """
        blocks = []
        for block, first in zip(mesh.blocks, mesh.offsets.tolist(), strict=False):
            nodes = block.nodes
            if block.type == "SEG3":
                a, b, middle = (mesh.points[nodes[:, k]] for k in range(3))
                as_listed = np.linalg.norm(middle - (a + b) / 2, axis=1)
                swapped = np.linalg.norm(b - (a + middle) / 2, axis=1) < 0.5 * as_listed  # the third is the middle
                if swapped.any():
                    text = "lines have their middle node last, not between their ends: read so"
                    self.warnings.append(f"{int(swapped.sum())} {text}")
                    nodes = np.where(swapped[:, None], nodes[:, [0, 2, 1]], nodes)
            ordered = np.sort(nodes, axis=1)
            twice = first + np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
            if len(twice):
                shown = some(mesh.cell_number[twice], 5)
                self.warnings.append(f"{len(twice)} elements {block.type} have a node twice, kept so: {shown}")
            blocks.append(block._replace(nodes=nodes))
        return replace(mesh, blocks=tuple(blocks))

    def _deck(self, mesh: Mesh) -> Deck:
        """The record of the deck that was read as `mesh`."""
        entries = [(index, card, number) for index, card, number, _ in self.nodes]
        # elements whose lines have more numbers than theirs and their nodes' cannot be written from the mesh
        entries += [(one.index, one.card, one.number) for one in self.elements if not (self.instances and one.surplus)]
        numbers = {} if self.numbers_differ else {index: number for index, _, number in entries}
        groups = {at: self.sets[at].shown for kind in OF_KIND for at in self.sets if at[0] == kind}
        cards = []
        for k, card in enumerate(self.cards):
            body = card.comments if k in numbers and k not in self.whole else card.body
            cards.append(replace(card, body=_without_note(body), numbers=numbers.get(k)))
        return Deck(
            str(self.path),
            tuple(cards),
            mesh,
            _without_note(self.start),
            groups,
            numbers_differ=self.numbers_differ,
            instances=tuple(self.instances.values()),
            instance_numbers=tuple((k % len(self.cards), number, k) for k, _, number in entries)
            if self.instances
            else (),
            assembly_offset=(self.assembly.nodes, self.assembly.elements),
        )


def _without_note(parts: tuple[Lines, ...]) -> tuple[Lines, ...]:
    """Lines without those of lacmesh's note."""
    return tuple(part._replace(text=NOTE_LINE.sub("", part.text)) if NOTE in part.text else part for part in parts)


def _instance_key(name: str) -> str:
    """Name of an instance for comparison, the same with quotes and without."""
    return key_of(shown_name(name))


def _in_place(card: DeckCard, points: Floats) -> Floats:
    """Points of a part in the position of its instance: translated, then rotated about an axis (a, b) by degrees."""
    values = []
    for row in card.rows[:2]:
        try:
            values.append([float(text) for text in row.split(b",") if text.strip()])
        except ValueError:
            raise card.error(f"{row.decode('latin-1').strip()[:60]!r} should be where the instance stands") from None
    if values:
        points = points + np.array([*values[0], 0.0, 0.0, 0.0][:3])
    if len(values) < 2:
        return points
    if len(values[1]) != 7:
        raise card.error("the rotation of an instance should be two points of its axis, and an angle")
    a, b, angle = np.array(values[1][:3]), np.array(values[1][3:6]), np.radians(values[1][6])
    axis, x = (b - a) / np.linalg.norm(b - a), points - a  # Rodrigues' formula
    along = (x @ axis)[:, None] * axis
    return a + along + np.cos(angle) * (x - along) + np.sin(angle) * np.cross(axis, x)
