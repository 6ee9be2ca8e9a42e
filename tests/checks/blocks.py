"""Healthy meshes: two blocks, one over the other, of every cell type; the lower one's top is the slave."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh, cut_skin, raise_order
from lacmesh.cells import CELLS

#: six tetrahedra and two prisms of a hexahedron, and its six pyramids' bases (the apex is its centre)
KUHN = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
PRISMS = [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)]

#: cell type of a body -> (linear type, order asked of raise_order)
SOLIDS = {
    "TRIA3": ("TRIA3", None),
    "TRIA6": ("TRIA3", "2"),
    "TRIA7": ("TRIA3", "2-full"),
    "QUAD4": ("QUAD4", None),
    "QUAD8": ("QUAD4", "2"),
    "QUAD9": ("QUAD4", "2-full"),
    "TETRA4": ("TETRA4", None),
    "TETRA10": ("TETRA4", "2"),
    "HEXA8": ("HEXA8", None),
    "HEXA20": ("HEXA8", "2"),
    "HEXA27": ("HEXA8", "2-full"),
    "PENTA6": ("PENTA6", None),
    "PENTA15": ("PENTA6", "2"),
    "PENTA18": ("PENTA6", "2-full"),
    "PYRAM5": ("PYRAM5", None),
    "PYRAM13": ("PYRAM5", "2"),
    "PYRAM14": ("PYRAM5", "2-full"),
}


def block(shape, low, high, kind="HEXA8"):
    """(points, {type: nodes}) of a block of cells of one linear type, `shape` of them a direction."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, shape, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(shape))
    g = np.arange(len(points)).reshape([n + 1 for n in shape])
    if len(shape) == 2:
        nx, ny = shape
        corner = lambda i, j: g[i : i + nx, j : j + ny].ravel()  # noqa: E731
        quads = np.stack([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)], axis=1)
        points = np.pad(points, ((0, 0), (0, 1)))
        return points, {kind: quads if kind == "QUAD4" else quads[:, [(0, 1, 2), (0, 2, 3)]].reshape(-1, 3)}
    nx, ny, nz = shape
    places = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    hexa = np.stack([g[i : i + nx, j : j + ny, k : k + nz].ravel() for i, j, k in places], axis=1)
    if kind == "TETRA4":
        return points, {kind: hexa[:, KUHN].reshape(-1, 4)}
    if kind == "PENTA6":
        return points, {kind: hexa[:, PRISMS].reshape(-1, 6)}
    if kind == "PYRAM5":
        centre = len(points) + np.arange(len(hexa))
        bases = hexa[:, [f.nodes[::-1] for f in CELLS["HEXA8"].facets]]
        apex = np.broadcast_to(centre[:, None, None], (*bases.shape[:2], 1))
        return np.vstack([points, points[hexa].mean(axis=1)]), {
            kind: np.concatenate([bases, apex], axis=2).reshape(-1, 5)
        }
    return points, {kind: hexa}


def skin(points, cells, on):
    """Facets {type: nodes} of cells whose corners all meet a condition, oriented outward."""
    out = {}
    for kind, nodes in cells.items():
        for facet in CELLS[kind].facets:
            there = nodes[:, facet.nodes]
            rows = on(points[there]).all(axis=1)
            if rows.any():
                out.setdefault(facet.type, []).append(there[rows])
    return {kind: np.concatenate(rows) for kind, rows in out.items()}


def join(parts, **rest):
    """A mesh from parts (points, {type: nodes}, {group: {type: nodes of skin cells}}), bodies named body0, body1 ..."""
    points, blocks, groups, start = [], {}, {}, 0
    for k, (x, cells, skins) in enumerate(parts):
        for name, faces in [(f"body{k}", cells), *skins.items()]:
            for kind, nodes in faces.items():
                rows = blocks.setdefault(kind, [])
                first = sum(len(r) for r in rows)
                rows.append(np.asarray(nodes) + start)
                groups.setdefault(name, []).append((kind, first + np.arange(len(nodes))))
        points.append(x)
        start += len(x)
    made = {kind: np.concatenate(rows) for kind, rows in blocks.items()}
    offset = dict(zip(made, np.cumsum([0, *(len(r) for r in made.values())]), strict=False))
    cell_groups = {n: np.concatenate([offset[kind] + rows for kind, rows in of]) for n, of in groups.items()}
    return Mesh.create(np.vstack(points), made.items(), cell_groups=cell_groups, **rest)


def two_blocks(name="HEXA8", gap=0.01, n=2, m=3, matching=False, reach=0.0):
    """Two blocks: slave on the lower one's top, master on the upper one's bottom, which reaches `reach` beyond it."""
    kind, order = SOLIDS[name]
    flat = CELLS[kind].dim == 2
    m = n if matching else m
    low = block((n, n) if flat else (n, n, n), (0,) * (2 if flat else 3), (1,) * (2 if flat else 3), kind)
    bottom = (-reach, 1 + gap) if flat else (-reach, -reach, 1 + gap)
    top = (1 + reach, 2 + gap) if flat else (1 + reach, 1 + reach, 2 + gap)
    high = block((m, m) if flat else (m, m, m), bottom, top, kind)
    up = 1 if flat else 2
    on = lambda level: lambda x: np.abs(x[..., up] - level) < 1e-9  # noqa: E731
    mesh = join(
        [
            (*low, {"slave": skin(*low, on(1.0)), "fixed": skin(*low, on(0.0))}),
            (*high, {"master": skin(*high, on(1 + gap)), "loaded": skin(*high, on(2 + gap))}),
        ]
    )
    return raise_order(mesh, order) if order else mesh


def cut_blocks(name="HEXA8", hexa="pyramid", **options):
    """Two blocks, the slave cut: a mesh without a defect."""
    return cut_skin(two_blocks(name, **options), "slave", hexa=hexa).mesh
