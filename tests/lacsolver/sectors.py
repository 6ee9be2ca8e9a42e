"""Sectors of rings: a body in polar coordinates, with groups of its sides, and the whole ring of the same cells."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from lacmesh import Mesh
from lacmesh.cells import CELLS
from tests.lacsolver.bodies import body

#: sides by the coordinate that is constant on them: radius, part of the angle, height
SIDES = {"in": (0, 1.0), "out": (0, 2.0), "a": (1, 0.0), "b": (1, 1.0), "bottom": (2, 0.0), "top": (2, 1.0)}


def sector(cell, counts, sectors, *, skew=0.0, parts=1):
    """`parts` of `sectors` of a ring with radii from 1 to 2; `skew`: how far radii shift from one side to the other."""
    dim = CELLS[cell].dim
    mesh = body(cell, 1, [1.0, 0.0, 0.0][:dim], [2.0, 1.0, 1.0][:dim], (counts[0], counts[1] * parts, *counts[2:]))
    plain = mesh.points * ([1, parts, 1])
    angle, r = plain[:, 1] * 2 * np.pi / sectors, plain[:, 0]
    r = r + skew * (r - 1) * (2 - r) * plain[:, 1]
    x = np.stack([r * np.cos(angle), r * np.sin(angle), plain[:, 2]], axis=1)
    return _with_sides(mesh, plain, x)


def ring(cell, counts, sectors):
    """The whole ring of the same cells."""
    mesh = sector(cell, counts, sectors, parts=sectors)
    of = np.arange(mesh.n_nodes)
    for i, j in cKDTree(mesh.points).query_pairs(1e-9):
        of[max(i, j)] = min(i, j)
    used = np.unique(of)
    new = np.searchsorted(used, of)
    blocks = [(block.type, new[block.nodes]) for block in mesh.blocks]
    groups = {name: cells for name, cells in mesh.cell_groups.items() if name not in ("a", "b")}
    return Mesh.create(mesh.points[used], blocks, cell_groups=groups, space_dim=mesh.dim)


def _with_sides(mesh, plain, x):
    """The mesh at x, with faces on its sides, where a coordinate of `plain` is constant."""
    (block,) = mesh.blocks
    rows = {}
    where = {}
    for cell in block.nodes:
        for facet in CELLS[block.type].facets:
            nodes = cell[list(facet.nodes)]
            for name, (axis, value) in SIDES.items():
                if axis < mesh.dim and np.allclose(plain[nodes, axis], value, atol=1e-9):
                    where.setdefault(name, []).append((facet.type, len(rows.setdefault(facet.type, []))))
                    rows[facet.type].append(nodes)
    first, count = {}, len(block.nodes)
    for kind, faces in rows.items():
        first[kind], count = count, count + len(faces)
    groups = {name: [first[kind] + k for kind, k in faces] for name, faces in where.items()}
    blocks = [(block.type, block.nodes), *((kind, np.array(faces)) for kind, faces in rows.items())]
    return Mesh.create(x, blocks, cell_groups=groups, space_dim=mesh.dim)
