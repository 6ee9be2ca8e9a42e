"""Small .inp and .mail files with a little of all that people write into them."""

INP = """** a block with a skin
*HEADING
 two hexahedra, and more
*INCLUDE, INPUT=more.inp
*NODE, NSET=NEW
21, 0., 0., 2.
22, 1., 0., 2.
*NSET, NSET=LINE
11, 12
*ELEMENT, TYPE=C3D8R, ELSET=Body
1, 1, 2, 5, 4, 7, 8,
 11, 10
*ELEMENT, TYPE=C3D20, ELSET=Body
9, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 21, 22, 1, 2,
3, 4, 5, 6
*ELEMENT, TYPE=S4, ELSET=Shell
30, 7, 8, 11, 10
*ELEMENT, TYPE=MASS, ELSET=point
31, 3
*ELSET, ELSET=All, GENERATE
1, 9, 8
*ELSET, ELSET=Both
Body, Shell
*NSET, NSET=Fix, UNSORTED
1, 2, 3, 4
LINE
*NSET, NSET=Even, GENERATE
2, 12, 2
*SURFACE, NAME=Slave, TYPE=ELEMENT
Body, S2
1, S4
Shell, SPOS
*SURFACE, NAME=Nodes, TYPE=NODE
Fix, 1.
*MATERIAL, NAME=steel
*ELASTIC
210000., .3
*STEP
*STATIC
*BOUNDARY
Fix, 1, 3
*END STEP
"""

#: A deck with every card that is rewritten where elements are cut.
DECK = """** a deck
*INCLUDE, INPUT=more.inp
*NSET, NSET=Top, GENERATE
7, 12
*NSET, NSET=Fix
1, 2, 3
4, 5, 6
*ELEMENT, TYPE=C3D8, ELSET=Body
1, 1, 2, 5, 4, 7, 8, 11, 10
*ELEMENT, TYPE=B31, ELSET=Beam
41, 1, 4, 3
*SURFACE, NAME=slave
Body, S2
*SURFACE, NAME=master, TYPE=ELEMENT
Second, S1
2, S3
*SURFACE, NAME=Nodes, TYPE=NODE
Top
1
*MATERIAL, NAME=steel
*ELASTIC
210000., .3
*SOLID SECTION, ELSET=Body, MATERIAL=steel
*SOLID SECTION, ELSET=Second, MATERIAL=steel
*SURFACE INTERACTION, NAME=I
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD
*CONTACT PAIR, INTERACTION=I
slave, master
*EQUATION
2
Fix, 1, 1., 9, 1, -1.
*INITIAL CONDITIONS, TYPE=TEMPERATURE
Fix, 20.
7, 1.
8, 2.
10, 3.
11, 4.
*INITIAL CONDITIONS, TYPE=STRESS
2, 1, 1., 2., 3., 4., 5., 6.
*AMPLITUDE, NAME=A
0., 0., 1., 1.
*STEP, NLGEOM
*STATIC
*BOUNDARY, AMPLITUDE=A
Fix, 1, 3
7, 1, 2, .5
8, 1, 2, 1.
10, 1, 2
11, 1, 2, 1.d0
*CLOAD
Top, 3, -1.
*DLOAD
1, P2, 3.
Body, P3, 4.
Second, GRAV, 9.81, 0., 0., -1.
1, BX, 1.
*FILM
1, F6, 20., 1.
*MODEL CHANGE, TYPE=ELEMENT, REMOVE
1, Second
*TEMPERATURE
Top, 5.
*NODE PRINT, NSET=Top
U
*END STEP
"""

INCLUDED = """*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 2., 0., 0.
4, 0., 1., 0.
5, 1., 1., 0.
6, 2., 1., 0.
7, 0., 0., 1.
8, 1., 0., 1.
9, 2., 0., 1.
10, 0., 1., 1.
11, 1., 1., 1.
12, 2., 1., 1.
*ELEMENT, TYPE=C3D8, ELSET=Second
2, 2, 3, 6, 5, 8, 9, 12, 11
"""

MAIL = """TITRE
mesh with a bit of all  % a comment
FINSF
%
COOR_3D NOM=INDEFINI NBOBJ=12 NBLIGT=0
N1 0.D0 0.0 0.0
N2 1.0D+00 0.0 0.0
N3 2.0 0. 0.
N4 0. 1. 0.
N5 1. 1. 0.
N6 2. 1. 0.
N7 0. 0. 1.
N8 1. 0. 1.
N9 2. 0. 1.
N10 0. 1. 1.
N11 1. 1. 1.
N12 2. 1. 1.
FINSF
HEXA8 NOM=INDEFINI
M1 N1 N2 N5 N4 N7 N8 N11 N10
M2 N2 N3 N6 N5
N8 N9 N12 N11
FINSF
QUAD4
S1 N7 N8 N11 N10
S2 N8 N9 N12 N11
FINSF
SEG2
L1 N1 N2
FINSF
POI1
P1 N3
FINSF
GROUP_MA NOM=SLAVE
S1 S2
FINSF
GROUP_MA
BODY M1 M2
FINSF
GROUP_NO
c\xf4t\xe9 N1 N4
N7 N10
FINSF
FIN
what follows is not read
"""
