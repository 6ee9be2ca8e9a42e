"""Writing a deck: its cards in their order, with the mesh as it has become.

*NODE, *ELEMENT, the sets and surfaces that changed are written from the mesh, the rest by `carry.py`. New nodes follow
the first *NODE; the children of an element stand in its card, or in one of the same parameters that follows it. What a
set gained follows its first card; a set that lost members is written anew in its place.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np

from lacmesh.deck import Deck, DeckCard, key_of
from lacmesh.formats.inp.carry import Complaints, carried, with_option, without_option
from lacmesh.formats.inp.follow import Followed
from lacmesh.formats.inp.lines import write_faces, write_nodes, write_rows, write_set
from lacmesh.formats.inp.plain import name_of
from lacmesh.formats.inp.plan import Plan, no_element, write_groups
from lacmesh.formats.inp.types import LINE, PLANE, SHELL, element
from lacmesh.formats.inp.writer_types import card as element_of
from lacmesh.formats.writing import file_order
from lacmesh.mesh import Ints

#: Letters of a formulation that only some shapes have; all others (H, T, E ...) are of every shape.
_SHAPES = {
    "R": ("QUAD4", "QUAD8", "HEXA8", "HEXA20"),
    "I": ("QUAD4", "HEXA8"),
    "M": ("TRIA6", "TETRA10"),
    "S": ("HEXA8", "TETRA10"),
}
_NAME = re.compile(r"(.*?3D|.*?2D|[A-Z]+)(\d+)([A-Z]*)")


def variant(name: str, cell_type: str, target: str, plane: str | None = None) -> str | None:
    """Element of a cell that takes the place of an element `name`; None if the target has none.

    `plane`: CPS, CPE or CAX, if plane elements are to be of that kind.

    >>> variant("C3D20R", "HEXA20", "calculix"), variant("C3D20R", "PENTA15", "calculix")
    ('C3D20R', 'C3D15')
    >>> variant("C3D8I", "TETRA4", "calculix"), variant("CPE4R", "TRIA3", "calculix", plane="CAX")
    ('C3D4', 'CAX3')
    """
    old = element(name)
    if old is None:
        return None
    if plane and old.kind == PLANE and name.startswith(("CPS", "CPE", "CAX")):
        name = plane + name[3:]
    if old.type == cell_type:
        return name
    plain = element_of(cell_type, target, "CPS" if old.kind == PLANE else None, old.kind == SHELL and "M3D" in name)
    parts = _NAME.fullmatch(name)
    if plain is None or parts is None:
        return plain
    number = re.search(r"\d+(?=\D*$)", plain)
    letters = "".join(c for c in parts[3] if cell_type in _SHAPES.get(c, (cell_type,)))
    new = f"{parts[1]}{number[0] if number else ''}{letters}"
    known = element(new)
    return new if known is not None and known.type == cell_type else plain


#: Cards of the mesh, behind the last of which (before the first step) stands what the deck does not have.
_MESH = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE")


class DeckWriter:
    """Writes the cards of a deck one by one; `place`: the file that is to come, for errors."""

    def __init__(
        self, place: Path, plan: Plan, rest: Plan, followed: Followed, plane: str | None, complaints: Complaints
    ) -> None:
        """`plan`: of the whole mesh; `rest`: of the groups that the deck has not; `plane`: given by the user."""
        self.place, self.plan, self.rest, self.followed = place, plan, rest, followed
        self.plane, self.complaints = plane, complaints
        self.deck: Deck = followed.deck
        self.last = max((k for k, c in enumerate(self.deck.model) if c.key in _MESH), default=0)
        self.first_nodes = next(k for k, c in enumerate(self.deck.cards) if c.key == "NODE")
        self.sets: DeckSets = sets_of(followed, plan)
        self.starts = self._node_starts()

    def _node_starts(self) -> dict[int, int]:
        """Index of the first node of each *NODE card, by the card's index."""
        cards = [
            (k, len(c.numbers)) for k, c in enumerate(self.deck.cards) if c.key == "NODE" and c.numbers is not None
        ]
        ends = np.cumsum([0, *(n for _, n in cards)]).tolist()
        return {k: start for (k, _), start in zip(cards, ends, strict=False)}

    def write(self, file: BinaryIO) -> None:
        """Write the whole deck. Raises DataError for a line that cannot be carried, WriteError as `Plan.cards`."""
        _put(file, *(part.text for part in self.deck.start))
        if self.deck.apart:  # an unchanged mesh, whose numbers are not those of the cards
            _put(file, *(text for card in self.deck.cards for text in carried(card, self.followed, self.complaints)))
            return
        for k, card in enumerate(self.deck.cards):
            self._card(file, k, card)
            if k == self.first_nodes and self.followed.n_read < self.plan.mesh.n_nodes:
                file.write(b"*NODE\n")
                write_nodes(file, self.plan.mesh, self.plan.node, self.followed.n_read)
            for head, numbers in self.sets.after.get(k, ()):
                write_set(file, head, numbers)
            if k == self.last:
                self._elements_without_card(file)
                write_groups(file, self.rest)

    def _card(self, file: BinaryIO, k: int, card: DeckCard) -> None:
        card = self.sets.without_dropped(card)
        if card.key == "NODE" and card.numbers is not None:
            _put(file, without_option(card, "SYSTEM", "INPUT").head)
            write_nodes(file, self.plan.mesh, self.plan.node, self.starts[k], self.starts[k] + len(card.numbers))
        elif card.key == "ELEMENT" and card.numbers is not None and not self._as_it_stood(k, card):
            self._tell_lost(card)
            self._elements(file, k, without_option(card, "INPUT"))
            _put(file, *_comments(card))
            return
        elif k in self.sets.dropped:
            _put(file, *_comments(card))
            return
        elif card.key in ("NSET", "ELSET", "ELEMENT"):
            _put(file, without_option(card, "INPUT").head)
        elif card.key == "SURFACE" and self._surface(file, card):
            return
        else:
            _put(file, *carried(card, self.followed, self.complaints))
            return
        _put(file, *(part.text for part in card.body))

    def _tell_lost(self, card: DeckCard) -> None:
        """Refuse lines of beams that have changed, and that list an orientation node behind their own."""
        old = element(name_of(card.options))
        if old is not None and old.kind == LINE and any(len(line.fields) > 1 + len(old.nodes) for line in card.data):
            why = "these beams have changed, and their orientation nodes would be lost; give a direction in the section"
            self.complaints.add(card, card.file, card.line, why, "they are written without these nodes")

    def _as_it_stood(self, k: int, card: DeckCard) -> bool:
        """True for a card whose lines say more than its cells do, and of which no element was replaced, or raised."""
        cells, old = self._cells_of(k), element(name_of(card.options))
        raised = old is not None and any(kind != old.type for kind, _, _ in self.plan.mesh.select(cells))
        return bool(card.data) and not raised and not np.isin(self.followed.root[cells], self.followed.changed).any()

    def _elements(self, file: BinaryIO, k: int, card: DeckCard) -> None:
        """Write the elements of a card, and the children of those that were replaced: a card for each type."""
        mesh, old = self.plan.mesh, name_of(card.options)
        cells = self._cells_of(k)
        names = {}
        for block, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True):
            some = cells[(cells >= lo) & (cells < hi)]
            if len(some):
                name = variant(old, block.type, self.plan.target, self.plane)
                if name is None:
                    raise no_element(self.place, block.type, self.plan.target, mesh.cells_by_type[block.type], False)
                names[name] = (block, some, lo)
        for name in sorted(names, key=lambda name: name != old):
            block, some, lo = names[name]
            _put(file, (card if name == old else with_option(card, "TYPE", name)).head.rstrip("\r\n"))
            write_rows(file, block.type, block.nodes, some - lo, self.plan.node, self.plan.cell[some])
            file.write(b"\n")

    def _cells_of(self, k: int) -> Ints:
        """Cells of the *ELEMENT card of an index, in the order of the file."""
        home, cells = self._by_home
        return cells[np.searchsorted(home, k) : np.searchsorted(home, k, side="right")]

    @cached_property
    def _by_home(self) -> tuple[Ints, Ints]:
        mesh, home = self.plan.mesh, self.followed.home
        order = file_order(mesh)
        order = order[np.argsort(home[order], kind="stable")]
        return home[order], order

    def _elements_without_card(self, file: BinaryIO) -> None:
        """Write the elements that the deck has no card for: skin, where all cells are to be elements."""
        mesh, roles = self.plan.mesh, self.plan.roles
        for block, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets), strict=True):
            for skin in (False, True):
                some = np.arange(lo, hi)
                some = some[(self.followed.home[lo:hi] < 0) & roles.element[lo:hi] & (roles.skin[lo:hi] == skin)]
                if len(some):
                    _put(file, f"*ELEMENT, TYPE={self.plan.cards[block.type, skin]}")
                    write_rows(file, block.type, block.nodes, some - lo, self.plan.node, self.plan.cell[some])
                    file.write(b"\n")

    def _surface(self, file: BinaryIO, card: DeckCard) -> bool:
        """Write a surface whose faces or nodes changed from the mesh; False if it is carried as it stands."""
        name = card.options.get("NAME", "")
        kind = card.options.get("TYPE", "ELEMENT").upper()
        if kind == "NODE":
            return self._node_surface(file, card)
        group = self.deck.surfaces.get(("ELEMENT", key_of(name)))
        members = self.plan.mesh.cell_groups.get(group or "", np.empty(0, np.int64))
        skin = members[self.plan.roles.skin[members]]
        if kind != "ELEMENT" or group is None or not len(skin) or (card.body and not self._changed(group, skin)):
            return False
        _put(file, card.head.rstrip("\r\n"))
        write_faces(file, self.plan.mesh, self.plan.roles, self.plan.target, self.plan.cell, skin)
        _put(file, *_comments(card))
        return True

    def _changed(self, group: str, skin: Ints) -> bool:
        """True if skin cells of a surface are others than those that were read, or lie on other elements."""
        read = self.deck.mesh
        now, before = self.plan.mesh.cell_number[skin], read.cell_number[read.cell_groups[group]]
        behind = self.followed.root[self.plan.roles.parent[skin]]
        return not np.isin(now, before).all() or bool(np.isin(behind, self.followed.changed).any())

    def _node_surface(self, file: BinaryIO, card: DeckCard) -> bool:
        """Write a surface of nodes with the new nodes among those it lists; sets in it have theirs already."""
        numbers = [int(line.fields[0]) for line in card.data if line.fields[0].isdigit()]
        if not numbers or self.followed.same:
            return False
        listed = np.isin(self.plan.mesh.node_number, numbers)
        more = self.plan.mesh.node_number[self.followed.extended(listed) & ~listed]
        _put(file, card.head, *(part.text for part in card.body), *(f"{number}\n" for number in more.tolist()))
        return True


def _comments(card: DeckCard) -> list[str]:
    lines = [text for part in card.body for text in part.text.splitlines(keepends=True)]
    return [text for text in lines if text.lstrip().startswith("**")]


def _put(file: BinaryIO, *texts: str) -> None:
    file.writelines(text.encode(errors="surrogateescape") for text in texts)


# ---- sets of a deck in a mesh made of it: what each has gained, and where that is written; sets to be written anew


_NUMBER = re.compile(r"[0-9]{1,18}")


@dataclass
class DeckSets:
    """Changes of sets: cards to write `after` the card of an index, cards `dropped`, and `heads` (by id of a card)."""

    after: dict[int, list[tuple[str, Ints]]] = field(default_factory=dict)
    dropped: set[int] = field(default_factory=set)
    heads: dict[int, DeckCard] = field(default_factory=dict)

    def without_dropped(self, card: DeckCard) -> DeckCard:
        """The card without a parameter that names a set which is written anew."""
        return self.heads.get(id(card), card)


def sets_of(followed: Followed, plan: Plan) -> DeckSets:
    """Find what the sets of nodes and of elements of a deck need."""
    sets = DeckSets()
    for of, groups in (("NSET", followed.deck.node_sets), ("ELSET", followed.deck.element_sets)):
        cards = _cards_of(followed, of)
        for key, group in groups.items():
            if key in cards and not _as_it_was(of, group, followed):
                _add(sets, of, key, group, cards[key], followed, plan)
    return sets


def _as_it_was(of: str, group: str, followed: Followed) -> bool:
    """True if a group is the very array that was read, in a mesh without new nodes and elements."""
    now, read = followed.mesh, followed.deck.mesh
    if of == "NSET":
        return followed.same and now.node_groups.get(group) is read.node_groups[group]
    return followed.same and now.cell_groups.get(group) is read.cell_groups[group]


def _cards_of(followed: Followed, of: str) -> dict[str, list[int]]:
    """Indices of the cards that name each set, by its name for comparison."""
    cards: dict[str, list[int]] = {}
    maker = "NODE" if of == "NSET" else "ELEMENT"
    for k, card in enumerate(followed.deck.cards):
        if card.key in (of, maker) and card.options.get(of):
            cards.setdefault(key_of(card.options[of]), []).append(k)
    return cards


def _add(sets: DeckSets, of: str, key: str, group: str, cards: list[int], followed: Followed, plan: Plan) -> None:
    """Note what one set needs."""
    deck = followed.deck
    now, before, written = _members(of, group, cards, followed, plan)
    lost = len(np.setdiff1d(before, now, assume_unique=True)) > 0
    first = max(cards[0], _behind(of, followed))
    head = f"*{of}, {of}={deck.cards[cards[0]].options[of]}"
    if lost or any(_catches(deck.cards[k], of, followed) for k in cards):
        for k in cards:
            if deck.cards[k].key == of:
                sets.dropped.add(k)
            else:
                card = sets.heads.get(id(deck.cards[k]), deck.cards[k])
                sets.heads[id(deck.cards[k])] = replace(without_option(card, of), options=card.options)
        more = now
    else:
        more = np.setdiff1d(now, np.union1d(before, written), assume_unique=True)
    if len(more):
        sets.after.setdefault(first, []).append((head, more))


def _members(of: str, group: str, cards: list[int], followed: Followed, plan: Plan) -> tuple[Ints, Ints, Ints]:
    """Sorted numbers in a set: now, as it was read, and those that its *ELEMENT cards give it anyway."""
    deck, mesh, read = followed.deck, plan.mesh, followed.deck.mesh
    none = np.empty(0, np.int64)
    if of == "NSET":
        now = plan.node[mesh.node_groups.get(group, none)]
        return np.unique(now), np.unique(read.node_number[read.node_groups[group]]), none
    cells = mesh.cell_groups.get(group, none)
    cells = cells[plan.roles.element[cells]]
    makers = [k for k in cards if deck.cards[k].key == "ELEMENT"]
    written = plan.cell[np.isin(followed.home, makers)]
    before = followed.members(deck.cards[cards[0]].options[of])
    return np.unique(plan.cell[cells]), np.unique(none if before is None else before), np.unique(written)


def _behind(of: str, followed: Followed) -> int:
    """Index of the last card that makes new nodes or elements: a set lists them behind it, as CalculiX needs."""
    cards = followed.deck.cards
    if of == "NSET":
        new = followed.mesh.n_nodes > followed.n_read
        return next(k for k, c in enumerate(cards) if c.key == "NODE") if new else 0
    homes = followed.home[np.isin(followed.root, followed.changed)]
    return int(homes.max(initial=0))


def _catches(card: DeckCard, of: str, followed: Followed) -> bool:
    """True if a set's card lists numbers that were of nothing, and that something new has now, as GENERATE may."""
    if card.key != of or followed.same:
        return False
    read = followed.deck.mesh
    largest = int((read.node_number if of == "NSET" else read.cell_number).max(initial=0))
    return any(int(number) > largest for line in card.data for number in _NUMBER.findall(line.text))
