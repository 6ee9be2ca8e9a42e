"""Lengths, areas and volumes of cells, and their sums over groups."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import CELLS
from lacmesh.mesh import Ints, Mesh
from lacmesh.origin import from_origin, origin_of_mesh
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian

#: degree of the rule, by dimension and order: exact for volumes and for flat faces
_DEGREE = {1: {1: 1, 2: 6}, 2: {1: 3, 2: 6}, 3: {1: 3, 2: 6}}
#: cells whose Jacobians are in memory at once
_PIECE = 1 << 16


def cell_sizes(mesh: Mesh, cells: Ints | None = None) -> NDArray[np.floating]:
    """Return the length, area or volume of cells (indices; all if None), 0 of points, NaN of types without shapes.

    >>> square = Mesh.create([[0, 0], [2, 0], [2, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]]), ("SEG2", [[0, 1]])])
    >>> cell_sizes(square).tolist()
    [2.0, 2.0]
    """
    cells = np.arange(mesh.n_cells) if cells is None else cells
    out, x = np.full(mesh.n_cells, np.nan), from_origin(mesh, origin_of_mesh(mesh)).points
    for name, chosen, nodes in mesh.select(cells):
        cell = CELLS.get(name)
        if cell is None:
            continue
        if not cell.dim:
            out[chosen] = 0.0
            continue
        X, w = rule(cell.family, _DEGREE[cell.dim][cell.order])
        for first in range(0, len(chosen), _PIECE):
            rows = slice(first, first + _PIECE)
            J = jacobian(name, x[nodes[rows]], X[:, : cell.dim])
            out[chosen[rows]] = np.sqrt(np.abs(np.linalg.det(J.swapaxes(2, 3) @ J))) @ w
    return out[cells]


def group_sizes(mesh: Mesh) -> dict[str, float]:
    """Return the length, area or volume of each group of cells, of its cells of the highest dimension."""
    used = np.zeros(mesh.n_cells, bool)
    for cells in mesh.cell_groups.values():
        used[cells] = True
    every = np.full(mesh.n_cells, np.nan)
    every[used] = cell_sizes(mesh, np.flatnonzero(used))
    return {
        name: float(every[cells[mesh.cell_dim[cells] == mesh.group_dim(name)]].sum()) if len(cells) else 0.0
        for name, cells in mesh.cell_groups.items()
    }
