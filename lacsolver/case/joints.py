"""Records of the table of keys that join nodes: equations, couplings, sectors, sections of bolts, and springs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from lacsolver.case.direction_kinds import COMPONENTS, GROUP_KIND, LOCAL_AXES, TERMS
from lacsolver.case.entry import Entry
from lacsolver.case.keys import MODELS, As, Load, Needs, Numbers, Rotation, Values, hidden, key
from lacsolver.case.kinds import FLAG, GROUP, NOT_NEGATIVE, POINT, POSITIVE, Kind, choice, numbers, text, whole
from lacsolver.case.records import (
    KIND_BY_DEFAULT,
    NOT_KIND_OF_AT,
    PLANAR,
    SPACE,
    WHERE,
    AtNodes,
    LocalAxes,
    Tie,
    in_axes,
)
from lacsolver.case.value import Value
from lacsolver.case.value_kinds import ROTATION, VALUE_OF_TIME, VECTOR_OF_TIME, WEIGHTS


class Equation(
    Entry, header="[[equation]]", one_of=(("terms", "same"),),
    not_both=(("terms", "group"), ("terms", "kind"), ("same", "value")), named_after="group",
):  # fmt: skip
    """[[equation]]: a sum of displacements that has a value, or displacements that the nodes of a group share.

    >>> Equation(group="lid", same=["uy"]).name
    'lid'
    """

    name: str = key(text("a name"), "", "name in the results", None, "the group's name, or equation and its number")
    terms: As[tuple[Mapping[str, Any], ...] | None, Sequence[Mapping[str, Any]] | None] = key(
        TERMS, "", "factors of displacements of nodes, by number, place or group of one node; their sum is the value",
        None,
    )  # fmt: skip
    value: Load = key(VALUE_OF_TIME, "length", "value of the sum", None, "0.0", load=True)
    group: str | None = key(GROUP, "", "nodes that share displacements, of a group of cells or of nodes", None)
    kind: str | None = key(
        GROUP_KIND, "", "kind of group, if a group of cells and one of nodes have this name", None, KIND_BY_DEFAULT
    )
    same: As[tuple[str, ...] | None, Sequence[str] | None] = key(
        COMPONENTS, "", "components of displacement that all nodes of the group share", None
    )


class Cyclic(Tie, header="[[cyclic]]", named_after="slave"):
    """[[cyclic]]: the sides of a sector, which is repeated about an axis: displacements turn with it.

    A problem has a case with its `angle`. `matching`: True if the nodes of both sides match, so that they are joined
    node by node and not as a tie.

    >>> Cyclic(slave="left", master="right", sectors=12).name
    'left'
    """

    angle: float = hidden(0.0)
    matching: bool = hidden(False)
    surfaces: None = hidden(None)
    search_distance: None = hidden(None)
    coverage_threshold: float = hidden(1e-6)
    surface: str = hidden("faces")
    crease_angle: None = hidden(None)
    slave: str = key(GROUP, "", "one side of the sector, which is cut where the meshes of the sides differ")
    master: str = key(GROUP, "", "the other side")
    sectors: int = key(whole(2), "", "number of sectors of the whole ring")
    axis: As[tuple[float, ...], Sequence[float]] = key(
        numbers(3), "", "direction of the axis", (0.0, 0.0, 1.0), "[0, 0, 1]", models=SPACE
    )
    origin: Numbers = key(POINT, "length", "a point of the axis", None, "the origin")
    harmonic: int = key(whole(0), "", "number of nodal diameters; only 0 is available: all sectors deform alike", 0)
    ring: bool = key(FLAG, "", "write the fields of the whole ring too, for ParaView", False)


_ONE_MOTION = (("ux", "fx"), ("uy", "fy"), ("uz", "fz"))


def _motion(unit: str, meaning: str, models: tuple[str, ...], kind: Kind = VALUE_OF_TIME) -> Any:
    return key(kind, unit, meaning, None, "free", load=True, models=models)


class Coupling(
    Entry, header="[[coupling]]", not_both=_ONE_MOTION,
    some_of=(("ux", "uy", "uz", "rotation", "fx", "fy", "fz", "moment"),), named_after="group",
):  # fmt: skip
    """[[coupling]]: a point with a force, a moment or a motion, which the nodes of a group take.

    >>> Coupling(group="flange", moment=[0, 0, 2.0]).name
    'flange'
    """

    name: str = key(text("a name"), "", "name in the results", None, "the group's name")
    group: str = key(GROUP, "", "the nodes, of a group of cells or of nodes")
    kind: str = key(
        choice({
            "distributing": "loads are spread by weights; the point moves as the mean of the nodes",
            "rigid": "the nodes move with the point as one rigid body",
        }), "", "how nodes and point are coupled", "distributing",
    )  # fmt: skip
    at: Numbers = key(POINT, "length", "the point", None, "the mean of the nodes, by their weights", models=PLANAR)
    weights: As[Value | tuple[tuple[float, float], ...] | None, Any] = key(
        WEIGHTS, "", "weights of the nodes: a formula of their place, or [[number of a node, weight], ...]", None,
        "the parts of the nodes in the group's area; 1 each of a group of nodes",
        needs=Needs("kind", ("distributing",)),
    )  # fmt: skip
    components: As[tuple[str, ...] | None, Sequence[str] | None] = key(
        COMPONENTS, "", "components of the nodes' displacement that follow the point", None, "all",
        needs=Needs("kind", ("rigid",)),
    )  # fmt: skip
    axes: LocalAxes = key(
        LOCAL_AXES, "", "Cartesian axes of the components, motions and loads", None, "those of the mesh"
    )
    ux: Load = _motion("length", "displacement of the point along x", PLANAR)
    uy: Load = _motion("length", "displacement of the point along y", MODELS)
    uz: Load = _motion("length", "displacement of the point along z", SPACE)
    rotation: Rotation = _motion("radian", "rotation vector; one number in a plane", PLANAR, ROTATION)
    fx: Load = _motion("force", "force at the point along x", PLANAR)
    fy: Load = _motion("force", "force at the point along y", MODELS)
    fz: Load = _motion("force", "force at the point along z", SPACE)
    moment: Values = _motion(
        "force × length", "moment vector; one number in a plane; beside rotation about the axes that it leaves free",
        PLANAR, VECTOR_OF_TIME,
    )  # fmt: skip


#: a group that the mesh has itself, or whose two sides it has (`problem.sections`)
_SECTION_GROUP = replace(GROUP, is_group=False)


class Pretension(Entry, header="[[pretension]]", one_of=(("force", "shortening"),), named_after="group"):
    """[[pretension]]: a section of a bolt, at which it is shortened by a force or by a length.

    >>> Pretension(group="shank", force=40e3, lock=1.0).name
    'shank'
    """

    name: str = key(text("a name"), "", "name in the results", None, "the group's name")
    group: str = key(
        _SECTION_GROUP, "", "faces inside the bolt, across all of it, where it is divided; or NAME of two surfaces "
        "NAME_a and NAME_b, as lacmesh split makes them",
    )  # fmt: skip
    normal: Numbers = key(
        POINT, "", "direction of the shortening, of any length and either sign", None, "the mean normal of the faces"
    )
    force: Load = key(
        VALUE_OF_TIME, "force", "force that pulls the two sides together: the bolt's tension", None, load=True
    )
    shortening: Load = key(
        VALUE_OF_TIME, "length", "length by which the bolt is shortened at the section", None, load=True
    )
    lock: float | None = key(
        NOT_NEGATIVE,
        "time",
        "time from which the shortening is constant, and the force follows from the stiffness",
        None,
        "never",
    )


class Spring(
    AtNodes, header="[[spring]]", one_of=WHERE, some_of=(("kx", "ky", "kz", "k"),),
    not_both=(*NOT_KIND_OF_AT, ("k", "kx"), ("k", "ky"), ("k", "kz"), ("k", "axes")),
):  # fmt: skip
    """[[spring]]: springs from nodes to the ground, or from one to another (axisymmetric: of the full circle).

    >>> Spring(group="top", ky=5.0)
    Spring(group='top', ky=5.0)
    >>> Spring(group="eye", to="hook", k=5.0)
    Spring(group='eye', to='hook', k=5.0)
    """

    to: str | None = key(
        GROUP, "", "group of one node at the other end, of the kind `kind`; group then has one node, too", None,
        "the ground",
    )  # fmt: skip
    k: float | None = key(
        POSITIVE, "force / length", "stiffness along the line to the other node; with kinematics = finite the line "
        "turns with its nodes", None,
    )  # fmt: skip
    kx: float | None = key(POSITIVE, "force / length", "stiffness along x; between two nodes, of the difference", None)
    ky: float | None = key(POSITIVE, "force / length", "stiffness along y, as kx", None)
    kz: float | None = key(POSITIVE, "force / length", "stiffness along z, as kx", None, models=SPACE)
    axes: LocalAxes = in_axes("kx, ky, kz")
