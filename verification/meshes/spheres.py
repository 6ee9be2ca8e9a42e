"""Two like hemispheres of radius 50 that touch at the origin, axisymmetric: quarters of a disc."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import SPLITS
from verification.exact.finite_bodies import SPHERE_RADIUS as RADIUS
from verification.grids import lines, quarter_disc
from verification.meshes.bodies import Body, body, joined

Floats = NDArray[np.floating]
#: radius of contact, of the half-space; the slave's cells are even up to 1.5 of it, and grow by this beyond
CONTACT, GROWTH = 10.0, 1.25
#: the master's cells are so much larger; skins end at this part of the arc to 45 degrees
COARSER, SKIN = 1.1, 0.6


def spheres(kind: str, n: int) -> Mesh:
    """Cells of type TRIA3, TRIA6, QUAD4 or QUAD8, n slave faces to the radius of contact.

    Groups: slave (of the upper), master, up, down (the flats), axis.
    """
    linear = CELLS[kind].linear
    upper = _hemisphere(linear, CONTACT / n, ("slave", "up", "axis"))
    lower = _mirrored(_hemisphere(linear, COARSER * CONTACT / n, ("master", "down", "axis")))
    mesh = joined({"upper": upper, "lower": lower}, linear)
    return mesh if kind == linear else _round(lacmesh.raise_order(mesh, surface="faces"))


def _hemisphere(linear: str, h: float, names: tuple[str, ...]) -> Body:
    """Upper hemisphere; quadrangles are split into triangles by the diagonal that halves the angle between two arcs."""
    arc = np.pi / 4 * RADIUS
    along, up = lines(arc, h, 1.5 * CONTACT, GROWTH), lines(RADIUS, h, CONTACT, GROWTH)
    skins = dict(zip(names, (_skin, _flat, _axis), strict=True))
    half = body(quarter_disc(RADIUS, along / arc, up / RADIUS), skins=skins)
    corners = np.roll(half.cells, 1, axis=1)
    return half._replace(cells=np.concatenate([corners[:, list(nodes)] for _, nodes in SPLITS[linear]]))


def _mirrored(of: Body) -> Body:
    """Mirror a body to y < 0; its cells stay positive, its skins outward."""
    return Body(of.points * [1, -1], of.cells[:, ::-1], {name: rows[:, ::-1] for name, rows in of.skins.items()})


def _skin(x: Floats, y: Floats) -> NDArray[np.bool_]:
    there = np.isclose(np.hypot(x, y - RADIUS), RADIUS, rtol=1e-9)
    return there & (x <= RADIUS * np.sin(SKIN * np.pi / 4)) & (y < RADIUS / 2)


def _flat(x: Floats, y: Floats) -> NDArray[np.bool_]:
    return np.isclose(y, RADIUS, rtol=1e-9)


def _axis(x: Floats, y: Floats) -> NDArray[np.bool_]:
    return np.isclose(x, 0.0, atol=1e-9)


def _round(mesh: Mesh) -> Mesh:
    """Put the middle nodes of both skins on the circle."""
    points = mesh.points.copy()
    for name, centre in (("slave", RADIUS), ("master", -RADIUS)):
        for _, _, nodes in mesh.select(mesh.cell_groups[name]):
            off = points[nodes[:, 2]] - [0.0, centre, 0.0]
            points[nodes[:, 2]] = [0.0, centre, 0.0] + off * (RADIUS / np.linalg.norm(off, axis=1))[:, None]
    return replace(mesh, points=points)
