"""Framing of a picture of contact: slave skins as cells, the surroundings of pressure, the magnification."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Mesh
from lacmesh.topology.bodies import label_bodies
from lacsolver.output.parts import on_faces
from lacsolver.pictures.plane import along
from lacsolver.results.results import ZoneFields

#: largest length of a magnified displacement, relative to the extent of the mesh
_MOVED = 0.04
#: largest overlap of magnified bodies, relative to the extent of the mesh
_OVERLAP = 0.004
#: margin of a zoomed picture on each side of the faces under pressure, relative to their extent
_MARGIN = 0.5


def with_skins(mesh: Mesh, x: Floats, zones: Mapping[str, ZoneFields], shown: Any) -> tuple[Mesh, Floats, list[str]]:
    """Return a mesh at points x (n_nodes, 3) with a group of faces for each zone, and the macro-elements of all zones.

    Also return the value of each cell (n_cells,), `shown(zone)` on these faces and NaN elsewhere; and the groups.
    """
    value, macro, first = np.full(mesh.n_cells, np.nan), np.full(mesh.n_cells, -1), 0
    groups = {f"zone {name}": np.sort(zone.surface.cell) for name, zone in zones.items()}
    for zone in zones.values():
        value[zone.surface.cell] = shown(zone)
        macro[zone.surface.cell] = np.where(zone.macro >= 0, first + zone.macro, -1)
        first += len(zone.status)
    whole = Mesh.create(x, mesh.blocks, space_dim=mesh.space_dim, cell_groups=groups, cell_data={"lac_macro": macro})
    return whole, value, list(groups)


def values_on_faces(zone: ZoneFields, values: Floats) -> NDArray[np.floating]:
    """Return values of macro-elements on the faces of a zone, NaN on those of none."""
    return on_faces(np.asarray(values, float), zone.macro, np.nan)


def pressed_window(zones: Any, x: Floats) -> NDArray[np.floating] | None:
    """Return the corners (2, 3) of a box around the faces under pressure, with a margin; None if there are none."""
    faces = [zone.surface.faces.nodes[values_on_faces(zone, zone.pressure) > 0] for zone in zones]
    pressed = np.concatenate([nodes.ravel() for nodes in faces])
    points = x[pressed[pressed >= 0]]
    return window_of(points) if len(points) else None


def window_of(points: Floats) -> NDArray[np.floating]:
    """Return the corners (2, d) of a box around points (n, d), with a margin."""
    low, high = points.min(axis=0), points.max(axis=0)
    margin = _MARGIN * (high - low).max()
    return np.stack([low - margin, high + margin])


def pressed_span(zone: ZoneFields) -> tuple[float, float] | None:
    """Return the interval of length along a skin that is under pressure, with a margin; None if there is none."""
    s, p = along(zone.surface.faces.nodes[:, :2], values_on_faces(zone, zone.pressure), zone.surface.x)
    pressed = s[np.isfinite(p) & (p != 0)]
    if not len(pressed):
        return None
    low, high = float(pressed.min()), float(pressed.max())
    margin = _MARGIN * (high - low)
    return max(low - margin, 0.0), high + margin


def largest_closed(mesh: Mesh, u: Floats, zones: Any) -> float:
    """Return by how much faces under pressure have moved towards the nearest node of another body, along the normal."""
    body = label_bodies((block.nodes for block in mesh.blocks), mesh.n_nodes)
    tree = import_module("scipy.spatial").cKDTree
    x, largest = mesh.points + u, 0.0
    for zone in zones:
        rows = np.flatnonzero(np.nan_to_num(values_on_faces(zone, zone.pressure)) != 0)
        others = np.flatnonzero((body >= 0) & ~np.isin(body, body[zone.surface.faces.distinct_nodes]))
        if len(rows) and len(others):
            corners = zone.surface.faces.nodes[rows, :2]
            near = others[tree(x[others]).query(x[corners].mean(axis=1))[1]]
            normal = np.nan_to_num(zone.normal[zone.macro[rows]])
            towards = np.einsum("nd,nd->n", (u[corners].mean(axis=1) - u[near])[:, : normal.shape[1]], normal)
            largest = max(largest, float(np.abs(towards).max()))
    return largest


def magnification(mesh: Mesh, u: Floats, closed: float = 0.0) -> float:
    """Return the factor by which displacements (n_nodes, 3) are magnified: 1, 2 or 5 times a power of ten, at least 1.

    `closed`: largest initial gap that has closed; magnified bodies overlap by about the factor times this gap, which is
    limited so that it cannot be visible.

    >>> bar = Mesh.create([[0, 0], [2, 0]], [("SEG2", [[0, 1]])])
    >>> magnification(bar, np.array([[0, 0, 0], [0.003, 0, 0]])), magnification(bar, np.ones((2, 3)))
    (20.0, 1.0)
    """
    largest, extent = float(np.abs(u).max(initial=0.0)), float(np.ptp(mesh.points, axis=0).max())
    ratio = min(_MOVED * extent / max(largest, 1e-300), 1 + _OVERLAP * extent / max(closed, 1e-300))
    if largest <= 0 or ratio < 1:
        return 1.0
    power = 10.0 ** math.floor(math.log10(ratio))
    return float(power * max(n for n in (1, 2, 5) if n * power <= ratio * (1 + 1e-9)))
