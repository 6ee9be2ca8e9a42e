"""Errors in a mesh, in every format that can express them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from math import inf, nan
from pathlib import Path
from typing import NamedTuple

import lacmesh
from tests.bad_input import raw
from tests.bad_input.case import CUT, Case
from tests.bad_input.raw import Cell, Raw, two_hexahedra

WRITERS: dict[str, Callable[[Raw], bytes]] = {
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
MED = tuple(name for name in WRITERS if name.startswith("MED"))


class Defect(NamedTuple):
    """`edit` spoils the mesh; `says`: format, or its first word -> the pattern of the sentence, and the status."""

    kind: str
    what: str
    edit: Callable[[Raw], object]
    says: dict[str, tuple[int, str]]
    command: tuple[str, ...] = CUT


def _set(attribute: str, at: int, value: object) -> Callable[[Raw], None]:
    """Put a value in place of a node's number ("node_number"), of a coordinate ("points": y)."""

    def edit(mesh: Raw) -> None:
        if attribute == "points":
            mesh.points[at][1] = value
        else:
            mesh.node_number[at] = value

    return edit


def _number(at: int, number: int) -> Callable[[Raw], None]:
    return lambda mesh: setattr(mesh.cells[at], "number", number)


def _node(at: int, place: int, node: int | None = None) -> Callable[[Raw], None]:
    """Replace a node in a cell; None: by the previous node, which is then repeated."""

    def edit(mesh: Raw) -> None:
        nodes = mesh.cells[at].nodes
        nodes[place] = nodes[place - 1] if node is None else node

    return edit


def _count(**counts: int) -> Callable[[Raw], None]:
    return lambda mesh: mesh.count.update(counts)


def _more(*cells: Cell) -> Callable[[Raw], None]:
    return lambda mesh: mesh.cells.extend(cells)


def _both(*edits: Callable[[Raw], object]) -> Callable[[Raw], None]:
    def edit(mesh: Raw) -> None:
        for one in edits:
            one(mesh)

    return edit


def _all_points(mesh: Raw) -> None:
    mesh.points = [[0.5, 0.5, 0.5] for _ in mesh.points]


def _type(at: int, kind: object) -> Callable[[Raw], None]:
    return lambda mesh: setattr(mesh.cells[at], "type", kind)


NOT_FINITE = {
    "msh": (3, r"(line|byte) \d+: the coordinates of nodes 14 are not finite"),
    "MED": (3, r"NOE/COO: the coordinates of nodes 14 are not finite"),
    "mail": (3, "line 4: the coordinates of node N14 are not finite"),
    "inp": (3, "line 7: the coordinates of node 14 are not finite"),
    "vtu": (3, "<Points>: the coordinates of points 3 .from 0. are not finite"),
    "xdmf": (3, "<Geometry>: the coordinates of points 3 .from 0. are not finite"),
}
COLLAPSED = {"any": (1, r"slave faces 103 have no parent cell")}
COUNTED = {
    "vtu": (0, "counted from 1: .*_number is not positive"),
    "xdmf": (0, "counted from 1: .*_number is not positive"),
}
TWICE = {
    "msh": (3, "two nodes have the number 13"),
    "MED": (0, "nodes are numbered from 1, the file gives several the number 13"),
    "mail": (3, "two nodes have the name N13"),
    "inp": (3, "two nodes have the number 13"),
    **COUNTED,
}
LOST = {
    "msh": (3, r"(line|byte) \d+: the HEXA8 101 has node {}, which \$Nodes does not hold"),
    "MED": (3, r"MAI/HE8/NOD: the HEXA8 101 has node {}, and there are 12"),
    "mail": (3, "line 19: HEXA8 M101 has the node N{}, which is not among the nodes"),
    "inp": (
        3,
        "line 16: (element 101 has the node {}, which is not|numbers of elements and nodes run .* one here is {})",
    ),
    "vtu": (3, "<Cells>: cell 0 .from 0. has point {}, and there are 12"),
    "xdmf": (3, "<Topology Mixed>: cell 0 .from 0. has point {}, and there are 12"),
}


def _lost(node: int) -> dict[str, tuple[int, str]]:
    there = ("vtu", "xdmf") if node == 0 else ()  # they count from 0
    return {name: (status, says.format(node, node)) for name, (status, says) in LOST.items() if name not in there}


DEFECTS = [
    Defect("coordinates", "a coordinate is NaN", _set("points", 3, nan), NOT_FINITE),
    Defect("coordinates", "a coordinate is infinite", _set("points", 3, -inf), NOT_FINITE),
    Defect(
        "coordinates",
        "all nodes stand at one point",
        _all_points,
        {"any": (0, "cells behind the slave faces were inverted or degenerate")},
    ),
    Defect(
        "coordinates",
        "a coordinate is 1e308",
        _set("points", 3, 1e308),
        {"any": (0, "cells behind the slave faces were inverted or degenerate")},
    ),
    Defect("numbers", "two nodes have one number", _set("node_number", 3, 13), TWICE),
    Defect(
        "numbers",
        "a node has the number 0",
        _set("node_number", 0, 0),
        {
            "msh": (3, "a node has the number 0"),
            "MED": (0, "the numbers of nodes are not positive"),
            "inp": (3, "number should be an integer from 1 to 999999999, not 0"),
            **COUNTED,
        },
    ),
    Defect(
        "numbers",
        "a node has the number -1",
        _set("node_number", 0, -1),
        {
            "msh": (3, "a node has the number -1"),
            "MED": (1, "the numbers of nodes .* negative"),
            "inp": (3, "number should be an integer from 1 to 999999999, not -1"),
            **COUNTED,
        },
    ),
    Defect(
        "numbers",
        "two cells have one number",
        _number(3, 103),
        {
            "msh": (3, "two cells have the number 103"),
            "MED": (0, "cells are numbered from 1, the file gives several the number 103"),
            "mail": (3, "two cells have the name M103"),
            "inp": (3, "two elements have the number 103"),
            **COUNTED,
        },
    ),
    Defect(
        "numbers",
        "a cell has the number 0",
        _number(3, 0),
        {
            "msh": (3, "a cell has the number 0"),
            "MED": (0, "the numbers of cells are not positive"),
            "mail": (0, "the numbers of cells are not positive"),
            "inp": (3, "run from 1 to 999999999, and one here is 0"),
            **COUNTED,
        },
    ),
    Defect(
        "numbers",
        "a cell has the number -7",
        _number(3, -7),
        {
            "msh": (3, "a cell has the number -7"),
            "MED": (1, "the numbers of cells .* negative"),
            "mail": (0, "as M-7. are not distinct numbers"),
            "inp": (3, "run from 1 to 999999999, and one here is -7"),
            **COUNTED,
        },
    ),
    Defect("nodes of cells", "a cell has a node that is not there", _node(0, 2, 99), _lost(99)),
    Defect("nodes of cells", "a cell has node 0", _node(0, 2, 0), _lost(0)),
    Defect("nodes of cells", "a cell has node -1", _node(0, 2, -1), _lost(-1)),
    Defect("nodes of cells", "a cell has node 2147483647", _node(0, 2, 2**31 - 1), _lost(2**31 - 1)),
    Defect("nodes of cells", "a hexahedron has a corner of the slave face twice", _node(0, 5), COLLAPSED),
    Defect("nodes of cells", "a slave face has a node twice", _node(2, 1), COLLAPSED),
    Defect(
        "nodes of cells",
        "the hexahedron behind a slave face has a node twice, away from it",
        _node(0, 1),
        {"any": (0, "cells behind the slave faces were inverted or degenerate")},
    ),
    Defect(
        "nodes of cells",
        "a slave face and the hexahedron behind it have the same node twice",
        _both(_node(0, 5), _node(2, 1)),
        {"any": (0, "cells behind the slave faces were inverted or degenerate")},
    ),
    Defect(
        "slave faces",
        "a slave face is no facet of a cell",
        _more(Cell(107, "QUAD4", [11, 13, 21, 17], "SLAVE")),
        {"any": (1, "slave faces 107 have no parent cell; gmsh saves .*--skin-only")},
    ),
    Defect(
        "slave faces",
        "there are no volumes at all",
        lambda mesh: setattr(mesh, "cells", [c for c in mesh.cells if c.type == "QUAD4"]),
        {"any": (1, "has cells of dimension|no cell behind|skin")},
    ),
    Defect(
        "slave faces",
        "a slave face stands twice in the file",
        _more(Cell(107, "QUAD4", [17, 18, 21, 20], "SLAVE")),
        {"any": (0, r"stand twice in the slave groups \(cells 107 repeat others\)")},
    ),
    Defect(
        "groups",
        "the slave group holds a volume too",
        lambda mesh: setattr(mesh.cells[1], "group", "SLAVE"),
        {"any": (1, r"'SLAVE' holds cells of dimension 3 \(102\)")},
    ),
    Defect(
        "groups",
        "the slave group holds volumes only",
        lambda mesh: None,
        {"any": (1, r"'BODY' holds cells of dimension 3 \(101, 102\)")},
        ("cut", "{in}", "--slave", "BODY", "-o", "{out}", "--force"),
    ),
    Defect(
        "groups",
        "the slave group is not there",
        lambda mesh: None,
        {"any": (2, "no cell group named 'SLAVES'; did you mean SLAVE")},
        ("cut", "{in}", "--slave", "SLAVES", "-o", "{out}", "--force"),
    ),
    Defect(
        "groups",
        "the slave group is not there, and nothing is like it",
        lambda mesh: None,
        {"any": (2, "no cell group named 'q'; there are: BODY, MASTER, SLAVE")},
        ("cut", "{in}", "--slave", "q", "-o", "{out}", "--force"),
    ),
    Defect(
        "counts",
        "fewer nodes are announced than there are",
        _count(nodes=5),
        {
            "msh": (3, r"the section \$Nodes should end here"),
            "MED": (3, "COO: holds 36 values for 5 nodes"),
            "vtu": (3, "<Points>: .* 5 points"),
            "xdmf": (3, "<Geometry>: .* 5 3"),
        },
    ),
    Defect(
        "counts",
        "no nodes are announced",
        _count(nodes=0),
        {
            "msh": (3, r"the section \$Nodes should end here"),
            "MED": (3, "COO: holds 36 values for 0 nodes"),
            "vtu": (3, "<Points>: .* 0 points"),
            "xdmf": (3, "<Geometry>: .* 0 3"),
        },
    ),
    Defect(
        "counts",
        "-1 nodes are announced",
        _count(nodes=-1),
        {
            "msh": (3, "how much follows|a negative count"),
            "MED": (3, "COO: holds 36 values for -1 nodes"),
            "vtu": (3, "NumberOfPoints should be"),
            "xdmf": (3, "<Geometry>: .*-1 3"),
        },
    ),
    Defect(
        "counts",
        "10^12 nodes are announced",
        _count(nodes=10**12),
        {
            "msh": (3, r"\d000000000000 values should"),
            "MED": (3, "COO: holds 36 values for 1000000000000 nodes"),
            "vtu": (3, "<Points>: .* 1000000000000 points"),
            "xdmf": (3, "<Geometry>: .* 1000000000000 3"),
        },
    ),
    Defect(
        "counts",
        "2^63 - 1 nodes are announced",
        _count(nodes=2**63 - 1),
        {
            "msh": (3, "how much follows|an integer should|9223372036854775807 values"),
            "MED": (3, "COO: holds 36 values for 9223372036854775807 nodes"),
            "vtu": (3, "NumberOfPoints should be"),
            "xdmf": (3, "<Geometry>: .*9223372036854775807 3"),
        },
    ),
    Defect(
        "counts",
        "-1 cells are announced",
        _count(cells=-1),
        {
            "msh": (3, "how much follows|a negative count"),
            "MED": (3, "NOD: holds 16 values for -1 cells of 4 nodes"),
            "vtu": (3, "NumberOfCells should be"),
            "xdmf": (3, "holds 6 cells, and announces -1"),
        },
    ),
    Defect(
        "counts",
        "10^12 cells are announced",
        _count(cells=10**12),
        {
            "msh": (
                3,
                "too early: (999999999994 more|1000000000000 elements) were announced|9000000000000 values should",
            ),
            "MED": (3, "NOD: holds 16 values for 1000000000000 cells of 4 nodes"),
            "vtu": (3, "<Cells>: .*1000000000000 cells"),
            "xdmf": (3, "holds 6 cells, and announces 1000000000000"),
        },
    ),
    Defect(
        "counts",
        "fewer cells are announced than there are",
        _count(cells=1),
        {
            "msh": (
                3,
                r"section \$Elements should end|elements of type \d+|should (end|stand) here|there cannot be an entity",
            ),
            "MED": (3, "NOD: holds 16 values for 1 cells"),
            "vtu": (3, "<Cells>: .* 1 cells"),
            "xdmf": (3, "holds 6 cells, and announces 1$"),
        },
    ),
    Defect(
        "types",
        "a cell is of a type that nobody knows",
        _type(3, 199),
        {
            "msh": (3, "elements of type 199 of gmsh"),
            "MED": (3, "MAI/199: cells of type 199 are not read"),
            "mail": (3, "'199' is no keyword"),
            "inp": (3, "elements of type 199 are not known"),
            "vtu": (3, "VTK's type 199"),
            "xdmf": (3, "XDMF's type 199"),
        },
    ),
    Defect(
        "content",
        "there are nodes and no cells",
        lambda mesh: mesh.cells.clear(),
        {"any": (2, "no cell group named 'SLAVE'; there are none")},
    ),
    Defect(
        "content",
        "there is nothing in it",
        _both(lambda mesh: mesh.cells.clear(), lambda mesh: mesh.points.clear(), lambda mesh: mesh.node_number.clear()),
        {"any": (2, "no cell group named 'SLAVE'; there are none")},
    ),
]


def cases() -> Iterator[Case]:
    """Every defect in every format that can have it."""
    for defect in DEFECTS:
        for name, writer in WRITERS.items():
            expected = next((defect.says[key] for key in (name, name.split()[0], "any") if key in defect.says), None)
            if expected is None:
                continue
            make = partial(_spoilt, defect, writer)
            yield Case(defect.kind, name, defect.what, make, expected[1], expected[0], defect.command)
    yield from _latin()


def _spoilt(defect: Defect, writer: Callable[[Raw], bytes], _: Path) -> bytes:
    """The content of a file with a defect."""
    mesh = two_hexahedra()
    defect.edit(mesh)
    return writer(mesh)


def _latin() -> Iterator[Case]:
    """A group's name that is not UTF-8 is taken for Latin-1."""
    for name in (n for n in WRITERS if n not in ("vtu", "xdmf")):
        mesh = two_hexahedra()
        for cell in mesh.cells:
            cell.group = "Körper" if cell.group == "SLAVE" else cell.group
        command = ("cut", "{in}", "--slave", "Körper", "-o", "{out}", "--force")

        def then(folder: Path) -> None:
            assert lacmesh.read(folder / "out.msh").zones == ("Körper",)

        yield Case("names", name, "a group's name is in Latin-1", WRITERS[name](mesh), "", 0, command, then=then)
