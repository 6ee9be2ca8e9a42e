"""The start of a pair: overlap of the bodies and its depth, and how much of the slave has a master in front of it.

A ray goes from a point of the slave backwards along its normal. If the point is inside the master's body, the ray
leaves it: the first face of that body's skin that it meets has its outward normal in the direction of the ray. A
macro-element inside the body that finds no master within the search depth is an error, not an unpaired macro-element.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.checks.findings import named
from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Coverage, Surface, contact_points, coverage
from lacmesh.topology.facets import boundary_faces
from lacmesh.topology.skin import Faces
from lacsolver.contact import Interface
from lacsolver.contact.interface import positions
from lacsolver.doubts.run import Doubt, Run, Watching
from lacsolver.equilibrium.state import CONTACT, UNPAIRED
from lacsolver.problem.pair import ContactPair
from lacsolver.problem.passing import looked
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
_FACES = "check which groups these are and that their faces turn outward"


# ---- values of the undeformed pairs


def deepest_overlap(run: Run, pair: ContactPair) -> float:
    """Return the deepest overlap of the undeformed skins of a pair, clearance included; 0 if nothing overlaps."""
    deepest = run.space.share.largest(max(0.0, -float(run.face(pair).distance.min(initial=0.0))))
    return deepest if deepest > _ROUNDING * run.space.extent else 0.0


def widest_gap(run: Run, pair: ContactPair) -> float:
    """Return the widest gap or overlap of the mesh across a pair; 0 for round-off."""
    widest = run.space.share.largest(float(np.abs(run.face(pair).points.gap).max(initial=0.0)))
    return widest if widest > _ROUNDING * run.space.extent else 0.0


def covered_part(face: Interface) -> float:
    """Return the part of the slave's area that has the master in front of it."""
    return float(face.w.sum() / face.area.sum())


# ---- rules


def inside(run: Run) -> Iterator[Doubt]:
    """Refuse pairs with macro-elements without a master inside its body, deeper than the search depth."""
    for pair in run.pairs:
        face, space = run.face(pair), run.space
        depth = depths(pair, face, space)
        deep = np.flatnonzero(depth > looked(pair, face))
        if not len(deep):
            continue
        worst = deep[depth[deep].argmax()]
        place = ", ".join(space.told(face.centre[worst] + space.origin[: space.dim]))
        message = f"{len(deep)} macro-elements of slave {pair.record.slave!r} lie inside the body of master "
        message += f"{pair.record.master!r}, deeper than max_penetration: by up to {depth[worst]:.6g}, near ({place})"
        advice = "move the bodies apart, or set max_penetration above that, and well below the bodies' thickness"
        yield Doubt(named(f"{message}; {advice}", "wrong-side"), pair.record, fatal=True)


def facing(run: Run) -> Iterator[Doubt]:
    """Refuse pairs of which no macro-element has a master, if they are not paired again on deformed skins."""
    for pair in run.pairs:
        if not pair.moving and not pair.above_threshold(run.face(pair)).any():
            message = f"no face of slave {pair.record.slave!r} has master {pair.record.master!r} in front of it"
            yield Doubt(named(f"{message}; {_FACES}, or raise search_distance", "no-coverage"), pair.record, fatal=True)


def across_a_gap(run: Run) -> Iterator[Doubt]:
    """Doubt ties across a wide gap. Of several processes the one that has the widest gap yields."""
    for pair in run.pairs:
        if not pair.tie:
            continue
        face, record, space = run.face(pair), pair.record, run.space
        gap, size = np.abs(face.points.gap), face.length[face.points.macro]
        k = int(gap.argmax()) if len(gap) else -1
        widest = widest_gap(run, pair)
        if k < 0 or not widest or gap[k] < widest or gap[k] <= _WIDE * size[k]:
            continue
        place = ", ".join(space.told(positions(face.slave, face.points)[k] + space.origin))
        message = f"tie {record.name!r} joins slave {record.slave!r} to master {record.master!r} across a gap of up to "
        message += f"{gap[k]:.4g}, {gap[k] / size[k]:.2g} of a macro-element's size, near ({place})"
        advice = "move the bodies together, or set search_distance below the gap if they are not joined there"
        yield Doubt(named(f"{message}; {advice}", "gap"), record)


def overlapping(run: Run) -> Iterator[Doubt]:
    """Doubt overlaps of the mesh that neither a clearance nor max_penetration asks for.

    Of several processes the one that has the deepest point yields.
    """
    for pair in run.pairs:
        if pair.tie or pair.pairing.max_penetration is not None:
            continue
        face, record, space = run.face(pair), pair.record, run.space
        points, size = face.points, face.length[face.points.macro]
        depth = np.minimum(-points.gap, -face.distance)  # with a negative clearance that of the mesh, else what is left
        ratio = np.divide(depth, size, out=np.zeros_like(depth), where=size > 0)
        worst = float(ratio.max(initial=0.0))
        if not _DOUBTED < space.share.largest(worst) <= worst:
            continue
        k = int(ratio.argmax())
        place = ", ".join(space.told(positions(face.slave, points)[k] + space.origin))
        message = f"slave {record.slave!r} overlaps master {record.master!r} by {depth[k]:.4g} in the mesh, "
        message += f"{worst:.2g} of a macro-element's size, near ({place}), which contact would remove by pressure"
        advice = "move the bodies apart or give a clearance, or, if the overlap is intended, "
        yield Doubt(named(f"{message}; {advice}set max_penetration above it", "gap"), record)


def covered(run: Run) -> Iterator[Doubt]:
    """Doubt pairs with a master in front of a small part of the slave, if they are paired once only."""
    for pair in run.pairs:
        if not pair.moving:
            yield from _scarcely_covered(pair, covered_part(run.face(pair)))


def _scarcely_covered(pair: ContactPair, part: float) -> Iterator[Doubt]:
    """Yield a doubt about a slave of which a master is in front of less than half, and of some."""
    if 0 < part < _HALF:
        slave, master = pair.record.slave, pair.record.master
        message = f"master {master!r} is in front of {100 * part:.3g} % of slave {slave!r}, less than half of it"
        advice = "name as slave the faces that may come into contact, or exchange slave and master"
        advice += ", or raise search_distance if they are farther apart"
        yield Doubt(named(f"{message}; {advice}", "partial-coverage"), pair.record)


class Covered(Watching):
    """Doubts pairs that are paired again, with a master in front of a small part of the slave in all steps, or of none.

    A ball that touches a plane has most of its skin away from it, as it should: a contact is covered.
    """

    def __init__(self, run: Run) -> None:
        self._part = {pair.name: 0.0 for pair in run.pairs if pair.moving}

    def look(self, run: Run) -> None:
        """Keep the largest part of each slave that is covered, 1 once it has been in contact."""
        for pair, zone in run.zones:
            if pair.moving and (zone.status != UNPAIRED).any():
                touches = (zone.status >= CONTACT).any()
                part = 1.0 if touches else float((zone.area * zone.coverage).sum() / zone.area.sum())
                self._part[pair.name] = max(self._part[pair.name], part)

    def __call__(self, run: Run) -> Iterator[Doubt]:
        """Yield a doubt about each slave that was scarcely covered, or never."""
        for pair, _ in run.zones:
            part = self._part.get(pair.name, 1.0)
            yield from _scarcely_covered(pair, part)
            if part == 0.0:
                message = f"slave {pair.record.slave!r} never had master {pair.record.master!r} in front of it"
                yield Doubt(f"{message}; {_FACES}, or raise search_distance", pair.record)


# ---- depth in a body


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
