"""Interpretation of a deck: every card goes to the one place of the table that is meant for it."""

from __future__ import annotations

from dataclasses import replace

from lacmesh.errors import ReadError
from lacmesh.formats.inp.contradictions import contradictions_of_frame
from lacmesh.formats.inp.flat import flattened
from lacmesh.mesh import Mesh
from lacsolver.decks.cards import Card, Finding, Lacking, Refused, look_up
from lacsolver.decks.names import Names
from lacsolver.decks.reading import Reading
from lacsolver.decks.table import LACKS, NOTES, OF_THE_MESH, PROCEDURES, READ


def interpret(mesh: Mesh, *, lenient: bool = False) -> Reading:
    """Return the content of the deck of a mesh, with a finding for every card that lacsolver does not take.

    A deck of parts and instances is read as one without (`lacmesh.formats.inp.flat`).

    `lenient`: cards that lacsolver has no place for are left out, with a finding that is no error.
    Raises ReadError for a mesh that was not read from a deck.
    """
    if mesh.deck is None:
        raise ReadError(mesh.name, "is no deck of CalculiX or Abaqus (.inp)")
    flat, refused = flattened(mesh.deck)
    reading = Reading(Names(replace(mesh, deck=flat)), lenient)
    wrong = (*refused, *contradictions_of_frame(flat))
    reading.findings += [Finding(one.file, one.line, one.card.name, one.why, "error") for one in wrong]
    for deck_card in reading.names.deck.cards:
        card = Card(deck_card)
        try:
            _take(reading, card)
        except Lacking as lacking:
            if lenient:
                reading.warn(card, f"left out: {lacking.message}", lacking.row)
            else:
                reading.error(card, lacking.message, lacking.row)
        except Refused as found:
            reading.error(card, found.message, found.row)
    _check_sections(reading)
    return reading


def _check_sections(reading: Reading) -> None:
    """Tell of sections whose material or orientation is nowhere in the deck."""
    content = reading.content
    for section in content.sections:
        try:
            look_up(content.materials, section.material, "*MATERIAL")
            if section.axes:
                look_up(content.orientations, section.axes, "*ORIENTATION")
        except Refused as found:
            reading.error(section.card, found.message)


def _take(reading: Reading, card: Card) -> None:
    """Take one card. Raises Refused."""
    row = READ.get(card.key)
    if row is not None:
        others = [name for name in card.options if name not in row.takes | row.ignores]
        if others:
            raise Refused(f"the option {', '.join(others)} is not taken; take it out if the answer does not hang on it")
        row.read(reading, card)
    elif card.key in NOTES:
        reading.note(card, NOTES[card.key])
    elif card.key in PROCEDURES:
        raise Refused(PROCEDURES[card.key])
    elif card.key in LACKS:
        raise Lacking(LACKS[card.key])
    elif card.key not in OF_THE_MESH:
        raise Lacking("lacsolver does not know this card; take it out if the answer does not hang on it")
