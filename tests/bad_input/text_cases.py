"""Errors in .mail and .inp files as such."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

from tests.bad_input import raw
from tests.bad_input.case import INFO, Case
from tests.bad_input.raw import two_hexahedra

#: kind, what is wrong, what stands in the file, what is put there, the sentence
MAIL = [
    ("sections", "there is no FIN", "\nFIN\n", "\n", "ends without FIN"),
    ("sections", "a FINSF is missing", "FINSF\nQUAD4\n", "QUAD4\n", "line 2[0-9]: "),
    ("sections", "there are no nodes", "COOR_3D", "TITRE", "there are no nodes: no COOR_3D"),
    (
        "sections",
        "nodes of 2 dimensions after nodes of 3",
        "FINSF\nHEXA8",
        "FINSF\nCOOR_2D\nN9 1. 2.\nFINSF\nHEXA8",
        "3 coor",
    ),
    (
        "numbers",
        "letters where a coordinate should be",
        "N15 1.0 1.0 0.0",
        "N15 1.0 l.0 0.0",
        "line 9: coordinates should be",
    ),
    ("numbers", "a coordinate with a decimal comma", "N15 1.0 1.0 0.0", "N15 1,0 1,0 0,0", "line (8|9|10): "),
    ("numbers", "a coordinate is missing", "N15 1.0 1.0 0.0", "N15 1.0 1.0", "line (8|9|10): .* 3 coordinates"),
    ("numbers", "a coordinate too many", "N15 1.0 1.0 0.0", "N15 1.0 1.0 0.0 7.0", "line (8|9|10): .* 3 coordinates"),
    ("numbers", "a node is missing in a cell", "M102 N12 N13", "M102 N12", "line (19|20|21): .* 8 nodes"),
    ("numbers", "1e400 for a coordinate", "N15 1.0 1.0 0.0", "N15 1.0 1e400 0.0", "node N15 are not finite"),
    (
        "types",
        "a keyword that nobody knows",
        "\nQUAD4\n",
        "\nQUAD5\n",
        "'QUAD5' is no keyword of a .mail file; did you mean",
    ),
    ("types", "cells of a type that is not kept", "\nQUAD4\n", "\nTRIA9\n", "'TRIA9' is no keyword|are not read"),
    ("groups", "a group without a name", "GROUP_MA NOM=SLAVE\nM103\nM104", "GROUP_MA", "neither a name nor members"),
    ("groups", "two groups of one name", "NOM=MASTER", "NOM=SLAVE", "two GROUP_MA named 'SLAVE'"),
    ("groups", "a member that is not there", "FINSF\nFIN\n", "M999\nFINSF\nFIN\n", "M999"),
]
INP = [
    ("sections", "there are no nodes", "*NODE", "*NOTE", "has no nodes: there is no .NODE|neither"),
    ("sections", "an element's type is missing", "TYPE=C3D8, ", "", "line 16: .ELEMENT should say its TYPE"),
    (
        "sections",
        "a file that is included is not there",
        "*NODE\n",
        "*INCLUDE, INPUT=more.inp\n*NODE\n",
        "'more.inp', which is",
    ),
    (
        "sections",
        "it includes itself",
        "*NODE\n",
        "*INCLUDE, INPUT=bad.inp\n*NODE\n",
        "which is included here, |more than",
    ),
    ("sections", "*INCLUDE without a name", "*NODE\n", "*INCLUDE\n*NODE\n", "INCLUDE should name a file"),
    (
        "sections",
        "nodes that CalculiX would make",
        "*ELEMENT",
        "*NGEN\n11, 14, 1\n*ELEMENT",
        "NGEN makes nodes, which is not",
    ),
    (
        "numbers",
        "letters where a coordinate should be",
        "15, 1.0, 1.0",
        "15, 1.0, one",
        "should be a node's number and its",
    ),
    ("numbers", "a node's number is 1.5", "15, 1.0, 1.0", "1.5, 1.0, 1.0", "number"),
    ("numbers", "a node is missing in an element", "102, 12, 13", "102, 12", "line 1[78]: "),
    ("numbers", "a node number of 20 digits", "102, 12, 13", "102, 12, 99999999999999999999", "line 1[78]: "),
    ("types", "an element of a type that nobody knows", "TYPE=C3D8,", "TYPE=C3D88,", "type C3D88 are not known"),
    (
        "groups",
        "a set that contains itself",
        "*ELEMENT",
        "*ELSET, ELSET=A\nB\n*ELSET, ELSET=B\nA\n*ELEMENT",
        "contains itself",
    ),
    (
        "groups",
        "a set of a set that is not there",
        "*HEADING",
        "*ELSET, ELSET=A\nSLAV\n*HEADING",
        "no set of elements named 'SLAV'; did",
    ),
    ("groups", "a set without a name", "*HEADING", "*ELSET\n1\n*HEADING", "ELSET should say the set's name"),
    (
        "counts",
        "numbers to generate in steps of 0",
        "*HEADING",
        "*NSET, NSET=A, GENERATE\n1, 9, 0\n*HEADING",
        "step .* 1 or more",
    ),
    ("slave faces", "a surface names a face that is none", "*HEADING", "*SURFACE, NAME=S\n101, S9\n*HEADING", "."),
]
WRITERS = {"mail": (raw.mail, MAIL), "inp": (raw.inp, INP)}


def _with_more(content: bytes, more: bytes, folder: Path) -> None:
    (folder / "bad.inp").write_bytes(content)
    (folder / "more.inp").write_bytes(more)


#: Cards that contradict the mesh or each other, and what is said of them.
DECKS = {
    "a section of no set": ("*SOLID SECTION, ELSET=nothing\n", "no element set 'nothing'"),
    "a condition on no set": ("*BOUNDARY\nnothing, 1, 3\n", "no node set 'nothing'"),
    "a condition on no node": ("*BOUNDARY\n999, 1, 3\n", "there is no node 999"),
    "a load on no element": ("*DLOAD\n999, P1, 1.\n", "there is no element 999"),
    "a load on no surface": ("*DSLOAD\nnothing, P, 1.\n", "no surface 'nothing'"),
    "a contact pair without its interaction": ("*CONTACT PAIR, INTERACTION=I\nSLAVE, SLAVE\n", "no "),
    "a load with no amplitude": ("*CLOAD, AMPLITUDE=A\n1, 3, 1.\n", "no amplitude 'A'"),
    "a step inside a step": ("*STEP\n*STEP\n*END STEP\n", "has no .END STEP before it"),
    "the end of no step": ("*END STEP\n", "there is no .STEP above it"),
    "a step without its end": ("*STEP\n*STATIC\n", "has no .END STEP; end it"),
    "a parameter with two values": ("*BOUNDARY, OP=NEW, OP=MOD\n", "OP is both NEW and MOD"),
}
#: A deck is judged where it is written.
CONVERT = ("convert", "{in}", "{out}", "--force")


def _decks() -> Iterator[Case]:
    """Yield decks that contradict themselves, to be written as decks; and one that is written all the same."""
    content = raw.inp(two_hexahedra())
    for what, (cards, says) in DECKS.items():
        yield Case("decks", "inp", what, content + cards.encode(), says, 1, CONVERT, out="out.inp")
    cards, says = DECKS["a step without its end"]
    lenient = (*CONVERT, "--lenient")
    yield Case("decks", "inp", "the same, with --lenient", content + cards.encode(), says, 0, lenient, out="out.inp")


def cases() -> Iterator[Case]:
    """Both formats."""
    for name, (writer, changes) in WRITERS.items():
        content = writer(two_hexahedra())
        for kind, what, old, new, says in changes:
            assert old.encode() in content, (name, what)
            yield Case(kind, name, what, content.replace(old.encode(), new.encode(), 1), says)
    content = raw.inp(two_hexahedra()).replace(b"*NODE\n", b"*INCLUDE, INPUT=more.inp\n*NODE\n", 1)
    for what, more, says in (
        ("the file that is included has an error", b"*NODE\n31, a, b, c\n", "more.inp, line 2: "),
        ("two files include each other", b"*INCLUDE, INPUT=bad.inp\n", "more.inp|includes more than"),
    ):
        yield Case("sections", "inp", what, partial(_with_more, content, more), says)
    text = raw.inp(two_hexahedra()) + b"*MATERIAL, NAME=steel\n*STEP\n*STATIC\n*END STEP\n"
    yield Case("sections", "inp", "cards that are no mesh, to a format without a place for them", text, "left out", 0)
    yield from _decks()
    text = raw.inp(two_hexahedra()) + b"*NSET, NSET=A, GENERATE\n1, 1000000000000, 1\n"
    yield Case("counts", "inp", "10^12 numbers to generate: those that are there", text, "", 0, INFO)
