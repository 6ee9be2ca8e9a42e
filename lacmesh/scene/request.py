"""A drawing request: how a mesh is placed, and the checks of its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lacmesh.errors import RequestError, did_you_mean
from lacmesh.scene.visible import Vector

#: the widest gap, in diagonals of the mesh: beyond it bodies are dots
WIDEST = 100.0
#: ways to draw bodies, and their opacity
BODIES_AS = {"solid": 1.0, "ghost": 0.16, "hidden": 0.0}


def check_direction(name: str, direction: Sequence[float]) -> None:
    """Raise RequestError unless a direction is three finite numbers, at least one of them not 0."""
    said = " ".join(f"{v:g}" for v in direction)
    if len(direction) != 3 or not all(map(math.isfinite, direction)):
        raise RequestError(f"{name} {said} is no direction; say three finite numbers")
    if not any(direction):
        raise RequestError(f"{name} {said} is no direction")


def check_gap(name: str, gap: float) -> None:
    """Raise RequestError for a gap that is not from 0 to WIDEST."""
    if not 0 <= gap <= WIDEST:
        raise RequestError(f"{name} {gap:g} is no gap; say a number from 0 to {WIDEST:g}, in sizes of the mesh")


@dataclass(frozen=True)
class Placing:
    """Placing of a mesh in a drawing, as `view.picture` describes it; None leaves the choice to the drawing.

    Raises RequestError for the first option that cannot be drawn.
    """

    camera: Vector | None = None
    explode: float | None = None
    tilt: float | None = None
    near: float | None = None
    cutaway: Vector | None = None
    bodies: str | None = None

    def __post_init__(self) -> None:
        for name, direction in (("camera", self.camera), ("cutaway", self.cutaway)):
            if direction is not None:
                check_direction(name, direction)
        if self.explode is not None:
            check_gap("explode", self.explode)
        if self.near is not None and not self.near >= 0:
            raise RequestError(f"near {self.near:g} is no distance; say a part of the mesh's diagonal")
        if self.bodies is not None and self.bodies not in BODIES_AS:
            near_match = did_you_mean(self.bodies, BODIES_AS)
            raise RequestError(f"bodies are drawn {', '.join(BODIES_AS)}, not {self.bodies!r}{near_match}")

    @property
    def part(self) -> bool:
        """True if a part of the mesh is drawn."""
        return self.near is not None or self.cutaway is not None
