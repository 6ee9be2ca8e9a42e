"""Elements of Abaqus and CalculiX: their cell types, the order of their nodes, the numbers of their faces.

Names are a shape and letters for what is computed in it (R, H, T ...), so that they are described by patterns here.
Orders are those of the elements' pictures in Abaqus's Elements Guide and CalculiX's manual; the order of C3D15V's 18
nodes follows from its shape functions (Abaqus Theory Guide, 3.2.6).
"""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from lacmesh.cells import CELLS

#: What an element is, which says what its faces mean.
SOLID, PLANE, SHELL, LINE, POINT = range(5)


class DeckElement(NamedTuple):
    """Cell type of an element, its kind (SOLID ...), its space of 2 or 3 dimensions (0: either), and its node order.

    `nodes[k]`: position in lacmesh's order of the node that is listed k-th.
    """

    type: str
    kind: int
    space: int
    nodes: tuple[int, ...]


_HEXA20 = (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)
_PENTA15 = (0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11)
#: Cells whose nodes Abaqus lists in an order of its own; the middle of a line stands between its ends.
NODES = {
    "SEG3": (0, 2, 1),
    "TETRA10": (0, 1, 2, 3, 4, 5, 6, 7, 9, 8),
    "HEXA20": _HEXA20,
    "HEXA27": (*_HEXA20, 26, 20, 25, 21, 23, 24, 22),
    "PENTA15": _PENTA15,
    "PENTA18": (*_PENTA15, 15, 17, 16),
}
_VOLUMES = {4: "TETRA4", 5: "PYRAM5", 6: "PENTA6", 8: "HEXA8", 10: "TETRA10", 15: "PENTA15", 20: "HEXA20", 27: "HEXA27"}
_SURFACES = {3: "TRIA3", 4: "QUAD4", 6: "TRIA6", 8: "QUAD8", 9: "QUAD9", 65: "TRIA6"}  # 65: STRI65, of 6 nodes
_LINES = {2: "SEG2", 3: "SEG3"}
_POINTS = {1: "POI1"}

#: Pattern of the name, cells by the number in it, what the element is, its space.
_PATTERNS = [
    (r"(?:[CFQ]|DC|DCC|AC|COH|GK|EC|PC|CIN)3D(4|5|6|8|10|15|20|27)[RHIMTPESL]*", _VOLUMES, SOLID, 3),
    (r"(?:SC|CSS)(6|8)[RT]*", _VOLUMES, SOLID, 3),
    (r"(?:CPS|CPEG?|CAX|CGAX|DCC?2D|DCC?AX|AC2D|ACAX|COH2D|COHAX|F2D)(3|4|6|8)[RHIMTPES]*", _SURFACES, PLANE, 2),
    (r"(?:S|DS|US|M3D|SFM3D|R3D)(3|4|6|8|9)[RSWT]*5?[T]?", _SURFACES, SHELL, 3),
    (r"STRI(3|65)", _SURFACES, SHELL, 3),
    (r"(?:T2D|DCC?1D|AC1D|R2D|RB2D)([23])[HETP]*", _LINES, LINE, 2),
    (r"(?:T3D|RB3D)([23])[HETP]*", _LINES, LINE, 3),
    (r"(?:CONN2D|JOINT2D|FRAME2D)(2?)", _LINES, LINE, 2),
    (r"(?:CONN3D|FRAME3D)(2?)", _LINES, LINE, 3),
]
#: Elements whose number of nodes is not what the name says: the pattern, the cell, what it is, its space.
_NAMED = [
    (r"C3D15VH?", "PENTA18", SOLID, 3),
    (r"(?:B2[13]|PIPE21|RAX2|[DM]?G?AX1|D?SAX1|SFMG?AX1)[HRT]*", "SEG2", LINE, 2),
    (r"(?:B22|PIPE22|MG?AX2|D?SAX2|SFMG?AX2)[HRT]*", "SEG3", LINE, 2),
    (r"(?:B3[13]|PIPE31|ELBOW31)[HRTBC]*(?:OSH?)?", "SEG2", LINE, 3),
    (r"(?:B32|PIPE32|ELBOW32)[HRT]*(?:OSH?)?", "SEG3", LINE, 3),
    (r"(?:SPRING2|SPRINGA|DASHPOT2|DASHPOTA|JOINTC|GAPUNIT?|GAPCYL|GAPSPHER)", "SEG2", LINE, 0),
    (r"(?:MASS|ROTARYI|HEATCAP|SPRING1|DASHPOT1)", "POI1", POINT, 0),
]
#: Elements that are no cells: networks, couplings, elements of the user.
NO_CELL = re.compile(r"D[A-Z]{0,7}|DCOUP[23]D|DASHPOTT?|DIST\w*|ESPRNG\w*|U\d+\w*|ISL\w*|IRS\w*|ITS\w*|ITT\w*|PSI\w*")


@cache
def element(name: str) -> DeckElement | None:
    """Look up an element by its name in capitals; None for an unknown name.

    >>> element("C3D20R").type, element("CPS4").space, element("C3D7")
    ('HEXA20', 2, None)
    """
    for pattern, cell, kind, space in _NAMED:
        if re.fullmatch(pattern, name):
            return _element(cell, kind, space)
    for pattern, cells, kind, space in _PATTERNS:
        match = re.fullmatch(pattern, name)
        if match:
            return _element(cells[int(match[1] or 2)], kind, space)
    return None


def _element(cell: str, kind: int, space: int) -> DeckElement:
    return DeckElement(cell, kind, space, NODES.get(cell, tuple(range(CELLS[cell].n_nodes))))


#: family -> corners of the faces S1, S2 ... (edges in the plane), by place
_FACES = {
    "TETRA": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "HEXA": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    "PENTA": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "PYRAM": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "TRIA": ((0, 1), (1, 2), (2, 0)),
    "QUAD": ((0, 1), (1, 2), (2, 3), (3, 0)),
}


def _facets(family: str) -> tuple[int, ...]:
    cell = next(c for c in CELLS.values() if c.family == family and c.order == 1)
    corners = [frozenset(f.nodes) for f in cell.facets]
    return tuple(corners.index(frozenset(face)) for face in _FACES[family])


#: family -> for faces S1, S2 ... the place of the facet in the cell's own list
FACETS = {family: _facets(family) for family in _FACES}
#: Labels of a shell's own two sides.
SIDES = frozenset(["SPOS", "SNEG", "POS", "NEG", "P", "N", "S1", "S2", "S"])
