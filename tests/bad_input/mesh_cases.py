"""Files that hold no mesh, or a part of one; and errors in a mesh, in every format that can express them."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable
from functools import partial
from io import BytesIO
from math import inf, nan
from typing import NamedTuple

import h5py

import lacmesh
from tests.bad_input import raw
from tests.bad_input.case import CUT, INFO, Case
from tests.bad_input.raw import Cell, Raw, two_hexahedra

WRITERS = {
    "msh 2.2 ASCII": raw.msh22,
    "msh 2.2 binary": partial(raw.msh22, binary=True),
    "msh 4.1 ASCII": raw.msh41,
    "msh 4.1 binary": partial(raw.msh41, binary=True),
    "MED 2.3": partial(raw.med, version=(2, 3, 6)),
    "MED 4.1": raw.med,
    "mail": raw.mail,
    "inp": raw.inp,
    "vtu": raw.vtu,
    "xdmf": raw.xdmf,
}


# ---- files


def png():
    """A picture of one white pixel."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">2I5B", 1, 1, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0\xff")) + chunk(b"IEND", b"")


def other_hdf5():
    """HDF5 that has nothing to do with MED."""
    image = BytesIO()
    with h5py.File(image, "w") as file:
        file["pressure"] = [1.0, 2.0]
    return image.getvalue()


def _secret(folder):
    (folder / "bad.msh").write_bytes(WRITERS["msh 4.1 ASCII"](two_hexahedra()))
    (folder / "bad.msh").chmod(0)


TEXT = b"Dear all,\nthe mesh is in the annex.\n"
NOT_A_MESH = [
    ("a picture (PNG)", png()),
    ("text", TEXT),
    ("a page (HTML)", b"<!DOCTYPE html>\n<html><body>404 not found</body></html>\n"),
    ("XML that is no mesh", b'<?xml version="1.0"?>\n<note>no mesh</note>\n'),
    ("numbers separated by blanks", b"0 0 0\n1 0 0\n" * 40),
    ("zeros", b"\0" * 4096),
    ("UTF-16", "$MeshFormat\n4.1 0 8\n".encode("utf-16")),
    ("gzip", b"\x1f\x8b\x08\x00" + bytes(range(200))),
    ("CAD (STEP)", b"ISO-10303-21;\nHEADER;\nENDSEC;\n"),
    ("HDF5 without MED", other_hdf5()),
    ("empty", b""),
    ("blanks and line ends", b"  \n\r\n\t\n" * 10),
    ("a folder", lambda folder: (folder / "bad.msh").mkdir()),
    ("missing", lambda folder: (folder / "good.msh").touch()),
    ("a link to nothing", lambda folder: (folder / "bad.msh").symlink_to("nowhere.msh")),
    ("a link to itself", lambda folder: (folder / "bad.msh").symlink_to("bad.msh")),
    ("a pipe", lambda folder: os.mkfifo(folder / "bad.msh")),
]
#: Where a file is cut short, as parts of its length.
PARTS = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98)
#: .inp has no end: cut between two lines, it is a shorter file, whose slave group may be missing.
_IN_TWO = {("inp", part): 2 for part in (0.1, 0.25, 0.5, 0.75)} | {("inp", 0.9): 0}


def _files():
    """Files that are no meshes, then files that are cut short or begin otherwise, for each format."""
    for what, make in NOT_A_MESH:
        yield Case("not a mesh", "any", what, make)
    for suffix in (".med", ".mail", ".inp", ".vtu", ".xdmf"):
        for what, content in (("text", TEXT), ("a picture (PNG)", png())):
            yield Case("not a mesh", "any", f"{what} in a file named {suffix}", content, file=f"bad{suffix}")
    yield Case("permission", "any", "the input may not be read", _secret, nobody=True)
    for name, writer in WRITERS.items():
        content = writer(two_hexahedra())
        for part in PARTS:
            whole = content[: int(part * len(content))]
            yield Case("cut short", name, f"after {part:.0%} of the file", whole, _IN_TWO.get((name, part), 3))
        yield Case("cut short", name, "the last 4 bytes are missing", content[:-4])
        begin = content.index(b"\n") + 1 if name.startswith("msh") else 8
        for what, spoilt in (
            ("zeros before the file", b"\0" * 16 + content),
            ("without its beginning", content[begin:]),
        ):
            yield Case("magic", name, what, spoilt, 0 if name == "inp" else 3, INFO)


# ---- meshes


class Defect(NamedTuple):
    """`edit` spoils the mesh; `status`: in all formats, or by the first word of some; `lines`: as `Case.says`."""

    kind: str
    what: str
    edit: Callable[[Raw], object]
    status: int | dict[str, int] = 3
    command: tuple[str, ...] = CUT
    lines: dict[str, str] = {}

    def status_in(self, name):
        """Exit status for a file of a format; None where the format cannot have the defect."""
        return self.status if isinstance(self.status, int) else self.status.get(name.split()[0])


def _set(attribute, at, value):
    """Put a value in place of a node's number ("node_number"), of a coordinate ("points": y)."""

    def edit(mesh):
        if attribute == "points":
            mesh.points[at][1] = value
        else:
            mesh.node_number[at] = value

    return edit


def _number(at, number):
    return lambda mesh: setattr(mesh.cells[at], "number", number)


def _node(at, place, node=None):
    """Replace a node in a cell; None: by the previous node, which is then repeated."""

    def edit(mesh):
        nodes = mesh.cells[at].nodes
        nodes[place] = nodes[place - 1] if node is None else node

    return edit


def _count(**counts):
    return lambda mesh: mesh.count.update(counts)


def _more(*nodes):
    return lambda mesh: mesh.cells.append(Cell(107, "QUAD4", list(nodes), "SLAVE"))


def _only(*types):
    return lambda mesh: setattr(mesh, "cells", [cell for cell in mesh.cells if cell.type in types])


def _cut(group):
    return (*CUT[:3], group, *CUT[4:])


def _both(*edits: Callable[[Raw], object]):
    def edit(mesh):
        for one in edits:
            one(mesh)

    return edit


def _all_points(mesh):
    mesh.points = [[0.5, 0.5, 0.5] for _ in mesh.points]


def _nothing(mesh):
    mesh.points, mesh.node_number, mesh.cells = [], [], []


def _type(at, kind):
    return lambda mesh: setattr(mesh.cells[at], "type", kind)


#: statuses of formats that say how many nodes and cells there are, and of those in which numbers are fields
ANNOUNCED = {"msh": 3, "MED": 3, "vtu": 3, "xdmf": 3}
COUNTED = {"vtu": 0, "xdmf": 0}
NOT_FINITE = {"mail": "line 4: ", "inp": "line 7: "}
LOST = {"mail": "line 19: ", "inp": "line 16: "}
NO_NUMBER = LOST | {"inp": "line 17: "}


BOTH_TWICE = _both(_node(0, 5), _node(2, 1))
TWICE = {"msh": 3, "MED": 0, "mail": 3, "inp": 3, **COUNTED}
NODES, FACES = "nodes of cells", "slave faces"
DEFECTS = [
    Defect("coordinates", "a coordinate is NaN", _set("points", 3, nan), lines=NOT_FINITE),
    Defect("coordinates", "a coordinate is infinite", _set("points", 3, -inf), lines=NOT_FINITE),
    Defect("coordinates", "all nodes stand at one point", _all_points, 0),
    Defect("coordinates", "a coordinate is 1e308", _set("points", 3, 1e308), 0),
    Defect("numbers", "two nodes have one number", _set("node_number", 3, 13), TWICE),
    Defect("numbers", "a node has the number 0", _set("node_number", 0, 0), {"msh": 3, "MED": 0, "inp": 3, **COUNTED}),
    Defect("numbers", "a node has the number -1", _set("node_number", 0, -1), {"msh": 3, "MED": 1, "inp": 3} | COUNTED),
    Defect("numbers", "two cells have one number", _number(3, 103), TWICE),
    Defect("numbers", "a cell has the number 0", _number(3, 0), TWICE | {"mail": 0}),
    Defect("numbers", "a cell has the number -7", _number(3, -7), TWICE | {"mail": 0, "MED": 1}),
    Defect(NODES, "a cell has a node that is not there", _node(0, 2, 99), lines=LOST),
    Defect(NODES, "a cell has node 0", _node(0, 2, 0), {"msh": 3, "MED": 3, "mail": 3, "inp": 3}, lines=NO_NUMBER),
    Defect(NODES, "a cell has node -1", _node(0, 2, -1), lines=NO_NUMBER),
    Defect(NODES, "a cell has node 2147483647", _node(0, 2, 2**31 - 1), lines=NO_NUMBER),
    Defect(NODES, "a hexahedron has a corner of the slave face twice", _node(0, 5), 1),
    Defect(NODES, "a slave face has a node twice", _node(2, 1), 1),
    Defect(NODES, "the hexahedron behind a slave face has a node twice, away from it", _node(0, 1), 0),
    Defect(NODES, "a slave face and the hexahedron behind it have the same node twice", BOTH_TWICE, 0),
    Defect(FACES, "a slave face is no facet of a cell", _more(11, 13, 21, 17), 1),
    Defect(FACES, "there are no volumes at all", _only("QUAD4"), 1),
    Defect(FACES, "a slave face stands twice in the file", _more(17, 18, 21, 20), 0),
    Defect("groups", "the slave group holds a volume too", lambda mesh: setattr(mesh.cells[1], "group", "SLAVE"), 1),
    Defect("groups", "the slave group holds volumes only", _count(), 1, _cut("BODY")),
    Defect("groups", "the slave group is not there", _count(), 2, _cut("SLAVES")),
    Defect("groups", "the slave group is not there, and nothing is like it", _count(), 2, _cut("q")),
    Defect("counts", "fewer nodes are announced than there are", _count(nodes=5), ANNOUNCED),
    Defect("counts", "no nodes are announced", _count(nodes=0), ANNOUNCED),
    Defect("counts", "-1 nodes are announced", _count(nodes=-1), ANNOUNCED),
    Defect("counts", "10^12 nodes are announced", _count(nodes=10**12), ANNOUNCED),
    Defect("counts", "2^63 - 1 nodes are announced", _count(nodes=2**63 - 1), ANNOUNCED),
    Defect("counts", "-1 cells are announced", _count(cells=-1), ANNOUNCED),
    Defect("counts", "10^12 cells are announced", _count(cells=10**12), ANNOUNCED),
    Defect("counts", "fewer cells are announced than there are", _count(cells=1), ANNOUNCED),
    Defect("types", "a cell is of a type that nobody knows", _type(3, 199)),
    Defect("content", "there are nodes and no cells", _only(), 2),
    Defect("content", "there is nothing in it", _nothing, 2),
]  # fmt: skip


def cases():
    """Files, then every defect in every format that can have it."""
    yield from _files()
    for defect in DEFECTS:
        for name in WRITERS:
            status = defect.status_in(name)
            if status is not None:
                make, says = partial(spoilt, name, defect), defect.lines.get(name, "")
                yield Case(defect.kind, name, defect.what, make, status, defect.command, says)
    yield from _latin()


def spoilt(name, defect: Defect, _=None):
    """The content of a file with a defect."""
    mesh = two_hexahedra()
    defect.edit(mesh)
    return WRITERS[name](mesh)


def _latin():
    """A group's name that is not UTF-8 is taken for Latin-1."""
    for name in (n for n in WRITERS if n not in ("vtu", "xdmf")):
        mesh = two_hexahedra()
        for cell in mesh.cells:
            cell.group = "Körper" if cell.group == "SLAVE" else cell.group

        def then(folder):
            assert lacmesh.read(folder / "out.msh").zones == ("Körper",)

        yield Case("names", name, "a group's name is in Latin-1", WRITERS[name](mesh), 0, _cut("Körper"), then=then)
