"""Errors after reading: unsuitable meshes, and measures, plots, pages and reports that cannot be made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tests.bad_input import raw
from tests.bad_input.case import CUT, PRECIOUS, Case
from tests.bad_input.command_cases import GOOD
from tests.bad_input.mesh_cases import DEFECTS, WRITERS, Defect
from tests.bad_input.raw import Cell, Raw, two_hexahedra

CHECK = ("check", "{in}", "--slave")
QUALITY = ("quality", "{in}")
VIEW = ("view", "{in}", "-o")
ORIENT = ("orient", "{in}", "-o", "{out}", "--force", "--group")
SPLIT = ("split", "{in}", "-o", "{out}", "--force", "--faces")
CONVERT = ("convert", "{in}", "{out}", "--force")


def _without_parent(mesh: Raw) -> None:
    mesh.cells.append(Cell(107, "QUAD4", [11, 13, 21, 17], "SLAVE"))


def _inside_out(mesh: Raw) -> None:
    nodes = mesh.cells[0].nodes
    nodes[:] = nodes[4:] + nodes[:4]


def _edited(*edits: Callable[[Raw], object]) -> bytes:
    mesh = two_hexahedra()
    for edit in edits:
        edit(mesh)
    return raw.msh41(mesh)


def _lines(mesh: Raw) -> None:
    mesh.cells = [Cell(101, "SEG2", [11, 12], "SLAVE")]


#: what is wrong, content, command, words: `lacmesh check` and the limits of `lacmesh cut` say no
VERDICTS: list[tuple[str, bytes, tuple[str, ...], str]] = [
    ("check: a slave face is no facet of a cell", _edited(_without_parent), (*CHECK, "SLAVE"), "no-parent"),
    ("check: a slave group of volumes", GOOD, (*CHECK, "BODY"), "wrong-dimension"),
    ("check: a cell is inverted", _edited(_inside_out), (*CHECK, "SLAVE"), "inverted-cell"),
    ("check: slave and master are one", GOOD, (*CHECK, "SLAVE", "--master", "SLAVE"), "shared-nodes"),
    ("check: a mesh of lines only", _edited(_lines), (*CHECK, "SLAVE"), "no-cells"),
    ("cut: cells would be worse than --min-quality", GOOD, (*CUT, "--min-quality", "2"), "below 2"),
    ("cut: a cell is inverted, and --min-quality", _edited(_inside_out), (*CUT, "--min-quality", "0"), "below 0"),
    (
        "cut: the check against the master finds an error",
        GOOD,
        (*CUT, "--master", "SLAVE"),
        "the cut is not usable for LAC: ",
    ),
    ("cut: CalculiX has no pyramids", GOOD, (*CUT, "--for", "calculix"), "--hexa hexa"),
    ("orient: a group of volumes", GOOD, (*ORIENT, "BODY"), "BODY"),
    ("split: a group of volumes", GOOD, (*SPLIT, "BODY"), "BODY"),
    ("split: faces on the surface", GOOD, (*SPLIT, "SLAVE"), "lie on the surface already"),
    ("split: a face of no cell", _edited(_without_parent), (*SPLIT, "SLAVE"), "are no facets of cells"),
]
REQUESTS: list[tuple[str, bytes, tuple[str, ...], str]] = [
    ("check: no slave group", GOOD, ("check", "{in}"), "give --slave GROUP, or --pair"),
    (
        "check: several slaves with several masters",
        GOOD,
        (*CHECK, "SLAVE", "--slave", "BODY", "--master", "MASTER", "--master", "x"),
        "--pair SLAVE:MASTER --pair BODY:x",
    ),
    ("check: a pair with a master that is not there", GOOD, ("check", "{in}", "--pair", "SLAVE:x"), "named 'x'"),
    ("check: a slave that is not there", GOOD, (*CHECK, "SLVE"), "no cell group named 'SLVE'; did you mean SLAVE"),
    ("check: a master that is not there", GOOD, (*CHECK, "SLAVE", "--master", "x"), "named 'x'; there are: BODY"),
    ("check: held nodes that are not there", GOOD, (*CHECK, "SLAVE", "--dirichlet", "MASTR"), "did you mean MASTER"),
    (
        "check: axisymmetric, and in space",
        GOOD,
        (*CHECK, "SLAVE", "--master", "MASTER", "--axisymmetric"),
        "axisymmetric",
    ),
    ("quality: a group that is not there", GOOD, (*QUALITY, "--group", "BODI"), "did you mean BODY"),
    ("quality: a measure that nobody knows", GOOD, (*QUALITY, "--measures", "beauty"), "'beauty'"),
    ("quality: a plot that is no picture", GOOD, (*QUALITY, "--plot", "q.txt"), "a plot is written as .png"),
    ("quality: nothing to plot", _edited(_lines), (*QUALITY, "--plot", "q.png"), "no surface or solid cell"),
    ("orient: no group", GOOD, ("orient", "{in}", "-o", "{out}"), "required: --group"),
    ("orient: a group that is not there", GOOD, (*ORIENT, "SLAV"), "did you mean SLAVE"),
    ("split: no group", GOOD, ("split", "{in}", "-o", "{out}"), "required: --faces"),
    ("split: a group that is not there", GOOD, (*SPLIT, "SLAV"), "did you mean SLAVE"),
    ("view: neither a picture nor a page", GOOD, (*VIEW, "v.jpg"), "nothing is drawn as '.jpg'"),
    ("view: a slave that is not there", GOOD, (*VIEW, "v.html", "--slave", "SLAV"), "did you mean SLAVE"),
    ("view: a direction of no length", GOOD, (*VIEW, "v.png", "--camera", "0", "0", "0"), "0 0 0 is no direction"),
    ("view: a size that is none", GOOD, (*VIEW, "v.png", "--size", "big"), "'big' is no size; write it as"),
    ("view: a size of 10^6", GOOD, (*VIEW, "v.png", "--size", "1000000x9"), "each side is 1 to"),
    ("view: a measure that nobody knows", GOOD, (*VIEW, "v.html", "--quality", "beauty"), "'beauty'"),
    ("view: a mesh of nothing", _edited(lambda m: m.cells.clear()), (*VIEW, "v.html"), "there is nothing to draw"),
    ("cut: --min-quality is NaN", GOOD, (*CUT, "--min-quality", "nan"), "NaN is no quality"),
    ("cut: --min-quality in letters", GOOD, (*CUT, "--min-quality", "high"), "--min-quality: 'high' is no number"),
    ("cut: a program that nobody knows", GOOD, (*CUT, "--for", "ansys"), "--for: invalid choice: 'ansys'"),
    ("cut: a report that is none", GOOD, (*CUT, "--report", "r.pdf"), "no report is written as '.pdf'"),
    ("cut: the report is the mesh", GOOD, (*CUT, "--report", "{out}"), "both the mesh and the report|no report"),
    ("cut: the master is not there", GOOD, (*CUT, "--master", "MASTR"), "did you mean MASTER"),
]
#: command, its other output
OTHERS: dict[str, tuple[tuple[str, ...], str]] = {
    "cut --report": ((*CUT, "--report", "r.html"), "r.html"),
    "cut --report (Markdown)": ((*CUT, "--report", "r.md"), "r.md"),
    "cut --report (JSON)": ((*CUT, "--report", "r.json"), "r.json"),
    "quality --plot": ((*QUALITY, "--plot", "q.png"), "q.png"),
    "view": ((*VIEW, "v.html"), "v.html"),
}


def _with_file(name: str, folder: Path) -> None:
    (folder / "bad.msh").write_bytes(GOOD)
    (folder / name).write_bytes(PRECIOUS)


def _with_folder(name: str, folder: Path) -> None:
    (folder / "bad.msh").write_bytes(GOOD)
    (folder / name).mkdir()


def cases() -> Iterator[Case]:
    """Verdicts, requests, places, a full disk."""
    for what, content, command, says in VERDICTS:
        yield Case("verdicts", "any", what, content, says, 1, command)
    for what, content, command, says in REQUESTS:
        yield Case("request", "any", what, content, says, 2, command)
    for what, (command, name) in OTHERS.items():
        force = () if "--force" in command else ("--force",)
        elsewhere = tuple(word.replace(name, f"no/{name}") for word in command)
        there = f"{what}: the folder is not there"
        yield Case("output", "any", there, GOOD, f"no/{name}: the folder no does not exist", 3, (*elsewhere, *force))
        there = f"{what}: it is a folder"
        yield Case("output", "any", there, partial(_with_folder, name), f"{name}: is no file", 3, (*command, *force))
        if not force:  # the same --force is for the mesh: another name for that
            command = tuple("new.msh" if word == "{out}" else word for word in command if word != "--force")
        there = f"{what}: it exists"
        yield Case("output", "any", there, partial(_with_file, name), f"{name} exists already; --force", 2, command)
        command, name = OTHERS[what]
        there = f"no room for {what}"
        keep = partial(_with_file, name)
        yield Case("full disk", "any", there, keep, f"{name}: cannot be written", 3, (*command, *force), file_size=1000)


#: Commands that are run on every mesh that is wrong and can be read.
EVERY: dict[str, tuple[str, ...]] = {
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


def readable() -> list[tuple[str, Defect]]:
    """Formats, and defects that are no error of the file in them."""
    return [
        (name, defect)
        for defect in DEFECTS
        for name in ("msh 4.1 ASCII", "MED 4.1")
        for says in [next((defect.says[key] for key in (name, name.split()[0], "any") if key in defect.says), (3, ""))]
        if says[0] != 3
    ]


def spoilt(name: str, defect: Defect) -> bytes:
    """The file of a defect."""
    mesh = two_hexahedra()
    defect.edit(mesh)
    return WRITERS[name](mesh)
