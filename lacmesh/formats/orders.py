"""Cells of MED, VTK, XDMF and meshio side by side: their names, numbers and orders of nodes; their order in a file.

An order lists our places of the nodes in the order in which the format names them. MED: MEDiterators.c of libmed. VTK:
vtkCellType.h; its cells of higher order are Lagrange cells. XDMF: XdmfTopologyType.cpp, whose order is VTK's, as
dolfinx's cells.cpp says too.
"""

from __future__ import annotations

from collections.abc import Container, Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lacmesh.cells import ALL_CELLS, CARRIED
from lacmesh.errors import WriteError
from lacmesh.indices import repeated
from lacmesh.mesh import Block, Ints, Mesh

Places = tuple[int, ...]


class FormatCell(NamedTuple):
    """A cell of a format: its `name` and `number` there, our `type`, its order of `nodes`; MED's `bit` in masks."""

    name: str
    number: int
    type: str
    nodes: Places
    bit: int = 0


#: type: MED's name, VTK's number, XDMF's name and number, each None where the format has no such cell
_LISTED: dict[str, tuple[str | None, int | None, str | None, int | None]] = {
    "POI1": ("PO1", 1, "Polyvertex", 1),
    "SEG2": ("SE2", 3, "Polyline", 2),
    "SEG3": ("SE3", 21, "Edge_3", 34),
    "TRIA3": ("TR3", 5, "Triangle", 4),
    "TRIA6": ("TR6", 22, "Triangle_6", 36),
    "TRIA7": ("TR7", 34, None, None),
    "QUAD4": ("QU4", 9, "Quadrilateral", 5),
    "QUAD8": ("QU8", 23, "Quadrilateral_8", 37),
    "QUAD9": ("QU9", 28, "Quadrilateral_9", 35),
    "TETRA4": ("TE4", 10, "Tetrahedron", 6),
    "TETRA10": ("T10", 24, "Tetrahedron_10", 38),
    "HEXA8": ("HE8", 12, "Hexahedron", 9),
    "HEXA20": ("H20", 25, "Hexahedron_20", 48),
    "HEXA27": ("H27", 29, "Hexahedron_27", 50),
    "PENTA6": ("PE6", 13, "Wedge", 8),
    "PENTA15": ("P15", 26, "Wedge_15", 40),
    "PENTA18": ("P18", 32, "Wedge_18", 41),
    "PYRAM5": ("PY5", 14, "Pyramid", 7),
    "PYRAM13": ("P13", 27, "Pyramid_13", 39),
    "SEG4": ("SE4", 68, None, None),
    **dict.fromkeys(("SEG5", "SEG6"), (None, 68, None, None)),
    **dict.fromkeys(("TRIA10", "TRIA15", "TRIA21"), (None, 69, None, None)),
    **dict.fromkeys(("QUAD16", "QUAD25", "QUAD36"), (None, 70, None, None)),
    **dict.fromkeys(("TETRA20", "TETRA35", "TETRA56"), (None, 71, None, None)),
    **dict.fromkeys(("HEXA64", "HEXA125"), (None, 72, None, None)),
}
#: MED's names in libmed's order, which numbers cells without numbers and gives each type its bit; O12 is none of ours
_OF_LIBMED = "PO1 SE2 SE3 SE4 TR3 QU4 TR6 TR7 QU8 QU9 TE4 PY5 PE6 HE8 T10 O12 P13 P15 P18 H20 H27"

_MED_HEXA8, _MED_PENTA6, _MED_PYRAM5 = (0, 3, 2, 1, 4, 7, 6, 5), (0, 2, 1, 3, 5, 4), (0, 3, 2, 1, 4)
_MED_HEXA20 = (*_MED_HEXA8, 9, 13, 11, 8, 17, 19, 18, 16, 10, 15, 14, 12)
_MED_PENTA15 = (*_MED_PENTA6, 7, 9, 6, 13, 14, 12, 8, 11, 10)
#: MED's order of nodes where it is not ours
_MED_NODES: dict[str, Places] = {
    "TETRA4": (0, 2, 1, 3),
    "TETRA10": (0, 2, 1, 3, 6, 5, 4, 7, 8, 9),
    "PYRAM5": _MED_PYRAM5,
    "PYRAM13": (*_MED_PYRAM5, 6, 10, 8, 5, 7, 12, 11, 9),
    "PENTA6": _MED_PENTA6,
    "PENTA15": _MED_PENTA15,
    "PENTA18": (*_MED_PENTA15, 16, 17, 15),
    "HEXA8": _MED_HEXA8,
    "HEXA20": _MED_HEXA20,
    "HEXA27": (*_MED_HEXA20, 20, 22, 24, 23, 21, 25, 26),
}

_VTK_HEXA20 = (*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)
_VTK_PENTA15 = (*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11)
#: VTK's order of nodes where it is not ours
_VTK_NODES: dict[str, Places] = {
    "TETRA10": (*range(8), 9, 8),
    "HEXA20": _VTK_HEXA20,
    "HEXA27": (*_VTK_HEXA20, 22, 23, 21, 24, 20, 25, 26),
    "PENTA15": _VTK_PENTA15,
    "PENTA18": (*_VTK_PENTA15, 15, 17, 16),
    "PYRAM13": (*range(5), 5, 8, 10, 6, 7, 9, 11, 12),
    "QUAD16": (*range(8), 9, 8, 11, 10, 12, 13, 15, 14),
    "QUAD25": (*range(10), 12, 11, 10, 15, 14, 13, 16, 20, 17, 23, 24, 21, 19, 22, 18),
    "QUAD36": (
        *(*range(12), 15, 14, 13, 12, 19, 18, 17, 16),
        *(20, 24, 25, 21, 31, 32, 33, 26, 30, 35, 34, 27, 23, 29, 28, 22),
    ),
    "TETRA20": (*range(10), 11, 10, 15, 14, 13, 12, 17, 19, 18, 16),
    "TETRA35": (
        *(*range(13), 15, 14, 13, 21, 20, 19, 18, 17, 16),
        *(25, 26, 27, 33, 31, 32, 28, 29, 30, 22, 23, 24, 34),
    ),
    "TETRA56": (
        *(*range(16), 19, 18, 17, 16, 27, 26, 25, 24, 23, 22, 21, 20, 34, 35, 36, 37, 38, 39, 48, 46, 47, 51, 49, 50),
        *(40, 41, 42, 43, 44, 45, 28, 29, 30, 31, 32, 33, 52, 53, 54, 55),
    ),
    "HEXA64": (
        *(*range(10), 14, 15, 19, 18, 10, 11, 24, 25, 28, 29, 31, 30, 26, 27, 12, 13, 16, 17, 20, 21, 22, 23),
        *(40, 43, 41, 42, 44, 45, 47, 46, 36, 37, 39, 38, 49, 48, 50, 51, 32, 35, 33, 34, 52, 53, 55, 54),
        *(56, 57, 59, 58, 60, 61, 63, 62),
    ),
    "HEXA125": (
        *(*range(11), 17, 18, 19, 25, 24, 23, 11, 12, 13, 32, 33, 34, 38, 39, 40, 43, 42, 41, 35, 36, 37),
        *(14, 15, 16, 20, 21, 22, 26, 27, 28, 29, 30, 31, 62, 69, 65, 66, 70, 68, 63, 67, 64, 71, 75, 72, 78, 79, 76),
        *(74, 77, 73, 53, 57, 54, 60, 61, 58, 56, 59, 55, 81, 84, 80, 85, 88, 87, 82, 86, 83, 44, 51, 47, 48, 52, 50),
        *(45, 49, 46, 89, 93, 90, 96, 97, 94, 92, 95, 91, 98, 106, 99, 107, 118, 109, 101, 111, 100, 108, 119, 110),
        *(120, 124, 121, 113, 122, 112, 102, 114, 103, 115, 123, 116, 105, 117, 104),
    ),
}


def _places(kind: str, of_format: dict[str, Places]) -> Places:
    return of_format.get(kind, tuple(range(ALL_CELLS[kind].n_nodes)))


#: our type: the cell of MED, of VTK, of XDMF; those of MED stand in libmed's order
_GEO = {kind: 100 * cell.dim + cell.n_nodes if cell.dim else 1 for kind, cell in ALL_CELLS.items()}
_MED = {med: FormatCell(med, _GEO[kind], kind, _places(kind, _MED_NODES), _OF_LIBMED.split().index(med))
        for kind, (med, _, _, _) in _LISTED.items() if med}  # fmt: skip
MED_CELLS = {_MED[name].type: _MED[name] for name in _OF_LIBMED.split() if name in _MED}
VTK_CELLS = {kind: FormatCell("", number, kind, _places(kind, _VTK_NODES))
             for kind, (_, number, _, _) in _LISTED.items() if number}  # fmt: skip
XDMF_CELLS = {kind: FormatCell(name, number, kind, _places(kind, _VTK_NODES))
              for kind, (_, _, name, number) in _LISTED.items() if name and number}  # fmt: skip

#: other cells of VTK that are read: Lagrange cells of order 1 and 2, polygons that are triangles, voxels ...
_READ_TOO = {
    2: ("POI1",), 4: ("SEG2",), 35: ("SEG4",), 6: ("TRIA3",), 7: ("TRIA3", "QUAD4"), 68: ("SEG2", "SEG3"),
    69: ("TRIA3", "TRIA6"), 70: ("QUAD4", "QUAD9"), 71: ("TETRA4", "TETRA10"), 72: ("HEXA8", "HEXA27"),
    73: ("PENTA6", "PENTA18"),
}  # fmt: skip
_PIXEL = FormatCell("", 8, "QUAD4", (0, 1, 3, 2))
_VOXEL = FormatCell("", 11, "HEXA8", (0, 1, 3, 2, 4, 5, 7, 6))
#: VTK's Lagrange hexahedra, whose order of nodes VTK 9 changed
LAGRANGE_HEXAHEDRON = 72
#: (VTK's number, nodes): the cell
VTK_BY_NUMBER = {
    (cell.number, len(cell.nodes)): cell
    for cell in (
        *VTK_CELLS.values(),
        *(FormatCell("", n, kind, _places(kind, _VTK_NODES)) for n, kinds in _READ_TOO.items() for kind in kinds),
        *(_PIXEL, _VOXEL),
    )
}
#: cells of VTK, and of MED, that are not read
VTK_NOT_READ = {
    0: "empty cells", 2: "vertices of several points", 4: "lines of several pieces", 6: "strips of triangles",
    7: "polygons of more than 4 corners", 15: "pentagonal prisms", 16: "hexagonal prisms",
    30: "quadrangles of order 2 by 1", 31: "wedges of order 2 by 1", 33: "hexahedra of 24 nodes",
    36: "quadratic polygons", 37: "pyramids of 19 nodes", 41: "convex sets of points", 42: "polyhedra",
    **dict.fromkeys(range(68, 75), "Lagrange cells"), **dict.fromkeys(range(75, 82), "Bezier cells"),
}  # fmt: skip
MED_NOT_READ = {"POG": "polygons", "PO2": "quadratic polygons", "POE": "polyhedra", "O12": "hexagonal prisms (OCTA12)"}
#: XDMF's vertices and lines: in a mixture, the number of their nodes follows that of the type
XDMF_COUNTED = (1, 2)
#: other names of XDMF's cells, in lower case
XDMF_ALIASES = {
    "line": "polyline", "tri": "triangle", "quad": "quadrilateral", "tet": "tetrahedron", "pyra": "pyramid",
    "hex": "hexahedron",
}  # fmt: skip

_OF_MESHIO = {
    "POI": "vertex", "SEG": "line", "TRIA": "triangle", "QUAD": "quad", "TETRA": "tetra", "HEXA": "hexahedron",
    "PENTA": "wedge", "PYRAM": "pyramid",
}  # fmt: skip
#: our type: meshio's name, whose order is VTK's but for cells of order above 2, where it is ours
MESHIO_NAMES = {
    kind: _OF_MESHIO[cell.family] + (str(cell.n_nodes) if cell.n_nodes > cell.n_corners else "")
    for kind, cell in ALL_CELLS.items()
}


def meshio_nodes(kind: str) -> Places:
    """Return our places of the nodes in the order in which meshio names them, of a cell type."""
    return VTK_CELLS[kind].nodes if kind in VTK_CELLS and kind not in CARRIED else tuple(range(ALL_CELLS[kind].n_nodes))


def lagrange_8_to_9(n_nodes: int) -> Places:
    """Permutation of a Lagrange hexahedron's nodes from VTK 8's order to VTK 9's (files of version 2.1 and later).

    The last two vertical edges changed places.

    >>> lagrange_8_to_9(27)[16:20]
    (16, 17, 19, 18)
    """
    inside = round(n_nodes ** (1 / 3)) - 2  # nodes inside an edge
    places, first = list(range(n_nodes)), 8 + 10 * inside
    middle, last = first + inside, first + 2 * inside
    places[first:last] = places[middle:last] + places[first:middle]
    return tuple(places)


# ---- cells of a mesh in a file


def file_order(mesh: Mesh) -> Ints:
    """Indices of the cells (n_cells,) in the order of the file."""
    return np.arange(mesh.n_cells) if mesh.file_order is None else np.asarray(mesh.file_order)


def blocks_in_order(mesh: Mesh) -> Iterator[tuple[Block, int, Ints]]:
    """Yield each block that has cells, the index of its first cell, and the indices of all in the order of the file."""
    order = file_order(mesh)
    for block, (lo, hi) in zip(mesh.blocks, pairwise(mesh.offsets.tolist()), strict=True):
        if lo < hi:
            yield block, lo, order[lo:hi] if mesh.file_order is None else order[(order >= lo) & (order < hi)]


def is_plane(mesh: Mesh) -> bool:
    """True if two coordinates say all of a mesh: it is of two dimensions, has no solids, and z is 0."""
    return mesh.space_dim == 2 and mesh.dim < 3 and not np.any(mesh.points[:, 2])


def check_types(path: Path, mesh: Mesh, known: Container[str], whose: str) -> None:
    """Raise WriteError where the mesh has cells of a type that is none of the `known` ones of a program or format."""
    for cell_type, n in mesh.cells_by_type.items():
        if cell_type not in known:
            what = "write them as PYRAM13" if cell_type == "PYRAM14" else "lower their order"
            message = f"{whose} has no cells of type {cell_type}, the mesh has {n}; {what}, or write a .msh file"
            raise WriteError(path, message)


def numbers_within(numbers: Ints, least: int, largest: int, what: str, clauses: list[str]) -> Ints:
    """Numbers of nodes or cells; 1, 2 ..., with a clause, where some are equal, or beyond what a format can hold."""
    numbers = np.asarray(numbers, np.int64)
    within = numbers.min(initial=least) >= least and numbers.max(initial=largest) <= largest
    if within and repeated(numbers) is None:
        return numbers
    wanted = "positive and distinct" if (least, largest) == (1, 2**63 - 1) else f"distinct from {least} to {largest}"
    clauses.append(f"the numbers of {what} are not {wanted}: they are 1, 2 ... in the file")
    return np.arange(1, len(numbers) + 1)
