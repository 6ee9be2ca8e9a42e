"""Errors in a msh file as such: in its sections, their order, their numbers."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator

from tests.bad_input.case import INFO, Case
from tests.bad_input.mesh_cases import WRITERS
from tests.bad_input.raw import two_hexahedra


def _changed(name: str, old: bytes, new: bytes) -> bytes:
    content = WRITERS[name](two_hexahedra())
    assert old in content, (name, old)
    return content.replace(old, new, 1)


def _without(name: str, section: str) -> bytes:
    content = WRITERS[name](two_hexahedra())
    begin, end = content.index(b"$" + section.encode()), content.index(b"$End" + section.encode())
    return content[:begin] + content[end + 5 + len(section) :]


def _swapped(name: str) -> bytes:
    """$Elements before $Nodes."""
    content = WRITERS[name](two_hexahedra())
    nodes, elements = content.index(b"$Nodes"), content.index(b"$Elements")
    return content[:nodes] + content[elements:] + content[nodes:elements]


def _twice(name: str, section: str) -> bytes:
    content = WRITERS[name](two_hexahedra())
    begin, end = content.index(b"$" + section.encode()), content.index(b"$End" + section.encode())
    return content + content[begin : end + 5 + len(section)]


ASCII = {
    "4.1": [
        ("version", "version 4.0", b"4.1 0 8", b"4 0 8", "msh version 4 is not read"),
        ("version", "version 9", b"4.1 0 8", b"9.0 0 8", "msh version 9.0 is not read"),
        ("version", "version 1", b"$MeshFormat", b"$NOD", "this is msh version 1"),
        ("version", "numbers of 4 bytes", b"4.1 0 8", b"4.1 0 4", "numbers of 4 bytes are not read"),
        ("version", "said to be binary and is not", b"4.1 0 8", b"4.1 1 8", "its byte order mark is missing"),
        ("version", "no number where the version should be", b"4.1 0 8", b"new 0 8", "should hold a version"),
        ("counts", "more names are announced", b"Names\n3", b"Names\n30", "30 names should follow here"),
        ("counts", "10^12 entities", b"$Entities\n0 0 2 1", b"$Entities\n0 0 2 1000000000000", "ends too early"),
        ("counts", "-1 entities", b"$Entities\n0 0 2 1", b"$Entities\n0 0 2 -1", "a negative count"),
        ("counts", "10^9 blocks of nodes", b"$Nodes\n1 12", b"$Nodes\n1000000000 12", "too early"),
        ("counts", "2^63 blocks of cells", b"$Elements\n3 6", b"$Elements\n9223372036854775808 6", "too early"),
        ("counts", "another total of nodes", b"$Nodes\n1 12", b"$Nodes\n1 13", "announces 13 nodes and holds another"),
        ("counts", "another total of cells", b"$Elements\n3 6", b"$Elements\n3 7", "announces 7 elements and holds 6"),
        (
            "numbers",
            "letters where a coordinate should be",
            b"2.0 1.0 1.0\n$End",
            b"2.0 l.0 1.0\n$End",
            "should be numbers",
        ),
        (
            "numbers",
            "a coordinate with a decimal comma",
            b"2.0 1.0 1.0\n$End",
            b"2,0 1,0 1,0\n$End",
            "should be numbers",
        ),
        (
            "numbers",
            "a fraction where a number should be",
            b"\n3 1 0 12\n",
            b"\n3 1.5 0 12\n",
            "an integer should stand",
        ),
        ("numbers", "a coordinate too many", b"2.0 1.0 1.0\n$End", b"2.0 1.0 1.0 1.0\n$End", "should end here"),
        ("numbers", "a coordinate is missing", b"2.0 1.0 1.0\n$End", b"2.0 1.0\n$End", "too early"),
        ("numbers", "1e400 for a coordinate", b"2.0 1.0 1.0\n$End", b"2.0 1e400 1.0\n$End", "nodes 22 are not finite"),
        (
            "numbers",
            "a node number of 20 digits in a cell",
            b"101 11 12",
            b"101 11 99999999999999999999",
            "has node 92233",
        ),
        ("types", "an entity of dimension 7", b"\n3 1 0 12\n", b"\n7 1 0 12\n", "entity 1 of dimension 7"),
        ("types", "a group's dimension is 4", b'3 1 "BODY"', b'4 1 "BODY"', "should be a dimension, a tag and a name"),
        (
            "names",
            "a group's name without quotes",
            b'3 1 "BODY"',
            b"3 1 BODY",
            "should be a dimension, a tag and a name",
        ),
    ],
    "2.2": [
        ("version", "version 2.5", b"2.2 0 8", b"2.5 0 8", "msh version 2.5 is not read"),
        ("counts", "more cells are announced", b"$Elements\n6", b"$Elements\n7", "too early: 1 more"),
        ("counts", "10^12 tags of a cell", b"101 5 2 ", b"101 5 1000000000000 ", "no element has 1000000000000 tags"),
        ("counts", "-1 tags of a cell", b"101 5 2 ", b"101 5 -1 ", "no element has -1 tags"),
        ("counts", "a tag too many", b"101 5 2 ", b"101 5 3 ", "."),
        ("numbers", "a node is missing in a cell", b"102 5 2 1 1 12", b"102 5 2 1 1", "."),
        ("numbers", "a node's number is 1.5", b"\n11 0.0", b"\n1.5 0.0", "the number of a node should be an integer"),
        ("numbers", "letters among the cells", b"101 5 2 ", b"101 five 2 ", "should be numbers"),
        ("numbers", "a tag of 10^12", b"101 5 2 1 1", b"101 5 2 1000000000000 1", "a tag beyond all limits"),
        ("content", "parametric nodes", b"$Nodes", b"$ParametricNodes", "parametric coordinates in msh 2"),
    ],
}

_FIELD = '$NodeData\n1\n"T"\n1\n{time}\n{n}\n{step}\n{width}\n{rows}\n11 5.0\n$EndNodeData\n'
FIELDS = [
    ("no name", "$NodeData\n0\n0\n3\n0\n1\n0\n$EndNodeData\n", "needs a name"),
    ("10^12 rows", _FIELD.format(time="0.0", n=3, step=0, width=1, rows=10**12), "2000000000000 values"),
    ("10^12 components", _FIELD.format(time="0.0", n=3, step=0, width=10**12, rows=1), "components"),
    ("-1 components", _FIELD.format(time="0.0", n=3, step=0, width=-1, rows=1), "-1 components"),
    ("two integers", '$NodeData\n1\n"T"\n1\n0.0\n2\n0\n1\n11 5.0\n$EndNodeData\n', "needs a name and the integers"),
    ("its time is NaN", _FIELD.format(time="nan", n=3, step=0, width=1, rows=1), "'nan' should be a time"),
    ("letters", _FIELD.format(time="0.0", n=3, step=0, width=1, rows=1).replace("5.0", "hot"), "should be numbers"),
]


def cases() -> Iterator[Case]:
    """Both versions, ASCII and binary."""
    for version, changes in ASCII.items():
        name = f"msh {version} ASCII"
        for kind, what, old, new, says in changes:
            yield Case(kind, name, what, _changed(name, old, new), says)
    for what, text, says in FIELDS:
        content = WRITERS["msh 4.1 ASCII"](two_hexahedra()) + text.encode()
        yield Case("fields", "msh 4.1 ASCII", what, content, says)
    yield from _sections()
    yield from _binary()
    yield from _notes()


def _sections() -> Iterator[Case]:
    for name in (n for n in WRITERS if n.startswith("msh")):
        yield Case("sections", name, "$Nodes is missing", _without(name, "Nodes"), "stands before|has no section")
        yield Case(
            "sections", name, "$Elements is missing", _without(name, "Elements"), "no section .Elements", 0, INFO
        )
        yield Case("sections", name, "$Elements stands before $Nodes", _swapped(name), "stands before .Nodes")
        yield Case("sections", name, "two $Nodes", _twice(name, "Nodes"), "a second section .Nodes")
        yield Case("sections", name, "two $Elements", _twice(name, "Elements"), "a second section .Elements")
        content = _changed(name, b"$EndNodes", b"$EndNod")
        yield Case("sections", name, "$EndNodes is spoilt", content, r"section \$Nodes (has no|should end)")
        content = _changed(name, b"$EndElements\n", b"$EndElements\nrubbish\n")
        yield Case("sections", name, "rubbish after the last section", content, "a section .* should start here")
        content = WRITERS[name](two_hexahedra()) + b"$Strange\n1 2 3\n$EndStrange\n"
        yield Case("sections", name, "a section that nobody knows", content, "unknown sections: .Strange", 0, INFO)


def _binary() -> Iterator[Case]:
    mark = b"8\n\1\0\0\0"
    for name in ("msh 2.2 binary", "msh 4.1 binary"):
        yield Case("version", name, "no byte order mark", _changed(name, mark, b"8\n\7\0\0\7"), "order mark is missing")
        content = _changed(name, mark, b"8\n\0\0\0\1")
        yield Case("version", name, "the mark of the other byte order", content, ".")
        yield Case("version", name, "said to be ASCII and is not", _changed(name, b" 1 8\n", b" 0 8\n"), ".")
    name = "msh 4.1 binary"
    for kind, what, old, new, says in (
        ("counts", "-1 blocks of cells", struct.pack("<2q", 3, 6), struct.pack("<2q", -1, 6), "should end here"),
        ("counts", "2^62 blocks", struct.pack("<2q", 3, 6), struct.pack("<2q", 2**62, 6), "."),
        (
            "types",
            "an entity of dimension -1",
            struct.pack("<3iq", 3, 1, 0, 12),
            struct.pack("<3iq", -1, 1, 0, 12),
            "entity 1 of dimension -1",
        ),
        (
            "types",
            "the largest tag of an entity",
            struct.pack("<3iq", 3, 1, 0, 12),
            struct.pack("<3iq", 3, -(2**31), 0, 12),
            "entity -2147483648",
        ),
    ):
        yield Case(kind, name, what, _changed(name, old, new), says)
    name = "msh 2.2 binary"
    head = struct.pack("<3i", 5, 1, 2)
    for what, new, says in (
        ("0 cells follow a header", (5, 0, 2), "no element has 2 tags, or 0 of them"),
        ("2^31 - 1 cells follow a header", (5, 2**31 - 1, 2), "or 2147483647 of them do not follow"),
        ("-1 tags", (5, 1, -1), "no element has -1 tags"),
        ("type 0", (0, 1, 2), "elements of type 0 of gmsh"),
        ("type -5", (-5, 1, 2), "elements of type -5 of gmsh"),
    ):
        kind = "types" if what.startswith("type") else "counts"
        yield Case(kind, name, what, _changed(name, head, struct.pack("<3i", *new)), says)


def _notes() -> Iterator[Case]:
    """Our own section."""
    head = {"version": 1, "nodes": 12, "cells": 6}
    for what, said, says in (
        ("no JSON", "{", "LacMesh is damaged"),
        ("a list", "[1]", "it should be an object"),
        ("no version", json.dumps({"nodes": 1}), "'version' is missing"),
        ("a zone that is a number", json.dumps({**head, "zones": [7]}), "'7' should be text"),
        (
            "a field's shape of 10^12",
            json.dumps(
                {
                    **head,
                    "fields": [
                        {
                            "on": "node",
                            "field": "T",
                            "step": 0,
                            "key": "T",
                            "name": "T",
                            "number": 0,
                            "order": -1,
                            "shape": [10**12],
                            "integer": False,
                        }
                    ],
                }
            ),
            None,
        ),
        ("nested 100000 deep", "[" * 100_000, "LacMesh is damaged"),
    ):
        text = "" if says else _FIELD.format(time="0.0", n=3, step=0, width=1, rows=1)
        content = WRITERS["msh 4.1 ASCII"](two_hexahedra()) + f"{text}$LacMesh\n{said}\n$EndLacMesh\n".encode()
        yield Case("our notes", "msh 4.1 ASCII", what, content, says or "1 components, and our notes say")
    for what, said, says in (
        (
            "for another number of nodes",
            {"version": 1, "nodes": 5, "cells": 6, "node_groups": [{"name": "g", "nodes": [11]}]},
            "was written for 5 nodes",
        ),
        (
            "members that are not there",
            {**head, "node_groups": [{"name": "g", "nodes": [999]}]},
            "1 values or members belong to nodes or cells that the file does not hold",
        ),
        ("of a newer lacmesh", {"version": 2}, "LacMesh of a newer lacmesh"),
    ):
        content = WRITERS["msh 4.1 ASCII"](two_hexahedra()) + f"$LacMesh\n{json.dumps(said)}\n$EndLacMesh\n".encode()
        yield Case("our notes", "msh 4.1 ASCII", what, content, says, 0, INFO)
