"""The table of cells: nodes, edges, facets and reference coordinates of every type, in gmsh's node order.

A type is its family and its number of nodes (TETRA10). The order of the nodes is: corners, one per edge (order 2),
one per face that has a centre, the centre of the cell. Facets are listed outward (their normal by the right-hand rule
points out of the cell); the order of the facets, and the corner at which each starts, fix the order in which a cell is
cut and its children are numbered (code_aster's order, `patterns.py`).

Reference elements: SEG [-1, 1]; TRIA (0,0) (1,0) (0,1); QUAD [-1, 1]^2; TETRA the unit simplex; HEXA [-1, 1]^3;
PENTA the unit triangle times [-1, 1]; PYRAM base [-1, 1]^2 at z = 0, apex (0, 0, 1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

Point = tuple[float, ...]
Nodes = tuple[int, ...]


@dataclass(frozen=True)
class Facet:
    """A side of a cell: its type, its nodes as indices into the cell's own list, outward, and those at its corners."""

    type: str
    nodes: Nodes
    corners: Nodes


@dataclass(frozen=True)
class Cell:
    """A cell type. `reference` is (n_nodes, dim); edge k's mid-node, where there is one, is node `n_corners + k`.

    `order` is 0 for a point, 1, 2, or 3 for anything higher (such cells are passed through, and have no table).
    """

    name: str
    family: str
    dim: int
    order: int
    n_nodes: int
    n_corners: int
    msh: int | None
    reference: tuple[Point, ...] = ()
    edges: tuple[Nodes, ...] = ()
    facets: tuple[Facet, ...] = ()
    #: node -> the corners at whose mean it stands in the reference element
    corners_of_node: tuple[Nodes, ...] = ()

    @property
    def linear(self) -> str:
        """Name of the linear type of the same family."""
        return f"{self.family}{self.n_corners}"


@dataclass(frozen=True)
class _Family:
    dim: int
    corners: tuple[Point, ...]
    edges: tuple[Nodes, ...]  # gmsh's order
    faces: tuple[Nodes, ...]  # facets of dimension dim - 1, outward, in our order
    centred: tuple[Nodes, ...]  # faces that get a node of their own, gmsh's order (by their corners)


_SQUARE = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
_FAMILIES = {
    "POI": _Family(0, ((),), (), (), ()),
    "SEG": _Family(1, ((-1.0,), (1.0,)), ((0, 1),), ((0,), (1,)), ()),
    "TRIA": _Family(
        2, ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)), ((0, 1), (1, 2), (2, 0)), ((0, 1), (1, 2), (2, 0)), ((0, 1, 2),)
    ),
    "QUAD": _Family(2, _SQUARE, ((0, 1), (1, 2), (2, 3), (3, 0)), ((0, 1), (1, 2), (2, 3), (3, 0)), ((0, 1, 2, 3),)),
    "TETRA": _Family(
        3,
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        ((0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1)),
        ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
        (),
    ),
    "HEXA": _Family(
        3,
        tuple((*p, -1.0) for p in _SQUARE) + tuple((*p, 1.0) for p in _SQUARE),
        ((0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7)),
        ((0, 3, 2, 1), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)),
        ((0, 1, 2, 3), (0, 1, 4, 5), (0, 3, 4, 7), (1, 2, 5, 6), (2, 3, 6, 7), (4, 5, 6, 7)),
    ),
    "PENTA": _Family(
        3,
        tuple((*p, z) for z in (-1.0, 1.0) for p in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))),
        ((0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)),
        ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
        ((0, 1, 3, 4), (0, 2, 3, 5), (1, 2, 4, 5)),
    ),
    "PYRAM": _Family(
        3,
        (*((*p, 0.0) for p in _SQUARE), (0.0, 0.0, 1.0)),
        ((0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)),
        ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
        ((0, 1, 2, 3),),
    ),
}

#: name: (family, edges have a mid-node, faces of `centred` have one, the cell has one, gmsh's number of the type)
_TYPES = {
    "POI1": ("POI", False, False, False, 15),
    "SEG2": ("SEG", False, False, False, 1),
    "SEG3": ("SEG", True, False, False, 8),
    "TRIA3": ("TRIA", False, False, False, 2),
    "TRIA6": ("TRIA", True, False, False, 9),
    "TRIA7": ("TRIA", True, True, False, None),
    "QUAD4": ("QUAD", False, False, False, 3),
    "QUAD8": ("QUAD", True, False, False, 16),
    "QUAD9": ("QUAD", True, True, False, 10),
    "TETRA4": ("TETRA", False, False, False, 4),
    "TETRA10": ("TETRA", True, False, False, 11),
    "HEXA8": ("HEXA", False, False, False, 5),
    "HEXA20": ("HEXA", True, False, False, 17),
    "HEXA27": ("HEXA", True, True, True, 12),
    "PENTA6": ("PENTA", False, False, False, 6),
    "PENTA15": ("PENTA", True, False, False, 18),
    "PENTA18": ("PENTA", True, True, False, 13),
    "PYRAM5": ("PYRAM", False, False, False, 7),
    "PYRAM13": ("PYRAM", True, False, False, 19),
    "PYRAM14": ("PYRAM", True, True, False, 14),
}

#: Cells of higher order, carried through whole: name: (dimension, nodes, corners, gmsh's number)
_CARRIED = {
    "SEG4": (1, 4, 2, 26),
    "SEG5": (1, 5, 2, 27),
    "SEG6": (1, 6, 2, 28),
    "TRIA9": (2, 9, 3, 20),
    "TRIA10": (2, 10, 3, 21),
    "TRIA12": (2, 12, 3, 22),
    "TRIA15": (2, 15, 3, 23),
    "TRIA21": (2, 21, 3, 25),
    "QUAD12": (2, 12, 4, 39),
    "QUAD16": (2, 16, 4, 36),
    "QUAD25": (2, 25, 4, 37),
    "QUAD36": (2, 36, 4, 38),
    "TETRA20": (3, 20, 4, 29),
    "TETRA35": (3, 35, 4, 30),
    "TETRA56": (3, 56, 4, 31),
    "HEXA64": (3, 64, 8, 92),
    "HEXA125": (3, 125, 8, 93),
    "PENTA40": (3, 40, 6, 90),
    "PENTA75": (3, 75, 6, 91),
    "PYRAM30": (3, 30, 5, 118),
    "PYRAM55": (3, 55, 5, 119),
}


def _facet(family: _Family, corners: Nodes, mid_nodes: bool, centres: bool) -> Facet:
    """Make a facet, its type and all its nodes, from its corners."""
    nodes = list(corners)
    if mid_nodes and len(corners) > 1:
        edge = {frozenset(e): len(family.corners) + k for k, e in enumerate(family.edges)}
        turn = zip(corners, corners[1:] + corners[:1], strict=True) if len(corners) > 2 else [corners]
        nodes += [edge[frozenset(e)] for e in turn]
    if centres and family.dim == 3:
        first = len(family.corners) + len(family.edges)
        nodes += [first + k for k, f in enumerate(family.centred) if set(f) == set(corners)]
    stem = "POI" if len(corners) == 1 else "SEG" if family.dim == 2 else {3: "TRIA", 4: "QUAD"}[len(corners)]
    return Facet(f"{stem}{len(nodes)}", tuple(nodes), corners)


def _cell(name: str) -> Cell:
    stem, mid_nodes, centres, body, msh = _TYPES[name]
    family = _FAMILIES[stem]
    n = len(family.corners)
    corners_of_node: tuple[Nodes, ...] = tuple((c,) for c in range(n))
    if mid_nodes:
        corners_of_node += family.edges
    if centres:
        corners_of_node += family.centred
    if body:
        corners_of_node += (tuple(range(n)),)
    return Cell(
        name=name,
        family=stem,
        dim=family.dim,
        order=2 if mid_nodes else min(1, family.dim),
        n_nodes=len(corners_of_node),
        n_corners=n,
        msh=msh,
        reference=tuple(
            tuple(sum(axis) / len(on) for axis in zip(*(family.corners[c] for c in on), strict=True))
            for on in corners_of_node
        ),
        edges=family.edges,
        facets=tuple(_facet(family, f, mid_nodes, centres) for f in family.faces),
        corners_of_node=corners_of_node,
    )


#: Every cell that lacmesh cuts, or leaves whole knowing why.
CELLS: Mapping[str, Cell] = MappingProxyType({name: _cell(name) for name in _TYPES})
#: Cells that a format has and that go through untouched.
CARRIED: Mapping[str, Cell] = MappingProxyType(
    {
        name: Cell(name, name.rstrip("0123456789"), dim, 3, n_nodes, n_corners, msh)
        for name, (dim, n_nodes, n_corners, msh) in _CARRIED.items()
    }
)
#: Both: every name that a block of a mesh may have.
ALL_CELLS: Mapping[str, Cell] = MappingProxyType({**CELLS, **CARRIED})
#: flat pieces of faces, by places among the face's nodes, all of which they use; they turn as the face does
PIECES = {
    "SEG2": ((0, 1),),
    "SEG3": ((0, 2), (2, 1)),
    "TRIA3": ((0, 1, 2),),
    "TRIA6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "TRIA7": ((0, 3, 6), (3, 1, 6), (1, 4, 6), (4, 2, 6), (2, 5, 6), (5, 0, 6)),
    "QUAD4": ((0, 1, 2), (0, 2, 3)),
    "QUAD8": ((0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6), (4, 6, 7)),
    "QUAD9": (
        (0, 4, 8), (4, 1, 8), (1, 5, 8), (5, 2, 8), (2, 6, 8), (6, 3, 8), (3, 7, 8), (7, 0, 8),
    ),
}  # fmt: skip
