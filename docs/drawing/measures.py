"""The tables of docs/quality.md: every measure of every type, what it is, its ideal, what Verdict accepts."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drawing.solids import ideal
from lacmesh.cells import CELLS
from lacmesh.quality.measures import default_measures, measures_of, primary_metric
from lacmesh.quality.vectors import nodes_first
from lacmesh.quality.verdict import ACCEPTED, CLASSES

_OURS = {
    "validity": "least Jacobian determinant over corners, other nodes and integration points, over its mean",
    "corner_jacobian": "determinant of the edges that leave a corner, brought to length 1, over that of the ideal "
    "cell; the least of the corners",
    "edge_ratio": "longest edge over the shortest",
    "min_dihedral": "least angle between two facets, degrees",
    "max_dihedral": "largest angle between two facets, degrees",
    "min_corner_angle": "least angle between two edges, degrees",
    "max_corner_angle": "largest angle between two edges, degrees",
}
_BEST = {"validity": "1", "corner_jacobian": "1", "edge_ratio": "1"}


def own_table() -> Iterator[str]:
    """The measures that are ours, and the cells that have them."""
    yield "| measure | what it is | ideal | cells |"
    yield "|---|---|---:|---|"
    for name, what in _OURS.items():
        dims = sorted({cell.dim for cell in CELLS.values() if name in measures_of(cell.name)})
        words = {(1, 2, 3): "all but points", (2, 3): "surfaces, solids", (2,): "surfaces", (3,): "solids"}
        yield f"| `{name}` | {what} | {_BEST.get(name, '')} | {words[tuple(dims)]} |"


def verdict_table(kind: str) -> Iterator[str]:
    """Verdict's measures of a type; bold: those that are taken when none are asked for."""
    yield "| measure | what it is | ideal | accepted |"
    yield "|---|---|---:|---|"
    cell = CLASSES[kind](nodes_first(_ideal(kind)[None]))
    for name, limits in ACCEPTED[kind].items():
        best = f"{round(float(getattr(cell, name)()[0]), 4):g}" if name not in ("area", "volume", "jacobian") else ""
        told = "" if limits is None else f"{limits[0]:.4g} to {limits[1]:.4g}".replace("to inf", "and more")
        shown = f"**`{name}`**" if name in default_measures(kind) else f"`{name}`"
        ranks = ", ranks" if name == primary_metric(kind) else ""
        yield f"| {shown}{ranks} | {_sentence(getattr(CLASSES[kind], name))} | {best} | {told} |"


def _ideal(kind: str) -> NDArray:
    corners = ideal(CELLS[kind].family)
    return np.pad(corners, ((0, 0), (0, 3 - corners.shape[1]))) / np.linalg.norm(corners[1] - corners[0])


def _sentence(measure: Any) -> str:
    """The first sentence of a method's docstring, for a cell of a table."""
    return (inspect.getdoc(measure) or "").split("\n\n")[0].replace("\n", " ").removesuffix(".")
