"""Digest of a mesh as it is in memory: its points, its cells, the records of its cut, and some of its groups.

Processes that have parts of a mesh make its digest together, which is the one that a process with the whole mesh makes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import GroupNotFoundError
from lacmesh.mesh import Ints, Mesh
from lacsolver.case.row_sums import ROWS, row_sums
from lacsolver.distributed.share import ALONE, Share

#: how the digest begins; that of an older version, which processes with parts could not make, does not
BY_ROWS = "rows:"


def mesh_digest(groups: Sequence[str], mesh: Mesh, share: Share = ALONE) -> str:
    """Return the digest of a mesh with some of its groups, or that of the whole mesh of which it is the `share`."""
    sums = np.zeros(2, np.uint64)
    for name, index, values in _rows(groups, mesh, share):
        sums += row_sums(name, index, values)
    return BY_ROWS + hashlib.sha256(f"{list(mesh.zones)} {share.total(sums).tolist()}".encode()).hexdigest()[:32]


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


def older_mesh_digest(groups: Sequence[str], mesh: Mesh) -> str:
    """Return the digest of a mesh as versions before `BY_ROWS` made it, of whole arrays."""
    digest = hashlib.sha256(f"zones {mesh.zones}".encode())
    arrays = [("points", mesh.points + 0.0), *((f"cells {block.type}", block.nodes) for block in mesh.blocks)]
    records = (name for name in ("lac_macro", "lac_zone") if name in mesh.cell_data)
    arrays += [(f"record {name}", mesh.cell_data[name]) for name in records]
    for name, values in (*arrays, *_groups(groups, mesh)):
        digest.update(f"{name} {values.shape}".encode())
        digest.update(values.astype("float64" if name == "points" else "int64").tobytes())
    return digest.hexdigest()[:32]
