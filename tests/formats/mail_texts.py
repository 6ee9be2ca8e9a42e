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

#: name: (text, line, words of the message); many more are in `tests/bad_input`
DAMAGED = {
    "cells lacmesh has not": (_NODES + "TR3QU4\nFINSF\nFIN\n", 7, "type TR3QU4 are not read"),
    "the last coordinate": ("COOR_3D\nN1 0. 0. 0.\nN2 1. 0.\nFINSF\nFIN\n", 4, "fewer than 3 coordinates"),
    "a node too few at the end": (_NODES + "TRIA3\nM1 N1 N2 N3\nM2 N1 N2\nFINSF\nFIN\n", 10, "fewer than 3 nodes"),
    "two cells on a line": (_NODES + "SEG2\nM1 N1 N2 M2 N2 N3\nFINSF\nFIN\n", 8, "should begin a line"),
    "a header of no length": (_NODES + "POI1 NBLIGE=many\nM1 N1\nFINSF\nFIN\n", 7, "NBLIGE"),
    "a header beyond all": (_NODES + "POI1 NBLIGE=999999\nM1 N1\nFINSF\nFIN\n", 7, "no FINSF"),
    "only separators": (_NODES + ", =\n", 8, "without FIN"),
}
