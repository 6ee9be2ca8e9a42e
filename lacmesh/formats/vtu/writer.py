"""Writing VTU: one piece, its arrays in one block of bytes behind the XML (raw, or compressed by zlib), or as text.

CellData and PointData hold the arrays of `arrays.py`: `group:NAME` for each group, `cell_number`, `node_number`, and
the data of the mesh. FieldData holds the notes, JSON, as the bytes of the array `lacmesh`: meshio fails on a file that
holds strings. Cells stand in the order of the file. The layout is that of VTK's XML formats (VTK User's Guide, 19.3).
"""

from __future__ import annotations

import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshWarning
from lacmesh.formats.arrays import to_arrays
from lacmesh.formats.notes import to_json
from lacmesh.formats.table import DEFAULT, WriteOptions
from lacmesh.formats.vtu.types import LAGRANGE_HEXAHEDRON, OF_TYPE
from lacmesh.formats.writing import check_types
from lacmesh.mesh import Ints, Mesh

NOTES = "lacmesh"
_NAMES = {"i": "Int", "u": "UInt", "f": "Float"}
#: Bytes of a block that is compressed by itself, as VTK takes it by default.
BLOCK = 2**15
_CHUNK = 2**17


#: what an attribute of XML may not hold as it is
_ESCAPED = str.maketrans(
    {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
)


def quoted(text: str) -> str:
    """A text as an attribute of XML, in quotes. (`xml.sax.saxutils` has it too, and brings all of urllib.)"""
    return f'"{text.translate(_ESCAPED)}"'


class _Array(NamedTuple):
    """An array as it stands in the file: its name, values (n,) or (n, m); `field`: it belongs to no cells or nodes."""

    name: str
    values: NDArray
    field: bool = False

    @property
    def head(self) -> str:
        """Attributes of the array's XML element."""
        dtype = self.values.dtype
        width = self.values.shape[1] if self.values.ndim == 2 else 1
        components = f' NumberOfComponents="{width}"' if width > 1 else ""
        tuples = f' NumberOfTuples="{len(self.values)}"' if self.field else ""
        name = quoted(self.name)
        return f'type="{_NAMES[dtype.kind]}{8 * dtype.itemsize}" Name={name}{components}{tuples}'


def write(path: Path, mesh: Mesh, options: WriteOptions = DEFAULT) -> None:
    """Write a mesh, over what `path` holds: raw bytes or text; `compress`: with zlib, a third of the size.

    Raises WriteError for a cell that VTK lacks. What is left out is named in a LacmeshWarning.
    """
    check_types(path, mesh, OF_TYPE, "VTK")
    said: list[str] = []
    sections = _sections(mesh, said)
    with path.open("wb") as file:
        _write(file, mesh, sections, options.in_binary, options.compress)
    if said:
        warnings.warn("VTU: " + "; ".join(said), LacmeshWarning, stacklevel=3)


def _sections(mesh: Mesh, said: list[str]) -> dict[str, list[_Array]]:
    """Arrays of each section of the file."""
    arrays = to_arrays(mesh, said, legal)
    notes = np.frombuffer(to_json(mesh, arrays.notes).encode("ascii"), np.uint8)
    return {
        "FieldData": [_Array(NOTES, notes, field=True)],
        "PointData": [_Array(name, values) for name, values in arrays.node.items()],
        "CellData": [_Array(name, values[_order(mesh)]) for name, values in arrays.cell.items()],
        "Points": [_Array("Points", np.ascontiguousarray(mesh.points, np.float64))],
        "Cells": [
            _Array(name, a) for name, a in zip(("connectivity", "offsets", "types"), vtk_cells(mesh), strict=True)
        ],
    }


def legal(name: str) -> str:
    """A name without the characters that XML cannot hold."""
    return "".join(c if (c >= " " and not "\ud800" <= c <= "\udfff" and c not in "￾￿") else "_" for c in name)


def _order(mesh: Mesh) -> Ints | slice:
    return slice(None) if mesh.file_order is None else np.asarray(mesh.file_order)


def vtk_cells(mesh: Mesh) -> tuple[Ints, Ints, Ints]:
    """Nodes one cell after the other, where each cell ends, VTK's types; in the order of the file."""
    sizes = np.diff(mesh.offsets)
    order = _order(mesh)
    width = np.repeat([len(OF_TYPE[b.type].nodes) if len(b.nodes) else 0 for b in mesh.blocks], sizes)
    types = np.repeat(np.array([OF_TYPE[b.type].number if len(b.nodes) else 0 for b in mesh.blocks], np.uint8), sizes)
    ends = np.cumsum(width[order], dtype=np.int64)
    total = int(ends[-1]) if len(ends) else 0
    dtype = np.int32 if max(mesh.n_nodes, total) < 2**31 else np.int64
    nodes = [b.nodes[:, OF_TYPE[b.type].nodes].astype(dtype, copy=False) for b in mesh.blocks if len(b.nodes)]
    if mesh.file_order is None:
        flat = np.concatenate([np.empty(0, dtype), *(n.ravel() for n in nodes)])
    else:
        flat = np.empty(total, dtype)
        first = np.empty(mesh.n_cells, np.int64)
        first[order] = ends - width[order]
        filled = [pair for pair in pairwise(mesh.offsets) if pair[0] < pair[1]]
        for (lo, hi), rows in zip(filled, nodes, strict=True):
            flat[first[lo:hi, None] + np.arange(rows.shape[1])] = rows
    return flat, ends.astype(dtype), types[order]


def _version(mesh: Mesh) -> str:
    """Version of the file: 2.1 if a cell has the node order of VTK 9, else one that every ParaView reads."""
    numbers = {OF_TYPE[cell_type].number for cell_type in mesh.cells_by_type}
    return "2.1" if LAGRANGE_HEXAHEDRON in numbers else "1.0"


def _write(file: BinaryIO, mesh: Mesh, sections: Mapping[str, list[_Array]], binary: bool, compress: bool) -> None:
    compressor = ' compressor="vtkZLibDataCompressor"' if binary and compress else ""
    blobs = [_packed(a.values) for arrays in sections.values() for a in arrays] if compressor else []
    sizes = iter([sum(map(len, blob)) for blob in blobs]) if compressor else None

    def put(text: str) -> None:
        file.write(text.encode())

    put('<?xml version="1.0" encoding="utf-8"?>\n')
    put(f'<VTKFile type="UnstructuredGrid" version="{_version(mesh)}" byte_order="LittleEndian" header_type="UInt64"')
    put(f"{compressor}>\n<UnstructuredGrid>\n")
    at = 0
    for section, arrays in sections.items():
        put(f"<{section}>\n")
        for array in arrays:
            if binary:
                put(f'<DataArray {array.head} format="appended" offset="{at}"/>\n')
                at += next(sizes) if sizes else 8 + array.values.nbytes
            else:
                put(f'<DataArray {array.head} format="ascii">\n')
                _write_text(put, array.values)
                put("</DataArray>\n")
        put(f"</{section}>\n")
        if section == "FieldData":
            put(f'<Piece NumberOfPoints="{mesh.n_nodes}" NumberOfCells="{mesh.n_cells}">\n')
    put("</Piece>\n</UnstructuredGrid>\n")
    if binary:
        put('<AppendedData encoding="raw">\n_')
        for part in _appended(sections, blobs):
            file.write(part)
        put("\n</AppendedData>\n")
    put("</VTKFile>\n")


def _appended(sections: Mapping[str, list[_Array]], blobs: list[list[bytes]]) -> Iterator[bytes | memoryview]:
    for blob in blobs:
        yield from blob
    if not blobs:
        for arrays in sections.values():
            for array in arrays:
                values = np.ascontiguousarray(array.values)
                yield np.uint64(values.nbytes).astype("<u8").tobytes()
                yield _little(values).data.cast("B") if values.size else b""


def _little(values: NDArray) -> NDArray:
    return values.astype(values.dtype.newbyteorder("<"), copy=False)


def _packed(values: NDArray) -> list[bytes]:
    """Blocks compressed one by one, after a header: their number, their size, that of the last, compressed sizes."""
    raw = _little(np.ascontiguousarray(values)).tobytes()
    blocks = [zlib.compress(raw[a : a + BLOCK], 1) for a in range(0, len(raw), BLOCK)]
    head = [len(blocks), BLOCK, len(raw) % BLOCK, *map(len, blocks)]
    return [np.array(head, "<u8").tobytes(), *blocks]


def _write_text(put: Callable[[str], None], values: NDArray) -> None:
    """Write values as text, one row per line, reals with the fewest digits that read back the same."""
    form = "%r" if values.dtype.kind == "f" else "%d"
    if values.dtype == np.float32:
        form = "%.9g"
    width = values.shape[1] if values.ndim == 2 else 12
    flat = values.reshape(-1)
    step = width * max(1, _CHUNK // width)
    for a in range(0, len(flat), step):
        part = flat[a : a + step].tolist()
        whole, rest = divmod(len(part), width)
        line = " ".join([form] * width) + "\n"
        put((line * whole + (" ".join([form] * rest) + "\n" if rest else "")) % tuple(part))
