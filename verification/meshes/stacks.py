"""Blocks on one another whose faces do not match: every type of cell and mixtures, distorted, tilted, bent.

A block fills [0, 1]^d; the lower of a stack is at heights 0 to 1, the upper at 1 to 2. Groups of a stack: `slave` and
`master` between the blocks, `bottom`, `top`, and `x0`, `x1` (`y0`, `y1`) on the sides, over both blocks; the cells are
in `lower` and `upper`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.meshes.blocks import SPLITS, Pattern, assembled, bent, divided, grid, joined, raised, with_sides

Ints = NDArray[np.integer]
Floats = NDArray[np.floating]

#: kinds of blocks: a type of cell, with what it turns to the other block where it has faces of two shapes; mixtures,
#: with the order that they are raised to
PLANE_KINDS = ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9", "mixed 1", "mixed 2", "mixed 2-full")
SOLID_KINDS = (
    *("TETRA4", "TETRA10", "HEXA8", "HEXA20", "HEXA27"),
    *(f"{name} {face}" for name in ("PENTA6", "PENTA15", "PENTA18") for face in ("triangle", "quadrangle")),
    *(f"{name} {face}" for name in ("PYRAM5", "PYRAM13", "PYRAM14") for face in ("triangle", "quadrangle")),
    *("mixed 1", "mixed 2", "mixed 2-full"),
)
#: kinds whose slave faces may be cut in two ways
TWO_WAYS = ("HEXA8", "HEXA20")
#: layers of cells in a block; even, so that pyramids turn the same faces up and down
LAYERS = 2
#: how uneven grid lines are along each axis, as parts of `bend`: t -> t + bend BEND t (1 - t)
BEND = (1.0, -0.8, 0.5)

_FACETS = tuple(facet.nodes for facet in CELLS["HEXA8"].facets)
#: prisms that lie down: quadrangles below and above
_LYING: Pattern = (("PENTA6", (0, 3, 7, 1, 2, 6)), ("PENTA6", (0, 7, 4, 1, 6, 5)))
#: three pyramids with their apex in a corner of a hexahedron: triangles on the facets that have that corner
_CORNERED: tuple[Pattern, ...] = tuple(
    tuple(("PYRAM5", (*facet[::-1], corner)) for facet in _FACETS if corner not in facet) for corner in range(8)
)
#: type of the cells that a mixture is raised like
_MIXED = {"1": "HEXA8", "2": "HEXA20", "2-full": "HEXA27"}


def _opened(facet: int) -> Pattern:
    """Six pyramids round the centre, that on one facet as two tetrahedra."""
    a, b, c, d = _FACETS[facet][::-1]
    rest = (cell for k, cell in enumerate(SPLITS["PYRAM5"]) if k != facet)
    return (*rest, ("TETRA4", (a, b, c, 8)), ("TETRA4", (a, c, d, 8)))


def block(kind: str, counts: Sequence[int], *, bend: float = 0.0, skew: float = 0.0) -> Mesh:
    """A block of cells of a kind, `counts` (dim,) along the axes (the last even); its sides are groups x0, x1, ...

    `bend`: how uneven the grid's lines are. `skew`: how far columns of nodes are moved at the middle of the block,
    which leaves its sides flat and makes quadrangles of faces that were rectangles.

    >>> block("PYRAM5 triangle", (1, 1, 2)).cells_by_type
    {'PYRAM5': 6, 'TRIA3': 12, 'QUAD4': 4}
    """
    dim = len(counts)
    points, boxes = grid(counts, (0,) * dim, (1,) * dim)
    patterns, which = _patterns(kind, np.array(counts), np.rint(points[boxes[:, 0]] * counts).astype(int))
    points, cells = divided(points, boxes, patterns, which)
    for axis in range(dim):
        t = points[:, axis]
        points[:, axis] = t + bend * BEND[axis] * t * (1 - t)
    plane = points[:, : dim - 1]
    bubble = np.prod(4 * plane * (1 - plane), axis=1)
    points[:, : dim - 1] = plane + skew * bubble[:, None] * np.array([1.0, -0.7])[: dim - 1]
    return with_sides(of_order(Mesh.create(points, cells.items(), space_dim=dim), kind), (0,) * dim, (1,) * dim)


def stack(
    slave: str, master: str, dim: int, *, slave_below: bool = True, counts: tuple[int, int] = (3, 2), gap: float = 0.0,
    bend: float = 0.0, skew: float = 0.0,
) -> Mesh:  # fmt: skip
    """Two blocks of kinds `slave` and `master`, `counts` cells a side of the lower and of the upper one.

    `gap`: how far the upper is above the lower, which is skewed the other way.
    """
    up = "xyz"[dim - 1]
    kinds, roles = ((slave, master), ("slave", "master")) if slave_below else ((master, slave), ("master", "slave"))
    parts = []
    for k, (kind, n, role) in enumerate(zip(kinds, counts, roles, strict=True)):
        part = block(kind, (*(n,) * (dim - 1), LAYERS), bend=bend, skew=-skew if k else skew)
        names = {f"{a}{e}": f"{a}{e}" for a in "xyz"[: dim - 1] for e in "01"}
        names |= {f"{up}{1 - k}": role, f"{up}{k}": ("bottom", "top")[k], "": ("lower", "upper")[k]}
        parts.append((moved(part, shift=np.eye(3)[dim - 1] * k * (1 + gap)), names))
    return joined(parts)


def tower(kinds: Sequence[str], counts: Sequence[int]) -> Mesh:
    """Blocks on one another in space: `slave1` lies on `master1`, `slave2` on `master2` ...; cells `body0`, ..."""
    parts = []
    for k, (kind, n) in enumerate(zip(kinds, counts, strict=True)):
        names = {f"{a}{e}": f"{a}{e}" for a in "xy" for e in "01"} | {"": f"body{k}"}
        names |= {"z0": f"slave{k}" if k else "bottom", "z1": f"master{k + 1}" if k + 1 < len(kinds) else "top"}
        parts.append((moved(block(kind, (n, n, LAYERS)), shift=np.array([0.0, 0, k])), names))
    return joined(parts)


def skin(mesh: Mesh, group: str) -> Mesh:
    """The cells of a group alone, with their nodes."""
    parts = [(kind, nodes) for kind, _, nodes in mesh.select(mesh.cell_groups[group])]
    used = np.unique(np.concatenate([nodes.ravel() for _, nodes in parts]))
    rows = {(kind, group): np.searchsorted(used, nodes) for kind, nodes in parts}
    return assembled(mesh.points[used], rows, mesh.space_dim)


def moved(mesh: Mesh, turn: Floats | None = None, shift: Floats | None = None) -> Mesh:
    """The mesh turned by a rotation (3, 3), then shifted by (3,)."""
    return bent(mesh, lambda x: (x if turn is None else x @ turn.T) + (0.0 if shift is None else shift))


def tilt(dim: int, angle: float = 0.7) -> NDArray[np.floating]:
    """(3, 3): a rotation about an axis that is no coordinate axis; about z in 2D (Rodrigues' formula)."""
    axis = np.array([0.0, 0.0, 1.0]) if dim == 2 else np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1, -2, 0.5])
    cross = -np.cross(np.eye(3), axis)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def _patterns(kind: str, counts: Ints, place: Ints) -> tuple[Sequence[Pattern], Ints]:
    """Patterns that split the boxes of a block at places (k, dim), and the index of each box's pattern (k,)."""
    name, _, face = kind.partition(" ")
    if name == "mixed":
        return _mixture(counts, place)
    linear = CELLS[name].linear
    if (linear, face) == ("PYRAM5", "triangle"):
        odd = place % 2
        corners = (np.array(CELLS["HEXA8"].reference) > 0).astype(int)
        return _CORNERED, np.array((odd[:, None] == corners).all(axis=2).argmax(axis=1))
    pattern = _LYING if (linear, face) == ("PENTA6", "quadrangle") else SPLITS[linear]
    return [pattern], np.zeros(len(place), int)


def _mixture(counts: Ints, place: Ints) -> tuple[Sequence[Pattern], Ints]:
    """Columns by turns: quadrangles, triangles; hexahedra, prisms, pyramids with tetrahedra below and above."""
    if len(counts) == 2:
        return [SPLITS["QUAD4"], SPLITS["TRIA3"]], place[:, 0] % 2
    column = (place[:, 0] + place[:, 1]) % 3
    lowest, highest = place[:, 2] == 0, place[:, 2] == counts[2] - 1
    which = np.select([(column == 2) & lowest, (column == 2) & highest], [2, 3], np.minimum(column, 1))
    return [SPLITS["HEXA8"], SPLITS["PENTA6"], _opened(0), _opened(5)], which


def of_order(mesh: Mesh, kind: str) -> Mesh:
    """Replace linear cells by those of a kind, of its order."""
    name, _, order = kind.partition(" ")
    return raised(mesh, _MIXED[order] if name == "mixed" else name)
