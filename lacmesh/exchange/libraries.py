"""Meshes to and from the libraries people use: meshio, pyvista, trimesh. Nothing is written to a disk.

Each of them is an extra (`lacmesh[io]`, `lacmesh[view]`), and imported when it is used.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lacmesh.cells import ALL_CELLS, PIECES
from lacmesh.errors import DataError, ReadError, RequestError, check_installed
from lacmesh.formats.arrays import (
    GROUP,
    NOTE,
    NUMBER,
    VtkCells,
    add_arrays,
    add_cells,
    from_meshio,
    mesh_with_tags,
    numbers_in,
    to_arrays,
    to_meshio,
    vtk_cells,
)
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.orders import VTK_CELLS
from lacmesh.mesh import Ints, Mesh

__all__ = ["from_meshio", "from_pyvista", "to_meshio", "to_pyvista", "to_trimesh"]


def to_pyvista(mesh: Mesh, *, groups: bool = True, data: bool = True) -> Any:
    """The mesh as a `pyvista.UnstructuredGrid`, its cells in the order of the file.

    `cell_data` and `point_data` hold what a VTU file does: `group:NAME` (0 or 1), `cell_number`, `node_number`, and the
    data; `groups`, `data`: whether those are wanted. Raises RequestError where pyvista is missing, DataError for cells
    that VTK lacks (PYRAM14; TRIA9, TRIA12, QUAD12 and pyramids and prisms of higher order).
    """
    check_installed("pyvista", "view")
    import pyvista

    for kind, n in mesh.cells_by_type.items():
        if kind not in VTK_CELLS:
            raise DataError(f"VTK has no cells of type {kind}, the mesh has {n}; lower their order")
    connectivity, ends, types = vtk_cells(mesh)
    width = np.diff(ends, prepend=0)
    cells = np.insert(connectivity.astype(np.int64), ends - width, width)
    grid = pyvista.UnstructuredGrid(cells, types.astype(np.uint8), mesh.points.astype(float))
    arrays = to_arrays(mesh, [])
    order = slice(None) if mesh.file_order is None else np.asarray(mesh.file_order)
    for values, into, rows in ((arrays.cell, grid.cell_data, order), (arrays.node, grid.point_data, slice(None))):
        for name, array in values.items():
            if name in NUMBER.values() or (groups if name.startswith(GROUP) else data):
                into[name] = array[rows]
    grid.field_data[NOTE] = [arrays.note(mesh)]
    return grid


def from_pyvista(grid: Any) -> Mesh:
    """The mesh of a `pyvista.UnstructuredGrid`, or of other pyvista data that can be cast to one.

    Arrays named as `to_pyvista` names them become groups and numbers again, others are data. Raises RequestError for
    what is no data of pyvista, DataError for cells that lacmesh does not have.
    """
    check_installed("pyvista", "view")
    if not hasattr(grid, "cast_to_unstructured_grid"):
        raise RequestError(f"from_pyvista takes the data sets of pyvista, not {type(grid).__name__}")
    try:
        return _mesh_of(grid.cast_to_unstructured_grid())
    except ReadError as error:
        raise DataError(f"this grid is no mesh of lacmesh: {error.reason}") from None


def _mesh_of(grid: Any) -> Mesh:
    """Return the mesh of a `pyvista.UnstructuredGrid`. Raises ReadError."""
    path = Path("pyvista")
    out = MeshBuilder(path, rows_from=0)
    if NOTE in grid.field_data:
        note = np.asarray(grid.field_data[NOTE])
        out.read_note(note.tobytes() if note.dtype == np.uint8 else str(note[0]))
    arrays = {}
    for on, data in (("node", grid.point_data), ("cell", grid.cell_data)):
        named = {name: np.asarray(data[name]) for name in data.keys()}  # noqa: SIM118, it is no mapping
        named = {name: values.astype(np.uint8) if values.dtype == bool else values for name, values in named.items()}
        arrays[on] = {name: values for name, values in named.items() if values.dtype.kind in "iuf"}
        left = [name for name in named if name not in arrays[on]]
        out.warnings += [f"{on} data {', '.join(map(repr, left))} are no numbers, they are left out"] if left else []
    out.nodes(numbers_in(arrays["node"], "node", grid.n_points, out), np.asarray(grid.points, float))
    offsets = grid.cell_offsets if hasattr(grid, "cell_offsets") else grid.offset
    cells = VtkCells(np.asarray(grid.cell_connectivity), np.asarray(offsets)[1:], np.asarray(grid.celltypes))
    error = lambda message: ReadError(path, message)  # noqa: E731
    add_cells(out, cells, numbers_in(arrays["cell"], "cell", grid.n_cells, out), error)
    for on in arrays:
        add_arrays(out, on, arrays[on])
    return mesh_with_tags(out, arrays["cell"])


def to_trimesh(mesh: Mesh, group: str) -> Any:
    """The skin faces of a group as a `trimesh.Trimesh`: triangles oriented as the faces, on the nodes they use.

    A QUAD4 is two triangles; a quadratic face is split at its mid-nodes. `metadata`: for each triangle its face, as an
    index (`cell`) and by the file's number (`cell_number`); for each vertex its node, likewise (`node`, `node_number`).
    Raises RequestError where trimesh is missing, GroupNotFoundError, DataError where the group has no such faces.
    """
    check_installed("trimesh", "io")
    import trimesh

    cells = mesh.cells_of(group)
    triangles, owners = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for kind, chosen, nodes in mesh.select(cells[mesh.cell_dim[cells] == 2]):
        parts = PIECES[kind if kind in PIECES else ALL_CELLS[kind].linear]
        triangles.append(nodes[:, parts].reshape(-1, 3).astype(np.int64))
        owners.append(np.repeat(chosen, len(parts)))
    faces, cell = np.concatenate(triangles), np.concatenate(owners)
    if not len(faces):
        raise DataError(f"the group {group!r} has no faces of dimension 2")
    used, inverse = np.unique(faces, return_inverse=True)
    place: Ints = inverse.reshape(-1, 3)
    metadata = {"group": group, "cell": cell, "cell_number": mesh.cell_number[cell]}
    metadata |= {"node": used, "node_number": mesh.node_number[used]}
    return trimesh.Trimesh(mesh.points[used], place, process=False, validate=False, metadata=metadata)
