"""A mesh as named arrays and VTK's list of cells, for what has nothing else: VTU, XDMF, objects of pyvista and meshio.

    group:NAME      0 or 1: membership of a group; groups may overlap, and ParaView can threshold them
    cell_number     the file's numbers of the cells;  node_number: of the nodes
    anything else   the data of the mesh, under its own name: fields, the records of a cut (lac_*), entity, partition

What an array itself cannot hold (a name illegal in the format, rows of several dimensions) goes into the note.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import replace
from itertools import chain, count, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD
from lacmesh.errors import DataError, ReadError, check_installed, listed
from lacmesh.facts import listed as first_of
from lacmesh.formats import notes
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.orders import (
    LAGRANGE_HEXAHEDRON,
    MESHIO_NAMES,
    VTK_BY_NUMBER,
    VTK_CELLS,
    VTK_NOT_READ,
    lagrange_8_to_9,
    meshio_nodes,
)
from lacmesh.mesh import Ints, Mesh, Tag, concatenated

#: name of the array of a file, or of pyvista's field data, that has the note
NOTE = "lacmesh"
GROUP = "group:"
#: gmsh's physical groups in cell data of meshio
_PHYSICAL = "gmsh:physical"
_OF_MESHIO = {theirs: ours for ours, theirs in MESHIO_NAMES.items()}
NUMBER = {"cell": "cell_number", "node": "node_number"}
#: most tags that an array of integers may have to be tags, and arrays of integers that are no tags
_MOST_TAGS = 1000
_NO_TAGS = frozenset({"vtkGhostType", "vtkOriginalCellIds", "entity", "partition", *CELL_RECORDS})


class Arrays(NamedTuple):
    """Arrays on cells and on nodes, each (n,) or (n, m); `names`, `shapes`: what the arrays cannot hold, for a note."""

    cell: dict[str, NDArray]
    node: dict[str, NDArray]
    names: dict[str, dict[str, str]]
    shapes: dict[str, dict[str, list[int]]]

    def note(self, mesh: Mesh, **more: Any) -> str:
        """Return the text of the mesh's note, in JSON; it is never empty, so that a file of lacmesh is known by it."""
        fields = ("name", "space_dim", "zones", "group_tags", "steps", "model")
        return notes.dump(mesh, *fields, names=self.names, shapes=self.shapes, of="lacmesh", **more)


def to_arrays(mesh: Mesh, left_out: list[str], tidy: Callable[[str], str] = str) -> Arrays:
    """Numbers, groups and data of a mesh as arrays on cells and nodes; `tidy` makes a name legal in the format.

    Data that cannot be an array of numbers are left out, with a message in `left_out`.
    """
    arrays = Arrays({}, {}, {"cell": {}, "node": {}}, {"cell": {}, "node": {}})
    for on, groups, data, number, named in (
        ("cell", mesh.cell_groups, mesh.cell_data, mesh.cell_number, arrays.cell),
        ("node", mesh.node_groups, mesh.node_data, mesh.node_number, arrays.node),
    ):
        named[NUMBER[on]] = np.asarray(number, np.int64)
        for name, members in groups.items():
            inside = np.zeros(len(number), np.uint8)
            inside[members] = 1
            named[_unique(GROUP, name, tidy, named, arrays.names[on])] = inside
        for name, original in data.items():
            values = _storable(original)
            if values is None:
                left_out.append(
                    f"data {name!r} ({np.asarray(original).dtype}, shape {np.shape(original)}) are left out"
                )
                continue
            key = _unique("data:" if name.startswith(GROUP) else "", name, tidy, named, arrays.names[on])
            named[key] = values
            if np.shape(original)[1:] != values.shape[1:] or np.shape(original)[1:] == (1,):
                arrays.shapes[on][key] = list(np.shape(original)[1:])
    return arrays


def _unique(prefix: str, name: str, tidy: Callable[[str], str], known: Container[str], names: dict[str, str]) -> str:
    """Unused name for an array; if it differs from the prefix and the name, `names` maps it to the original name."""
    key = prefix + tidy(name)
    key = next(k for k in chain([key], (f"{key}_{n}" for n in count(2))) if k and k not in known)
    if key != prefix + name or prefix == "data:":
        names[key] = name
    return key


def _storable(original: NDArray) -> NDArray | None:
    """Data as native integers or reals, (n,) or (n, m); None if no array of a file can hold them."""
    values = np.asarray(original)
    if values.dtype.kind not in "fiub" or 0 in values.shape[1:]:
        return None
    if values.dtype.kind == "b":
        values = values.astype(np.uint8)
    elif values.dtype.kind == "f" and values.dtype.itemsize not in (4, 8):
        values = values.astype(np.float32 if values.dtype.itemsize < 4 else np.float64)
    values = values.astype(values.dtype.newbyteorder("="), copy=False)
    if values.ndim > 2:
        return values.reshape(len(values), int(np.prod(values.shape[1:])))
    return values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values


def numbers_in(arrays: Mapping[str, NDArray], on: str, size: int, out: MeshBuilder) -> Ints | None:
    """Return the numbers (size,) of nodes or cells among their arrays; None, with a warning, if they are not such."""
    values = arrays.get(NUMBER[on])
    if values is None or values.shape != (size,):
        return None
    numbers = _integers(values)
    if numbers is None or numbers.min(initial=1) < 1:
        out.warnings.append(f"{on}s are counted from 1: {NUMBER[on]} is not positive and distinct")
        return None
    return numbers.astype(np.int64)


def add_arrays(out: MeshBuilder, on: str, arrays: Mapping[str, NDArray], rows: Ints | None = None) -> None:
    """Add arrays on nodes or cells, of all or of some `rows`: marks of groups, and data; numbers go with the cells."""
    names, shapes = (_noted(out, key, on) for key in ("names", "shapes"))
    for key, values in arrays.items():
        name = str(names.get(key, key))
        if key == NUMBER[on] and values.ndim == 1:
            continue
        whole = _integers(values) if key.startswith(GROUP) and values.ndim == 1 else None
        if whole is not None and whole.min(initial=0) >= 0 and whole.max(initial=0) <= 1:
            inside = np.flatnonzero(values)
            out.group(on, str(names.get(key, key.removeprefix(GROUP))), inside if rows is None else rows[inside])
        else:
            name, values = _sound(name, _shaped(values, shapes.get(key)), out)
            out.values(on, name, rows, values)


def _noted(out: MeshBuilder, key: str, on: str) -> Mapping[str, Any]:
    """Return what the note has of the arrays on nodes or cells; nothing, with a warning, if it is no such mapping."""
    noted = out.note.get(key, {})
    noted = noted.get(on, {}) if isinstance(noted, dict) else None
    if not isinstance(noted, dict):
        out.warnings.append("lacmesh's own note is damaged and left out")
        return {}
    return noted


def _integers(values: NDArray) -> Ints | None:
    """Values as integers, also if a tool stored them as reals; None if some are not integers."""
    if values.dtype.kind in "iu":
        return None if values.dtype == np.uint64 and len(values) and values.max() >= 2**63 else values
    if values.dtype.kind != "f" or not np.isfinite(values).all():
        return None
    whole = np.rint(values)
    return values.astype(np.int64) if (whole == values).all() and (np.abs(whole) < 2.0**53).all() else None


def _shaped(values: NDArray, shape: Any) -> NDArray:
    """Reshape the rows of an array as the note says, if its size allows."""
    if not isinstance(shape, list) or any(type(n) is not int or n <= 0 for n in shape):
        return values
    fits = int(np.prod([len(values), *shape], dtype=object)) == values.size
    return values.reshape(len(values), *shape) if fits else values


def _sound(name: str, values: NDArray, out: MeshBuilder) -> tuple[str, NDArray]:
    """Return data whose name lacmesh reserves as integers, or under another name if they do not fit its meaning."""
    if name not in ("entity", NODE_RECORD, *CELL_RECORDS):
        return name, values
    whole = _integers(values)
    if whole is None or values.shape[1:] != ((2,) if name == "entity" else ()):
        out.warnings.append(f"data {name!r} are not what lacmesh means by that name: they are {name + '_'!r} now")
        return name + "_", values
    return name, values if values.dtype.kind == "i" else whole.astype(np.int64)


def mesh_with_tags(out: MeshBuilder, arrays: Container[str], **rest: Any) -> Mesh:
    """Return the mesh of a builder; one without groups has those of its tags: lacmesh's own files have names.

    `arrays`: names of those on cells; `rest`: as `MeshBuilder.mesh` takes it.
    """

    def with_tags(mesh: Mesh) -> Mesh:
        if out.note or mesh.cell_groups or NUMBER["cell"] in arrays:
            return mesh
        groups, tags, message = groups_of_tags(mesh.cell_dim, mesh.cell_data)
        out.warnings += [message] if message else []
        return replace(mesh, cell_groups=groups, group_tags=tags)

    return out.mesh(with_tags, **rest)


def groups_of_tags(dims: Ints, data: Mapping[str, NDArray]) -> tuple[dict[str, Ints], dict[str, tuple[Tag, ...]], str]:
    """Return groups of cells of one tag, an integer >= 0, the dimension and tag of each, and a message on their names.

    `dims` (n,): dimensions of the cells; `data`: arrays on them, of which those of few integers are tags, if cells of
    some dimension differ. A group has its number as its name; `2:5`, its dimension and number, where others have that
    number too.

    >>> groups_of_tags(np.array([3, 3, 3, 3, 2, 2]), {"tags": np.array([1, 1, 4, 4, 7, 7])})[1:]
    ({'7': ((2, 7),), '1': ((3, 1),), '4': ((3, 4),)}, "no group has a name in this file: ... numbers (7, 1, 4)")
    """
    tagged: list[tuple[str, Tag, Ints]] = []
    for array, values in data.items():
        if values.shape != dims.shape or values.dtype.kind not in "iu" or array in _NO_TAGS:
            continue
        least = 1 if ":" in array else 0  # 0 is no tag in the formats of meshio: medit:ref, nastran:ref, su2:tag
        pairs = np.unique(np.stack([dims, values], axis=1), axis=0)
        tags = pairs[pairs[:, 1] >= least]
        if len(pairs) > len(np.unique(dims)) and len(tags) <= min(_MOST_TAGS, max(1, len(dims) // 2)):
            tagged += [(array, (d, t), np.flatnonzero((dims == d) & (values == t))) for d, t in tags.tolist()]
    of_number = Counter(tag for _, (_, tag), _ in tagged)
    of_tag = Counter(tag for _, tag, _ in tagged)
    groups, group_tags = dict[str, Ints](), dict[str, tuple[Tag, ...]]()
    for array, tag, cells in tagged:
        name = f"{tag[0]}:{tag[1]}" if of_tag[tag] == 1 else f"{array} {tag[1]}"
        name = str(tag[1]) if of_number[tag[1]] == 1 else name
        groups[name] = cells
        if of_tag[tag] == 1 and tag[1] > 0:
            group_tags[name] = (tag,)
    arrays = listed([repr(array) for array in dict.fromkeys(array for array, _, _ in tagged)], "and")
    message = f"no group has a name in this file: the tags {arrays} are groups, named by their numbers"
    return groups, group_tags, f"{message} ({first_of(groups, 10)})" if tagged else ""


# ---- cells as VTK lists them


class VtkCells(NamedTuple):
    """Cells as VTK lists them: nodes one cell after the other, where each cell ends, VTK's numbers of the types."""

    connectivity: Ints
    ends: Ints
    types: Ints

    def by_kind(self) -> Iterator[tuple[int, int, Ints, Ints]]:
        """Yield each type's number and size n, the rows (k,) of its cells and their nodes (k, n)."""
        code = self.types.astype(np.int64) << 32 | np.diff(self.ends, prepend=0)
        for value in np.unique(code).tolist():
            rows, n = np.flatnonzero(code == value), value & 0xFFFFFFFF
            if len(rows) == len(code):
                yield value >> 32, n, rows, self.connectivity.reshape(len(rows), n)
            else:
                yield value >> 32, n, rows, self.connectivity[(self.ends[rows] - n)[:, None] + np.arange(n)]


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
    at = out.size("cell") + np.arange(len(cells.types)) if at is None else at
    for vtk_number, n, rows, listed_nodes in cells.by_kind():
        cell = VTK_BY_NUMBER.get((vtk_number, n))
        if cell is None:
            what = VTK_NOT_READ.get(vtk_number, "cells that lacmesh does not know")
            raise error(f"{what} (VTK's type {vtk_number}, {n} nodes) are not read")
        there = at[rows] >= 0
        here = rows[there]
        if old and vtk_number == LAGRANGE_HEXAHEDRON and n > 8:
            listed_nodes = listed_nodes[:, lagrange_8_to_9(n)]
        nodes = np.empty((len(here), n), listed_nodes.dtype)
        nodes[:, cell.nodes] = (listed_nodes if there.all() else listed_nodes[there]) + first_node
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


# ---- meshio's objects


def needed() -> Any:
    """Import the package meshio. Raises RequestError if it is missing."""
    check_installed("meshio", "io")
    import meshio

    return meshio


def to_meshio(mesh: Mesh) -> Any:
    """The mesh as a `meshio.Mesh`: groups are `cell_sets` and `point_sets`, numbers and data are arrays.

    `cell_data["cell_number"]`, `point_data["node_number"]` are the file's numbers. Raises RequestError where meshio is
    missing. Data that are no numbers are left out.
    """
    meshio, arrays = needed(), to_arrays(mesh, [])
    bounds = list(pairwise(mesh.offsets))
    foreign = meshio.Mesh(
        mesh.points.copy(),
        [_block(meshio, b.type, b.nodes[:, meshio_nodes(b.type)]) for b in mesh.blocks],
        point_data={name: v for name, v in arrays.node.items() if not name.startswith(GROUP)},
        cell_data={n: [v[a:b] for a, b in bounds] for n, v in arrays.cell.items() if not n.startswith(GROUP)},
        point_sets={name: nodes.copy() for name, nodes in mesh.node_groups.items()},
        cell_sets={n: [c[(c >= a) & (c < b)] - a for a, b in bounds] for n, c in mesh.cell_groups.items()},
    )
    order = None if mesh.file_order is None else mesh.file_order.tolist()
    foreign.info = {NOTE: arrays.note(mesh, file_order=order)}
    return foreign


def _block(meshio: Any, kind: str, nodes: Ints) -> Any:
    """A block of cells; meshio's own constructor does not know the dimension of wedge15, pyramid13 and others."""
    block = meshio.CellBlock.__new__(meshio.CellBlock)
    block.type, block.data, block.tags, block.dim = MESHIO_NAMES[kind], nodes, [], ALL_CELLS[kind].dim
    return block


def from_meshio(foreign: Any) -> Mesh:
    """The mesh of a `meshio.Mesh`; sets are groups, and so are gmsh's physical groups where there are no sets.

    Raises DataError for cells that lacmesh lacks (polygons, polyhedra) and for arrays that do not fit.

    >>> from lacmesh import Mesh
    >>> square = Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1]], [("QUAD4", [[0, 1, 2, 3]])])
    >>> from_meshio(square.to_meshio()).cells_by_type
    {'QUAD4': 1}
    """
    try:
        return mesh_of_meshio(foreign, Path("meshio"))
    except ReadError as error:
        raise DataError(f"this meshio mesh cannot be used: {error.reason}") from error
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise DataError(f"this meshio mesh cannot be used: {error}") from error


def mesh_of_meshio(foreign: Any, path: Path) -> Mesh:
    """The mesh of a `meshio.Mesh`. Raises ReadError, DataError, and what numpy raises on arrays that do not fit."""
    out = MeshBuilder(path, rows_from=0)
    for block in foreign.cells:
        if block.type not in _OF_MESHIO:
            raise DataError(f"cells of meshio's type {block.type!r} are not read")
    starts = np.cumsum([0, *(len(block.data) for block in foreign.cells)]).tolist()
    # the note is in the info or, of a VTU file, in the field data
    n, in_file = len(foreign.points), np.asarray(foreign.field_data.get(NOTE, ()))
    info = foreign.info.get(NOTE) if isinstance(foreign.info, dict) else None
    if text := in_file.tobytes() if info is None and in_file.dtype == np.uint8 else str(info or ""):
        out.read_note(text)
    order, rows = np.asarray(out.note.get("file_order", ())), np.arange(starts[-1])
    rows = np.argsort(order) if np.array_equal(np.sort(order), rows) else rows  # places of the cells in the file
    on_cells = {name: _native(np.concatenate([*map(np.asarray, parts)])) for name, parts in foreign.cell_data.items()}
    on_nodes = {name: _native(np.asarray(values)) for name, values in foreign.point_data.items()}
    out.nodes(numbers_in(on_nodes, "node", n, out), np.asarray(foreign.points, float))
    number = numbers_in(on_cells, "cell", starts[-1], out)
    for block, (first, last) in zip(foreign.cells, pairwise(starts), strict=True):
        kind, listed = _OF_MESHIO[block.type], np.asarray(block.data)
        nodes = np.empty(listed.shape, np.int64)
        nodes[:, meshio_nodes(kind)] = listed
        out.cells(kind, None if number is None else number[first:last], nodes, at=rows[first:last])
    for name, parts in foreign.cell_sets.items():
        if not name.startswith("gmsh:"):
            out.group("cell", name, rows[concatenated(_members(m) + a for m, a in zip(parts, starts, strict=False))])
    for name, nodes in foreign.point_sets.items():
        out.group("node", name, _members(nodes))
    tags: dict[str, tuple[Tag, ...]] = {}
    if _PHYSICAL in on_cells and all(name.startswith("gmsh:") for name in foreign.cell_sets):
        tags = _physical_groups(foreign, on_cells.pop(_PHYSICAL), rows, out)
    add_arrays(out, "cell", on_cells, rows)
    add_arrays(out, "node", on_nodes)
    return mesh_with_tags(out, on_cells, group_tags=tags)


def _native(values: NDArray) -> NDArray:
    """An array in native byte order, flat if its width is 1."""
    flat = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
    return flat.astype(flat.dtype.newbyteorder("="), copy=False) if flat.dtype.kind in "iuf" else flat


def _physical_groups(foreign: Any, physical: NDArray, rows: Ints, out: MeshBuilder) -> dict[str, tuple[Tag, ...]]:
    """Add gmsh's physical groups, a tag for each cell; return the tags of each group."""
    sizes = [len(block.data) for block in foreign.cells]
    dims = np.repeat([ALL_CELLS[_OF_MESHIO[block.type]].dim for block in foreign.cells], sizes)
    names = {(int(dim), int(tag)): name for name, (tag, dim) in foreign.field_data.items()}
    tags: dict[str, tuple[Tag, ...]] = {}
    for dim, tag in np.unique(np.stack([dims, physical.astype(np.int64)], axis=1), axis=0).tolist():
        if tag > 0:
            name = names.get((dim, tag), f"{dim}:{tag}")
            out.group("cell", name, rows[(dims == dim) & (physical == tag)])
            tags[name] = (*tags.get(name, ()), (dim, tag))
    return tags


def _members(members: Any) -> Ints:
    return np.asarray([] if members is None else members, np.int64)
