"""Digest of a mesh as it is in memory: its points, its cells, the records of its cut, and some of its groups.

Processes that have parts of a mesh make its digest together, which is the one that a process with the whole mesh
makes: it is of sums of hashes of rows, which are the same whoever adds which rows, in whatever order. The hash of a row
depends on the name of the array, on the index of the row, and on every value in its place. It is made of the finaliser
of SplitMix64, a bijection of 64 bits: Steele, Lea, Flood, Fast splittable pseudorandom number generators, OOPSLA 2014,
with the constants of Stafford's variant 13. Two sums from different seeds have 128 bits.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import GroupNotFoundError
from lacmesh.mesh import Ints, Mesh
from lacsolver.distributed.share import ALONE, Share

#: rows that are hashed at once, so that their hashes stay in a core's cache
ROWS = 1 << 13
#: 2^64 over the golden ratio: what SplitMix64 counts by
_STEP = np.uint64(0x9E3779B97F4A7C15)
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31))
_FACTORS = (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))


def mesh_digest(groups: Sequence[str], mesh: Mesh, share: Share = ALONE) -> str:
    """Return the digest of a mesh with some of its groups, or that of the whole mesh of which it is the `share`."""
    sums = np.zeros(2, np.uint64)
    for name, index, values in _rows(groups, mesh, share):
        sums += row_sums(name, index, values)
    return hashlib.sha256(f"{list(mesh.zones)} {share.total(sums).tolist()}".encode()).hexdigest()[:32]


def _rows(groups: Sequence[str], mesh: Mesh, share: Share) -> Iterator[tuple[str, Ints, NDArray]]:
    """Yield rows of the arrays that a solution depends on: the array's name, their indices in the whole mesh, values.

    They come in pieces, so that no array is copied as a whole. A process has the rows of its own nodes, and of the
    cells whose first nodes are its own.
    """

    def indices(rows: Ints, of_part: Ints | None) -> Ints:
        return rows if of_part is None else of_part[rows]

    node, cell, own = share.node, share.cell, share.own
    for rows in _pieces(own, mesh.n_nodes):
        yield "points", indices(rows, node), mesh.points[rows]
    ours = []
    for block, first in zip(mesh.blocks, mesh.offsets, strict=False):
        mine = None if own is None else own[block.nodes[:, 0]]
        ours.append(mine)
        for rows in _pieces(mine, len(block.nodes)):
            yield f"cells {block.type}", indices(first + rows, cell), indices(block.nodes[rows], node)
    of_cells = None if own is None else np.concatenate([np.empty(0, bool), *ours])
    for name in ("lac_macro", "lac_zone"):
        for rows in _pieces(of_cells, mesh.n_cells) if name in mesh.cell_data else ():
            yield f"record {name}", indices(rows, cell), mesh.cell_data[name][rows, None]
    for name, members in _groups(groups, mesh):
        mine, whole = (own, node) if name.startswith("node group") else (of_cells, cell)
        counted = members if mine is None else members[mine[members]]
        yield name, indices(counted, whole), np.empty((len(counted), 0), np.int64)


def _pieces(mine: NDArray[np.bool_] | None, n: int) -> Iterator[Ints]:
    """Yield the rows of a mask (n,), or all n, in pieces."""
    for start in range(0, n, ROWS):
        rows = np.arange(start, min(start + ROWS, n))
        yield rows if mine is None else rows[mine[rows]]


def _groups(groups: Sequence[str], mesh: Mesh) -> Iterator[tuple[str, Ints]]:
    """Yield the members of groups, with a name for each."""
    for name in groups:
        with suppress(GroupNotFoundError):  # then it is one of nodes
            yield f"cell group {name}", mesh.cells_of(name)
        if name in mesh.node_groups:
            yield f"node group {name}", mesh.node_groups[name]


def row_sums(name: str, index: Ints, values: NDArray) -> NDArray[np.uint64]:
    """Return the sums (2,), modulo 2^64, of the hashes of some rows of an array.

    `name`: that of the array; `index` (k,): the indices of the rows in the whole of it; `values` (k, m): the rows.
    Integers count by their values, reals by their bits, -0.0 as 0.0.

    >>> first, last = row_sums("x", np.array([0]), np.array([[7]])), row_sums("x", np.array([1]), np.array([[8]]))
    >>> np.array_equal(row_sums("x", np.array([1, 0]), np.array([[8], [7]])), first + last)
    True
    """
    seed = np.frombuffer(hashlib.sha256(name.encode()).digest(), "<u8", 2).astype(np.uint64)
    sums = np.zeros(2, np.uint64)
    for start in range(0, len(index), ROWS):
        rows = slice(start, start + ROWS)
        columns = np.ascontiguousarray(_bits(values[rows]).T)
        for lane in range(2):
            sums[lane : lane + 1] += _hashes(index[rows].astype(np.uint64) * _STEP + seed[lane], columns).sum()
    return sums


def _bits(values: NDArray) -> NDArray[np.uint64]:
    """Return values as 64 bits each."""
    if values.dtype.kind == "f":
        return (values.astype(np.float64) + 0.0).view(np.uint64)
    return values.astype(np.int64).view(np.uint64)


def _hashes(h: NDArray[np.uint64], columns: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the hashes (k,) of rows of columns (m, k), which are written into their first values h (k,)."""
    scratch = np.empty_like(h)
    mix(h, scratch)
    for column in columns:
        h ^= column
        mix(h, scratch)
    return h


def mix(z: NDArray[np.uint64], scratch: NDArray[np.uint64]) -> None:
    """Apply the finaliser of SplitMix64 to numbers z (k,) in place; `scratch` (k,) is written into."""
    for shift, factor in zip(_SHIFTS[:2], _FACTORS, strict=True):
        np.right_shift(z, shift, out=scratch)
        z ^= scratch
        z *= factor
    np.right_shift(z, _SHIFTS[2], out=scratch)
    z ^= scratch
