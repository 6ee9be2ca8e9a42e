"""The surface of some skin cells for contact: smooth, or the faces as they are."""

from __future__ import annotations

from dataclasses import replace

from lacmesh.errors import RequestError
from lacmesh.mesh import Ints, Mesh
from lacmesh.smooth.heights import height_of
from lacmesh.surface.record import Surface

#: what a surface may be taken for
SURFACES = ("smooth", "faces")


def surface_of(mesh: Mesh, cells: Ints, surface: str = "smooth", crease_angle: float | None = None) -> Surface:
    """Build the surface of some skin cells (indices) of a mesh, with the heights of the smooth skin over its faces.

    `surface`: `smooth`, or `faces` for a surface without heights; `crease_angle` in degrees as in `height_of`. Raises
    RequestError; DataError as in `Surface.of`.
    """
    if surface not in SURFACES:
        raise RequestError(f"surface is one of {', '.join(SURFACES)}, not {surface!r}")
    skin = Surface.of(mesh, cells)
    return skin if surface == "faces" else replace(skin, height=height_of(mesh, skin, crease_angle))
