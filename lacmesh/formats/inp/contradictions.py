"""Contradictions of a deck: names that nothing has, steps inside steps, a parameter given twice.

Looked for when a deck is written: the mesh in it can be read and checked without them. Only cards that both programs
have are judged; what else a deck holds is carried unseen.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lacmesh.deck import DataLine, Deck, DeckCard, key_of
from lacmesh.errors import did_you_mean
from lacmesh.mesh import concatenated

_NUMBER = re.compile(r"[0-9]{1,9}")
_PARAMETER = re.compile(r'\s*([^,="]+?)\s*=\s*("[^"]*"|[^,]*?)\s*(?:,|$)')

#: Cards whose parameters ELSET and NSET name sets that must be there.
_OF_SETS = frozenset(
    ("SOLIDSECTION", "SHELLSECTION", "MEMBRANESECTION", "BEAMSECTION", "RIGIDBODY", "TRANSFORM", "NODEPRINT", "ELPRINT")
)
#: Parameter of a card -> the card that gives the name.
_BY_PARAMETER = {"MATERIAL": "MATERIAL", "INTERACTION": "SURFACEINTERACTION", "AMPLITUDE": "AMPLITUDE"}
#: Card -> kind of what its data lines begin with.
_FIRST = {
    **dict.fromkeys(("BOUNDARY", "CLOAD", "CFLUX", "TEMPERATURE"), "node"),
    **dict.fromkeys(("DLOAD", "DFLUX", "FILM", "RADIATE"), "element"),
    "DSLOAD": "surface",
}
#: Cards whose first data line lists surfaces.
_PAIRS = ("CONTACTPAIR", "TIE")


class Contradiction(NamedTuple):
    """A contradiction in a deck: its card, its file and line (those of a data line, if it is in one), and why."""

    card: DeckCard
    file: str
    line: int
    why: str


def contradictions(deck: Deck) -> Iterator[Contradiction]:
    """Find the contradictions of a deck: those of its frame, then those of its names, in the order of its cards."""
    yield from contradictions_of_frame(deck)
    if deck.apart:  # names of parts are other names in the mesh
        return
    names = _Names(deck)
    for card in deck.cards:
        yield from _parameters(card, names)
        yield from _data(card, names)


def contradictions_of_frame(deck: Deck) -> Iterator[Contradiction]:
    """Find steps inside steps, or without an end, and parameters that stand twice."""
    inside: DeckCard | None = None
    for card in deck.cards:
        if card.key == "STEP" and inside is not None:
            yield _at(card, f"the step of line {inside.line} has no *END STEP before it; end it")
        if card.key == "ENDSTEP" and inside is None:
            yield _at(card, "there is no *STEP above it; take it out, or begin the step")
        inside = {"STEP": card, "ENDSTEP": None}.get(card.key, inside)
        yield from _twice(card)
    if inside is not None:
        yield _at(inside, "this step has no *END STEP; end it")


def _at(card: DeckCard, why: str) -> Contradiction:
    return Contradiction(card, card.file, card.line, why)


class _Names:
    """Names and numbers that a deck has."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        self.given = {key: _names_of(deck, key) for key in set(_BY_PARAMETER.values())}
        self._nodes = np.sort(deck.mesh.node_number)
        numbers = [card.numbers for card in deck.named("ELEMENT") if card.numbers is not None]
        self._elements = np.sort(concatenated(numbers))
        self.all_cells = all(card.numbers is not None for card in deck.named("ELEMENT"))

    def missing(self, kind: str, name: str) -> str:
        """Words on a node, element or surface that a deck lacks; empty if it is there."""
        if kind != "surface" and _NUMBER.fullmatch(name):
            numbers = self._nodes if kind == "node" else self._elements
            at = int(np.searchsorted(numbers, int(name)))
            there = (at < len(numbers) and int(numbers[at]) == int(name)) or not (kind == "node" or self.all_cells)
            return "" if there else f"there is no {kind} {name}; take the line out, or give the {kind}"
        known = self._groups(kind)
        if {key_of(name), key_of(name.rpartition(".")[2])} & set(known):
            return ""
        what = "surface" if kind == "surface" else f"{kind} set"
        return f"there is no {what} {name!r}{did_you_mean(name, known.values())}"

    def _groups(self, kind: str) -> dict[str, str]:
        deck = self.deck
        if kind == "surface":
            return {key: group for (_, key), group in deck.surfaces.items()}
        return dict(deck.node_sets if kind == "node" else deck.element_sets)


def _names_of(deck: Deck, key: str) -> dict[str, str]:
    """Names that the cards of a kind give, by their form for comparison."""
    return {key_of(name): name for card in deck.named(key) if (name := card.options.get("NAME", ""))}


def _twice(card: DeckCard) -> Iterator[Contradiction]:
    """Find parameters that stand twice in a keyword line, with different values."""
    text = "".join(card.head.split("\n")).partition(",")[2]
    values: dict[str, str] = {}
    for parameter in _PARAMETER.finditer(text):
        name = "".join(parameter[1].split()).upper()
        if key_of(values.setdefault(name, parameter[2])) != key_of(parameter[2]):
            yield _at(card, f"{name} is both {values[name]} and {parameter[2]}; take one out")


def _parameters(card: DeckCard, names: _Names) -> Iterator[Contradiction]:
    """Find parameters that name what is not there."""
    if card.key in _OF_SETS:
        for option, kind in (("ELSET", "element"), ("NSET", "node")):
            if card.options.get(option) and (why := names.missing(kind, card.options[option])):
                yield _at(card, why)
    for option, key in _BY_PARAMETER.items():
        name, known = card.options.get(option, ""), names.given[key]
        if name and card.key in (*_OF_SETS, *_FIRST, *_PAIRS) and key_of(name) not in known:
            yield _at(card, f"there is no {option.lower()} {name!r}{did_you_mean(name, known.values())}")


def _data(card: DeckCard, names: _Names) -> Iterator[Contradiction]:
    """Find data lines that begin with what is not there."""
    if card.key in _FIRST:
        lines: tuple[DataLine, ...] = card.data
        wanted = [(line, _FIRST[card.key], line.fields[:1]) for line in lines]
    elif card.key in _PAIRS:
        wanted = [(line, "surface", line.fields[:2]) for line in card.data[:1]]
    else:
        return
    for line, kind, fields in wanted:
        for name in filter(None, fields):
            if why := names.missing(kind, name):
                yield Contradiction(card, line.file, line.line, why)
