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


def visible_cells(mesh: Mesh, cutaway: Vector | None) -> NDArray[np.bool_]:
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


def outlines(grid: Any, group: Ints, level: int) -> Any:
    """Return the lines around each group (n,) of a grid's faces; `level`: how finely curved faces are divided."""
    grid = grid.copy(deep=False)
    grid["group"] = group
    faces = grid.extract_surface(algorithm="dataset_surface", nonlinear_subdivision=level).cast_to_unstructured_grid()
    own = np.repeat(np.asarray(faces["group"]), np.diff(faces.cell_offsets))
    points, apart = np.unique(np.stack([own, faces.cell_connectivity]), axis=1, return_inverse=True)  # each group's own
    cells = np.insert(apart, faces.cell_offsets[:-1], np.diff(faces.cell_offsets))
    apart = import_module("pyvista").UnstructuredGrid(cells, faces.celltypes, faces.points[points[1].astype(int)])
    return apart.extract_feature_edges(feature_edges=False, manifold_edges=False)


def face_colours(grid: Any, macro: Ints) -> Ints:
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
