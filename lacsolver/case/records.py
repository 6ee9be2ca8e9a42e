"""The table of keys: the records of a case. Every key is a field, with its type, unit, default and meaning.

The rest of the table, for the case as a whole, is in `case.py`. The records are frozen. They are filled from a TOML
file (`read_case`) or from Python, and both are checked alike. From Python a value may also be a function
f(x (n, dim), t) -> (n,), for a traction f(x, n (n, dim), t). Lengths, forces and times are in consistent units of the
user's choice; `unit` gives the dimension.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lacsolver.case.added import CONTACT_LAWS, MATERIAL_LAWS
from lacsolver.case.direction_kinds import AXES, GROUP_KIND, LOCAL_AXES
from lacsolver.case.entry import Entry
from lacsolver.case.keys import MODELS, As, Groups, Load, Needs, Numbers, Rotation, Values, hidden, key
from lacsolver.case.kinds import (
    FLAG,
    GROUP,
    GROUPS,
    NOT_NEGATIVE,
    NUMBER,
    NUMBER_TABLE,
    POINT,
    POSITIVE,
    TWO_GROUPS,
    Kind,
    choice,
    number,
    numbers,
    one_or_three,
    text,
)
from lacsolver.case.value import Value, ValueLike
from lacsolver.case.value_kinds import (
    HARDENING,
    PRESSURES,
    ROTATION,
    VALUE,
    VALUE_OF_TIME,
    VECTOR_OF_TIME,
    varying,
)

SPACE = ("3d",)
PLANAR = ("3d", "plane_strain", "plane_stress")  # where x is a direction and not a radius
WHERE = (("group", "at"),)
NOT_KIND_OF_AT = (("kind", "at"),)
ROLES = (("slave", "surfaces"), ("master", "surfaces"))
KIND_BY_DEFAULT = "the kind that has this name; cell if both have it"
_THREE = ("fx", "fy", "fz")
#: the kinematics that each law of a material is for
_KINEMATICS = {
    "elastic": "small",
    "orthotropic": "small",
    "saint_venant_kirchhoff": "finite",
    "neo_hookean": "finite",
}


class Material(Entry, header="[[material]]"):
    """[[material]]: the law of the cells of some groups, or of the whole mesh.

    >>> Material(young=210e3, poisson=0.3).law
    'elastic'
    """

    groups: Groups = key(GROUPS, "", "groups of cells that have this material", None, "the whole mesh")
    law: str = key(
        choice({
            "elastic": "linear, isotropic",
            "orthotropic": "linear, three axes of symmetry",
            "saint_venant_kirchhoff": "linear in the Green-Lagrange strain",
            "neo_hookean": "compressible rubber",
            "plastic": "a metal that yields, by von Mises; small or finite strains",
        }, _KINEMATICS, MATERIAL_LAWS),
        "", "constitutive law", "elastic", '"elastic"; needed if finite',
    )  # fmt: skip
    young: As[float | tuple[float, float, float] | None, float | Sequence[float] | None] = key(
        one_or_three(POSITIVE), "stress", "Young's modulus; orthotropic: [E1, E2, E3]", None, "required",
        unless="constants",
    )  # fmt: skip
    poisson: As[float | tuple[float, float, float] | None, float | Sequence[float] | None] = key(
        one_or_three(), "",
        "Poisson's ratio, between -1 and 0.5; orthotropic: [nu12, nu13, nu23], with nu_ij / E_i = nu_ji / E_j", None,
        "required", unless="constants",
    )  # fmt: skip
    shear: As[tuple[float, float, float] | None, Sequence[float] | None] = key(
        numbers(3, POSITIVE), "stress", "shear moduli [G12, G13, G23]", None, "required if orthotropic",
        needs=Needs("law", ("orthotropic",)),
    )  # fmt: skip
    axes: As[tuple[tuple[float, ...], tuple[float, ...]], Sequence[Sequence[float]]] = key(
        AXES, "", "axis 1, and a second vector in the plane of axes 1 and 2", ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        "[[1, 0, 0], [0, 1, 0]]", needs=Needs("law", ("orthotropic",)),
    )  # fmt: skip
    hardening: As[tuple[tuple[float, float], ...] | None, Sequence[Sequence[float]] | None] = key(
        HARDENING, "stress, 1",
        "yield stress at each plastic strain, the first at 0; linear between the rows, constant after the last", None,
        "required if plastic", needs=Needs("law", ("plastic",)),
    )  # fmt: skip
    kinematic: float = key(
        NOT_NEGATIVE, "stress", "modulus of linear kinematic hardening: stress per plastic strain in tension", 0.0,
        needs=Needs("law", ("plastic",)),
    )  # fmt: skip
    density: float = key(NOT_NEGATIVE, "mass / length³", "mass per volume, for weight, motion and natural modes", 0.0)
    expansion: As[float | tuple[float, float, float], float | Sequence[float]] = key(
        one_or_three(), "1 / temperature",
        "thermal expansion, for [[temperature]]; orthotropic: one, or one for each axis", 0.0,
    )  # fmt: skip
    reference_temperature: float = key(NUMBER, "temperature", "temperature without thermal strain", 0.0)
    constants: dict[str, float] | None = key(
        NUMBER_TABLE, "", "constants of a law that a Python program has added, in place of young and poisson", None
    )


_HEXA = choice(
    {"pyramid": "into pyramids", "hexa": "into hexahedra", "auto": "the variant with the higher minimum Jacobian"}
)
_MACRO = choice({"cut": "one of each face, which is cut", "stars": "one of the faces around a node, without a cut"})
_NORMALS = choice(
    {
        "facet": "of the slave's faces, or of its smooth surface, or of a plane master",
        "smoothed": "averaged at the nodes and interpolated",
        "master": "of the master, averaged at its nodes and interpolated",
        "slave": "as facet, over a plane master too",
    }
)
_SURFACE = choice({"smooth": "the curved surfaces on which the nodes lie", "faces": "the faces of the cells"})


class PairEntry(Entry):
    """Base class of contacts and ties. With `surfaces`, slave, master and the default of the name are None.

    A problem has a case in which they are chosen; `why` says why the slave is, and is empty for roles that were given.
    """

    why: str = hidden("")
    name: str = key(text("a name"), "", "name in the results", None, "the slave's name")
    slave: str = key(GROUP, "", "the surface that is cut and carries the pressures", None, "one of surfaces")
    master: str = key(GROUP, "", "the opposite surface", None, "the other one of surfaces")
    surfaces: As[tuple[str, str] | None, Sequence[str] | None] = key(
        TWO_GROUPS, "", "instead of slave and master: two surfaces; rules choose the slave", None
    )
    hexa: str = key(_HEXA, "", "variant of the cut of HEXA8 and HEXA20, if the mesh is not cut yet", "pyramid")
    macro: str = key(_MACRO, "", "macro-elements of the slave, if the mesh has none yet", "cut")
    search_distance: float | None = key(
        POSITIVE, "length", "search distance from the slave to the master", None,
        "a quarter of the smaller surface's diagonal, at least twice a macro-element's",
    )  # fmt: skip
    coverage_threshold: float = key(
        number(0, 1, open=False), "", "macro-elements with less coverage are unpaired", 1e-6
    )
    surface: str = key(_SURFACE, "", "surfaces between which the gap of linear cells is measured", "smooth")
    crease_angle: float | None = key(
        number(0, 180, open=False), "degree", "edges at which the normal turns by more are sharp", None,
        "40.0, but five to eight faces whose nodes lie on one circle, cylinder, sphere or cone are smooth",
    )  # fmt: skip


class Contact(PairEntry, header="[[contact]]", one_of=ROLES, named_after="slave"):
    """[[contact]]: two surfaces that may touch.

    A Case sets the default of `geometry` from its kinematics.

    >>> Contact(slave="pin", master="hole").name
    'pin'
    """

    type: str = key(
        choice({
            "unilateral": "contact that can open",
            "bilateral": "always closed, pressures of either sign",
        }, added=CONTACT_LAWS), "", "contact condition", "unilateral",
    )  # fmt: skip
    stiffness: As[Value | None, ValueLike | None] = key(
        varying(least="> 0", place=False), "stress / length",
        "pressure per overlap, for soft contact, not ramped", None, "rigid: no overlap",
        needs=Needs("type", ("unilateral", "bilateral")),
    )  # fmt: skip
    law: str = key(
        choice({
            "linear": "rigid, or with stiffness times the overlap",
            "exponential": "pressure that grows exponentially as surfaces come near",
            "table": "pressure against overlap, by a table",
        }), "", "pressure under overlap", "linear", needs=Needs("type", ("unilateral",)),
    )  # fmt: skip
    pressure_at_contact: float | None = key(
        POSITIVE, "stress", "pressure where the surfaces meet", None, "required if exponential",
        needs=Needs("law", ("exponential",)),
    )  # fmt: skip
    clearance_at_zero: float | None = key(
        POSITIVE, "length", "gap from which on there is no pressure", None, "required if exponential",
        needs=Needs("law", ("exponential",)),
    )  # fmt: skip
    pressures: As[tuple[tuple[float, float], ...] | None, Sequence[Sequence[float]] | None] = key(
        PRESSURES, "stress, length",
        "pressure at each overlap (negative: at a gap), from pressure 0 on; linear between the rows, and beyond them "
        "with the last slope",
        None, "required if table", needs=Needs("law", ("table",)),
    )  # fmt: skip
    damping: float = key(
        NOT_NEGATIVE, "stress × time / length",
        "pressure per approach velocity while surfaces overlap, added to that of soft contact; with [dynamics]", 0.0,
        needs=Needs("type", ("unilateral",)),
    )  # fmt: skip
    constants: dict[str, float] | None = key(
        NUMBER_TABLE, "", "constants of a contact law that a Python program has added", None
    )
    normals: str = key(_NORMALS, "", "direction of contact", "facet")
    geometry: str = key(
        choice({
            "reference": "undeformed configuration, paired once",
            "current": "deformed configuration, updated during iterations",
        }), "", "configuration in which the surfaces are paired", None, '"reference" if small, "current" if finite',
    )  # fmt: skip
    measure: str = key(
        choice({"reference": "the undeformed area: nominal pressure", "current": "the deformed area: true pressure"}),
        "", "area to which pressures refer", "reference",
    )  # fmt: skip
    initial: str = key(
        choice({"gap": "closed where bodies overlap", "all": "closed", "none": "open"}), "",
        "contact status at the start", "gap", needs=Needs("type", ("unilateral",), added=True),
    )  # fmt: skip
    max_penetration: float | None = key(
        POSITIVE, "length", "largest initial penetration searched", None,
        "half the local cell size; search_distance if geometry = current",
    )  # fmt: skip
    clearance: As[Value, ValueLike] = key(
        VALUE, "length", "added to the gap; negative: interference", Value(0.0), "0.0"
    )
    adjust: float | None = key(
        NOT_NEGATIVE, "length",
        "slave nodes within this distance of the master are moved onto it, without strain; 0: only nodes that overlap "
        "it", None, "no node is moved",
    )  # fmt: skip
    friction: As[Value, ValueLike] = key(
        varying(least=">= 0", infinite=True), "", "coefficient of friction, not ramped; inf: no slip while in contact",
        Value(0.0), "0.0",
    )  # fmt: skip
    cohesion: As[Value, ValueLike] = key(
        varying(least=">= 0"), "stress", "friction without pressure, while in contact; alone: Tresca's law",
        Value(0.0), "0.0",
    )  # fmt: skip
    shear_limit: As[Value | None, ValueLike | None] = key(
        varying(least="> 0"), "stress", "largest shear traction (Orowan's law)", None, "none"
    )

    @property
    def is_soft(self) -> bool:
        """True if surfaces overlap under pressure."""
        return self.stiffness is not None or self.law in ("exponential", "table")

    @property
    def has_friction(self) -> bool:
        """True if there is friction at any place or time."""
        return any(value is not None and value.source != 0 for value in (self.friction, self.cohesion))


class Tie(PairEntry, header="[[tie]]", one_of=ROLES, named_after="slave"):
    """[[tie]]: two surfaces bonded together, in all components.

    >>> Tie(slave="liner", master="hole").name
    'liner'
    """


class AtNodes(Entry):
    """Base class of records that act on the nodes of a group, or on the node at a place."""

    group: str | None = key(GROUP, "", "the nodes of this group, of cells or of nodes", None)
    at: Numbers = key(POINT, "length", "instead of a group: the node at this point", None)
    kind: str | None = key(
        GROUP_KIND, "", "kind of group, if a group of cells and one of nodes have this name", None, KIND_BY_DEFAULT
    )


#: a value that may be a function of normals
_TRACTION = varying(normals=True)


def _load(unit: str, meaning: str, models: tuple[str, ...] = MODELS, kind: Kind = VALUE) -> Any:
    return key(kind, unit, meaning, None, load=True, models=models)


#: type of a field for local axes
LocalAxes = As[Mapping[str, Any] | None, Mapping[str, Any] | None]


def in_axes(names: str) -> Any:
    """Return a key for local axes of components."""
    what = f"local axes of {names}: x, y, z, or where cylindrical r, theta, z, at each node's undeformed place"
    return key(LOCAL_AXES, "", what, None, "those of the mesh")


class Displacement(
    AtNodes, header="[[displacement]]", one_of=WHERE, some_of=(("ux", "uy", "uz", "un"),),
    not_both=(*NOT_KIND_OF_AT, ("un", "ux"), ("un", "uy"), ("un", "uz"), ("at", "un"), ("un", "axes"), ("un", "begin")),
):  # fmt: skip
    """[[displacement]]: prescribed displacement; components that are not given are free.

    >>> Displacement(group="base", ux=0, uy=0)
    Displacement(group='base', ux=0.0, uy=0.0)
    """

    ux: Load = _load("length", "along x (the radius where axisymmetric)")
    uy: Load = _load("length", "along y")
    uz: Load = _load("length", "along z", SPACE)
    axes: LocalAxes = in_axes("ux, uy, uz")
    un: Load = _load("length", "along the outward normal of the group's faces")
    begin: float | None = key(
        POSITIVE, "time", "time up to which the nodes are free; then they are constrained where they are, and move as "
        "the values change from there on", None, "constrained from the start",
    )  # fmt: skip
    reached: float | None = key(
        POSITIVE, "time", "with begin: time up to which the nodes go evenly to the values themselves, counted from the "
        "undeformed bodies", None, "never: values count from where the nodes are at begin",
    )  # fmt: skip


class Pressure(Entry, header="[[pressure]]"):
    """[[pressure]]: pressure on faces.

    >>> Pressure(group="top", value="25 * t").value.at(0.5)
    12.5
    """

    group: str = key(GROUP, "", "faces on which it acts")
    value: As[Value, ValueLike] = key(VALUE, "stress", "positive pressure pushes into the body", load=True)
    follower: bool = key(FLAG, "", "acts on the deformed face", False, kinematics="finite")


class Traction(Entry, header="[[traction]]", some_of=(("tx", "ty", "tz"),)):
    """[[traction]]: force per undeformed area, on faces.

    >>> Traction(group="end", tx=3.0)
    Traction(group='end', tx=3.0)
    """

    group: str = key(GROUP, "", "faces on which it acts")
    tx: Load = _load("stress", "along x", kind=_TRACTION)
    ty: Load = _load("stress", "along y", kind=_TRACTION)
    tz: Load = _load("stress", "along z", SPACE, kind=_TRACTION)


class Force(
    AtNodes, header="[[force]]", one_of=WHERE, some_of=((*_THREE, "moment"),),
    not_both=(*NOT_KIND_OF_AT, ("at", "moment")),
):  # fmt: skip
    """[[force]]: force on each node of a group, or in total, or on one node (axisymmetric: of the full circle).

    >>> Force(at=(0, 1), fy=-2.0)
    Force(at=(0.0, 1.0), fy=-2.0)
    """

    fx: Load = _load("force", "along x")
    fy: Load = _load("force", "along y")
    fz: Load = _load("force", "along z", SPACE)
    axes: LocalAxes = in_axes("fx, fy, fz")
    moment: Values = _load(
        "force × length", "moment of the whole group about its mean, spread by area; with total = true", PLANAR,
        VECTOR_OF_TIME,
    )  # fmt: skip
    total: bool = key(
        FLAG, "", "the force of the whole group, spread over its faces by area; not that of each node", False
    )


class BodyForce(Entry, header="[[body_force]]", some_of=(_THREE,)):
    """[[body_force]]: force per undeformed volume.

    >>> BodyForce(fy=-1.0)
    BodyForce(fy=-1.0)
    """

    groups: Groups = key(GROUPS, "", "groups of cells on which it acts", None, "the whole mesh")
    fx: Load = _load("force / length³", "along x")
    fy: Load = _load("force / length³", "along y")
    fz: Load = _load("force / length³", "along z", SPACE)


class Gravity(Entry, header="[gravity]", some_of=(("gx", "gy", "gz"),)):
    """[gravity]: acceleration of gravity; materials need a density.

    >>> Gravity(gy=-9.81)
    Gravity(gy=-9.81)
    """

    gx: Load = _load("length / time²", "along x", PLANAR)
    gy: Load = _load("length / time²", "along y")
    gz: Load = _load("length / time²", "along z", SPACE)


class Temperature(Entry, header="[[temperature]]"):
    """[[temperature]]: temperature; materials need an expansion.

    >>> Temperature(groups=["pin"], value=80.0)
    Temperature(groups=('pin',), value=80.0)
    """

    groups: Groups = key(GROUPS, "", "groups of cells that have it", None, "the whole mesh")
    value: As[Value, ValueLike] = key(
        VALUE, "temperature", "a number is ramped from the material's reference_temperature", load=True
    )


class Rigid(Entry, header="[[rigid]]", not_both=(("ux", "fx"), ("uy", "fy"), ("uz", "fz"))):
    """[[rigid]]: rigid body; each component is fixed, prescribed, or free under a given force.

    Components of its motion that are neither prescribed nor loaded are held at 0.

    >>> Rigid(group="punch", uy=-0.1)
    Rigid(group='punch', uy=-0.1)
    """

    group: str = key(GROUP, "", "cells (a surface without parent cells is enough) or nodes that move rigidly")
    kind: str | None = key(
        GROUP_KIND, "", "kind of group, if a group of cells and one of nodes have this name", None, KIND_BY_DEFAULT
    )
    centre: Numbers = key(
        POINT, "length", "centre of rotation, at which forces act", None, "the mean of its nodes", models=PLANAR
    )
    ux: Load = key(
        VALUE_OF_TIME, "length", "displacement of the centre along x", None, "0: fixed", load=True, models=PLANAR
    )
    uy: Load = key(VALUE_OF_TIME, "length", "displacement of the centre along y", None, "0: fixed", load=True)
    uz: Load = key(
        VALUE_OF_TIME, "length", "displacement of the centre along z", None, "0: fixed", load=True, models=SPACE
    )
    rotation: Rotation = key(
        ROTATION, "radian", "rotation vector about the centre; one number in a plane", None, "0: fixed", load=True,
        models=PLANAR,
    )  # fmt: skip
    fx: Load = _load("force", "force along x; x is then free", PLANAR, VALUE_OF_TIME)
    fy: Load = _load("force", "force along y; y is then free", MODELS, VALUE_OF_TIME)
    fz: Load = _load("force", "force along z; z is then free", SPACE, VALUE_OF_TIME)
    moment: Values = _load(
        "force × length",
        "moment vector about the centre; the rotation is then free, or beside it about the axes that it leaves free",
        PLANAR,
        VECTOR_OF_TIME,
    )
    mass: float | None = key(
        POSITIVE, "mass", "mass of the body, at its centre, beside that of cells with a density", None,
        "that of its cells",
    )  # fmt: skip
    inertia: As[float | tuple[float, float, float] | None, float | Sequence[float] | None] = key(
        one_or_three(POSITIVE), "mass × length²",
        "moments of inertia of this mass about the axes x, y, z through the centre; one number in a plane", None,
        "that of its cells", models=PLANAR,
    )  # fmt: skip
