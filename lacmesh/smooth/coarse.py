"""Faces of free form that are too coarse for the curved skin that they stand for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints, Mesh
from lacmesh.smooth.fitted import cells_of
from lacmesh.smooth.heights import Smooth, smooth_of
from lacmesh.smooth.patches import Bools
from lacmesh.surface.record import Surface

#: faces that turn by more (radians) from one to the next, fewer than sixteen to a turn, are too few for a fit
_COARSE = 2 * np.pi / 16


class Faceted(NamedTuple):
    """Where a skin of free form is too coarse: `cells` of the mesh, the `turn` (degrees) to a neighbour at most.

    `no_height`: how many of the faces, as the user meshed them, have no fit though they have a neighbour.
    """

    cells: Ints
    turn: float
    no_height: int


def faceted(smooth: Smooth, surface: Surface) -> Faceted:
    """The faces of no exact shape that turn by more than a 16th of a circle to the next, or that have no fit."""
    turn, lacking = _turns(smooth), _lacking(smooth)
    free = smooth.sought.free
    cells = cells_of(smooth, surface, np.flatnonzero(free & (turn > _COARSE) | lacking))
    return Faceted(cells, float(np.degrees(turn[free].max(initial=0.0))), int(lacking.sum()))


def unresolved(mesh: Mesh, surface: Surface, *, how: str = "smooth", crease_angle: float = 40.0) -> Floats:
    """(k,): by how much (radians) linear faces turn from a neighbour, of those that contact takes to be flat.

    With `how` = `faces` all that turn; with `smooth` those of free form that are too coarse for a fit or have none.
    """
    smooth = smooth_of(mesh, surface, crease_angle)
    turn = _turns(smooth)
    if how == "smooth":
        return turn[smooth.sought.free & (turn > _COARSE) | _lacking(smooth)]
    return turn[turn > 0]


def _turns(smooth: Smooth) -> NDArray[np.floating]:
    """(k,): the largest angle (radians) from a linear parent to one that it joins without a crease."""
    patches = smooth.sought.patches
    i, j = patches.joints.i, patches.joints.j
    out = np.zeros(len(patches.normal))
    angle = np.arccos(np.clip((patches.normal[i] * patches.normal[j]).sum(axis=1), -1.0, 1.0))
    for one in (i, j):
        np.maximum.at(out, one, angle)
    return out


def _lacking(smooth: Smooth) -> Bools:
    """(k,): linear parents of free form that have a neighbour and no fit."""
    patches, free = smooth.sought.patches, smooth.sought.free
    i, j = patches.joints.i, patches.joints.j
    both = free[i] & free[j]
    joined = np.zeros(len(free), bool)
    joined[i[both]] = joined[j[both]] = True
    return smooth.heights[1] & joined
