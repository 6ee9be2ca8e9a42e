"""Texts of .mail files: one that uses the grammar, and damaged ones with what should be said of them."""

from __future__ import annotations

WHOLE = """\
% made by hand
 TITRE
 a plate of two squares
 FINSF
%
COOR_2D   NOM=INDEFINI NBOBJ=7   % six of them matter
  N1\t0. 0.D+0
  N2  1.0D0, 0
  N3  .2E1
      0.
  N4  0. 1.d0   % a comment
  N5  1. 1
  N6  20.E-1 1.
  N77 3.5 -1.5
FINSF

QUAD4
M1 N1 N2
   N5 N4
M12 N2 N3 N6 N5
FINSF
SEG2  NBLIGE= 2 NBLIGT=1
  this line belongs to the header
M3 N1 N2
FINSF
QUAD4 % more of them
M4 N4 N5 N2 N1
FINSF
GROUP_MA NOM= BAS NBOBJ=1
M3
FINSF
GROUP_MA NOM=INDEFINI NBOBJ=4 NBLIGE=3
         AUTEUR=SOMEONE
%FORMAT=(1*NOM)
TOUT M1 M12
M4 M3
FINSF
GROUP_NO NOM=COIN
N77 N1
FINSF
GROUP_NO NOM=RIEN
FINSF
FIN
whatever follows FIN does not matter
"""

_NODES = "COOR_3D\nN1 0. 0. 0.\nN2 1. 0. 0.\nN3 0. 1. 0.\nN4 0. 0. 1.\nFINSF\n"

#: name: (text, line, words of the message)
DAMAGED = {
    "no FIN": (_NODES, 7, "without FIN"),
    "no FINSF": (_NODES + "TETRA4\nM1 N1 N2 N3 N4\n", 7, "TETRA4 has no FINSF"),
    "cut in a word": (_NODES + "TETRA4\nM1 N1 N2 N", 7, "no FINSF"),
    "unknown keyword": (_NODES + "TETRAH4\nFINSF\nFIN\n", 7, "no keyword of a .mail file; did you mean TETRA4"),
    "cells lacmesh has not": (_NODES + "TR3QU4\nFINSF\nFIN\n", 7, "type TR3QU4 are not read"),
    "no nodes": ("TITRE\nnothing\nFINSF\nFIN\n", 4, "no nodes"),
    "a coordinate too few": ("COOR_3D\nN1 0. 0. 0.\nN2 1. 0.\nN3 0. 1. 0.\nFINSF\nFIN\n", 3, "have 3 coordinates"),
    "the last coordinate": ("COOR_3D\nN1 0. 0. 0.\nN2 1. 0.\nFINSF\nFIN\n", 4, "fewer than 3 coordinates"),
    "a word for a number": ("COOR_2D\nN1 0. 0.\nN2 1. zero\nFINSF\nFIN\n", 3, "should be real numbers"),
    "not finite": ("COOR_2D\nN1 0. 0.\nN2 1. nan\nFINSF\nFIN\n", 1, "node N2 are not finite"),
    "two dimensions": (_NODES + "COOR_2D\nN7 1. 1.\nFINSF\nFIN\n", 7, "3 coordinates above, and 2 here"),
    "a node twice": ("COOR_2D\nN1 0. 0.\nN1 1. 1.\nFINSF\nFIN\n", 1, "two nodes have the name N1"),
    "a cell twice": (_NODES + "POI1\nM1 N1\nM1 N2\nFINSF\nFIN\n", 7, "two cells have the name M1"),
    "a node too few": (_NODES + "TRIA3\nM1 N1 N2 N3\nM2 N1 N2\nM3 N2 N3 N4\nFINSF\nFIN\n", 9, "have 3 nodes"),
    "a node too few at the end": (_NODES + "TRIA3\nM1 N1 N2 N3\nM2 N1 N2\nFINSF\nFIN\n", 10, "fewer than 3 nodes"),
    "two cells on a line": (_NODES + "SEG2\nM1 N1 N2 M2 N2 N3\nFINSF\nFIN\n", 8, "should begin a line"),
    "an unknown node": (_NODES + "SEG2\nM1 N1 N2\n\nM2 N9 N3\nFINSF\nFIN\n", 10, "SEG2 M2 has the node N9"),
    "a group of nobody": (_NODES + "GROUP_NO\nG N1 N7\nFINSF\nFIN\n", 7, "members that are not among the nodes: N7"),
    "a group twice": (_NODES + "GROUP_NO NOM=G\nN1\nFINSF\nGROUP_NO\nG N2\nFINSF\nFIN\n", 10, "two GROUP_NO named 'G'"),
    "a group without a name": (_NODES + "GROUP_NO\nFINSF\nFIN\n", 7, "neither a name nor members"),
    "a header of no length": (_NODES + "POI1 NBLIGE=many\nM1 N1\nFINSF\nFIN\n", 7, "NBLIGE"),
    "a header beyond all": (_NODES + "POI1 NBLIGE=999999\nM1 N1\nFINSF\nFIN\n", 7, "no FINSF"),
    "only separators": (_NODES + ", =\n", 8, "without FIN"),
    "nothing": ("", 1, "without FIN"),
    "not a mesh": ("\x00\x01\x02 bytes\n", 1, "no keyword"),
}
