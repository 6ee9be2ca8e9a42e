"""Local axes of a record of the case: directions of its components at nodes, Cartesian or cylindrical."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints
from lacsolver.case.entry import Entry
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: distance from the axis of cylindrical axes, relative to the bodies' extent, below which a node is on it
_ON_AXIS = 1e-9


def directions(space: Space, record: Entry, nodes: Ints) -> NDArray[np.floating]:
    """Return the unit directions (k, dim, dim) of a record's components at nodes (k,), one a row.

    Without `axes` they are those of the mesh. Raises CaseError for a node on the axis of cylindrical ones.
    """
    axes: Mapping[str, Any] | None = getattr(record, "axes", None)
    if axes is None:
        return np.tile(np.eye(space.dim), (len(nodes), 1, 1))
    if "axis" not in axes:
        return np.tile(cartesian(axes, space.dim), (len(nodes), 1, 1))
    rows, radius = cylindrical(axes, space.mesh.points[nodes])
    on = radius <= _ON_AXIS * space.extent
    if on.any():
        numbers = some(space.mesh.node_number[nodes[on]])
        raise wrong(record, f"nodes {numbers} are on the axis of its axes, where r and theta have no direction")
    return rows[:, : space.dim, : space.dim]


def cylindrical(axes: Mapping[str, Any], x: Floats) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the directions r, theta, z (k, 3, 3) of cylindrical axes at points x (k, 3), and their radii (k,).

    On the axis, where the radius is 0, r and theta are 0.
    """
    z, origin = np.array(axes["axis"]) / np.linalg.norm(axes["axis"]), np.zeros(3)
    origin[: len(axes["origin"])] = axes["origin"]
    arm = x - origin
    arm -= (arm @ z)[:, None] * z
    radius = np.linalg.norm(arm, axis=1)
    r = arm / np.where(radius > 0, radius, 1.0)[:, None]
    return np.stack([r, np.cross(z, r), np.broadcast_to(z, r.shape)], axis=1), radius


def cartesian(axes: Mapping[str, Any] | None, dim: int) -> NDArray[np.floating]:
    """Return the directions (dim, dim) of Cartesian axes, one a row; in a plane y is where x turns to.

    >>> cartesian({"x": (0.0, 2.0)}, 2).tolist()
    [[0.0, 1.0], [-1.0, 0.0]]
    """
    if axes is None:
        return np.eye(dim)
    x = np.array(axes["x"], float)
    x /= np.linalg.norm(x)
    if "xy" not in axes:
        return np.array([x, [-x[1], x[0]]])
    y = np.array(axes["xy"]) - (x @ np.array(axes["xy"])) * x
    y /= np.linalg.norm(y)
    return np.array([x, y]) if dim == 2 else np.array([x, y, np.cross(x, y)])
