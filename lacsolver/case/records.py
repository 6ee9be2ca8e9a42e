# ruff: noqa: RUF009 (key and section make fields)
"""The table of keys: the records of a case. Every key is a field, with its type, unit, default and meaning.

The rest of the table, for the case as a whole, is in `case.py`. The records are frozen. They are filled from a TOML
file (`read_case`) or from Python, and both are checked alike. From Python a value may also be a function
f(x (n, dim), t) -> (n,), for a traction f(x, n (n, dim), t). Lengths, forces and times are in consistent units of the
user's choice; `unit` gives the dimension.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from lacsolver.case.added import CONTACT_LAWS, MATERIAL_LAWS
from lacsolver.case.draft import draft, same
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.keys import MODELS, Needs, Section, defaults_of, key
from lacsolver.case.kinds import (
    NOT_NEGATIVE,
    POSITIVE,
    Axes,
    Bounds,
    Choice,
    Flag,
    Group,
    Groups,
    Number,
    NumberTable,
    Option,
    Point,
    Reserved,
    Text,
    ThreeNumbers,
    Turning,
    Varying,
)
from lacsolver.case.value import Value

SPACE = ("3d",)
PLANAR = ("3d", "plane_strain", "plane_stress")  # where x is a direction and not a radius
WHERE = (("group", "at"),)
NOT_KIND_OF_AT = (("kind", "at"),)
_KIND = Choice((Option("cell", "a group of cells"), Option("node", "a group of nodes")))
_EITHER = "the one that has the name; cell if both have"
_THREE = ("fx", "fy", "fz")


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Base class of the records. `place`: file and line of the record, for messages; empty for records from Python."""

    SECTION: ClassVar[Section]
    place: str = field(default="", repr=False, compare=False)

    def __post_init__(self) -> None:
        """Read and check the given values, as from a file. Raises CaseError."""
        defaults = defaults_of(type(self))
        given = {name: getattr(self, name) for name in defaults}
        given = {name: value for name, value in given.items() if not same(value, defaults[name])}
        path = (self.SECTION.name,) if self.SECTION.name else ()
        made, found = draft(type(self), path, given)
        if found:
            raise CaseError([Issue(f.message) for f in found], self.place or None)
        for name, value in made.values.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True, kw_only=True)
class Material(Entry):
    """[[material]]: the law of some cells."""

    SECTION: ClassVar = Section("material", True, "the law of the cells of some groups, or of the whole mesh")
    groups: tuple[str, ...] | None = key(
        Groups(), "", "groups of cells that it is for", default=None, default_words="the whole mesh"
    )
    law: str = key(
        Choice(
            (
                Option("elastic", "linear, isotropic", "small"),
                Option("orthotropic", "linear, three axes of symmetry", "small"),
                Option("saint_venant_kirchhoff", "linear in the Green-Lagrange strain", "finite"),
                Option("neo_hookean", "compressible rubber", "finite"),
            ),
            MATERIAL_LAWS,
        ),
        "",
        "how stress follows from strain",
        default="elastic",
        default_words='"elastic"; needed if finite',
    )
    young: float | tuple[float, float, float] | None = key(
        ThreeNumbers(POSITIVE), "stress", "Young's modulus; orthotropic: [E1, E2, E3]", default=None,
        default_words="required", unless="constants",
    )  # fmt: skip
    poisson: float | tuple[float, float, float] | None = key(
        ThreeNumbers(), "",
        "Poisson's ratio, between -1 and 0.5; orthotropic: [nu12, nu13, nu23], with nu_ij / E_i = nu_ji / E_j",
        default=None, default_words="required", unless="constants",
    )  # fmt: skip
    shear: tuple[float, float, float] | None = key(
        ThreeNumbers(POSITIVE, alone=False), "stress", "shear moduli [G12, G13, G23]", default=None,
        needs=Needs("law", ("orthotropic",)), default_words="required if orthotropic",
    )  # fmt: skip
    axes: tuple[tuple[float, ...], tuple[float, ...]] = key(
        Axes(), "", "axis 1, and a vector that with it spans the plane of axes 1 and 2",
        default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), default_words="[[1, 0, 0], [0, 1, 0]]",
        needs=Needs("law", ("orthotropic",)),
    )  # fmt: skip
    density: float = key(Number(NOT_NEGATIVE), "mass / length³", "mass per volume, for [gravity]", default=0.0)
    expansion: float | tuple[float, float, float] = key(
        ThreeNumbers(),
        "1 / temperature",
        "thermal expansion, for [[temperature]]; orthotropic: one, or one for each axis",
        default=0.0,
    )
    reference_temperature: float = key(Number(), "temperature", "where there is no thermal strain", default=0.0)
    constants: dict[str, float] | None = key(
        NumberTable(),
        "",
        "constants of a law that a Python program has added, in place of young and poisson",
        default=None,
    )


_HEXA = Choice(
    (
        Option("pyramid", "into pyramids"),
        Option("hexa", "into hexahedra"),
        Option("auto", "whichever has the better worst child"),
    )
)
_NORMALS = Choice((Option("facet", "of the faces"), Option("smoothed", "of the nodes, averaged")))
_SURFACE = Choice(
    (Option("smooth", "the curved skins that the nodes lie on"), Option("faces", "the faces of the cells, as they are"))
)


@dataclass(frozen=True, kw_only=True)
class PairEntry(Entry):
    """Base class of contacts and ties."""

    name: str = key(Text("a name"), "", "what results are called by", default=None, default_words="the slave's name")
    slave: str = key(Group(), "", "the skin that is cut and carries the pressures")
    master: str = key(Group(), "", "the skin that it meets")
    hexa: str = key(_HEXA, "", "how HEXA8 and HEXA20 are cut, unless the mesh carries a cut", default="pyramid")
    search_distance: float | None = key(
        Number(POSITIVE), "length", "how far from the slave a master is looked for", default=None,
        default_words="a quarter of the smaller skin's diagonal, or twice a macro-element's if more",
    )  # fmt: skip
    coverage_threshold: float = key(
        Number(Bounds(0, 1, open=False)), "", "a macro-element with less coverage is unpaired", default=1e-6
    )
    surface: str = key(_SURFACE, "", "what the gap is measured between, where cells are linear", default="smooth")
    crease_angle: float = key(
        Number(Bounds(0, 180, open=False)), "degree", "edges that turn by more stay sharp", default=40.0
    )

    def __post_init__(self) -> None:
        """Read the given values, and name the record after its slave if it has no name."""
        super().__post_init__()
        if self.name is None:
            object.__setattr__(self, "name", self.slave)


@dataclass(frozen=True, kw_only=True)
class Contact(PairEntry):
    """[[contact]]: two skins that may touch. A Case sets the default of `geometry` from its kinematics."""

    SECTION: ClassVar = Section("contact", True, "two skins that may touch, without friction")
    type: str = key(
        Choice(
            (Option("unilateral", "pressure or gap"), Option("bilateral", "no gap, pressure of either sign")),
            CONTACT_LAWS,
        ),
        "", "what the pressure may be", default="unilateral",
    )  # fmt: skip
    stiffness: float | None = key(
        Number(POSITIVE), "stress / length", "pressure per overlap, for soft contact", default=None,
        default_words="rigid: no overlap", needs=Needs("type", ("unilateral", "bilateral")),
    )  # fmt: skip
    constants: dict[str, float] | None = key(
        NumberTable(), "", "constants of a contact law that a Python program has added", default=None
    )
    normals: str = key(_NORMALS, "", "the normals of the slave", default="facet")
    geometry: str = key(
        Choice(
            (
                Option("reference", "pairs, normals, gap on the undeformed skins, once"),
                Option("current", "on the deformed skins, again and again"),
            )
        ),
        "", "where the contact is looked for", default=None, default_words='"reference" if small, "current" if finite',
    )  # fmt: skip
    measure: str = key(
        Choice((Option("reference", "the undeformed area: nominal pressure"), Option("current", "the deformed area"))),
        "", "the area that pressures refer to", default="reference",
    )  # fmt: skip
    initial: str = key(
        Choice((Option("gap", "by the sign of the gap"), Option("all", "in contact"), Option("none", "open"))),
        "", "the status at the start", default="gap", needs=Needs("type", ("unilateral",)),
    )  # fmt: skip
    max_penetration: float | None = key(
        Number(POSITIVE), "length", "how far behind the slave, where bodies overlap, a master is looked for",
        default=None,
        default_words="half the cells behind slave and master; as far as search_distance if geometry = current",
    )  # fmt: skip
    clearance: Value = key(
        Varying(), "length", "added to the gap; negative: interference", default=Value(0.0), default_words="0.0"
    )
    friction: float = key(
        Reserved("friction is reserved: contact is without friction, so leave it out"), "", "reserved: 0", default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class Tie(PairEntry):
    """[[tie]]: two skins that are glued together, all components."""

    SECTION: ClassVar = Section("tie", True, "two skins that are glued together, in all components")


@dataclass(frozen=True, kw_only=True)
class AtNodes(Entry):
    """Base class of records that act on the nodes of a group, or on the node at a place."""

    group: str | None = key(Group(), "", "the nodes of this group, of cells or of nodes", default=None)
    at: tuple[float, ...] | None = key(Point(), "length", "in place of a group: the node there", default=None)
    kind: str | None = key(_KIND, "", "which group, where both have the name", default=None, default_words=_EITHER)


def _load(unit: str, meaning: str, models: tuple[str, ...] = MODELS, normals: bool = False) -> Any:
    return key(Varying(normals=normals), unit, meaning, load=True, models=models, default=None)


@dataclass(frozen=True, kw_only=True)
class Displacement(AtNodes):
    """[[displacement]]: prescribed components of displacement."""

    SECTION: ClassVar = Section(
        "displacement", True, "prescribed displacement; what is not named is free", one_of=WHERE,
        some_of=(("ux", "uy", "uz", "un"),),
        not_both=(*NOT_KIND_OF_AT, ("un", "ux"), ("un", "uy"), ("un", "uz"), ("at", "un")),
    )  # fmt: skip
    ux: Value | None = _load("length", "along x (the radius where axisymmetric)")
    uy: Value | None = _load("length", "along y")
    uz: Value | None = _load("length", "along z", SPACE)
    un: Value | None = _load("length", "along the outward normal of the group's faces")


@dataclass(frozen=True, kw_only=True)
class Pressure(Entry):
    """[[pressure]]: pressure on faces, along their inward normal."""

    SECTION: ClassVar = Section("pressure", True, "pressure on faces")
    group: str = key(Group(), "", "faces that it acts on")
    value: Value = key(Varying(), "stress", "> 0 pushes into the body", load=True)
    follower: bool = key(Flag(), "", "turns and grows with the face", default=False, kinematics="finite")


@dataclass(frozen=True, kw_only=True)
class Traction(Entry):
    """[[traction]]: force per area on faces."""

    SECTION: ClassVar = Section("traction", True, "force per undeformed area, on faces", some_of=(("tx", "ty", "tz"),))
    group: str = key(Group(), "", "faces that it acts on")
    tx: Value | None = _load("stress", "along x", normals=True)
    ty: Value | None = _load("stress", "along y", normals=True)
    tz: Value | None = _load("stress", "along z", SPACE, normals=True)


@dataclass(frozen=True, kw_only=True)
class Force(AtNodes):
    """[[force]]: force on each node."""

    SECTION: ClassVar = Section(
        "force", True, "force on each node of a group, or on one node (axisymmetric: of the full circle)",
        one_of=WHERE, some_of=(_THREE,), not_both=NOT_KIND_OF_AT,
    )  # fmt: skip
    fx: Value | None = _load("force", "along x")
    fy: Value | None = _load("force", "along y")
    fz: Value | None = _load("force", "along z", SPACE)


@dataclass(frozen=True, kw_only=True)
class BodyForce(Entry):
    """[[body_force]]: force per volume."""

    SECTION: ClassVar = Section("body_force", True, "force per undeformed volume", some_of=(_THREE,))
    groups: tuple[str, ...] | None = key(
        Groups(), "", "groups of cells that it acts on", default=None, default_words="the whole mesh"
    )
    fx: Value | None = _load("force / length³", "along x")
    fy: Value | None = _load("force / length³", "along y")
    fz: Value | None = _load("force / length³", "along z", SPACE)


@dataclass(frozen=True, kw_only=True)
class Gravity(Entry):
    """[gravity]: acceleration of everything that has a density."""

    SECTION: ClassVar = Section("gravity", False, "acceleration; needs density", some_of=(("gx", "gy", "gz"),))
    gx: Value | None = _load("length / time²", "along x", PLANAR)
    gy: Value | None = _load("length / time²", "along y")
    gz: Value | None = _load("length / time²", "along z", SPACE)


@dataclass(frozen=True, kw_only=True)
class Temperature(Entry):
    """[[temperature]]: temperature, which strains cells that have an expansion."""

    SECTION: ClassVar = Section("temperature", True, "temperature; needs expansion")
    groups: tuple[str, ...] | None = key(
        Groups(), "", "groups of cells that have it", default=None, default_words="the whole mesh"
    )
    value: Value = key(
        Varying(), "temperature", "a number is ramped from the material's reference_temperature", load=True
    )


@dataclass(frozen=True, kw_only=True)
class Spring(AtNodes):
    """[[spring]]: springs between nodes and the ground."""

    SECTION: ClassVar = Section(
        "spring", True, "springs from nodes of a group, or one node, to the ground (axisymmetric: of the full circle)",
        one_of=WHERE, some_of=(("kx", "ky", "kz"),), not_both=NOT_KIND_OF_AT,
    )  # fmt: skip
    kx: float | None = key(Number(POSITIVE), "force / length", "stiffness along x", default=None)
    ky: float | None = key(Number(POSITIVE), "force / length", "stiffness along y", default=None)
    kz: float | None = key(Number(POSITIVE), "force / length", "stiffness along z", default=None, models=SPACE)


def _of_body(kind: Varying | Turning, unit: str, meaning: str, models: tuple[str, ...], default_words: str = "") -> Any:
    return key(kind, unit, meaning, load=True, models=models, default=None, default_words=default_words)


@dataclass(frozen=True, kw_only=True)
class Rigid(Entry):
    """[[rigid]]: a rigid body, or a rigid surface without parent cells.

    Components of its motion that are neither prescribed nor loaded are held at 0.
    """

    SECTION: ClassVar = Section(
        "rigid", True, "nodes that move as one; each component is held, prescribed, or loaded and then free",
        not_both=(("ux", "fx"), ("uy", "fy"), ("uz", "fz"), ("rotation", "moment")),
    )  # fmt: skip
    group: str = key(Group(), "", "cells (a bare skin is enough) or nodes that move as one")
    kind: str | None = key(_KIND, "", "which group, where both have the name", default=None, default_words=_EITHER)
    centre: tuple[float, ...] | None = key(
        Point(), "length", "what it turns about, and where forces act", default=None,
        models=PLANAR, default_words="the mean of its nodes",
    )  # fmt: skip
    ux: Value | None = _of_body(Varying(place=False), "length", "displacement of the centre along x", PLANAR, "0: held")
    uy: Value | None = _of_body(Varying(place=False), "length", "displacement of the centre along y", MODELS, "0: held")
    uz: Value | None = _of_body(Varying(place=False), "length", "displacement of the centre along z", SPACE, "0: held")
    rotation: tuple[Value, ...] | None = _of_body(
        Turning(), "radian", "vector of the rotation about the centre; a number in a plane", PLANAR, "0: held"
    )
    fx: Value | None = _of_body(Varying(place=False), "force", "force along x; x is then free", PLANAR)
    fy: Value | None = _of_body(Varying(place=False), "force", "force along y; y is then free", MODELS)
    fz: Value | None = _of_body(Varying(place=False), "force", "force along z; z is then free", SPACE)
    moment: tuple[Value, ...] | None = _of_body(
        Turning(), "force × length", "vector of the moment about the centre; the rotation is then free", PLANAR
    )
