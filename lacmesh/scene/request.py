"""Checks of the numbers in a drawing request: directions, and the gap between bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lacmesh.errors import RequestError, did_you_mean

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


def check_placing(
    camera: Sequence[float] | None,
    cutaway: Sequence[float] | None,
    explode: float | None,
    near: float | None,
    bodies: str | None = None,
) -> None:
    """Raise RequestError for the first option that cannot be drawn; None leaves the choice to the drawing."""
    for name, direction in (("camera", camera), ("cutaway", cutaway)):
        if direction is not None:
            check_direction(name, direction)
    if explode is not None:
        check_gap("explode", explode)
    if near is not None and not near >= 0:
        raise RequestError(f"near {near:g} is no distance; say a part of the mesh's diagonal")
    if bodies is not None and bodies not in BODIES_AS:
        raise RequestError(f"bodies are drawn {', '.join(BODIES_AS)}, not {bodies!r}{did_you_mean(bodies, BODIES_AS)}")
