"""VTU, the XML files of VTK's unstructured grids, which ParaView, pyvista and dolfinx read and write; PVD lists them.

Our own reader and writer, on numpy alone. Measured on 200 damaged files, VTK's reader (9.7, by pyvista) ends the
process on 8, and reads 13 as sound ones, with values that are not theirs; meshio joins the names of sets that overlap,
and crashes on sets that are empty somewhere. CellData and PointData hold the arrays of `arrays.py`, FieldData the note,
JSON, as the bytes of the array `lacmesh`: meshio fails on a file that holds strings. Cells stand in the order of the
file. Every encoding of VTK is read (VTK User's Guide, 19.3); blocks packed by LZ4 are unpacked by VTK.

An array is a header and its bytes. Not compressed, the header is the number of bytes; compressed, it is the number of
blocks, the size of a block, the size of the last one if it is smaller, and the size of each when compressed. In base64
a header of a compressed array is encoded by itself, any other together with the bytes.
"""

from __future__ import annotations

import base64
import lzma
import re
import warnings
import zlib
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import LacmeshWarning, ReadError, check_installed, reading
from lacmesh.formats.arrays import (
    NOTE,
    VtkCells,
    add_arrays,
    add_cells,
    checked_cells,
    mesh_with_tags,
    numbers_in,
    to_arrays,
    vtk_cells,
)
from lacmesh.formats.builder import MeshBuilder
from lacmesh.formats.orders import LAGRANGE_HEXAHEDRON, VTK_CELLS, check_types
from lacmesh.formats.output import replace_file
from lacmesh.formats.text import in_lines
from lacmesh.mesh import Ints, Mesh

XmlElement = ElementTree.Element

_NAMES = {"i": "Int", "u": "UInt", "f": "Float"}
_KINDS = {f"{'U' * u}Int{8 * n}": np.dtype(f"{'u' if u else 'i'}{n}") for u in (0, 1) for n in (1, 2, 4, 8)}
_KINDS |= {"Float32": np.dtype(np.float32), "Float64": np.dtype(np.float64), "String": np.dtype(np.uint8)}
#: bytes of a block that is compressed by itself, as VTK takes it by default
_BLOCK = 2**15
#: what decoding may raise on damaged bytes
DAMAGE = (ValueError, IndexError, OverflowError, MemoryError, zlib.error, lzma.LZMAError, EOFError)


# ---- reading


class _Document(NamedTuple):
    """A VTU file: its root, order of bytes, type of headers; its block of arrays (`base64`: as text), their places."""

    path: Path
    root: XmlElement
    order: str
    header: np.dtype
    appended: memoryview
    base64: bool
    offsets: list[int]

    def error(self, message: str, place: str | None = None) -> ReadError:
        """A ReadError about the file, at an element."""
        return ReadError(self.path, message, place)

    def whole_number(self, element: XmlElement, name: str, default: int | None = None) -> int:
        """Integer value of an attribute that counts something. Raises ReadError."""
        text = element.get(name)
        if text is None and default is not None:
            return default
        if text is None or not re.fullmatch(r"\s*\d{1,18}\s*", text):
            raise self.error(f"{name} should be a number, not {str(text)[:40]!r}", f"<{element.tag}>")
        return int(text)

    def array(self, element: XmlElement, most: int | None = None) -> NDArray:
        """Values of a DataArray, flat; `most`: the largest possible number of values in a compressed one, if known."""
        dtype, place = _KINDS.get(element.get("type", "")), f"<{element.tag} Name={element.get('Name')!r}>"
        if dtype is None:
            raise self.error(f"the type {element.get('type')!r} is not known", place)
        form = element.get("format", "ascii")
        try:
            if form == "ascii":
                return from_text(element.text or "", dtype)
            if form == "appended":
                offset = self.whole_number(element, "offset")
                if offset >= len(self.appended):
                    raise ValueError(f"offset {offset} is past the end")
                content = self.appended[offset : next((at for at in self.offsets if at > offset), None)]
            elif form == "binary":
                content = memoryview("".join((element.text or "").split()).encode("ascii"))
            else:
                raise ValueError(f"the format {form!r} is not known")
            if form == "binary" or self.base64:
                parts = re.findall(rb"[^=]+=*", content)  # several where the header is encoded by itself
                content = memoryview(b"".join(base64.b64decode(part, validate=True) for part in parts))
            size = None if most is None else most * dtype.itemsize
            content = _unpacked(content, self.header, self.root.get("compressor", ""), size)
            if len(content) % dtype.itemsize:
                raise ValueError(f"{len(content)} bytes are no whole number of {dtype}")
            return np.frombuffer(content, dtype.newbyteorder(self.order)).astype(dtype)  # type: ignore[arg-type]
        except DAMAGE as error:
            raise self.error(f"cannot be read ({error})", place) from None


def _unpacked(content: memoryview, header: np.dtype, compressor: str, most: int | None) -> memoryview:
    """Values of an array, as bytes, that stand behind its header; `most`: of a compressed one. Raises one of DAMAGE."""

    def take(start: int, n: int) -> memoryview:
        return _complete(content[start : start + n], n)

    size = header.itemsize
    if not compressor:
        return take(size, int(np.frombuffer(take(0, size), header)[0]))
    blocks, block, last = np.frombuffer(take(0, 3 * size), header).tolist()
    if blocks * size > len(content):
        raise ValueError(f"{blocks} blocks are more than the file holds")
    claimed = (blocks - 1) * block + (last or block) if blocks else 0
    if most is not None and claimed > most:  # each byte may give a thousand
        raise ValueError(f"its header claims {claimed} bytes, where {most} should be")
    sizes = np.frombuffer(take(0, (3 + blocks) * size), header)[3:].tolist()
    packed, start, parts = take((3 + blocks) * size, sum(sizes)), 0, list[bytes]()
    for n, wanted in zip(sizes, [*[block] * (blocks - 1), last or block], strict=False):
        if compressor not in _UNPACK:
            raise ValueError(f"the compressor {compressor} is not known")
        parts.append(_complete(_UNPACK[compressor](packed[start : start + n], wanted), wanted))
        start += n
    return memoryview(b"".join(parts))


def _from_lz4(packed: memoryview, size: int) -> bytes:
    """Unpack a block of LZ4 by VTK, which pyvista brings; nothing of a damaged one. Raises RequestError without VTK."""
    check_installed("pyvista", "view", "a VTU file that is packed by LZ4")
    from vtkmodules.vtkIOCore import vtkLZ4DataCompressor

    unpacked = np.empty(size, np.uint8)
    unpacker: Any = vtkLZ4DataCompressor()
    unpacker.AddObserver("ErrorEvent", lambda *_: None)  # which VTK would print
    return unpacked[: unpacker.Uncompress(np.frombuffer(packed, np.uint8), len(packed), unpacked, size)].tobytes()


#: compressor -> what unpacks a block of so many bytes; one more of them shows that the block has more
_UNPACK: dict[str, Callable[[memoryview, int], bytes]] = {
    "vtkZLibDataCompressor": lambda packed, size: zlib.decompressobj().decompress(packed, size + 1),
    "vtkLZMADataCompressor": lambda packed, size: lzma.LZMADecompressor(memlimit=2**28).decompress(packed, size + 1),
    "vtkLZ4DataCompressor": _from_lz4,
}


def _complete(content: Any, n: int) -> Any:
    if len(content) != n:
        raise ValueError(f"{len(content)} bytes where {n} should be")
    return content


def from_text(text: str, dtype: np.dtype) -> NDArray:
    """The values in a text. Raises ValueError."""
    words = text.split()
    if dtype.kind == "f":
        return np.array(words, np.float64).astype(dtype)
    values: Ints = np.array(words, np.uint64 if dtype == np.uint64 else np.int64)
    typed = values.astype(dtype)
    if not (typed == values).all():
        raise ValueError(f"a number is too large for {dtype}")
    return typed


def parsed(path: Path, text: bytes) -> XmlElement:
    """The root of an XML text. Raises ReadError: for damage, and for entities, which no mesh needs."""
    if b"<!ENTITY" in text:
        raise ReadError(path, "declares XML entities, which are not read")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise ReadError(path, f"is no sound XML ({error})") from None


def _opened(path: Path) -> _Document:
    """Parse the XML of a file; what stands behind it as raw bytes is no XML. Raises ReadError."""
    with reading(path):
        data = path.read_bytes()
    head, appended, in_base64 = data, memoryview(b""), False
    section = re.search(rb"<AppendedData\b[^>]*>\s*_", data)
    if section:
        head, appended = data[: section.start()] + b"</VTKFile>", memoryview(data)[section.end() :]
        in_base64 = re.search(rb"encoding\s*=\s*[\"']base64[\"']", section[0], re.IGNORECASE) is not None
        if in_base64:
            appended = memoryview(b"".join(data[section.end() :].split(b"<", 1)[0].split()))
    root = parsed(path, head)
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        of = root.get("type") or root.tag
        raise ReadError(path, f"holds {of}; of VTK's files only UnstructuredGrid (.vtu) is read")
    order = {"LittleEndian": "<", "BigEndian": ">"}.get(root.get("byte_order", "LittleEndian"))
    header = {"UInt32": "u4", "UInt64": "u8"}.get(root.get("header_type", "UInt32"))
    if order is None or header is None:
        raise ReadError(path, "has a byte_order or header_type that VTK does not know")
    offsets = sorted(int(text) for one in root.iter("DataArray") if (text := one.get("offset", "")).isdecimal())
    return _Document(path, root, order, np.dtype(order + header), appended, in_base64, offsets)


def read(path: Path) -> Mesh:
    """Read the mesh of a VTU file. Raises ReadError; what is left out is named in one LacmeshWarning."""
    document = _opened(path)
    grid = document.root.find("UnstructuredGrid")
    pieces = [] if grid is None else grid.findall("Piece")
    if grid is None or not pieces:
        what = "<UnstructuredGrid>" if grid is None else "<Piece>, so it holds no mesh"
        raise document.error(f"has no {what}")
    out = MeshBuilder(path, rows_from=0)
    fields = {array.get("Name", ""): array for array in grid.findall("FieldData/")}
    if NOTE in fields:
        out.read_note(document.array(fields.pop(NOTE)).tobytes().replace(b"\0", b""))
    if fields:
        out.warnings.append(f"FieldData {', '.join(map(repr, [*fields][:8]))} are left out")
    known: set[str] = set()
    for piece in pieces:
        known |= _read_piece(document, piece, out, several=len(pieces) > 1)
    if len(pieces) > 1 and sum(document.whole_number(piece, "NumberOfPoints") > 0 for piece in pieces) > 1:
        out.warnings.append(f"{len(pieces)} pieces are put together; nodes that several have stay apart")
    return mesh_with_tags(out, known)


def _read_piece(document: _Document, piece: XmlElement, out: MeshBuilder, *, several: bool) -> set[str]:
    """Add a piece; return the names of its arrays on cells. Raises ReadError."""
    n, k = document.whole_number(piece, "NumberOfPoints"), document.whole_number(piece, "NumberOfCells")
    place = piece.find("Points/DataArray")
    points = document.array(place, 3 * n) if place is not None else np.empty(0)
    if len(points) != 3 * n or points.dtype.kind != "f":
        raise document.error(f"holds {len(points)} coordinates of type {points.dtype} for {n} points", "<Points>")
    first_node, first_cell = out.size("node"), out.size("cell")
    cells = _read_cells(document, piece, n, k)
    on_nodes, on_cells = (_read_data(document, piece, f"{on}Data", m, out) for on, m in (("Point", n), ("Cell", k)))
    number, at_points = numbers_in(on_nodes, "node", n, out), partial(document.error, place="<Points>")
    out.nodes(number, points.reshape(n, 3), error=at_points)
    old = [int(part) for part in document.root.get("version", "0.1").split(".") if part.isdigit()] < [2, 1]
    error, number = partial(document.error, place="<Cells>"), numbers_in(on_cells, "cell", k, out)
    add_cells(out, cells, number, error, first_node=first_node, old=old)
    add_arrays(out, "node", on_nodes, np.arange(first_node, first_node + n) if several else None)
    add_arrays(out, "cell", on_cells, np.arange(first_cell, first_cell + k) if several else None)
    return set(on_cells)


def _read_cells(document: _Document, piece: XmlElement, n_points: int, k: int) -> VtkCells:
    arrays = {array.get("Name"): array for array in piece.findall("Cells/DataArray")}
    read: dict[str, Ints] = {}
    for name in ("offsets", "types", "connectivity"):
        most = k + 1 if name != "connectivity" else max([0, *read["offsets"].tolist()[-1:]])
        read[name] = document.array(arrays[name], most) if name in arrays else np.empty(0, np.int64)
        if read[name].dtype.kind not in "iu":
            raise document.error(f"{name} should be integers", "<Cells>")
    ends, types = read["offsets"], read["types"]
    if len(ends) == len(types) + 1 and ends[0] == 0:
        ends = ends[1:]
    if len(ends) != k or len(types) != k:
        raise document.error(f"holds {len(types)} types and {len(ends)} offsets for {k} cells", "<Cells>")
    cells = VtkCells(read["connectivity"], ends, types)
    return checked_cells(cells, n_points, partial(document.error, place="<Cells>"))


def _read_data(document: _Document, piece: XmlElement, section: str, size: int, out: MeshBuilder) -> dict[str, NDArray]:
    arrays: dict[str, NDArray] = {}
    for element in piece.findall(f"{section}/"):
        name = element.get("Name", "")
        if element.get("type") == "String":
            out.warnings.append(f"{section} {name!r} are strings, they are left out")
            continue
        width = document.whole_number(element, "NumberOfComponents", 1)
        values = document.array(element, size * width)
        if width < 1 or len(values) != size * width:
            raise document.error(f"{name!r} has {len(values)} values for {size} times {width}", f"<{section}>")
        arrays[name] = values.reshape(size, width) if width > 1 else values
    return arrays


# ---- writing


def write(path: Path, mesh: Mesh, *, binary: bool = True, compress: bool = False) -> None:
    """Write a mesh, over what `path` holds: raw bytes or text; `compress`: with zlib, a third of the size.

    Raises WriteError for a cell that VTK lacks. What is left out is named in a LacmeshWarning.
    """
    check_types(path, mesh, VTK_CELLS, "VTK")
    left_out: list[str] = []
    arrays = to_arrays(mesh, left_out, legal)
    order = slice(None) if mesh.file_order is None else np.asarray(mesh.file_order)
    sections: dict[str, dict[str, NDArray]] = {
        "FieldData": {NOTE: np.frombuffer(arrays.note(mesh).encode("ascii"), np.uint8)},
        "PointData": arrays.node,
        "CellData": {name: values[order] for name, values in arrays.cell.items()},
        "Points": {"Points": np.ascontiguousarray(mesh.points, np.float64)},
        "Cells": dict(zip(("connectivity", "offsets", "types"), vtk_cells(mesh), strict=True)),
    }
    with path.open("wb") as file:
        _write(file, mesh, sections, binary, binary and compress)
    if left_out:
        warnings.warn("VTU: " + "; ".join(left_out), LacmeshWarning, stacklevel=3)


def legal(name: str) -> str:
    """A name without the characters that XML cannot hold."""
    return "".join(c if (c >= " " and not "\ud800" <= c <= "\udfff" and c not in "￾￿") else "_" for c in name)


def _write(file: BinaryIO, mesh: Mesh, sections: Mapping[str, Mapping[str, NDArray]], binary: bool, pack: bool) -> None:
    """Write the XML, and the arrays in it as text, or behind it as bytes."""
    numbers = {VTK_CELLS[kind].number for kind in mesh.cells_by_type}
    version = "2.1" if LAGRANGE_HEXAHEDRON in numbers else "1.0"  # 1.0 is read by every ParaView
    blobs: list[list[bytes | memoryview]] = []

    def put(text: str) -> None:
        file.write(text.encode())

    put(f'<?xml version="1.0" encoding="utf-8"?>\n<VTKFile type="UnstructuredGrid" version="{version}"')
    compressor = ' compressor="vtkZLibDataCompressor"' if pack else ""
    put(f' byte_order="LittleEndian" header_type="UInt64"{compressor}>\n<UnstructuredGrid>\n')
    at = 0
    for section, arrays in sections.items():
        put(f"<{section}>\n")
        for name, values in arrays.items():
            width = values.shape[1] if values.ndim == 2 else 1
            head = f'type="{_NAMES[values.dtype.kind]}{8 * values.dtype.itemsize}" Name={quoteattr(name)}'
            head += f' NumberOfComponents="{width}"' if width > 1 else ""
            head += f' NumberOfTuples="{len(values)}"' if section == "FieldData" else ""
            if binary:
                put(f'<DataArray {head} format="appended" offset="{at}"/>\n')
                blobs.append(_bytes(values, pack))
                at += sum(map(len, blobs[-1]))
            else:
                put(f'<DataArray {head} format="ascii">\n')
                form = "%d" if values.dtype.kind != "f" else "%.9g" if values.dtype == np.float32 else "%r"
                for text in in_lines(values.reshape(-1), form, width if values.ndim == 2 else 12):
                    put(text)
                put("</DataArray>\n")
        put(f"</{section}>\n")
        if section == "FieldData":
            put(f'<Piece NumberOfPoints="{mesh.n_nodes}" NumberOfCells="{mesh.n_cells}">\n')
    put("</Piece>\n</UnstructuredGrid>\n")
    if binary:
        put('<AppendedData encoding="raw">\n_')
        for blob in blobs:
            file.writelines(blob)
        put("\n</AppendedData>\n")
    put("</VTKFile>\n")


def _bytes(values: NDArray, pack: bool) -> list[bytes | memoryview]:
    """A header and the bytes of an array; packed, their blocks one by one."""
    values = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<"), copy=False)
    if not pack:
        return [np.array([values.nbytes], "<u8").tobytes(), values.data.cast("B") if values.size else b""]
    raw = values.tobytes()
    blocks = [zlib.compress(raw[a : a + _BLOCK], 1) for a in range(0, len(raw), _BLOCK)]
    head = [len(blocks), _BLOCK, len(raw) % _BLOCK, *map(len, blocks)]
    return [np.array(head, "<u8").tobytes(), *blocks]


# ---- PVD: a list of a VTU file for each time, for ParaView


def read_pvd(path: Path) -> dict[float, str]:
    """Return the files of a PVD that exist, by their times; none if there is no PVD. Raises ReadError."""
    if not path.exists():
        return {}
    try:
        sets = ElementTree.parse(path).getroot().iter("DataSet")
        files = {float(s.attrib["timestep"]): s.attrib["file"] for s in sets}
    except (OSError, ValueError, KeyError, ElementTree.ParseError) as error:
        raise ReadError(path, f"cannot be gone on with ({error}); write into another folder") from error
    return {time: file for time, file in files.items() if (path.parent / file).is_file()}


def write_pvd(path: Path, files: Mapping[float, str]) -> None:
    """Write a PVD that names the file of each time. Raises WriteError."""
    sets = [f'<DataSet timestep="{t!r}" group="" part="0" file={quoteattr(file)}/>\n' for t, file in files.items()]
    head = '<?xml version="1.0" encoding="utf-8"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    replace_file(path, (head + "".join(sets) + "</Collection>\n</VTKFile>\n").encode())
