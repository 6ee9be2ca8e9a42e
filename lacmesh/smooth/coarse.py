"""Faces of free form that are too coarse for the curved skin that they approximate."""

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
#: heights that may be off by more than this part of a face's size are told: worth such a part of Young's modulus
DOUBTFUL = 5e-3


class Faceted(NamedTuple):
    """Faces of free form that are too coarse: `cells` of the mesh, the largest angle `turn` to a neighbour (degrees).

    `no_height`: number of faces, before the cut, that have no fit though they have a neighbour. `doubt`: how far the
    heights of any of them may be off, over the face's size.
    """

    cells: Ints
    turn: float
    no_height: int
    doubt: float


def faceted(smooth: Smooth, surface: Surface) -> Faceted:
    """Find faces of free form that have no fit or a doubtful one, or turn by more than a 16th of a circle."""
    turn, lacking = _turns(smooth), _lacking(smooth)
    free = smooth.sought.free
    cells = cells_of(smooth, surface, np.flatnonzero(free & ((turn > _COARSE) | (smooth.doubt > DOUBTFUL)) | lacking))
    doubt = float(smooth.doubt.max(initial=0.0))
    return Faceted(cells, float(np.degrees(turn[free].max(initial=0.0))), int(lacking.sum()), doubt)


def doubt_in_words(doubt: float) -> str:
    """Say how far gaps to a curved skin may be off, over the size of a face; after `its` or `their`."""
    return f"curvature changes within few faces, so that gaps may be off by {doubt:.2g} of a face's size"


def unresolved(mesh: Mesh, surface: Surface, *, how: str = "smooth", crease_angle: float | None = None) -> Floats:
    """(k,): largest angles (radians) to a neighbour of the linear faces whose curvature contact does not represent.

    With `how` = `faces` these are all faces that turn from a neighbour; with `smooth` those of free form that are too
    coarse for a fit or have none.
    """
    smooth = smooth_of(mesh, surface, crease_angle)
    turn = _turns(smooth)
    if how == "smooth":
        return turn[smooth.sought.free & (turn > _COARSE) | _lacking(smooth)]
    return turn[turn > 0]


def _turns(smooth: Smooth) -> NDArray[np.floating]:
    """(k,): largest angle (radians) between a linear parent and a neighbour joined to it without a crease."""
    patches = smooth.sought.patches
    i, j = patches.joints.i, patches.joints.j
    out = np.zeros(len(patches.normal))
    angle = np.arccos(np.clip((patches.normal[i] * patches.normal[j]).sum(axis=1), -1.0, 1.0))
    for one in (i, j):
        np.maximum.at(out, one, angle)
    return out


def _lacking(smooth: Smooth) -> Bools:
    """(k,): True for linear parents of free form that have a neighbour but no fit."""
    patches, free = smooth.sought.patches, smooth.sought.free
    i, j = patches.joints.i, patches.joints.j
    both = free[i] & free[j]
    joined = np.zeros(len(free), bool)
    joined[i[both]] = joined[j[both]] = True
    return smooth.heights[1] & joined
