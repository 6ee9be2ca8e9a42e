"""Bodies that the solver is tested on: boxes of every cell type, mixtures, one distorted cell."""

from __future__ import annotations

import numpy as np

from lacmesh import Mesh, raise_order
from lacmesh.cells import CELLS
from tests.meshes import box, grid, pad

#: every cell that carries displacements
SOLIDS = [name for name, cell in CELLS.items() if cell.dim == 3]
PLANES = [name for name, cell in CELLS.items() if cell.dim == 2]
PLANE_MODELS = ("plane_strain", "plane_stress", "axisymmetric")
#: (cell, model): every pair there is
PAIRS = [(name, "3d") for name in SOLIDS] + [(name, model) for name in PLANES for model in PLANE_MODELS]

#: a hexahedron as six tetrahedra round its diagonal 0-6, and as two prisms
_TETRAHEDRA = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
_PRISMS = [(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)]


def one_cell(name, distortion=0.0, seed=0, shift=3.0):
    """A mesh of one cell, its nodes moved at random, at x > 0."""
    cell = CELLS[name]
    rng = np.random.default_rng(seed)
    points = pad(cell.reference)
    points = points + rng.uniform(-distortion, distortion, points.shape) * [1, 1, cell.dim == 3]
    points[:, 0] += shift
    return Mesh.create(points, [(name, [np.arange(cell.n_nodes)])])


def with_skin(mesh):
    """Copy of a mesh of one cell with every facet as a skin cell, in the group 'skin'."""
    (block,) = mesh.blocks
    blocks = {block.type: block.nodes}
    for facet in CELLS[block.type].facets:
        row = block.nodes[0][list(facet.nodes)]
        blocks[facet.type] = np.vstack([*([blocks[facet.type]] if facet.type in blocks else []), row[None]])
    n = sum(len(rows) for rows in blocks.values())
    return Mesh.create(mesh.points, blocks.items(), cell_groups={"skin": np.arange(1, n), "body": [0]})


def square(name, n):
    """The unit square at x in [1, 2], meshed n times n with one type of cell."""
    g = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    x, y = np.meshgrid(1 + np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij")
    quads = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=-1).reshape(-1, 4)
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    if CELLS[name].family == "QUAD":
        return raised(Mesh.create(points, [("QUAD4", quads)]), name)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return raised(Mesh.create(points, [("TRIA3", triangles)]), name)


def cube(name, n):
    """The unit cube meshed n^3 times with one type of cell."""
    points, hexahedra = box(n)
    family = CELLS[name].family
    if family == "PYRAM":
        points, cells = pyramids(points, hexahedra)
    elif family == "HEXA":
        cells = hexahedra
    else:
        split = np.array(_TETRAHEDRA if family == "TETRA" else _PRISMS)
        cells = hexahedra[:, split].reshape(-1, split.shape[1])
    return raised(Mesh.create(points, [(f"{CELLS[name].linear}", cells)]), name)


def pyramids(points, hexahedra):
    """Each hexahedron as six pyramids round its centre: points, pyramids."""
    centre = len(points) + np.arange(len(hexahedra))
    points = np.vstack([points, points[hexahedra].mean(axis=1)])
    facets = [list(f.nodes[:4])[::-1] for f in CELLS["HEXA8"].facets]
    cells = [np.column_stack([hexahedra[:, facet], centre]) for facet in facets]
    return points, np.concatenate(cells)


def body(name, n):
    """`square` or `cube`, as the cell wants."""
    return square(name, n) if CELLS[name].dim == 2 else cube(name, n)


def raised(mesh, name):
    """Replace linear cells by cells of the type `name`."""
    if CELLS[name].order == 1:
        return mesh
    full = name in ("QUAD9", "HEXA27", "PENTA18", "PYRAM14")
    mesh = raise_order(mesh, "2-full" if full else "2")
    if name != "TRIA7":
        return mesh
    (block,) = mesh.blocks
    centre = mesh.n_nodes + np.arange(len(block.nodes))
    points = np.vstack([mesh.points, mesh.points[block.nodes[:, :3]].mean(axis=1)])
    return Mesh.create(points, [("TRIA7", np.column_stack([block.nodes, centre]))])


def mixture(order="1", seed=0):
    """Hexahedra, prisms, tetrahedra and the pyramids between them, conforming, in [0, 3] x [0, 2] x [0, 2]."""
    rng = np.random.default_rng(seed)
    plane, quads, triangles = grid(rng, 3, 2)
    n = len(plane)
    points = [(*p, float(k)) for k in range(3) for p in plane]
    cells = {"HEXA8": [], "PENTA6": [], "PYRAM5": [], "TETRA4": []}
    for low in (0, n):
        cells["PENTA6"] += [(*(low + a for a in t), *(low + n + a for a in t)) for t in triangles]
        for k, q in enumerate(quads):
            nodes = np.array([*(low + a for a in q), *(low + n + a for a in q)])
            if k % 2:
                cells["HEXA8"].append(nodes)
                continue
            points.append(tuple(np.mean([points[a] for a in nodes], axis=0)))
            for number, facet in enumerate(CELLS["HEXA8"].facets):
                a, b, c, d = nodes[list(facet.nodes[::-1])]
                outer = number == (0 if low == 0 else 5)  # on the skin, where a quadrangle may be two triangles
                apex = len(points) - 1
                if outer:
                    cells["TETRA4"] += [(a, b, c, apex), (a, c, d, apex)]
                else:
                    cells["PYRAM5"].append((a, b, c, d, apex))
    mesh = Mesh.create(np.array(points), [(t, np.array(rows)) for t, rows in cells.items() if rows])
    return mesh if order == "1" else raise_order(mesh, order)


def plane_mixture(order="1", seed=0):
    """Quadrangles and triangles at x in [1, 4]."""
    plane, quads, triangles = grid(np.random.default_rng(seed), 3, 3)
    plane[:, 0] += 1.0
    mesh = Mesh.create(plane, [("QUAD4", np.array(quads)), ("TRIA3", np.array(triangles))])
    return mesh if order == "1" else raise_order(mesh, order)


def rim(mesh):
    """(n_nodes,): whether a node lies on the box around the mesh."""
    x = mesh.points
    dims = range(2 if mesh.space_dim == 2 else 3)
    return np.any([(np.abs(x[:, s] - side(x[:, s])) < 1e-9) for s in dims for side in (np.min, np.max)], axis=0)


def distorted(mesh, size, seed=0):
    """The mesh with every node moved at random by up to `size` each way; curved where it is quadratic."""
    rng = np.random.default_rng(seed)
    move = rng.uniform(-size, size, mesh.points.shape) * [1, 1, mesh.space_dim == 3]
    return Mesh.create(mesh.points + move, [(b.type, b.nodes) for b in mesh.blocks], space_dim=mesh.space_dim)
