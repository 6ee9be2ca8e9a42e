"""Commands that cannot be carried out: wrong names and wishes, unfit meshes and geometries, places, a full disk."""

from __future__ import annotations

import os
import tomllib
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tests.bad_input import raw
from tests.bad_input.case import CONVERT, CUT, PRECIOUS, Case
from tests.bad_input.mesh_cases import DEFECTS, WRITERS, png
from tests.bad_input.raw import Cell, two_hexahedra

GOOD = WRITERS["msh 4.1 binary"](two_hexahedra())
#: Suffix and options -> how the output is called.
OUTPUTS = {
    "msh 2.2 ASCII": (".msh", "--msh", "2.2", "--ascii"),
    "msh 2.2 binary": (".msh", "--msh", "2.2"),
    "msh 4.1 ASCII": (".msh", "--ascii"),
    "msh 4.1 binary": (".msh",),
    "MED 4.1": (".med",),
    "mail": (".mail",),
    "inp": (".inp", "--hexa", "hexa"),
    "vtu": (".vtu",),
    "xdmf": (".xdmf",),
}
CHECK = ("check", "{in}", "--slave")
QUALITY = ("quality", "{in}")
VIEW = ("view", "{in}", "-o")
ORIENT = ("orient", "{in}", "-o", "{out}", "--force", "--group")
SPLIT = ("split", "{in}", "-o", "{out}", "--force", "--faces")


def _without_parent(mesh):
    mesh.cells.append(Cell(107, "QUAD4", [11, 13, 21, 17], "SLAVE"))


def _inside_out(mesh):
    nodes = mesh.cells[0].nodes
    nodes[:] = nodes[4:] + nodes[:4]


def _edited(*edits):
    mesh = two_hexahedra()
    for edit in edits:
        edit(mesh)
    return raw.msh41(mesh)


def _lines(mesh):
    mesh.cells = [Cell(101, "SEG2", [11, 12], "SLAVE")]


#: the meshes of commands.toml, by which its rows name them
MESHES = {
    "good": GOOD,
    "lines": _edited(_lines),
    "without a parent": _edited(_without_parent),
    "inside out": _edited(_inside_out),
    "nothing": _edited(lambda mesh: mesh.cells.clear()),
}
COMMANDS = tomllib.loads((Path(__file__).parent / "commands.toml").read_text(encoding="utf-8"))
#: command, its other output
OTHERS = {
    "cut --report": ((*CUT, "--report", "r.html"), "r.html"),
    "cut --report (Markdown)": ((*CUT, "--report", "r.md"), "r.md"),
    "cut --report (JSON)": ((*CUT, "--report", "r.json"), "r.json"),
    "quality --plot": ((*QUALITY, "--plot", "q.png"), "q.png"),
    "view": ((*VIEW, "v.html"), "v.html"),
}


def _put(folder, **things):
    """Put the good mesh into a folder, and other things: files, or what makes a folder, a pipe or a link."""
    (folder / "bad.msh").write_bytes(GOOD)
    for name, thing in things.items():
        path = folder / name.replace("_", ".")
        path.write_bytes(thing) if isinstance(thing, bytes) else thing(path)


def _closed(folder):
    """A folder in which nobody may write; where we own it, `nobody` does not."""
    _put(folder, out_msh=PRECIOUS)
    folder.chmod(0o555)


def _replaced(folder):
    assert (folder / "out.msh").read_bytes() != PRECIOUS


PLACES = [
    ("no format has the suffix", GOOD, "out.xyz", 2),
    ("there is no suffix", GOOD, "out", 2),
    ("the suffix is nearly one", GOOD, "out.mssh", 2),
    ("the folder is not there", GOOD, "no/folder/out.msh", 3),
    ("the folder is a file", GOOD, "bad.msh/out.msh", 3),
    ("it is a folder", partial(_put, out_msh=Path.mkdir), "out.msh", 3),
    ("it is a pipe", partial(_put, out_msh=os.mkfifo), "out.msh", 3),
    (
        "it is a link to a pipe",
        partial(_put, device=os.mkfifo, out_msh=lambda path: path.symlink_to("device")),
        "out.msh",
        3,
    ),
    ("the system takes no file there", GOOD, "/proc/out.msh", 3),
    ("its name is too long", GOOD, "x" * 300 + ".msh", 3),
]


# ---- geometry

_SQUARE = b"""lc = 0.5;
Point(1) = {0, 0, 0, lc}; Point(2) = {1, 0, 0, lc}; Point(3) = {1, 1, 0, lc}; Point(4) = {0, 1, 0, lc};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
"""
BOX = b'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 1, 1, 1};\nPhysical Surface("top") = {6};\n'
_STEP = b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
_STEP += b"FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n"
_TRIANGLE = "facet normal 0 0 1\nouter loop\nvertex {0}\nvertex {1}\nvertex {2}\nendloop\nendfacet\n"


def _stl(*triangles):
    return ("solid a\n" + "".join(_TRIANGLE.format(*t) for t in triangles) + "endsolid a\n").encode()


MESH = ("mesh", "{in}", "-o", "{out}", "--force")
LIST = ("mesh", "{in}", "--list")
#: format, what is wrong, content, status, words of gmsh
FILES = [
    ("STEP", "missing", lambda folder: (folder / "good.step").touch(), 3, "No such file"),
    ("STEP", "empty", b"", 3, ""),
    ("STEP", "text", b"Dear all,\n", 3, ""),
    ("STEP", "a picture (PNG)", png(), 3, ""),
    ("STEP", "no shape in it", _STEP, 3, ""),
    ("STEP", "cut short", _STEP[:120], 3, ""),
    ("IGES", "text", b"Dear all,\n", 3, ""),
    ("BREP", "text", b"Dear all,\n", 3, ""),
    ("STL", "text", b"Dear all,\n", 3, ""),
    ("STL", "a coordinate is NaN", _stl(("0 0 0", "1 0 0", "nan 1 0"), ("0 0 0", "1 0 0", "0 0 1")), 3, "not finite"),
    ("geo", "empty", b"", 3, ""),
    ("geo", "a picture (PNG)", png(), 3, ""),
    ("geo", "an error of syntax", _SQUARE + b"Foo(3;\n", 3, "line 5"),
    ("geo", "it ends gmsh", b"Exit;\n", 3, ""),
    ("geo", "a file that it merges is not there", b'Merge "no.step";\n', 3, "no.step"),
    ("geo", "a curve that is not there", _SQUARE.replace(b"{1, 2, 3, 4}", b"{1, 2, 3, 9}"), 3, "9"),
    ("geo", "points and curves only", _SQUARE.split(b"Curve")[0], 1, ""),
    ("geo", "a surface of which a side is missing", _SQUARE.replace(b"{1, 2, 3, 4}", b"{1, 2, 3}"), 1, "closed loop"),
    ("geo", "a size of nothing", _SQUARE.replace(b"lc = 0.5", b"lc = 1/0"), 3, "Division by zero"),
]


def cases():
    """Groups, requests, verdicts, places, permissions, a full disk, geometries."""
    for kind in ("groups", "request", "verdicts"):
        for what, mesh, (first, *rest), status, *says in COMMANDS[kind]:
            command = (*(CUT if first == "CUT" else (first,)), *rest)
            yield Case(kind, "any", what, MESHES[mesh], status, command, *says)
    for what, make, out, status in PLACES:
        yield Case("output", "any", what, make, status, out=out)
    yield Case("permission", "any", "the folder of the output takes no files", _closed, nobody=True)
    there = "the folder and the older output are another's, but open"
    yield Case("permission", "any", there, GOOD, 0, then=_replaced, nobody=True)
    for name, (suffix, *options) in OUTPUTS.items():
        for size in (0, 700):
            what = f"no room at all for {name}" if not size else f"no room after {size} bytes of {name}"
            command, says = (*CUT, *options), "cannot be written"
            yield Case("full disk", "any", what, GOOD, 3, command, says, out="out" + suffix, file_size=size)
    yield from _other_outputs()
    yield from _geometry()


def _other_outputs():
    for what, (command, name) in OTHERS.items():
        force = () if "--force" in command else ("--force",)
        elsewhere = tuple(word.replace(name, f"no/{name}") for word in command)
        there, taken = (
            partial(_put, **{name.replace(".", "_"): PRECIOUS}),
            partial(_put, **{name.replace(".", "_"): Path.mkdir}),
        )
        yield Case("output", "any", f"{what}: the folder is not there", GOOD, 3, (*elsewhere, *force))
        yield Case("output", "any", f"{what}: it is a folder", taken, 3, (*command, *force))
        # where the mesh is written with the same --force: under a new name
        new = tuple("new.msh" if word == "{out}" else word for word in command if word != "--force")
        yield Case("output", "any", f"{what}: it exists", there, 2, command if force else new)
        yield Case("full disk", "any", f"no room for {what}", there, 3, (*command, *force), file_size=1000)


def _geometry():
    for name, what, content, status, says in FILES:
        yield Case("geometry", name, what, content, status, MESH, says, needs="gmsh")
    yield Case("geometry", "STEP", "no shape in it, listed", _STEP, 3, LIST, needs="gmsh")
    for what, options, *says in COMMANDS["wishes"]:
        yield Case("geometry", "geo", what, BOX, 2, (*MESH, *options), *says, needs="gmsh")
    yield Case("geometry", "any", "a mesh", b"$MeshFormat\n", 2, MESH)
    yield Case("geometry", "any", "no CAD file has the suffix", png(), 2, MESH, file="bad.png")
    for what, size in (("no room for temporary files", 0), ("no room for gmsh's mesh", 2000)):
        yield Case("full disk", "geo", what, BOX, 3, MESH, needs="gmsh", file_size=size)


#: Commands that are run on every mesh that is wrong and can be read.
EVERY = {
    "check": (*CHECK, "SLAVE", "--master", "MASTER", "--dirichlet", "MASTER", "--json"),
    "check, for people": (*CHECK, "SLAVE"),
    "quality": (*QUALITY, "--measures", "all", "--json"),
    "quality of a group": (*QUALITY, "--group", "SLAVE"),
    "orient": (*ORIENT, "SLAVE"),
    "split": (*SPLIT, "SLAVE"),
    "view": (*VIEW, "v.html", "--slave", "SLAVE", "--check", "--quality"),
    "convert": ("convert", "{in}", "new.vtu"),
    "convert --order": (*CONVERT, "--order", "2"),
    "info": ("info", "{in}"),
    "partition": ("partition", "{in}", "-n", "2"),
    "cut --report": (*CUT, "--report", "r.html"),
    "cut --master": (*CUT, "--master", "MASTER"),
    "cut --hexa hexa": (*CUT, "--hexa", "hexa", "--min-quality", "0.1"),
}


def readable():
    """Formats, and defects that are no error of the file in them."""
    names = ("msh 4.1 ASCII", "MED 4.1")
    return [(name, defect) for defect in DEFECTS for name in names if defect.status_in(name) not in (None, 3)]


# ---- a command that is stopped by SIGINT or SIGTERM, wherever it is; each in a process of its own

#: What is run instead of `lacmesh`; {} makes the command wait at its stage.
_RUN = """
import sys, time
sys.argv = ["lacmesh", *sys.argv[1:]]
def wait(seconds=120):
    print("now", flush=True)
    for _ in range(100 * seconds):  # in short steps: a signal that comes just before one is seen after it
        time.sleep(0.01)
{}
from lacmesh.__main__ import main
sys.exit(main())
"""
#: waits where a function is called
_CALL = """
import {module} as at
real = at.{name}
def slow(*given, **more):
    if {when}:
        {first}
        wait({lasts})
    return real(*given, **more)
at.{name} = slow"""


class Stage(NamedTuple):
    """Stage at which a command is stopped: `at` runs the code `first`, waits for `lasts` seconds, and goes on.

    A stage that lasts one second is not stopped in the middle. `written`: the output exists afterwards. `when`: a
    condition on the calls of `at`; the others do not wait.
    """

    what: str
    at: str
    command: tuple[str, ...]
    first: str = "pass"
    lasts: float = 120
    written: bool = False
    when: str = "True"

    def code(self):
        """Python code of the command, which waits at the stage."""
        module, _, name = self.at.rpartition(".")
        return _RUN.format(_CALL.format(module=module, name=name, **self._asdict()))


HALF = "given[0].write_bytes(b'half of it')"
_STOPPED = ("cut", "in.msh", "--slave", "SLAVE", "--force", "-o")
_MSH, _MED, _XDMF = ((*_STOPPED, f"out{suffix}") for suffix in (".msh", ".med", ".xdmf"))
_SKIN = ("orient", "in.msh", "--group", "SLAVE", "--force", "-o", "out.msh")
STAGES = (
    Stage("while the file is read", "lacmesh.formats.msh.read", _MSH),
    Stage("while the mesh is cut", "lacmesh.cutting.cut.cut_skin", _MSH),
    Stage("while a msh file is written", "lacmesh.formats.msh.write", _MSH, HALF),
    Stage("while HDF5 writes a MED file", "lacmesh.formats.med_fields.write", _MED),
    Stage("while the two files of XDMF are written", "lacmesh.formats.xdmf.write", _XDMF, HALF),
    Stage("before the new file takes its place", "lacmesh.formats.output.signals_wait", _MSH),
    Stage("when one of the two files of XDMF is in its place", "os.replace", _XDMF, "pass", 1, True,
          "str(given[1]).endswith('.xdmf')"),
    Stage("while a report is written", "lacmesh.report.report_bytes", (*_MSH, "--report", "r.html")),
    Stage("when the new file is there", "lacmesh.cli.cuts._print_summary", _MSH, written=True),
    Stage("while a mesh is checked", "lacmesh.checks.check", ("check", "in.msh", "--slave", "SLAVE")),
    Stage("while a plot is drawn", "lacmesh.report.plot_quality", ("quality", "in.msh", "--plot", "q.png", "--force")),
    Stage("while a picture is drawn", "lacmesh.view.picture", ("view", "in.msh", "--force", "-o", "out.png")),
    Stage("while a skin is turned", "lacmesh.topology.orientation.analyse_orientation", _SKIN),
)  # fmt: skip
