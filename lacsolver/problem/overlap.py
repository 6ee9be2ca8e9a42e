"""Overlap: how deep a slave lies behind its master, and macro-elements that lie inside the master's body unseen.

From a point of the slave a line goes back along its normal, and leaves the master's body where it was inside: what it
meets first then is a face of that body's skin which is turned the same way as the line. A macro-element that is inside,
and finds no master as deep as it may look, is not just without a master.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.checks.facets import Facets
from lacmesh.mesh import Ints, Mesh
from lacmesh.surface import Coverage, Surface, contact_points, coverage, default_distance
from lacmesh.topology.faces import facets_of
from lacmesh.topology.skin import Match
from lacsolver.contact import Interface
from lacsolver.problem.problem import Joint
from lacsolver.problem.rigid_modes import bodies
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: part of a macro-element that must be inside, or face the master
_MOST = 0.5


def deepest(face: Interface) -> float:
    """How far the slave lies behind the master where it lies deepest, the clearance in it; 0 where nothing overlaps."""
    return max(0.0, -float(face.distance.min(initial=0.0)))


def check_overlap(joint: Joint, face: Interface, space: Space) -> None:
    """Raises CaseError where macro-elements that find no master lie inside its body, deeper than it is looked for."""
    depth = depths(joint, face, space)
    deep = np.flatnonzero(depth > _looked(joint, face))
    if not len(deep):
        return
    worst = deep[depth[deep].argmax()]
    place = ", ".join(space.told(face.centre[worst] + space.origin[: space.dim]))
    message = f"{len(deep)} macro-elements of slave {joint.record.slave!r} lie inside the body of master "
    message += f"{joint.record.master!r}, deeper than a master is looked for: by up to {depth[worst]:.6g}, "
    message += f"near ({place})"
    advice = "move the bodies apart, or set max_penetration above that, and well below the bodies' thickness"
    raise wrong(joint.record, f"{message}; {advice}")


def depths(joint: Joint, face: Interface, space: Space) -> NDArray[np.floating]:
    """(m,): how deep macro-elements that hardly face the master lie inside its body; 0 for those that do not.

    Nothing is said (0) of a master that has no body, and of one that is the slave's own.
    """
    alone = (face.coverage < _MOST) & (not joint.tie)
    skin = _skin_behind(face, space) if alone.any() else None
    if skin is None:
        return np.zeros(len(alone))
    macro = np.where(alone[face.zone.macro], face.zone.macro, -1)
    other = skin.turned_over(np.arange(len(skin)))
    out, into = (_met(face.slave, one, macro, len(alone)) for one in (skin, other))
    first = np.where(into.ratio > _MOST, -into.mean_gap, np.inf)  # a line that enters the body before was outside
    depth = np.where(out.ratio > _MOST, -out.mean_gap, 0.0)
    return np.where(depth < first, depth, 0.0)


def _looked(joint: Joint, face: Interface) -> NDArray[np.floating]:
    """(m,): how far behind each macro-element a master was looked for, at least."""
    zone, given = face.zone, joint.pairing.max_penetration
    if given is None and joint.moving:
        given = joint.pairing.search_distance or default_distance(zone.slave, zone.master, zone.macro)
    if given is not None:
        return np.full(zone.n_macros, given)
    out = np.zeros(zone.n_macros)
    np.maximum.at(out, zone.macro, np.where(zone.slave.depth > 0, zone.slave.depth, zone.slave.size) / 2)
    return out


def _met(slave: Surface, skin: Surface, macro: Ints, n: int) -> Coverage:
    """What a skin is to the slave behind it, however deep."""
    far = float(np.ptp(np.concatenate([slave.x, skin.x]), axis=0).sum())
    found = contact_points(slave, skin, macro=macro, search_distance=0.0, max_penetration=far)
    made = coverage(found, slave, macro)
    more: dict[str, Any] = {k: np.pad(v, (0, n - len(v)), constant_values=np.nan) for k, v in vars(made).items()}
    return Coverage(**more)


def _skin_behind(face: Interface, space: Space) -> Surface | None:
    """The skin of the bodies that the master is on, where they stand; None if it is on none, or on the slave's."""
    body = bodies(space)
    theirs, ours = (np.unique(body[s.faces.nodes[:, 0]]) for s in (face.master, face.slave))
    theirs = theirs[theirs >= 0]
    if not len(theirs) or np.intersect1d(theirs, ours).size:
        return None
    skin = _whole_skin(space.local)
    mine = np.isin(body[skin.faces.nodes[:, 0]], theirs)
    return skin.take(np.flatnonzero(mine)).at(face.master.x)


def _whole_skin(mesh: Mesh) -> Surface:
    """The skin of all cells of the highest dimension, turned outward."""
    facets = Facets.of(mesh)
    rows, facet = facets.boundary
    cell = facets.solid.cells[rows].astype(np.int64)
    faces = facets_of(mesh, Match(np.arange(len(cell)), cell, facet.astype(np.int64), np.ones(len(cell), bool)))
    return Surface(mesh.points, faces, cell, mesh.dim - 1, np.full(len(cell), np.nan))
