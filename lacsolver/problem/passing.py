"""Skins that pass through each other in one step, farther than the pairing of its end can see.

A step is solved at its end alone, and the pairing there looks as deep as `looked`. What went farther is on the other
side, without a pressure. So the motion over a step is looked at, linear in between: a point of one skin *passes* a face
of the other that faces it if

    d0 > -L,   d1 < -L,   d0 - d1 > L,   and its place lies in the face where d is 0 (at the start, if d0 < 0)

with d its height above the face, clearance included, at the start and at the end, and L the depth that is looked to, or
half the cell behind the face if that is less. It is no matter where the macro-element is paired at the end with what it
went into: its gap is held there. Bodies that move away, fly past, slide, or stay apart pass nothing, however far they
go in a step. A step in which nothing approaches by more than L ends before anything else is computed.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats, Ints
from lacmesh.surface import Surface, default_distance
from lacmesh.surface.normals import unit
from lacmesh.surface.record import mean_normals
from lacmesh.topology.boxes import meeting
from lacmesh.topology.skin import MAX_CORNERS
from lacsolver.contact import Interface, integrate
from lacsolver.distributed.share import Share
from lacsolver.problem.pair import ContactPair
from lacsolver.space.space import Space
from lacsolver.space.values import evaluate

#: part of a point's depth that its macro-element must see of it at its own points, for its gap to be held there
_SEEN = 0.25
#: how far a place may lie outside a face, relative to the face
_EDGE = 1e-6
#: slave faces whose motion is looked at together
_MANY = 4096


class Passing(NamedTuple):
    """Points that pass in a step: the slave face of each, how deep they are at its end, their L, and where (k, 3)."""

    face: Ints
    depth: Floats
    limit: Floats
    place: Floats

    def take(self, rows: Ints) -> Passing:
        """Return some of the points."""
        return Passing(self.face[rows], self.depth[rows], self.limit[rows], self.place[rows])


_NOTHING = Passing(np.empty(0, np.int64), np.empty(0), np.empty(0), np.empty((0, 3)))


class _Moving(NamedTuple):
    """A skin over a step: its corners at the start and at the end (f, 4, 3), repeated where there are fewer.

    `normals` (2, f, 3) at both ends; `real` (f, 4): False for repeated corners; `limit` (f,): L.
    """

    start: Floats
    end: Floats
    normals: Floats
    real: NDArray[np.bool_]
    limit: Floats

    def take(self, rows: Ints) -> _Moving:
        return _Moving(self.start[rows], self.end[rows], self.normals[:, rows], self.real[rows], self.limit[rows])


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


def passing(joint: ContactPair, face: Interface, x: Floats, t: float, space: Space) -> Passing | None:
    """Return what of a contact passes in a step from nodes at x (n_nodes, 3) to the interface `face` at time t.

    None if nothing passes, for ties, bilateral contact, and contact that is not paired again on deformed skins.
    """
    if not (joint.moving and joint.one_sided):
        return None
    depth = float(looked(joint, face).min(initial=np.inf))
    points = _passed(face.slave, face.master, x, depth, _clearances(joint, t))
    if not space.share.largest(float(len(points.face))):
        return None
    seen = np.where(joint.above_threshold(face), _seen(face, space.share), 0.0)
    points = points.take(np.flatnonzero(_SEEN * points.depth > seen[face.zone.macro[points.face]]))
    if not space.share.largest(float(len(points.face))):
        return None
    stays = _held_throughout(joint, face, x, t, space)[face.zone.macro[points.face]]
    return None if stays.all() else points.take(np.flatnonzero(~stays))


def _held_throughout(joint: ContactPair, face: Interface, x: Floats, t: float, space: Space) -> NDArray[np.bool_]:
    """Return a mask (m,), True for macro-elements that have the master in front of them at both ends of a step.

    Their gap is held at both. A body that turns or folds crosses, on the straight ways that are looked at, others that
    it does not meet.
    """
    before = integrate(joint.zone, space.dim, joint.pairing, x=x, t=t, share=space.share)
    return np.asarray(joint.above_threshold(face) & joint.above_threshold(before))


def words(joint: ContactPair, points: Passing, t: float, space: Space) -> str:
    """Return the sentence for a step, as small as it may be, in which points of a contact pass through."""
    deepest = int(points.depth.argmax())
    place = ", ".join(space.told((points.place[deepest] + space.origin)[: space.dim]))
    message = f"contact {joint.name!r}: in the step to time {t:.6g} {len(np.unique(points.face))} faces of slave "
    message += f"{joint.record.slave!r} pass through master {joint.record.master!r}, by up to "
    message += f"{points.depth[deepest]:.6g} near ({place}), farther than the search depth "
    message += f"{points.limit[deepest]:.6g} there"
    return f"{message}; take more steps ([steps] count) or max_halvings, or a larger search_distance"


def _moving(skin: Surface, x: Floats, depth: float) -> _Moving:
    """Return a skin at its end of a step that started with nodes at x, and is looked behind to a depth."""
    nodes = skin.faces.nodes[:, :MAX_CORNERS]
    real = np.arange(MAX_CORNERS) < skin.n_corners[:, None]
    nodes = np.where(real, nodes, nodes[:, :1])
    normals = np.stack([mean_normals(skin.at(x))[0], mean_normals(skin)[0]])
    return _Moving(x[nodes], skin.x[nodes], normals, real, _limits(skin, depth))


def _limits(skin: Surface, depth: float) -> NDArray[np.floating]:
    """Return L (f,) of the faces of a skin that is looked behind to a depth."""
    return np.asarray(np.fmin(depth, np.where(skin.depth > 0, skin.depth / 2, np.nan)))


def _clearances(joint: ContactPair, t: float) -> NDArray[np.floating]:
    """Return the clearance (slave faces,) at the faces' centres."""
    slave, value = joint.zone.slave, joint.pairing.clearance
    if callable(value):
        return np.asarray(evaluate(value, mean_normals(slave)[1], t, "clearance"))
    return np.full(len(slave), float(value))


def _seen(face: Interface, share: Share) -> NDArray[np.floating]:
    """Return how deep (m,) each macro-element sees its master behind its points, 0 if it is nowhere behind."""
    deepest = np.zeros(face.zone.n_macros)
    np.maximum.at(deepest, face.points.macro, -face.points.ray)
    return share.total(deepest)  # each has points of its own macro-elements alone


def _passed(slave: Surface, master: Surface, x: Floats, depth: float, clearance: Floats) -> Passing:
    """Return the points of both skins that pass a face of the other one, from nodes at x (n_nodes, 3)."""
    least = min(_limits(skin, depth).min(initial=np.inf) for skin in (slave, master))
    ours, theirs = _approaching(slave, master, x, least), _approaching(master, slave, x, least)
    parts = [_NOTHING]
    if len(ours) and len(theirs):
        one, other = _moving(slave.take(ours), x, depth), _moving(master.take(theirs), x, depth)
        for i, j in _near(one, other):
            facing = (one.normals[:, i] * other.normals[:, j]).sum(axis=2).min(axis=0) < 0
            i, j = i[facing], j[facing]
            sides = one.take(i), other.take(j)
            for points, faces in (sides, sides[::-1]):
                pair, deep, place = _crossing(points, faces, clearance[ours[i]])
                parts.append(Passing(ours[i[pair]], deep, faces.limit[pair], place))
    return Passing(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _approaching(skin: Surface, other: Surface, x: Floats, least: float) -> Ints:
    """Return the faces of a skin that move relative to some node of the other one by more than `least`."""
    nodes, theirs = skin.faces.nodes, other.faces.nodes[other.faces.nodes >= 0]
    nodes = np.where(nodes >= 0, nodes, nodes[:, :1])
    moved, by = skin.x[nodes] - x[nodes], other.x[theirs] - x[theirs]
    apart = np.maximum(moved.max(axis=1) - by.min(axis=0), by.max(axis=0) - moved.min(axis=1))
    return np.flatnonzero(np.linalg.norm(apart, axis=1) > least)


def _near(slave: _Moving, master: _Moving) -> Iterator[tuple[Ints, Ints]]:
    """Yield pairs of faces whose boxes over the step meet, some faces of the slave after others.

    Boxes are as the master's mean motion sees them, with an axis along that of the slave: what flies far has thin ones.
    Those of the slave begin L before its start, as it may start in the master.
    """
    ours, theirs = ((k.end - k.start).reshape(-1, 3).mean(axis=0) for k in (slave, master))
    axes = np.linalg.qr(np.column_stack([ours - theirs, np.eye(3)]))[0]
    before = slave.start - np.maximum(slave.limit, master.limit.max())[:, None, None] * slave.normals[0][:, None]
    boxes = []
    for places in ([before, slave.start, slave.end - theirs], [master.start, master.end - theirs]):
        corners = np.concatenate(places, axis=1) @ axes
        boxes.append((corners.min(axis=1), corners.max(axis=1)))
    (low, high), (other_low, other_high) = boxes
    for first in range(0, len(low), _MANY):
        some = slice(first, first + _MANY)
        i, j = meeting(low[some], high[some], other_low, other_high)
        yield i + first, j


def _crossing(points: _Moving, faces: _Moving, clearance: Floats) -> tuple[Ints, Floats, Floats]:
    """Return (pair, depth, place (k, 3)) of points of the first faces (n,) that pass the other faces (n,).

    The points are corners, middles of edges, and centres.
    """
    start, end = (_points(x, points.real) for x in (points.start, points.end))
    out = []
    for corners, there in _simplices(faces):
        n0, n1 = (_normal(x[:, corners]) for x in (faces.start, faces.end))
        d0 = np.einsum("pks,ps->pk", start - faces.start[:, :1], n0) + clearance[:, None]
        d1 = np.einsum("pks,ps->pk", end - faces.end[:, :1], n1) + clearance[:, None]
        L = faces.limit[:, None]
        pair, k = np.nonzero((d0 > -L) & (d1 < -L) & (d0 - d1 > L) & there[:, None])
        d0, d1 = d0[pair, k], d1[pair, k]
        above = np.maximum(d0, 0.0)
        part = above / (above - d1)
        at = start[pair, k] + part[:, None] * (end - start)[pair, k]
        face = faces.start[pair] + part[:, None, None] * (faces.end - faces.start)[pair]
        inside = _inside(at, face[:, corners])
        out.append((pair[inside], -d1[inside], end[pair, k][inside]))
    pairs, depths, places = (np.concatenate(part) for part in zip(*out, strict=True))
    return pairs, depths, places


def _points(x: Floats, real: NDArray[np.bool_]) -> NDArray[np.floating]:
    """Return corners, middles of edges and centres (f, 9, 3) of faces with corners at x (f, 4, 3)."""
    centre = (x * real[..., None]).sum(axis=1, keepdims=True) / real.sum(axis=1)[:, None, None]
    return np.concatenate([x, (x + np.roll(x, -1, axis=1)) / 2, centre], axis=1)


def _simplices(faces: _Moving) -> Iterator[tuple[list[int], NDArray[np.bool_]]]:
    """Yield the corners of the segments or triangles that faces are made of, and the mask of faces that have them."""
    every = np.ones(len(faces.real), bool)
    if not faces.real[:, 2:].any():
        yield [0, 1], every
        return
    yield [0, 1, 2], every
    yield [0, 2, 3], faces.real[:, 3]


def _normal(x: Floats) -> NDArray[np.floating]:
    """Return unit normals (n, 3) of segments (n, 2, 3) in a plane or triangles (n, 3, 3), 0 of degenerate ones."""
    along = x[:, 1] - x[:, 0]
    return unit(np.cross(along, x[:, 2] - x[:, 0] if x.shape[1] == 3 else np.array([0.0, 0.0, 1.0])))


def _inside(x: Floats, corners: Floats) -> NDArray[np.bool_]:
    """Return a mask (n,), True where x (n, 3) lies above or below its segment (n, 2, 3) or triangle (n, 3, 3)."""
    away, edge = x - corners[:, 0], corners[:, 1:] - corners[:, :1]
    G, g = np.einsum("pes,pfs->efp", edge, edge), np.einsum("pes,ps->ep", edge, away)
    if len(G) == 1:
        size, xi = G[0, 0], g
    else:
        size = G[0, 0] * G[1, 1] - G[0, 1] ** 2
        xi = np.stack([G[1, 1] * g[0] - G[0, 1] * g[1], G[0, 0] * g[1] - G[0, 1] * g[0]])
    return np.asarray((xi >= -_EDGE * size).all(axis=0) & (xi.sum(axis=0) <= (1 + _EDGE) * size) & (size > 0))
