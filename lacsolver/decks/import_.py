"""The import of a deck while its cards are read: the records of the case so far, what cards refer to, and findings.

A handler adds the records of its card. What it cannot know before all cards are read, such as the load of a reference
node, it leaves to a function given to `Import.later`. Names are keys in capitals (`key_of`); nodes, cells and facets
are indices into the mesh of the deck, a facet 8 times its cell and its place among the facets of that cell.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from lacmesh.deck import key_of
from lacmesh.mesh import Floats, Ints
from lacsolver.case.toml import section_text
from lacsolver.decks.cards import Card, DeckLine, Finding, Lacking, Refused, look_up
from lacsolver.decks.groups import DeckGroups
from lacsolver.decks.histories import Amplitude, Assigned, DeckStep, Orders, Points, written
from lacsolver.decks.names import Names
from lacsolver.space.axes import cartesian, cylindrical

_Begun = TypeVar("_Begun")
AXES = ("x", "y", "z")
#: model of a case by the plane elements of a deck
MODELS = {"CPS": "plane_stress", "CPE": "plane_strain", "CAX": "axisymmetric"}
#: sections of a case, in the order in which they are made and written; those with False are there once
SECTIONS = {
    **dict.fromkeys(("material", "contact", "tie", "cyclic", "rigid", "displacement", "equation", "coupling"), True),
    **dict.fromkeys(("pretension", "spring", "pressure", "force", "body_force"), True),
    **{"gravity": False, "temperature": True, "dynamics": False, "initial": True, "probe": True, "steps": False},
}
#: card of a mistake in a section as a whole
_CARDS_OF = {
    **{"material": "SOLIDSECTION", "contact": "CONTACTPAIR", "displacement": "BOUNDARY", "pressure": "DLOAD"},
    **{"force": "CLOAD", "body_force": "DLOAD", "temperature": "TEMPERATURE", "dynamics": "DYNAMIC", "steps": "STATIC"},
}
#: kinds of what acts, and the components of each
COMPONENTS = {
    **dict.fromkeys(("displacement", "held", "force", "spin", "moment", "gravity", "velocity"), 3),
    **dict.fromkeys(("pressure", "centrifugal", "temperature"), 1),
}


class Record(NamedTuple):
    """A record of the case: its section, its keys and values, and the card that it comes from."""

    section: str
    keys: dict[str, Any]
    card: Card | None = None

    @property
    def text(self) -> str:
        """The record as TOML, with a comment that names the card."""
        header = f"[[{self.section}]]" if SECTIONS[self.section] else f"[{self.section}]"
        of = self.card.of if self.card else None
        return section_text(header, self.keys, [f"*{of.name} ({Path(of.file).name}, line {of.line})"] if of else [])


@dataclass
class DeckMaterial:
    """A material: the keys of its [[material]] so far, the card that began it, its damping (of mass, of stiffness)."""

    name: str
    card: Card
    keys: dict[str, Any] = field(default_factory=dict)
    damping: tuple[float, float] = (0.0, 0.0)


class DeckSection(NamedTuple):
    """Cells (k,) of one material; `axes`: the name of an orientation, or ""; `thickness` of the plane."""

    name: str
    cells: Ints
    material: str
    axes: str
    thickness: float
    card: Card


class DeckRigid(NamedTuple):
    """Nodes (k,) of a rigid body, and the nodes that hold its place and, or None, its rotation."""

    nodes: Ints
    reference: int
    rotation: int | None


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


@dataclass
class Pair:
    """A contact pair or a tie: names of its skins, and the keys of the record that do not depend on others.

    `clearance`: the gap that replaces the one of the mesh, and its card. `changes`: the steps in which the contact is
    removed (False) or added again (True), and the card that says so. `record`: keys of the [[contact]], once made.
    """

    slave: str
    master: str
    interaction: str
    keys: Mapping[str, Any]
    card: Card
    tie: bool = False
    clearance: tuple[float, Card] | None = None
    changes: list[tuple[int, bool, Card]] = field(default_factory=list)
    record: dict[str, Any] = field(default_factory=dict)


@dataclass
class Import:
    """An import: what the cards have given so far, in their order, and what was found.

    `lenient`: cards that lacsolver lacks are left out, with a warning; `partial`: all that is not taken. `top`: keys of
    the top of the case. `couplers`: sets of DCOUP3D, which are no cells. `assigned`: lines of loads and supports;
    `removed`: for a kind, the steps that remove those of earlier steps, and the card that says so. `systems`: nodes
    with local axes, as the `axes` of a case. `references`: nodes of rigid bodies, couplings and bolts; `equated`: nodes
    in equations. `locks`: the step from which the bolt of a reference node stays as it is.
    """

    names: Names
    groups: DeckGroups
    lenient: bool = False
    partial: bool = False
    top: dict[str, Any] = field(default_factory=dict)
    records: list[Record] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    variants: set[str] = field(default_factory=set)
    spring_types: set[str] = field(default_factory=set)
    couplers: set[str] = field(default_factory=set)
    materials: dict[str, DeckMaterial] = field(default_factory=dict)
    orientations: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = field(default_factory=dict)
    sections: list[DeckSection] = field(default_factory=list)
    amplitudes: dict[str, Amplitude] = field(default_factory=dict)
    interactions: dict[str, Interaction] = field(default_factory=dict)
    pairs: list[Pair] = field(default_factory=list)
    bodies: list[DeckRigid] = field(default_factory=list)
    references: list[int] = field(default_factory=list)
    equated: list[int] = field(default_factory=list)
    systems: list[tuple[Ints, dict[str, list[float]]]] = field(default_factory=list)
    couplings: list[dict[str, Any]] = field(default_factory=list)
    locks: dict[int, int | None] = field(default_factory=dict)
    sectors: dict[str, dict[str, Any]] = field(default_factory=dict)
    masses: list[tuple[int, float, tuple[float, ...], Card]] = field(default_factory=list)
    steps: list[DeckStep] = field(default_factory=list)
    assigned: list[Assigned] = field(default_factory=list)
    removed: dict[str, dict[int, Card]] = field(default_factory=lambda: defaultdict(dict))
    watched: dict[int, None] = field(default_factory=dict)
    modal: DeckStep | None = None
    in_step: bool = False
    waiting: list[tuple[str, Card | None, Callable[[], None]]] = field(default_factory=list)

    # ---- the model

    @property
    def dim(self) -> int:
        """Dimension of the space."""
        return self.names.mesh.dim

    @property
    def model(self) -> str:
        """The model of the case, by the elements; that of the first kind, if a plane has several."""
        plane = self.names.mesh.plane or ""
        return "3d" if self.dim == 3 else MODELS.get(plane, "plane_strain")

    @property
    def large(self) -> bool:
        """True for finite displacements (NLGEOM)."""
        return any(step.large for step in self.steps)

    @property
    def ramped(self) -> float:
        """Time up to which a case ramps plain numbers: that at which the steps with inertia begin, else the end."""
        return next((step.begin for step in self.steps if step.alpha is not None), self.steps[-1].end)

    @property
    def step(self) -> DeckStep:
        """The step that is open. Raises Refused outside a step."""
        if not self.in_step:
            raise Refused("it belongs between *STEP and *END STEP; move it there")
        return self.steps[-1]

    @property
    def beside_bodies(self) -> list[int]:
        """The reference nodes, and the nodes that hold the rotations of rigid bodies."""
        return [*self.references, *(body.rotation for body in self.bodies if body.rotation is not None)]

    @property
    def material(self) -> DeckMaterial:
        """The material begun last. Raises Refused before the first."""
        return _last(self.materials, "MATERIAL")

    @property
    def interaction(self) -> Interaction:
        """The surface interaction begun last. Raises Refused before the first."""
        return _last(self.interactions, "SURFACE INTERACTION")

    def material_of(self, section: DeckSection) -> DeckMaterial:
        """Return the material of a section. Raises Refused if the deck has none of this name."""
        return self.materials[look_up(self.materials, section.material, "*MATERIAL")]

    def of_cells(self, key: str) -> Floats:
        """Return a key of the material of each cell (n_cells,), 0 without one."""
        out = np.zeros(self.names.mesh.n_cells)
        for section in self.sections:
            value = self.material_of(section).keys.get(key, 0.0)
            out[section.cells] = max(map(abs, value)) if isinstance(value, list) else value
        return out

    # ---- records

    def add(self, section: str, keys: dict[str, Any], card: Card | None = None) -> None:
        """Add a record."""
        self.records.append(Record(section, keys, card))

    def later(self, section: str, card: Card | None, build: Callable[[], None]) -> None:
        """Call a function that adds records of a section when all cards are read.

        What it refuses is of this card, or of the whole: None, such as the materials, which cannot be left out.
        """
        self.waiting.append((section, card, build))

    def finish(self) -> None:
        """Call the functions that wait, in the order of sections."""
        for section, card, build in sorted(self.waiting, key=lambda one: list(SECTIONS).index(one[0])):
            if card is not None:
                with self.taking(card):
                    build()
                continue
            try:
                build()
            except Refused as found:
                cards = self.names.deck
                of = next(cards.named(_CARDS_OF[section]), None) or next(cards.named("ELEMENT"), cards.cards[0])
                self.error(found.card or Card.from_deck(of), found.message, found.row)

    @contextmanager
    def taking(self, card: Card) -> Iterator[None]:
        """Add a finding for what is refused of a card: a warning if it may be left out, else an error."""
        try:
            yield
        except Refused as found:
            of = found.card or card
            if self.partial or (self.lenient and isinstance(found, Lacking)):
                self.warn(of, f"left out: {found.message}", found.row)
            else:
                self.error(of, found.message, found.row)

    def text(self, name: str) -> str:
        """Return the text of the case that was imported from a file."""
        order = list(SECTIONS)
        ordered = sorted(self.records, key=lambda one: order.index(one.section))
        head = section_text("", self.top, [f"{name}, imported by lacsolver import"])
        return "\n".join([head, *(one.text for one in ordered)])

    def node_group(self, name: str, nodes: Ints, default: str = "nodes") -> str:
        """Return the name of a group of nodes: `name`, else `node_7` of a single one, `default` of several."""
        if not name:
            name = f"node_{self.names.mesh.node_number[nodes[0]]}" if len(nodes) == 1 else default
        return self.groups.add("nodes", name, nodes)

    # ---- what acts

    def amplitude(self, card: Card) -> Amplitude | None:
        """Return the amplitude that a card names, None without one. Raises Refused if it is not above the card."""
        if "AMPLITUDE" not in card.options:
            return None
        key = key_of(card.options["AMPLITUDE"])
        if key not in self.amplitudes:
            raise Refused(f"there is no *AMPLITUDE named {card.options['AMPLITUDE']!r} above this card")
        amplitude, delay = self.amplitudes[key], card.number("TIMEDELAY", 0.0)
        return replace(amplitude, rows=tuple((t + delay, factor) for t, factor in amplitude.rows))

    def assign(
        self, card: Card, row: DeckLine, kind: str, step: int, named: tuple[str, Ints],
        components: Sequence[int], value: float, data: Sequence[float] = (),
    ) -> None:  # fmt: skip
        """Add one line of what acts; `named`: a set and its items. Raises Refused for an unknown amplitude."""
        amplitude = self.amplitude(card)
        self.assigned.append(Assigned(kind, step, *named, tuple(components), value, amplitude, card, row, tuple(data)))

    def lines(self, kind: str) -> list[Assigned]:
        """Return the lines of one kind."""
        return [line for line in self.assigned if line.kind == kind]

    def orders(self, kind: str, lines: Sequence[Assigned]) -> Orders:
        """Return the orders of some lines; a load that a step removes (OP=NEW) goes to 0 in it.

        Supports and temperatures that a step removes are a finding.
        """
        cards, adds = self.removed.get(kind, {}), kind not in ("displacement", "spin", "temperature")
        orders = Orders.of(lines, self.steps, COMPONENTS[kind], adds, cards)
        for card in [] if adds else [cards[step] for step in orders.removed]:
            row = card.rows[0] if card.rows else None
            with self.taking(card):
                raise Refused("lacsolver cannot remove what OP=NEW removes here; repeat it in this step", row)
        return orders

    def history(self, kind: str, node: int, c: int) -> Points | None:
        """Return the history of a component of one node, None if the deck says nothing of it. Raises Refused."""
        lines = [replace(line, items=np.array([node])) for line in self.lines(kind) if node in line.items]
        if not lines:
            return None
        orders = self.orders(kind, lines)
        late = [k for k in range(len(orders.label)) if any(orders.order_of(k, 0)) and orders.order_of(k, 0)[0] is None]
        if kind in ("displacement", "spin") and late:
            message = "this motion of a reference node begins after the first step; lacsolver's begin with the first"
            line = orders.line_of(0, late[0])
            message += "; prescribe it in the first step too, or compute the steps apart"
            raise Refused(message, line.row, line.card)
        return orders.history(node, c)

    def value(self, kind: str, node: int, c: int) -> Any:
        """Return a component of one node as the value of a case, None if the deck says nothing of it."""
        points = self.history(kind, node, c)
        return None if points is None else written(points, self.ramped)

    # ---- local axes

    def axes_at(self, node: int) -> dict[str, list[float]] | None:
        """Return the local axes of a node by the last *TRANSFORM that names it; None for those of the mesh."""
        return next((axes for nodes, axes in reversed(self.systems) if node in nodes), None)

    def directions_at(self, node: int) -> Floats:
        """Return the directions (3, 3) of the displacements of a node, a row each."""
        axes = self.axes_at(node)
        if axes is None:
            return np.eye(3)
        if "axis" not in axes:
            return cartesian(axes, 3)
        (directions,), (radius,) = cylindrical(axes, self.names.mesh.points[[node]])
        if not radius > 0:
            raise Refused(f"node {self.names.mesh.node_number[node]} is on the axis of its *TRANSFORM")
        return directions

    def by_axes(self, nodes: Ints) -> Iterator[tuple[dict[str, Any], Ints]]:
        """Yield keys for the local axes of some nodes, {} for those of the mesh, and the nodes that have them."""
        which = np.full(len(nodes), -1)
        for k, (own, _) in enumerate(self.systems):
            which[np.isin(nodes, own)] = k
        for k in np.unique(which).tolist():
            yield {} if k < 0 else {"axes": self.axes_in_model(self.systems[k][1])}, nodes[which == k]

    def axes_in_model(self, axes: dict[str, list[float]]) -> dict[str, list[float]]:
        """Return axes with as many components as the model has. Raises Refused for axes out of a plane."""
        if self.dim == 3:
            return axes
        if "axis" in axes:
            if any(axes["axis"][:2]):
                raise Refused("the axis of a *TRANSFORM in a plane should be along z")
            return {"origin": axes["origin"][:2], "axis": axes["axis"]}
        if axes["x"][2] or axes["xy"][2]:
            raise Refused("the points of a *TRANSFORM in a plane should have z = 0")
        return {name: values[:2] for name, values in axes.items()}

    # ---- findings

    def tell(self, level: str, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Add a finding about a card, or about one of its lines; for `level` see Finding."""
        place = row or card.of
        self.findings.append(Finding(place.file, place.line, card.of.name, message, level))

    def note(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Add what does not change the answer."""
        self.tell("note", card, message, row)

    def warn(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Add what may change the answer."""
        self.tell("warning", card, message, row)

    def error(self, card: Card, message: str, row: DeckLine | None = None) -> None:
        """Add what would change the answer, and is not supported."""
        self.tell("error", card, message, row)


def _last(known: Mapping[str, _Begun], what: str) -> _Begun:
    """Return what was begun last. Raises Refused before the first."""
    if not known:
        raise Refused(f"it belongs after *{what}, NAME=name; move it there")
    return list(known.values())[-1]
