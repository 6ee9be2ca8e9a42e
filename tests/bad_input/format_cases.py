"""Errors in files of each format as such: in their sections, counts and numbers, and in the HDF5 file beside XDMF."""

import json
import re
import struct
import tempfile
import tomllib
import warnings
from functools import cache, partial
from io import BytesIO
from pathlib import Path

import h5py
import numpy as np

import lacmesh
from tests.bad_input import raw
from tests.bad_input.case import CUT, INFO, Case
from tests.bad_input.mesh_cases import WRITERS
from tests.bad_input.raw import two_hexahedra
from tests.formats import test_xml, texts

#: of msh 4.1 binary, the head of its nodes; of 2.2, that of a cell
BLOCK, HEADER = struct.pack("<3iq", 3, 1, 0, 12), struct.pack("<3i", 5, 1, 2)
MARKS = [
    ("no byte order mark", b"8\n\1\0\0\0", b"8\n\7\0\0\7"),
    ("the mark of the other byte order", b"8\n\1\0\0\0", b"8\n\0\0\0\1"),
    ("said to be ASCII and is not", " 1 8\n", " 0 8\n"),
]
#: format -> kind -> what is wrong, what is replaced, by what, and where the command says that it is, if by a line
EDITS = tomllib.loads((Path(__file__).parent / "edits.toml").read_text(encoding="utf-8")) | {
    "msh 4.1 binary": {
        "version": MARKS,
        "counts": [
            ("-1 blocks of cells", struct.pack("<2q", 3, 6), struct.pack("<2q", -1, 6)),
            ("2^62 blocks", struct.pack("<2q", 3, 6), struct.pack("<2q", 2**62, 6)),
        ],
        "types": [
            ("an entity of dimension -1", BLOCK, struct.pack("<3iq", -1, 1, 0, 12)),
            ("the largest tag of an entity", BLOCK, struct.pack("<3iq", 3, -(2**31), 0, 12)),
        ],
    },
    "msh 2.2 binary": {
        "version": MARKS,
        "counts": [
            ("0 cells follow a header", HEADER, struct.pack("<3i", 5, 0, 2)),
            ("2^31 - 1 cells follow a header", HEADER, struct.pack("<3i", 5, 2**31 - 1, 2)),
            ("-1 tags", HEADER, struct.pack("<3i", 5, 1, -1)),
        ],
        "types": [
            ("type 0", HEADER, struct.pack("<3i", 0, 1, 2)),
            ("type -5", HEADER, struct.pack("<3i", -5, 1, 2)),
        ],
    },
}


def good(name):
    return WRITERS[name](two_hexahedra())


def edited(content, old, new, count=1):
    """The content with one thing replaced; `count`: so many times, or everywhere with -1."""
    before, after = (text.encode() if isinstance(text, str) else text for text in (old, new))
    assert before in content, old
    return content.replace(before, after, count)


def _field(time=0.0, n=3, width=1, rows=1, value=5.0):
    return f'$NodeData\n1\n"T"\n1\n{time}\n{n}\n0\n{width}\n{rows}\n11 {value}\n$EndNodeData\n'


FIELDS = {
    "no name": "$NodeData\n0\n0\n3\n0\n1\n0\n$EndNodeData\n",
    "10^12 rows": _field(rows=10**12),
    "10^12 components": _field(width=10**12),
    "-1 components": _field(width=-1),
    "two integers": '$NodeData\n1\n"T"\n1\n0.0\n2\n0\n1\n11 5.0\n$EndNodeData\n',
    "its time is NaN": _field(time="nan"),
    "letters": _field(value="hot"),
}
_HEAD = {"version": 1, "nodes": 12, "cells": 6}
_FIELD = {"on": "node", "field": "T", "step": 0, "key": "T", "name": "T", "number": 0, "order": -1}
#: what is wrong in our own section -> its text, or what it says as JSON
NOTES = {
    "no JSON": "{",
    "a list": [1],
    "no version": {"nodes": 1},
    "a zone that is a number": {**_HEAD, "zones": [7]},
    "a field's shape of 10^12": {**_HEAD, "fields": [{**_FIELD, "shape": [10**12], "integer": False}]},
    "nested 100000 deep": "[" * 100_000,
}
#: and what is left out with a warning
LEFT_OUT = {
    "for another number of nodes": {**_HEAD, "nodes": 5, "node_groups": [{"name": "g", "nodes": [11]}]},
    "members that are not there": {**_HEAD, "node_groups": [{"name": "g", "nodes": [999]}]},
    "of a newer lacmesh": {"version": 3},
}
_MORE = ("*NODE\n", "*INCLUDE, INPUT=more.inp\n*NODE\n")
_WARNED = {}, {"status": 0, "command": INFO}


def _texts():
    """Small files that are wrong in one place, each with that place and words on it."""
    for name in ("inp", "mail"):
        for what, (text, line, words) in texts.WRONG[name].items():
            yield Case("text", name, what, text.encode(), says=rf"line {line}\b.*{re.escape(words)}")
    for old, new, words in texts.WRONG["msh"]["changes"]:
        content, says = edited(texts.ASCII4.encode(), old, new), rf"^(?=.*(line|byte) ).*{re.escape(words)}"
        yield Case("text", "msh 4.1 ASCII", f"{old!r} -> {new!r}", content, says=says)
    for what, (text, words) in test_xml.WRONG_VTU.items():
        yield Case("text", "vtu", what, text.encode(), says=words)
    for what, (body, words) in test_xml.WRONG_XDMF.items():
        yield Case("text", "xdmf", what, test_xml.document(body).encode(), says=words)


def cases():
    """Texts; edits of every format; then sections, fields and notes of msh; decks and files of several parts."""
    yield from _texts()
    for name, kinds in EDITS.items():
        for kind, edits in kinds.items():
            for what, old, new, *says in edits:
                every = name in ("vtu", "xdmf") and what.startswith(("there is no", "another of"))
                content = edited(good(name), old, new, -1 if every else 1)
                yield Case(kind, name, what, content, says="".join(says))
    for name in (name for name in WRITERS if name.startswith("msh")):
        for what, content in _sections(good(name)):
            left_out = what in ("$Elements is missing", "a section that nobody knows")
            yield Case("sections", name, what, content, **_WARNED[left_out])
    for what, text in FIELDS.items():
        yield Case("fields", "msh 4.1 ASCII", what, good("msh 4.1 ASCII") + text.encode())
    for what, notes in (NOTES | LEFT_OUT).items():
        text = _field() if "shape" in what else ""
        text += f"$LacMesh\n{notes if isinstance(notes, str) else json.dumps(notes)}\n$EndLacMesh\n"
        content = good("msh 4.1 ASCII") + text.encode()
        yield Case("our notes", "msh 4.1 ASCII", what, content, **_WARNED[what in LEFT_OUT])
    yield from _of_inp()
    yield from _of_hdf5()


def _parted(content, section):
    """What is before a section, the section, what is after it."""
    begin, end = content.index(b"$" + section), content.index(b"$End" + section) + len(section) + 5
    return content[:begin], content[begin:end], content[end:]


def _sections(content):
    """Sections of a msh file that are missing, repeated, or in a wrong order."""
    for title in (b"Nodes", b"Elements"):
        before, section, after = _parted(content, title)
        yield f"${title.decode()} is missing", before + after.removeprefix(b"\n")
        yield f"two ${title.decode()}", content + section
    nodes, elements = content.index(b"$Nodes"), content.index(b"$Elements")
    yield "$Elements stands before $Nodes", content[:nodes] + content[elements:] + content[nodes:elements]
    yield "$EndNodes is spoilt", edited(content, b"$EndNodes", b"$EndNod")
    yield "rubbish after the last section", edited(content, b"$EndElements\n", b"$EndElements\nrubbish\n")
    yield "a section that nobody knows", content + b"$Strange\n1 2 3\n$EndStrange\n"


def _with_more(content, more, folder):
    (folder / "bad.inp").write_bytes(content)
    (folder / "more.inp").write_bytes(more)


def _of_inp():
    """Files in files, cards that are no mesh, and decks that contradict themselves, to be written as decks."""
    inp = good("inp")
    for what, more in (
        ("the file that is included has an error", b"*NODE\n31, a, b, c\n"),
        ("two files include each other", b"*INCLUDE, INPUT=bad.inp\n"),
    ):
        yield Case("sections", "inp", what, partial(_with_more, edited(inp, *_MORE), more))
    text = inp + b"*MATERIAL, NAME=steel\n*STEP\n*STATIC\n*END STEP\n"
    yield Case("sections", "inp", "cards that are no mesh, to a format without a place for them", text, 0)
    text = inp + b"*STEP\n*STATIC\n*DLOAD\n101, P1, 1.\n102, P1, 1.\n*END STEP\n"
    cut = (*CUT, "--hexa", "hexa")
    yield Case("decks", "inp", "a load on an element that is cut", text, 1, cut, out="out.inp")
    yield Case("decks", "inp", "the same, with --lenient", text, 0, (*cut, "--lenient"), out="out.inp")
    text = inp + b"*NSET, NSET=A, GENERATE\n1, 1000000000000, 1\n"
    yield Case("counts", "inp", "10^12 numbers to generate: those that are there", text, 0, INFO)


# ---- MED

STEP = f"{-1:020d}{-1:020d}"
HOME = {"MED 2.3": "ENS_MAA/mesh", "MED 3.0": f"ENS_MAA/mesh/{STEP}", "MED 4.1": f"ENS_MAA/mesh/{STEP}"}
FAMILY = {"MED 2.3": "ENS_MAA/mesh/FAS/ELEME/FAM_2", "MED 4.1": "FAS/mesh/ELEME/FAM_2"}
VERSIONS = {"MED 2.3": (2, 3, 6), "MED 3.0": (3, 0, 0), "MED 4.1": (4, 1, 0)}


def in_med(name, edit=lambda file, step: None):
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


def _med_field(**changes):
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
MED_FIELDS = {
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
        yield from (Case(kind, name, what, in_med(name, e)) for what, e in edits for name in ("MED 2.3", "MED 4.1"))
    yield from (Case(kind, name, what, in_med(name, edit)) for name, kind, what, edit in ONE)
    yield from (
        Case("fields", "MED 4.1", what, in_med("MED 4.1", _med_field(**one))) for what, one in MED_FIELDS.items()
    )
    for name in VERSIONS:
        two, one = in_med(name, lambda f, s: f.copy("ENS_MAA/mesh", f["ENS_MAA"], "other")), in_med(name)
        for what, make, mesh in (
            ("two, and none is chosen", two, ()),
            ("two, and another is chosen", two, ("--mesh", "meshes")),
            ("one, and another is chosen", one, ("--mesh", "q")),
        ):
            yield Case("several meshes", name, what, make, 2, (*CUT, *mesh))
    families = in_med("MED 4.1", lambda f, s: put(s, "MAI/QU4/FAM", np.array([-77, -2, -3, -3], "i4")))
    yield Case("groups", "MED 4.1", "a family that is not defined", families, 0, INFO)
    for what, notes in (("no JSON", b"{"), ("a list", b"[1]"), ("nested 100000 deep", b"[" * 100_000)):
        note = in_med("MED 4.1", lambda f, s, n=notes: f.create_dataset("LACMESH/notes", data=np.frombuffer(n, "u1")))
        yield Case("our notes", "MED 4.1", what, note, 0, INFO)
    content = in_med("MED 4.1")(None)
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


def _of_hdf5():
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
