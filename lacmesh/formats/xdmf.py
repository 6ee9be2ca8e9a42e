"""XDMF 3 (an XML file, and an HDF5 file of arrays beside it), which dolfinx, legacy FEniCS and ParaView read.

There is a grid for the cells of each dimension, on the same points, so that dolfinx can read each by name:

    mesh       the cells of the highest dimension; `read_mesh(name="mesh")`
    facets     those of one dimension less; `read_meshtags(mesh, name="facets", attribute_name="group:slave")`
    edges, vertices     the others

A grid of one type of cells is uniform, which dolfinx asks for; others are a mixture, which ParaView reads too. Its
first attribute `tags` gives every cell a number by the groups it is in (the Information `tags` says which); then come
the arrays of `arrays.py`: a group of its own is `group:NAME`, in integers of 32 bits, which dolfinx reads. Values
on nodes are on the grid `mesh`. The Information `lacmesh` holds the note, in JSON.

The arrays are in the HDF5 file of the same name (dolfinx looks for no other), or, as text, in the XML. Both carry the
same `lacmesh_id`, so that a file whose other half was replaced is noticed.
"""

from __future__ import annotations

import json
import math
import warnings
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import h5py
import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshWarning, WriteError
from lacmesh.formats.arrays import GROUP, NOTE, VtkCells, to_arrays, vtk_cells
from lacmesh.formats.hdf5 import image, set_attributes
from lacmesh.formats.med import families_of
from lacmesh.formats.orders import VTK_BY_NUMBER, XDMF_CELLS, XDMF_COUNTED, check_types, file_order, is_plane
from lacmesh.formats.output import readable
from lacmesh.formats.text import in_lines
from lacmesh.formats.vtu import legal
from lacmesh.formats.xdmf_reader import ID, PLACE, read
from lacmesh.mesh import Ints, Mesh, mask_of

__all__ = ["read", "write"]

TAGS = "tags"
#: where the two files' common mark goes, once all arrays are written
_MARK = "<!-- mark -->"
_KINDS = {1: "Scalar", 3: "Vector", 6: "Tensor6", 9: "Tensor"}
_NUMBERS = {"i": "Int", "u": "UInt", "f": "Float"}


def write(
    path: Path, mesh: Mesh, *, binary: bool = True, compress: bool = False, second: tuple[Path, str] | None = None
) -> None:
    """Write a mesh: XML to `path`, arrays to the `second` file, of HDF5, with the name it will have; or as text.

    `compress`: everything in the HDF5 file, not the groups only. Raises WriteError for a cell that XDMF lacks. What is
    left out is named in a LacmeshWarning.
    """
    check_types(path, mesh, XDMF_CELLS, "XDMF")
    heavy, link = second or (None, "")
    if readable(link) != link:
        raise WriteError(path, f"XML cannot name the second file, {link}, as its name is no UTF-8; choose another name")
    left_out: list[str] = []
    with ExitStack() as stack:
        sink = _Sink(stack.enter_context(image(heavy)) if heavy is not None else None, link, compress)
        body, mark = _domain(mesh, sink, left_out), ""
        if sink.root is not None:
            mark = f"{sink.digest:08x}{zlib.crc32(body.encode()):08x}"
            set_attributes(sink.root, **{ID: mark})  # of fixed length: HDF5 may never end on a damaged one of another
        body = body.replace(_MARK, _information(ID, mark) if mark else "", 1)
    with path.open("w", encoding="utf-8") as file:
        file.write('<?xml version="1.0" encoding="utf-8"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n')
        file.write('<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude">\n<Domain>\n')
        file.write(body + "</Domain>\n</Xdmf>\n")
    if left_out:
        warnings.warn("XDMF: " + "; ".join(left_out), LacmeshWarning, stacklevel=3)


def is_ours(heavy: Path) -> bool:
    """True if an HDF5 file is the second half of an XDMF file that lacmesh wrote."""
    try:
        with h5py.File(heavy, "r") as file:
            return ID in file.attrs
    except (OSError, RuntimeError):
        return False


class _Sink:
    """Destination of the arrays: the `root` of an HDF5 file, or the XML; `digest` runs over what is in the first."""

    def __init__(self, root: h5py.Group | None, link: str, compress: bool) -> None:
        self.root, self.link, self.compress, self.digest = root, link, compress, 0

    def item(self, place: str, values: NDArray, *, packed: bool = False) -> str:
        """Write an array, as the dataset `place` in HDF5; return the DataItem that holds or names it."""
        values = np.ascontiguousarray(values)
        kind, size = values.dtype.kind, values.dtype.itemsize
        head = f'Dimensions="{" ".join(map(str, values.shape))}" NumberType="{_NUMBERS[kind]}" Precision="{size}"'
        if self.root is None:
            form = "%d" if kind != "f" else "%r" if size == 8 else "%.9g"
            text = "".join(in_lines(values.reshape(-1), form, max(1, math.prod(values.shape[1:]))))
            return f'<DataItem {head} Format="XML">\n{text}</DataItem>\n'
        options = {}
        if (packed or self.compress) and values.size:
            n = max(1, 2**18 // max(1, values[0].size))
            options = {"compression": 1, "shuffle": True, "chunks": (min(len(values), n), *values.shape[1:])}
        self.root.create_dataset(place, data=values, **options)
        if values.size:
            self.digest = zlib.crc32(values.reshape(-1).view(np.uint8).data, self.digest)
        return f'<DataItem {head} Format="HDF">{escape(self.link)}:/{place}</DataItem>\n'


def _information(name: str, value: str) -> str:
    """Information with a named text, which is wrapped in an XML element of its own, as meshio expects."""
    return f'<Information Name="{name}" Value="">{escape(f"<text value={quoteattr(value)}/>")}</Information>\n'


def _domain(mesh: Mesh, sink: _Sink, left_out: list[str]) -> str:
    """XML of the domain: the grids, with the Information elements in the first."""
    arrays = to_arrays(mesh, left_out, legal)
    family, families = families_of(mesh.cell_groups, np.zeros(mesh.n_cells, np.int8))
    table = {str(k): list(groups) for k, groups in enumerate(families[: int(family.max(initial=0)) + 1]) if groups}
    tags = TAGS
    while tags in arrays.cell:
        tags += "_"
    cell = {tags: family.astype(np.int32), **{name: _widened(values) for name, values in arrays.cell.items()}}
    node = {name: _widened(values) for name, values in arrays.node.items()}
    extra, order = [tags], file_order(mesh)
    grids = list(_grids(mesh, order))
    if not np.array_equal(np.concatenate([cells for _, cells in grids]), order):
        cell[PLACE] = np.argsort(order)
        extra.append(PLACE)
    information = _information(TAGS, json.dumps(table)) if table else ""
    information += _information(NOTE, arrays.note(mesh, own=extra, groups=list(mesh.cell_groups)))
    flat, listed = is_plane(mesh), vtk_cells(mesh)
    points = sink.item("mesh/geometry", mesh.points[:, : 2 if flat else 3].astype(np.float64))
    geometry = f'<Geometry GeometryType="{"XY" if flat else "XYZ"}">\n{points}</Geometry>\n'
    width, place, parts = np.diff(listed.ends, prepend=0), np.argsort(order), list[str]()
    for k, (title, cells) in enumerate(grids):
        inside = mask_of(mesh.n_cells, place[cells])
        here = VtkCells(listed.connectivity[np.repeat(inside, width)], np.cumsum(width[inside]), listed.types[inside])
        parts.append(f'<Grid Name="{title}" GridType="Uniform">\n')
        parts.append(_topology(here, title, sink) + geometry)
        for name, values in cell.items():
            some = values[cells]
            lacking = np.isnan(some) if some.dtype.kind == "f" else some == (0 if name.startswith(GROUP) else -1)
            if name in extra or not lacking.all() or (k == 0 and not name.startswith(GROUP)):
                parts.append(_attribute(f"{title}/cell/{len(parts)}", name, "Cell", some, sink))
        for name, values in node.items() if k == 0 else ():
            parts.append(_attribute(f"{title}/node/{len(parts)}", name, "Node", values, sink))
        parts.append((information + _MARK if k == 0 else "") + "</Grid>\n")
    return "".join(parts)


def _widened(values: NDArray) -> NDArray:
    """Integers of 32 or 64 bits, which every reader of XDMF takes."""
    if values.dtype.kind == "f" or values.dtype in (np.int32, np.int64, np.uint64):
        return values
    return values.astype(np.int64 if values.dtype == np.uint32 else np.int32)


def _grids(mesh: Mesh, order: Ints) -> Iterator[tuple[str, Ints]]:
    """The grids, one for each dimension that has cells, the highest first: its name, its cells in the file's order."""
    names = {0: "vertices", 1: "edges", mesh.dim - 1: "facets", mesh.dim: "mesh"}
    for dim in range(mesh.dim, -1, -1):
        cells = order[mesh.cell_dim[order] == dim]
        if len(cells) or dim == mesh.dim:
            yield names[dim], cells


def _topology(cells: VtkCells, title: str, sink: _Sink) -> str:
    """Topology of a grid: a table of nodes for cells of one type, else a mixture with the type number of each cell."""
    width = np.diff(cells.ends, prepend=0)
    codes = np.flatnonzero(np.bincount(cells.types * np.int64(256) + width)).tolist()
    kinds = {divmod(code, 256): XDMF_CELLS[VTK_BY_NUMBER[divmod(code, 256)].type] for code in codes}
    nodes = cells.connectivity.astype(np.int64)
    if len(kinds) < 2:
        name, n = next(((kind.name, n) for (_, n), kind in kinds.items()), ("Polyvertex", 1))
        head = f'TopologyType="{name}" NumberOfElements="{len(width)}" NodesPerElement="{n}"'
        return f"<Topology {head}>\n{sink.item(f'{title}/topology', nodes.reshape(-1, n))}</Topology>\n"
    flat = list[int]()
    for number, row in zip(cells.types.tolist(), np.split(nodes, cells.ends[:-1]), strict=True):
        kind = kinds[number, len(row)]
        flat += [kind.number, *([len(row)] if kind.number in XDMF_COUNTED else []), *row.tolist()]
    item = sink.item(f"{title}/topology", np.array(flat, np.int64))
    return f'<Topology TopologyType="Mixed" NumberOfElements="{len(width)}">\n{item}</Topology>\n'


def _attribute(place: str, name: str, center: str, values: NDArray, sink: _Sink) -> str:
    item = sink.item(place, values, packed=name.startswith((GROUP, TAGS)))
    kind = _KINDS.get(values.shape[1] if values.ndim == 2 else 1, "Matrix")
    return f'<Attribute Name={quoteattr(name)} AttributeType="{kind}" Center="{center}">\n{item}</Attribute>\n'
