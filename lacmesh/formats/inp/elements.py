"""Elements of Abaqus and CalculiX: their cell types, the order of their nodes, the numbers of their faces.

The element that each program has for a cell, and that of a cell that takes the place of another element.

Names are a shape and letters for what is computed in it (R, H, T ...), so that they are described by patterns here.
Orders are those of the elements' pictures in Abaqus's Elements Guide and CalculiX's manual; the order of C3D15V's 18
nodes follows from its shape functions (Abaqus Theory Guide, 3.2.6).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from itertools import product
from typing import NamedTuple

from lacmesh.cells import CELLS
from lacmesh.deck import Deck

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

#: Pattern of the name, its cell, or cells by the number in it, what the element is, its space.
_PATTERNS: list[tuple[str, str | dict[int, str], int, int]] = [
    (r"C3D15VH?", "PENTA18", SOLID, 3),
    (r"(?:B2[13]|PIPE21|RAX2|[DM]?G?AX1|D?SAX1|SFMG?AX1)[HRT]*", "SEG2", LINE, 2),
    (r"(?:B22|PIPE22|MG?AX2|D?SAX2|SFMG?AX2)[HRT]*", "SEG3", LINE, 2),
    (r"(?:B3[13]|PIPE31|ELBOW31)[HRTBC]*(?:OSH?)?", "SEG2", LINE, 3),
    (r"(?:B32|PIPE32|ELBOW32)[HRT]*(?:OSH?)?", "SEG3", LINE, 3),
    (r"(?:SPRING2|SPRINGA|DASHPOT2|DASHPOTA|JOINTC|GAPUNIT?|GAPCYL|GAPSPHER)", "SEG2", LINE, 0),
    (r"(?:MASS|ROTARYI|HEATCAP|SPRING1|DASHPOT1)", "POI1", POINT, 0),
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
#: Elements that are no cells: networks, couplings, elements of the user.
NO_CELL = re.compile(r"D[A-Z]{0,7}|DCOUP[23]D|DASHPOTT?|DIST\w*|ESPRNG\w*|U\d+\w*|ISL\w*|IRS\w*|ITS\w*|ITT\w*|PSI\w*")


@cache
def element(name: str) -> DeckElement | None:
    """Look up an element by its name in capitals; None for an unknown name.

    >>> element("C3D20R").type, element("CPS4").space, element("C3D7")
    ('HEXA20', 2, None)
    """
    for pattern, cells, kind, space in _PATTERNS:
        if match := re.fullmatch(pattern, name):
            cell = cells if isinstance(cells, str) else cells[int(match[1] or 2)]
            return DeckElement(cell, kind, space, NODES.get(cell, tuple(range(CELLS[cell].n_nodes))))
    return None


#: family -> corners of the faces S1, S2 ... (edges in the plane), by place
_FACES = {
    "TETRA": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "HEXA": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
    "PENTA": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "PYRAM": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "TRIA": ((0, 1), (1, 2), (2, 0)),
    "QUAD": ((0, 1), (1, 2), (2, 3), (3, 0)),
}


#: family -> for faces S1, S2 ... the place of the facet in the cell's own list
FACETS = {
    cell.family: tuple([set(f.nodes) for f in cell.facets].index(set(face)) for face in _FACES[cell.family])
    for cell in CELLS.values()
    if cell.family in _FACES and cell.order == 1
}
#: Labels of a shell's own two sides.
SIDES = frozenset(["SPOS", "SNEG", "POS", "NEG", "P", "N", "S1", "S2", "S"])


# ---- elements that cells are written as

#: What an .inp file is written for, and how the elements of a plane mesh may be called.
TARGETS = ("calculix", "abaqus")
PLANES = ("CPS", "CPE", "CAX")
_NUMBER = {cell: n for table in (_VOLUMES, _SURFACES, _LINES) for n, cell in table.items() if n != 65}
#: Advice for cells that a program lacks, where it is not to lower their order.
_HEXA = "cut hexahedra with --hexa hexa, which makes no pyramids"
_HINTS = {
    "PYRAM5": f"write for Abaqus, which has C3D5, or {_HEXA}",
    **dict.fromkeys(("PYRAM13", "PYRAM14"), f"write PYRAM5 for Abaqus, which has C3D5, or {_HEXA}"),
    "PENTA18": "write for Abaqus, which has C3D15V, or make the cells PENTA15",
    "HEXA27": "write for Abaqus, which has C3D27, or make the cells HEXA20",
    "TRIA7": "make the cells TRIA6",
    "QUAD9": "make the cells QUAD8",
}


def element_name(cell_type: str, target: str, plane: str | None, skin: bool) -> str | None:
    """Element for a cell type; None if the target has none.

    `plane`: CPS, CPE or CAX for plane meshes, None in 3D; `skin`: the cell lies on a face of another cell. Skin as
    elements is without stiffness in Abaqus, membranes in CalculiX, the least that it has.

    >>> element_name("HEXA8", "calculix", None, False), element_name("QUAD4", "calculix", "CPE", False)
    ('C3D8', 'CPE4')
    """
    abaqus, n = target == "abaqus", _NUMBER.get(cell_type)
    if cell_type in ("POI1", "PENTA18"):
        return "MASS" if cell_type == "POI1" else "C3D15V" if abaqus else None
    if n is None or (not abaqus and cell_type in ("PYRAM5", "HEXA27", "QUAD9")):
        return None
    if cell_type in _VOLUMES.values():
        return f"C3D{n}"
    if cell_type in _LINES.values():
        return f"T2D{n}" if plane and abaqus else f"T3D{n}"
    if plane:
        return None if cell_type == "QUAD9" else f"{plane}{n}"
    if skin:
        return f"SFM3D{n}" if abaqus and cell_type != "QUAD9" else f"M3D{n}"
    return {"TRIA6": "STRI65", "QUAD8": "S8R", "QUAD9": "S9R5"}.get(cell_type, f"S{n}") if abaqus else f"S{n}"


def hint(cell_type: str, target: str) -> str:
    """Advice for a cell type that has no element in the target."""
    return _HEXA if target == "abaqus" and "PYRAM" in cell_type else _HINTS.get(cell_type, "lower their order")


# ---- elements whose letters say more than a shape


#: Letters of a formulation that only some shapes have; all others (H, T, E ...) are of every shape.
_SHAPES = {"R": "QUAD4 QUAD8 HEXA8 HEXA20", "I": "QUAD4 HEXA8", "M": "TRIA6 TETRA10", "S": "HEXA8 TETRA10"}
_NAME = re.compile(r"(.*?3D|.*?2D|[A-Z]+)(\d+)([A-Z]*)")


def type_of(options: Mapping[str, str]) -> str:
    """Type of the elements that an *ELEMENT card with these options makes."""
    return options.get("TYPE", "").strip('"').upper()


def plane_of(name: str) -> str:
    """CPS, CPE or CAX by an element's name, else empty: a heat element, say, is the same in plane stress and strain."""
    return "CAX" if "AX" in name else name[:3] if name.startswith(PLANES) else ""


def variant(name: str, cell_type: str, target: str, plane: str | None = None) -> str | None:
    """Element of a cell that takes the place of an element `name`; None if the target has none.

    `plane`: CPS, CPE or CAX, if plane elements are to be of that kind.

    >>> variant("C3D20R", "HEXA20", "calculix"), variant("C3D20R", "PENTA15", "calculix")
    ('C3D20R', 'C3D15')
    >>> variant("C3D8I", "TETRA4", "calculix"), variant("CPE4R", "TRIA3", "calculix", plane="CAX")
    ('C3D4', 'CAX3')
    """
    old = element(name)
    if old is None:
        return None
    if plane and old.kind == PLANE and name.startswith(PLANES):
        name = plane + name[3:]
    if old.type == cell_type:
        return name
    plain = element_name(cell_type, target, "CPS" if old.kind == PLANE else None, old.kind == SHELL and "M3D" in name)
    parts = _NAME.fullmatch(name)
    if plain is None or parts is None:
        return plain
    number = re.search(r"\d+(?=\D*$)", plain)
    letters = "".join(c for c in parts[3] if cell_type in _SHAPES.get(c, cell_type).split())
    new = f"{parts[1]}{number[0] if number else ''}{letters}"
    known = element(new)
    return new if known is not None and known.type == cell_type else plain


#: Cards that say where parts begin and end.
FRAMES = ("PART", "ENDPART", "ASSEMBLY", "ENDASSEMBLY", "INSTANCE", "ENDINSTANCE")
#: Cards whose content is the mesh's, or that only say where a part of the file begins or ends.
_OF_MESH = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "HEADING", *FRAMES)


def losses(deck: Deck, *, formulations: bool = True) -> str:
    """Clause that names what a mesh alone does not keep of its deck; empty if nothing is lost.

    That is its other cards and, with `formulations`, what elements have beside their shape.
    """
    parts = list(dict.fromkeys("*" + card.name for card in deck.cards if card.key not in _OF_MESH))
    makers = deck.named("ELEMENT") if formulations else ()
    names = (type_of(card.options) for card in makers if card.numbers is not None and len(card.numbers))
    known = {name: e for name in names if (e := element(name)) is not None}
    solid = any(e.kind == SOLID for e in known.values())
    skin = {name for name, e in known.items() if solid and e.kind == SHELL and name.startswith(("M3D", "SFM3D"))}
    shapes = []
    for name, e in known.items():  # of a plain element, the shape says all: a cell is written as it without a deck
        ways = product(TARGETS, (None, plane_of(name) or "CPS"), {False, name in skin})
        plain = {element_name(e.type, *way) for way in ways} - {"S8R"}  # Abaqus has no other; CalculiX has S8 as well
        if name not in plain:
            shapes.append(f"{name} (written as {e.type})")
    if shapes:
        parts.append(f"the formulation of the elements {', '.join(shapes)}")
    return f"left out of the deck {deck.path}: {', '.join(parts)}" if parts else ""
