"""Structured blocks of every cell type, their sides as groups, and a master skin beside them.

A block is n cells a side of a box: quadrangles or hexahedra, each split into the cells asked for, order raised by
lacmesh. Sides are groups x0, x1, y0, ...: the axis, and 0 for its lower end, 1 for its upper.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

import lacmesh
from lacmesh import CELLS, Mesh

Ints = NDArray[np.integer]
Floats = NDArray[np.floating]

#: type -> the linear type that it is raised from, and `raise_order`'s order (None: as it is)
_RAISED: dict[str, tuple[str, str | None]] = {
    "TRIA3": ("TRIA3", None), "TRIA6": ("TRIA3", "2"),
    "QUAD4": ("QUAD4", None), "QUAD8": ("QUAD4", "2"), "QUAD9": ("QUAD4", "2-full"),
    "TETRA4": ("TETRA4", None), "TETRA10": ("TETRA4", "2"),
    "HEXA8": ("HEXA8", None), "HEXA20": ("HEXA8", "2"), "HEXA27": ("HEXA8", "2-full"),
    "PENTA6": ("PENTA6", None), "PENTA15": ("PENTA6", "2"), "PENTA18": ("PENTA6", "2-full"),
    "PYRAM5": ("PYRAM5", None), "PYRAM13": ("PYRAM5", "2"), "PYRAM14": ("PYRAM5", "2-full"),
}  # fmt: skip
#: the cells that a block can be made of
BLOCK_TYPES = tuple(_RAISED)

#: linear type -> its cells by the corners of a quadrangle or hexahedron; 8 is the hexahedron's centre
_SPLITS: dict[str, tuple[tuple[int, ...], ...]] = {
    "TRIA3": ((0, 1, 2), (0, 2, 3)),
    "QUAD4": ((0, 1, 2, 3),),
    "TETRA4": ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)),  # Kuhn, 1960
    "HEXA8": (tuple(range(8)),),
    "PENTA6": ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)),
    "PYRAM5": tuple((*facet.nodes[::-1], 8) for facet in CELLS["HEXA8"].facets),
}


def block(kind: str, n: int, low: Sequence[float], high: Sequence[float]) -> Mesh:
    """A box of cells of type `kind`, n a side, its sides as groups; `low`, `high` (dim,) its corners.

    Raises ValueError for a type that blocks are not made of (`BLOCK_TYPES` are).

    >>> block("TETRA10", 2, (0, 0, 0), (1, 1, 1)).cells_by_type
    {'TETRA10': 48, 'TRIA6': 48}
    """
    if kind not in _RAISED:
        raise ValueError(f"blocks are made of {', '.join(BLOCK_TYPES)}, not of {kind}")
    linear, order = _RAISED[kind]
    dim = CELLS[kind].dim
    points, cells = _grid(n, np.asarray(low, dtype=float), np.asarray(high, dtype=float))
    if any(8 in nodes for nodes in _SPLITS[linear]):
        cells = np.column_stack([cells, len(points) + np.arange(len(cells))])
        points = np.concatenate([points, points[cells[:, :8]].mean(axis=1)])
    made = np.concatenate([cells[:, list(nodes)] for nodes in _SPLITS[linear]])
    mesh = Mesh.create(points, [(linear, made)], space_dim=dim)
    mesh = mesh if order is None else lacmesh.raise_order(mesh, order)
    return assembled(mesh.points, {(mesh.blocks[0].type, ""): mesh.blocks[0].nodes, **_sides(mesh, low, high)}, dim)


def with_master(mesh: Mesh, kind: str, points: Floats) -> Mesh:
    """The mesh and one cell more, of type `kind` with its nodes at `points` (n_nodes, dim): the group `master`."""
    own = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    rows: dict[tuple[str, str], Ints] = {}
    for name, cells in mesh.cell_groups.items():
        rows |= {(type_, name): nodes for type_, _, nodes in mesh.select(cells)}
    rows |= {(b.type, ""): b.nodes for b in mesh.blocks if CELLS[b.type].dim == mesh.space_dim}
    rows[kind, "master"] = mesh.n_nodes + np.arange(len(own))[None]
    return assembled(np.concatenate([mesh.points, own]), rows, mesh.space_dim)


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


def _grid(n: int, low: Floats, high: Floats) -> tuple[Floats, Ints]:
    """Points (., dim) and the corners of the n^dim quadrangles or hexahedra of a box, in the order of `CELLS`."""
    dim = len(low)
    unit = np.stack(np.meshgrid(*[np.arange(n + 1) / n] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    number = np.arange((n + 1) ** dim).reshape((n + 1,) * dim)
    corners = (np.array(CELLS["QUAD4" if dim == 2 else "HEXA8"].reference) > 0).astype(int)
    cells = [number[tuple(slice(c, c + n) for c in corner)].ravel() for corner in corners]
    return low + unit * (high - low), np.stack(cells, axis=1)


def _sides(mesh: Mesh, low: Sequence[float], high: Sequence[float]) -> dict[tuple[str, str], Ints]:
    """(type, side) -> the facets (k, n_nodes) that lie in each side of the box."""
    (cells,) = mesh.blocks
    found: dict[tuple[str, str], list[Ints]] = defaultdict(list)
    for axis, ends in enumerate(zip(low, high, strict=True)):
        for end, value in enumerate(ends):
            there = np.abs(mesh.points[:, axis] - value) < 1e-9 * (ends[1] - ends[0])
            for facet in CELLS[cells.type].facets:
                nodes = cells.nodes[:, list(facet.nodes)]
                inside = there[nodes].all(axis=1)
                if inside.any():
                    found[facet.type, f"{'xyz'[axis]}{end}"].append(nodes[inside])
    return {key: np.concatenate(parts) for key, parts in found.items()}
