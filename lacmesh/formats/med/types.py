"""MED's cells: the table of names, numbers and node orders, in libmed's order of types (MEDiterators.c).

That order numbers the cells of a file without numbers, and gives each type its bit in a field's masks.
"""

from __future__ import annotations

from typing import NamedTuple


class MedType(NamedTuple):
    """MED's `name` of our `type`, its number `geo`, its `bit`; `nodes[k]` is our place of the node MED lists k-th."""

    name: str
    type: str
    geo: int
    bit: int
    nodes: tuple[int, ...]


_HEXA8 = (0, 3, 2, 1, 4, 7, 6, 5)
_HEXA20 = (*_HEXA8, 9, 13, 11, 8, 17, 19, 18, 16, 10, 15, 14, 12)
_PENTA6 = (0, 2, 1, 3, 5, 4)
_PENTA15 = (*_PENTA6, 7, 9, 6, 13, 14, 12, 8, 11, 10)
_PYRAM5 = (0, 3, 2, 1, 4)

MED_TYPES = (
    MedType("PO1", "POI1", 1, 0, (0,)),
    MedType("SE2", "SEG2", 102, 1, (0, 1)),
    MedType("SE3", "SEG3", 103, 2, (0, 1, 2)),
    MedType("SE4", "SEG4", 104, 3, (0, 1, 2, 3)),
    MedType("TR3", "TRIA3", 203, 4, (0, 1, 2)),
    MedType("QU4", "QUAD4", 204, 5, (0, 1, 2, 3)),
    MedType("TR6", "TRIA6", 206, 6, (0, 1, 2, 3, 4, 5)),
    MedType("TR7", "TRIA7", 207, 7, (0, 1, 2, 3, 4, 5, 6)),
    MedType("QU8", "QUAD8", 208, 8, (0, 1, 2, 3, 4, 5, 6, 7)),
    MedType("QU9", "QUAD9", 209, 9, (0, 1, 2, 3, 4, 5, 6, 7, 8)),
    MedType("TE4", "TETRA4", 304, 10, (0, 2, 1, 3)),
    MedType("PY5", "PYRAM5", 305, 11, _PYRAM5),
    MedType("PE6", "PENTA6", 306, 12, _PENTA6),
    MedType("HE8", "HEXA8", 308, 13, _HEXA8),
    MedType("T10", "TETRA10", 310, 14, (0, 2, 1, 3, 6, 5, 4, 7, 8, 9)),
    MedType("P13", "PYRAM13", 313, 16, (*_PYRAM5, 6, 10, 8, 5, 7, 12, 11, 9)),
    MedType("P15", "PENTA15", 315, 17, _PENTA15),
    MedType("P18", "PENTA18", 318, 18, (*_PENTA15, 16, 17, 15)),
    MedType("H20", "HEXA20", 320, 19, _HEXA20),
    MedType("H27", "HEXA27", 327, 20, (*_HEXA20, 20, 22, 24, 23, 21, 25, 26)),
)

#: Cells of MED that lacmesh does not read.
NOT_READ = {"POG": "polygons", "PO2": "quadratic polygons", "POE": "polyhedra", "O12": "hexagonal prisms (OCTA12)"}
