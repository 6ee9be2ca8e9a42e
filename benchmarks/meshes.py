"""Large structured meshes: hexahedra, or six tetrahedra for each, with the top as the group 'slave'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lacmesh import Mesh, cut_skin, generate


def box(nx: int, ny: int, nz: int, cell: str = "HEXA8") -> Mesh:
    """A box of nx ny nz hexahedra, or six times as many tetrahedra, one elementary entity a dimension."""
    mesh = generate.box((nx, ny, nz), (nx, ny, nz), cell).renamed(top="slave").only("body", "slave")
    entity = np.stack([mesh.cell_dim, np.ones(mesh.n_cells, int)], axis=1).astype(np.int32)
    return replace(mesh, cell_data={"entity": entity})


def blocks(
    n: int, m: int, depth: int, lower: str = "HEXA8", upper: str | None = None, hexa: str | None = "pyramid"
) -> Mesh:
    """Two blocks, n and m cells to a side, `depth` in height; cut, unless `hexa` is None.

    Groups lower, upper, slave, master; top, bottom (of nodes).
    """
    low, up = (generate.box((k, k, depth), (1, 1, 0.5), kind) for k, kind in ((n, lower), (m, upper or lower)))
    turned = up.moved(lambda x: [x[0], 1 - x[1], 0.5 - x[2]]).renamed(top="bottom", bottom="top")  # half a turn about x
    mesh = generate.stack(low, turned, slave="lower").only("lower", "upper", "slave", "master")
    mesh = mesh.with_groups("nodes", bottom=lambda x: x[2] == 0, top=lambda x: x[2] == 1)
    return mesh if hexa is None else cut_skin(mesh, "slave", hexa=hexa).mesh


def n_bytes(mesh: Mesh) -> int:
    """Memory of all the arrays of a mesh."""
    arrays = [mesh.points, mesh.node_number, mesh.cell_number, *(b.nodes for b in mesh.blocks)]
    arrays += [*mesh.cell_groups.values(), *mesh.node_groups.values()]
    arrays += [*mesh.cell_data.values(), *mesh.node_data.values()]
    return sum(a.nbytes for a in arrays)
