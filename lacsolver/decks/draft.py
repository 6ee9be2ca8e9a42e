"""The case that an import writes, as it is being drafted: its records as keys and values, each with its card."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from lacmesh.mesh import Ints
from lacsolver.case.case import Case
from lacsolver.case.keys import sections_of
from lacsolver.case.toml import section_text
from lacsolver.decks.cards import Card
from lacsolver.decks.content import DeckContent
from lacsolver.decks.groups import DeckGroups

AXES = ("x", "y", "z")
#: model of a case by the plane elements of a deck
MODELS = {"CPS": "plane_stress", "CPE": "plane_strain", "CAX": "axisymmetric"}


class Record(NamedTuple):
    """A record of the case: its section, its keys and values, and the card that it comes from."""

    section: str
    keys: dict[str, Any]
    card: Card | None = None


@dataclass
class CaseDraft:
    """The case so far: what was read, the groups of its mesh, keys of the top, records in their order."""

    deck: DeckContent
    groups: DeckGroups
    top: dict[str, Any] = field(default_factory=dict)
    records: list[Record] = field(default_factory=list)
    #: by the group of the slave: the gap that replaces the one in the mesh, and its card
    clearances: dict[str, tuple[float, Card]] = field(default_factory=dict)

    @property
    def dim(self) -> int:
        """Dimension of the space."""
        return self.groups.mesh.dim

    @property
    def large(self) -> bool:
        """True for finite displacements (NLGEOM)."""
        return any(step.large for step in self.deck.steps)

    @property
    def end(self) -> float:
        """Time at which the last step ends."""
        return self.deck.steps[-1].end

    @property
    def ramped(self) -> float:
        """Time up to which a case ramps plain numbers: that at which the steps with inertia begin, else the end."""
        steps = self.deck.steps
        return next((step.begin for step in steps if step.alpha is not None), self.end)

    def add(self, section: str, keys: dict[str, Any], card: Card | None = None) -> None:
        """Add a record."""
        self.records.append(Record(section, keys, card))

    def node_group(self, name: str, nodes: Ints, default: str = "nodes") -> str:
        """Return the name of a group of nodes: `name`, else `node_7` of a single one, `default` of several."""
        if not name:
            name = f"node_{self.groups.mesh.node_number[nodes[0]]}" if len(nodes) == 1 else default
        return self.groups.add_nodes(name, nodes)


def case_text(head: Iterable[str], top: dict[str, Any], records: Iterable[Record]) -> str:
    """Return the text of a case: comment lines, keys of the top, then the records in the order of a case's sections."""
    order = list(sections_of(Case))
    ordered = sorted(records, key=lambda one: order.index(one.section))
    return "\n".join([section_text("", top, head), *map(_record, ordered)])


def _record(record: Record) -> str:
    header = sections_of(Case)[record.section].SECTION.header
    of = record.card.of if record.card else None
    comment = [f"*{of.name} ({Path(of.file).name}, line {of.line})"] if of else []
    return section_text(header, record.keys, comment)
