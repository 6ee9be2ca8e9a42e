"""The start of a zone: overlap of the bodies and its depth, and how much of the slave has a master in front of it.

A ray goes from a point of the slave backwards along its normal. If the point is inside the master's body, the ray
leaves it: the first face of that body's skin that it meets has its outward normal in the direction of the ray. A
macro-element inside the body that finds no master within the search depth is an error, not an unpaired macro-element.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.checks.findings import named
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Coverage, Surface, contact_points, coverage, default_distance
from lacmesh.topology.facets import boundary_faces
from lacmesh.topology.skin import Faces
from lacsolver.contact import Interface
from lacsolver.contact.interface import positions
from lacsolver.problem.pair import ContactPair
from lacsolver.space.places import wrong
from lacsolver.space.space import Space

#: fraction of a macro-element that must be inside, or face the master
_MOST = 0.5
#: overlap, relative to the extent of the bodies, that is round-off
_ROUNDING = 1e-13
#: overlap of a mesh, relative to the size of a macro-element, from which it is doubted
_DOUBTED = 0.1
#: gap across a tie, relative to the size of a macro-element, from which it is doubted
_WIDE = 0.1
#: fraction of a slave that a master should be in front of
_HALF = 0.5


class Start(NamedTuple):
    """A zone at the start: its deepest `overlap`, clearance included, the fraction `covered` of the slave, warnings.

    `bridged`: the widest gap across a tie, NaN for contact.
    """

    overlap: float
    covered: float
    told: tuple[str, ...]
    bridged: float = float("nan")


def start_of(joint: ContactPair, face: Interface, space: Space) -> Start:
    """Return what is known of a zone from its interface in the undeformed configuration.

    A zone that is paired again on deformed skins may be covered later: its coverage is not warned of here.
    """
    covered = float(face.w.sum() / face.area.sum())
    bridged, doubts = _bridged(joint, face, space) if joint.tie else (np.nan, [*_doubted_overlap(joint, face, space)])
    doubts += [] if joint.moving else scarcely_covered(joint, covered)
    overlap = space.share.largest(deepest(face))
    return Start(overlap if overlap > _ROUNDING * space.extent else 0.0, covered, tuple(doubts), bridged)


def deepest(face: Interface) -> float:
    """Return the largest penetration of the slave into the master, with the clearance; 0 if nothing overlaps."""
    return max(0.0, -float(face.distance.min(initial=0.0)))


def scarcely_covered(joint: ContactPair, covered: float) -> Iterator[str]:
    """Yield a warning for a slave of which a master is in front of less than half, and of some."""
    if 0 < covered < _HALF:
        slave, master = joint.record.slave, joint.record.master
        message = f"master {master!r} is in front of {100 * covered:.3g} % of slave {slave!r}, less than half of it"
        advice = "name as slave the faces that may come into contact, or exchange slave and master"
        advice += ", or raise search_distance if they are farther apart"
        yield named(f"{message}; {advice}", "partial-coverage")


def _doubted_overlap(joint: ContactPair, face: Interface, space: Space) -> Iterator[str]:
    """Yield a warning for an overlap of the mesh that neither a clearance nor max_penetration asks for.

    Of several processes the one that has the deepest point tells.
    """
    if joint.pairing.max_penetration is not None:
        return
    points = face.points
    depth = np.minimum(-points.gap, -face.distance)  # with a negative clearance that of the mesh, else what is left
    ratio = np.divide(depth, face.length[points.macro], out=np.zeros_like(depth), where=face.length[points.macro] > 0)
    worst = float(ratio.max(initial=0.0))
    if worst <= _DOUBTED or worst < space.share.largest(worst):
        return
    k = int(ratio.argmax())
    place = ", ".join(space.told(positions(face.slave, points)[k] + space.origin))
    message = f"slave {joint.record.slave!r} overlaps master {joint.record.master!r} by {depth[k]:.4g} in the mesh, "
    message += f"{worst:.2g} of a macro-element's size, near ({place}), which contact would remove by pressure"
    advice = "move the bodies apart or give a clearance, or, if the overlap is intended, set max_penetration above it"
    yield named(f"{message}; {advice}", "gap")


def _bridged(joint: ContactPair, face: Interface, space: Space) -> tuple[float, list[str]]:
    """Return the widest gap or overlap across a tie, and a warning where it is wide; 0 for round-off.

    Of several processes the one that has the widest gap tells.
    """
    points, record = face.points, joint.record
    gap = np.abs(points.gap)
    widest = space.share.largest(float(gap.max(initial=0.0)))
    if widest <= _ROUNDING * space.extent:
        return 0.0, []
    size = face.length[points.macro]
    k = int(gap.argmax()) if len(gap) else -1
    if k < 0 or gap[k] < widest or gap[k] <= _WIDE * size[k]:
        return widest, []
    place = ", ".join(space.told(positions(face.slave, points)[k] + space.origin))
    message = f"tie {record.name!r} joins slave {record.slave!r} to master {record.master!r} across a gap of up to "
    message += f"{gap[k]:.4g}, {gap[k] / size[k]:.2g} of a macro-element's size, near ({place})"
    advice = "move the bodies together, or set search_distance below the gap if they are not joined there"
    return widest, [named(f"{message}; {advice}", "gap")]


def check_overlap(joint: ContactPair, face: Interface, space: Space) -> None:
    """Raise CaseError if macro-elements without a master lie inside its body, deeper than the search depth."""
    depth = depths(joint, face, space)
    deep = np.flatnonzero(depth > looked(joint, face))
    if not len(deep):
        return
    worst = deep[depth[deep].argmax()]
    place = ", ".join(space.told(face.centre[worst] + space.origin[: space.dim]))
    message = f"{len(deep)} macro-elements of slave {joint.record.slave!r} lie inside the body of master "
    message += f"{joint.record.master!r}, deeper than max_penetration: by up to {depth[worst]:.6g}, "
    message += f"near ({place})"
    advice = "move the bodies apart, or set max_penetration above that, and well below the bodies' thickness"
    raise wrong(joint.record, named(f"{message}; {advice}", "wrong-side"))


def depths(joint: ContactPair, face: Interface, space: Space) -> NDArray[np.floating]:
    """Return the depth (m,) in the master's body of macro-elements that hardly face the master; 0 for the others.

    All depths are 0 for a tie, for a master without a body, and for one on the slave's own body.
    """
    alone = (face.coverage < _MOST) & (not joint.law.all_components)
    skin = _skin_behind(face, space) if alone.any() else None
    if skin is None:
        return np.zeros(len(alone))
    macro = np.where(alone[face.zone.macro], face.zone.macro, -1)
    other = skin.turned_over(np.arange(len(skin)))
    out, into = (_met(face.slave, one, macro, len(alone)) for one in (skin, other))
    first = np.where(into.ratio > _MOST, -into.mean_gap, np.inf)  # a ray that enters the body first started outside
    depth = np.where(out.ratio > _MOST, -out.mean_gap, 0.0)
    return np.where(depth < first, depth, 0.0)


def looked(joint: ContactPair, face: Interface) -> NDArray[np.floating]:
    """Return a lower bound (m,) of the depth behind each macro-element to which a master was searched for."""
    zone, given = face.zone, joint.pairing.max_penetration
    if given is None and joint.moving:
        given = joint.pairing.search_distance or default_distance(zone.slave, zone.master, zone.macro)
    if given is not None:
        return np.full(zone.n_macros, given)
    out = np.zeros(zone.n_macros)
    np.maximum.at(out, zone.macro, np.where(zone.slave.depth > 0, zone.slave.depth, zone.slave.size) / 2)
    return out


def _met(slave: Surface, skin: Surface, macro: Ints, n: int) -> Coverage:
    """Return the coverage of the slave's macro-elements by a skin behind them, at any depth."""
    far = float(np.ptp(np.concatenate([slave.x, skin.x]), axis=0).sum())
    points = contact_points(slave, skin, macro=macro, search_distance=0.0, max_penetration=far)
    met = coverage(points, slave, macro)
    more: dict[str, Any] = {k: np.pad(v, (0, n - len(v)), constant_values=np.nan) for k, v in vars(met).items()}
    return Coverage(**more)


def _skin_behind(face: Interface, space: Space) -> Surface | None:
    """Return the deformed skin of the bodies that the master is on; None if it is on none, or on the slave's."""
    body = space.bodies
    theirs, ours = (np.unique(body[s.faces.nodes[:, 0]]) for s in (face.master, face.slave))
    theirs = theirs[theirs >= 0]
    if not len(theirs) or np.intersect1d(theirs, ours).size:
        return None
    faces, cell = boundary_faces(space.local)
    mine = np.flatnonzero(np.isin(body[faces.nodes[:, 0]], theirs))
    return _of_all(faces.take(mine), cell[mine], face.master.x, space)


def _of_all(faces: Faces, cell: Ints, x: Floats, space: Space) -> Surface:
    """Return the surface of faces with nodes at x (n_nodes, 3), of all processes: each gives those of its own nodes."""
    share = space.share
    if share.own is not None:
        own = np.flatnonzero(share.own[faces.nodes[:, 0]])  # all cells at these are here, so that the skin is true
        types, used, places = (share.gather(v[own]) for v in (faces.type, faces.nodes >= 0, x[faces.nodes]))
        nodes = np.where(used, np.arange(used.size).reshape(used.shape), -1)
        faces, cell, x = Faces(types, nodes), np.zeros(len(types), np.int64), places.reshape(-1, 3)
    return Surface(x, faces, cell, space.dim - 1, np.full(len(cell), np.nan))
