"""The cells of code_aster's mesh files: their keywords, and the order of their nodes (documentation U3.01.00).

Corners are ordered as in gmsh, not as in MED; mid-nodes follow the edges of the base, those that leave it, those of the
top. code_aster's own conversion from MED (routine lrmtyp) turns MED's order into this one, which a test repeats.
"""

from __future__ import annotations

#: keyword -> our place of the node that the file lists k-th
NODES: dict[str, tuple[int, ...]] = {
    "POI1": (0,),
    "SEG2": (0, 1),
    "SEG3": (0, 1, 2),
    "SEG4": (0, 1, 2, 3),
    "TRIA3": (0, 1, 2),
    "TRIA6": (0, 1, 2, 3, 4, 5),
    "TRIA7": (0, 1, 2, 3, 4, 5, 6),
    "QUAD4": (0, 1, 2, 3),
    "QUAD8": (0, 1, 2, 3, 4, 5, 6, 7),
    "QUAD9": (0, 1, 2, 3, 4, 5, 6, 7, 8),
    "TETRA4": (0, 1, 2, 3),
    "TETRA10": (0, 1, 2, 3, 4, 5, 6, 7, 9, 8),
    "PYRAM5": (0, 1, 2, 3, 4),
    "PYRAM13": (0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12),
    "PENTA6": (0, 1, 2, 3, 4, 5),
    "PENTA15": (0, 1, 2, 3, 4, 5, 6, 9, 7, 8, 10, 11, 12, 14, 13),
    "PENTA18": (0, 1, 2, 3, 4, 5, 6, 9, 7, 8, 10, 11, 12, 14, 13, 15, 17, 16),
    "HEXA8": (0, 1, 2, 3, 4, 5, 6, 7),
    "HEXA20": (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 10, 12, 14, 15, 16, 18, 19, 17),
    "HEXA27": (0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 10, 12, 14, 15, 16, 18, 19, 17, 20, 21, 23, 24, 22, 25, 26),
}

#: Cells of code_aster that lacmesh has not: its own between facing surfaces, and types with more centres.
_PAIRS = (
    "TR3QU4 QU4TR3 TR6TR3 TR3TR6 TR6QU4 QU4TR6 TR6QU8 QU8TR6 TR6QU9 QU9TR6 QU8TR3 TR3QU8 QU8QU4 QU4QU8 QU8QU9 "
    "QU9QU8 QU9QU4 QU4QU9 QU9TR3 TR3QU9 SEG32 SEG23 QU4QU4 TR3TR3 HE8HE8 PE6PE6 TE4TE4 QU8QU8 TR6TR6 SE2TR3 SE2TR6 "
    "SE2QU4 SE2QU8 SE2QU9 SE3TR3 SE3TR6 SE3QU4 SE3QU8 SE3QU9 H20H20 P15P15 T10T10"
)
NOT_READ = frozenset(
    f"SEG22 SEG33 TRIA33 TRIA66 QUAD44 QUAD88 QUAD99 TETRA9 TETRA15 PENTA7 PENTA21 PYRAM19 HEXA9 TRIA4 {_PAIRS}".split()
)
