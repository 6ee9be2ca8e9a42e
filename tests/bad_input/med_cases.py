"""Errors in a MED file as such: in its groups, datasets and attributes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np

from tests.bad_input import raw
from tests.bad_input.case import CUT, INFO, Case
from tests.bad_input.raw import two_hexahedra

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


BOTH: list[tuple[str, str, Edit, str]] = [
    ("sections", "INFOS_GENERALES is missing", lambda f, s: f.pop("INFOS_GENERALES"), "HDF5 file, but not MED"),
    ("sections", "the version is missing", lambda f, s: f["INFOS_GENERALES"].attrs.pop("MAJ"), "has no attribute MAJ"),
    ("version", "version 5.1", attribute("INFOS_GENERALES", "MAJ", np.int32(5)), "MED version 5.. is not read"),
    ("version", "version 1.0", attribute("INFOS_GENERALES", "MAJ", np.int32(1)), "MED version 1.. is not read"),
    ("sections", "there are no meshes", lambda f, s: f.pop("ENS_MAA"), "holds no mesh"),
    ("sections", "the mesh is gone", lambda f, s: f["ENS_MAA"].pop("mesh"), "holds no mesh"),
    (
        "sections",
        "the nodes are missing",
        lambda f, s: s.pop("NOE"),
        "NOE: is missing|neither nodes|no attribute|has neither",
    ),
    ("sections", "the coordinates are missing", lambda f, s: s["NOE"].pop("COO"), "NOE/COO: is missing"),
    ("counts", "a coordinate too few", lambda f, s: put(s, "NOE/COO", np.zeros(35)), "holds 35 values for 12 nodes"),
    ("counts", "coordinates of 4 dimensions", attribute("ENS_MAA/mesh", "ESP", np.int32(4)), "for 12 nodes in 4 dim"),
    ("counts", "dimension -3", attribute("ENS_MAA/mesh", "ESP", np.int32(-3)), "for 12 nodes in -3 dimensions"),
    (
        "numbers",
        "coordinates are integers",
        lambda f, s: put(s, "NOE/COO", np.zeros(36, "i4")),
        "int32, expected reals",
    ),
    ("numbers", "coordinates are text", lambda f, s: put(s, "NOE/COO", np.array([b"x"] * 36)), "expected reals"),
    (
        "numbers",
        "nodes of cells are reals",
        lambda f, s: put(s, "MAI/HE8/NOD", np.ones(16)),
        "float64, expected integers",
    ),
    ("numbers", "coordinates without values", lambda f, s: put(s, "NOE/COO", h5py.Empty("f8")), "COO: has no values"),
    (
        "counts",
        "a node of a cell is missing",
        lambda f, s: put(s, "MAI/HE8/NOD", np.ones(15, "i4")),
        "holds 15 values for 2",
    ),
    (
        "counts",
        "3 numbers for 12 nodes",
        lambda f, s: put(s, "NOE/NUM", np.arange(3)),
        "NUM: holds 3 values, expected 12",
    ),
    (
        "counts",
        "3 families for 2 cells",
        lambda f, s: put(s, "MAI/HE8/FAM", np.arange(3)),
        "FAM: holds 3 values, expected 2",
    ),
    (
        "counts",
        "the number of nodes is text",
        attribute(".NOE/COO", "NBR", np.bytes_(b"twelve")),
        "NBR is not an integer",
    ),
    ("counts", "10^12 coordinates, none of them stored", _huge("nodes"), "COO: declares 24000000000000 bytes"),
    ("counts", "10^11 cells, none of them stored", _huge("cells"), "NOD: declares 3200000000000 bytes"),
    ("counts", "40 million nodes, none of them stored", _bomb, "COO: declares 960000000 bytes"),
    ("types", "polygons", lambda f, s: s.create_group("MAI/POG"), "polygons are not read"),
    ("types", "polyhedra", lambda f, s: s.create_group("MAI/POE"), "polyhedra are not read"),
    ("types", "hexagonal prisms", lambda f, s: s.create_group("MAI/O12"), "OCTA12"),
    ("types", "cells given by their faces", lambda f, s: s["MAI/HE8"].move("NOD", "DES"), "descending connectivity"),
    (
        "types",
        "a type is a dataset",
        lambda f, s: put(s["MAI"], "HE8", np.ones(3)),
        "HE8: is a dataset, expected a group",
    ),
    ("content", "a structured grid", attribute("ENS_MAA/mesh", "TYP", np.int32(1)), "structured grid"),
    ("content", "cylindrical coordinates", attribute("ENS_MAA/mesh", "REP", np.int32(1)), "cylindrical or spherical"),
    ("links", "coordinates in another file", _external, "points into another file"),
    ("links", "coordinates in another file, virtually", _virtual, "kept in another file"),
    ("links", "a link to itself", _loop, "HE8: cannot be read"),
]
ONE: list[tuple[str, str, str, Edit, str]] = [
    (
        "MED 4.1",
        "sections",
        "the step is missing",
        lambda f, s: f["ENS_MAA/mesh"].pop(STEP),
        "has neither nodes nor steps",
    ),
    (
        "MED 4.1",
        "numbers",
        "a family without a number",
        lambda f, s: f[FAMILY["MED 4.1"]].attrs.pop("NUM"),
        "no attribute NUM",
    ),
    (
        "MED 2.3",
        "numbers",
        "a family without a number",
        lambda f, s: f[FAMILY["MED 2.3"]].attrs.pop("NUM"),
        "no attribute NUM",
    ),
    (
        "MED 4.1",
        "counts",
        "9 names in the room of one",
        attribute(f"{FAMILY['MED 4.1']}/GRO", "NBR", np.int32(9)),
        "80 bytes for 9 names",
    ),
    (
        "MED 4.1",
        "counts",
        "-1 names",
        attribute(f"{FAMILY['MED 4.1']}/GRO", "NBR", np.int32(-1)),
        "80 bytes for -1 names",
    ),
    ("MED 4.1", "fields", "3 values for 12 nodes", _field(CO=np.zeros(3)), "CO: holds 3 values, expected 12"),
    ("MED 4.1", "fields", "10^9 components", _field(NCO=np.int32(10**9)), "CO: holds 12 values, expected 12000000000"),
    ("MED 4.1", "fields", "-1 components", _field(NCO=np.int32(-1)), "has -1 components"),
    ("MED 4.1", "fields", "no components", _field(NCO=np.int32(0)), "has 0 components"),
    ("MED 4.1", "fields", "values are text", _field(CO=np.array([b"x"] * 12)), "CO: holds |S1, expected"),
    ("MED 4.1", "fields", "the profile is missing", _field(PFL=None), "PROFILS: is missing"),
    (
        "MED 4.1",
        "fields",
        "the profile names node 13 of 12",
        _field(PFL=np.array([13])),
        r"PFL: holds a number outside 1\.\.12",
    ),
    (
        "MED 4.1",
        "fields",
        "the profile names node 0",
        _field(PFL=np.array([0])),
        r"PFL: holds a number outside 1\.\.12",
    ),
    ("MED 4.1", "fields", "its time is text", _field(PDT=np.bytes_(b"now")), "PDT is not a number"),
]


def cases() -> Iterator[Case]:
    """Cases for both layouts, and for defects that only one of them can have."""
    for kind, what, edit, says in BOTH:
        for name in ("MED 2.3", "MED 4.1"):
            yield Case(kind, name, what, edited(name, edit), says)
    for name, kind, what, edit, says in ONE:
        yield Case(kind, name, what, edited(name, edit), says)
    for name in ("MED 2.3", "MED 3.0", "MED 4.1"):
        two = edited(name, _two)
        yield Case("several meshes", name, "two, and none is chosen", two, "holds 2 meshes, say which: mesh, other", 2)
        wrong = (*CUT, "--mesh", "meshes")
        yield Case(
            "several meshes", name, "two, and another is chosen", two, "no mesh named 'meshes'; did you", 2, wrong
        )
        strange = (*CUT, "--mesh", "q")
        one = edited(name, lambda f, s: None)
        yield Case(
            "several meshes", name, "one, and another is chosen", one, "no mesh named 'q'; there are: mesh", 2, strange
        )
    said = "cells in 1 undefined families .as -77. get no group"
    yield Case("groups", "MED 4.1", "a family that is not defined", edited("MED 4.1", _families), said, 0, INFO)
    for what, notes in (("no JSON", b"{"), ("a list", b"[1]"), ("nested 100000 deep", b"[" * 100_000)):
        content = edited("MED 4.1", _noted(notes))
        yield Case("our notes", "MED 4.1", what, content, "own notes .* are damaged and left out", 0, INFO)
    yield Case("magic", "MED 4.1", "the version of its HDF5 is unknown", _superblock, "cannot be read")


def _noted(notes: bytes) -> Edit:
    return lambda file, step: file.create_dataset("LACMESH/notes", data=np.frombuffer(notes, np.uint8))


def _superblock(folder: Path) -> None:
    content = bytearray(edited("MED 4.1", lambda f, s: None)(folder))
    content[8] = 99
    (folder / "bad.med").write_bytes(content)
