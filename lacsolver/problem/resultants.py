"""Resultants of loads: of each record of the case, the sum of its forces, of the whole thickness or circle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.problem.loads import Loads
from lacsolver.space.places import where_of
from lacsolver.space.space import Space

#: component of a resultant, relative to the sum of the sizes of its forces, that is round-off
_ROUNDING = 1e-12


class Resultant(NamedTuple):
    """Sum of the forces of one load: its `section` of the case, `where` it acts, its `force` (dim,) and its `moment`.

    The moment is about the origin, of forces at the displaced nodes under finite kinematics: (3,), one number in a
    plane. Where axisymmetric, the force along x is the sum of the radial forces of the full circle, and the moment is
    None.
    """

    section: str
    where: str
    force: tuple[float, ...]
    moment: tuple[float, ...] | float | None = None


def resultants(loads: Loads, t: float, u: Floats | None = None) -> tuple[Resultant, ...]:
    """Return the resultants of all loads at time t and u (n_dof,) but temperatures, whose forces are in balance.

    Springs, supports and forces on rigid bodies are no loads here.
    """
    space, out = loads.space, []
    x = space.mesh.points[:, : space.dim]
    if u is not None and loads.finite:
        x = x + u.reshape(x.shape)
    x = space.own(x.ravel())
    for load in loads.mechanical:
        f = space.own(load.force(t, u))
        force = _total(space, f)
        moment = None if space.model.axisymmetric else _total(space, _moments(space, f, x))
        about = moment if moment is None or len(moment) > 1 else moment[0]
        out.append(Resultant(load.record.SECTION.name, where_of(load.record), force, about))
    return tuple(out)


def _total(space: Space, parts: Floats) -> tuple[float, ...]:
    """Return the sums (k,) of parts (own nodes, k) over all processes, 0 for those that are round-off."""
    sums = space.share.total(np.stack([parts.sum(axis=0), np.abs(parts).sum(axis=0)]))
    return tuple(np.where(np.abs(sums[0]) > _ROUNDING * sums[1].max(), sums[0], 0.0).tolist())


def _moments(space: Space, f: Floats, x: Floats) -> NDArray[np.floating]:
    """Return the moments (k, 3), in a plane (k, 1), about the origin of forces f (k, dim) at x (k, dim)."""
    if space.dim == 3:
        return np.cross(x, f)
    return (x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0])[:, None]
