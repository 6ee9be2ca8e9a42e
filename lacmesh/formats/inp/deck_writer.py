"""Writing a deck: its cards in their order, with the mesh as it has become.

*NODE, *ELEMENT, the sets and surfaces that changed are written from the mesh, the rest by `carry.py`. New nodes follow
the first *NODE; the children of an element stand in its card, or in one of the same parameters that follows it. What a
set gained follows its first card; a set that lost members is written anew in its place.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

import numpy as np

from lacmesh.deck import Deck, DeckCard, key_of
from lacmesh.formats.inp.carry import Complaints, carried, with_option, without_option
from lacmesh.formats.inp.deck_sets import DeckSets, sets_of
from lacmesh.formats.inp.follow import Followed
from lacmesh.formats.inp.lines import write_faces, write_nodes, write_rows, write_set
from lacmesh.formats.inp.plain import name_of
from lacmesh.formats.inp.plan import Plan, no_element, write_groups
from lacmesh.formats.inp.types import LINE, element
from lacmesh.formats.inp.variants import variant
from lacmesh.formats.writing import file_order
from lacmesh.mesh import Ints

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
