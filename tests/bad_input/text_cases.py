"""Errors in msh, .mail, .inp, VTU and XDMF files as such: in their sections, counts and numbers."""

from __future__ import annotations

import json
import struct
from functools import partial

from tests.bad_input.case import CONVERT, INFO, Case
from tests.bad_input.mesh_cases import WRITERS
from tests.bad_input.raw import two_hexahedra

#: of msh 4.1 binary, the head of its nodes; of 2.2, that of a cell
BLOCK, HEADER = struct.pack("<3iq", 3, 1, 0, 12), struct.pack("<3i", 5, 1, 2)
MARKS = [
    ("no byte order mark", b"8\n\1\0\0\0", b"8\n\7\0\0\7"),
    ("the mark of the other byte order", b"8\n\1\0\0\0", b"8\n\0\0\0\1"),
    ("said to be ASCII and is not", " 1 8\n", " 0 8\n"),
]
_ENTITIES = '<?xml version="1.0"?>\n<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
INCLUDE = '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" xpointer="xpointer(/Xdmf/{})"/>'
SIX = '"6" NumberType="Int" Precision="8" Format="XML">\n'
#: format -> kind -> what is wrong, what is replaced, by what, and where the command says that it is, if by a line
EDITS = {
    "msh 4.1 ASCII": {
        "version": [
            ("version 4.0", "4.1 0 8", "4 0 8"),
            ("version 9", "4.1 0 8", "9.0 0 8"),
            ("version 1", "$MeshFormat", "$NOD"),
            ("numbers of 4 bytes", "4.1 0 8", "4.1 0 4"),
            ("said to be binary and is not", "4.1 0 8", "4.1 1 8"),
            ("no number where the version should be", "4.1 0 8", "new 0 8"),
        ],
        "counts": [
            ("more names are announced", "Names\n3", "Names\n30"),
            ("10^12 entities", "$Entities\n0 0 2 1", "$Entities\n0 0 2 1000000000000"),
            ("-1 entities", "$Entities\n0 0 2 1", "$Entities\n0 0 2 -1"),
            ("10^9 blocks of nodes", "$Nodes\n1 12", "$Nodes\n1000000000 12"),
            ("2^63 blocks of cells", "$Elements\n3 6", "$Elements\n9223372036854775808 6"),
            ("another total of nodes", "$Nodes\n1 12", "$Nodes\n1 13"),
            ("another total of cells", "$Elements\n3 6", "$Elements\n3 7"),
        ],
        "numbers": [
            ("letters where a coordinate should be", "2.0 1.0 1.0\n$End", "2.0 l.0 1.0\n$End"),
            ("a coordinate with a decimal comma", "2.0 1.0 1.0\n$End", "2,0 1,0 1,0\n$End"),
            ("a fraction where a number should be", "\n3 1 0 12\n", "\n3 1.5 0 12\n"),
            ("a coordinate too many", "2.0 1.0 1.0\n$End", "2.0 1.0 1.0 1.0\n$End"),
            ("a coordinate is missing", "2.0 1.0 1.0\n$End", "2.0 1.0\n$End"),
            ("1e400 for a coordinate", "2.0 1.0 1.0\n$End", "2.0 1e400 1.0\n$End"),
            ("a node number of 20 digits in a cell", "101 11 12", "101 11 99999999999999999999"),
        ],
        "types": [
            ("an entity of dimension 7", "\n3 1 0 12\n", "\n7 1 0 12\n"),
            ("a group's dimension is 4", '3 1 "BODY"', '4 1 "BODY"'),
        ],
        "names": [
            ("a group's name without quotes", '3 1 "BODY"', "3 1 BODY"),
        ],
    },
    "msh 2.2 ASCII": {
        "version": [
            ("version 2.5", "2.2 0 8", "2.5 0 8"),
        ],
        "counts": [
            ("more cells are announced", "$Elements\n6", "$Elements\n7"),
            ("10^12 tags of a cell", "101 5 2 ", "101 5 1000000000000 "),
            ("-1 tags of a cell", "101 5 2 ", "101 5 -1 "),
            ("a tag too many", "101 5 2 ", "101 5 3 "),
        ],
        "numbers": [
            ("a node is missing in a cell", "102 5 2 1 1 12", "102 5 2 1 1"),
            ("a node's number is 1.5", "\n11 0.0", "\n1.5 0.0"),
            ("letters among the cells", "101 5 2 ", "101 five 2 "),
            ("a tag of 10^12", "101 5 2 1 1", "101 5 2 1000000000000 1"),
        ],
        "content": [
            ("parametric nodes", "$Nodes", "$ParametricNodes"),
        ],
    },
    "mail": {
        "sections": [
            ("there is no FIN", "\nFIN\n", "\n"),
            ("a FINSF is missing", "FINSF\nQUAD4\n", "QUAD4\n", "line 2[0-9]: "),
            ("there are no nodes", "COOR_3D", "TITRE"),
            ("nodes of 2 dimensions after nodes of 3", "FINSF\nHEXA8", "FINSF\nCOOR_2D\nN9 1. 2.\nFINSF\nHEXA8"),
        ],
        "numbers": [
            ("letters where a coordinate should be", "N15 1.0 1.0 0.0", "N15 1.0 l.0 0.0", "line 9: "),
            ("a coordinate with a decimal comma", "N15 1.0 1.0 0.0", "N15 1,0 1,0 0,0", "line (8|9|10): "),
            ("a coordinate is missing", "N15 1.0 1.0 0.0", "N15 1.0 1.0", "line (8|9|10): "),
            ("a coordinate too many", "N15 1.0 1.0 0.0", "N15 1.0 1.0 0.0 7.0", "line (8|9|10): "),
            ("a node is missing in a cell", "M102 N12 N13", "M102 N12", "line (19|20|21): "),
            ("1e400 for a coordinate", "N15 1.0 1.0 0.0", "N15 1.0 1e400 0.0"),
        ],
        "types": [
            ("a keyword that nobody knows", "\nQUAD4\n", "\nQUAD5\n"),
            ("cells of a type that is not kept", "\nQUAD4\n", "\nTRIA9\n"),
        ],
        "groups": [
            ("a group without a name", "GROUP_MA NOM=SLAVE\nM103\nM104", "GROUP_MA"),
            ("two groups of one name", "NOM=MASTER", "NOM=SLAVE"),
            ("a member that is not there", "FINSF\nFIN\n", "M999\nFINSF\nFIN\n"),
        ],
    },
    "inp": {
        "sections": [
            ("there are no nodes", "*NODE", "*NOTE"),
            ("an element's type is missing", "TYPE=C3D8, ", "", "line 16: "),
            ("a file that is included is not there", "*NODE\n", "*INCLUDE, INPUT=more.inp\n*NODE\n"),
            ("it includes itself", "*NODE\n", "*INCLUDE, INPUT=bad.inp\n*NODE\n"),
            ("*INCLUDE without a name", "*NODE\n", "*INCLUDE\n*NODE\n"),
            ("nodes that CalculiX would make", "*ELEMENT", "*NGEN\n11, 14, 1\n*ELEMENT"),
        ],
        "numbers": [
            ("letters where a coordinate should be", "15, 1.0, 1.0", "15, 1.0, one"),
            ("a node's number is 1.5", "15, 1.0, 1.0", "1.5, 1.0, 1.0"),
            ("a node is missing in an element", "102, 12, 13", "102, 12", "line 1[78]: "),
            ("a node number of 20 digits", "102, 12, 13", "102, 12, 99999999999999999999", "line 1[78]: "),
        ],
        "types": [
            ("an element of a type that nobody knows", "TYPE=C3D8,", "TYPE=C3D88,"),
        ],
        "groups": [
            ("a set that contains itself", "*ELEMENT", "*ELSET, ELSET=A\nB\n*ELSET, ELSET=B\nA\n*ELEMENT"),
            ("a set of a set that is not there", "*HEADING", "*ELSET, ELSET=A\nSLAV\n*HEADING"),
            ("a set without a name", "*HEADING", "*ELSET\n1\n*HEADING"),
        ],
        "counts": [
            ("numbers to generate in steps of 0", "*HEADING", "*NSET, NSET=A, GENERATE\n1, 9, 0\n*HEADING"),
        ],
        "slave faces": [
            ("a surface names a face that is none", "*HEADING", "*SURFACE, NAME=S\n101, S9\n*HEADING"),
        ],
    },
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
}  # fmt: skip


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
    "of a newer lacmesh": {"version": 2},
}
#: Cards that contradict the mesh or each other.
DECKS = {
    "a section of no set": "*SOLID SECTION, ELSET=nothing\n",
    "a condition on no set": "*BOUNDARY\nnothing, 1, 3\n",
    "a condition on no node": "*BOUNDARY\n999, 1, 3\n",
    "a load on no element": "*DLOAD\n999, P1, 1.\n",
    "a load on no surface": "*DSLOAD\nnothing, P, 1.\n",
    "a contact pair without its interaction": "*CONTACT PAIR, INTERACTION=I\nSLAVE, SLAVE\n",
    "a contact pair without its surfaces": "*CONTACT PAIR, INTERACTION=I\nX, Y\n*SURFACE INTERACTION, NAME=I\n",
    "a section of no material": "*SOLID SECTION, ELSET=BODY, MATERIAL=M\n",
    "a load with no amplitude": "*CLOAD, AMPLITUDE=A\n1, 3, 1.\n",
    "a step inside a step": "*STEP\n*STEP\n*END STEP\n",
    "the end of no step": "*END STEP\n",
    "a step without its end": "*STEP\n*STATIC\n",
    "a parameter with two values": "*BOUNDARY, OP=NEW, OP=MOD\n",
}
_MORE = ("*NODE\n", "*INCLUDE, INPUT=more.inp\n*NODE\n")
_WARNED = {}, {"status": 0, "command": INFO}


def cases():
    """Edits of every format; then sections, fields and notes of msh; decks and files of several parts."""
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
    for what, cards in DECKS.items():
        yield Case("decks", "inp", what, inp + cards.encode(), 1, CONVERT, out="out.inp")
    text = inp + DECKS["a step without its end"].encode()
    yield Case("decks", "inp", "the same, with --lenient", text, 0, (*CONVERT, "--lenient"), out="out.inp")
    text = inp + b"*NSET, NSET=A, GENERATE\n1, 1000000000000, 1\n"
    yield Case("counts", "inp", "10^12 numbers to generate: those that are there", text, 0, INFO)
