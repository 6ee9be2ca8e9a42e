"""A case as a deck of CalculiX: mesh, sections, contact, supports, loads and steps; what CalculiX has not is named.

`HANDLERS[section](export, record)` adds the cards of a record, the other way than an import. Each step of the case is a
*STEP of the deck. Values over time are amplitudes over the total time, so that they are the same at each step's end.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import lacmesh
from lacmesh.errors import LacmeshWarning
from lacmesh.formats.output import replacing
from lacmesh.mesh import Ints, Mesh
from lacmesh.surface import Surface
from lacmesh.surface.points import face_measure
from lacsolver.case import (
    Case,
    CaseError,
    Contact,
    Displacement,
    Force,
    Issue,
    Material,
    Pressure,
    Rigid,
    Spring,
    Tie,
    Value,
    check_groups,
)  # fmt: skip
from lacsolver.case.value_kinds import FREE
from lacsolver.decks.contact import even_gap
from lacsolver.problem.skin import mesh_of
from lacsolver.validation import validate

AXES = "xyz"
#: plane elements of CalculiX for each model
_PLANES = {"plane_stress": "CPS", "plane_strain": "CPE", "axisymmetric": "CAX"}
#: pressure per overlap of rigid contact, times the size of a slave face, relative to the largest Young's modulus
PENALTY = 100.0
#: stick slope of friction, relative to the pressure per overlap
_STICK = 0.1
#: keys that say how lacsolver searches, cuts or writes, which CalculiX does in its own way
_OWN = {
    "name", "why", "hexa", "macro", "search_distance", "coverage_threshold", "surface", "crease_angle", "normals",
    "geometry", "measure", "initial", "max_penetration", "kind",
}  # fmt: skip


@dataclass
class Export:
    """The deck so far: cards of the model, cards of the first step, and what CalculiX has not.

    `nodes`: sets of nodes by name, `extra`: lines of nodes beside those of the mesh.
    """

    case: Case
    mesh: Mesh
    model: list[str] = field(default_factory=list)
    loads: list[str] = field(default_factory=list)
    lacks: list[Issue] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    nodes: dict[str, Ints] = field(default_factory=dict)
    amplitudes: dict[tuple[tuple[float, float], ...], str] = field(default_factory=dict)
    extra: int = 0

    @property
    def end(self) -> float:
        """Time at which the last step ends."""
        return self.case.steps.last

    def lack(self, record: Any, message: str, key: str | None = None) -> None:
        """Add what CalculiX has not."""
        self.lacks.append(record.wrong(f"cannot be written for CalculiX: {message}", key))

    def node_set(self, record: Any) -> str:
        """Return the name of the set of nodes of a record: of its group, or the node at its place."""
        if record.group is None:
            at = np.zeros(3)
            at[: len(record.at)] = record.at
            nodes = np.array([np.linalg.norm(self.mesh.points - at, axis=1).argmin()])
            return self.set_of(f"node_{self.mesh.node_number[nodes[0]]}", nodes)
        cells = self.mesh.cell_groups.get(record.group)
        if cells is None or record.kind == "node":
            return self.set_of(record.group, self.mesh.node_groups[record.group])
        return self.set_of(record.group, self.mesh.nodes_on(cells))

    def set_of(self, name: str, nodes: Ints) -> str:
        """Return the name of a set of nodes, `N_` and its name or number."""
        chosen, k = f"N_{label(name)}", 1
        while chosen in self.nodes and not np.array_equal(self.nodes[chosen], nodes):
            k += 1
            chosen = f"N_{label(name)}_{k}"
        self.nodes[chosen] = nodes
        return chosen

    def amplitude(self, value: Value) -> str:
        """Return the option of a card by which 1.0 on it is a value over time; "" of a value that is always 0."""
        inside = {t for t, _ in value.source if t < self.end} if isinstance(value.source, tuple) else set()
        ramp = {value.ramp_start} | ({value.ramp_end} if value.ramp_end is not None else set())
        times = sorted({0.0, *inside, *ramp, *self.case.steps.planned})
        rows = tuple((t, value.at(t)) for t in times)
        if not any(v for _, v in rows):
            return ""
        return f", AMPLITUDE={self.amplitudes.setdefault(rows, f'A{len(self.amplitudes) + 1}')}"

    def given(self, record: Any, *keys: str) -> Iterator[tuple[int, Value]]:
        """Yield the direction, 1 to 3, and the value of each key of a record that is given."""
        for direction, key in enumerate(keys, 1):
            value = getattr(record, key)
            if value is not None and value.depends_on_place:
                self.lack(record, "the value depends on the place", key)
            elif value is not None:
                yield direction, value

    def load(self, card: str, value: Value, *fields: Any, after: Iterable[float] = ()) -> None:
        """Add a load to the first step, unless it is always 0; its size stands between `fields` and those `after`."""
        if option := self.amplitude(value):
            self.loads.append(_card(f"{card}{option}", (*fields, 1.0, *after)))

    def support(self, nodes: Any, direction: int, value: Value | None) -> None:
        """Fix a direction of nodes in the model, or prescribe its displacement from the first step on."""
        if value is not None and self.amplitude(value):
            self.load("BOUNDARY", value, nodes, direction, direction)
        else:
            self.model.append(_card("BOUNDARY", (nodes, direction, direction)))


def export_deck(case: Case, path: str | Path, *, mesh: Mesh | None = None, partial: bool = False) -> list[str]:
    """Write a case as a deck of CalculiX, and return sentences on what it computes in another way.

    `mesh`: in place of the case's. `partial`: what CalculiX has not is left out, and such a sentence. Raises CaseError
    with all that it has not, WriteError.
    """
    export = Export(case, mesh_of(case, mesh))
    check_groups(case, export.mesh)
    for (section, *_), record in case.records():
        handler, keys = HANDLERS.get(str(section), (None, ""))
        if handler is None:
            export.lack(record, "the export has no cards for this section")
            continue
        for key in set(record.told()) - {*keys.split(), *_OWN}:
            export.lack(record, "the export has no card for this key", key)
        handler(export, record)
    if export.lacks and not partial:
        raise CaseError(export.lacks, case.path)
    write(export, Path(path))
    return [*(f"left out: {one.message}" for one in export.lacks), *export.notes]


def label(name: str) -> str:
    """Return a name as CalculiX takes it.

    >>> label("Top face é")
    'Top_face__'
    """
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)


def _card(head: str, *rows: Iterable[Any]) -> str:
    """Return the text of a card with its data lines.

    >>> _card("ELASTIC", (1000.0, 0.3))
    '*ELASTIC\\n1000.0, 0.3\\n'
    """
    return "".join([f"*{head}\n", *(f"{', '.join(map(str, row))}\n" for row in rows)])


# ---- the handlers


def _material(export: Export, record: Material) -> None:
    """Add a material and its section, with the axes of an orthotropic one."""
    number = sum(card.startswith("*MATERIAL") for card in export.model) + 1
    name, option = f"M{number}", ""
    cards = [_card(f"MATERIAL, NAME={name}")]
    if record.law == "orthotropic":
        values = [*_three(record.young), *_three(record.poisson), *(record.shear or ())]
        cards.append(_card("ELASTIC, TYPE=ENGINEERING CONSTANTS", values[:8], values[8:]))
        axes = [(*axis, 0.0)[:3] for axis in record.axes]
        cards.insert(0, _card(f"ORIENTATION, NAME=O{number}", [*axes[0], *axes[1]]))
        option = f", ORIENTATION=O{number}"
    elif record.law in ("elastic", "saint_venant_kirchhoff", "plastic"):
        cards.append(_card("ELASTIC", (record.young, record.poisson)))
    elif record.law == "neo_hookean" and isinstance(record.young, float) and isinstance(record.poisson, float):
        shear, bulk = record.young / (2 + 2 * record.poisson), record.young / (3 - 6 * record.poisson)
        cards.append(_card("HYPERELASTIC, NEO HOOKE", (shear / 2, 2 / bulk)))
        export.notes.append("[[material]]: NEO HOOKE has another volumetric energy than neo_hookean")
    else:
        export.lack(record, f"CalculiX has no law with the energy of {record.law}", "law")
    if record.hardening:
        rows: Any = record.hardening
        if record.kinematic:
            rows = [(rows[0][0], 0.0), (rows[0][0] + record.kinematic, 1.0)]
        cards.append(_card("PLASTIC, HARDENING=KINEMATIC" if record.kinematic else "PLASTIC", *rows))
        if record.kinematic and len(record.hardening) > 1:
            export.lack(record, "the export has no combined isotropic and kinematic hardening", "kinematic")
    if record.density:
        cards.append(_card("DENSITY", (record.density,)))
    if record.expansion:
        kind = ", TYPE=ORTHO" if isinstance(record.expansion, tuple) else ""
        cards.append(_card(f"EXPANSION{kind}", _three(record.expansion) if kind else (record.expansion,)))
    thickness = export.case.thickness if export.case.model.startswith("plane") else None
    if isinstance(thickness, dict):
        export.lack(record, "a section of CalculiX has one thickness: give each thickness its own material")
    thick = [] if export.mesh.dim == 3 else [(thickness if isinstance(thickness, float) else 1.0,)]
    for group in record.groups or ("",):
        own = label(group) if group else "E_ALL"
        cards.append(_card(f"SOLID SECTION, ELSET={own}, MATERIAL={name}{option}", *thick))
    export.model += cards


def _three(value: Any) -> tuple[float, ...]:
    return tuple(value) if isinstance(value, tuple) else (value,) * 3


def _skins(export: Export, record: Contact | Tie) -> tuple[str, str]:
    """Return the names of slave and master in the deck."""
    slave, master = record.surfaces or (record.slave, record.master)
    return label(slave), label(master)


def _check_cells(export: Export, record: Contact | Tie) -> None:
    """Raise CaseError for a surface without cells behind it, which would be elements of the deck."""
    for name in record.surfaces or (record.slave, record.master):
        if np.isnan(Surface.of(export.mesh, export.mesh.cell_groups[name]).depth).any():
            message = f"{name!r} has faces without a cell behind them, on which CalculiX has no contact"
            raise CaseError([record.wrong(f"{message}; give them cells")], export.case.path)


def _contact(export: Export, record: Contact) -> None:
    """Add a surface interaction and a contact pair; rigid contact has a penalty."""
    slave, master = _skins(export, record)
    _check_cells(export, record)
    number = sum(card.startswith("*SURFACE INTERACTION") for card in export.model) + 1
    faces = Surface.of(export.mesh, export.mesh.cell_groups[(record.surfaces or (record.slave,))[0]])
    size = float(np.mean(face_measure(faces) ** (1 / faces.dim)))
    young = max((float(np.max(one.young)) for one in export.case.material if one.young is not None), default=1.0)
    stiffness = PENALTY * young / size
    if record.type != "unilateral":
        export.lack(record, "all contact of CalculiX can open", "type")
    if record.stiffness is not None:
        stiffness = _constant(export, record, "stiffness")
    elif record.law == "linear":
        message = f"contact {record.name} is rigid in lacsolver; in the deck it has the penalty {stiffness:.3g}"
        export.notes.append(f"{message}, a pressure per overlap")
    rows: list[tuple[float, ...]] = list(record.pressures or ())
    if record.law == "exponential":
        export.lack(record, "CalculiX has another exponential law", "law")
    kind = "TABULAR" if rows else "LINEAR"
    cards = [
        _card(f"SURFACE INTERACTION, NAME=I{number}"),
        _card(f"SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE={kind}", *(rows or [(stiffness,)])),
    ]
    if friction := _constant(export, record, "friction"):
        if friction == float("inf"):
            export.lack(record, "the export has no contact without slip", "friction")
        cards.append(_card("FRICTION", (friction, _STICK * stiffness)))
    adjust = "" if record.adjust is None else f", ADJUST={record.adjust!r}"
    head = f"CONTACT PAIR, INTERACTION=I{number}, TYPE=SURFACE TO SURFACE{adjust}"
    export.model += [*cards, _card(head, (slave, master))]
    if _constant(export, record, "clearance"):
        _clearance(export, record, slave, master)


def _clearance(export: Export, record: Contact, slave: str, master: str) -> None:
    """Add the gap of a contact with its clearance, which replaces that of the mesh: it should be even."""
    zones = {zone.name: zone.gap for zone in validate(export.case, export.mesh).zones}
    least, largest = zones.get(record.name, (np.nan, np.nan))
    gap = even_gap((least, largest), export.mesh)
    if gap is None:
        varies = "is unknown" if np.isnan(least) else f"varies from {least:.6g} to {largest:.6g}"
        reason = f"in CalculiX a clearance replaces the gap of the mesh, and this gap, with the clearance, {varies}"
        export.lack(record, reason, "clearance")
    else:
        export.model.append(_card(f"CLEARANCE, MASTER={master}, SLAVE={slave}, VALUE={gap!r}"))


def _constant(export: Export, record: Contact, key: str) -> float:
    """Return a value of a contact, the first one, which it should be at all places and times."""
    value = getattr(record, key)
    if value.depends_on_place or value.depends_on_time:
        export.lack(record, "the value varies, and CalculiX takes a constant", key)
        return 0.0
    return value.at(0.0)


def _tie(export: Export, record: Tie) -> None:
    """Add a tie."""
    _check_cells(export, record)
    distance = "" if record.search_distance is None else f", POSITION TOLERANCE={record.search_distance!r}"
    number = sum(card.startswith("*TIE") for card in export.model) + 1
    export.model.append(_card(f"TIE, NAME=T{number}{distance}", _skins(export, record)))


def _displacement(export: Export, record: Displacement) -> None:
    """Add a support, in the model if it is 0, else in the first step."""
    name = export.node_set(record)
    for direction, value in export.given(record, "ux", "uy", "uz"):
        export.support(name, direction, value)


def _force(export: Export, record: Force) -> None:
    """Add a force on each node."""
    if record.total:
        return
    name = export.node_set(record)
    for direction, value in export.given(record, "fx", "fy", "fz"):
        export.load("CLOAD", value, name, direction)


def _pressure(export: Export, record: Pressure) -> None:
    """Add a pressure on a surface; with NLGEOM it follows its faces."""
    if export.case.kinematics == "finite" and not record.follower:
        export.lack(record, "with NLGEOM a pressure follows its faces: set follower = true")
    for _, value in export.given(record, "value"):
        export.load("DSLOAD", value, label(record.group), "P")


def _gravity(export: Export, record: Any) -> None:
    """Add the weight of all elements along each axis."""
    for direction, value in export.given(record, "gx", "gy", "gz"):
        export.load("DLOAD", value, "E_ALL", "GRAV", after=np.eye(3)[direction - 1].tolist())


def _rigid(export: Export, record: Rigid) -> None:
    """Add a rigid body, with nodes for its place and its rotation. A body of a plane model turns about z."""
    if export.case.model == "axisymmetric":
        export.lack(record, "the export has no axisymmetric rigid bodies")
        return
    name, dim = export.node_set(record), export.mesh.dim
    nodes = export.nodes[name]
    centre = np.zeros(3)
    centre[:dim] = record.centre if record.centre is not None else export.mesh.points[nodes].mean(axis=0)[:dim]
    first = int(export.mesh.node_number.max()) + 1 + export.extra
    export.extra += 2
    export.model += [
        _card("NODE", *((first + k, *centre.tolist()) for k in range(2))),
        _card(f"RIGID BODY, NSET={name}, REF NODE={first}, ROT NODE={first + 1}"),
    ]
    directions = range(1, dim + 1)
    about = directions if dim == 3 else (3,)
    none = (None,) * len(about)
    of_place = [
        (first, k, getattr(record, f"u{a}"), getattr(record, f"f{a}")) for k, a in zip(directions, AXES, strict=False)
    ]
    turned = zip(about, record.rotation or none, record.moment or none, strict=True)
    for node, direction, moved, pushed in (*of_place, *((first + 1, *one) for one in turned)):
        if moved not in (None, FREE) or (moved is None and pushed is None):
            export.support(node, direction, moved)
        elif pushed is not None:
            export.load("CLOAD", pushed, node, direction)


def _spring(export: Export, record: Spring) -> None:
    """Add springs from nodes to the ground."""
    if record.to is not None or export.case.model == "axisymmetric":
        export.lack(record, "the export has springs from nodes to the ground only, and none in axisymmetry")
        return
    nodes = export.mesh.node_number[export.nodes[export.node_set(record)]].tolist()
    for key in ("kx", "ky", "kz"):
        if (stiffness := getattr(record, key)) is None:
            continue
        first = int(export.mesh.cell_number.max()) + 1 + export.extra
        export.extra += len(nodes)
        name = f"SPRINGS{first}"
        elements = [(first + k, node) for k, node in enumerate(nodes)]
        export.model += [
            _card(f"ELEMENT, TYPE=SPRING1, ELSET={name}", *elements),
            _card(f"SPRING, ELSET={name}", (AXES.index(key[1]) + 1,), (stiffness,)),
        ]


def _nothing(export: Export, record: Any) -> None:
    """Add nothing: [steps] are written as a whole, and the rest is of lacsolver alone."""
    del export, record


#: section -> its handler, and the keys that it writes
HANDLERS: dict[str, tuple[Callable[[Export, Any], None] | None, str]] = {
    "material": (_material, "groups law young poisson shear axes hardening kinematic density expansion"),
    "contact": (_contact, "type slave master surfaces stiffness law pressures clearance friction adjust"),
    "tie": (_tie, "slave master surfaces"),
    "displacement": (_displacement, "group at ux uy uz"),
    "pressure": (_pressure, "group value follower"),
    "force": (_force, "group at fx fy fz"),
    "gravity": (_gravity, "gx gy gz"),
    "rigid": (_rigid, "group centre ux uy uz rotation fx fy fz moment"),
    "spring": (_spring, "group at to kx ky kz"),
    "probe": (_nothing, "group at"),
    "steps": (_nothing, "end count times growth max_halvings"),
    "solver": (_nothing, "engine backend threads tolerance max_iterations tangent"),
    "output": (_nothing, "format every units times"),
}


# ---- the file


def write(export: Export, path: Path) -> None:
    """Write the mesh, then the cards of the model and of the steps; a file that is there stays until all are written.

    Raises WriteError.
    """
    mesh = export.mesh
    solid = np.flatnonzero(mesh.cell_dim == mesh.dim)
    groups = {label(name): cells for name, cells in mesh.cell_groups.items()} | {"E_ALL": solid}
    mesh = replace(mesh, deck=None, cell_groups=groups, node_groups=export.nodes)
    amplitudes = [
        _card(f"AMPLITUDE, NAME={name}, TIME=TOTAL TIME", *([t, v] for t, v in rows))
        for rows, name in export.amplitudes.items()
    ]
    option, before = ", NLGEOM" if export.case.kinematics == "finite" else "", 0.0
    steps = []
    for k, time in enumerate(export.case.steps.planned):
        period = time - before
        steps += [_card(f"STEP, INC=1000{option}"), _card("STATIC", (period, period)), *(export.loads if not k else ())]
        steps += [_card("NODE FILE", ("U", "RF")), _card("EL FILE", ("S",)), *_contact_file(export), "*END STEP\n"]
        before = time
    with replacing(path) as (beside,):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LacmeshWarning)
            lacmesh.write(beside, mesh, force=True, target="calculix", plane=_PLANES.get(export.case.model))
        with beside.open("a", encoding="utf-8") as file:
            file.writelines([*export.model, *amplitudes, *steps])


def _contact_file(export: Export) -> list[str]:
    """Return the card that writes the fields of contact, if there is any."""
    return [_card("CONTACT FILE", ("CDIS", "CSTR"))] if export.case.contact else []
