"""Normals of a surface: the true one at a point of a face, or nodal ones interpolated ("smoothed").

A smoothed normal at a node is the mean of the normals of the faces that meet there, each weighted with its area (the
manual's 3.3.3.2). Faces that turn from one another by more than the crease angle do not mix: an edge stays an edge.
"""

from __future__ import annotations

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.mesh import Floats
from lacmesh.quadrature import rule
from lacmesh.shapes import jacobian
from lacmesh.surface.record import Surface


def weighted(name: str, x: Floats, X: Floats, dim: int) -> Floats:
    """(k, p, 3): normals of faces with nodes at x (k, n, 3), times the Jacobian, at reference points X."""
    J = jacobian(name, x, X[:, : CELLS[name].dim])
    if dim == 1:
        return np.stack([J[..., 1, 0], -J[..., 0, 0], np.zeros(J.shape[:2])], axis=-1)
    return np.cross(J[..., 0], J[..., 1])


def smoothed(surface: Surface, crease_angle: float) -> Floats:
    """(f, 9, 3): unit normals at the nodes of each face, zero where a face has none. `crease_angle` in degrees."""
    area = np.zeros((len(surface), 3))
    own = np.zeros((len(surface), 9, 3))
    for name, rows, nodes in surface.by_type():
        x = surface.x[nodes]
        X, w = rule(CELLS[name].family, 4)
        area[rows] = np.einsum("fps,p->fs", weighted(name, x, X, surface.dim), w)
        there = weighted(name, x, np.array(CELLS[name].reference), surface.dim)
        own[rows, : nodes.shape[1]] = there
    size = np.linalg.norm(own, axis=2, keepdims=True)
    own = np.divide(own, size, out=np.zeros_like(own), where=size > 0)
    total = _gather(surface, own, np.linalg.norm(area, axis=1), np.cos(np.radians(crease_angle)))
    size = np.linalg.norm(total, axis=2, keepdims=True)
    return np.divide(total, size, out=own, where=size > 1e-300)


def _gather(surface: Surface, own: Floats, area: Floats, least: float) -> Floats:
    """Sum, over the faces at each node of each face, of area times normal; only of those within the crease angle."""
    there = surface.faces.nodes >= 0
    face, place = np.nonzero(there)
    node = surface.faces.nodes[there]
    order = np.argsort(node, kind="stable")
    face, place, node = face[order], place[order], node[order]
    normal, weight = own[face, place], area[face]
    total = np.zeros_like(normal)
    start = np.searchsorted(node, node)
    stop = np.searchsorted(node, node, side="right")
    rows, other = np.arange(len(node)), start
    while len(rows):
        close = (normal[rows] * normal[other]).sum(axis=1) >= least - 1e-12
        total[rows] += np.where(close, weight[other], 0.0)[:, None] * normal[other]
        more = other + 1 < stop[rows]  # only those go on: a pole where many faces meet costs no more than its own
        rows, other = rows[more], other[more] + 1
    out = np.zeros_like(own)
    out[face, place] = total
    return out
