"""Interpretation of a deck: every card goes to the one place of the table that is meant for it."""

from __future__ import annotations

from dataclasses import replace

from lacmesh.errors import ReadError
from lacmesh.formats.inp.contradictions import contradictions_of_frame
from lacmesh.formats.inp.flat import flattened
from lacmesh.mesh import Mesh
from lacsolver.decks.cards import Card, Finding, Lacking, Refused, look_up
from lacsolver.decks.content import DeckContent
from lacsolver.decks.names import Names
from lacsolver.decks.table import LACKS, NOTES, OF_THE_MESH, PROCEDURES, READ


def interpret(mesh: Mesh, *, lenient: bool = False) -> DeckContent:
    """Return the content of the deck of a mesh, with a finding for every card that lacsolver does not take.

    A deck of parts and instances is read as one without (`lacmesh.formats.inp.flat`).

    `lenient`: cards that lacsolver has no place for are left out, with a finding that is no error.
    Raises ReadError for a mesh that was not read from a deck.
    """
    if mesh.deck is None:
        raise ReadError(mesh.name, "is no deck of CalculiX or Abaqus (.inp)")
    flat, refused = flattened(mesh.deck)
    deck = DeckContent(Names(replace(mesh, deck=flat)), lenient)
    wrong = (*refused, *contradictions_of_frame(flat))
    deck.findings += [Finding(one.file, one.line, one.card.name, one.why, "error") for one in wrong]
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
