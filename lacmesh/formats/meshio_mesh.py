"""Between a Mesh and meshio's: cells, groups as sets, data, numbers.

Nodes stand in VTK's order in meshio, as its readers give them; cells of higher order than 2 in gmsh's. What meshio has
no place for (zones, steps, tags, the model, 2 or 3 dimensions) is kept in its `info`, as text, and comes back from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CARRIED
from lacmesh.errors import DataError, RequestError
from lacmesh.formats import notes
from lacmesh.formats.arrays import GROUP, from_arrays, to_arrays
from lacmesh.formats.msh_names import unnamed
from lacmesh.formats.vtu_types import OF_TYPE
from lacmesh.mesh import Ints, Mesh, Tag

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
    """The package meshio. Raises RequestError where it is missing."""
    if find_spec("meshio") is None:
        raise RequestError("this needs meshio; pip install 'lacmesh[io]' brings it")
    import meshio

    return meshio


def places(kind: str) -> Ints:
    """Our place of the node that meshio lists k-th."""
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
    found = meshio.Mesh(
        mesh.points.copy(),
        [_block(meshio, NAMES[b.type], b.nodes[:, places(b.type)]) for b in mesh.blocks],
        point_data={n: v for n, v in arrays.node.items() if not n.startswith(GROUP)},
        cell_data=cell,
        point_sets={name: nodes.copy() for name, nodes in mesh.node_groups.items()},
        cell_sets=sets,
    )
    order = {} if mesh.file_order is None else {"file_order": np.asarray(mesh.file_order).tolist()}
    found.info = {INFO: notes.to_json(mesh, **arrays.notes, **order)}
    return found


def _block(meshio: Any, kind: str, nodes: Ints) -> Any:
    """A block of cells; meshio's own constructor does not know the dimension of wedge15, pyramid13 and others."""
    try:
        return meshio.CellBlock(kind, nodes)
    except KeyError:
        block = meshio.CellBlock.__new__(meshio.CellBlock)
        block.type, block.data, block.tags = kind, nodes, []
        block.dim = ALL_CELLS[_OF_NAME[kind]].dim
        return block


def from_meshio(given: Any) -> Mesh:
    """The mesh of a `meshio.Mesh`; sets are groups, and so are gmsh's physical groups where there are no sets.

    Raises DataError for cells that lacmesh lacks (polygons, polyhedra) and for arrays that do not fit.
    """
    try:
        return _from_meshio(given)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise DataError(f"this meshio mesh cannot be used: {error}") from error


def _from_meshio(given: Any) -> Mesh:
    said: list[str] = []
    fields: dict[str, Any] = {}
    noted: dict[str, Any] = {}
    points = np.asarray(given.points, float)
    info = given.info if isinstance(given.info, dict) else {}
    if INFO in info:
        fields, noted = notes.from_json(str(info[INFO]), len(points), said)
    for block in given.cells:
        if block.type not in _OF_NAME:
            raise DataError(f"cells of meshio's type {block.type!r} are not read")
    kinds = [_OF_NAME[block.type] for block in given.cells]
    sizes = [len(block.data) for block in given.cells]
    starts = np.cumsum([0, *sizes])
    of_kind = {kind: [k for k, other in enumerate(kinds) if other == kind] for kind in dict.fromkeys(kinds)}
    blocks = {kind: np.concatenate([_nodes(given.cells[k].data, kind) for k in ks]) for kind, ks in of_kind.items()}
    order = np.concatenate(
        [np.empty(0, np.int64), *(np.arange(starts[k], starts[k + 1]) for ks in of_kind.values() for k in ks)]
    )
    place = np.argsort(order)
    cell = {name: np.concatenate([np.asarray(v) for v in values])[order] for name, values in given.cell_data.items()}
    node = {name: np.asarray(values) for name, values in given.point_data.items()}
    found, tags = _groups(given, starts, place, {n: v for n, v in cell.items() if n == _PHYSICAL}, blocks)
    if tags:
        cell.pop(_PHYSICAL)
    plain = from_arrays(_native(cell), _native(node), (len(order), len(points)), noted, said)
    plain["cell_groups"] = {**plain["cell_groups"], **found}
    plain["node_groups"] = {**plain["node_groups"], **{n: np.asarray(v) for n, v in given.point_sets.items()}}
    listed = noted.get("file_order")
    if isinstance(listed, list) and sorted(listed) == list(range(len(order))):
        plain["file_order"] = np.array(listed, np.int64)
    elif len(given.cells) > len(blocks):
        plain["file_order"] = place
    fields = {"group_tags": tags, **fields, **plain}
    steps = fields.get("steps", {})
    fields["steps"] = {k: s for k, s in steps.items() if k in plain["cell_data"] or k in plain["node_data"]}
    if not fields.get("zones") and "lac_zone" in plain["cell_data"]:
        from lacmesh.formats.med_notes import zone_names

        fields["zones"] = zone_names(plain["cell_data"], plain["cell_groups"])
    return Mesh.create(points, blocks.items(), **fields)


def _nodes(data: Any, kind: str) -> Ints:
    rows = np.asarray(data)
    nodes = np.empty(rows.shape, np.int64)
    nodes[:, places(kind)] = rows
    return nodes


def _native(arrays: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Arrays of the machine's byte order, vectors that are one number wide flat."""
    flat = {n: v[:, 0] if v.ndim == 2 and v.shape[1] == 1 else v for n, v in arrays.items()}
    return {n: v.astype(v.dtype.newbyteorder("=")) if v.dtype.kind in "iuf" else v for n, v in flat.items()}


def _groups(
    given: Any, starts: Ints, place: Ints, physical: Mapping[str, NDArray], blocks: Mapping[str, Ints]
) -> tuple[dict[str, Ints], dict[str, tuple[Tag, ...]]]:
    """Groups of cells from the sets; else, with their tags, from gmsh's physical groups."""
    groups = {
        name: place[
            np.concatenate([np.empty(0, np.int64), *(_members(m) + a for m, a in zip(parts, starts, strict=False))])
        ]
        for name, parts in given.cell_sets.items()
        if not name.startswith("gmsh:")
    }
    if groups or _PHYSICAL not in physical:
        return groups, {}
    dims = np.concatenate([np.full(len(rows), ALL_CELLS[kind].dim) for kind, rows in blocks.items()])
    names = {(int(d), int(t)): name for name, (t, d) in given.field_data.items()}
    tags: dict[str, tuple[Tag, ...]] = {}
    for dim, tag in np.unique(np.stack([dims, physical[_PHYSICAL].astype(np.int64)], axis=1), axis=0).tolist():
        if tag > 0:
            name = names.get((dim, tag), unnamed((dim, tag)))
            here = np.flatnonzero((dims == dim) & (physical[_PHYSICAL] == tag))
            groups[name] = np.concatenate([groups.get(name, np.empty(0, np.int64)), here])
            tags[name] = (*tags.get(name, ()), (dim, tag))
    return groups, tags


def _members(members: Any) -> Ints:
    return np.asarray([] if members is None else members, np.int64)
