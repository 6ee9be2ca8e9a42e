"""Texts of .inp files: one that uses much of the grammar, one with parts, and damaged ones with what to say of them."""

from __future__ import annotations

#: Two cubes, one on the other; the file "more.inp" is `MORE`.
WHOLE = """\
** made by hand
*Heading
two cubes
*NODE, NSET=Nall
1, 0., 0., 0.
2, 1.D0, 0., 0.
 3 , 1.e0, 1
** in between
4,, 1., 0.
*include, input=more.inp
11, 0., 0., 1.
*ELEMENT, TYPE=C3D8R, ELSET=Low
100, 1, 2, 3, 4, 5, 6,
7, 8
*ELEMENT,
 ELSET=High, TYPE = c3d8i
200, 5, 6, 7, 8, 9, 10, 21, 22
*element, type=s4, elset=Plate
7, 1, 4, 3, 2
*ELSET, ELSET=Both
Early, 100
*ELSET, ELSET=Early
HIGH
*NSET, NSET=Odd, GENERATE
1, 9, 2
20, 22
*NSET, NSET=Odd
2
*NSET, NSET=OfHigh, ELSET=High
*NSET, NSET="With Blank"
odd, 22
*SURFACE, NAME=Joint
Low, S2
High, S1
*SURFACE, NAME=Side, TYPE=ELEMENT
100, S3
200, S3
*SURFACE, NAME=Under
Low, S1
*SURFACE, NAME=Skin
Both,
*SURFACE, NAME=Points, TYPE=NODE
1
Odd
*MATERIAL, NAME=Steel
*ELASTIC
210000., 0.3
*STEP
*STATIC
*NODE PRINT, NSET=Nall
U
*END STEP
*Elastic
"""
MORE = """\
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
*NODE
9, 0, 0, 2
10, 1, 0, 2
21, 1, 1, 2
22, 0, 1, 2
"""

PARTS = """\
*Part, name=Brick
*Node
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
*Element, type=C3D8
1, 1, 2, 3, 4, 5, 6, 7, 8
*Elset, elset=Body
1
*Surface, type=ELEMENT, name=Top
Body, S2
*End Part
*Assembly, name=A
*Instance, name=Lower, part=Brick
*End Instance
*Instance, name=Upper, part=Brick
0., 0., 1.
0., 0., 0., 0., 0., 1., 90.
*End Instance
*Node
1, 5., 5., 5.
*Nset, nset=Ref
1
*Nset, nset=Feet, instance=Lower
1, 2
*Nset, nset=Mixed
Lower.3, Upper.3
*Elset, elset=All
Lower.Body, Upper.Body
*Surface, name=Lid
Upper.Body, S2
*End Assembly
"""

_NODES = "*NODE\n1, 0., 0., 0.\n2, 1., 0., 0.\n3, 0., 1., 0.\n4, 0., 0., 1.\n"
_TETRA = _NODES + "*ELEMENT, TYPE=C3D4\n5, 1, 2, 3, 4\n"

#: name: (text, line, words of the message); many more are in `tests/bad_input`
DAMAGED = {
    "a node beyond all": ("*NODE\n1, 0., 0., 0.\n9999999999, 0., 0., 0.\n", 3, "from 1 to 999999999"),
    "an element of two types twice": (_TETRA + "*ELEMENT, TYPE=T3D2\n5, 1, 2\n", 8, "two elements have the number 5"),
    "a node too few at the end": (_TETRA + "6, 1, 2, 3\n", 8, "element 6 has 3 nodes, and should have 4"),
    "a word for a node": (_TETRA + "6, 1, 2, 3, four\n", 8, "'6, 1, 2, 3, four' should be an element's"),
    "nothing for a node": (_TETRA + "6, 1, , 2, 3, 4\n", 7, "without a number"),
    "a range of words": (_NODES + "*NSET, NSET=A, GENERATE\n1, last\n", 7, "numbers to generate"),
    "a surface of nobody": (_TETRA + "*SURFACE, NAME=S\nB, S1\n", 8, "no set of elements named 'B'"),
    "a surface twice": (_TETRA + "*SURFACE, NAME=S\n5, S1\n*SURFACE, NAME=s\n5, S2\n", 10, "two surfaces"),
    "spherical": ("*NODE, SYSTEM=S\n1, 1., 0., 0.\n", 1, "spherical"),
    "a part of nobody": ("*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n", 1, "no part named 'P'"),
    "parts without an assembly": ("*PART, NAME=P\n*NODE\n1, 0.\n*END PART\n*PART, NAME=Q\n", 5, "several parts"),
    "an empty field of a beam": (_NODES + "*ELEMENT, TYPE=B31\n1, 1, 2, , 3\n", 7, "without a number"),
    "an open instance": ("*PART, NAME=P\n*NODE\n1, 0.\n*END PART\n*INSTANCE, NAME=I, PART=P\n", 5, "no *END INSTANCE"),
    "an endless keyword": ("*NODE" + ", A" * 3000 + "\n1, 0.\n", 1, "more than 4096 characters"),
}
