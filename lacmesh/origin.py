"""Coordinates relative to a point of the model, so that results do not depend on where the model lies.

Products of coordinates far from 0 lose the digits that distinguish two nodes. So computations use `from_origin(mesh)`,
while positions and formulas that users read or write are in the coordinates of the mesh itself. The origin is chosen
such that subtracting it loses no digit: for coordinates between c and 2 c the difference to c is exact (Sterbenz), and
a model that is nearer to 0 than it is large keeps its coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Mesh, mask_of

#: coordinates beyond this are wild: their squares are not finite
_WILD = 1e150
#: what is left of a coordinate that is 0 but for rounding, of the size of what it is of
_NOTHING = 1e-9


def origin_of(x: Floats) -> NDArray[np.floating]:
    """(3,): the origin for points x (n, 3): along each axis the coordinate nearest to 0, or 0 itself.

    It is 0 along an axis on which the points come nearer to 0 than their largest extent. Points with coordinates that
    are not finite, or huge, are ignored.

    >>> origin_of(np.array([[5e5, 1.0, 0.0], [5e5 + 2, 3.0, 0.0]])).tolist()
    [500000.0, 0.0, 0.0]
    """
    low, high = bounds_of(x)
    least = np.where(low > 0, low, np.where(high < 0, high, 0.0))
    return np.where(np.abs(least) >= (high - low).max(), least, 0.0)


def origin_of_mesh(mesh: Mesh) -> NDArray[np.floating]:
    """(3,): the origin for the nodes of a mesh's cells, or for all its nodes if it has no cell."""
    return origin_of(bounds_of_mesh(mesh))


def bounds_of(x: Floats) -> NDArray[np.floating]:
    """(2, 3): the lower and the upper corner of the box of points x (n, 3), or zeros if there are none.

    Points with coordinates that are not finite, or huge, are ignored.
    """
    tame = np.abs(x) < _WILD
    if not tame.all():
        x = x[tame.all(axis=1)]
    if not len(x):
        return np.zeros((2, 3))
    return np.array([[reduce(column) for column in x.T] for reduce in (np.min, np.max)])  # quicker than axis=0


def bounds_of_mesh(mesh: Mesh) -> NDArray[np.floating]:
    """(2, 3): the corners of the box of the nodes of a mesh's cells, or of all its nodes if it has no cell."""
    used = mask_of(mesh.n_nodes, *(block.nodes for block in mesh.blocks))
    return bounds_of(mesh.points if used.all() or not used.any() else mesh.points[used])


def from_origin(mesh: Mesh, origin: Floats) -> Mesh:
    """Return the mesh with its points relative to an origin (3,); the mesh itself if that is 0."""
    return replace(mesh, points=mesh.points - origin) if np.any(origin) else mesh


def size_of(mesh: Mesh) -> float:
    """Largest side of the bounding box of the nodes, without those whose coordinates are not finite or huge; or 0."""
    x = mesh.points[(np.abs(mesh.points) < _WILD).all(axis=1)]
    return float(np.ptp(x, axis=0).max()) if len(x) else 0.0


def format_coordinates(x: Iterable[float], size: float, digits: int = 5) -> list[str]:
    """Format coordinates to `digits` significant digits of the model's size, or of themselves if they are smaller.

    >>> format_coordinates([500001.25, 1 / 3, 1e-17], 2.0)
    ['500001.25', '0.33333', '0']
    """
    return [f"{0.0 if abs(v) <= _NOTHING * size else v:.{digits + _more(v, size)}g}" for v in x]


def _more(v: float, size: float) -> int:
    """Number of additional digits for a coordinate v that is larger than the size of the model; 12 at most."""
    far = abs(v) / size if size > 0 else 0.0
    return max(0, min(math.ceil(math.log10(far)), 12)) if 1 < far < math.inf else 0
