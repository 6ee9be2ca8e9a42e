"""Cells that quality is tested on: ideal, distorted, wild, stretched, inverted, tiny, degenerate in every way."""

from __future__ import annotations

import numpy as np

from lacmesh.cells import CELLS
from tests.meshes import pad

#: corners of the cells that Verdict calls ideal
IDEAL = {
    "TRIA3": [(0, 0, 0), (1, 0, 0), (0.5, np.sqrt(0.75), 0)],
    "QUAD4": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
    "TETRA4": [(0, 0, 0), (1, 0, 0), (0.5, np.sqrt(0.75), 0), (0.5, np.sqrt(1 / 12), np.sqrt(2 / 3))],
    "HEXA8": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
    "PENTA6": [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (0.5, np.sqrt(0.75)))],
    "PYRAM5": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, np.sqrt(0.5))],
}
LINEAR = list(IDEAL)
MEASURED = [name for name, cell in CELLS.items() if cell.dim > 1]


def ideal(name):
    """(n, 3): nodes of an ideal cell of any type, mid-nodes and centres where they belong."""
    cell = CELLS[name]
    if cell.dim == 1:
        return pad(cell.reference)
    corners = np.array(IDEAL[cell.linear])
    return np.array([corners[list(c)].mean(axis=0) for c in cell.corners_of_node])


def reference(name):
    return pad(CELLS[name].reference)


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, [1, 0, 2]]


def distorted(name, seed=0, k=200):
    """(6 k, n, 3): a little and a lot distorted, wild, stretched, of many sizes, twisted, inverted."""
    rng = np.random.default_rng(seed)
    ref = reference(name)
    noise = rng.normal(size=(6, k, *ref.shape))
    little = ref + noise[0] * rng.uniform(0, 0.3, (k, 1, 1))
    stretched = (ref + 0.1 * noise[1]) * rng.lognormal(0, 1.5, (k, 1, 3))
    sizes = (ref + 0.1 * noise[2]) * rng.choice([1e-3, 1e-2, 1e3, 1e6], (k, 1, 1))
    inverted = ref + 0.1 * noise[3]
    inverted = inverted * [1, 1, -1] if CELLS[name].dim == 3 else inverted[:, ::-1]
    turn = rng.uniform(-3, 3, (k, 1)) * (ref[:, 2] > 0)  # worse at the centre than at its corners
    c, s, x, y = np.cos(turn), np.sin(turn), ref[:, 0], ref[:, 1]
    twisted = np.stack([c * x - s * y, s * x + c * y, 0 * c + ref[:, 2]], axis=2) + 0.02 * noise[5]
    return np.concatenate([little, noise[4], stretched, sizes, twisted, inverted])


def degenerate(name, seed=1, k=200):
    """(m, n, 3): nodes that coincide, flat cells, cells of no extent, on whole numbers, so that nothing is rounded."""
    rng = np.random.default_rng(seed)
    ref = np.round(2 * reference(name))
    n = len(ref)
    collapsed = np.repeat(ref[None], k, axis=0)
    for cell in collapsed:
        for _ in range(rng.integers(1, 3)):
            p, q = rng.integers(0, n, 2)
            cell[p] = cell[q]
    lattice = [rng.integers(-2, 3, (k, n, 3)) * np.array(mask, float) for mask in ((1, 1, 1), (1, 1, 0), (1, 0, 0))]
    known = [ref, 0 * ref, 0 * ref + 1, ref * [1, 1, 0], ref * [1, 0, 1], ref * [1, 1, -1]]
    return np.concatenate([collapsed, *lattice, np.array(known)])


def near_ideal(name, seed=2, k=200):
    """(4 k + m, n, 3): regular and right cells, stretched, sheared, and nearly so, turned and of any size.

    The m last lie on the axes, undistorted, as a mesher leaves them.
    """
    rng = np.random.default_rng(seed)
    ref = np.array(IDEAL[name])
    flat = CELLS[name].dim == 2
    heights = np.array([(1, 1, z) for z in (0.1, 0.5, 0.8, 0.9, 0.95, 1, 1.05, 1.1, 1.25, 2, 10)])
    wide = np.array([(x, y, 1) for x in (0.5, 1, 2) for y in (0.5, 0.9, 1, 3)])
    on_axes = (
        ref * np.concatenate([heights, wide])[:, None] * rng.choice([0.25, 1, 8], (len(heights) + len(wide), 1, 1))
    )
    right = ref * heights[rng.integers(0, len(heights), k), None]
    boxes = ref * rng.uniform(0.5, 2, (k, 1, 3))
    shear = np.eye(3) + np.triu(rng.uniform(-0.5, 0.5, (k, 3, 3)), 1) * ([1, 1, 0] if flat else 1)
    sheared = np.einsum("nj,kij->kni", ref, shear)
    nearly = ref + rng.normal(size=(k, *ref.shape)) * 10.0 ** rng.uniform(-12, -2, (k, 1, 1))
    cells = np.concatenate([right, boxes, sheared, nearly])
    turned = np.array([x @ rotation(rng).T for x in cells]) * rng.lognormal(0, 2, (len(cells), 1, 1))
    return np.concatenate([turned, on_axes])
