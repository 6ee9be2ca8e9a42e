"""Coordinates from a point of the model, so that what is computed does not depend on where the model lies.

A product of coordinates far from 0 loses the digits that tell two nodes apart. So numerics read `from_origin(mesh)`,
and what a user is told, or gives as a place or a formula, is in the coordinates of the mesh as it stands. The origin
is taken such that no digit is lost by subtracting it: what lies between c and 2 c is c and an exact difference
(Sterbenz), and a model that is nearer to 0 than it is large stays where it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Mesh

#: coordinates beyond this are wild: their squares are not finite
_WILD = 1e150
#: what is left of a coordinate that is 0 but for rounding, of the size of what it is of
_NOTHING = 1e-9


def origin_of(x: Floats) -> NDArray[np.floating]:
    """(3,): the origin for points x (n, 3): along each axis their coordinate that is nearest to 0, or 0 itself.

    It is 0 where they come nearer to 0 than their largest extent. Points that are not finite do not count.

    >>> origin_of(np.array([[5e5, 1.0, 0.0], [5e5 + 2, 3.0, 0.0]])).tolist()
    [500000.0, 0.0, 0.0]
    """
    x = x[(np.abs(x) < _WILD).all(axis=1)]
    if not len(x):
        return np.zeros(3)
    low, high = x.min(axis=0), x.max(axis=0)
    least = np.where(low > 0, low, np.where(high < 0, high, 0.0))
    return np.where(np.abs(least) >= (high - low).max(), least, 0.0)


def origin_of_mesh(mesh: Mesh) -> NDArray[np.floating]:
    """(3,): the origin for the nodes of a mesh's cells; for all of its nodes where it has no cell."""
    used = np.zeros(mesh.n_nodes, bool)
    for block in mesh.blocks:
        used[block.nodes] = True
    return origin_of(mesh.points if used.all() or not used.any() else mesh.points[used])


def from_origin(mesh: Mesh, origin: Floats) -> Mesh:
    """The mesh with its points counted from an origin (3,); itself where that is 0."""
    return replace(mesh, points=mesh.points - origin) if np.any(origin) else mesh


def size_of(mesh: Mesh) -> float:
    """The largest side of the box around the nodes that are not wild; 0 where there is none."""
    x = mesh.points[(np.abs(mesh.points) < _WILD).all(axis=1)]
    return float(np.ptp(x, axis=0).max()) if len(x) else 0.0


def told(x: Iterable[float], size: float, digits: int = 5) -> list[str]:
    """Coordinates in words: to so many digits of the size of what they are of, and of themselves if that is more.

    >>> told([500001.25, 1 / 3, 1e-17], 2.0)
    ['500001.25', '0.33333', '0']
    """
    return [f"{0.0 if abs(v) <= _NOTHING * size else v:.{digits + _more(v, size)}g}" for v in x]


def _more(v: float, size: float) -> int:
    """How many digits stand before those that tell places of a model of some size apart."""
    far = abs(v) / size if size > 0 else 0.0
    return max(0, min(math.ceil(math.log10(far)), 12)) if 1 < far < math.inf else 0
