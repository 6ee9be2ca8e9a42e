"""Errors in VTU and XDMF files as such, and in the HDF5 file beside an XDMF file."""

from __future__ import annotations

import re
import struct
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

import lacmesh
from tests.bad_input import raw
from tests.bad_input.case import CUT, Case
from tests.bad_input.raw import two_hexahedra

_ENTITIES = '<?xml version="1.0"?>\n<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
VTU = [
    ("sections", "there is no grid", "UnstructuredGrid>", "Grid>", "no sound XML|has no <UnstructuredGrid>"),
    ("content", "another of VTK's grids", "UnstructuredGrid", "PolyData", "holds PolyData; .* only UnstructuredGrid"),
    ("version", "a byte order that nobody knows", "LittleEndian", "MiddleEndian", "byte_order or header_type"),
    ("sections", "a tag is not closed", "</Points>", "", "no sound XML"),
    ("sections", "XML entities", '<?xml version="1.0"?>', _ENTITIES, "declares XML entities"),
    ("counts", "a coordinate is missing", "0.0 0.0 0.0 1.0", "0.0 0.0 0.0", "holds 35 coordinates .* for 12 points"),
    ("counts", "a node too few", "\n0 1 4 3 6", "\n0 1 4 3", "the offsets do not fit"),
    ("counts", "offsets that go back", "\n8 16 20", "\n16 8 20", "the offsets do not fit"),
    ("counts", "an offset of 10^12", "\n8 16 20", "\n8 1000000000000 20", "the offsets do not fit"),
    (
        "counts",
        "3 components in place of 1",
        'Name="cell_number" NumberOfComponents="1"',
        'Name="cell_number" NumberOfComponents="3"',
        "has 6 values for 6 times 3",
    ),
    (
        "counts",
        "10^12 components",
        'Name="cell_number" NumberOfComponents="1"',
        'Name="cell_number" NumberOfComponents="1000000000000"',
        "6 times 1000000000000",
    ),
    (
        "numbers",
        "letters where a coordinate should be",
        "0.0 0.0 0.0 1.0",
        "0.0 l.0 0.0 1.0",
        "<DataArray Name='Points'>: cannot be read",
    ),
    (
        "numbers",
        "nodes of cells are reals",
        'type="Int64" Name="connectivity"',
        'type="Float64" Name="connectivity"',
        "connectivity should be integers",
    ),
    (
        "types",
        "a type of number that nobody knows",
        'type="Float64" Name="Points"',
        'type="Float16" Name="Points"',
        "type 'Float16' is not known",
    ),
    (
        "types",
        "an encoding that nobody knows",
        'format="ascii">\n0.0',
        'format="morse">\n0.0',
        "format 'morse' is not known",
    ),
    ("types", "polyhedra", "\n12 12 9", "\n42 12 9", "polyhedra.* are not read"),
    ("types", "a hexahedron of 4 nodes", "\n12 12 9", "\n12 9 12", "are not read|do not fit"),
    (
        "links",
        "arrays in a block that is not there",
        'format="ascii">\n0.0',
        'format="appended" offset="0">\n0.0',
        "offset 0 is past the end",
    ),
]
XDMF = [
    ("sections", "there is no domain", "Domain>", "Main>", "has no <Xdmf> and <Domain>"),
    ("sections", "there is no grid", "Grid", "Gird", "holds no grid"),
    ("sections", "there is no topology", "Topology", "Topologie", "has no <Topology>"),
    ("sections", "there is no geometry", "Geometry", "Geometrie", "has no <Geometry>"),
    ("sections", "a tag is not closed", "</Grid>", "", "no sound XML"),
    ("sections", "XML entities", '<?xml version="1.0"?>', _ENTITIES, "declares XML entities"),
    ("content", "a structured grid", 'GridType="Uniform"', 'GridType="Subset"', "grids of type Subset are not read"),
    (
        "content",
        "points in polar coordinates",
        'GeometryType="XYZ"',
        'GeometryType="VXVYVZ"',
        "points of type VXVYVZ are not read",
    ),
    (
        "types",
        "cells of one type that nobody knows",
        'TopologyType="Mixed"',
        'TopologyType="Hexagon"',
        "cells of type Hexagon are not read",
    ),
    (
        "types",
        "numbers that nobody knows",
        'NumberType="Float"',
        'NumberType="Complex"',
        "numbers of type Complex and 8 bytes",
    ),
    (
        "types",
        "a format that nobody knows",
        'Precision="8" Format="XML"',
        'Precision="8" Format="TEXT"',
        "format 'TEXT' is not known",
    ),
    ("types", "an attribute on edges", 'Center="Cell"', 'Center="Edge"', "attributes on Edge are not read"),
    ("counts", "a number too few among the cells", "\n9 0 1", "\n9 0", "values for dimensions"),
    ("counts", "a coordinate is missing", "1.0 0.0 0.0\n", "1.0 0.0\n", "35 values for dimensions 12 3"),
    (
        "counts",
        "numbers for 5 of 6 cells",
        '"6" NumberType="Int" Precision="8" Format="XML">\n101',
        '"5" NumberType="Int" Precision="8" Format="XML">\n',
        "cell_number.* 5 .*|5 values",
    ),
    ("numbers", "letters where a coordinate should be", "1.0 0.0 0.0\n", "1.0 l.0 0.0\n", "<Geometry>: cannot be read"),
    (
        "links",
        "an HDF5 file that is not there",
        'Format="XML">\n0.0',
        'Format="HDF">\nno.h5:/x\n0.0',
        "no.h5|does not name an array",
    ),
    (
        "links",
        "it includes what is not there",
        "<Geometry ",
        '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" xpointer="xpointer(/Xdmf/Else)"/><Geometry ',
        "which is not found",
    ),
    (
        "links",
        "a collection of grids includes itself",
        '<Grid Name="mesh" GridType="Uniform">',
        '<Grid Name="mesh" GridType="Collection"><xi:include xmlns:xi="http://www.w3.org/2001/XInclude" '
        'xpointer="xpointer(/Xdmf/Domain/Grid)"/>',
        "includes itself",
    ),
]


@cache
def pair(name: str = "bad") -> dict[str, bytes]:
    """An XDMF file and its HDF5 file, as lacmesh writes them."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
        (Path(folder) / "in.msh").write_bytes(raw.msh41(two_hexahedra()))
        lacmesh.write(Path(folder) / f"{name}.xdmf", lacmesh.read(Path(folder) / "in.msh"))
        return {path.name: path.read_bytes() for path in sorted(Path(folder).glob(f"{name}.*"))}


def _put(folder: Path, **changes: Any) -> None:
    """The pair in a folder; `text` changes the XML, `heavy` the HDF5 file, `edit` its objects."""
    for name, content in pair().items():
        (folder / name).write_bytes(content)
    if "text" in changes:
        path = folder / "bad.xdmf"
        path.write_bytes(changes["text"](path.read_bytes()))
    if "heavy" in changes:
        path = folder / "bad.h5"
        content = changes["heavy"](path.read_bytes())
        path.unlink() if content is None else path.write_bytes(content)
    if "edit" in changes:
        with h5py.File(folder / "bad.h5", "r+") as file:
            changes["edit"](file)


def _other(folder: Path) -> None:
    """The HDF5 file of another writing."""
    _put(folder)
    with h5py.File(folder / "bad.h5", "r+") as file:
        file.attrs["lacmesh_id"] = "another"


def _places(content: bytes) -> list[str]:
    return [place.decode() for place in re.findall(rb"bad\.h5:(/[\w/.:-]+)", content)]


def _arrays(change: Callable[[h5py.File, str], object]) -> Callable[[h5py.File], None]:
    """An edit of the first array that the XML names: of the coordinates or of the cells."""

    def edit(file: h5py.File) -> None:
        change(file, _places(pair()["bad.xdmf"])[0])

    return edit


def _gone(file: h5py.File, place: str) -> None:
    del file[place]


def _text(file: h5py.File, place: str) -> None:
    shape = file[place].shape
    del file[place]
    file[place] = np.full(shape, b"x")


def _huge(file: h5py.File, place: str) -> None:
    del file[place]
    file.create_dataset(place, shape=(10**12,), dtype="f8", chunks=(10**6,))


HEAVY: list[tuple[str, str, dict[str, Any], str]] = [
    (
        "sections",
        "its HDF5 file is gone",
        {"heavy": lambda c: None},
        "names the HDF5 file bad.h5, which is not beside it",
    ),
    ("cut short", "its HDF5 file is cut in half", {"heavy": lambda c: c[: len(c) // 2]}, "bad.h5: .*it is cut short"),
    ("not a mesh", "its HDF5 file is text", {"heavy": lambda c: b"no HDF5"}, "bad.h5: cannot be read"),
    ("links", "an array is gone from its HDF5 file", {"edit": _arrays(_gone)}, "bad.h5, .*: is missing"),
    ("types", "an array of its HDF5 file is text", {"edit": _arrays(_text)}, "bad.h5, .*: holds .S1, expected"),
    (
        "counts",
        "an array of its HDF5 file has 10^12 numbers",
        {"edit": _arrays(_huge)},
        "bad.h5, .*: declares 8000000000000",
    ),
]


def cases() -> Iterator[Case]:
    """Both formats."""
    for name, writer, changes in (("vtu", raw.vtu, VTU), ("xdmf", raw.xdmf, XDMF)):
        text = writer(two_hexahedra()).decode()
        for kind, what, old, new, says in changes:
            assert old in text, (name, what)
            every = what.startswith("there is no") or what == "another of VTK's grids"
            yield Case(kind, name, what, text.replace(old, new, -1 if every else 1).encode(), says)
    for kind, what, change, says in HEAVY:
        yield Case(kind, "xdmf", what, partial(_put, **change), says)
    yield Case(
        "links", "xdmf", "its HDF5 file is of another writing", _other, "is not the file that was written with it"
    )
    yield from _packed()
    two = raw.xdmf(two_hexahedra()).decode()
    grid = re.search(r"<Grid .*</Grid>\n", two, re.DOTALL)
    assert grid is not None
    other = grid[0].replace('Name="mesh"', 'Name="other"').replace("2.0 1.0 1.0", "2.5 1.0 1.0")
    content = two.replace(grid[0], grid[0] + other).encode()
    yield Case("several meshes", "xdmf", "two, and none is chosen", content, "say which: mesh, other", 2)
    wrong = (*CUT, "--mesh", "othr")
    yield Case(
        "several meshes", "xdmf", "two, and another is chosen", content, "named 'othr'; did you mean other", 2, wrong
    )


def _packed() -> Iterator[Case]:
    """VTU with binary, compressed arrays."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
        (Path(folder) / "in.msh").write_bytes(raw.msh41(two_hexahedra()))
        path = Path(folder) / "packed.vtu"
        lacmesh.write(path, lacmesh.read(Path(folder) / "in.msh"), compress=True)
        content = path.read_bytes()
    block = content.index(b"_", content.index(b"<AppendedData")) + 1
    found = re.search(rb'Name="Points"[^>]* offset="(\d+)"', content)
    assert found is not None
    start = block + int(found[1])
    yield Case("cut short", "vtu", "in its packed arrays", content[: start + 20], "<DataArray .*: cannot be read")
    for kind, what, new in (
        ("counts", "packed arrays of 2^64 blocks", b"\xff" * 8),
        ("counts", "packed arrays of 2^40 bytes", struct.pack("<3q", 1, 2**40, 2**40)),
        ("counts", "packed arrays of no blocks", bytes(8)),
        ("numbers", "packed arrays of other bytes", struct.pack("<4q", 1, 2**15, 288, 8) + b"rubbish!"),
    ):
        spoilt = content[:start] + new + content[start + len(new) :]
        yield Case(kind, "vtu", what, spoilt, "<DataArray .*: cannot be read|<Points>: holds 0 coordinates")
