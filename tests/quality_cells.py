"""Cells that quality is tested on: ideal, distorted, wild, stretched, inverted, tiny, degenerate in every way."""

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
