"""Import of a deck: from its mesh, with all its cards, to the mesh and the case of lacsolver."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh.mesh import Mesh
from lacsolver.case import Case, CaseError, Issue, parse_case
from lacsolver.decks import joint_records as joints
from lacsolver.decks import load_records as loads
from lacsolver.decks import model_records as model
from lacsolver.decks.body_records import centrifugal, gravity, rigid_bodies
from lacsolver.decks.cards import Card, Finding, Refused
from lacsolver.decks.content import DeckContent, DeckStep
from lacsolver.decks.draft import CaseDraft, case_text
from lacsolver.decks.groups import DeckGroups
from lacsolver.decks.interpret import interpret
from lacsolver.decks.motion_records import dynamics
from lacsolver.validation import validate

#: what drafts the records, in this order, and the card that a mistake without a line is told of
_BUILDERS: tuple[tuple[Callable[[CaseDraft], None], str], ...] = (
    (model.top, "ELEMENT"),
    (model.materials, "SOLIDSECTION"),
    (model.contacts, "CONTACTPAIR"),
    (joints.sectors, "CYCLICSYMMETRYMODEL"),
    (rigid_bodies, "RIGIDBODY"),
    (loads.supports, "BOUNDARY"),
    (loads.kept, "BOUNDARY"),
    (joints.equations, "EQUATION"),
    (joints.bolts, "PRE-TENSIONSECTION"),
    (joints.couplings, "COUPLING"),
    (model.springs, "SPRING"),
    (loads.pressures, "DLOAD"),
    (loads.forces, "CLOAD"),
    (gravity, "DLOAD"),
    (centrifugal, "DLOAD"),
    (loads.temperatures, "TEMPERATURE"),
    (dynamics, "DYNAMIC"),
    (loads.probes, "NODEPRINT"),
    (loads.steps, "STATIC"),
)
#: largest difference of gaps that are taken for one, relative to the extent of the mesh
_EVEN = 1e-6


@dataclass(frozen=True, eq=False)
class Imported:
    """An imported deck: the mesh and the case, the text of the case file, and the findings, in the order of lines."""

    mesh: Mesh
    case: Case
    text: str
    findings: tuple[Finding, ...]


def import_deck(path: str | Path, case_path: str | Path, *, lenient: bool = False) -> Imported:
    """Return the mesh and the case of a deck of CalculiX or Abaqus; nothing is written.

    `case_path`: where the case file will be; its mesh is named after it, with the suffix .med. `lenient`: cards that
    lacsolver has no place for are left out with a finding, which else are errors. Raises CaseError with every card that
    is not taken, ReadError for a file that is no deck, or a broken one.
    """
    path, case_path = Path(path), Path(case_path)
    deck = interpret(lacmesh.read(path), lenient=lenient)
    _raise(deck)
    draft = CaseDraft(deck, DeckGroups.of(deck.names.mesh), {"mesh": case_path.with_suffix(".med").name})
    if not deck.steps and deck.modal:
        deck.steps.append(DeckStep(deck.modal.card, 0.0))
    if not deck.steps:
        raise CaseError([Issue(f"{path}: there is no *STEP, and so nothing to compute; give it one with *STATIC")])
    for build, key in _BUILDERS:
        try:
            build(draft)
        except Refused as refused:
            cards = deck.names.deck
            card = next(cards.named(key), None) or next(cards.named("ELEMENT"), cards.cards[0])
            deck.error(refused.card or Card(card), refused.message, refused.row)
    _raise(deck)
    return _imported(path, case_path, draft)


def _raise(deck: DeckContent) -> None:
    """Raise CaseError if there is an error among the findings."""
    errors = [finding for finding in deck.findings if finding.level == "error"]
    if errors:
        raise CaseError([Issue(finding.text) for finding in dict.fromkeys(errors)])


def _imported(path: Path, case_path: Path, draft: CaseDraft) -> Imported:
    """Return the mesh and the case of a draft. Raises CaseError for values that a case cannot have."""
    head = [f"{path.name}, imported by lacsolver import"]
    mesh = draft.groups.written()
    _name_kinds(draft, mesh)
    text = case_text(head, draft.top, draft.records)
    case = _case(text, case_path)
    if draft.clearances:
        _set_clearances(draft, case, mesh)
        text = case_text(head, draft.top, draft.records)
        case = _case(text, case_path)
    findings = sorted(dict.fromkeys(draft.deck.findings), key=lambda one: (one.file, one.line))
    return Imported(mesh, case, text, tuple(findings))


def _name_kinds(draft: CaseDraft, mesh: Mesh) -> None:
    """Say which kind of group a record means where a group of cells has the name of one of nodes."""
    for record in draft.records:
        groups = {record.keys.get(key) for key in ("group", "to")}
        if record.section in ("displacement", "force", "spring", "probe") and groups & mesh.cell_groups.keys():
            record.keys["kind"] = "node"


def _case(text: str, case_path: Path) -> Case:
    """Return the case of a text. Raises CaseError, with the card that each wrong record comes from."""
    try:
        return parse_case(text, case_path)
    except CaseError as error:
        lines = text.splitlines()
        raise CaseError([Issue(f"{_origin(lines, p.line)}{p.message}") for p in error.problems]) from None


def _origin(lines: list[str], line: int | None) -> str:
    """Return the card, from the comment above a line of the case, to go in front of a message."""
    above = [text for text in lines[: line or 0] if text.startswith("# *")]
    return f"{above[-1][2:]}: " if above else ""


def _set_clearances(draft: CaseDraft, case: Case, mesh: Mesh) -> None:
    """Set clearances so that they replace the gap in the mesh, which must be even. Raises CaseError for another."""
    zones = {zone.slave: zone for zone in validate(case, mesh).zones}
    extent = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    for slave, (value, card) in draft.clearances.items():
        gap = zones[slave].gap if slave in zones else (np.nan, np.nan)
        if not gap[1] - gap[0] <= _EVEN * extent:
            message = (
                f"the gap in the mesh is from {gap[0]:.6g} to {gap[1]:.6g}, and a clearance of lacsolver is added to it"
            )
            draft.deck.error(card, f"{message}: it replaces an even gap only; move the nodes in the mesh instead")
            continue
        record = next(one for one in draft.records if one.section == "contact" and one.keys["slave"] == slave)
        of_steps = record.keys.get("clearance", [[0.0, 0.0]])  # of contact that is removed for some of them
        shift = value - ((gap[0] + gap[1]) / 2 - of_steps[0][1])
        shifted = [[t, more + shift] for t, more in of_steps]
        record.keys["clearance"] = shifted if "clearance" in record.keys else shift
    _raise(draft.deck)
