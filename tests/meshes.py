"""Meshes that tests are run on: reference cells, and random conforming mixtures of every type."""

import warnings
from contextlib import contextmanager

import numpy as np
from scipy.spatial import Delaunay

from lacmesh import LacmeshWarning, Mesh, generate, measure_quality, raise_order
from lacmesh.cells import CELLS
from lacmesh.reference.quadrature import measure
from verification.families.cut import listed


def pad(points):
    points = np.asarray(points, float)
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def worst(mesh):
    """The least corner Jacobian of the cells of a mesh."""
    return min(t.measures["corner_jacobian"].least for t in measure_quality(mesh).types if t.poor is not None)


@contextmanager
def lenient():
    """Let our own warnings pass; every other one stays an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        yield


def same_nodes(one, other):
    """True if the cells of two meshes are of the same types and list the same nodes, in the same order."""
    pairs = zip(one.blocks, other.blocks, strict=True)
    return all(a.type == b.type and np.array_equal(a.nodes, b.nodes) for a, b in pairs)


def renumbered(mesh, rng):
    """The mesh with nodes, blocks, their cells and groups in another order; and the new place of each cell."""
    node = rng.permutation(mesh.n_nodes)
    rows = [(k, rng.permutation(len(mesh.blocks[k].nodes))) for k in rng.permutation(len(mesh.blocks))]
    place = np.argsort(np.concatenate([mesh.offsets[k] + some for k, some in rows]))
    blocks = [(mesh.blocks[k].type, node[mesh.blocks[k].nodes[some]]) for k, some in rows]
    groups = {name: place[members] for name, members in reversed(mesh.cell_groups.items())}
    points = mesh.points[np.argsort(node)]
    return Mesh.create(points, blocks, cell_groups=groups, space_dim=mesh.space_dim), place


def affine(points, seed=0):
    """Points moved by a fixed affine map that keeps orientation (in the plane if they are plane)."""
    rng = np.random.default_rng(seed)
    A = np.eye(3) + 0.25 * rng.uniform(-1, 1, (3, 3))
    if not np.any(points[:, 2]):
        A[2, :2] = 0
    return points @ A.T + rng.uniform(-1, 1, 3) * [1, 1, float(np.any(points[:, 2]))]


def cell_with_faces(name, facets=(0,), rotation=0, inward=False, seed=0):
    """One cell of type `name`, some of whose facets are skin cells in the group 'slave'; each listed another way."""
    cell = CELLS[name]
    points = affine(pad(cell.reference), seed)
    blocks = {name: [np.arange(cell.n_nodes)]}
    for j in facets:
        facet = cell.facets[j]
        blocks.setdefault(facet.type, []).append(listed(np.array(facet.nodes), facet.type, rotation, inward))
    groups = {"slave": np.arange(1, 1 + len(facets)), "body": [0]}
    return Mesh.create(points, blocks.items(), cell_groups=groups, node_groups={"all": np.arange(cell.n_nodes)})


def box(n=2, size=1.0):
    """(points, hexahedra) of a cube of n^3 HEXA8."""
    mesh = generate.box(n, size)
    return mesh.points, mesh.block("HEXA8")


def grid(rng, nx, ny):
    """A plane grid, some of whose quadrangles are two triangles: points (n, 2), quads, triangles."""
    g = np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
    x, y = np.meshgrid(np.arange(nx + 1.0), np.arange(ny + 1.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    quads, triangles = [], []
    for i in range(nx):
        for j in range(ny):
            a, b, c, d = g[i, j], g[i + 1, j], g[i + 1, j + 1], g[i, j + 1]
            if rng.random() < 0.5:
                quads.append((a, b, c, d))
            else:
                triangles += [(a, b, c), (a, c, d)] if rng.random() < 0.5 else [(a, b, d), (b, c, d)]
    return points, quads, triangles


def layered(rng, nx=2, ny=2, nz=2):
    """Hexahedra, prisms and pyramids (a hexahedron cut from its centre), conforming: points, {type: nodes}."""
    plane, quads, triangles = grid(rng, nx, ny)
    n = len(plane)
    points = [(*p, float(k)) for k in range(nz + 1) for p in plane]
    cells = {"HEXA8": [], "PENTA6": [], "PYRAM5": []}
    for k in range(nz):
        low, high = k * n, (k + 1) * n
        cells["PENTA6"] += [(*(low + a for a in t), *(high + a for a in t)) for t in triangles]
        for q in quads:
            nodes = (*(low + a for a in q), *(high + a for a in q))
            if rng.random() < 0.4:
                centre = len(points)
                points.append(tuple(np.mean([points[a] for a in nodes], axis=0)))
                for facet in CELLS["HEXA8"].facets:
                    a, b, c, d = (nodes[i] for i in facet.nodes)
                    cells["PYRAM5"].append((a, d, c, b, centre))
            else:
                cells["HEXA8"].append(nodes)
    return np.array(points), {t: np.array(rows) for t, rows in cells.items() if rows}


def tetrahedra(rng, n_points=14):
    """A Delaunay mesh of random points: points, {type: nodes}, flat cells left out at the hull."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    points = np.vstack([corners, rng.uniform(0.15, 0.85, (n_points, 3))])
    tets = Delaunay(points).simplices
    volume = measure("TETRA4", points[tets])
    tets = np.where((volume < 0)[:, None], tets[:, [0, 2, 1, 3]], tets)
    return points, {"TETRA4": tets[np.abs(volume) > 1e-6]}


def facets_of(mesh, dim=None):
    """{sorted corners: [(cell index, facet number, nodes), ...]} of all facets of the cells of dimension `dim`."""
    dim = mesh.dim if dim is None else dim
    table = {}
    for k, block in enumerate(mesh.blocks):
        cell = CELLS[block.type]
        if cell.dim != dim:
            continue
        for row, nodes in enumerate(block.nodes):
            for j, facet in enumerate(cell.facets):
                there = nodes[list(facet.nodes)]
                key = tuple(sorted(there[: CELLS[facet.type].n_corners].tolist()))
                table.setdefault(key, []).append((int(mesh.offsets[k]) + row, j, facet.type, there))
    return table


def random_mesh(rng, dim=3, order=1, slaves=3, interior=False, twins=False, orphans=True):
    """A random conforming mixture with random skin faces in overlapping groups, random numbers and data."""
    if dim == 2:
        plane, quads, triangles = grid(rng, 3, 2)
        points, cells = pad(plane), {t: np.array(c) for t, c in (("QUAD4", quads), ("TRIA3", triangles)) if c}
    else:
        points, cells = layered(rng) if rng.random() < 0.6 else tetrahedra(rng)
    points = affine(points, int(rng.integers(1 << 30)))
    solid = Mesh.create(points, cells.items(), space_dim=dim)
    table = facets_of(solid)
    keys = [k for k, owners in table.items() if interior or len(owners) == 1]
    chosen = [keys[i] for i in rng.permutation(len(keys))[: max(1, slaves)]]
    blocks = {t: list(map(tuple, c)) for t, c in cells.items()}
    skin = {}
    for key in chosen:
        _, _, face, nodes = table[key][0]
        for _ in range(2 if twins and rng.random() < 0.5 else 1):
            skin.setdefault(face, []).append(listed(nodes, face, int(rng.integers(4)), bool(rng.random() < 0.5)))
    blocks |= skin
    if orphans:
        points = np.vstack([points, rng.uniform(2, 3, (2, 3)) * [1, 1, dim == 3]])
    names = list(blocks)
    order_of_types = [names[i] for i in rng.permutation(len(names))]
    made = [(t, np.array(blocks[t])) for t in order_of_types]
    mesh = dressed(rng, points, made, skin, dim)
    return raise_order(mesh, {2: "2", 3: "2-full"}[order]) if order > 1 else mesh


def dressed(rng, points, made, skin, dim):
    """A mesh of blocks `made`, those of `skin` the group `slave`, with random numbers, order, groups and data."""
    n_cells = sum(len(rows) for _, rows in made)
    starts = dict(zip([t for t, _ in made], np.cumsum([0, *(len(r) for _, r in made)]), strict=False))
    faces = np.concatenate([starts[t] + np.arange(len(rows)) for t, rows in skin.items()])
    groups = {"slave": faces, "half": rng.permutation(n_cells)[: n_cells // 2], "all": np.arange(n_cells), "none": []}
    return Mesh.create(
        points,
        made,
        space_dim=dim,
        node_number=rng.permutation(10 * len(points))[: len(points)] + 1,
        cell_number=rng.permutation(10 * n_cells)[:n_cells] + 1,
        file_order=rng.permutation(n_cells),
        cell_groups=groups,
        node_groups={"some": rng.permutation(len(points))[: len(points) // 2], "every": np.arange(len(points))},
        cell_data={"colour": rng.random(n_cells), "rank": rng.integers(0, 5, n_cells)},
        node_data={"heat": points @ [1.0, 2.0, 3.0], "where": points.copy()},
    )
