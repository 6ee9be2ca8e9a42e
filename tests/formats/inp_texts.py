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

#: name: (text, line, words of the message); the line is None where the whole file is meant
DAMAGED = {
    "no keyword": ("1, 2, 3\n", None, "holds no keyword line"),
    "nothing": ("", None, "holds no keyword line"),
    "no nodes": ("*STEP\n*END STEP\n", None, "has no nodes"),
    "a word for a coordinate": (_NODES + "9, zero, 0., 0.\n", 6, "'9, zero, 0., 0.' should be a node's number"),
    "not finite": ("*NODE\n1, 0., 0., 0.\n2, inf, 0., 0.\n", 3, "coordinates of node 2 are not finite"),
    "a node's number": ("*NODE\n1, 0., 0., 0.\n1.5, 0., 0., 0.\n", 3, "should be an integer from 1"),
    "node 0": ("*NODE\n1, 0., 0., 0.\n0, 0., 0., 0.\n", 3, "not 0"),
    "a node beyond all": ("*NODE\n1, 0., 0., 0.\n9999999999, 0., 0., 0.\n", 3, "from 1 to 999999999"),
    "a node twice": (_NODES + "*NODE\n4, 2., 2., 2.\n", 6, "two nodes have the number 4"),
    "an element twice": (_TETRA + "5, 2, 3, 4, 1\n", 6, "two elements have the number 5"),
    "an element of two types twice": (_TETRA + "*ELEMENT, TYPE=T3D2\n5, 1, 2\n", 8, "two elements have the number 5"),
    "an unknown type": (_NODES + "*ELEMENT, TYPE=C3D7\n1, 1, 2, 3, 4\n", 6, "type C3D7 are not known"),
    "no type": (_NODES + "*ELEMENT\n1, 1, 2, 3, 4\n", 6, "should say its TYPE"),
    "an unknown node": (_TETRA + "6, 1, 2, 3, 9\n", 6, "element 6 has the node 9"),
    "a node too few": (_TETRA + "6, 1, 2, 3\n7, 2, 3, 4, 1\n8, 1\n", 8, "should have 4 nodes"),
    "a node too few at the end": (_TETRA + "6, 1, 2, 3\n", 8, "element 6 has 3 nodes, and should have 4"),
    "a word for a node": (_TETRA + "6, 1, 2, 3, four\n", 8, "'6, 1, 2, 3, four' should be an element's"),
    "nothing for a node": (_TETRA + "6, 1, , 2, 3, 4\n", 7, "without a number"),
    "a negative node": (_TETRA + "6, 1, 2, 3, -4\n", 6, "and one here is -4"),
    "an unknown set": (_NODES + "*NSET, NSET=A\nB\n", 6, "no set of nodes named 'B'; there are: A"),
    "a set in itself": (_NODES + "*NSET, NSET=A\nB\n*NSET, NSET=B\na\n", 8, "contains itself"),
    "a set without a name": (_NODES + "*NSET\n1\n", 6, "should say the set's name"),
    "a range": (_NODES + "*NSET, NSET=A, GENERATE\n1, 4, 0\n", 7, "step"),
    "a range of words": (_NODES + "*NSET, NSET=A, GENERATE\n1, last\n", 7, "numbers to generate"),
    "a face too many": (_TETRA + "*SURFACE, NAME=S\n5, S5\n", 8, "face S5 of a TETRA4"),
    "a surface of nobody": (_TETRA + "*SURFACE, NAME=S\nB, S1\n", 8, "no set of elements named 'B'"),
    "a surface twice": (_TETRA + "*SURFACE, NAME=S\n5, S1\n*SURFACE, NAME=s\n5, S2\n", 10, "two surfaces"),
    "a file that is not there": (
        _NODES + "*INCLUDE, INPUT=none.inp\n",
        6,
        "'none.inp', which is included here, is not",
    ),
    "a file that is not named": (_NODES + "*INCLUDE\n", 6, "should name a file"),
    "a file in itself": (_NODES + "*INCLUDE, INPUT=a.inp\n", 6, "includes itself"),
    "made nodes": (_NODES + "*NGEN\n1, 4\n", 6, "*NGEN makes nodes, which is not read"),
    "spherical": ("*NODE, SYSTEM=S\n1, 1., 0., 0.\n", 1, "spherical"),
    "a part of nobody": ("*INSTANCE, NAME=I, PART=P\n*END INSTANCE\n", 1, "no part named 'P'"),
    "parts without an assembly": ("*PART, NAME=P\n*NODE\n1, 0.\n*END PART\n*PART, NAME=Q\n", 5, "several parts"),
    "an empty field of a beam": (_NODES + "*ELEMENT, TYPE=B31\n1, 1, 2, , 3\n", 7, "without a number"),
    "an open instance": ("*PART, NAME=P\n*NODE\n1, 0.\n*END PART\n*INSTANCE, NAME=I, PART=P\n", 5, "no *END INSTANCE"),
    "an endless keyword": ("*NODE" + ", A" * 3000 + "\n1, 0.\n", 1, "more than 4096 characters"),
}
