"""The table of keys for motion: [dynamics], by which the steps of a case have inertia, and [[initial]]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from lacsolver.case.entry import Entry
from lacsolver.case.keys import MODELS, As, Groups, Load, Needs, Numbers, Section, Values, key
from lacsolver.case.kinds import GROUPS, NOT_NEGATIVE, POINT, Choice, number, numbers
from lacsolver.case.records import PLANAR, SPACE
from lacsolver.case.value_kinds import VALUE, VECTOR_OF_TIME

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
        Choice({
            "hht": "Hilber, Hughes and Taylor, second order, damps the highest frequencies",
            "newmark": "Newmark's method; without damping if beta = 1/4, gamma = 1/2",
        }), "", "time scheme", "hht",
    )  # fmt: skip
    alpha: float = key(number(0, 1 / 3, open=False), "", "numerical damping; 0 is Newmark's method", 0.02, needs=_HHT)
    beta: float = key(NOT_NEGATIVE, "", "weight of the acceleration in displacements", 0.25, needs=_NEWMARK)
    gamma: float = key(NOT_NEGATIVE, "", "weight of the acceleration in velocities", 0.5, needs=_NEWMARK)
    start: float = key(
        NOT_NEGATIVE, "time", "time from which inertia acts; static equilibrium before, as under a preload", 0.0
    )
    massless: str = key(
        Choice({
            "skins": "slave and master skins, and the nodes that the cut made",
            "slave": "slave skins, and the nodes that the cut made",
            "internal": "the internal nodes of the macro-elements",
            "none": "no nodes: pressures oscillate, and energy is created at impacts",
        }), "", "nodes without mass, whose mass goes to their neighbours", "skins",
    )  # fmt: skip
    mass: str = key(
        Choice({
            "consistent": "by the shape functions of displacements",
            "lumped": "diagonal (Hinton, Rock and Zienkiewicz)",
        }), "", "mass matrix of the cells", "consistent",
    )  # fmt: skip
    rayleigh: As[tuple[float, float], Sequence[float]] = key(
        numbers(2, NOT_NEGATIVE), "1 / time, time",
        "[a, b] of the damping matrix a M + b K, with K of the undeformed bodies", (0.0, 0.0), "[0.0, 0.0]",
    )  # fmt: skip


def _motion(unit: str, meaning: str, models: tuple[str, ...] = MODELS) -> Any:
    return key(VALUE, unit, meaning, None, models=models)


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
    groups: Groups = key(GROUPS, "", "groups of cells that move so", None, "the whole mesh")
    vx: Load = _motion("length / time", "velocity along x")
    vy: Load = _motion("length / time", "velocity along y")
    vz: Load = _motion("length / time", "velocity along z", SPACE)
    rotation: Values = key(
        VECTOR_OF_TIME, "radian / time",
        "angular velocity about the centre, added to vx, vy, vz; one number in a plane", None, models=PLANAR,
    )  # fmt: skip
    centre: Numbers = key(
        POINT, "length", "centre of the rotation", None, "the mean of the groups' nodes", models=PLANAR
    )
    ux: Load = _motion("length", "displacement along x")
    uy: Load = _motion("length", "displacement along y")
    uz: Load = _motion("length", "displacement along z", SPACE)
