"""Structured blocks of every cell type, their sides as groups, and a master skin beside them.

A block is n cells a side of a box: quadrangles or hexahedra, each split into the cells asked for, order raised by
lacmesh. Sides are groups x0, x1, y0, ...: the axis, and 0 for its lower end, 1 for its upper. `grid`, `boxed`,
`divided`, `with_sides`, `rows_of` and `assembled` are the steps of it, for other meshes, which `joined` makes one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh import Mesh
from lacmesh.cells import CELLS

Ints = NDArray[np.integer]
Floats = NDArray[np.floating]

#: type -> `raise_order`'s order that leads to it from the linear type (None: that type itself)
_ORDERS: dict[str, str | None] = {
    **dict.fromkeys(("TRIA3", "QUAD4", "TETRA4", "HEXA8", "PENTA6", "PYRAM5")),
    **dict.fromkeys(("TRIA6", "TRIA7", "QUAD8", "TETRA10", "HEXA20", "PENTA15", "PYRAM13"), "2"),
    **dict.fromkeys(("QUAD9", "HEXA27", "PENTA18", "PYRAM14"), "2-full"),
}
#: the cells that a block can be made of
BLOCK_TYPES = tuple(_ORDERS)

#: how a quadrangle or hexahedron is split: cells by their type and its corners; the corner 8 is its centre
Pattern = tuple[tuple[str, tuple[int, ...]], ...]
_KUHN = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))  # Kuhn, 1960
#: linear type -> the pattern of cells of that type alone
SPLITS: dict[str, Pattern] = {
    "TRIA3": (("TRIA3", (0, 1, 2)), ("TRIA3", (0, 2, 3))),
    "QUAD4": (("QUAD4", (0, 1, 2, 3)),),
    "TETRA4": tuple(("TETRA4", corners) for corners in _KUHN),
    "HEXA8": (("HEXA8", tuple(range(8))),),
    "PENTA6": (("PENTA6", (0, 1, 2, 4, 5, 6)), ("PENTA6", (0, 2, 3, 4, 6, 7))),
    "PYRAM5": tuple(("PYRAM5", (*facet.nodes[::-1], 8)) for facet in CELLS["HEXA8"].facets),
}
#: triangles along the other diagonal
LEFT: Pattern = (("TRIA3", (0, 1, 3)), ("TRIA3", (1, 2, 3)))


def block(kind: str, n: int, low: Sequence[float], high: Sequence[float]) -> Mesh:
    """A box of cells of type `kind`, n a side, its sides as groups; `low`, `high` (dim,) its corners.

    Raises ValueError for a type that blocks are not made of (`BLOCK_TYPES` are).

    >>> block("TETRA10", 2, (0, 0, 0), (1, 1, 1)).cells_by_type
    {'TETRA10': 48, 'TRIA6': 48}
    """
    if kind not in _ORDERS:
        raise ValueError(f"blocks are made of {', '.join(BLOCK_TYPES)}, not of {kind}")
    return boxed(kind, *grid((n,) * CELLS[kind].dim, low, high), low, high)


def boxed(
    kind: str, points: Floats, boxes: Ints, low: Sequence[float], high: Sequence[float],
    patterns: Sequence[Pattern] = (), which: Ints | None = None,
) -> Mesh:  # fmt: skip
    """A box of cells of type `kind` from the points and boxes of a grid, its sides as groups.

    `patterns` and `which` as `divided` takes them; by default the one pattern of cells of that type alone.
    """
    patterns = patterns or [SPLITS[CELLS[kind].linear]]
    points, cells = divided(points, boxes, patterns, np.zeros(len(boxes), int) if which is None else which)
    return with_sides(raised(Mesh.create(points, cells.items(), space_dim=len(low)), kind), low, high)


def raised(mesh: Mesh, kind: str) -> Mesh:
    """Replace linear cells by cells of the order of `kind`, one of `BLOCK_TYPES`."""
    order = _ORDERS[kind]
    higher = mesh if order is None else lacmesh.raise_order(mesh, order, surface="faces")
    return _centred(higher) if kind == "TRIA7" else higher


def _centred(mesh: Mesh) -> Mesh:
    """Convert TRIA6 to TRIA7."""
    nodes = np.concatenate([b.nodes for b in mesh.blocks if b.type == "TRIA6"])
    seven = np.column_stack([nodes, mesh.n_nodes + np.arange(len(nodes))])
    others = [(b.type, b.nodes) for b in mesh.blocks if b.type != "TRIA6"]
    points = np.concatenate([mesh.points, mesh.points[nodes[:, :3]].mean(axis=1)])
    return Mesh.create(points, [("TRIA7", seven), *others], space_dim=mesh.space_dim)


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


def assembled(points: Floats, rows: Mapping[tuple[str, str], Ints], dim: int) -> Mesh:
    """A mesh from the cells (k, n_nodes) of each type and group; those of the group "" are in none."""
    blocks: dict[str, list[Ints]] = defaultdict(list)
    for (kind, _), nodes in rows.items():
        blocks[kind].append(nodes)
    sizes = {kind: sum(map(len, parts)) for kind, parts in blocks.items()}
    first = dict(zip(sizes, np.cumsum([0, *sizes.values()])[:-1], strict=True))
    groups: dict[str, list[Ints]] = defaultdict(list)
    for (kind, name), nodes in rows.items():
        groups[name].append(first[kind] + np.arange(len(nodes)))
        first[kind] += len(nodes)
    joined = {name: np.concatenate(parts) for name, parts in groups.items() if name}
    cells = [(kind, np.concatenate(parts)) for kind, parts in blocks.items()]
    return Mesh.create(points, cells, space_dim=dim, cell_groups=joined)


def grid(counts: Sequence[int], low: Sequence[float], high: Sequence[float]) -> tuple[Floats, Ints]:
    """Points (., dim) and the corners of the quadrangles or hexahedra of a box, in the order of `CELLS`.

    `counts` (dim,): how many along each axis; the last axis goes fastest, of points and of cells.
    """
    dim, first = len(counts), np.asarray(low, dtype=float)
    axes = [np.arange(n + 1) / n for n in counts]
    unit = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    number = np.arange(len(unit)).reshape([n + 1 for n in counts])
    corners = (np.array(CELLS["QUAD4" if dim == 2 else "HEXA8"].reference) > 0).astype(int)
    cells = [number[tuple(slice(c, c + n) for c, n in zip(corner, counts, strict=True))].ravel() for corner in corners]
    return first + unit * (np.asarray(high, dtype=float) - first), np.stack(cells, axis=1)


def divided(points: Floats, boxes: Ints, patterns: Sequence[Pattern], which: Ints) -> tuple[Floats, dict[str, Ints]]:
    """Boxes (k, corners) split into cells: points, centres added where a pattern has them, and type -> nodes.

    `which` (k,): the place in `patterns` of the pattern of each box.
    """
    centred = np.array([any(8 in corners for _, corners in pattern) for pattern in patterns])[which]
    centre = np.zeros((len(boxes), 1), boxes.dtype)
    centre[centred, 0] = len(points) + np.arange(centred.sum())
    corners_of = np.concatenate([boxes, centre], axis=1)
    rows: dict[str, list[Ints]] = defaultdict(list)
    for k, pattern in enumerate(patterns):
        for kind, corners in pattern:
            rows[kind].append(corners_of[which == k][:, list(corners)])
    nodes_of = {kind: np.concatenate(parts) for kind, parts in rows.items()}
    cells = {kind: nodes for kind, nodes in nodes_of.items() if len(nodes)}
    return np.concatenate([points, points[boxes[centred]].mean(axis=1)]), cells


def with_sides(mesh: Mesh, low: Sequence[float], high: Sequence[float]) -> Mesh:
    """Add the sides of a box to its mesh: the facets of its cells in each side, as that side's group."""
    body = {(b.type, ""): b.nodes for b in mesh.blocks}
    return assembled(mesh.points, {**body, **_sides(mesh, low, high)}, mesh.space_dim)


def _sides(mesh: Mesh, low: Sequence[float], high: Sequence[float]) -> dict[tuple[str, str], Ints]:
    """(type, side) -> the facets (k, n_nodes) that lie in each side of the box."""
    sides: dict[tuple[str, str], list[Ints]] = defaultdict(list)
    for axis, ends in enumerate(zip(low, high, strict=True)):
        for end, value in enumerate(ends):
            there = np.abs(mesh.points[:, axis] - value) < 1e-9 * (ends[1] - ends[0])
            for cells in mesh.blocks:
                for facet in CELLS[cells.type].facets:
                    nodes = cells.nodes[:, list(facet.nodes)]
                    inside = there[nodes].all(axis=1)
                    if inside.any():
                        sides[facet.type, f"{'xyz'[axis]}{end}"].append(nodes[inside])
    return {key: np.concatenate(parts) for key, parts in sides.items()}
