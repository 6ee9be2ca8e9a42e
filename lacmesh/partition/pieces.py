"""Pieces of a mesh: the nodes and cells that each rank needs, and the cells of each skin with those that touch it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints, Mesh, mask_of
from lacmesh.partition.parts import cells_of_skins, nodes_of


@dataclass(frozen=True)
class PieceIndices:
    """Indices of nodes or of cells, piece after piece, ascending in each; piece p has `index[start[p] : start[p + 1]]`.

    `start` (n_pieces + 1,).
    """

    index: Ints
    start: Ints

    def count(self, chosen: NDArray[np.bool_]) -> Ints:
        """(n_pieces + 1,): how many of the `chosen` (k,), a mask on `index`, come before each piece, and in all."""
        return np.concatenate([[0], np.cumsum(chosen)])[self.start]


def pieces_of(mesh: Mesh, owner: Ints) -> tuple[tuple[str, ...], PieceIndices, PieceIndices]:
    """Return the names of the skins of a mesh, and its pieces, those of nodes and those of cells.

    There is one for each rank, as by `part_of`, then one for each skin. `owner` (n_nodes,): the rank that owns each
    node. A skin is a group without cells of the highest dimension; in a mesh without groups, an entity of msh.
    """
    n_ranks = int(owner.max(initial=0)) + 1
    skins = tuple(name for name in mesh.cell_groups if mesh.group_dim(name) < mesh.dim)
    if not mesh.cell_groups:
        skins = tuple(f"entity:{dim}:{tag}" for dim, tag in mesh.entities if dim < mesh.dim)
    node, cell = _of_ranks(mesh, owner, n_ranks)
    around = cells_of_skins(mesh, skins)
    under: list[Ints] = []
    for cells in around:
        mask = mask_of(mesh.n_cells, cells)
        under.append(np.flatnonzero(nodes_of(mesh, mask)))
    return skins, _joined(node, under), _joined(cell, around)


def cells_of_ranks(mesh: Mesh, owner: Ints, n_ranks: int, everywhere: Ints) -> PieceIndices:
    """Return the cells that each rank needs: those at its own nodes, and the cells `everywhere` (k,)."""
    _, cell = _of_ranks(mesh, owner, n_ranks)
    needed = [np.union1d(cell.index[first:last], everywhere) for first, last in pairwise(cell.start)]
    return PieceIndices(np.concatenate(needed), np.cumsum([0, *map(len, needed)]))


def _of_ranks(mesh: Mesh, owner: Ints, n_ranks: int) -> tuple[PieceIndices, PieceIndices]:
    """Return the nodes and the cells that each rank needs: cells at its own nodes, its own nodes and all of theirs."""
    nodes: list[Ints] = [_pairs(owner, np.arange(mesh.n_nodes), mesh.n_nodes)]
    cells: list[Ints] = [np.empty(0, np.int64)]
    for block, first in zip(mesh.blocks, mesh.offsets, strict=False):
        low, high = _range_of_owners(owner, block.nodes)
        alone, shared = np.flatnonzero(low == high), np.flatnonzero(low < high)
        pairs = _distinct(_pairs(owner[block.nodes[shared]], shared[:, None], len(low)))
        rank, cell = np.divmod(pairs, max(len(low), 1))
        cells += [_pairs(low[alone], first + alone, mesh.n_cells), _pairs(rank, first + cell, mesh.n_cells)]
        around = block.nodes[cell]
        nodes.append(_distinct(_pairs(rank[:, None], around, mesh.n_nodes)[owner[around] != rank[:, None]]))
    return _by_rank(nodes, n_ranks, mesh.n_nodes), _by_rank(cells, n_ranks, mesh.n_cells)


def _range_of_owners(owner: Ints, nodes: Ints) -> tuple[Ints, Ints]:
    """Return the lowest and the highest rank (k,) that owns a node of each cell; `nodes` (k, m)."""
    low = owner[nodes[:, 0]]
    high = low.copy()
    for column in nodes.T[1:]:
        of_column = owner[column]
        np.minimum(low, of_column, out=low)
        np.maximum(high, of_column, out=high)
    return low, high


def _pairs(rank: Ints, index: Ints, size: int) -> Ints:
    """Return the pairs of a rank and an index below `size` as one number each, in the order of both."""
    return rank.astype(np.int64) * size + index


def _distinct(numbers: Ints) -> Ints:
    """Return some numbers, ascending, each once; quicker than np.unique, which hashes."""
    ascending = np.sort(numbers, axis=None)
    return ascending[np.diff(ascending, prepend=-1) > 0]


def _by_rank(pairs: list[Ints], n_ranks: int, size: int) -> PieceIndices:
    """Return the indices in some pairs, rank by rank; pairs that occur in several lists count once."""
    joined = _distinct(np.concatenate(pairs))
    start = np.searchsorted(joined, np.arange(n_ranks + 1) * size)
    return PieceIndices(joined % max(size, 1), start)


def _joined(members: PieceIndices, more: list[Ints]) -> PieceIndices:
    """Return the members of the ranks, followed by those of further pieces."""
    ends = members.start[-1] + np.cumsum([len(index) for index in more], dtype=np.int64)
    return PieceIndices(np.concatenate([members.index, *more]), np.concatenate([members.start, ends]))
