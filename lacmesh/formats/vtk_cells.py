"""Cells as VTK lists them, in VTU files, in XDMF and in pyvista, and their way into a mesh and out of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lacmesh.errors import ReadError
from lacmesh.formats.arrays import add_arrays, numbers_in, with_tag_groups
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.orders import LAGRANGE_HEXAHEDRON, VTK_BY_NUMBER, VTK_CELLS, VTK_NOT_READ, lagrange_8_to_9
from lacmesh.mesh import Ints, Mesh

#: name of the array of a file, or of pyvista's field data, that has the note
NOTE = "lacmesh"


class VtkCells(NamedTuple):
    """Cells as VTK lists them: nodes one cell after the other, where each cell ends, VTK's numbers of the types."""

    connectivity: Ints
    ends: Ints
    types: Ints


def vtk_cells(mesh: Mesh) -> VtkCells:
    """Return the cells of a mesh as VTK lists them, in the order of the file."""
    order = slice(None) if mesh.file_order is None else np.asarray(mesh.file_order)
    blocks = [(block, VTK_CELLS[block.type]) for block in mesh.blocks if len(block.nodes)]
    sizes = [len(block.nodes) for block, _ in blocks]
    width = np.repeat(np.array([len(cell.nodes) for _, cell in blocks], np.int64), sizes)
    types = np.repeat(np.array([cell.number for _, cell in blocks], np.uint8), sizes)
    ends = np.cumsum(width[order], dtype=np.int64)
    total = int(ends[-1]) if len(ends) else 0
    dtype = np.int32 if max(mesh.n_nodes, total) < 2**31 else np.int64
    rows = [block.nodes[:, cell.nodes].astype(dtype, copy=False) for block, cell in blocks]
    flat = np.concatenate([np.empty(0, dtype), *(nodes.ravel() for nodes in rows)])
    if mesh.file_order is not None:
        start = np.cumsum(width) - width  # of each cell in `flat`, and its places in the order of the file
        flat = flat[np.repeat(start[order] - ends + width[order], width[order]) + np.arange(total)]
    return VtkCells(flat, ends.astype(dtype), types[order])


def add_cells(
    out: MeshBuilder,
    cells: VtkCells,
    number: Ints | None,
    error: Callable[[str], ReadError],
    *,
    at: Ints | None = None,
    first_node: int = 0,
    old: bool = False,
) -> None:
    """Add cells as VTK lists them, whose points are rows from `first_node` on; `old`: in the orders of VTK 8.

    `at` (k,): their positions among all cells, by default behind those that are there; -1 leaves a cell out. Raises
    ReadError for cells that lacmesh does not have.
    """
    width = np.diff(cells.ends, prepend=0)
    code = cells.types.astype(np.int64) << 32 | width
    at = out.size("cell") + np.arange(len(code)) if at is None else at
    for value in np.unique(code).tolist():
        vtk_number, n = value >> 32, value & 0xFFFFFFFF
        cell = VTK_BY_NUMBER.get((vtk_number, n))
        if cell is None:
            what = VTK_NOT_READ.get(vtk_number, "cells that lacmesh does not know")
            raise error(f"{what} (VTK's type {vtk_number}, {n} nodes) are not read")
        here = np.flatnonzero((code == value) & (at >= 0))
        if len(here) == len(code):
            rows = cells.connectivity.reshape(-1, n)
        else:
            rows = cells.connectivity[(cells.ends[here] - n)[:, None] + np.arange(n)]
        if old and vtk_number == LAGRANGE_HEXAHEDRON and n > 8:
            rows = rows[:, lagrange_8_to_9(n)]
        nodes = np.empty_like(rows)
        nodes[:, cell.nodes] = rows + first_node if first_node else rows
        out.cells(cell.type, None if number is None else number[here], nodes, at=at[here])


def checked_cells(cells: VtkCells, n_points: int, error: Callable[[str], ReadError]) -> VtkCells:
    """Return cells whose ends fit their nodes, and whose nodes are points. Raises ReadError."""
    nodes, ends = cells.connectivity, cells.ends.astype(np.int64)
    if (np.diff(ends, prepend=0) < 0).any() or (ends[-1] if len(ends) else 0) != len(nodes):
        raise error(f"the offsets do not fit the {len(nodes)} nodes of connectivity")
    if len(nodes) and (nodes.min() < 0 or nodes.max() >= n_points):
        at = int(((nodes < 0) | (nodes >= n_points)).argmax())
        cell = int(np.searchsorted(ends, at, side="right"))
        raise error(f"cell {cell} (from 0) has point {nodes[at]}, and there are {n_points}")
    return cells._replace(ends=ends)


def mesh_of_grid(path: Path, grid: Any) -> Mesh:
    """Return the mesh of a `pyvista.UnstructuredGrid`. Raises ReadError."""
    out = MeshBuilder(path, rows_from=0)
    if NOTE in grid.field_data:
        note = np.asarray(grid.field_data[NOTE])
        out.read_note(note.tobytes() if note.dtype == np.uint8 else str(note[0]))
    arrays = {}
    for on, data in (("node", grid.point_data), ("cell", grid.cell_data)):
        given = {name: np.asarray(data[name]) for name in data.keys()}  # noqa: SIM118, it is no mapping
        kinds = {name: values.astype(np.uint8) if values.dtype == bool else values for name, values in given.items()}
        arrays[on] = {name: values for name, values in kinds.items() if values.dtype.kind in "iuf"}
        left = [name for name in given if name not in arrays[on]]
        out.warnings += [f"{on} data {', '.join(map(repr, left))} are no numbers, they are left out"] if left else []
    out.nodes(numbers_in(arrays["node"], "node", grid.n_points, out), np.asarray(grid.points, float))
    offsets = grid.cell_offsets if hasattr(grid, "cell_offsets") else grid.offset
    cells = VtkCells(np.asarray(grid.cell_connectivity), np.asarray(offsets)[1:], np.asarray(grid.celltypes))
    error = lambda message: ReadError(path, message)  # noqa: E731
    add_cells(out, cells, numbers_in(arrays["cell"], "cell", grid.n_cells, out), error)
    for on in arrays:
        add_arrays(out, on, arrays[on])
    return with_tag_groups(out.mesh(), out, arrays["cell"])
