"""Lines that families draw: pressures along a slave in a plane, residuals of Newton's method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacsolver.results.state import State
from verification.pages.charts import Line
from verification.solving import Solved

Floats = NDArray[np.floating]
#: points (..., 3) -> (...,): where they are along the slave
Along = Callable[[Floats], Floats]


def line(label: str, x: Floats, y: Floats, style: Literal["line", "points", "both", "steps"] = "line") -> Line:
    """A line of arrays (n,)."""
    return Line(label, tuple(map(float, x)), tuple(map(float, y)), style)


def means(mesh: Mesh, p: Floats, along: Along, label: str = "p_m") -> Line:
    """The pressures p (n,) of macro-elements of a cut mesh: from one end to the other of each, two points for each.

    >>> from lacmesh import cut_skin
    >>> from verification.meshes.blocks import block
    >>> cut = cut_skin(block("QUAD8", 2, (0, 0), (1, 1)), "y0").mesh
    >>> means(cut, np.array([3.0, 5.0]), lambda x: x[..., 0]).x
    (0.0, 0.5, 0.5, 1.0)
    """
    macro = mesh.cell_data["lac_macro"]
    ends = np.tile([np.inf, -np.inf], (len(p), 1))
    for _, chosen, nodes in mesh.select(np.flatnonzero(macro >= 0)):
        places = along(mesh.points[nodes])
        np.minimum.at(ends[:, 0], macro[chosen], places.min(axis=1))
        np.maximum.at(ends[:, 1], macro[chosen], places.max(axis=1))
    order = np.argsort(ends[:, 0])
    return line(label, ends[order].ravel(), np.repeat(p[order], 2), "steps")


def nodal(mesh: Mesh, p: Floats, along: Along, label: str = "recovered") -> Line:
    """Plot line of a pressure p (n_nodes,) at the nodes of a slave, NaN elsewhere."""
    there = np.flatnonzero(np.isfinite(p))
    places = along(mesh.points[there])
    order = np.argsort(places)
    return line(label, places[order], p[there][order], "points")


def pressures(solved: Solved, exact: Line, along: Along) -> tuple[Line, ...]:
    """Exact, p_m and recovered pressure along the slave of the one zone of a plane problem."""
    return exact, means(solved.mesh, solved.zone.pressure, along), nodal(solved.mesh, solved.recovered, along)


def residuals(label: str, states: Sequence[State]) -> Line:
    """Residuals of all iterations that led through some states; zeros are left out of a logarithmic axis."""
    values = np.array([r for state in states for r in state.residuals])
    numbers = 1.0 + np.arange(len(values))
    return line(label, numbers[values > 0], values[values > 0], "both")
