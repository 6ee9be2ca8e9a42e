"""Healthy meshes of other shapes than a block: bent, closed, twisted, warped, far away, cut off by symmetry planes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh import Mesh, raise_order
from lacmesh.cells import CELLS
from tests.checks.blocks import SOLIDS, block, join, skin


def layers(name, n, m, gap=0.02, reach=0.0):
    """Two blocks in parameters, `n` and `m` cells a direction: the last parameter in 0..1 and in 1 + gap..2 + gap.

    Groups: slave, master, and `end00`, `end01`, ...: what bounds the lower one, in each other direction.
    """
    kind, order = SOLIDS[name]
    dim = CELLS[kind].dim
    low = block(n, (0,) * dim, (1,) * dim, kind)
    high = block(m, (*(-reach,) * (dim - 1), 1 + gap), (*(1 + reach,) * (dim - 1), 2 + gap), kind)
    on = lambda level: lambda x: np.abs(x[..., dim - 1] - level) < 1e-9  # noqa: E731
    ends = {
        f"end{k}{v}": skin(*low, lambda x, k=k, v=v: np.abs(x[..., k] - v) < 1e-9)
        for k in range(dim - 1)
        for v in (0, 1)
    }
    mesh = join([(*low, {"slave": skin(*low, on(1.0)), **ends}), (*high, {"master": skin(*high, on(1 + gap))})])
    return raise_order(mesh, order) if order else mesh


def all_round(name, n=2):
    """A block whose whole skin is the slave: cells with two and three slave faces, no rim, convex edges."""
    kind, order = SOLIDS[name]
    dim = CELLS[kind].dim
    part = block((n,) * dim, (0,) * dim, (1,) * dim, kind)
    outside = {}
    for k in range(dim):
        for v in (0, 1):
            for face, nodes in skin(*part, lambda x, k=k, v=v: np.abs(x[..., k] - v) < 1e-9).items():
                outside.setdefault(face, []).append(nodes)
    mesh = join([(*part, {"slave": {face: np.concatenate(rows) for face, rows in outside.items()}})])
    return raise_order(mesh, order) if order else mesh


def slot(name):
    """One body with a slot: slave and master are its two walls, which end at the slot's bottom."""
    kind, order = SOLIDS[name]
    dim = CELLS[kind].dim
    points, cells = block((3,) * dim, (0,) * dim, (3,) * dim, kind)
    middle, up = points[cells[kind]].mean(axis=1), dim - 1
    keep = ~((np.abs(middle[:, up] - 1.5) < 0.5) & (middle[:, 0] > 1))
    solid = {kind: cells[kind][keep]}
    wall = lambda v: lambda x: (np.abs(x[..., up] - v) < 1e-9) & (x[..., 0] > 1 - 1e-9)  # noqa: E731
    used = np.unique(solid[kind])
    new = np.full(len(points), -1)
    new[used] = np.arange(len(used))
    part = (points[used], {kind: new[solid[kind]]})
    outside = {g: only_boundary(part, skin(*part, wall(v))) for g, v in (("slave", 1.0), ("master", 2.0))}
    mesh = join([(*part, outside)])
    return raise_order(mesh, order) if order else mesh


def only_boundary(part, faces):
    """Select the facets that belong to one cell only: those on the boundary."""
    _, cells = part
    count = {}
    for kind, nodes in cells.items():
        for facet in CELLS[kind].facets:
            for row in np.sort(nodes[:, facet.nodes], axis=1):
                count[tuple(row)] = count.get(tuple(row), 0) + 1
    return {kind: nodes[[count[tuple(np.sort(row))] == 1 for row in nodes]] for kind, nodes in faces.items()}


def bent(mesh, place):
    """Move every node of a mesh, mid-nodes too, by a map of (n, 3); nodes that then coincide are merged."""
    points = place(mesh.points)
    _, first, inverse = np.unique(points.round(9) + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), np.int64)
    rank[order] = np.arange(len(first))
    new = rank[inverse.ravel()]
    blocks = [(b.type, new[b.nodes]) for b in mesh.blocks]
    flat = bool((points[:, 2] == points[0, 2]).all()) and mesh.space_dim == 2
    return Mesh.create(points[first[order]], blocks, cell_groups=mesh.cell_groups, space_dim=2 if flat else 3)


def ring(x):
    """A plane block to a closed ring: the first parameter goes round, the last outward."""
    angle, r = -2 * np.pi * x[:, 0], 3 + x[:, 1]
    return np.stack([r * np.cos(angle), r * np.sin(angle), 0 * r], axis=1)


def tube(x):
    """A block to a closed tube: the first parameter goes round, the second along, the last outward."""
    angle, r = 2 * np.pi * x[:, 0], 3 + x[:, 2]
    return np.stack([r * np.sin(angle), 4 * x[:, 1], r * np.cos(angle)], axis=1)


def torus(x):
    """A block to a closed torus: no skin has a rim."""
    a, b, r = 2 * np.pi * x[:, 0], 2 * np.pi * x[:, 1], 1.5 + x[:, 2]
    across = 9 + r * np.cos(b)
    return np.stack([across * np.cos(a), across * np.sin(a), r * np.sin(b)], axis=1)


def quarter(x):
    """A block to a quarter of a tube, which ends at symmetry planes."""
    angle, r = np.pi / 2 * x[:, 0], 3 + x[:, 2]
    return np.stack([r * np.sin(angle), 4 * x[:, 1], r * np.cos(angle)], axis=1)


def arc(x):
    """A plane block to a quarter of a ring, which ends at symmetry lines."""
    angle, r = np.pi / 2 * x[:, 0], 3 + x[:, 1]
    return np.stack([r * np.sin(angle), r * np.cos(angle), 0 * r], axis=1)


def dome(x):
    """A block whose layers bulge: every face is curved both ways, and quadrangles are warped."""
    up = 0.04 * (np.sin(2.2 * x[:, 0]) * np.cos(1.7 * x[:, 1] + 0.3) - x[:, 0] * x[:, 1])
    return x + np.stack([0 * up, 0 * up, up], axis=1)


def turned(x):
    """A block somewhere else, turned about a skew axis, in other units."""
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    c, s = np.cos(0.7), np.sin(0.7)
    cross = np.cross(axis, x)
    return 1e-3 * (c * x + s * cross + (1 - c) * np.outer(x @ axis, axis)) + [4.0, -2.0, 7.0]


def plane_elsewhere(mesh):
    """A plane mesh in a space of three dimensions, at z = 7."""
    return replace(mesh, points=mesh.points + np.array([0, 0, 7.0]), space_dim=3)
