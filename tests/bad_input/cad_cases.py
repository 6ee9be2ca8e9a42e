"""Geometries that gmsh cannot read or mesh, and wishes that a geometry cannot fulfil."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from tests.bad_input.case import Case
from tests.bad_input.file_cases import png

_SQUARE = b"""lc = 0.5;
Point(1) = {0, 0, 0, lc}; Point(2) = {1, 0, 0, lc}; Point(3) = {1, 1, 0, lc}; Point(4) = {0, 1, 0, lc};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
"""
BOX = b'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 1, 1, 1};\nPhysical Surface("top") = {6};\n'
_STEP = b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
_STEP += b"FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n"
_TRIANGLE = "facet normal 0 0 1\nouter loop\nvertex {0}\nvertex {1}\nvertex {2}\nendloop\nendfacet\n"


def _stl(*triangles: tuple[str, str, str]) -> bytes:
    return ("solid a\n" + "".join(_TRIANGLE.format(*t) for t in triangles) + "endsolid a\n").encode()


MESH = ("mesh", "{in}", "-o", "{out}", "--force")
LIST = ("mesh", "{in}", "--list")
#: format, what is wrong, content, status, words
FILES: list[tuple[str, str, bytes, int, str]] = [
    ("STEP", "empty", b"", 3, "is empty"),
    ("STEP", "text", b"Dear all,\n", 3, "cannot read it as STEP"),
    ("STEP", "a picture (PNG)", png(), 3, "cannot read it as STEP"),
    ("STEP", "no shape in it", _STEP, 3, "STEP"),
    ("STEP", "cut short", _STEP[:120], 3, "STEP"),
    ("IGES", "text", b"Dear all,\n", 3, "there is no geometry in it; is it IGES"),
    ("BREP", "text", b"Dear all,\n", 3, "there is no geometry in it; is it BREP"),
    ("STL", "text", b"Dear all,\n", 3, "no geometry|no triangle"),
    ("STL", "a surface that is not closed", _stl(("0 0 0", "1 0 0", "0 1 0")), 1, "3 edges .*--dim 2"),
    (
        "STL",
        "a coordinate is NaN",
        _stl(("0 0 0", "1 0 0", "nan 1 0"), ("0 0 0", "1 0 0", "0 0 1")),
        1,
        "is not closed",
    ),
    ("geo", "empty", b"", 3, "is empty"),
    ("geo", "a picture (PNG)", png(), 3, "cannot read it as a gmsh script"),
    ("geo", "an error of syntax", _SQUARE + b"Foo(3;\n", 3, "line 5"),
    ("geo", "it ends gmsh", b"Exit;\n", 3, "gmsh died on it"),
    ("geo", "a file that it merges is not there", b'Merge "no.step";\n', 3, "no.step"),
    ("geo", "a curve that is not there", _SQUARE.replace(b"{1, 2, 3, 4}", b"{1, 2, 3, 9}"), 3, "9"),
    ("geo", "points and curves only", _SQUARE.split(b"Curve")[0], 1, "holds curves and no surface"),
    (
        "geo",
        "a surface of which a side is missing",
        _SQUARE.replace(b"{1, 2, 3, 4}", b"{1, 2, 3}"),
        1,
        "gmsh cannot mesh it .*closed loop",
    ),
    ("geo", "a size of nothing", _SQUARE.replace(b"lc = 0.5", b"lc = 1/0"), 3, "Division by zero"),
]
#: what is wrong, options, status, words
WISHES: list[tuple[str, tuple[str, ...], int, str]] = [
    ("a surface that is not there", ("--group", "x=99"), 2, "no surface 99"),
    ("a volume that is not there", ("--group", "x=3:99"), 2, "no volume 99; it has 1"),
    ("a box in which nothing lies", ("--group", "x=box:8,8,8,9,9,9"), 2, "no surface lies in that box"),
    ("a box with its corners exchanged", ("--group", "x=box:1,0,0,0,1,1"), 2, "says no group; write"),
    ("a group without a tag", ("--group", "x"), 2, "says no group; write"),
    ("a size without a slave", ("--slave-size", "1"), 2, "go together"),
    ("a slave that is not there", ("--slave", "tops", "--slave-size", "1"), 2, "did you mean top"),
    ("a size of -1", ("--size", "-1"), 2, "positive length, not -1"),
    ("a size that is NaN", ("--size", "nan"), 2, "positive length, not nan"),
    ("a size in letters", ("--size", "small"), 2, "--size: invalid float value: 'small'"),
    ("an order that gmsh has and we have not", ("--order", "3"), 2, "--order: invalid choice"),
    ("a list and a mesh", ("--list",), 2, "say --list to see what is in the file, or -o OUT"),
]


def cases() -> Iterator[Case]:
    """Files, then wishes."""
    for name, what, content, status, says in FILES:
        yield Case("geometry", name, what, content, says, status, MESH, needs="gmsh")
    yield Case("geometry", "STEP", "no shape in it, listed", _STEP, "STEP", 3, LIST, needs="gmsh")
    for what, options, status, says in WISHES:
        yield Case("geometry", "geo", what, BOX, says, status, (*MESH, *options), needs="gmsh")
    yield Case("geometry", "any", "a mesh", b"$MeshFormat\n", "is a mesh already", 2, MESH)
    yield Case("geometry", "any", "no CAD file has the suffix", png(), "suffix '.png'", 2, MESH, file="bad.png")
    no_room = Case("full disk", "geo", "no room for temporary files", BOX, "temporary files", 3, MESH, needs="gmsh")
    yield replace(no_room, file_size=0)
    yield replace(no_room, what="no room for gmsh's mesh", says="cannot be written .File too large", file_size=2000)
