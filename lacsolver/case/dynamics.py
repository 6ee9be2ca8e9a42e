# ruff: noqa: RUF009 (key and section make fields)
"""The table of keys for motion: [dynamics], by which the steps of a case have inertia, and [[initial]]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from lacsolver.case.keys import MODELS, As, Needs, Section, key
from lacsolver.case.kinds import (
    NOT_NEGATIVE,
    Bounds,
    Choice,
    Groups,
    Number,
    Option,
    Point,
    Turning,
    TwoNumbers,
    Varying,
)
from lacsolver.case.records import PLANAR, SPACE, Entry
from lacsolver.case.value import Value, ValueLike

_HHT, _NEWMARK = Needs("scheme", ("hht",)), Needs("scheme", ("newmark",))


@dataclass(frozen=True, kw_only=True, repr=False)
class Dynamics(Entry):
    """[dynamics]: inertia and damping in the steps, and the time scheme; contact conditions hold at their ends.

    >>> Dynamics(scheme="newmark").beta
    0.25
    """

    SECTION: ClassVar = Section(
        "dynamics", False, "motion with inertia; without this section all steps are in static equilibrium"
    )
    scheme: str = key(
        Choice(
            (
                Option("hht", "Hilber, Hughes and Taylor, second order, damps the highest frequencies"),
                Option("newmark", "Newmark's method; without damping if beta = 1/4, gamma = 1/2"),
            )
        ),
        "", "time scheme", default="hht",
    )  # fmt: skip
    alpha: float = key(
        Number(Bounds(0, 1 / 3, open=False)), "", "numerical damping; 0 is Newmark's method", default=0.02, needs=_HHT
    )
    beta: float = key(Number(NOT_NEGATIVE), "", "weight of the acceleration in displacements", default=0.25,
                      needs=_NEWMARK)  # fmt: skip
    gamma: float = key(Number(NOT_NEGATIVE), "", "weight of the acceleration in velocities", default=0.5,
                       needs=_NEWMARK)  # fmt: skip
    start: float = key(
        Number(NOT_NEGATIVE), "time", "time from which inertia acts; static equilibrium before, as under a preload",
        default=0.0,
    )  # fmt: skip
    massless: str = key(
        Choice(
            (
                Option("skins", "slave and master skins, and the nodes that the cut made"),
                Option("slave", "slave skins, and the nodes that the cut made"),
                Option("internal", "the internal nodes of the macro-elements"),
                Option("none", "no nodes: pressures oscillate, and energy is created at impacts"),
            )
        ),
        "", "nodes without mass, whose mass goes to their neighbours", default="skins",
    )  # fmt: skip
    mass: str = key(
        Choice(
            (
                Option("consistent", "by the shape functions of displacements"),
                Option("lumped", "diagonal (Hinton, Rock and Zienkiewicz)"),
            )
        ),
        "", "mass matrix of the cells", default="consistent",
    )  # fmt: skip
    rayleigh: As[tuple[float, float], Sequence[float]] = key(
        TwoNumbers(NOT_NEGATIVE), "1 / time, time",
        "[a, b] of the damping matrix a M + b K, with K of the undeformed bodies",
        default=(0.0, 0.0), default_words="[0.0, 0.0]",
    )  # fmt: skip


def _motion(unit: str, meaning: str, models: tuple[str, ...] = MODELS) -> Any:
    return key(Varying(), unit, meaning, models=models, default=None)


@dataclass(frozen=True, kw_only=True, repr=False)
class Initial(Entry):
    """[[initial]]: velocity, and displacement, with which bodies begin to move.

    >>> Initial(groups=["ball"], vy=-3.0)
    Initial(groups=('ball',), vy=-3.0)
    """

    SECTION: ClassVar = Section(
        "initial", True,
        "velocity and displacement at the start of [dynamics]; later sections replace what earlier ones give",
        some_of=(("vx", "vy", "vz", "rotation", "ux", "uy", "uz"),),
    )  # fmt: skip
    groups: As[tuple[str, ...] | None, Sequence[str] | None] = key(
        Groups(), "", "groups of cells that move so", default=None, default_words="the whole mesh"
    )
    vx: As[Value | None, ValueLike | None] = _motion("length / time", "velocity along x")
    vy: As[Value | None, ValueLike | None] = _motion("length / time", "velocity along y")
    vz: As[Value | None, ValueLike | None] = _motion("length / time", "velocity along z", SPACE)
    rotation: As[tuple[Value, ...] | None, ValueLike | Sequence[ValueLike] | None] = key(
        Turning(), "radian / time", "angular velocity about the centre, added to vx, vy, vz; one number in a plane",
        models=PLANAR, default=None,
    )  # fmt: skip
    centre: As[tuple[float, ...] | None, Sequence[float] | None] = key(
        Point(), "length", "centre of the rotation", default=None, models=PLANAR,
        default_words="the mean of the groups' nodes",
    )  # fmt: skip
    ux: As[Value | None, ValueLike | None] = _motion("length", "displacement along x")
    uy: As[Value | None, ValueLike | None] = _motion("length", "displacement along y")
    uz: As[Value | None, ValueLike | None] = _motion("length", "displacement along z", SPACE)
