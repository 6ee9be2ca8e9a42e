"""Healthy meshes: two blocks, one over the other, of every cell type; the lower one's top is the slave."""

import numpy as np

from lacmesh import Mesh, cut_skin, generate
from lacmesh.cells import CELLS
from lacmesh.generate.parts import SPLITS, box_of

#: cells with all nodes that a raised cell may have
FULL = ("TRIA7", "QUAD9", "HEXA27", "PENTA18", "PYRAM14")
#: cell type of a body -> (linear type, order asked of raise_order)
SOLIDS = {
    name: (cell.linear, None if cell.order == 1 else "2-full" if name in FULL else "2")
    for name, cell in CELLS.items()
    if cell.dim > 1
}


def block(shape, low, high, kind="HEXA8"):
    """(points, {type: nodes}) of a block of cells of one linear type, `shape` of them a direction."""
    grid = box_of("QUAD4" if len(shape) == 2 else "HEXA8", len(shape), shape, np.subtract(high, low), low, 0.0, 0, ())
    points, ((_, boxes),) = grid.points, grid.blocks
    if kind == "PYRAM5":
        centres = points[boxes].mean(axis=1)
        boxes = np.column_stack([boxes, len(points) + np.arange(len(boxes))])
        points = np.vstack([points, centres])
    corners = [nodes for _, nodes in SPLITS[kind]]
    return points, {kind: boxes[:, corners].reshape(-1, len(corners[0]))}


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
    beyond = np.array([reach] * (CELLS[name].dim - 1) + [0.0])
    make = generate.rectangle if len(beyond) == 2 else generate.box
    high = make(n if matching else m, 1 + 2 * beyond, name, corner=-beyond)
    mesh = generate.stack(make(n, 1.0, name), high, gap=gap, slave="lower")
    names = {"lower": "body0", "upper": "body1", "bottom": "fixed", "top": "loaded"}
    return mesh.renamed(**names).only(*names.values(), "slave", "master")


def cut_blocks(name="HEXA8", hexa="pyramid", **options):
    """Two blocks, the slave cut: a mesh without a defect."""
    return cut_skin(two_blocks(name, **options), "slave", hexa=hexa).mesh
