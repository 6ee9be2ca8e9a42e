"""Large structured meshes: hexahedra, or six tetrahedra for each, with the top as the group 'slave'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh import Mesh, cut_skin, raise_order

#: six tetrahedra of a hexahedron (Kuhn), from corner 0 to corner 6
KUHN = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]


def box(nx: int, ny: int, nz: int, cell: str = "HEXA8") -> Mesh:
    """A box of nx ny nz hexahedra, or six times as many tetrahedra, one elementary entity a dimension."""
    g = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    z, y, x = np.meshgrid(np.arange(nz + 1.0), np.arange(ny + 1.0), np.arange(nx + 1.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)

    def corner(i: int, j: int, k: int) -> np.ndarray:
        return g[k : k + nz, j : j + ny, i : i + nx].ravel()

    places = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    cells = np.stack([corner(*p) for p in places], axis=1)
    top = cells[-nx * ny :, 4:]
    if cell == "HEXA8":
        solid, skin = ("HEXA8", cells), ("QUAD4", top)
    else:
        solid = ("TETRA4", cells[:, KUHN].reshape(-1, 4))
        skin = ("TRIA3", np.concatenate([top[:, [0, 1, 2]], top[:, [0, 2, 3]]]))
    n, m = len(solid[1]), len(skin[1])
    entity = np.repeat(np.array([[3, 1], [2, 1]], np.int32), [n, m], axis=0)
    return Mesh.create(
        points,
        [solid, skin],
        cell_groups={"body": np.arange(n), "slave": n + np.arange(m)},
        cell_data={"entity": entity},
    )


def blocks(
    n: int, m: int, depth: int, lower: str = "HEXA8", upper: str | None = None, hexa: str | None = "pyramid"
) -> Mesh:
    """Two blocks, n and m cells to a side, `depth` in height; cut, unless `hexa` is None.

    Groups lower, upper, slave, master; top, bottom (of nodes).
    """
    low, up = (_half(k, depth, kind) for k, kind in ((n, lower), (m, upper or lower)))
    turned = up.points * [1, -1, -1] + [0, 1, 1]  # half a turn about x: its skin looks down
    points = np.concatenate([low.points * [1, 1, 0.5], turned * [1, 1, 0.5] + [0, 0, 0.5]])
    cells: dict[str, list[np.ndarray]] = {}
    skins: dict[str, list[np.ndarray]] = {}
    for part, shift in ((low, 0), (up, len(low.points))):
        for kind, nodes in part.blocks:
            (skins if kind in FACES else cells).setdefault(kind, []).append(nodes + shift)
    n_cells = sum(len(c) for part in cells.values() for c in part)
    n_lower, slave, master = (len(b.nodes) for b in (low.blocks[0], low.blocks[1], up.blocks[1]))
    groups = {"lower": np.arange(n_lower), "upper": np.arange(n_lower, n_cells)}
    groups |= {"slave": n_cells + np.arange(slave), "master": n_cells + slave + np.arange(master)}
    z = points[:, 2]
    mesh = Mesh.create(
        points,
        [(kind, np.concatenate(parts)) for kind, parts in (*cells.items(), *skins.items())],
        cell_groups=groups,
        node_groups={"bottom": np.flatnonzero(z == 0), "top": np.flatnonzero(z == 1)},
    )
    return mesh if hexa is None else cut_skin(mesh, "slave", hexa=hexa).mesh


FACES = ("QUAD4", "QUAD8", "QUAD9", "TRIA3", "TRIA6")


def _half(n: int, depth: int, kind: str) -> Mesh:
    """A unit box whose top is a skin."""
    mesh = box(n, n, depth, "HEXA8" if kind.startswith("HEXA") else "TETRA4")
    mesh = replace(mesh, points=mesh.points / [n, n, depth], cell_data={})
    if kind in ("HEXA20", "HEXA27", "TETRA10"):
        mesh = raise_order(mesh, "2-full" if kind == "HEXA27" else "2")
    return mesh


def n_bytes(mesh: Mesh) -> int:
    """Memory of all the arrays of a mesh."""
    arrays = [mesh.points, mesh.node_number, mesh.cell_number, *(b.nodes for b in mesh.blocks)]
    arrays += [*mesh.cell_groups.values(), *mesh.node_groups.values()]
    arrays += [*mesh.cell_data.values(), *mesh.node_data.values()]
    return sum(a.nbytes for a in arrays)
