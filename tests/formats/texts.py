"""Small files as text: those in `files`, which use much of the grammar, decks in pieces, and files that are wrong."""

from __future__ import annotations

from pathlib import Path


def _file(name):
    return (Path(__file__).parent / "files" / name).read_text()


#: two cubes, one on the other, whose file includes "more.inp", `MORE`; two instances of a part
INP, MORE, PARTS = map(_file, ("cubes.inp", "cubes_more.inp", "parts.inp"))
#: a deck with every card that is rewritten where elements are cut; it includes "more.inp", `INCLUDED`
DECK, INCLUDED = map(_file, ("deck.inp", "deck_more.inp"))
MAIL, ASCII4, OLD = map(_file, ("plate.mail", "square.msh", "old.msh"))
#: A deck of a brick: its mesh, cards before the steps, and a step.
MESH, MODEL = map(_file, ("brick.inp", "brick_cards.inp"))

# ---- .inp


_FOUR = "*NODE\n1, 0., 0., 0.\n2, 1., 0., 0.\n3, 0., 1., 0.\n4, 0., 0., 1.\n"
_TETRA = _FOUR + "*ELEMENT, TYPE=C3D4\n5, 1, 2, 3, 4\n"

#: name: (text, line, words of the message); many more are in `tests/bad_input`
WRONG_INP = {
    "a node beyond all": ("*NODE\n1, 0., 0., 0.\n9999999999, 0., 0., 0.\n", 3, "from 1 to 999999999"),
    "an element of two types twice": (_TETRA + "*ELEMENT, TYPE=T3D2\n5, 1, 2\n", 8, "two elements have the number 5"),
    "a node too few at the end": (_TETRA + "6, 1, 2, 3\n", 8, "element 6 has 3 nodes, and should have 4"),
    "a word for a node": (_TETRA + "6, 1, 2, 3, four\n", 8, "'6, 1, 2, 3, four' should be an element's"),
    "nothing for a node": (_TETRA + "6, 1, , 2, 3, 4\n", 7, "without a number"),
    "a range of words": (_FOUR + "*NSET, NSET=A, GENERATE\n1, last\n", 7, "numbers to generate"),
    "a surface of nobody": (_TETRA + "*SURFACE, NAME=S\nB, S1\n", 8, "no set of elements named 'B'"),
    "a surface twice": (_TETRA + "*SURFACE, NAME=S\n5, S1\n*SURFACE, NAME=s\n5, S2\n", 10, "two surfaces"),
    "spherical": ("*NODE, SYSTEM=S\n1, 1., 0., 0.\n", 1, "spherical"),
    "a part of nobody": ("*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n", 1, "no part named 'P'"),
    "parts without an assembly": ("*PART, NAME=P\n*NODE\n1, 0.\n*END PART\n*PART, NAME=Q\n", 5, "several parts"),
    "an empty field of a beam": (_FOUR + "*ELEMENT, TYPE=B31\n1, 1, 2, , 3\n", 7, "without a number"),
    "an open instance": ("*PART, NAME=P\n*NODE\n1, 0.\n*END PART\n*INSTANCE, NAME=I, PART=P\n", 5, "no *END INSTANCE"),
    "an endless keyword": ("*NODE" + ", A" * 3000 + "\n1, 0.\n", 1, "more than 4096 characters"),
}

STEP = "*STEP\n*STATIC\n1., 1.\n{cards}*NODE PRINT, NSET=Nall\nU\n*END STEP\n"

# ---- .mail


_CORNERS = "COOR_3D\nN1 0. 0. 0.\nN2 1. 0. 0.\nN3 0. 1. 0.\nN4 0. 0. 1.\nFINSF\n"

#: name: (text, line, words of the message); many more are in `tests/bad_input`
WRONG_MAIL = {
    "cells lacmesh has not": (_CORNERS + "TR3QU4\nFINSF\nFIN\n", 7, "type TR3QU4 are not read"),
    "the last coordinate": ("COOR_3D\nN1 0. 0. 0.\nN2 1. 0.\nFINSF\nFIN\n", 4, "fewer than 3 coordinates"),
    "a node too few at the end": (_CORNERS + "TRIA3\nM1 N1 N2 N3\nM2 N1 N2\nFINSF\nFIN\n", 10, "fewer than 3 nodes"),
    "two cells on a line": (_CORNERS + "SEG2\nM1 N1 N2 M2 N2 N3\nFINSF\nFIN\n", 8, "should begin a line"),
    "a header of no length": (_CORNERS + "POI1 NBLIGE=many\nM1 N1\nFINSF\nFIN\n", 7, "NBLIGE"),
    "a header beyond all": (_CORNERS + "POI1 NBLIGE=999999\nM1 N1\nFINSF\nFIN\n", 7, "no FINSF"),
    "only separators": (_CORNERS + ", =\n", 8, "without FIN"),
}

# ---- msh


#: what stands in ASCII4, what is put there, and the error that this gives; many more are in `tests/bad_input`
WRONG_MSH = [
    ("4.1 0 8", "4.1 0", "$MeshFormat should hold a version, 0 or 1, and a size"),
    ("$EndMeshFormat\n", "", "line 3: the section $MeshFormat should end here"),
    ("$PhysicalNames\n1", "$PhysicalNames\n-1", "line 5: the section $PhysicalNames should say here how much"),
    ("1 5 0\n", "1000000000000 5 0\n", "line 10: 1000000000000 values should follow here"),
    ("2 1 3 4\n", "2 1 3\n", "8 values should follow here, and $Elements ends too early"),
    ("2 1 3 4\n", "2 1 3 4 5\n", "line 28: the section $Elements should end here"),
]

#: mark after which numbers follow -> their sizes in bytes
WORDS = {
    "4.1": {
        b"$MeshFormat\n4.1 1 8\n": "4",
        b"$Entities\n": "8888" + "4" + "8" * 6 + "84" + "8",
        b"$Nodes\n": "8888" + "4448" + "8" * 4 + "8" * 12,
        b"$Elements\n": "8888" + "4448" + "8" * 4,
        b"3\n0\n3\n4\n": "4888" * 4,
    },
    "2.2": {
        b"$MeshFormat\n2.2 1 8\n": "4",
        b"$Nodes\n4\n": "4888" * 4,
        b"$Elements\n1\n": "4" * 9,
        b"3\n0\n3\n4\n": "4888" * 4,
    },
}


def swapped(content, version):
    """A binary file of one triangle, four nodes, a group and a field of three components, in the other byte order."""
    for mark, sizes in WORDS[version].items():
        at = content.index(mark) + len(mark)
        for n in map(int, sizes):
            content = content[:at] + content[at : at + n][::-1] + content[at + n :]
            at += n
    return content
