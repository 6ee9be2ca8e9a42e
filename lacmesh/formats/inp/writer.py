"""Writing .inp: a deck card by card with its mesh as it has become, any other mesh as a deck of nodes alone.

*NODE, *ELEMENT, and the sets and surfaces that changed are written from the mesh, every other card by `carry.py`. New
nodes follow the first *NODE, the children of an element stand in its card, or in one of the same parameters behind it.
A skin cell is not written as an element: it gives the face of its parent in a *SURFACE. A skin group that no deck has
becomes a surface of its name, with a set of its nodes. Element sets, surfaces and node sets have separate names: one
name may mean all three.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.deck import INP_CARD, Deck, DeckCard, Lines, key_of
from lacmesh.errors import LacmeshWarning, RequestError, WriteError
from lacmesh.formats import notes
from lacmesh.formats.inp import elements
from lacmesh.formats.inp.cards import LARGEST, NOTE
from lacmesh.formats.inp.carry import NAME, Carrier, Refusal, flattened, with_option, without_option
from lacmesh.formats.inp.sets import roles_of
from lacmesh.formats.notes import left_out
from lacmesh.formats.orders import file_order, is_plane, numbers_within
from lacmesh.formats.text import changes, in_lines, labels, node_lines, rows_of_text
from lacmesh.indices import repeated
from lacmesh.mesh import Ints, Mesh, mask_of

#: Characters of a real number in both programs; nodes or elements on a line.
_REAL, _PER_LINE = 20, 16
#: Characters in names, for `labels`; names that Abaqus takes without quotes.
_ALLOWED = {"calculix": "A-Za-z0-9_-", "abaqus": " !#-~"}
_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
#: Cards of the mesh, behind the last of which (before the first step) stands what the deck does not have.
_MESH = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE")
_NONE = np.empty(0, np.int64)


def write(
    path: Path,
    mesh: Mesh,
    *,
    target: str | None = None,
    plane: str | None = None,
    all_cells: bool = False,
    lenient: bool = False,
) -> None:
    """Write a mesh as an .inp file for the `target` "calculix" (also if None) or "abaqus", replacing any content.

    `plane`: the elements of plane meshes: CPS (plane stress), CPE (plane strain) or CAX (axisymmetric); by default
    `mesh.plane`, else CPS, with a warning. Skin cells are written as faces of *SURFACEs, other cells below the mesh's
    dimension as sets of nodes; with `all_cells` all of them are elements as well. Raises WriteError for a cell that the
    target has no element for, RequestError for an option; one LacmeshWarning names what is changed or left out.

    A mesh with a deck (`Mesh.deck`) is written as that deck: every card in its place, its mesh as it has become; one of
    parts is written without them if anything in its mesh has changed, or if "calculix", which has none, is named.
    Raises DataError for a line that cannot be carried; with `lenient` it is left out, and a LacmeshWarning names it.
    """
    if target not in (None, *elements.TARGETS) or plane not in (None, "", *elements.PLANES):
        message = f"an .inp file is for {' or '.join(elements.TARGETS)}, in {', '.join(elements.PLANES)}"
        raise RequestError(f"{message}: not {target or elements.TARGETS[0]}, {plane or elements.PLANES[0]}")
    clauses = left_out(replace(mesh, cell_data={k: v for k, v in mesh.cell_data.items() if k != INP_CARD}))
    card = mesh.cell_data.get(INP_CARD, np.empty(0))
    index = card if card.shape == (mesh.n_cells,) else np.full(mesh.n_cells, -1)
    deck, refused = _deck_of(mesh, index, target != "calculix", all_cells, clauses)
    if deck is None:
        line, index = " ".join(mesh.name.split()), np.full(mesh.n_cells, -1)
        has_heading = line and mesh.name != "mesh" and not line.startswith("*") and len(line) <= NAME
        start = (Lines(f"*HEADING\n{line}\n", "", 1),) if has_heading else ()
        deck = Deck("", (DeckCard("NODE", {}, "", 1, "*NODE\n", (), mesh.node_number),), mesh, start)
    carrier = Carrier(deck, mesh, lenient, clauses)
    for one in refused:
        carrier.refuse(*one, "it is left out")
    writer = _Writer(path, carrier, index, target or elements.TARGETS[0], plane, all_cells)
    with path.open("w", encoding="utf-8", errors="surrogateescape", newline="") as file:
        file.writelines(writer)
    if clauses:
        warnings.warn(LacmeshWarning(".inp: " + "; ".join(clauses)), stacklevel=2)


def _deck_of(
    mesh: Mesh, index: Ints, with_parts: bool, all_cells: bool, clauses: list[str]
) -> tuple[Deck | None, tuple[Refusal, ...]]:
    """Return the deck that a mesh is written as, None if it is another mesh; and what that lacks of its deck.

    `index` (n_cells,): of the card of each cell; `with_parts`: with its parts as long as all in the mesh is as read.
    """
    deck = mesh.deck
    if deck is None or (deck.instances and with_parts and _is_as_read(mesh, deck.mesh)):
        return deck, ()
    flat, refused = flattened(deck)
    why = _misfit(mesh, flat, index)
    lower = (index >= 0) & (mesh.cell_dim < mesh.dim)
    if not why and lower.any() and not all_cells and not elements.losses(flat, formulations=False):
        cards = set(index[lower].tolist())
        names = ", ".join(dict.fromkeys(elements.type_of(card.options) for card in flat.cards if card.index in cards))
        why = (
            f"{int(lower.sum())} elements of lower dimension than the mesh ({names}) become faces of surfaces, or sets "
            "of nodes, unless --all-cells (all_cells=True) keeps them elements"
        )
    if why:
        clauses += [f"written anew and not as the deck {deck.path}: {why}", *filter(None, [elements.losses(deck)])]
        return None, ()
    if deck.instances:
        names = ", whose names stand before those of their sets" if any(one.prefix for one in deck.instances) else ""
        clauses.append(f"the deck is written without parts and instances{names}")
    return flat, refused


def _is_as_read(mesh: Mesh, read: Mesh) -> bool:
    """True if cells, nodes and groups are those that were read."""
    arrays = [{"points": m.points, "numbers": m.cell_number, **dict(m.blocks)} for m in (mesh, read)]
    pairs = [arrays, (mesh.cell_groups, read.cell_groups), (mesh.node_groups, read.node_groups)]
    return all(a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a) for a, b in pairs)


def _misfit(mesh: Mesh, deck: Deck, index: Ints) -> str:
    """Reason why the mesh is not one of this deck; empty if it is."""
    if not np.array_equal(mesh.node_number[: deck.mesh.n_nodes], deck.mesh.node_number):
        return "its nodes have other numbers in the mesh"
    for card in deck.named("ELEMENT"):
        listed, own = card.numbers, mesh.cell_number[index == card.index]
        if listed is not None and len(np.setdiff1d(listed, own)) and not len(np.setdiff1d(own, listed)):
            return "some of its elements are not in the mesh"  # nor their children
    if repeated(mesh.cell_number[index >= 0]) is not None or repeated(mesh.node_number) is not None:
        return "numbers stand twice in the mesh"
    return ""


class _Writer:
    """Yields the text of a deck with its mesh; `path`: the file that is to come, for errors."""

    def __init__(
        self, path: Path, carrier: Carrier, index: Ints, target: str, plane: str | None, all_cells: bool
    ) -> None:
        """`index` (n_cells,): that of the card of each cell, or -1."""
        self.path, self.carrier, self.index, self.target, self.plane = path, carrier, index, target, plane
        self.mesh, self.deck, self.clauses = carrier.mesh, carrier.deck, carrier.clauses
        element_role, self.parent, self.facet = roles_of(self.mesh, all_cells)
        self.is_element, self.skin = element_role | (index >= 0), self.parent >= 0
        self.node = numbers_within(self.mesh.node_number, 1, LARGEST, "nodes", self.clauses)
        self.cell = self.mesh.cell_number.astype(np.int64)
        own = self.cell[self.is_element]
        self.cell[self.is_element] = numbers_within(own, 1, LARGEST, "cells", self.clauses)
        # behind the last card of the mesh, before the first step, stands what the deck does not have
        self.last = max((k for k, card in enumerate(self.deck.model) if card.key in _MESH), default=0)
        self.heads: dict[int, DeckCard] = {}  # cards without the sets that are written anew
        self.dropped: set[int] = set()  # index of the cards of these sets
        self.behind: dict[int, list[str]] = {}  # sets that stand behind the card of an index
        for (kind, key), group in self.deck.groups.items() if not self.deck.numbers_differ else ():
            if kind in ("NSET", "ELSET"):
                self._plan_set(kind, key, group)

    def __iter__(self) -> Iterator[str]:
        """Yield the file in pieces. Raises DataError for a line that cannot be carried, WriteError."""
        faces = np.flatnonzero(self.skin & ~self.is_element)
        numbers = {"node_number": self.node, "cell_number": np.where(self.is_element, self.cell, self.mesh.cell_number)}
        note = notes.dump(self.mesh, "zones", "records", faces=faces, **numbers)
        others = list(self._other_groups())
        yield from (part.text for part in self.deck.start)
        yield from (f"{NOTE}{line}\n" for line in notes.in_lines(note) if note)
        n_read, start = self.deck.mesh.n_nodes, 0
        for k, original in enumerate(self.deck.cards):
            card = self.heads.get(k, original)
            written: Iterator[str] | None = None
            if self.deck.numbers_differ:  # an unchanged mesh, whose numbers are not those of the cards
                yield from self.carrier.carried(card)
                continue
            if card.key == "NODE" and card.numbers is not None:
                written = self._nodes(without_option(card, "SYSTEM", "INPUT").head, start, start + len(card.numbers))
            elif card.key == "ELEMENT" and card.numbers is not None and not self._is_as_listed(card):
                written = self._elements(without_option(card, "INPUT"))
            elif k in self.dropped:
                written = iter(())
            elif card.key == "SURFACE":
                written = self._surface(card)
            elif card.key in ("NSET", "ELSET", "ELEMENT"):
                card = without_option(card, "INPUT")
            if written is None:
                yield from self.carrier.carried(card)
            else:
                yield from written
                yield from (part.text for part in card.comments)
            if card.key == "NODE" and card.numbers is not None:
                if start == 0 and n_read < self.mesh.n_nodes:
                    yield from self._nodes("*NODE\n", n_read, self.mesh.n_nodes)
                start += len(card.numbers)
            yield from self.behind.get(k, ())
            if k == self.last:
                yield from self._elements_without_card()
                yield from others

    # ---- nodes and elements

    def _nodes(self, head: str, begin: int, end: int) -> Iterator[str]:
        """Yield a card of nodes; coordinates have 20 characters at most, as both programs read."""
        yield head
        points = self.mesh.points[begin:end, : 2 if is_plane(self.mesh) else 3]
        yield from (f"{n}, {', '.join(row)}\n" for n, row in node_lines(self.node[begin:end], points, _REAL))

    def _cells(
        self, cells: Ints, name_of: Callable[[str], str | None], head: Callable[[str], str], first: str = ""
    ) -> Iterator[str]:
        """Yield cells in their order, a card for each type, that of the element `first` before others.

        Raises WriteError for a type without an element.
        """
        parts = {}
        for cell_type, _, _ in self.mesh.select(np.sort(cells)):
            name = name_of(cell_type)
            if name is None:
                program = {"calculix": "CalculiX", "abaqus": "Abaqus"}[self.target]
                where = " in the plane" if is_plane(self.mesh) else ""
                n, hint = self.mesh.cells_by_type[cell_type], elements.hint(cell_type, self.target)
                message = f"{program} has no element{where} for {cell_type}, and the mesh has {n}; {hint}"
                raise WriteError(self.path, message)
            parts[cell_type] = name
        types = [block.type for block in self.mesh.blocks]
        for cell_type, name in sorted(parts.items(), key=lambda part: part[1] != first):
            k = types.index(cell_type)
            some = cells[(cells >= self.mesh.offsets[k]) & (cells < self.mesh.offsets[k + 1])]
            nodes = self.mesh.blocks[k].nodes[some - self.mesh.offsets[k]]
            places = list(elements.NODES.get(cell_type, range(nodes.shape[1])))
            row = "%d" + "".join(",\n%d" if n % _PER_LINE == 0 else ", %d" for n in range(1, len(places) + 1)) + "\n"
            yield head(name)
            yield from rows_of_text(row, np.column_stack([self.cell[some], self.node[nodes[:, places]]]))

    def _is_as_listed(self, card: DeckCard) -> bool:
        """True for a card whose lines say more than its cells do, and of which no element was replaced, or raised."""
        cells, old = np.flatnonzero(self.index == card.index), elements.element(elements.type_of(card.options))
        same_types = old is not None and all(cell_type == old.type for cell_type, _, _ in self.mesh.select(cells))
        listed = _NONE if card.numbers is None else card.numbers
        return bool(card.data) and same_types and not np.isin(listed, self.carrier.gone).any()

    def _elements(self, card: DeckCard) -> Iterator[str]:
        """Yield the elements of a card, and the children of those that were replaced, in cards of its parameters."""
        name = elements.type_of(card.options)
        old = elements.element(name)
        n_fields = max((len(line.fields) for line in card.data), default=0)
        if old is not None and old.kind == elements.LINE and n_fields > 1 + len(old.nodes):
            why = "these beams have changed, and their orientation nodes would be lost; give a direction in the section"
            self.carrier.refuse(card, None, why, "they are written without these nodes")
        order = file_order(self.mesh)
        yield from self._cells(
            order[self.index[order] == card.index],
            lambda cell_type: elements.variant(name, cell_type, self.target, self.plane),
            lambda new: (card if new == name else with_option(card, "TYPE", new)).head,
            name,
        )

    def _elements_without_card(self) -> Iterator[str]:
        """Yield the elements that the deck has no card for; skin is apart, where all cells are to be elements."""
        flat = (self.plane or self.mesh.plane or "CPS") if is_plane(self.mesh) else None
        order = file_order(self.mesh)
        order = order[(self.index[order] < 0) & self.is_element[order]]
        for skin in (False, True):
            yield from self._cells(
                order[self.skin[order] == skin],
                partial(elements.element_name, target=self.target, plane=flat, skin=skin),
                lambda name: f"*ELEMENT, TYPE={name}\n",
            )
        if not self.deck.path and flat and self.mesh.dim == 2 and not (self.plane or self.mesh.plane):
            text = "written as CPS (plane stress); --plane CPE or CAX (plane=) for plane strain or axisymmetry"
            self.clauses.append(text)

    # ---- sets and surfaces

    def _plan_set(self, kind: str, key: str, group: str) -> None:
        """Find out whether a set is written anew: one that changed, or that would take in numbers which are new."""
        mesh, read, maker = self.mesh, self.deck.mesh, "NODE" if kind == "NSET" else "ELEMENT"
        cards = {
            k: card
            for k, card in enumerate(self.deck.cards)
            if card.key in (kind, maker) and card.options.get(kind) and key_of(card.options[kind]) == key
        }
        if kind == "NSET":
            before, largest = read.node_number[read.node_groups[group]], read.node_number.max(initial=0)
            now = self.node[mesh.node_groups.get(group, _NONE)]
        else:
            cells = mesh.cell_groups.get(group, _NONE)
            before, largest = read.cell_number[read.cell_groups[group]], read.cell_number.max(initial=0)
            before, now = before[np.isin(before, self.carrier.elements)], self.cell[cells[self.is_element[cells]]]
        words = (word for card in cards.values() for line in card.data for word in line.fields)
        is_new = self.carrier.changed and any(word.isdecimal() and int(word) > largest for word in words)
        empty = not any(card.body or card.key == maker or len(card.options) > 1 for card in cards.values())
        now = np.unique(now)
        if np.array_equal(now, np.unique(before)) and not is_new and not (empty and len(now)):
            return
        written: list[Ints] = [_NONE]
        for k, card in cards.items():
            some = card.numbers if kind == "NSET" else self.cell[self.index == card.index]
            if card.key == kind:
                self.dropped.add(k)
            elif card.numbers is None or some is None or np.isin(some, now).all():
                written.append(_NONE if some is None else some)
            else:
                self.heads[k] = without_option(self.heads.get(k, card), kind)
        if len(rest := np.setdiff1d(now, np.concatenate(written))):
            name = self.deck.labels.get(group, key if key.startswith('"') else group)
            text = self._set(kind, name, rest)
            self.behind.setdefault(max(cards, default=self.last), []).extend(text)

    def _set(self, kind: str, name: str, numbers: Ints) -> Iterator[str]:
        """Yield a card of a set."""
        yield f"*{kind}, {kind}={name}\n"
        yield from in_lines(numbers, "%d", _PER_LINE, ", ")

    def _surface(self, card: DeckCard) -> Iterator[str] | None:
        """Yield a surface whose faces or nodes changed from the mesh; None if it is carried as it stands."""
        kind, key = card.options.get("TYPE", "ELEMENT").upper(), key_of(card.options.get("NAME", ""))
        group = self.deck.groups.get((kind, key)) if kind in ("NODE", "ELEMENT") else None
        if group is None:
            return None
        mesh, read = self.mesh, self.deck.mesh
        if kind == "NODE":
            sets = {self.deck.node_group(line.fields[0]) for line in card.data} & mesh.node_groups.keys()
            known = [read.node_groups[group], *(mesh.node_groups[name] for name in sets if name is not None)]
            more = np.setdiff1d(mesh.node_groups.get(group, _NONE), np.concatenate(known) if card.body else _NONE)
            texts: list[str] = [
                card.head,
                *(part.text for part in card.body),
                *(f"{n}\n" for n in self.node[more].tolist()),
            ]
            return iter(texts) if len(more) else None
        members = mesh.cell_groups.get(group, _NONE)
        skin = members[self.skin[members]]
        behind = mesh.cell_number[self.parent[skin]]
        new = np.isin(behind, self.carrier.gone) | ~np.isin(behind, self.carrier.elements)
        same = np.array_equal(np.sort(mesh.cell_number[members]), np.sort(read.cell_number[read.cell_groups[group]]))
        if not len(skin) or (card.body and same and not new.any()):
            return None
        return chain([card.head], self._faces(skin))

    def _faces(self, skin: Ints) -> Iterator[str]:
        """Yield the faces of skin cells, each once: the number of an element and the face's label."""
        at = np.unique(self.parent[skin] * 8 + self.facet[skin])
        parent, facet = at // 8, at % 8
        shells = self.mesh.dim == 2 and not is_plane(self.mesh)  # Abaqus counts their edges from E1, CalculiX from S3
        letter = "E" if shells and self.target == "abaqus" else "S"
        label = np.full(len(at), 3 if shells and self.target == "calculix" else 1)
        block = np.searchsorted(self.mesh.offsets, parent, side="right") - 1
        for b in np.unique(block).tolist():
            place = np.argsort(
                elements.FACETS[CELLS[self.mesh.blocks[b].type].family]
            )  # our facet -> its place among S1, S2 ...
            label[block == b] += place[facet[block == b]]
        yield from rows_of_text(f"%d, {letter}%d\n", self.cell[parent], label)

    # ---- groups that the deck does not have

    def _other_groups(self) -> Iterator[str]:
        """Yield element sets, surfaces and node sets of these groups; what is lost goes to the warning.

        Cells of a group that are skin, or no elements, give a set of nodes.
        """
        mesh = self.mesh
        known = {(kind in ("NSET", "NODE"), group) for (kind, _), group in self.deck.groups.items()}
        cells = {name: members for name, members in mesh.cell_groups.items() if (False, name) not in known}
        nodes = {name: members for name, members in mesh.node_groups.items() if (True, name) not in known}
        own = {name: mesh.nodes_on(some[self.skin[some] | ~self.is_element[some]]) for name, some in cells.items()}
        of_cells = {name: some for name, some in own.items() if len(some)}
        label_of, clash_label = self._labels({**cells, **nodes}, of_cells)
        for name, members in cells.items():
            if len(some := members[self.is_element[members]]):
                yield from self._set("ELSET", label_of[name], self.cell[some])
            if len(some := members[self.skin[members]]):
                yield f"*SURFACE, NAME={label_of[name]}, TYPE=ELEMENT\n"
                yield from self._faces(some)
        sets = {label_of[name]: some for name, some in nodes.items() if len(some)}
        sets |= {clash_label.get(name, label_of[name]): some for name, some in of_cells.items()}
        for label, some in sets.items():
            yield from self._set("NSET", label, self.node[some])
        lower = ~self.is_element & ~self.skin
        if as_nodes := [name for name, members in cells.items() if lower[members].any()]:
            self.clauses.append(f"cells of lower dimension become sets of nodes: {', '.join(as_nodes)}")
        if empty := dict.fromkeys(name for name, members in (*cells.items(), *nodes.items()) if not len(members)):
            self.clauses.append(f"empty groups are left out: {', '.join(empty)}")
        grouped = mask_of(mesh.n_cells, *mesh.cell_groups.values())
        if n := int((~grouped & ~self.is_element).sum()):
            self.clauses.append(f"{n} cells of lower dimension are in no group, and left out")
        some = np.flatnonzero(self.skin & ~self.is_element & grouped)
        if twice := len(some) - len(np.unique(self.parent[some] * 8 + self.facet[some])):
            self.clauses.append(f"{twice} surface cells coincide with others, and become one face with them")

    def _labels(self, groups: dict[str, Ints], of_cells: dict[str, Ints]) -> tuple[dict[str, str], dict[str, str]]:
        """Return the names of groups in the file, and of sets of the nodes of cells that are other nodes' names."""
        mesh, allowed = self.mesh, _ALLOWED[self.target]
        label_of = labels(groups, allowed, NAME)
        if changed := changes(label_of):
            self.clauses.append(f"names of groups that an .inp file cannot hold: {changed}")
        own = mesh.node_groups
        clash = [
            name for name, some in of_cells.items() if len(own.get(name, ())) and not np.array_equal(own[name], some)
        ]
        taken = labels(dict.fromkeys([*mesh.cell_groups, *own]), allowed, NAME).values()
        clash_label = dict(
            zip(clash, labels((f"{n}_nodes" for n in clash), allowed, NAME, taken).values(), strict=True)
        )
        if clash:
            shown = ", ".join(f"those of {name!r} are {label}" for name, label in clash_label.items())
            text = "groups of cells and of other nodes have the same name; the sets of the cells' nodes: "
            self.clauses.append(text + shown)
        if self.target == "abaqus":  # names that are more than a plain word stand between quotes
            for names in (label_of, clash_label):
                names.update({n: f'"{text}"' for n, text in names.items() if not _PLAIN.fullmatch(text)})
        return label_of, clash_label
