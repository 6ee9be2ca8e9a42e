"""Structured blocks of every cell type, their sides as groups, and a master skin beside them.

A block is n cells a side of a box: quadrangles or hexahedra, each split into the cells asked for, order raised by
lacmesh. Sides are groups x0, x1, y0, ...: the axis, and 0 for its lower end, 1 for its upper. `joined` makes several
meshes one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import Counts, Pattern, assembled, box_of, kinds, linear, raised

Ints = NDArray[np.integer]
Floats = NDArray[np.floating]

#: the cells that a block can be made of
BLOCK_TYPES = tuple(name for dim in (2, 3) for name in kinds(dim) if name in CELLS)
#: triangles along the other diagonal
LEFT: Pattern = (("TRIA3", (0, 1, 3)), ("TRIA3", (1, 2, 3)))
#: names of the least and the greatest side of each axis
SIDES = (("x0", "x1"), ("y0", "y1"), ("z0", "z1"))


def block(kind: str, n: Counts, low: Sequence[float], high: Sequence[float]) -> Mesh:
    """A box of cells of type `kind`, n a side or (nx, ny, ..), its sides as groups; `low`, `high` (dim,) its corners.

    >>> block("TETRA10", 2, (0, 0, 0), (1, 1, 1)).cells_by_type
    {'TETRA10': 48, 'TRIA6': 48}
    """
    mesh = box_of(kind, CELLS[kind].dim, n, np.subtract(high, low), low, 0.0, 0, SIDES)
    return mesh.renamed(body="")


def boxed(kind: str, points: Floats, division: tuple[Sequence[Pattern], Ints] | None = None) -> Mesh:
    """Cells of a kind between the points (a, .., dim) of a grid, its sides as groups.

    `division`: patterns of boxes, and the index of each box's pattern, where they are not those of the kind.
    """
    return raised(linear(points, kind, SIDES, division), kind).renamed(body="")


def with_master(mesh: Mesh, kind: str, points: Floats) -> Mesh:
    """Add one cell of type `kind` with its nodes at `points` (n_nodes, dim), in the group `master`."""
    return with_skin(mesh, kind, points, np.arange(len(points))[None], "master")


def with_skin(mesh: Mesh, kind: str, points: Floats, faces: Ints, group: str) -> Mesh:
    """Add faces (k, n_nodes), rows of `points` (n, dim), of type `kind` in a group of their own."""
    own = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    rows = rows_of(mesh) | {(kind, group): mesh.n_nodes + faces}
    return assembled(np.concatenate([mesh.points, own]), rows, mesh.space_dim)


def joined(parts: Sequence[tuple[Mesh, Mapping[str, str]]], *, keep: bool = False) -> Mesh:
    """Join meshes, each with new names for its groups ("": the cells of no group); groups of one name are merged.

    `keep`: groups without a new name keep theirs; else they are left out.
    """
    rows: dict[tuple[str, str], list[Ints]] = defaultdict(list)
    first = 0
    for mesh, names in parts:
        for (kind, name), nodes in rows_of(mesh).items():
            rows[kind, names.get(name, name if keep else "")].append(nodes + first)
        first += mesh.n_nodes
    points = np.concatenate([mesh.points for mesh, _ in parts])
    return assembled(points, {key: np.concatenate(nodes) for key, nodes in rows.items()}, parts[0][0].space_dim)


def bent(mesh: Mesh, where: Callable[[Floats], Floats]) -> Mesh:
    """The mesh with its nodes x (n, 3) at `where(x)`: nodes between others go along, so that faces are curved."""
    return Mesh.create(where(mesh.points), mesh.blocks, cell_groups=mesh.cell_groups, space_dim=mesh.space_dim)


def polar(x: Floats) -> Floats:
    """Points (n, 3) at a radius, an angle (radians) and a height z."""
    return np.stack([x[:, 0] * np.cos(x[:, 1]), x[:, 0] * np.sin(x[:, 1]), x[:, 2]], axis=1)


def nodes_of(mesh: Mesh, group: str) -> Ints:
    """The nodes of the cells of a group, sorted."""
    return np.unique(np.concatenate([nodes.ravel() for _, _, nodes in mesh.select(mesh.cell_groups[group])]))


def rows_of(mesh: Mesh) -> dict[tuple[str, str], Ints]:
    """Cells by (type, group), from which a mesh is assembled; "" for cells without group. Groups are disjoint."""
    left = np.ones(mesh.n_cells, bool)
    rows: dict[tuple[str, str], Ints] = {}
    for name, cells in mesh.cell_groups.items():
        rows |= {(kind, name): nodes for kind, _, nodes in mesh.select(cells)}
        left[cells] = False
    return rows | {(kind, ""): nodes for kind, _, nodes in mesh.select(np.flatnonzero(left))}
