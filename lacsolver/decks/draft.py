"""The case that an import writes, as it is being drafted: its records as keys and values, each with its card."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from lacmesh.mesh import Ints
from lacsolver.decks.cards import Card
from lacsolver.decks.groups import DeckGroups
from lacsolver.decks.reading import Reading

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

    reading: Reading
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
        return any(step.large for step in self.reading.content.steps)

    @property
    def end(self) -> float:
        """Time at which the last step ends."""
        return self.reading.content.steps[-1].end

    @property
    def ramped(self) -> float:
        """Time up to which a case ramps plain numbers: that at which the steps with inertia begin, else the end."""
        steps = self.reading.content.steps
        return next((step.begin for step in steps if step.alpha is not None), self.end)

    @property
    def per_thickness(self) -> float:
        """Factor of forces and springs: those of plane strain are per unit of thickness."""
        return 1 / self.thickness if self.top.get("model") == "plane_strain" else 1.0

    @property
    def thickness(self) -> float:
        """Thickness of the plane body."""
        return self.reading.content.sections[0].thickness if self.reading.content.sections else 1.0

    def add(self, section: str, keys: dict[str, Any], card: Card | None = None) -> None:
        """Add a record."""
        self.records.append(Record(section, keys, card))

    def node_group(self, name: str, nodes: Ints, default: str = "nodes") -> str:
        """Return the name of a group of nodes: `name`, else `node_7` of a single one, `default` of several."""
        if not name:
            name = f"node_{self.groups.mesh.node_number[nodes[0]]}" if len(nodes) == 1 else default
        return self.groups.add_nodes(name, nodes)
