"""Errors in MED, VTU and XDMF files as such, and in the HDF5 file beside an XDMF file."""

from __future__ import annotations

import re
import struct
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache, partial
from io import BytesIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np

import lacmesh
from tests.bad_input import raw
from tests.bad_input.case import CUT, INFO, Case
from tests.bad_input.raw import two_hexahedra

# ---- MED

STEP = f"{-1:020d}{-1:020d}"
HOME = {"MED 2.3": "ENS_MAA/mesh", "MED 3.0": f"ENS_MAA/mesh/{STEP}", "MED 4.1": f"ENS_MAA/mesh/{STEP}"}
FAMILY = {"MED 2.3": "ENS_MAA/mesh/FAS/ELEME/FAM_2", "MED 4.1": "FAS/mesh/ELEME/FAM_2"}
VERSIONS = {"MED 2.3": (2, 3, 6), "MED 3.0": (3, 0, 0), "MED 4.1": (4, 1, 0)}

Edit = Callable[[h5py.File, h5py.Group], object]


def edited(name: str, edit: Edit) -> Callable[[Path], bytes]:
    """A maker of the mesh of `raw`, changed; `edit` gets the file and the group that holds nodes and cells."""

    def make(_: Path) -> bytes:
        image = BytesIO(raw.med(two_hexahedra(), VERSIONS[name]))
        with h5py.File(image, "r+") as file:
            edit(file, file[HOME[name]])
        return image.getvalue()

    return make


def put(group: h5py.Group, name: str, values: object, **attributes: int) -> None:
    """Replace a dataset; attributes that are not given are kept."""
    kept = dict(group[name].attrs) if name in group else {}
    if name in group:
        del group[name]
    group.create_dataset(name, data=values).attrs.update({**kept, **attributes})


def attribute(place: str, key: str, value: object) -> Edit:
    """An edit that sets an attribute; `place` from the root, or from the nodes' and cells' group after a dot."""

    def edit(file: h5py.File, step: h5py.Group) -> None:
        (step[place[1:]] if place.startswith(".") else file[place]).attrs[key] = value

    return edit


def _external(file: h5py.File, step: h5py.Group) -> None:
    del step["NOE/COO"]
    step["NOE/COO"] = h5py.ExternalLink("elsewhere.med", "/x")


def _virtual(file: h5py.File, step: h5py.Group) -> None:
    layout = h5py.VirtualLayout((36,), "f8")
    layout[:] = h5py.VirtualSource("elsewhere.med", "x", (36,), "f8")
    del step["NOE/COO"]
    step["NOE"].create_virtual_dataset("COO", layout)


def _loop(file: h5py.File, step: h5py.Group) -> None:
    del step["MAI/HE8"]
    step["MAI/HE8"] = h5py.SoftLink(f"{step.name}/MAI/HE8")


def _huge(kind: str) -> Edit:
    def edit(file: h5py.File, step: h5py.Group) -> None:
        place, size = {"nodes": ("NOE/COO", 3 * 10**12), "cells": ("MAI/HE8/NOD", 8 * 10**11)}[kind]
        number = "f8" if kind == "nodes" else "i4"
        del step[place]
        step.create_dataset(place, shape=(size,), dtype=number, chunks=(10**6,)).attrs["NBR"] = size // 8

    return edit


def _bomb(file: h5py.File, step: h5py.Group) -> None:
    """Zeros, packed a thousand to one, that the file announces as 40 million nodes."""
    del step["NOE/COO"]
    data = step.create_dataset("NOE/COO", shape=(3 * 40_000_000,), dtype="f8", chunks=(1 << 17,), compression="gzip")
    data.attrs["NBR"] = 40_000_000


def _field(**changes: object) -> Edit:
    """A field on nodes in which something is changed: an attribute, or the values (CO), or its profile (PFL)."""

    def edit(file: h5py.File, step: h5py.Group) -> None:
        field = file.create_group("CHA/T")
        field.attrs.update({"MAI": np.bytes_("mesh"), "NCO": np.int32(1), "TYP": np.int32(6)})
        when = field.create_group(STEP)
        when.attrs.update({"NDT": np.int32(-1), "NOR": np.int32(-1), "PDT": 0.0})
        profile = "some" if "PFL" in changes else "MED_NO_PROFILE_INTERNAL"
        leaf = when.create_group(f"NOE/{profile}")
        leaf.attrs.update({"NGA": np.int32(1), "NBR": np.int32(12)})
        leaf["CO"] = changes.get("CO", np.arange(12.0))
        if changes.get("PFL") is not None:
            file["PROFILS/some/PFL"] = changes["PFL"]
        field.attrs.update({key: value for key, value in changes.items() if key in field.attrs})
        when.attrs.update({key: value for key, value in changes.items() if key in when.attrs})

    return edit


def _two(file: h5py.File, step: h5py.Group) -> None:
    file.copy("ENS_MAA/mesh", file["ENS_MAA"], "other")


def _families(file: h5py.File, step: h5py.Group) -> None:
    put(step, "MAI/QU4/FAM", np.array([-77, -2, -3, -3], "i4"))


BOTH: dict[str, list[tuple[str, Edit]]] = {
    "sections": [
        ("INFOS_GENERALES is missing", lambda f, s: f.pop("INFOS_GENERALES")),
        ("the version is missing", lambda f, s: f["INFOS_GENERALES"].attrs.pop("MAJ")),
        ("there are no meshes", lambda f, s: f.pop("ENS_MAA")),
        ("the mesh is gone", lambda f, s: f["ENS_MAA"].pop("mesh")),
        ("the nodes are missing", lambda f, s: s.pop("NOE")),
        ("the coordinates are missing", lambda f, s: s["NOE"].pop("COO")),
    ],
    "version": [
        ("version 5.1", attribute("INFOS_GENERALES", "MAJ", np.int32(5))),
        ("version 1.0", attribute("INFOS_GENERALES", "MAJ", np.int32(1))),
    ],
    "counts": [
        ("a coordinate too few", lambda f, s: put(s, "NOE/COO", np.zeros(35))),
        ("coordinates of 4 dimensions", attribute("ENS_MAA/mesh", "ESP", np.int32(4))),
        ("dimension -3", attribute("ENS_MAA/mesh", "ESP", np.int32(-3))),
        ("a node of a cell is missing", lambda f, s: put(s, "MAI/HE8/NOD", np.ones(15, "i4"))),
        ("3 numbers for 12 nodes", lambda f, s: put(s, "NOE/NUM", np.arange(3))),
        ("3 families for 2 cells", lambda f, s: put(s, "MAI/HE8/FAM", np.arange(3))),
        ("the number of nodes is text", attribute(".NOE/COO", "NBR", np.bytes_(b"twelve"))),
        ("10^12 coordinates, none of them stored", _huge("nodes")),
        ("10^11 cells, none of them stored", _huge("cells")),
        ("40 million nodes, none of them stored", _bomb),
    ],
    "numbers": [
        ("coordinates are integers", lambda f, s: put(s, "NOE/COO", np.zeros(36, "i4"))),
        ("coordinates are text", lambda f, s: put(s, "NOE/COO", np.array([b"x"] * 36))),
        ("nodes of cells are reals", lambda f, s: put(s, "MAI/HE8/NOD", np.ones(16))),
        ("coordinates without values", lambda f, s: put(s, "NOE/COO", h5py.Empty("f8"))),
    ],
    "types": [
        ("polygons", lambda f, s: s.create_group("MAI/POG")),
        ("polyhedra", lambda f, s: s.create_group("MAI/POE")),
        ("hexagonal prisms", lambda f, s: s.create_group("MAI/O12")),
        ("cells given by their faces", lambda f, s: s["MAI/HE8"].move("NOD", "DES")),
        ("a type is a dataset", lambda f, s: put(s["MAI"], "HE8", np.ones(3))),
    ],
    "content": [
        ("a structured grid", attribute("ENS_MAA/mesh", "TYP", np.int32(1))),
        ("cylindrical coordinates", attribute("ENS_MAA/mesh", "REP", np.int32(1))),
    ],
    "links": [
        ("coordinates in another file", _external),
        ("coordinates in another file, virtually", _virtual),
        ("a link to itself", _loop),
    ],
}
ONE: dict[str, list[tuple[str, str, Edit]]] = {
    "sections": [("MED 4.1", "the step is missing", lambda f, s: f["ENS_MAA/mesh"].pop(STEP))],
    "numbers": [
        ("MED 4.1", "a family without a number", lambda f, s: f[FAMILY["MED 4.1"]].attrs.pop("NUM")),
        ("MED 2.3", "a family without a number", lambda f, s: f[FAMILY["MED 2.3"]].attrs.pop("NUM")),
    ],
    "counts": [
        ("MED 4.1", "9 names in the room of one", attribute(f"{FAMILY['MED 4.1']}/GRO", "NBR", np.int32(9))),
        ("MED 4.1", "-1 names", attribute(f"{FAMILY['MED 4.1']}/GRO", "NBR", np.int32(-1))),
    ],
    "fields": [
        ("MED 4.1", "3 values for 12 nodes", _field(CO=np.zeros(3))),
        ("MED 4.1", "10^9 components", _field(NCO=np.int32(10**9))),
        ("MED 4.1", "-1 components", _field(NCO=np.int32(-1))),
        ("MED 4.1", "no components", _field(NCO=np.int32(0))),
        ("MED 4.1", "values are text", _field(CO=np.array([b"x"] * 12))),
        ("MED 4.1", "the profile is missing", _field(PFL=None)),
        ("MED 4.1", "the profile names node 13 of 12", _field(PFL=np.array([13]))),
        ("MED 4.1", "the profile names node 0", _field(PFL=np.array([0]))),
        ("MED 4.1", "its time is text", _field(PDT=np.bytes_(b"now"))),
    ],
}


def _med() -> Iterator[Case]:
    """Cases for both layouts, and for defects that only one of them can have."""
    for kind, edits in BOTH.items():
        yield from (Case(kind, name, what, edited(name, e)) for what, e in edits for name in ("MED 2.3", "MED 4.1"))
    for kind, ones in ONE.items():
        yield from (Case(kind, name, what, edited(name, edit)) for name, what, edit in ones)
    for name in VERSIONS:
        two, one = edited(name, _two), edited(name, lambda f, s: None)
        for what, make, mesh in (
            ("two, and none is chosen", two, ()),
            ("two, and another is chosen", two, ("--mesh", "meshes")),
            ("one, and another is chosen", one, ("--mesh", "q")),
        ):
            yield Case("several meshes", name, what, make, 2, (*CUT, *mesh))
    yield Case("groups", "MED 4.1", "a family that is not defined", edited("MED 4.1", _families), 0, INFO)
    for what, notes in (("no JSON", b"{"), ("a list", b"[1]"), ("nested 100000 deep", b"[" * 100_000)):
        yield Case("our notes", "MED 4.1", what, edited("MED 4.1", _noted(notes)), 0, INFO)
    yield Case("magic", "MED 4.1", "the version of its HDF5 is unknown", _superblock)


def _noted(notes: bytes) -> Edit:
    return lambda file, step: file.create_dataset("LACMESH/notes", data=np.frombuffer(notes, np.uint8))


def _superblock(folder: Path) -> None:
    content = bytearray(edited("MED 4.1", lambda f, s: None)(folder))
    content[8] = 99
    (folder / "bad.med").write_bytes(content)


# ---- VTU and XDMF

_ENTITIES = '<?xml version="1.0"?>\n<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
INCLUDE = '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" xpointer="xpointer(/Xdmf/{})"/>'
SIX = '"6" NumberType="Int" Precision="8" Format="XML">\n'
#: format -> kind -> what is wrong, what is replaced, by what
XML = {
    "vtu": {
        "sections": [
            ("there is no grid", "UnstructuredGrid>", "Grid>"),
            ("a tag is not closed", "</Points>", ""),
            ("XML entities", '<?xml version="1.0"?>', _ENTITIES),
        ],
        "content": [("another of VTK's grids", "UnstructuredGrid", "PolyData")],
        "version": [("a byte order that nobody knows", "LittleEndian", "MiddleEndian")],
        "counts": [
            ("a coordinate is missing", "0.0 0.0 0.0 1.0", "0.0 0.0 0.0"),
            ("a node too few", "\n0 1 4 3 6", "\n0 1 4 3"),
            ("offsets that go back", "\n8 16 20", "\n16 8 20"),
            ("an offset of 10^12", "\n8 16 20", "\n8 1000000000000 20"),
            (
                "3 components in place of 1",
                'cell_number" NumberOfComponents="1"',
                'cell_number" NumberOfComponents="3"',
            ),
            (
                "10^12 components",
                'cell_number" NumberOfComponents="1"',
                'cell_number" NumberOfComponents="1000000000000"',
            ),
        ],
        "numbers": [
            ("letters where a coordinate should be", "0.0 0.0 0.0 1.0", "0.0 l.0 0.0 1.0"),
            ("nodes of cells are reals", 'type="Int64" Name="connectivity"', 'type="Float64" Name="connectivity"'),
        ],
        "types": [
            ("a type of number that nobody knows", 'type="Float64" Name="Points"', 'type="Float16" Name="Points"'),
            ("an encoding that nobody knows", 'format="ascii">\n0.0', 'format="morse">\n0.0'),
            ("polyhedra", "\n12 12 9", "\n42 12 9"),
            ("a hexahedron of 4 nodes", "\n12 12 9", "\n12 9 12"),
        ],
        "links": [
            ("arrays in a block that is not there", 'format="ascii">\n0.0', 'format="appended" offset="0">\n0.0'),
        ],
    },
    "xdmf": {
        "sections": [
            ("there is no domain", "Domain>", "Main>"),
            ("there is no grid", "Grid", "Gird"),
            ("there is no topology", "Topology", "Topologie"),
            ("there is no geometry", "Geometry", "Geometrie"),
            ("a tag is not closed", "</Grid>", ""),
            ("XML entities", '<?xml version="1.0"?>', _ENTITIES),
        ],
        "content": [
            ("a structured grid", 'GridType="Uniform"', 'GridType="Subset"'),
            ("points in polar coordinates", 'GeometryType="XYZ"', 'GeometryType="VXVYVZ"'),
        ],
        "types": [
            ("cells of one type that nobody knows", 'TopologyType="Mixed"', 'TopologyType="Hexagon"'),
            ("numbers that nobody knows", 'NumberType="Float"', 'NumberType="Complex"'),
            ("a format that nobody knows", 'Precision="8" Format="XML"', 'Precision="8" Format="TEXT"'),
            ("an attribute on edges", 'Center="Cell"', 'Center="Edge"'),
        ],
        "counts": [
            ("a number too few among the cells", "\n9 0 1", "\n9 0"),
            ("a coordinate is missing", "1.0 0.0 0.0\n", "1.0 0.0\n"),
            ("numbers for 5 of 6 cells", SIX + "101", SIX.replace("6", "5")),
        ],
        "numbers": [("letters where a coordinate should be", "1.0 0.0 0.0\n", "1.0 l.0 0.0\n")],
        "links": [
            ("an HDF5 file that is not there", 'Format="XML">\n0.0', 'Format="HDF">\nno.h5:/x\n0.0'),
            ("it includes what is not there", "<Geometry ", INCLUDE.format("Else") + "<Geometry "),
            (
                "a collection of grids includes itself",
                '<Grid Name="mesh" GridType="Uniform">',
                '<Grid Name="mesh" GridType="Collection">' + INCLUDE.format("Domain/Grid"),
            ),
        ],
    },
}


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


HEAVY: list[tuple[str, str, dict[str, Any]]] = [
    ("sections", "its HDF5 file is gone", {"heavy": lambda c: None}),
    ("cut short", "its HDF5 file is cut in half", {"heavy": lambda c: c[: len(c) // 2]}),
    ("not a mesh", "its HDF5 file is text", {"heavy": lambda c: b"no HDF5"}),
    ("links", "an array is gone from its HDF5 file", {"edit": _arrays(_gone)}),
    ("types", "an array of its HDF5 file is text", {"edit": _arrays(_text)}),
    ("counts", "an array of its HDF5 file has 10^12 numbers", {"edit": _arrays(_huge)}),
]


def cases() -> Iterator[Case]:
    """MED, then what is of XML in both formats, of HDF5 files beside it, of packed arrays, of several grids."""
    yield from _med()
    for name, writer in (("vtu", raw.vtu), ("xdmf", raw.xdmf)):
        text = writer(two_hexahedra()).decode()
        for kind, edits in XML[name].items():
            for what, old, new in edits:
                assert old in text, (name, what)
                every = what.startswith("there is no") or what == "another of VTK's grids"
                yield Case(kind, name, what, text.replace(old, new, -1 if every else 1).encode())
    for kind, what, change in HEAVY:
        yield Case(kind, "xdmf", what, partial(_put, **change))
    yield Case("links", "xdmf", "its HDF5 file is of another writing", _other)
    yield from _packed()
    two = raw.xdmf(two_hexahedra()).decode()
    grid = re.search(r"<Grid .*</Grid>\n", two, re.DOTALL)
    assert grid is not None
    other = grid[0].replace('Name="mesh"', 'Name="other"').replace("2.0 1.0 1.0", "2.5 1.0 1.0")
    content = two.replace(grid[0], grid[0] + other).encode()
    yield Case("several meshes", "xdmf", "two, and none is chosen", content, 2)
    yield Case("several meshes", "xdmf", "two, and another is chosen", content, 2, (*CUT, "--mesh", "othr"))


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
    yield Case("cut short", "vtu", "in its packed arrays", content[: start + 20])
    for kind, what, new in (
        ("counts", "packed arrays of 2^64 blocks", b"\xff" * 8),
        ("counts", "packed arrays of 2^40 bytes", struct.pack("<3q", 1, 2**40, 2**40)),
        ("counts", "packed arrays of no blocks", bytes(8)),
        ("numbers", "packed arrays of other bytes", struct.pack("<4q", 1, 2**15, 288, 8) + b"rubbish!"),
    ):
        spoilt = content[:start] + new + content[start + len(new) :]
        yield Case(kind, "vtu", what, spoilt)
