"""Content of a deck that lacsolver has a place for: what its cards say, before it becomes the records of a case.

Nodes, cells and facets are indices into the mesh of the deck; a facet is 8 times its cell and its place among the
facets of that cell.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lacmesh.mesh import Floats, Ints
from lacsolver.decks.cards import Card, DeckLine, Finding, Refused, look_up
from lacsolver.decks.names import Names

#: kinds of what acts, and the components of each
COMPONENTS = {
    "displacement": 3,
    "held": 3,
    "force": 3,
    "spin": 3,
    "moment": 3,
    "pressure": 1,
    "gravity": 3,
    "centrifugal": 1,
    "temperature": 1,
    "velocity": 3,
}


@dataclass
class MaterialData:
    """A material: the keys of its [[material]] so far, and the card that began it.

    `damping`: factors of its mass and of its stiffness.
    """

    name: str
    card: Card
    keys: dict[str, Any] = field(default_factory=dict)
    damping: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class DeckSection:
    """Cells (indices) of one material; `axes`: the name of an orientation, or ""; `thickness` of the plane."""

    name: str
    cells: Ints
    material: str
    axes: str
    thickness: float
    card: Card


@dataclass(frozen=True)
class Amplitude:
    """Factor ((time, value), ...) of loads, over the time of the step or of the whole analysis."""

    rows: tuple[tuple[float, float], ...]
    total: bool


@dataclass
class Interaction:
    """Surface interaction: `stiffness` of linear contact, {} if hard; keys of a `curve`; `tied`; and its friction.

    `stiffness`: that from each step on, -1 for the model's; `friction`: coefficient, likewise, inf if rough;
    `shear_limit`: the largest stress of friction, None without a limit. `damping`: pressure per approach velocity, and
    its card; None without.
    """

    card: Card
    stiffness: dict[int, float] = field(default_factory=dict)
    curve: dict[str, Any] = field(default_factory=dict)
    tied: bool = False
    friction: dict[int, float] = field(default_factory=dict)
    shear_limit: float | None = None
    damping: tuple[float, Card] | None = None


@dataclass(frozen=True)
class Pair:
    """A contact pair or a tie: names of its skins, and the keys of the record that do not depend on others."""

    slave: str
    master: str
    interaction: str
    keys: Mapping[str, Any]
    card: Card
    tie: bool = False


@dataclass(frozen=True)
class DeckRigid:
    """A rigid body: its group, kind of group, and the nodes (indices) that hold its place and its rotation."""

    group: str
    kind: str
    nodes: Ints
    reference: int
    rotation: int | None
    card: Card


@dataclass(frozen=True)
class DeckEquation:
    """An equation: (node, direction, factor) of each term, at `row` of its card. `linearised`: its *MPC, or ""."""

    terms: tuple[tuple[int, int, float], ...]
    card: Card
    row: DeckLine
    linearised: str = ""


@dataclass(frozen=True)
class LocalSystem:
    """Local axes of some nodes, as the `axes` of a case, in three dimensions."""

    nodes: Ints
    axes: dict[str, list[float]]
    card: Card


@dataclass
class DeckBolt:
    """A section of a bolt: its group and `facets`, its `normal` or (), and the node `reference`, whose direction 1 has
    its force or its shortening. `lock`: the step from which this stays as it is, None if it does not.
    """

    group: str
    facets: Ints
    reference: int
    normal: tuple[float, ...]
    card: Card
    lock: int | None = None


@dataclass
class DeckCoupling:
    """A coupling of the node `reference` with a group of `facets` or of `nodes`, the other one None.

    `kind`: that of [[coupling]], "" as long as it is not known; `components` that follow, of a rigid one; `weights` of
    nodes, None for those of the area.
    """

    group: str
    facets: Ints | None
    nodes: Ints | None
    reference: int
    card: Card
    kind: str = ""
    components: list[int] = field(default_factory=lambda: [0, 1, 2])
    weights: dict[int, float] | None = None
    axes: dict[str, list[float]] | None = None


@dataclass
class DeckSector:
    """The sides of a sector, name and facets of each; the number of sectors, 0 if it is not known, and the axis."""

    slave: tuple[str, Ints]
    master: tuple[str, Ints]
    card: Card
    count: int = 0
    origin: Floats = field(default_factory=lambda: np.zeros(3))
    axis: Floats = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class GroundSpring:
    """Springs of one stiffness along one axis at the nodes of an element set."""

    group: str
    nodes: Ints
    axis: int
    stiffness: float
    card: Card


@dataclass(frozen=True)
class SpringsBetween:
    """Springs of one stiffness between pairs of nodes `ends` (m, 2), along an axis, or along their lines if None."""

    ends: Ints
    axis: int | None
    stiffness: float
    card: Card


@dataclass(frozen=True)
class PointMass:
    """Mass at a node (index), or moments of inertia about axes along x, y and z through it."""

    node: int
    mass: float
    inertia: tuple[float, ...]
    card: Card


@dataclass
class DeckStep:
    """A step: when it begins and how long it takes, its increments, and how loads without amplitude grow.

    `procedure`: the card that says what is computed. `increment`: the first one; `largest`: the largest one allowed.
    `alpha`: numerical damping of a step with inertia, None for a static one. `modes`: how many natural modes it asks
    for; such a step takes no time, and goes at its end. `changes`: the last card in it of each that begins a change of
    a surface interaction.
    """

    card: Card
    begin: float
    procedure: Card | None = None
    period: float = 1.0
    increment: float = 1.0
    largest: float = 0.0
    direct: bool = False
    large: bool = False
    sudden: bool = False
    alpha: float | None = None
    modes: int = 0
    changes: dict[str, Card] = field(default_factory=dict)

    @property
    def origin(self) -> Card:
        """The card of the procedure, or that of the step if it has none."""
        return self.procedure or self.card

    @property
    def end(self) -> float:
        """Time at which the step ends."""
        return self.begin + self.period


@dataclass(frozen=True)
class Assigned:
    """One line of a load, a support or a temperature: `value` on components of some items in a step.

    `items`: nodes, facets or cells; `step`: -1 for what the model says; `data`: numbers beside the value, such as the
    axis of a centrifugal load.
    """

    kind: str
    step: int
    name: str
    items: Ints
    components: tuple[int, ...]
    value: float
    amplitude: str
    card: Card
    row: DeckLine
    data: tuple[float, ...] = ()


@dataclass
class DeckContent:
    """Everything that the cards of a deck have said, in their order, and what was found. Names are keys in capitals.

    `names`: those of its mesh. `lenient`: what lacsolver lacks is left out, with a warning. `variants`: names of
    elements that a note has told of. `spring_types`: those of the elements that are springs between two nodes.
    """

    names: Names
    lenient: bool = False
    findings: list[Finding] = field(default_factory=list)
    variants: set[str] = field(default_factory=set)
    spring_types: set[str] = field(default_factory=set)
    materials: dict[str, MaterialData] = field(default_factory=dict)
    orientations: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = field(default_factory=dict)
    sections: list[DeckSection] = field(default_factory=list)
    amplitudes: dict[str, Amplitude] = field(default_factory=dict)
    interactions: dict[str, Interaction] = field(default_factory=dict)
    pairs: list[Pair] = field(default_factory=list)
    clearances: dict[tuple[str, str], tuple[float, Card]] = field(default_factory=dict)
    #: for a pair: the steps in which its contact is removed (False) or added again (True), and the card that says so
    changes: dict[tuple[str, str], list[tuple[int, bool, Card]]] = field(default_factory=lambda: defaultdict(list))
    rigid: list[DeckRigid] = field(default_factory=list)
    springs: list[GroundSpring] = field(default_factory=list)
    springs_between: list[SpringsBetween] = field(default_factory=list)
    equations: list[DeckEquation] = field(default_factory=list)
    systems: list[LocalSystem] = field(default_factory=list)
    couplings: list[DeckCoupling] = field(default_factory=list)
    bolts: list[DeckBolt] = field(default_factory=list)
    sectors: dict[str, DeckSector] = field(default_factory=dict)
    masses: list[PointMass] = field(default_factory=list)
    steps: list[DeckStep] = field(default_factory=list)
    assigned: list[Assigned] = field(default_factory=list)
    #: kinds of which a step removes what earlier steps have said, and the card that says so
    removed: dict[str, dict[int, Card]] = field(default_factory=lambda: defaultdict(dict))
    #: nodes whose displacements are asked for
    watched: dict[int, None] = field(default_factory=dict)
    #: the step that asks for natural modes
    modal: DeckStep | None = None
    in_step: bool = False

    @property
    def step(self) -> DeckStep:
        """The step that is open. Raises Refused outside a step."""
        if not self.in_step:
            raise Refused("it belongs between *STEP and *END STEP; move it there")
        return self.steps[-1]

    def begin_procedure(self, card: Card) -> DeckStep:
        """Return the step that is open, which has this procedure. Raises Refused if it has another."""
        which = self.step
        if which.procedure is not None:
            before = which.procedure.of
            raise Refused(f"this step is *{before.name} already (line {before.line}); keep one of them")
        which.procedure = card
        return which

    @property
    def material(self) -> MaterialData:
        """The material begun last. Raises Refused before the first."""
        if not self.materials:
            raise Refused("it belongs after *MATERIAL, NAME=name; move it there")
        return next(reversed(self.materials.values()))

    def material_of(self, section: DeckSection) -> MaterialData:
        """Return the material of a section. Raises Refused if the deck has none of this name."""
        return self.materials[look_up(self.materials, section.material, "*MATERIAL")]

    @property
    def references(self) -> list[int]:
        """Reference nodes of rigid bodies, couplings and bolts, which belong to no solid element."""
        every: tuple[DeckRigid | DeckCoupling | DeckBolt, ...] = (*self.rigid, *self.couplings, *self.bolts)
        return [one.reference for one in every]

    @property
    def beside_bodies(self) -> list[int]:
        """The reference nodes, and the nodes that hold the rotations of rigid bodies."""
        return [*self.references, *(body.rotation for body in self.rigid if body.rotation is not None)]

    @property
    def interaction(self) -> Interaction:
        """The surface interaction begun last. Raises Refused before the first."""
        if not self.interactions:
            raise Refused("it belongs after *SURFACE INTERACTION, NAME=name; move it there")
        return next(reversed(self.interactions.values()))

    def tell(self, level: str, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Tell something about a card, or about one of its lines; for `level` see Finding."""
        place = row or card.of
        self.findings.append(Finding(place.file, place.line, card.of.name, message, level))

    def note(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Tell what does not change the answer."""
        self.tell("note", card, message, row)

    def warn(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Tell what may change the answer."""
        self.tell("warning", card, message, row)

    def error(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Tell what would change the answer, and is not taken."""
        self.tell("error", card, message, row)

    def lack(self, card: Card, message: str, instead: str = "") -> None:
        """Tell what would change the answer and is not taken, or, if this is lenient, what is taken instead."""
        if self.lenient:
            self.warn(card, f"left out: {message}; {instead}")
        else:
            self.error(card, message)
