# ruff: noqa: RUF009 (key and section make fields)
"""The table of keys: the records of a case. Every key is a field, with its type, unit, default and meaning.

The rest of the table, for the case as a whole, is in `case.py`. The records are frozen. They are filled from a TOML
file (`read_case`) or from Python, and both are checked alike. From Python a value may also be a function
f(x (n, dim), t) -> (n,), for a traction f(x, n (n, dim), t). Lengths, forces and times are in consistent units of the
user's choice; `unit` gives the dimension.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, Self

from lacmesh.facts import Described
from lacsolver.case.added import CONTACT_LAWS, MATERIAL_LAWS
from lacsolver.case.draft import draft, same
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.formula import Formula
from lacsolver.case.keys import MODELS, As, Needs, Section, defaults_of, key
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
    TwoGroups,
    Varying,
)
from lacsolver.case.value import Value, ValueLike

SPACE = ("3d",)
PLANAR = ("3d", "plane_strain", "plane_stress")  # where x is a direction and not a radius
WHERE = (("group", "at"),)
NOT_KIND_OF_AT = (("kind", "at"),)
ROLES = (("slave", "surfaces"), ("master", "surfaces"))
_KIND = Choice((Option("cell", "a group of cells"), Option("node", "a group of nodes")))
_EITHER = "the kind that has this name; cell if both have it"
_THREE = ("fx", "fy", "fz")


@dataclass(frozen=True, kw_only=True, repr=False)
class Entry(Described):
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
        self._complete(made.values)

    def __repr__(self) -> str:
        defaults = defaults_of(type(self))
        given = {name: getattr(self, name) for name in defaults}
        words = (f"{k}={_plainly(value)}" for k, value in given.items() if not same(value, defaults[k]))
        return f"{type(self).__name__}({', '.join(words)})"

    def _facts(self) -> dict[str, str]:
        defaults = defaults_of(type(self))
        given = {name: getattr(self, name) for name in defaults}
        return {name: _plainly(value) for name, value in given.items() if not same(value, defaults[name])}

    def _complete(self, values: Mapping[str, Any]) -> None:
        """Take the values that were read, and set those that depend on others."""
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @classmethod
    def of_read(cls, values: Mapping[str, Any]) -> Self:
        """Return the record of values that were read and checked already, such as those of a file."""
        made = object.__new__(cls)
        for one in fields(cls):
            default = one.default_factory() if one.default_factory is not MISSING else one.default
            object.__setattr__(made, one.name, default)
        made._complete(values)
        return made


def _plainly(value: Any) -> str:
    """Return a value of a record as it could be given."""
    source = value.source if isinstance(value, Value) else value
    return repr(source.text) if isinstance(source, Formula) else repr(source)


@dataclass(frozen=True, kw_only=True, repr=False)
class Material(Entry):
    """[[material]]: the law of some cells.

    >>> Material(young=210e3, poisson=0.3).law
    'elastic'
    """

    SECTION: ClassVar = Section("material", True, "the law of the cells of some groups, or of the whole mesh")
    groups: As[tuple[str, ...] | None, Sequence[str] | None] = key(
        Groups(), "", "groups of cells made of it", default=None, default_words="the whole mesh"
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
        "constitutive law",
        default="elastic",
        default_words='"elastic"; needed if finite',
    )
    young: As[float | tuple[float, float, float] | None, float | Sequence[float] | None] = key(
        ThreeNumbers(POSITIVE), "stress", "Young's modulus; orthotropic: [E1, E2, E3]", default=None,
        default_words="required", unless="constants",
    )  # fmt: skip
    poisson: As[float | tuple[float, float, float] | None, float | Sequence[float] | None] = key(
        ThreeNumbers(), "",
        "Poisson's ratio, between -1 and 0.5; orthotropic: [nu12, nu13, nu23], with nu_ij / E_i = nu_ji / E_j",
        default=None, default_words="required", unless="constants",
    )  # fmt: skip
    shear: As[tuple[float, float, float] | None, Sequence[float] | None] = key(
        ThreeNumbers(POSITIVE, alone=False), "stress", "shear moduli [G12, G13, G23]", default=None,
        needs=Needs("law", ("orthotropic",)), default_words="required if orthotropic",
    )  # fmt: skip
    axes: As[tuple[tuple[float, ...], tuple[float, ...]], Sequence[Sequence[float]]] = key(
        Axes(), "", "axis 1, and a second vector in the plane of axes 1 and 2",
        default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), default_words="[[1, 0, 0], [0, 1, 0]]",
        needs=Needs("law", ("orthotropic",)),
    )  # fmt: skip
    density: float = key(
        Number(NOT_NEGATIVE),
        "mass / length³",
        "mass per volume, for weight, motion and natural modes",
        default=0.0,
    )
    expansion: As[float | tuple[float, float, float], float | Sequence[float]] = key(
        ThreeNumbers(),
        "1 / temperature",
        "thermal expansion, for [[temperature]]; orthotropic: one, or one for each axis",
        default=0.0,
    )
    reference_temperature: float = key(Number(), "temperature", "temperature without thermal strain", default=0.0)
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
        Option("auto", "the variant with the higher minimum Jacobian"),
    )
)
_NORMALS = Choice(
    (Option("facet", "normals of the faces"), Option("smoothed", "averaged at the nodes and interpolated"))
)
_SURFACE = Choice(
    (Option("smooth", "the curved surfaces on which the nodes lie"), Option("faces", "the faces of the cells"))
)


@dataclass(frozen=True, kw_only=True, repr=False)
class PairEntry(Entry):
    """Base class of contacts and ties. With `surfaces`, slave, master and the default of the name are None.

    A problem has a case in which they are chosen; `why` says why the slave is, and is empty for roles that were given.
    """

    why: str = field(default="", repr=False, compare=False)
    name: str = key(Text("a name"), "", "name in the results", default=None, default_words="the slave's name")
    slave: str = key(
        Group(), "", "the surface that is cut and carries the pressures", default=None, default_words="one of surfaces"
    )
    master: str = key(Group(), "", "the surface opposite", default=None, default_words="the other one of surfaces")
    surfaces: As[tuple[str, str] | None, Sequence[str] | None] = key(
        TwoGroups(), "", "instead of slave and master: two surfaces, of which a rule chooses the slave", default=None
    )
    hexa: str = key(_HEXA, "", "variant of the cut of HEXA8 and HEXA20, if the mesh is not cut yet", default="pyramid")
    search_distance: float | None = key(
        Number(POSITIVE), "length", "search distance from the slave to the master", default=None,
        default_words="a quarter of the smaller skin's diagonal, or twice a macro-element's if more",
    )  # fmt: skip
    coverage_threshold: float = key(
        Number(Bounds(0, 1, open=False)), "", "macro-elements with less coverage are unpaired", default=1e-6
    )
    surface: str = key(_SURFACE, "", "surfaces between which the gap of linear cells is measured", default="smooth")
    crease_angle: float | None = key(
        Number(Bounds(0, 180, open=False)), "degree", "edges at which the normal turns by more are sharp", default=None,
        default_words="40.0, but five to eight faces whose nodes lie on one circle, cylinder, sphere or cone are that",
    )  # fmt: skip

    def _complete(self, values: Mapping[str, Any]) -> None:
        """Take the values that were read, and name the record after its slave if it has no name."""
        super()._complete(values)
        if self.name is None and self.surfaces is None:
            object.__setattr__(self, "name", self.slave)


@dataclass(frozen=True, kw_only=True, repr=False)
class Contact(PairEntry):
    """[[contact]]: two skins that may touch. A Case sets the default of `geometry` from its kinematics.

    >>> Contact(slave="pin", master="hole").name
    'pin'
    """

    SECTION: ClassVar = Section("contact", True, "two surfaces that may touch, without friction", one_of=ROLES)
    type: str = key(
        Choice(
            (
                Option("unilateral", "contact that can open"),
                Option("bilateral", "always closed, pressures of either sign"),
            ),
            CONTACT_LAWS,
        ),
        "", "contact condition", default="unilateral",
    )  # fmt: skip
    stiffness: float | None = key(
        Number(POSITIVE), "stress / length", "pressure per overlap, for soft contact", default=None,
        default_words="rigid: no overlap", needs=Needs("type", ("unilateral", "bilateral")),
    )  # fmt: skip
    constants: dict[str, float] | None = key(
        NumberTable(), "", "constants of a contact law that a Python program has added", default=None
    )
    normals: str = key(_NORMALS, "", "normals of the slave", default="facet")
    geometry: str = key(
        Choice(
            (
                Option("reference", "undeformed configuration, paired once"),
                Option("current", "deformed configuration, updated during iterations"),
            )
        ),
        "", "configuration in which the surfaces are paired", default=None,
        default_words='"reference" if small, "current" if finite',
    )  # fmt: skip
    measure: str = key(
        Choice(
            (
                Option("reference", "the undeformed area: nominal pressure"),
                Option("current", "the deformed area: true pressure"),
            )
        ),
        "", "area to which pressures refer", default="reference",
    )  # fmt: skip
    initial: str = key(
        Choice((Option("gap", "closed where bodies overlap"), Option("all", "closed"), Option("none", "open"))),
        "", "contact status at the start", default="gap",
        needs=Needs("type", ("unilateral",), added=True),
    )  # fmt: skip
    max_penetration: float | None = key(
        Number(POSITIVE), "length", "largest initial penetration searched",
        default=None,
        default_words="half the local cell size; search_distance if geometry = current",
    )  # fmt: skip
    clearance: As[Value, ValueLike] = key(
        Varying(), "length", "added to the gap; negative: interference", default=Value(0.0), default_words="0.0"
    )
    friction: float = key(
        Reserved("friction is reserved: contact is without friction, so leave it out"),
        "",
        "not available yet; leave it out or give 0",
        default=0.0,
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Tie(PairEntry):
    """[[tie]]: two surfaces bonded together, in all components.

    >>> Tie(slave="liner", master="hole").name
    'liner'
    """

    SECTION: ClassVar = Section("tie", True, "two surfaces bonded together, in all components", one_of=ROLES)


@dataclass(frozen=True, kw_only=True, repr=False)
class AtNodes(Entry):
    """Base class of records that act on the nodes of a group, or on the node at a place."""

    group: str | None = key(Group(), "", "the nodes of this group, of cells or of nodes", default=None)
    at: As[tuple[float, ...] | None, Sequence[float] | None] = key(
        Point(), "length", "instead of a group: the node at this point", default=None
    )
    kind: str | None = key(
        _KIND,
        "",
        "kind of group, if a group of cells and one of nodes have this name",
        default=None,
        default_words=_EITHER,
    )


def _load(unit: str, meaning: str, models: tuple[str, ...] = MODELS, normals: bool = False) -> Any:
    return key(Varying(normals=normals), unit, meaning, load=True, models=models, default=None)


@dataclass(frozen=True, kw_only=True, repr=False)
class Displacement(AtNodes):
    """[[displacement]]: prescribed components of displacement.

    >>> Displacement(group="base", ux=0, uy=0)
    Displacement(group='base', ux=0.0, uy=0.0)
    """

    SECTION: ClassVar = Section(
        "displacement", True, "prescribed displacement; components that are not given are free", one_of=WHERE,
        some_of=(("ux", "uy", "uz", "un"),),
        not_both=(*NOT_KIND_OF_AT, ("un", "ux"), ("un", "uy"), ("un", "uz"), ("at", "un")),
    )  # fmt: skip
    ux: As[Value | None, ValueLike | None] = _load("length", "along x (the radius where axisymmetric)")
    uy: As[Value | None, ValueLike | None] = _load("length", "along y")
    uz: As[Value | None, ValueLike | None] = _load("length", "along z", SPACE)
    un: As[Value | None, ValueLike | None] = _load("length", "along the outward normal of the group's faces")


@dataclass(frozen=True, kw_only=True, repr=False)
class Pressure(Entry):
    """[[pressure]]: pressure on faces, along their inward normal.

    >>> Pressure(group="top", value="25 * t").value.at(0.5)
    12.5
    """

    SECTION: ClassVar = Section("pressure", True, "pressure on faces")
    group: str = key(Group(), "", "faces on which it acts")
    value: As[Value, ValueLike] = key(Varying(), "stress", "positive pressure pushes into the body", load=True)
    follower: bool = key(Flag(), "", "acts on the deformed face", default=False, kinematics="finite")


@dataclass(frozen=True, kw_only=True, repr=False)
class Traction(Entry):
    """[[traction]]: force per area on faces.

    >>> Traction(group="end", tx=3.0)
    Traction(group='end', tx=3.0)
    """

    SECTION: ClassVar = Section("traction", True, "force per undeformed area, on faces", some_of=(("tx", "ty", "tz"),))
    group: str = key(Group(), "", "faces on which it acts")
    tx: As[Value | None, ValueLike | None] = _load("stress", "along x", normals=True)
    ty: As[Value | None, ValueLike | None] = _load("stress", "along y", normals=True)
    tz: As[Value | None, ValueLike | None] = _load("stress", "along z", SPACE, normals=True)


@dataclass(frozen=True, kw_only=True, repr=False)
class Force(AtNodes):
    """[[force]]: force on each node.

    >>> Force(at=(0, 1), fy=-2.0)
    Force(at=(0.0, 1.0), fy=-2.0)
    """

    SECTION: ClassVar = Section(
        "force", True, "force on each node of a group, or in total, or on one node (axisymmetric: of the full circle)",
        one_of=WHERE, some_of=(_THREE,), not_both=NOT_KIND_OF_AT,
    )  # fmt: skip
    fx: As[Value | None, ValueLike | None] = _load("force", "along x")
    fy: As[Value | None, ValueLike | None] = _load("force", "along y")
    fz: As[Value | None, ValueLike | None] = _load("force", "along z", SPACE)
    total: bool = key(
        Flag(),
        "",
        "the force of the whole group, spread over its faces by area; not that of each node",
        default=False,
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class BodyForce(Entry):
    """[[body_force]]: force per volume.

    >>> BodyForce(fy=-1.0)
    BodyForce(fy=-1.0)
    """

    SECTION: ClassVar = Section("body_force", True, "force per undeformed volume", some_of=(_THREE,))
    groups: As[tuple[str, ...] | None, Sequence[str] | None] = key(
        Groups(), "", "groups of cells on which it acts", default=None, default_words="the whole mesh"
    )
    fx: As[Value | None, ValueLike | None] = _load("force / length³", "along x")
    fy: As[Value | None, ValueLike | None] = _load("force / length³", "along y")
    fz: As[Value | None, ValueLike | None] = _load("force / length³", "along z", SPACE)


@dataclass(frozen=True, kw_only=True, repr=False)
class Gravity(Entry):
    """[gravity]: acceleration of everything that has a density.

    >>> Gravity(gy=-9.81)
    Gravity(gy=-9.81)
    """

    SECTION: ClassVar = Section(
        "gravity", False, "acceleration of gravity; materials need a density", some_of=(("gx", "gy", "gz"),)
    )
    gx: As[Value | None, ValueLike | None] = _load("length / time²", "along x", PLANAR)
    gy: As[Value | None, ValueLike | None] = _load("length / time²", "along y")
    gz: As[Value | None, ValueLike | None] = _load("length / time²", "along z", SPACE)


@dataclass(frozen=True, kw_only=True, repr=False)
class Temperature(Entry):
    """[[temperature]]: temperature, which strains cells that have an expansion.

    >>> Temperature(groups=["pin"], value=80.0)
    Temperature(groups=('pin',), value=80.0)
    """

    SECTION: ClassVar = Section("temperature", True, "temperature; materials need an expansion")
    groups: As[tuple[str, ...] | None, Sequence[str] | None] = key(
        Groups(), "", "groups of cells that have it", default=None, default_words="the whole mesh"
    )
    value: As[Value, ValueLike] = key(
        Varying(), "temperature", "a number is ramped from the material's reference_temperature", load=True
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class Spring(AtNodes):
    """[[spring]]: springs between nodes and the ground.

    >>> Spring(group="top", ky=5.0)
    Spring(group='top', ky=5.0)
    """

    SECTION: ClassVar = Section(
        "spring", True, "springs from nodes of a group, or one node, to the ground (axisymmetric: of the full circle)",
        one_of=WHERE, some_of=(("kx", "ky", "kz"),), not_both=NOT_KIND_OF_AT,
    )  # fmt: skip
    kx: float | None = key(Number(POSITIVE), "force / length", "stiffness along x", default=None)
    ky: float | None = key(Number(POSITIVE), "force / length", "stiffness along y", default=None)
    kz: float | None = key(Number(POSITIVE), "force / length", "stiffness along z", default=None, models=SPACE)


def _of_body(kind: Varying | Turning, unit: str, meaning: str, models: tuple[str, ...], default_words: str = "") -> Any:
    return key(kind, unit, meaning, load=True, models=models, default=None, default_words=default_words)


@dataclass(frozen=True, kw_only=True, repr=False)
class Rigid(Entry):
    """[[rigid]]: a rigid body, or a rigid surface without parent cells.

    Components of its motion that are neither prescribed nor loaded are held at 0.

    >>> Rigid(group="punch", uy=-0.1)
    Rigid(group='punch', uy=-0.1)
    """

    SECTION: ClassVar = Section(
        "rigid", True, "rigid body; each component is fixed, prescribed, or free under a given force",
        not_both=(("ux", "fx"), ("uy", "fy"), ("uz", "fz"), ("rotation", "moment")),
    )  # fmt: skip
    group: str = key(Group(), "", "cells (a surface without parent cells is enough) or nodes that move rigidly")
    kind: str | None = key(
        _KIND,
        "",
        "kind of group, if a group of cells and one of nodes have this name",
        default=None,
        default_words=_EITHER,
    )
    centre: As[tuple[float, ...] | None, Sequence[float] | None] = key(
        Point(), "length", "centre of rotation, at which forces act", default=None,
        models=PLANAR, default_words="the mean of its nodes",
    )  # fmt: skip
    ux: As[Value | None, ValueLike | None] = _of_body(
        Varying(place=False), "length", "displacement of the centre along x", PLANAR, "0: fixed"
    )
    uy: As[Value | None, ValueLike | None] = _of_body(
        Varying(place=False), "length", "displacement of the centre along y", MODELS, "0: fixed"
    )
    uz: As[Value | None, ValueLike | None] = _of_body(
        Varying(place=False), "length", "displacement of the centre along z", SPACE, "0: fixed"
    )
    rotation: As[tuple[Value, ...] | None, ValueLike | Sequence[ValueLike] | None] = _of_body(
        Turning(), "radian", "rotation vector about the centre; one number in a plane", PLANAR, "0: fixed"
    )
    fx: As[Value | None, ValueLike | None] = _of_body(
        Varying(place=False), "force", "force along x; x is then free", PLANAR
    )
    fy: As[Value | None, ValueLike | None] = _of_body(
        Varying(place=False), "force", "force along y; y is then free", MODELS
    )
    fz: As[Value | None, ValueLike | None] = _of_body(
        Varying(place=False), "force", "force along z; z is then free", SPACE
    )
    moment: As[tuple[Value, ...] | None, ValueLike | Sequence[ValueLike] | None] = _of_body(
        Turning(), "force × length", "moment vector about the centre; the rotation is then free", PLANAR
    )
    mass: float | None = key(
        Number(POSITIVE), "mass", "mass of the body, at its centre, beside that of cells with a density", default=None,
        default_words="that of its cells",
    )  # fmt: skip
    inertia: As[float | tuple[float, float, float] | None, float | Sequence[float] | None] = key(
        ThreeNumbers(POSITIVE), "mass × length²",
        "moments of inertia of this mass about the axes x, y, z through the centre; one number in a plane",
        default=None, models=PLANAR, default_words="that of its cells",
    )  # fmt: skip
