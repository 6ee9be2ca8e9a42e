"""Grids of pyvista for drawing: a mesh, its outer faces, edges between cells, a colour for each macro-element."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.cutting.cut import is_cut
from lacmesh.errors import DataError, some
from lacmesh.mesh import Floats, Ints, Mesh, concatenated, mask_of

Groups = str | Sequence[str] | None
Vector = tuple[float, float, float]
#: colours of macro-elements, close to Paul Tol's light scheme: they differ in lightness as well as in hue
PALETTE = ("#77aadd", "#ee8866", "#eedd88", "#ffaabb", "#99ddff", "#44bb99", "#bbcc33", "#c3a5d9")
#: VTK's types of linear cells; of faces, with ours; the farthest coordinate whose square is finite
LINEAR = (1, 3, 5, 9, 10, 12, 13, 14)
FLAT = {5: "TRIA3", 9: "QUAD4", 22: "TRIA6", 34: "TRIA7", 23: "QUAD8", 28: "QUAD9"}
_FARTHEST = 1e150


def skin_cells(mesh: Mesh, groups: Groups) -> Ints:
    """Sorted faces of groups: cells of the highest dimension among theirs, 1 or 2; None: all slave faces of a cut."""
    if groups is None:
        cells = np.flatnonzero(mesh.cell_data["lac_macro"] >= 0) if is_cut(mesh) else np.empty(0, np.int64)
    else:
        cells = np.unique(concatenated(map(mesh.cells_of, [groups] if isinstance(groups, str) else groups)))
    dim = mesh.cell_dim[cells]
    return cells[(dim == dim.max(initial=0)) & (dim > 0) & (dim < 3)]


def kept_cells(mesh: Mesh, cutaway: Vector | None) -> NDArray[np.bool_]:
    """True for cells that are not cut away (n_cells,). Raises DataError for nodes too far away to be drawn."""
    used = mask_of(mesh.n_nodes, *(block.nodes for block in mesh.blocks))
    far = np.flatnonzero(used & (np.abs(mesh.points) > _FARTHEST).any(axis=1))
    if len(far):
        names = some(mesh.node_number[far])
        raise DataError(f"nodes {names} lie too far away for anything to be drawn; correct their coordinates")
    if cutaway is None or not mesh.n_cells:
        return np.ones(mesh.n_cells, bool)
    along = np.concatenate([mesh.points[b.nodes].mean(axis=1) for b in mesh.blocks]) @ unit(cutaway)
    return np.asarray(along <= (along.min() + along.max()) / 2)


def bodies_of(mesh: Mesh) -> NDArray[np.bool_]:
    """True for cells of the mesh's dimension, and for surfaces, in a plane for lines, that lie on none (n_cells,)."""
    solid = mask_of(mesh.n_nodes, *(b.nodes for b in mesh.blocks if ALL_CELLS[b.type].dim == mesh.dim))
    free = np.concatenate([np.empty(0, bool), *(~solid[b.nodes].all(axis=1) for b in mesh.blocks)])
    return np.asarray(((mesh.cell_dim == mesh.dim) | free) & (mesh.cell_dim > (0 if mesh.dim < 3 else 1)))


def grid_of(mesh: Mesh) -> Any:
    """Return a mesh as a grid of pyvista with the indices of each `cell` and `node`; PYRAM14 has its corners only."""
    parts: dict[str, list[tuple[Ints, Ints]]] = {}
    for k, (kind, nodes) in enumerate(mesh.blocks):
        drawn = kind if kind in CELLS and kind != "PYRAM14" else ALL_CELLS[kind].linear
        ids = np.arange(mesh.offsets[k], mesh.offsets[k + 1])
        parts.setdefault(drawn, []).append((nodes[:, : CELLS[drawn].n_nodes], ids))
    blocks = [(kind, np.concatenate([nodes for nodes, _ in of_kind])) for kind, of_kind in parts.items()]
    grid = Mesh.create(mesh.points, blocks).to_pyvista(groups=False, data=False)
    grid.clear_data()
    grid.point_data["node"] = np.arange(mesh.n_nodes)
    grid.cell_data["cell"] = concatenated(ids for of_kind in parts.values() for _, ids in of_kind)
    return grid


def outer_faces(grid: Any) -> Any:
    """Return the outer faces of a grid's solids, and its other cells, as a grid; quadratic faces stay so."""
    if np.isin(grid.celltypes, LINEAR).all():
        return grid.extract_surface(algorithm="dataset_surface").cast_to_unstructured_grid()
    faces = import_module("vtkmodules.vtkFiltersGeometry").vtkUnstructuredGridGeometryFilter()
    faces.SetInputData(grid)
    faces.Update()
    return import_module("pyvista").wrap(faces.GetOutput())


def edges_between(grid: Any, group: Ints) -> Ints:
    """Edges (e, 3), ends and mid-node or -1, of a grid's faces between two groups (n,), and of one face only."""
    ends, groups = [np.empty((0, 3), np.int64)], [group[:0]]
    for kind, nodes in grid.cells_dict.items():
        corners = CELLS[FLAT[kind]].n_corners if kind in FLAT else 0
        for k in range(corners):
            middle = nodes[:, corners + k] if nodes.shape[1] > corners else np.full(len(nodes), -1)
            ends.append(np.stack([nodes[:, k], nodes[:, (k + 1) % corners], middle], axis=1))
            groups.append(group[grid.celltypes == kind])
    every, of = np.concatenate(ends), np.concatenate(groups)
    key = np.sort(every[:, :2], axis=1) @ [grid.n_points, 1]
    first, label, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)[1:]
    lowest, highest = np.full(len(first), np.inf), np.full(len(first), -np.inf)
    np.minimum.at(lowest, label, of)
    np.maximum.at(highest, label, of)
    return every[first[(count != 2) | (lowest != highest)]]


def painted(grid: Any, macro: Ints) -> Ints:
    """Index in PALETTE of each face of a grid (n,): one colour a macro-element (n,), others for those that touch it."""
    coo = import_module("scipy.sparse").coo_array
    if not len(macro):
        return macro
    names, member = np.unique(macro, return_inverse=True)
    nodes, offset = grid.cell_connectivity, grid.cell_offsets
    touched = coo((np.ones(len(nodes)), (np.repeat(member, np.diff(offset)), nodes))).tocsr()
    near = (touched @ touched.T).tocsr()
    colour, used = np.full(len(names), -1), np.zeros(len(PALETTE))
    for k in range(len(names)):
        row = slice(near.indptr[k], near.indptr[k + 1])
        known = colour[near.indices[row]] >= 0
        clash = np.bincount(colour[near.indices[row]][known], near.data[row][known], len(PALETTE))
        colour[k] = np.lexsort((used, clash))[0]
        used[colour[k]] += 1
    return colour[member]


def unit(v: Any) -> Floats:
    """Unit vector along `v`, of any length; zero stays zero."""
    v = np.asarray(v, float) / (np.abs(v).max() or 1.0)
    return np.asarray(v / (np.linalg.norm(v) or 1.0))
