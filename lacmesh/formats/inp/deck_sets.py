"""Sets of a deck in a mesh made of it: what each has gained, and where that is written; sets to be written anew."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

import numpy as np

from lacmesh.deck import DeckCard, key_of
from lacmesh.formats.inp.carry import without_option
from lacmesh.formats.inp.follow import Followed
from lacmesh.formats.inp.plan import Plan
from lacmesh.mesh import Ints

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
