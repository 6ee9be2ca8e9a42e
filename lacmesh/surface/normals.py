"""Normals of a surface: the true one at a point of a face, or interpolated nodal ones ("smoothed").

Over a face with the normal N, the tangents t_k and their dual vectors a^k, the smooth surface (`maps`) has the normal

    n = m / |m|,   m = N - a^k s_k

with slopes s_k: db/dxi^k for a height b along N, or those of the exact shape, -n.t_k / n.N.

Or they are the master's smoothed ones, turned round.

A smoothed normal at a node is the area-weighted mean of the normals of the faces that meet there (the manual's
3.3.3.2). Faces whose normals differ by more than the crease angle are not averaged: an edge remains an edge. The
undeformed surface decides: normals would jump as an angle passes the limit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats, Ints
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian
from lacmesh.surface.maps import NormalMaps, interpolated, padded_nodes, slopes, values
from lacmesh.surface.record import Surface

#: degrees; edges at which the normal turns by more are sharp where no other angle is given
CREASE_ANGLE = 40.0


def weighted(name: str, x: Floats, X: Floats) -> Floats:
    """(k, p, 3): normals of faces with nodes at x (k, n, 3), times the Jacobian, at reference points X."""
    return normals_of(jacobian(name, x, X[:, : CELLS[name].dim]))


def normals_of(J: Floats) -> Floats:
    """(..., 3): normals from tangents J (..., 3, 1 or 2); their length is the Jacobian."""
    if J.shape[-1] == 1:
        return np.stack([J[..., 1, 0], -J[..., 0, 0], np.zeros(J.shape[:-2])], axis=-1)
    (ax, bx), (ay, by), (az, bz) = np.moveaxis(J, (-2, -1), (0, 1))  # np.cross takes several times as long
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def measures(G: Floats, face: Ints, xi: Floats, dim: int, axisymmetric: bool) -> NDArray[np.floating]:
    """(n,): area (length if `dim` is 1) of faces with maps G (f, 9, 3) over that in reference coordinates, at points.

    In axisymmetry it is times the radius.
    """
    size = np.linalg.norm(normals_of(slopes(G, face, xi, dim)), axis=-1)
    return np.asarray(size * values(G[..., :1], face, xi)[:, 0] if axisymmetric else size)


def unit(v: Floats) -> NDArray[np.floating]:
    """Return vectors (..., k) over their lengths; 0 for those without one."""
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.divide(v, size, out=np.zeros_like(v), where=size > 0)


def dual_vectors(J: Floats) -> NDArray[np.floating]:
    """Return the dual vectors of tangents J (..., 3, 1 or 2), of that shape; 0 where a face is degenerate."""
    N = normals_of(J)
    crossed = J if J.shape[-1] == 1 else np.stack([np.cross(J[..., 1], N), np.cross(N, J[..., 0])], axis=-1)
    area = (N * N).sum(axis=-1)[..., None, None]
    return np.divide(crossed, area, out=np.zeros_like(J), where=area > 0)


def smooth_normals(J: Floats, lean: Floats) -> NDArray[np.floating]:
    """(..., 3): unit normals of the smooth surface over faces with tangents J (..., 3, k).

    `lean` (..., k): its slopes to the faces.
    """
    return unit(unit(normals_of(J)) - (dual_vectors(J) * lean[..., None, :]).sum(axis=-1))


def normal_maps(slave: Surface, master: Surface, normals: str, crease_angle: float | None) -> NormalMaps:
    """Return the maps that the normals of contact follow from; arguments as in `lacmesh.contact_points`."""
    if normals == "master":
        return NormalMaps(interpolated(master.faces.type, -smoothed(master, crease_angle)), True)
    if normals == "smoothed":
        return NormalMaps(interpolated(slave.faces.type, smoothed(slave, crease_angle)))
    return NormalMaps.none() if slave.height is None else NormalMaps(slave.height.leans)


def turning(maps: NormalMaps, n: int) -> NDArray[np.bool_]:
    """(n,): True for slave faces whose normals are not the faces' own, by their `normal_maps`."""
    if maps.are_normals:
        return np.ones(n, bool)
    return (maps.G != 0).any(axis=(1, 2)) if len(maps.G) else np.zeros(n, bool)


def smoothed(surface: Surface, crease_angle: float | None) -> Floats:
    """(f, 9, 3): smoothed unit normals at the nodes of each face, padded with 0.

    `crease_angle` in degrees; None: 40, and faces that the surface's height takes as one shape are averaged at any
    angle.
    """
    area = np.zeros((len(surface), 3))
    for name, rows, nodes in surface.by_type():
        X, w = rule(CELLS[name].family, 4)
        area[rows] = np.einsum("fps,p->fs", weighted(name, surface.x[nodes], X), w)
    own = _own_normals(surface)
    place, other = crease_pairs(surface, crease_angle)
    total: Floats = np.zeros_like(own)
    weight = np.linalg.norm(area, axis=1)[other // own.shape[1]]
    np.add.at(total.reshape(-1, 3), place, weight[:, None] * own.reshape(-1, 3)[other])
    size = np.linalg.norm(total, axis=2, keepdims=True)
    return np.divide(total, size, out=own, where=size > 1e-300)


def _own_normals(surface: Surface) -> Floats:
    """(f, 9, 3): true unit normals at the nodes of each face, padded with 0."""
    own: Floats = np.zeros((len(surface), 9, 3))
    for name, rows, nodes in surface.by_type():
        own[rows, : nodes.shape[1]] = smooth_normals(*at_nodes(surface, name, rows, surface.x[nodes]))
    return own


def at_nodes(surface: Surface, name: str, rows: Ints, x: Floats) -> tuple[Floats, Floats]:
    """Return the tangents at the nodes of faces of one type, (k, n, 3, dim), and the slopes of normals (k, n, dim).

    `rows` (k,): the faces; `x` (k, n, 3): their nodes.
    """
    X, dim = padded_nodes(name), CELLS[name].dim
    lean = surface.leans(np.repeat(rows, len(X)), np.tile(X, (len(rows), 1)))
    return jacobian(name, x, X[:, :dim]), lean.reshape(len(rows), len(X), dim)


def crease_pairs(surface: Surface, crease_angle: float | None) -> tuple[Ints, Ints]:
    """(k,) each: pairs of positions 9 f + a (node a of face f), of a smoothed normal and of one that contributes to it.

    `crease_angle` as in `smoothed`.
    """
    own = _own_normals(surface.undeformed)
    least = np.cos(np.radians(CREASE_ANGLE if crease_angle is None else crease_angle))
    face, corner = np.nonzero(surface.faces.nodes >= 0)
    node = surface.faces.nodes[face, corner]
    order = np.argsort(node, kind="stable")
    place, node = (face * own.shape[1] + corner)[order], node[order]
    start, stop = (np.searchsorted(node, node, side) for side in ("left", "right"))
    count = stop - start
    one = np.repeat(np.arange(len(node)), count)
    two = np.arange(len(one)) + np.repeat(start - np.cumsum(count) + count, count)
    one, two, normal = place[one], place[two], own.reshape(-1, own.shape[2])
    close = (normal[one] * normal[two]).sum(axis=1) >= least - 1e-12
    if crease_angle is None and surface.height is not None and surface.height.taken is not None:
        a, b = (surface.height.taken[rows // own.shape[1]] for rows in (one, two))
        close |= (a == b) & (a >= 0)
    return one[close], two[close]
