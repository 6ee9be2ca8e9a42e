"""Losses of a mesh in a format: the mesh that was written is compared with the mesh that is read back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import some
from lacmesh.mesh import Floats, Ints, Mesh

_SOME = 6


class MeshMap(NamedTuple):
    """Index of each cell and node in the mesh read back, -1 if lost; `off`: largest node shift over the mesh's size."""

    cell: Ints
    node: Ints
    off: float


def match(before: Mesh, after: Mesh, tolerance: float = 1e-5) -> MeshMap | str:
    """Match two meshes whose cells are the same, type by type and in order; else a text that says what differs."""
    size = float(np.ptp(before.points, axis=0).max(initial=0)) if before.n_nodes else 0.0
    cell, node = np.full(before.n_cells, -1), np.full(before.n_nodes, -1)
    off = 0.0
    for cell_type in dict.fromkeys([*before.cells_by_type, *after.cells_by_type]):
        ours, theirs = _of_type(before, cell_type), _of_type(after, cell_type)
        if len(ours) != len(theirs):
            return f"{len(theirs)} {cell_type} of {len(ours)}"
        rows, others = before.block(cell_type), after.block(cell_type)
        away = _farthest(before.points[rows], after.points[others])
        if not away <= tolerance * size:
            return f"{cell_type} with other nodes"
        off = max(off, away)
        cell[ours] = theirs
        node[rows] = others
    if after.n_nodes == before.n_nodes:
        alone = np.flatnonzero(node < 0)
        there = _farthest(before.points[alone], after.points[alone]) <= tolerance * size
        node[alone] = alone if there else -1
    return MeshMap(cell, node, off / size if size else 0.0)


def _of_type(mesh: Mesh, cell_type: str) -> Ints:
    for k, block in enumerate(mesh.blocks):
        if block.type == cell_type:
            return np.arange(mesh.offsets[k], mesh.offsets[k + 1])
    return np.empty(0, np.int64)


def _farthest(a: Floats, b: Floats) -> float:
    return float(np.linalg.norm(a - b, axis=-1).max(initial=0.0))


def round_trip_losses(before: Mesh, after: Mesh, indices: MeshMap) -> list[str]:
    """Clauses that name what `after` has lost of `before`."""
    lost = []
    if indices.off > 1e-14:
        lost.append(f"digits of coordinates (moved by up to {indices.off:.0e} of the mesh's size)")
    if (indices.node < 0).any():
        lost.append(f"{int((indices.node < 0).sum())} nodes that no cell has")
    for what, groups, other, to in (
        ("cell groups", before.cell_groups, after.cell_groups, indices.cell),
        ("node groups", before.node_groups, after.node_groups, indices.node),
    ):
        gone = [name for name, members in groups.items() if not _same_group(to[members], other.get(name))]
        if gone:
            lost.append(f"the {what} {_names(gone)}")
    for what, number, other_number, to in (
        ("nodes", before.node_number, after.node_number, indices.node),
        ("cells", before.cell_number, after.cell_number, indices.cell),
    ):
        there = to >= 0
        if not np.array_equal(number[there], other_number[to[there]]):
            lost.append(f"the numbers of {what} (they are 1, 2, ...)")
    lost += _lost_data("cell", before.cell_data, after.cell_data, indices.cell)
    lost += _lost_data("node", before.node_data, after.node_data, indices.node)
    return lost + _lost_rest(before, after)


def _same_group(members: Ints, other: Ints | None) -> bool:
    return other is not None and np.array_equal(np.sort(members), np.sort(other))


def _names(names: list[str]) -> str:
    more = f" and {len(names) - _SOME} more" if len(names) > _SOME else ""
    return ", ".join(map(repr, names[:_SOME])) + more


def _lost_data(on: str, data: Mapping[str, NDArray], others: Mapping[str, NDArray], to: Ints) -> list[str]:
    gone, now_real, padded = [], [], []
    for name, values in data.items():
        other = others.get(name)
        there = to >= 0
        if other is not None and (values.shape[1:], other.shape[1:]) == ((2,), (3,)) and not other[:, 2].any():
            other = other[:, :2]
            padded.append(name)
        same = other is not None and other.shape[1:] == values.shape[1:]
        if other is None or not same or not _same_values(values[there], other[to[there]]):
            gone.append(name)
        elif values.dtype.kind in "iu" and other.dtype.kind == "f":
            now_real.append(name)
    lost = [f"the {on} data {_names(gone)}"] if gone else []
    lost += [f"that the {on} data {_names(now_real)} are integers"] if now_real else []
    flat = [name for name in padded if name not in gone]
    return lost + ([f"that the {on} data {_names(flat)} have 2 components (a third, 0, is added)"] if flat else [])


def _same_values(a: NDArray, b: NDArray) -> bool:
    if a.dtype.kind not in "iufb" or b.dtype.kind not in "iufb":
        return False
    scale = float(np.nanmax(np.abs(a), initial=0.0)) if a.dtype.kind == "f" else 0.0
    return bool(np.allclose(a.astype(float), b.astype(float), rtol=1e-6, atol=1e-9 * scale, equal_nan=True))


def _lost_rest(before: Mesh, after: Mesh) -> list[str]:
    lost = []
    if before.zones and before.zones != after.zones:
        lost.append(f"the names of the zones {_names(list(before.zones))}")
    if before.name not in ("mesh", after.name):
        lost.append(f"the mesh's name {before.name!r}")
    if before.space_dim != after.space_dim:
        lost.append(f"that the mesh has {before.space_dim} dimensions")
    if before.steps and before.steps != after.steps:
        lost.append("the times of steps")
    if before.group_tags and before.group_tags != after.group_tags:
        lost.append("the tags of groups")
    if before.model is not None and before.model.periodic and not (after.model and after.model.periodic):
        lost.append("periodic links")
    if before.file_order is not None and _types(before) != _types(after):
        lost.append("the order of cells of different types")
    return lost


def _types(mesh: Mesh) -> list[Any]:
    """The types of the cells in the order of the file."""
    types = np.repeat([b.type for b in mesh.blocks], np.diff(mesh.offsets))
    return (types if mesh.file_order is None else types[mesh.file_order]).tolist()


def misplaced_mid_nodes(mesh: Mesh) -> str:
    """Text that names cells with misplaced mid-nodes, the sign of a wrong node order; "" if there are none.

    A mid-node is misplaced if it is farther from the middle of its edge than half the edge's length.
    """
    wrong = []
    for block in mesh.blocks:
        cell = ALL_CELLS[block.type]
        if cell.order != 2 or not len(block.nodes) or cell.dim < 2:
            continue
        x = mesh.points[block.nodes]
        a, b = (x[:, [edge[k] for edge in cell.edges]] for k in (0, 1))
        middle = x[:, cell.n_corners : cell.n_corners + len(cell.edges)]
        far = np.linalg.norm(middle - (a + b) / 2, axis=2) > 0.5 * np.linalg.norm(b - a, axis=2)
        k = [other.type for other in mesh.blocks].index(block.type)
        bad = np.flatnonzero(far.any(axis=1)) + mesh.offsets[k]
        if len(bad):
            wrong.append(f"{block.type} {some(mesh.cell_number[bad], 3)}")
    return ", ".join(wrong)
