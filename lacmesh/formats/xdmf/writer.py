"""Writing XDMF 3: a grid for the cells of each dimension, on the same points, so that dolfinx can read each by name.

    mesh       the cells of the highest dimension; `read_mesh(name="mesh")`
    facets     those of one dimension less; `read_meshtags(mesh, name="facets", attribute_name="group:slave")`
    edges, vertices     the others

A grid of one type of cells is uniform, which dolfinx asks for; others are a mixture, which ParaView reads too. Its
first attribute `tags` gives every cell a number by the groups it is in (the Information `tags` says which); then come
the arrays of `arrays.py`: a group of its own is `group:NAME`, in integers of 32 bits, which dolfinx reads. Values
on nodes are on the grid `mesh`. The Information `lacmesh` holds the notes, in JSON.

The arrays are in the HDF5 file of the same name (dolfinx looks for no other), or, as text, in the XML. Both carry the
same `lacmesh_id`, so that a file whose other half was replaced is noticed.
"""

from __future__ import annotations

import json
import warnings
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import escape, quoteattr

import h5py
import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshWarning, WriteError
from lacmesh.formats.arrays import GROUP, to_arrays
from lacmesh.formats.med import families_of as derive
from lacmesh.formats.hdf5 import image as created, set_attributes
from lacmesh.formats.notes import to_json
from lacmesh.formats.output import readable
from lacmesh.formats.table import DEFAULT, WriteOptions
from lacmesh.formats.vtu.types import OF_TYPE as VTK_OF_TYPE
from lacmesh.formats.vtu.writer import legal
from lacmesh.formats.writing import file_order, is_plane
from lacmesh.formats.xdmf.types import OF_TYPE, XDMF_TYPES
from lacmesh.mesh import Ints, Mesh, places_of

NOTES, ID, TAGS, PLACE = "lacmesh", "lacmesh_id", "tags", "file_place"
#: Where the two files' common mark goes, once all arrays are written.
MARK = "<!-- mark -->"
_KINDS = {1: "Scalar", 3: "Vector", 6: "Tensor6", 9: "Tensor"}
_NUMBERS = {"i": "Int", "u": "UInt", "f": "Float"}


def write(path: Path, mesh: Mesh, options: WriteOptions = DEFAULT) -> None:
    """Write a mesh: XML to `path`, arrays to the `second` file, of HDF5; without it, as text.

    `compress`: everything in the HDF5 file, not the groups only. Raises WriteError for a cell that XDMF lacks. What is
    left out is named in a LacmeshWarning.
    """
    _check(path, mesh)
    heavy, link = options.second or (None, "")
    if readable(link) != link:
        raise WriteError(path, f"XML cannot name the second file, {link}, as its name is no UTF-8; choose another name")
    said: list[str] = []
    with ExitStack() as stack:
        sink: _Text | _Heavy = _Text()
        if heavy is not None:
            sink = _Heavy(stack.enter_context(created(heavy)), link, options.compress)
        body = _domain(mesh, sink, said)
        mark = ""  # told in the body where MARK stands
        if isinstance(sink, _Heavy):
            mark = f"{sink.digest:08x}{zlib.crc32(body.encode()):08x}"
            set_attributes(sink.root, **{ID: mark})  # of fixed length: HDF5 may never end on a damaged one of another
        body = body.replace(MARK, _information(ID, mark) if mark else "", 1)
    with path.open("w", encoding="utf-8") as file:
        file.write('<?xml version="1.0" encoding="utf-8"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n')
        file.write('<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude">\n<Domain>\n')
        file.write(body + "</Domain>\n</Xdmf>\n")
    if said:
        warnings.warn("XDMF: " + "; ".join(said), LacmeshWarning, stacklevel=3)


def is_ours(heavy: Path) -> bool:
    """True if an HDF5 file is the second half of an XDMF file that lacmesh wrote."""
    try:
        with h5py.File(heavy, "r") as file:
            return ID in file.attrs
    except (OSError, RuntimeError):
        return False


def _check(path: Path, mesh: Mesh) -> None:
    for cell_type, n in mesh.cells_by_type.items():
        if cell_type not in OF_TYPE:
            what = {"PYRAM14": "write them as PYRAM13", "TRIA7": "write a .vtu, .med or .msh file"}.get(cell_type)
            message = f"XDMF has no cells of type {cell_type}, the mesh has {n}; {what or 'write a .vtu or .msh file'}"
            raise WriteError(path, message)


class _Text:
    """Destination of the arrays: as text, where they belong in the XML."""

    def item(self, place: str, values: NDArray, packed: bool) -> str:
        """Store an array, and return the XML of the DataItem that refers to it."""
        rows = values.tolist() if values.ndim == 2 else [[v] for v in values.tolist()]
        form = repr if values.dtype.kind == "f" and values.dtype.itemsize == 8 else "{:.9g}".format
        text = "\n".join(" ".join(map(form if values.dtype.kind == "f" else str, row)) for row in rows)
        return f'<DataItem {_shape(values)} Format="XML">\n{text}\n</DataItem>\n'


class _Heavy:
    """Destination of the arrays: an HDF5 file; `digest` runs over all that was put there."""

    def __init__(self, root: h5py.Group, link: str, compress: bool) -> None:
        self.root, self.link, self.compress, self.digest = root, link, compress, 0

    def item(self, place: str, values: NDArray, packed: bool) -> str:
        """Write the array as the dataset `place`, and return the DataItem that names it."""
        values = np.ascontiguousarray(values)
        options = {}
        if (packed or self.compress) and values.size:
            rows = max(1, 2**18 // max(1, values[0].size))
            options = {"compression": 1, "shuffle": True, "chunks": (min(len(values), rows), *values.shape[1:])}
        self.root.create_dataset(place, data=values, **options)
        if values.size:
            self.digest = zlib.crc32(values.reshape(-1).view(np.uint8).data, self.digest)
        return f'<DataItem {_shape(values)} Format="HDF">{escape(self.link)}:/{place}</DataItem>\n'


def _shape(values: NDArray) -> str:
    dtype = values.dtype
    dimensions = " ".join(map(str, values.shape))
    return f'Dimensions="{dimensions}" NumberType="{_NUMBERS[dtype.kind]}" Precision="{dtype.itemsize}"'


def _information(name: str, value: str) -> str:
    """Information with a named text, which is wrapped in an XML element of its own, as meshio expects."""
    return f'<Information Name="{name}" Value="">{escape(f"<told value={quoteattr(value)}/>")}</Information>\n'


def told(information: ElementTree.Element) -> str:
    """The text that an Information holds. Raises ValueError."""
    try:
        return ElementTree.fromstring("".join(information.itertext())).get("value", "")
    except ElementTree.ParseError as error:
        raise ValueError(str(error)) from None


def _domain(mesh: Mesh, sink: _Text | _Heavy, said: list[str]) -> str:
    """XML of the domain: the grids, with the Information elements in the first."""
    arrays = to_arrays(mesh, said, legal)
    tags, table = _tags(mesh)
    tags_name = TAGS
    while tags_name in arrays.cell:
        tags_name += "_"
    cell = {tags_name: tags, **{name: _widened(values) for name, values in arrays.cell.items()}}
    node = {name: _widened(values) for name, values in arrays.node.items()}
    own = [tags_name]
    order = file_order(mesh)
    if not np.array_equal(np.concatenate([cells for _, cells in _grids(mesh)]), order):
        cell[PLACE] = np.argsort(order)
        own.append(PLACE)
    groups = [n for n in arrays.cell if n.startswith(GROUP)]
    information = _information(TAGS, json.dumps(table)) if table else ""
    information += _information(NOTES, to_json(mesh, {**arrays.notes, "own": own, "groups": groups}))
    parts: list[str] = []
    geometry = _geometry(mesh, sink)
    for k, (title, cells) in enumerate(_grids(mesh)):
        here = {name: values[cells] for name, values in cell.items()}
        here = {name: v for name, v in here.items() if not _says_nothing(name, v, first=k == 0, own=own)}
        parts.append(f'<Grid Name="{title}" GridType="Uniform">\n')
        parts.append(_topology(mesh, title, cells, sink) + geometry)
        parts += _attributes(title, "Cell", here, sink)
        parts += _attributes(title, "Node", node if k == 0 else {}, sink)
        parts.append((information + MARK if k == 0 else "") + "</Grid>\n")
    return "".join(parts)


def _tags(mesh: Mesh) -> tuple[Ints, dict[str, list[str]]]:
    """Number of the set of groups that each cell is in (n_cells,), 0 for none; and the groups of each number."""
    family, families = derive(mesh.cell_groups, np.zeros(mesh.n_cells, np.int8))
    used = families[: int(family.max(initial=0)) + 1]
    return family.astype(np.int32), {str(k): list(groups) for k, groups in enumerate(used) if groups}


def _widened(values: NDArray) -> NDArray:
    """Integers of 32 or 64 bits, which every reader of XDMF takes."""
    if values.dtype.kind == "f" or values.dtype in (np.int32, np.int64, np.uint64):
        return values
    return values.astype(np.int64 if values.dtype == np.uint32 else np.int32)


def _says_nothing(name: str, values: NDArray, *, first: bool, own: list[str]) -> bool:
    """True if an array can be left out on a grid: no cell in the group; or no value, and not the `first` grid."""
    if name in own:
        return False
    if name.startswith(GROUP):
        return not values.any()
    return not first and bool(np.isnan(values).all() if values.dtype.kind == "f" else (values == -1).all())


def _grids(mesh: Mesh) -> Iterator[tuple[str, Ints]]:
    """The grids, one for each dimension that has cells, the highest first: its name, its cells in the file's order."""
    order = file_order(mesh)
    names = {mesh.dim - 1: "facets", mesh.dim: "mesh"}
    for dim in range(mesh.dim, -1, -1):
        cells = order[mesh.cell_dim[order] == dim]
        if len(cells) or dim == mesh.dim:
            yield names.get(dim) or ("vertices", "edges")[dim], cells


def _geometry(mesh: Mesh, sink: _Text | _Heavy) -> str:
    flat = is_plane(mesh)
    points = mesh.points[:, : 2 if flat else 3].astype(np.float64)
    item = sink.item("mesh/geometry", points, packed=False)
    return f'<Geometry GeometryType="{"XY" if flat else "XYZ"}">\n{item}</Geometry>\n'


def _topology(mesh: Mesh, title: str, cells: Ints, sink: _Text | _Heavy) -> str:
    """Topology of a grid: a table of nodes for cells of one type, else a mixture with the type number of each cell."""
    chosen = [(OF_TYPE[name], some, n[:, VTK_OF_TYPE[name].nodes]) for name, some, n in mesh.select(cells)]
    if len(chosen) < 2:
        kind = chosen[0][0] if chosen else XDMF_TYPES[0]
        rows = chosen[0][2].astype(np.int64) if chosen else np.empty((0, 1), np.int64)
        head = f'TopologyType="{kind.name}" NumberOfElements="{len(rows)}" NodesPerElement="{rows.shape[1]}"'
        return f"<Topology {head}>\n{sink.item(f'{title}/topology', rows, packed=False)}</Topology>\n"
    at = places_of(cells, mesh.n_cells)
    width = np.empty(len(cells), np.int64)
    rows_of = []
    for kind, some, nodes in chosen:
        mark = [kind.number, *([nodes.shape[1]] if kind.counted else [])]
        rows_of.append((at[some], np.hstack([np.tile(mark, (len(nodes), 1)), nodes])))
        width[at[some]] = rows_of[-1][1].shape[1]
    first = np.cumsum(width) - width
    flat = np.empty(int(width.sum()), np.int64)
    for place, rows in rows_of:
        flat[first[place, None] + np.arange(rows.shape[1])] = rows
    item = sink.item(f"{title}/topology", flat, packed=False)
    return f'<Topology TopologyType="Mixed" NumberOfElements="{len(cells)}">\n{item}</Topology>\n'


def _attributes(grid: str, center: str, arrays: dict[str, NDArray], sink: _Text | _Heavy) -> Iterator[str]:
    for k, (name, values) in enumerate(arrays.items()):
        packed = name.startswith((GROUP, TAGS))
        item = sink.item(f"{grid}/{center.lower()}/{k}", values, packed)
        attribute_type = _KINDS.get(values.shape[1] if values.ndim == 2 else 1, "Matrix")
        head = f'<Attribute Name={quoteattr(name)} AttributeType="{attribute_type}" Center="{center}">'
        yield f"{head}\n{item}</Attribute>\n"
