"""Parts of a mesh for output: the bodies, the slave skin of a zone, or the whole mesh, each as a mesh of its own.

The bodies are the cells that carry displacements, and rigid surfaces without parent cells. Cells and nodes keep the
numbers of the file, the groups and the records of a cut; other data of the mesh's file are not repeated. PYRAM14, which
neither VTK nor MED has, becomes PYRAM13 without the centre of its base, with a warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD
from lacmesh.errors import LacmeshWarning
from lacmesh.mesh import Ints, Mesh, concatenated, places_of
from lacmesh.surface import Surface
from lacsolver.space.space import Space


class Part(NamedTuple):
    """Some cells of a mesh as a mesh; `nodes` and `cells`: indices of its nodes and cells in the whole mesh."""

    mesh: Mesh
    nodes: Ints
    cells: Ints


class _Rows(NamedTuple):
    """Cells of one type: the type, their nodes (k, n) and indices (k,) in the whole mesh."""

    type: str
    nodes: Ints
    cells: Ints


def body(space: Space) -> Part:
    """Return the cells that carry displacements, and skin cells with a node that belongs to no such cell.

    Of several processes each returns its own cells, with all groups, empty ones too.
    """
    mesh = space.mesh
    own = [space.own_cells(block) for block in space.blocks]
    rows = [_Rows(b.type, b.nodes[here], b.cell[here]) for b, here in zip(space.blocks, own, strict=True)]
    for k, (kind, nodes) in enumerate(mesh.blocks):
        index = np.arange(mesh.offsets[k], mesh.offsets[k + 1])
        bare = (mesh.cell_dim[index] == space.dim - 1) & ~space.attached[nodes].all(axis=1)
        bare &= np.ones(len(nodes), bool) if space.share.own is None else space.share.own[nodes[:, 0]]
        if bare.any():
            rows.append(_Rows(kind, nodes[bare], index[bare]))
    if space.share.own is None:
        return _part(mesh, rows)
    cells, part = np.zeros(mesh.n_cells, bool), _part(mesh, rows, all_groups=True)
    cells[part.cells] = True
    some = {name for name, ids in mesh.cell_groups.items() if space.share.total(np.array(int(cells[ids].sum())))}
    return part._replace(mesh=replace(part.mesh, cell_groups={k: part.mesh.cell_groups[k] for k in sorted(some)}))


def skin(mesh: Mesh, surface: Surface) -> Part:
    """Return the faces of a surface, in the order of `Surface.by_type`; `cells` are rows of the surface."""
    rows = [_Rows(kind, nodes, surface.cell[at]) for kind, at, nodes in surface.by_type()]
    order = [at for _, at, _ in surface.by_type()]
    return _part(mesh, rows)._replace(cells=concatenated(order))


def whole(mesh: Mesh) -> Part:
    """Return all cells and nodes."""
    index = [np.arange(lo, lo + len(b.nodes)) for b, lo in zip(mesh.blocks, mesh.offsets[:-1], strict=True)]
    rows = [_Rows(*block, at) for block, at in zip(mesh.blocks, index, strict=True)]
    return _part(mesh, rows, all_nodes=True)


def _part(mesh: Mesh, rows: Iterable[_Rows], all_nodes: bool = False, all_groups: bool = False) -> Part:
    rows = _storable([r for r in rows if len(r.cells)])
    used = np.full(mesh.n_nodes, all_nodes)
    for r in rows:
        used[r.nodes] = True
    nodes = np.flatnonzero(used)
    place = np.cumsum(used) - 1
    cells = concatenated(r.cells for r in rows)
    restricted = Mesh.create(
        mesh.points[nodes],
        [(r.type, place[r.nodes]) for r in rows],
        space_dim=mesh.space_dim,
        node_number=mesh.node_number[nodes],
        cell_number=mesh.cell_number[cells],
        cell_groups=_groups(mesh.cell_groups, cells, mesh.n_cells, all_groups),
        node_groups=_groups(mesh.node_groups, nodes, mesh.n_nodes, all_groups),
        cell_data={name: mesh.cell_data[name][cells] for name in CELL_RECORDS if name in mesh.cell_data},
        node_data={name: mesh.node_data[name][nodes] for name in (NODE_RECORD,) if name in mesh.node_data},
        zones=mesh.zones,
        name=mesh.name,
    )
    return Part(restricted, nodes, cells)


def _storable(rows: list[_Rows]) -> list[_Rows]:
    """Return one entry per type of cell, with PYRAM14 turned into PYRAM13."""
    by_type: dict[str, list[_Rows]] = {}
    for r in rows:
        if r.type == "PYRAM14":
            message = f"{len(r.cells)} PYRAM14 are written as PYRAM13, without the centre of their base"
            warnings.warn(LacmeshWarning(message), stacklevel=5)
            r = _Rows("PYRAM13", r.nodes[:, :13], r.cells)
        by_type.setdefault(r.type, []).append(r)
    return [
        _Rows(kind, np.concatenate([r.nodes for r in same]), np.concatenate([r.cells for r in same]))
        for kind, same in by_type.items()
    ]


def _groups(groups: Mapping[str, Ints], members: Ints, size: int, empty: bool = False) -> dict[str, Ints]:
    """Return the groups restricted to some members of the whole, as indices into these; `empty` ones too, or not."""
    place = places_of(members, size)
    members_of = {name: place[ids][place[ids] >= 0] for name, ids in groups.items()}
    return {name: np.sort(ids) for name, ids in members_of.items() if len(ids) or empty}


def on_faces(values: NDArray, macro: Ints, missing: float) -> NDArray:
    """Return values of macro-elements (n, ...) on their faces (n_faces, ...), `missing` for faces of none."""
    out = np.full((len(macro), *values.shape[1:]), missing, values.dtype)
    out[macro >= 0] = values[macro[macro >= 0]]
    return out
