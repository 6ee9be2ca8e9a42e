"""Sectors of thick rings, whose sides match or not, and whole rings of the same cells.

Groups: `body`, `in`, `out`, the sides `a` and `b` of a sector, `bottom` and `top` in space.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.meshes.blocks import bent, block, joined

Floats = NDArray[np.floating]
#: sides of the block of a sector: radius, part of the angle, height
_SIDES = {"": "body", "x0": "in", "x1": "out", "y0": "a", "y1": "b", "z0": "bottom", "z1": "top"}
#: distance of nodes that are one
_SAME = 1e-9


def sector(
    kind: str, counts: Sequence[int], radii: tuple[float, float], sectors: int, *, skew: float = 0.0, parts: int = 1
) -> Mesh:
    """`parts` of `sectors` of a ring of cells of a type, `counts` of quadrangles along radius, angle (and height 1).

    `skew`: how far radii shift from side `a` to side `b`, relative to the thickness: sides that do not match.
    """
    dim, thick = CELLS[kind].dim, radii[1] - radii[0]
    low, high = [radii[0], 0.0, 0.0][:dim], [radii[1], float(parts), 1.0][:dim]
    flat = block(kind, (counts[0], counts[1] * parts, *counts[2:]), low, high)

    def around(x: Floats) -> Floats:
        angle = x[:, 1] * 2 * np.pi / sectors
        r = x[:, 0] + skew * (x[:, 0] - radii[0]) * (radii[1] - x[:, 0]) / thick * x[:, 1]
        return np.stack([r * np.cos(angle), r * np.sin(angle), x[:, 2]], axis=1)

    return bent(joined([(flat, _SIDES)]), around)


def whole(kind: str, counts: Sequence[int], radii: tuple[float, float], sectors: int) -> Mesh:
    """The whole ring of the cells of a sector."""
    mesh = sector(kind, counts, radii, sectors, parts=sectors)
    of = np.arange(mesh.n_nodes)
    for i, j in cKDTree(mesh.points).query_pairs(_SAME):
        of[max(i, j)] = min(i, j)
    used = np.unique(of)
    new = np.searchsorted(used, of)
    blocks = [(block.type, new[block.nodes]) for block in mesh.blocks]
    groups = {name: cells for name, cells in mesh.cell_groups.items() if name not in ("a", "b")}
    return Mesh.create(mesh.points[used], blocks, cell_groups=groups, space_dim=mesh.dim)


def fitted(kind: str, n: int, radii: tuple[float, float, float], sectors: int, *, skew: float = 0.0) -> Mesh:
    """Sectors of two rings, one in the other, n and n + 1 cells around: `slave` is the outer side of the inner one."""
    inner = sector(kind, (n, n), radii[:2], sectors, skew=skew)
    outer = sector(kind, (n, n + 1), radii[1:], sectors, skew=skew)
    return joined([
        (inner, {"body": "within", "in": "inner", "out": "slave", "a": "a", "b": "b"}),
        (outer, {"body": "around", "in": "master", "out": "outer", "a": "a", "b": "b"}),
    ])  # fmt: skip
