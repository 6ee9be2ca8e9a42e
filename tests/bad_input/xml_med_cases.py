"""Errors in MED, VTU and XDMF files as such, and in the HDF5 file beside an XDMF file."""

from __future__ import annotations

import re
import struct
import tempfile
import warnings
from functools import cache, partial
from io import BytesIO
from pathlib import Path

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


def edited(name, edit=lambda file, step: None):
    """A maker of the mesh of `raw`, changed; `edit` gets the file and the group that holds nodes and cells."""

    def make(_):
        image = BytesIO(raw.med(two_hexahedra(), VERSIONS[name]))
        with h5py.File(image, "r+") as file:
            edit(file, file[HOME[name]])
        return image.getvalue()

    return make


def put(group, name, values, **attributes):
    """Replace a dataset; attributes that are not given are kept."""
    kept = dict(group[name].attrs) if name in group else {}
    if name in group:
        del group[name]
    group.create_dataset(name, data=values).attrs.update({**kept, **attributes})


def attribute(place, key, value):
    """An edit that sets an attribute; `place` from the root, or from the nodes' and cells' group after a dot."""

    def edit(file, step):
        (step[place[1:]] if place.startswith(".") else file[place]).attrs[key] = value

    return edit


def _external(file, step):
    del step["NOE/COO"]
    step["NOE/COO"] = h5py.ExternalLink("elsewhere.med", "/x")


def _virtual(file, step):
    layout = h5py.VirtualLayout((36,), "f8")
    layout[:] = h5py.VirtualSource("elsewhere.med", "x", (36,), "f8")
    del step["NOE/COO"]
    step["NOE"].create_virtual_dataset("COO", layout)


def _loop(file, step):
    del step["MAI/HE8"]
    step["MAI/HE8"] = h5py.SoftLink(f"{step.name}/MAI/HE8")


def _huge(kind):
    def edit(file, step):
        place, size = {"nodes": ("NOE/COO", 3 * 10**12), "cells": ("MAI/HE8/NOD", 8 * 10**11)}[kind]
        number = "f8" if kind == "nodes" else "i4"
        del step[place]
        step.create_dataset(place, shape=(size,), dtype=number, chunks=(10**6,)).attrs["NBR"] = size // 8

    return edit


def _bomb(file, step):
    """Zeros, packed a thousand to one, that the file announces as 40 million nodes."""
    del step["NOE/COO"]
    data = step.create_dataset("NOE/COO", shape=(3 * 40_000_000,), dtype="f8", chunks=(1 << 17,), compression="gzip")
    data.attrs["NBR"] = 40_000_000


def _field(**changes):
    """A field on nodes in which something is changed: an attribute, or the values (CO), or its profile (PFL)."""

    def edit(file, step):
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


BOTH = {
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
#: layout, kind, what is wrong, the edit
ONE = [
    ("MED 4.1", "sections", "the step is missing", lambda f, s: f["ENS_MAA/mesh"].pop(STEP)),
    ("MED 4.1", "numbers", "a family without a number", lambda f, s: f[FAMILY["MED 4.1"]].attrs.pop("NUM")),
    ("MED 2.3", "numbers", "a family without a number", lambda f, s: f[FAMILY["MED 2.3"]].attrs.pop("NUM")),
    ("MED 4.1", "counts", "9 names in the room of one", attribute(f"{FAMILY['MED 4.1']}/GRO", "NBR", np.int32(9))),
    ("MED 4.1", "counts", "-1 names", attribute(f"{FAMILY['MED 4.1']}/GRO", "NBR", np.int32(-1))),
]
FIELDS = {
    "3 values for 12 nodes": {"CO": np.zeros(3)},
    "10^9 components": {"NCO": np.int32(10**9)},
    "-1 components": {"NCO": np.int32(-1)},
    "no components": {"NCO": np.int32(0)},
    "values are text": {"CO": np.array([b"x"] * 12)},
    "the profile is missing": {"PFL": None},
    "the profile names node 13 of 12": {"PFL": np.array([13])},
    "the profile names node 0": {"PFL": np.array([0])},
    "its time is text": {"PDT": np.bytes_(b"now")},
}


def _med():
    """Cases for both layouts, and for defects that only one of them can have."""
    for kind, edits in BOTH.items():
        yield from (Case(kind, name, what, edited(name, e)) for what, e in edits for name in ("MED 2.3", "MED 4.1"))
    yield from (Case(kind, name, what, edited(name, edit)) for name, kind, what, edit in ONE)
    yield from (Case("fields", "MED 4.1", what, edited("MED 4.1", _field(**one))) for what, one in FIELDS.items())
    for name in VERSIONS:
        two, one = edited(name, lambda f, s: f.copy("ENS_MAA/mesh", f["ENS_MAA"], "other")), edited(name)
        for what, make, mesh in (
            ("two, and none is chosen", two, ()),
            ("two, and another is chosen", two, ("--mesh", "meshes")),
            ("one, and another is chosen", one, ("--mesh", "q")),
        ):
            yield Case("several meshes", name, what, make, 2, (*CUT, *mesh))
    families = edited("MED 4.1", lambda f, s: put(s, "MAI/QU4/FAM", np.array([-77, -2, -3, -3], "i4")))
    yield Case("groups", "MED 4.1", "a family that is not defined", families, 0, INFO)
    for what, notes in (("no JSON", b"{"), ("a list", b"[1]"), ("nested 100000 deep", b"[" * 100_000)):
        note = edited("MED 4.1", lambda f, s, n=notes: f.create_dataset("LACMESH/notes", data=np.frombuffer(n, "u1")))
        yield Case("our notes", "MED 4.1", what, note, 0, INFO)
    content = edited("MED 4.1")(None)
    yield Case("magic", "MED 4.1", "the version of its HDF5 is unknown", content[:8] + b"c" + content[9:])


# ---- VTU and XDMF


@cache
def written(suffix, **options):
    """The files of a format that lacmesh writes, by their names."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", lacmesh.LacmeshWarning)
        (Path(folder) / "in.msh").write_bytes(raw.msh41(two_hexahedra()))
        lacmesh.write(Path(folder) / f"bad{suffix}", lacmesh.read(Path(folder) / "in.msh"), **options)
        return {path.name: path.read_bytes() for path in sorted(Path(folder).glob("bad.*"))}


def _put(folder, change=None, edit=None):
    """An XDMF file and its HDF5 file in a folder; `change`: of the bytes of the second one, `edit`: of its objects.

    The edit is told the place of the first array that the XML names.
    """
    for name, content in written(".xdmf").items():
        (folder / name).write_bytes(content)
    heavy = folder / "bad.h5"
    if change is not None:
        content = change(heavy.read_bytes())
        heavy.unlink() if content is None else heavy.write_bytes(content)
    if edit is not None:
        place = re.search(rb"bad\.h5:(/[\w/.:-]+)", written(".xdmf")["bad.xdmf"])[1].decode()
        with h5py.File(heavy, "r+") as file:
            edit(file, place)


def _text(file, place):
    put(file, place, np.full(file[place].shape, b"x"))


def _more(file, place):
    del file[place]
    file.create_dataset(place, shape=(10**12,), dtype="f8", chunks=(10**6,))


HEAVY = [
    ("sections", "its HDF5 file is gone", {"change": lambda c: None}),
    ("cut short", "its HDF5 file is cut in half", {"change": lambda c: c[: len(c) // 2]}),
    ("not a mesh", "its HDF5 file is text", {"change": lambda c: b"no HDF5"}),
    ("links", "an array is gone from its HDF5 file", {"edit": lambda file, place: file.pop(place)}),
    ("types", "an array of its HDF5 file is text", {"edit": _text}),
    ("counts", "an array of its HDF5 file has 10^12 numbers", {"edit": _more}),
    ("links", "its HDF5 file is of another writing", {"edit": lambda f, _: f.attrs.update(lacmesh_id="another")}),
]


def cases():
    """MED, then HDF5 files beside XDMF, packed arrays of VTU, several grids."""
    yield from _med()
    for kind, what, change in HEAVY:
        yield Case(kind, "xdmf", what, partial(_put, **change))
    yield from _packed()
    two = raw.xdmf(two_hexahedra()).decode()
    grid = re.search(r"<Grid .*</Grid>\n", two, re.DOTALL)[0]
    other = grid.replace('Name="mesh"', 'Name="other"').replace("2.0 1.0 1.0", "2.5 1.0 1.0")
    content = two.replace(grid, grid + other).encode()
    yield Case("several meshes", "xdmf", "two, and none is chosen", content, 2)
    yield Case("several meshes", "xdmf", "two, and another is chosen", content, 2, (*CUT, "--mesh", "othr"))


def _packed():
    """VTU with binary, compressed arrays."""
    content = written(".vtu", compress=True)["bad.vtu"]
    block = content.index(b"_", content.index(b"<AppendedData")) + 1
    start = block + int(re.search(rb'Name="Points"[^>]* offset="(\d+)"', content)[1])
    yield Case("cut short", "vtu", "in its packed arrays", content[: start + 20])
    for kind, what, new in (
        ("counts", "packed arrays of 2^64 blocks", b"\xff" * 8),
        ("counts", "packed arrays of 2^40 bytes", struct.pack("<3q", 1, 2**40, 2**40)),
        ("counts", "packed arrays of no blocks", bytes(8)),
        ("numbers", "packed arrays of other bytes", struct.pack("<4q", 1, 2**15, 288, 8) + b"rubbish!"),
    ):
        yield Case(kind, "vtu", what, content[:start] + new + content[start + len(new) :])
