"""Errors in msh, .mail, .inp, VTU and XDMF files as such: in their sections, counts and numbers."""

from __future__ import annotations

import json
import struct
import tomllib
from functools import partial
from pathlib import Path

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
