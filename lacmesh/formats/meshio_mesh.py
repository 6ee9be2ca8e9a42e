"""Conversion between a Mesh and a `meshio.Mesh`: cells, groups as sets, data, numbers.

meshio's readers give nodes in VTK's order, for cells of order above 2 in gmsh's. Data that meshio has no place for
(zones, steps, tags, the model, 2 or 3 dimensions) are kept as text in its `info`, and restored from it.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CARRIED
from lacmesh.errors import DataError, LacmeshWarning, check_installed
from lacmesh.formats import notes
from lacmesh.formats.arrays import GROUP, assembled, to_arrays
from lacmesh.formats.msh.names import unnamed
from lacmesh.formats.vtu.types import OF_TYPE
from lacmesh.mesh import Ints, Mesh, Tag, concatenated

_FAMILIES = {
    "POI": "vertex",
    "SEG": "line",
    "TRIA": "triangle",
    "QUAD": "quad",
    "TETRA": "tetra",
    "HEXA": "hexahedron",
    "PENTA": "wedge",
    "PYRAM": "pyramid",
}
#: our type -> meshio's
NAMES = {
    name: _FAMILIES[cell.family] + (str(cell.n_nodes) if cell.n_nodes > cell.n_corners else "")
    for name, cell in ALL_CELLS.items()
}
_OF_NAME = {theirs: ours for ours, theirs in NAMES.items()}
INFO = "lacmesh"
_PHYSICAL = "gmsh:physical"


def needed() -> Any:
    """Import the package meshio. Raises RequestError if it is missing."""
    check_installed("meshio", "io")
    import meshio

    return meshio


def places(kind: str) -> Ints:
    """Position in lacmesh's order of the node that meshio lists k-th, for a cell type."""
    known = kind in OF_TYPE and kind not in CARRIED
    return np.array(OF_TYPE[kind].nodes if known else range(ALL_CELLS[kind].n_nodes))


def to_meshio(mesh: Mesh) -> Any:
    """The mesh as a `meshio.Mesh`: groups are `cell_sets` and `point_sets`, numbers and data are arrays.

    `cell_data["cell_number"]`, `point_data["node_number"]` are the file's numbers. Raises RequestError where meshio is
    missing. Data that are no numbers are left out.
    """
    meshio = needed()
    arrays = to_arrays(mesh, [])
    bounds = list(pairwise(mesh.offsets))
    sets = {
        name: [cells[(cells >= a) & (cells < b)] - a for a, b in bounds] for name, cells in mesh.cell_groups.items()
    }
    cell = {n: [v[a:b] for a, b in bounds] for n, v in arrays.cell.items() if not n.startswith(GROUP)}
    given = meshio.Mesh(
        mesh.points.copy(),
        [_block(meshio, NAMES[b.type], b.nodes[:, places(b.type)]) for b in mesh.blocks],
        point_data={n: v for n, v in arrays.node.items() if not n.startswith(GROUP)},
        cell_data=cell,
        point_sets={name: nodes.copy() for name, nodes in mesh.node_groups.items()},
        cell_sets=sets,
    )
    given.info = {INFO: notes.to_json(mesh, {**arrays.notes, "file_order": mesh.file_order})}
    return given


def _block(meshio: Any, name: str, nodes: Ints) -> Any:
    """A block of cells; meshio's own constructor does not know the dimension of wedge15, pyramid13 and others."""
    try:
        return meshio.CellBlock(name, nodes)
    except KeyError:
        block = meshio.CellBlock.__new__(meshio.CellBlock)
        block.type, block.data, block.tags = name, nodes, []
        block.dim = ALL_CELLS[_OF_NAME[name]].dim
        return block


def from_meshio(given: Any) -> Mesh:
    """The mesh of a `meshio.Mesh`; sets are groups, and so are gmsh's physical groups where there are no sets.

    Raises DataError for cells that lacmesh lacks (polygons, polyhedra) and for arrays that do not fit.

    >>> from lacmesh import Mesh
    >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> from_meshio(square.to_meshio()).cells_by_type
    {'QUAD4': 1}
    """
    try:
        return _from_meshio(given)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise DataError(f"this meshio mesh cannot be used: {error}") from error


def _from_meshio(given: Any) -> Mesh:
    said: list[str] = []
    points = np.asarray(given.points, float)
    blocks, place = _blocks(given)
    fields, noted = _noted(given, len(points), len(place), said)
    cell = {name: np.concatenate([np.asarray(v) for v in values]) for name, values in given.cell_data.items()}
    groups, tags = _groups(given, np.argsort(place), cell.get(_PHYSICAL))
    if tags:
        cell.pop(_PHYSICAL)
    node = {name: np.asarray(values) for name, values in given.point_data.items()}
    node_groups = {name: np.asarray(nodes) for name, nodes in given.point_sets.items()}
    arrays, more = (_native(cell), _native(node)), {"cell": groups, "node": node_groups}
    mesh = assembled(points, blocks, place, arrays, {"group_tags": tags, **fields}, noted, said, more)
    if said:
        warnings.warn(LacmeshWarning("; ".join(said)), stacklevel=5)
    return mesh


def _blocks(given: Any) -> tuple[dict[str, Ints], Ints]:
    """Nodes by type, in lacmesh's order, and the positions of these cells among all of meshio's."""
    for block in given.cells:
        if block.type not in _OF_NAME:
            raise DataError(f"cells of meshio's type {block.type!r} are not read")
    starts = np.cumsum([0, *(len(block.data) for block in given.cells)])
    rows: dict[str, list[Ints]] = {}
    place: dict[str, list[Ints]] = {}
    for block, a, b in zip(given.cells, starts, starts[1:], strict=False):
        cell_type = _OF_NAME[block.type]
        listed = np.asarray(block.data)
        nodes = np.empty(listed.shape, np.int64)
        nodes[:, places(cell_type)] = listed
        rows.setdefault(cell_type, []).append(nodes)
        place.setdefault(cell_type, []).append(np.arange(a, b))
    order = concatenated(part for parts in place.values() for part in parts)
    return {cell_type: np.concatenate(parts) for cell_type, parts in rows.items()}, order


def _noted(given: Any, n_nodes: int, n_cells: int, said: list[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Mesh fields from the notes in the info (`to_meshio`) or the field data (VTU files), and the notes themselves."""
    info = given.info if isinstance(given.info, dict) else {}
    in_file = np.asarray(given.field_data.get(INFO, ()))
    text = str(info[INFO]) if INFO in info else in_file.tobytes().decode() if in_file.dtype == np.uint8 else ""
    if not text:
        return {}, {}
    fields, noted = notes.from_json(text, n_nodes, said)
    order = noted.get("file_order")
    if order is not None and np.array_equal(np.sort(order), np.arange(n_cells)):
        fields["file_order"] = order
    return fields, noted


def _native(arrays: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Arrays in native byte order, those of width 1 made flat."""
    flat = {n: v[:, 0] if v.ndim == 2 and v.shape[1] == 1 else v for n, v in arrays.items()}
    return {n: v.astype(v.dtype.newbyteorder("=")) if v.dtype.kind in "iuf" else v for n, v in flat.items()}


def _groups(given: Any, index: Ints, physical: NDArray | None) -> tuple[dict[str, Ints], dict[str, tuple[Tag, ...]]]:
    """Cell groups from the sets; else, with their tags, from gmsh's physical groups. `index`: our index by meshio's."""
    sizes = [len(block.data) for block in given.cells]
    starts = np.cumsum([0, *sizes])
    groups = {
        name: index[np.concatenate([_members([]), *(_members(m) + a for m, a in zip(parts, starts, strict=False))])]
        for name, parts in given.cell_sets.items()
        if not name.startswith("gmsh:")
    }
    if groups or physical is None:
        return groups, {}
    dims = np.repeat([ALL_CELLS[_OF_NAME[block.type]].dim for block in given.cells], sizes)
    names = {(int(d), int(t)): name for name, (t, d) in given.field_data.items()}
    tags: dict[str, tuple[Tag, ...]] = {}
    for dim, tag in np.unique(np.stack([dims, physical.astype(np.int64)], axis=1), axis=0).tolist():
        if tag > 0:
            name = names.get((dim, tag), unnamed((dim, tag)))
            here = index[(dims == dim) & (physical == tag)]
            groups[name] = np.concatenate([groups.get(name, _members([])), here])
            tags[name] = (*tags.get(name, ()), (dim, tag))
    return groups, tags


def _members(members: Any) -> Ints:
    return np.asarray([] if members is None else members, np.int64)
