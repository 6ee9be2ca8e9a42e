"""Import of a deck: each card goes to its handler, then the records are finished, and the case checks itself."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial as part
from pathlib import Path

import lacmesh
from lacmesh.deck import Deck, DeckCard, key_of
from lacmesh.errors import ReadError
from lacmesh.formats.inp.carry import flattened
from lacmesh.mesh import Mesh
from lacsolver.case import Case, CaseError, Issue, parse_case
from lacsolver.decks import contact, loads, materials, steps
from lacsolver.decks.cards import Card, Finding, Lacking, Refused, look_up
from lacsolver.decks.groups import DeckGroups
from lacsolver.decks.histories import DeckStep
from lacsolver.decks.import_ import Import
from lacsolver.decks.names import Names
from lacsolver.decks.table import BY_LINE, HANDLERS, LACKS, NOTES, OF_THE_MESH, PROCEDURES

#: what adds records that depend on many cards, by their section
_OF_THE_WHOLE: tuple[tuple[str, Callable[[Import], None]], ...] = (
    ("material", materials.top),
    ("material", materials.materials),
    ("contact", contact.contacts),
    ("displacement", loads.supports),
    ("pressure", loads.pressures),
    ("force", loads.forces),
    ("body_force", loads.gravity),
    ("body_force", loads.centrifugal),
    ("temperature", loads.temperatures),
    ("dynamics", steps.dynamics),
    ("steps", steps.steps),
)
_PARAMETER = re.compile(r'\s*([^,="]+?)\s*=\s*("[^"]*"|[^,]*?)\s*(?:,|$)')


@dataclass(frozen=True, eq=False)
class Imported:
    """An imported deck: the mesh and the case, the text of the case file, and the findings, in the order of lines."""

    mesh: Mesh
    case: Case
    text: str
    findings: tuple[Finding, ...]


def import_deck(path: str | Path, case_path: str | Path, *, lenient: bool = False, partial: bool = False) -> Imported:
    """Return the mesh and the case of a deck of CalculiX or Abaqus; nothing is written.

    `case_path`: where the case file will be; its mesh is named after it, with the suffix .med. `lenient`: cards that
    lacsolver has no place for are left out with a finding, which else are errors. `partial`: all that is not taken is
    left out so, if the rest is a case. Raises CaseError with every card that is not taken, ReadError for a file that
    is no deck, or a broken one.
    """
    path, case_path = Path(path), Path(case_path)
    import_ = _with_cards(lacmesh.read(path), lenient, partial)
    _raise(import_)
    if not import_.steps and import_.modal:
        import_.steps.append(DeckStep(import_.modal.card, 0.0))
    if not import_.steps:
        raise CaseError([Issue(f"{path}: there is no *STEP, and so nothing to compute; give it one with *STATIC")])
    import_.top["mesh"] = case_path.with_suffix(".med").name
    for section, build in _OF_THE_WHOLE:
        import_.later(section, None, part(build, import_))
    import_.finish()
    _raise(import_)
    mesh = import_.groups.written()
    _name_kinds(import_, mesh)
    case, text = _case(import_, path, case_path)
    if contact.set_clearances(import_, case, mesh):
        case, text = _case(import_, path, case_path)
    findings = sorted(dict.fromkeys(import_.findings), key=lambda one: (one.file, one.line))
    return Imported(mesh, case, text, tuple(findings))


def _with_cards(mesh: Mesh, lenient: bool, partial: bool) -> Import:
    """Return the import of the deck of a mesh with all its cards read, one of parts and instances as one without.

    Raises ReadError for a mesh that was not read from a deck.
    """
    if mesh.deck is None:
        raise ReadError(mesh.name, "is no deck of CalculiX or Abaqus (.inp)")
    flat, refused = flattened(mesh.deck)
    mesh = replace(mesh, deck=flat)
    import_ = Import(Names(mesh), DeckGroups.of(mesh), lenient, partial)
    for wrong, line, why in (*refused, *_frame_errors(flat)):
        place = line or wrong
        import_.findings.append(Finding(place.file, place.line, wrong.name, why, "error"))
    for card in map(Card.from_deck, flat.cards):
        for one in card.lines if card.key in BY_LINE else [card]:
            with import_.taking(one):
                _take(import_, one)
    for section in import_.sections:
        with import_.taking(section.card):
            import_.material_of(section)
            if section.axes:
                look_up(import_.orientations, section.axes, "*ORIENTATION")
    return import_


def _take(import_: Import, card: Card) -> None:
    """Take one card. Raises Refused."""
    if card.key in HANDLERS:
        handler, takes, ignores = HANDLERS[card.key]
        others = [name for name in card.options if name not in (*takes.split(), *ignores.split())]
        if others:
            raise Refused(
                f"the option {', '.join(others)} is not supported; remove it if the answer does not depend on it"
            )
        handler(import_, card)
    elif card.key in NOTES:
        import_.note(card, NOTES[card.key])
    elif card.key in PROCEDURES:
        if import_.in_step:
            import_.steps[-1].left_out = True
        raise Refused(PROCEDURES[card.key])
    elif card.key in LACKS:
        raise Lacking(LACKS[card.key])
    elif card.key not in OF_THE_MESH:
        raise Lacking("lacsolver does not know this card; take it out if the answer does not hang on it")


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


def _raise(import_: Import) -> None:
    """Raise CaseError if there is an error among the findings."""
    errors = [finding for finding in import_.findings if finding.level == "error"]
    if errors:
        raise CaseError([Issue(finding.text) for finding in dict.fromkeys(errors)])


def _name_kinds(import_: Import, mesh: Mesh) -> None:
    """Say which kind of group a record means where a group of cells has the name of one of nodes."""
    for record in import_.records:
        groups = {record.keys.get(key) for key in ("group", "to")}
        if record.section in ("displacement", "force", "spring", "probe") and groups & mesh.cell_groups.keys():
            record.keys["kind"] = "node"


def _case(import_: Import, path: Path, case_path: Path) -> tuple[Case, str]:
    """Return the case of the records, and its text. Raises CaseError, with the card that a wrong record comes from."""
    text = import_.text(path.name)
    try:
        return parse_case(text, case_path), text
    except CaseError as error:
        lines = text.splitlines()
        raise CaseError([Issue(f"{_origin(lines, p.line)}{p.message}") for p in error.problems]) from None


def _origin(lines: list[str], line: int | None) -> str:
    """Return the card, from the comment above a line of the case, to go in front of a message."""
    above = [text for text in lines[: line or 0] if text.startswith("# *")]
    return f"{above[-1][2:]}: " if above else ""
