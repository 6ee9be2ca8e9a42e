"""Records of the table of keys that join nodes: equations, couplings of nodes and points, sides of sectors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from lacsolver.case.direction_kinds import COMPONENTS, LOCAL_AXES, TERMS
from lacsolver.case.entry import Entry
from lacsolver.case.keys import MODELS, As, Load, Needs, Numbers, Rotation, Section, Values, key
from lacsolver.case.kinds import FLAG, GROUP, POINT, Choice, Kind, numbers, text, whole
from lacsolver.case.records import GROUP_KIND, KIND_BY_DEFAULT, PLANAR, SPACE, LocalAxes, Tie
from lacsolver.case.value import Value
from lacsolver.case.value_kinds import ROTATION, VALUE_OF_TIME, VECTOR_OF_TIME, WEIGHTS


@dataclass(frozen=True, kw_only=True, repr=False)
class Equation(Entry):
    """[[equation]]: a sum of displacements that has a value, or displacements that all nodes of a group share.

    >>> Equation(group="lid", same=["uy"]).name
    'lid'
    """

    SECTION: ClassVar = Section(
        "equation", True, "a sum of displacements that has a value, or displacements that the nodes of a group share",
        one_of=(("terms", "same"),),
        not_both=(("terms", "group"), ("terms", "kind"), ("same", "value")), named_after="group",
    )  # fmt: skip
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


@dataclass(frozen=True, kw_only=True, repr=False)
class Cyclic(Tie):
    """[[cyclic]]: the sides of a sector, one of several that make a ring. A problem has a case with its `angle`.

    `matching`: True if the nodes of both sides match, so that they are joined node by node and not as a tie.

    >>> Cyclic(slave="left", master="right", sectors=12).name
    'left'
    """

    SECTION: ClassVar = Section(
        "cyclic", True, "the sides of a sector, which is repeated about an axis: displacements turn with it",
        named_after="slave",
    )  # fmt: skip
    angle: float = field(default=0.0, repr=False, compare=False)
    matching: bool = field(default=False, repr=False, compare=False)
    surfaces: None = field(default=None, repr=False, compare=False)
    search_distance: None = field(default=None, repr=False, compare=False)
    coverage_threshold: float = field(default=1e-6, repr=False, compare=False)
    surface: str = field(default="faces", repr=False, compare=False)
    crease_angle: None = field(default=None, repr=False, compare=False)
    slave: str = key(GROUP, "", "one side of the sector, which is cut where the meshes of the sides differ")
    master: str = key(GROUP, "", "the other side")
    sectors: int = key(whole(2), "", "number of sectors of the whole ring")
    axis: As[tuple[float, ...], Sequence[float]] = key(
        numbers(3), "", "direction of the axis", (0.0, 0.0, 1.0), "[0, 0, 1]", models=SPACE
    )
    origin: Numbers = key(POINT, "length", "a point of the axis", None, "the origin")
    harmonic: int = key(
        whole(0), "", "number of nodal diameters; 0: all sectors move alike, and others are not available", 0
    )
    ring: bool = key(FLAG, "", "write the fields of the whole ring too, for ParaView", False)


_ONE_MOTION = (("ux", "fx"), ("uy", "fy"), ("uz", "fz"))


def _motion(unit: str, meaning: str, models: tuple[str, ...], kind: Kind = VALUE_OF_TIME) -> Any:
    return key(kind, unit, meaning, None, "free", load=True, models=models)


@dataclass(frozen=True, kw_only=True, repr=False)
class Coupling(Entry):
    """[[coupling]]: a point that moves with the nodes of a group, as their mean or rigidly.

    >>> Coupling(group="flange", moment=[0, 0, 2.0]).name
    'flange'
    """

    SECTION: ClassVar = Section(
        "coupling", True, "a point with a force, a moment or a motion, which the nodes of a group take",
        not_both=_ONE_MOTION,
        some_of=(("ux", "uy", "uz", "rotation", "fx", "fy", "fz", "moment"),), named_after="group",
    )  # fmt: skip
    name: str = key(text("a name"), "", "name in the results", None, "the group's name")
    group: str = key(GROUP, "", "the nodes, of a group of cells or of nodes")
    kind: str = key(
        Choice({
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
