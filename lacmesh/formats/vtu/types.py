"""VTK's cells: the table of numbers and node orders (vtkCellType.h), for VTU, XDMF and pyvista.

Cells of higher order are VTK's Lagrange cells, whose node order follows from their order; TRIA9, TRIA12, QUAD12,
PYRAM14 and the pyramids and prisms of higher order have no cell in VTK that any version reads.
"""

from __future__ import annotations

from typing import NamedTuple

Places = tuple[int, ...]


class VtkType(NamedTuple):
    """VTK's `number` of our `type`; `nodes[k]` is our place of the node VTK lists k-th."""

    number: int
    type: str
    nodes: Places


def _same(n: int) -> Places:
    return tuple(range(n))


_TETRA10 = (*_same(8), 9, 8)
_HEXA20 = (*_same(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)
_HEXA27 = (*_HEXA20, 22, 23, 21, 24, 20, 25, 26)
_PENTA15 = (*_same(6), 6, 9, 7, 12, 14, 13, 8, 10, 11)
_PENTA18 = (*_PENTA15, 15, 17, 16)
_QUAD16 = (*_same(8), 9, 8, 11, 10, 12, 13, 15, 14)
_QUAD25 = (*_same(10), 12, 11, 10, 15, 14, 13, 16, 20, 17, 23, 24, 21, 19, 22, 18)
_QUAD36 = (
    *(*_same(12), 15, 14, 13, 12, 19, 18, 17, 16),
    *(20, 24, 25, 21, 31, 32, 33, 26, 30, 35, 34, 27, 23, 29, 28, 22),
)
_TETRA20 = (*_same(10), 11, 10, 15, 14, 13, 12, 17, 19, 18, 16)
_TETRA35 = (
    *(*_same(13), 15, 14, 13, 21, 20, 19, 18, 17, 16),
    *(25, 26, 27, 33, 31, 32, 28, 29, 30, 22, 23, 24, 34),
)
_TETRA56 = (
    *(*_same(16), 19, 18, 17, 16, 27, 26, 25, 24, 23, 22, 21, 20),
    *(34, 35, 36, 37, 38, 39, 48, 46, 47, 51, 49, 50, 40, 41, 42, 43, 44, 45, 28, 29, 30, 31, 32, 33, 52, 53, 54, 55),
)
_HEXA64 = (
    *(*_same(10), 14, 15, 19, 18, 10, 11, 24, 25, 28, 29, 31, 30, 26, 27, 12, 13, 16, 17, 20, 21, 22, 23),
    *(40, 43, 41, 42, 44, 45, 47, 46, 36, 37, 39, 38, 49, 48, 50, 51, 32, 35, 33, 34, 52, 53, 55, 54),
    *(56, 57, 59, 58, 60, 61, 63, 62),
)
_HEXA125 = (
    *(*_same(11), 17, 18, 19, 25, 24, 23, 11, 12, 13, 32, 33, 34, 38, 39, 40, 43, 42, 41, 35, 36, 37),
    *(14, 15, 16, 20, 21, 22, 26, 27, 28, 29, 30, 31, 62, 69, 65, 66, 70, 68, 63, 67, 64, 71, 75, 72, 78, 79, 76),
    *(74, 77, 73, 53, 57, 54, 60, 61, 58, 56, 59, 55, 81, 84, 80, 85, 88, 87, 82, 86, 83, 44, 51, 47, 48, 52, 50),
    *(45, 49, 46, 89, 93, 90, 96, 97, 94, 92, 95, 91, 98, 106, 99, 107, 118, 109, 101, 111, 100, 108, 119, 110),
    *(120, 124, 121, 113, 122, 112, 102, 114, 103, 115, 123, 116, 105, 117, 104),
)

#: The cells that are written.
VTK_TYPES = (
    VtkType(1, "POI1", _same(1)),
    VtkType(3, "SEG2", _same(2)),
    VtkType(21, "SEG3", _same(3)),
    VtkType(5, "TRIA3", _same(3)),
    VtkType(22, "TRIA6", _same(6)),
    VtkType(34, "TRIA7", _same(7)),
    VtkType(9, "QUAD4", _same(4)),
    VtkType(23, "QUAD8", _same(8)),
    VtkType(28, "QUAD9", _same(9)),
    VtkType(10, "TETRA4", _same(4)),
    VtkType(24, "TETRA10", _TETRA10),
    VtkType(12, "HEXA8", _same(8)),
    VtkType(25, "HEXA20", _HEXA20),
    VtkType(29, "HEXA27", _HEXA27),
    VtkType(13, "PENTA6", _same(6)),
    VtkType(26, "PENTA15", _PENTA15),
    VtkType(32, "PENTA18", _PENTA18),
    VtkType(14, "PYRAM5", _same(5)),
    VtkType(27, "PYRAM13", (*_same(5), 5, 8, 10, 6, 7, 9, 11, 12)),
    VtkType(68, "SEG4", _same(4)),
    VtkType(68, "SEG5", _same(5)),
    VtkType(68, "SEG6", _same(6)),
    VtkType(69, "TRIA10", _same(10)),
    VtkType(69, "TRIA15", _same(15)),
    VtkType(69, "TRIA21", _same(21)),
    VtkType(70, "QUAD16", _QUAD16),
    VtkType(70, "QUAD25", _QUAD25),
    VtkType(70, "QUAD36", _QUAD36),
    VtkType(71, "TETRA20", _TETRA20),
    VtkType(71, "TETRA35", _TETRA35),
    VtkType(71, "TETRA56", _TETRA56),
    VtkType(72, "HEXA64", _HEXA64),
    VtkType(72, "HEXA125", _HEXA125),
)

#: Other cells that are read: Lagrange cells of order 1 and 2, polygons that are triangles, voxels ...
READ_TOO = (
    VtkType(2, "POI1", _same(1)),
    VtkType(4, "SEG2", _same(2)),
    VtkType(35, "SEG4", _same(4)),
    VtkType(6, "TRIA3", _same(3)),
    VtkType(7, "TRIA3", _same(3)),
    VtkType(7, "QUAD4", _same(4)),
    VtkType(8, "QUAD4", (0, 1, 3, 2)),
    VtkType(11, "HEXA8", (0, 1, 3, 2, 4, 5, 7, 6)),
    VtkType(68, "SEG2", _same(2)),
    VtkType(68, "SEG3", _same(3)),
    VtkType(69, "TRIA3", _same(3)),
    VtkType(69, "TRIA6", _same(6)),
    VtkType(70, "QUAD4", _same(4)),
    VtkType(70, "QUAD9", _same(9)),
    VtkType(71, "TETRA4", _same(4)),
    VtkType(71, "TETRA10", _TETRA10),
    VtkType(72, "HEXA8", _same(8)),
    VtkType(72, "HEXA27", _HEXA27),
    VtkType(73, "PENTA6", _same(6)),
    VtkType(73, "PENTA18", _PENTA18),
)

#: Cells of VTK that lacmesh does not read.
NOT_READ = {
    0: "empty cells",
    2: "vertices of several points",
    4: "lines of several pieces",
    6: "strips of triangles",
    7: "polygons of more than 4 corners",
    15: "pentagonal prisms",
    16: "hexagonal prisms",
    30: "quadrangles of order 2 by 1",
    31: "wedges of order 2 by 1",
    33: "hexahedra of 24 nodes",
    36: "quadratic polygons",
    37: "pyramids of 19 nodes",
    41: "convex sets of points",
    42: "polyhedra",
    **dict.fromkeys(range(68, 75), "Lagrange cells"),
    **dict.fromkeys(range(75, 82), "Bezier cells"),
}

LAGRANGE_HEXAHEDRON = 72

OF_TYPE = {kind.type: kind for kind in VTK_TYPES}
#: (VTK's number, nodes) -> the cell.
OF_NUMBER = {(kind.number, len(kind.nodes)): kind for kind in (*READ_TOO, *VTK_TYPES)}


def lagrange_8_to_9(n_nodes: int) -> Places:
    """Permutation of a Lagrange hexahedron's nodes from VTK 8's order to VTK 9's (files of version 2.1 and later).

    The last two vertical edges changed places.

    >>> lagrange_8_to_9(27)[16:20]
    (16, 17, 19, 18)
    """
    inside = round(n_nodes ** (1 / 3)) - 2  # nodes inside an edge
    places = list(range(n_nodes))
    first = 8 + 10 * inside
    a, b = places[first : first + inside], places[first + inside : first + 2 * inside]
    places[first : first + 2 * inside] = b + a
    return tuple(places)
