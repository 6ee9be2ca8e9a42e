"""The facets of all cells, each paired with the facet of the neighbouring cell by a compiled hash table, in O(n).

A facet is identified by its sorted corners. Facet j of cell k has the number `FACETS k + j`; `twin` gives the number of
the same facet in the neighbouring cell, ALONE if there is none, CROWDED if there are several (non-manifold).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.kernels import kernel
from lacmesh.mesh import Ints, Mesh
from lacmesh.topology.skin import label_rows

Array = NDArray[Any]
#: at most so many facets a cell has
FACETS = 6
CORNERS = 8
#: cells for which sorting takes less time than loading the kernel
_FEW = 50_000
ALONE, CROWDED, ABSENT = -1, -2, -3
_FAMILIES = ("TRIA", "QUAD", "TETRA", "HEXA", "PENTA", "PYRAM")


@dataclass(frozen=True)
class Solid:
    """The cells of the mesh's dimension: `cells` (k,) indices, `corners` (k, 8) padded with -1, `family` (k,)."""

    cells: Ints
    corners: Ints
    family: Ints

    def take(self, rows: Ints) -> Solid:
        """Some of the cells."""
        return Solid(self.cells[rows], self.corners[rows], self.family[rows])

    def copies(self) -> Ints:
        """Rows of duplicate cells: those with the same corners as an earlier one."""
        labels, count = label_rows(np.sort(self.corners, axis=1) + 1)
        first = np.full(count, len(labels))
        np.minimum.at(first, labels, np.arange(len(labels)))
        return np.setdiff1d(np.arange(len(labels)), first)

    @classmethod
    def of(cls, mesh: Mesh) -> Solid:
        """Return all cells of the highest dimension, by their corners; those of order 3 and higher are included."""
        wide = mesh.n_nodes > np.iinfo(np.int32).max // 2 or mesh.n_cells * FACETS > np.iinfo(np.int32).max
        dtype = np.int64 if wide else np.int32
        mine = [k for k, b in enumerate(mesh.blocks) if ALL_CELLS[b.type].dim == mesh.dim > 1]
        size = sum(len(mesh.blocks[k].nodes) for k in mine)
        corners = np.full((size, CORNERS), -1, dtype)
        cells: Ints = np.empty(size, dtype)
        family: Ints = np.empty(size, np.int8)
        start = 0
        for k in mine:
            kind, nodes = mesh.blocks[k]
            cell = ALL_CELLS[kind]
            rows = slice(start, start + len(nodes))
            corners[rows, : cell.n_corners] = nodes[:, : cell.n_corners]
            cells[rows] = np.arange(mesh.offsets[k], mesh.offsets[k + 1])
            family[rows] = _FAMILIES.index(cell.family)
            start += len(nodes)
        return cls(cells, corners, family)


@dataclass(frozen=True)
class Facets:
    """The cells of a mesh, each once, and their paired facets (`find_twins`); `copies`: the duplicate cells."""

    solid: Solid
    twin: Ints
    same: NDArray[np.bool_]
    copies: Ints

    @classmethod
    def of(cls, mesh: Mesh) -> Facets:
        """Return all facets of the cells of the highest dimension."""
        solid = Solid.of(mesh)
        find = find_twins_plain if len(solid.cells) <= _FEW else find_twins
        twin, same = find(solid)
        copies: Ints = np.empty(0, np.int64)
        if same.any() or (twin == CROWDED).any():  # a copy shares its facets, which shows here
            copies = solid.copies()
        if len(copies):
            cells = solid.cells[copies]
            solid = solid.take(np.setdiff1d(np.arange(len(solid.cells)), copies))
            return cls(solid, *find(solid), cells)
        return cls(solid, twin, same, copies)

    @property
    def boundary(self) -> tuple[Ints, Ints]:
        """(rows of `solid`, facet numbers) of the boundary facets, which belong to one cell only."""
        alone = np.flatnonzero(self.twin == ALONE)
        return alone // FACETS, alone % FACETS

    def corners(self, rows: Ints, facet: Ints) -> Ints:
        """(k, 4): the corners of some facets, in the order of their cells, padded with -1."""
        places = FACET_TABLE[self.solid.family[rows], facet].astype(np.int64)
        corners = np.take_along_axis(self.solid.corners[rows], np.maximum(places, 0), axis=1)
        return np.where(places < 0, -1, corners).astype(np.int64)


def _table() -> NDArray[np.int8]:
    """(families, FACETS, 4): local corners of each facet, padded with -1."""
    table = np.full((len(_FAMILIES), FACETS, 4), -1, np.int8)
    for row, family in enumerate(_FAMILIES):
        cell = next(c for c in CELLS.values() if c.family == family and c.order == 1)
        for j, facet in enumerate(cell.facets):
            table[row, j, : len(facet.nodes)] = facet.nodes
    return table


FACET_TABLE = _table()


def find_twins(solid: Solid) -> tuple[Ints, NDArray[np.bool_]]:
    """(twin (k FACETS,), same (k FACETS,)): the facet on the other side of each, True if it has the same winding.

    The facets of two cells on opposite sides have opposite windings; `same` is False where there is no twin.
    """
    twin, forward = _hash_facets(solid.corners, solid.family, FACET_TABLE)
    paired = twin >= 0
    same = np.zeros(len(twin), bool)
    same[paired] = forward[paired] == forward[twin[paired]]
    return twin, same


def find_twins_plain(solid: Solid) -> tuple[Ints, NDArray[np.bool_]]:
    """Pair the facets by sorting: the reference for `find_twins`, half as fast, and used for few cells."""
    ids, rows = [], []
    for f in range(len(_FAMILIES)):
        mine = np.flatnonzero(solid.family == f)
        for j in range(FACETS):
            places = FACET_TABLE[f, j][FACET_TABLE[f, j] >= 0]
            if len(places) and len(mine):
                ids.append(mine * FACETS + j)
                rows.append(np.pad(solid.corners[mine][:, places], ((0, 0), (0, 4 - len(places))), constant_values=-1))
    twin = np.full(len(solid.cells) * FACETS, ABSENT, np.int64)
    forward = np.zeros(len(twin), bool)
    if not ids:
        return twin, forward
    number, listed = np.concatenate(ids), np.concatenate(rows)
    labels, count = label_rows(np.sort(listed, axis=1) + 1)
    size = np.bincount(labels, minlength=count)
    order = np.argsort(labels, kind="stable")
    twin[number] = np.where(size[labels] > 2, CROWDED, ALONE)
    pairs = number[order[(size == 2)[labels[order]]]].reshape(-1, 2)
    twin[pairs[:, 0]], twin[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    n = (listed >= 0).sum(axis=1)
    at = np.where(listed >= 0, listed, solid.corners.max() + 1).argmin(axis=1)
    every = np.arange(len(listed))
    forward[number] = np.where(
        n == 2, listed[:, 0] < listed[:, 1], listed[every, (at + 1) % n] > listed[every, (at - 1) % n]
    )
    paired = twin >= 0
    same = np.zeros(len(twin), bool)
    same[paired] = forward[paired] == forward[twin[paired]]
    return twin, same


@kernel
def _sorted_corners(corners: Array, table: Array, cell: int, family: int, j: int, out: Array) -> int:
    """Write the sorted corners of a facet into out (4,), padded with -1; return their number."""
    n = 0
    for k in range(4):
        place = table[family, j, k]
        if place < 0:
            break
        value = corners[cell, place]
        i = n
        while i > 0 and out[i - 1] > value:
            out[i] = out[i - 1]
            i -= 1
        out[i] = value
        n += 1
    for k in range(n, 4):
        out[k] = -1
    return n


@kernel
def _goes_forward(corners: Array, table: Array, cell: int, family: int, j: int, n: int) -> bool:
    """Winding of a facet: True if it goes from its lowest corner towards the larger of the two corners beside it."""
    if n == 2:
        return corners[cell, table[family, j, 0]] < corners[cell, table[family, j, 1]]
    least = 0
    for k in range(1, n):
        if corners[cell, table[family, j, k]] < corners[cell, table[family, j, least]]:
            least = k
    after = corners[cell, table[family, j, (least + 1) % n]]
    before = corners[cell, table[family, j, (least + n - 1) % n]]
    return after > before


@kernel
def _hash_facets(corners: Array, family: Array, table: Array) -> tuple[Array, Array]:
    n_cells = len(corners)
    bits = 4
    while (1 << bits) < 2 * FACETS * n_cells:
        bits += 1
    slots = np.full(1 << bits, -1, corners.dtype)
    mask = np.uint64((1 << bits) - 1)
    twin = np.full(n_cells * FACETS, ABSENT, corners.dtype)
    forward = np.zeros(n_cells * FACETS, np.bool_)
    mine, other = np.empty(4, np.int64), np.empty(4, np.int64)
    for cell in range(n_cells):
        for j in range(FACETS):
            n = _sorted_corners(corners, table, cell, family[cell], j, mine)
            if n == 0:
                break
            number = cell * FACETS + j
            forward[number] = _goes_forward(corners, table, cell, family[cell], j, n)
            # finalizer of splitmix64 over the corners (Steele, Lea, Flood, OOPSLA 2014)
            key = np.uint64(0)
            for k in range(n):
                key ^= np.uint64(mine[k]) + np.uint64(0x9E3779B97F4A7C15)
                key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
                key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
                key ^= key >> np.uint64(31)
            at = key & mask
            twin[number] = ALONE
            while slots[at] >= 0:
                there = slots[at]
                owner = there // FACETS
                m = _sorted_corners(corners, table, owner, family[owner], there - owner * FACETS, other)
                if (
                    m == n
                    and mine[0] == other[0]
                    and mine[1] == other[1]
                    and mine[2] == other[2]
                    and mine[3] == other[3]
                ):
                    if twin[there] == ALONE:
                        twin[there], twin[number] = number, there
                    else:
                        if twin[there] >= 0:
                            twin[twin[there]] = CROWDED
                        twin[there] = twin[number] = CROWDED
                    break
                at = (at + np.uint64(1)) & mask
            if slots[at] < 0:
                slots[at] = number
    return twin, forward


def find_bodies(solid: Solid, n_nodes: int) -> Ints:
    """(n_nodes,): the body of each node, numbered from 0 by their first nodes; -1 for nodes of no cell."""
    return _unite(solid.corners, n_nodes)


def find_bodies_plain(solid: Solid, n_nodes: int) -> Ints:
    """Label the bodies with scipy: the reference for `find_bodies`, which is compiled."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    cell, place = np.nonzero(solid.corners >= 0)
    node = solid.corners[cell, place]
    size = n_nodes + len(solid.corners)
    graph = coo_matrix((np.ones(len(node), bool), (node, n_nodes + cell)), shape=(size, size))
    labels = connected_components(graph, directed=False)[1][:n_nodes]
    used = np.zeros(n_nodes, bool)
    used[node] = True
    out = np.full(n_nodes, -1, np.int64)
    values, first, inverse = np.unique(labels[used], return_index=True, return_inverse=True)
    rank = np.empty(len(values), np.int64)
    rank[np.argsort(first)] = np.arange(len(values))
    out[used] = rank[inverse]
    return out


@kernel
def _root(parent: Array, node: int) -> int:
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@kernel
def _unite(corners: Array, n_nodes: int) -> Array:
    parent = np.full(n_nodes, -1, np.int64)
    for cell in range(len(corners)):
        first = corners[cell, 0]
        if parent[first] < 0:
            parent[first] = first
        a = _root(parent, first)
        for k in range(1, CORNERS):
            node = corners[cell, k]
            if node < 0:
                break
            if parent[node] < 0:
                parent[node] = a
                continue
            b = _root(parent, node)
            if b < a:
                parent[a] = b
                a = b
            else:
                parent[b] = a
    body = np.full(n_nodes, -1, np.int64)
    count = 0
    for node in range(n_nodes):
        if parent[node] < 0:
            continue
        root = _root(parent, node)
        if body[root] < 0:
            body[root] = count
            count += 1
        body[node] = body[root]
    return body
