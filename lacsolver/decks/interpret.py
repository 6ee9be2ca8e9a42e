"""Interpretation of a deck: every card goes to the one place of the table that is meant for it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from lacmesh.deck import Deck, DeckCard, key_of
from lacmesh.errors import ReadError
from lacmesh.formats.inp.carry import flattened
from lacmesh.mesh import Mesh
from lacsolver.decks.cards import Card, Finding, Lacking, Refused, look_up
from lacsolver.decks.content import DeckContent
from lacsolver.decks.names import Names
from lacsolver.decks.table import LACKS, NOTES, OF_THE_MESH, PROCEDURES, READ

_PARAMETER = re.compile(r'\s*([^,="]+?)\s*=\s*("[^"]*"|[^,]*?)\s*(?:,|$)')


def interpret(mesh: Mesh, *, lenient: bool = False) -> DeckContent:
    """Return the content of the deck of a mesh, with a finding for every card that lacsolver does not take.

    A deck of parts and instances is read as one without (`lacmesh.formats.inp.carry`).

    `lenient`: cards that lacsolver has no place for are left out, with a finding that is no error.
    Raises ReadError for a mesh that was not read from a deck.
    """
    if mesh.deck is None:
        raise ReadError(mesh.name, "is no deck of CalculiX or Abaqus (.inp)")
    flat, refused = flattened(mesh.deck)
    deck = DeckContent(Names(replace(mesh, deck=flat)), lenient)
    for wrong, line, why in (*refused, *_frame_errors(flat)):
        place = line or wrong
        deck.findings.append(Finding(place.file, place.line, wrong.name, why, "error"))
    for deck_card in deck.names.deck.cards:
        card = Card(deck_card)
        try:
            _take(deck, card)
        except Lacking as lacking:
            if lenient:
                deck.warn(card, f"left out: {lacking.message}", lacking.row)
            else:
                deck.error(card, lacking.message, lacking.row)
        except Refused as found:
            deck.error(card, found.message, found.row)
    _check_sections(deck)
    return deck


def _frame_errors(deck: Deck) -> Iterator[tuple[DeckCard, None, str]]:
    """Yield cards of steps inside steps, or without an end, and of parameters that stand twice; and what is wrong."""
    step: DeckCard | None = None
    for card in deck.cards:
        if card.key == "STEP" and step is not None:
            yield card, None, f"the step of line {step.line} has no *END STEP before it; end it"
        if card.key == "ENDSTEP" and step is None:
            yield card, None, "there is no *STEP above it; take it out, or begin the step"
        step = {"STEP": card, "ENDSTEP": None}.get(card.key, step)
        values: dict[str, str] = {}
        for name, value in _PARAMETER.findall("".join(card.head.split("\n")).partition(",")[2]):
            option = "".join(name.split()).upper()
            if key_of(values.setdefault(option, value)) != key_of(value):
                yield card, None, f"{option} is both {values[option]} and {value}; take one out"
    if step is not None:
        yield step, None, "this step has no *END STEP; end it"


def _check_sections(deck: DeckContent) -> None:
    """Tell of sections whose material or orientation is nowhere in the deck."""
    for section in deck.sections:
        try:
            deck.material_of(section)
            if section.axes:
                look_up(deck.orientations, section.axes, "*ORIENTATION")
        except Refused as found:
            deck.error(section.card, found.message)


def _take(deck: DeckContent, card: Card) -> None:
    """Take one card. Raises Refused."""
    row = READ.get(card.key)
    if row is not None:
        read, takes, ignores = row
        others = [name for name in card.options if name not in (*takes.split(), *ignores.split())]
        if others:
            raise Refused(f"the option {', '.join(others)} is not taken; take it out if the answer does not hang on it")
        read(deck, card)
    elif card.key in NOTES:
        deck.note(card, NOTES[card.key])
    elif card.key in PROCEDURES:
        raise Refused(PROCEDURES[card.key])
    elif card.key in LACKS:
        raise Lacking(LACKS[card.key])
    elif card.key not in OF_THE_MESH:
        raise Lacking("lacsolver does not know this card; take it out if the answer does not hang on it")
