"""Meshes made of others: several joined, with more groups, with other names of groups, some groups alone.

These are `lacmesh.join` and the methods `with_groups`, `renamed` and `only` of a mesh.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS
from lacmesh.errors import GroupNotFoundError, RequestError
from lacmesh.mesh import Block, Floats, Ints, Mesh, mask_of, places_of
from lacmesh.topology.facets import FACETS, Facets, boundary_faces
from lacmesh.topology.skin import FACE_TYPES, N_NODES, FaceIncidence, Faces, cells_of_dim, facets_of, find_repeats

Bools = NDArray[np.bool_]
#: a condition on points x (3, n), true or false for each
Condition = Callable[[Floats], Any]
#: what `with_groups` makes groups of
MEMBERS = ("faces", "inner", "cells", "nodes")


def join(*meshes: Mesh) -> Mesh:
    """Join meshes into one, which has the cells, nodes and groups of all; no nodes are merged.

    Groups of one name become one group. Nodes are numbered anew, mesh after mesh, and cells type by type. Data that
    some meshes lack are NaN there, or -1 if they are integers. Tags and entities of gmsh are left out. Raises
    RequestError without meshes, for a mesh that carries a cut, and for data of one name that have different shapes.

    >>> from lacmesh.generate import box
    >>> two = join(box(2), box(2).moved((3, 0, 0)).renamed(body="second"))
    >>> two.n_nodes, {name: len(cells) for name, cells in two.cell_groups.items() if name in ("body", "second", "top")}
    (54, {'body': 8, 'top': 8, 'second': 8})
    """
    if not meshes:
        raise RequestError("no mesh was given to join; give one or more")
    if any(mesh.zones for mesh in meshes):
        raise RequestError("one of the meshes to join carries a cut; join the meshes, then cut")
    first = np.cumsum([0, *(mesh.n_nodes for mesh in meshes)])
    nodes = [start + np.arange(mesh.n_nodes) for start, mesh in zip(first, meshes, strict=False)]
    blocks, cells = _blocks(meshes, first.tolist())
    return Mesh.create(
        np.concatenate([mesh.points for mesh in meshes]),
        blocks,
        space_dim=max(mesh.space_dim for mesh in meshes),
        cell_groups=_united([mesh.cell_groups for mesh in meshes], cells),
        node_groups=_united([mesh.node_groups for mesh in meshes], nodes),
        cell_data=_data([mesh.cell_data for mesh in meshes], cells),
        node_data=_data([mesh.node_data for mesh in meshes], nodes),
    )


def with_groups(mesh: Mesh, on: str, where: Mapping[str, Condition]) -> Mesh:
    """Return the mesh with more groups: `Mesh.with_groups`."""
    if on not in MEMBERS:
        raise RequestError(f"groups are made of {', '.join(MEMBERS)}, not of {on!r}")
    for name, condition in where.items():
        if on == "nodes":
            nodes = _some(_holds(name, condition, mesh.points), name, on)
            mesh = replace(mesh, node_groups={**mesh.node_groups, name: nodes})
        elif on == "cells":
            holds = _holds(name, condition, _centres(mesh))
            cells = _some(holds & (mesh.cell_dim == mesh.dim), name, on)
            mesh = replace(mesh, cell_groups={**mesh.cell_groups, name: cells})
        else:
            faces = _inner_faces(mesh) if on == "inner" else boundary_faces(mesh)[0]
            there = _holds(name, condition, mesh.points)[faces.nodes] | (faces.nodes < 0)
            mesh = _with_faces(mesh, name, faces.take(_some(there.all(axis=1), name, on)))
    return mesh


def renamed(mesh: Mesh, names: Mapping[str, str]) -> Mesh:
    """Return the mesh with other names of groups: `Mesh.renamed`."""
    for name in names:
        if name not in mesh.cell_groups and name not in mesh.node_groups:
            raise GroupNotFoundError(name, [*mesh.cell_groups, *mesh.node_groups], "group")

    def new(groups: Mapping[str, Any]) -> list[dict[str, Any]]:
        return [{names.get(name, name): value} for name, value in groups.items() if names.get(name, name)]

    tags: dict[str, tuple[Any, ...]] = {}
    for ((name, own),) in (one.items() for one in new(mesh.group_tags)):
        tags[name] = tags.get(name, ()) + own
    cells, nodes = (_united(one, None) for one in (new(mesh.cell_groups), new(mesh.node_groups)))
    return replace(mesh, cell_groups=cells, node_groups=nodes, group_tags=tags)


def only(mesh: Mesh, groups: Sequence[str]) -> Mesh:
    """Return some groups of the mesh alone: `Mesh.only`."""
    cells = np.flatnonzero(mask_of(mesh.n_cells, *(mesh.cells_of(name) for name in groups)))
    part = restrict(mesh, mesh.nodes_on(cells), cells)
    cell_groups, node_groups = (
        {name: own for name, own in groups.items() if len(own)} for groups in (part.cell_groups, part.node_groups)
    )
    return replace(
        part,
        blocks=tuple(block for block in part.blocks if len(block.nodes)),
        cell_groups=cell_groups,
        node_groups=node_groups,
        group_tags={name: tags for name, tags in mesh.group_tags.items() if name in cell_groups},
        model=None,
    )


def restrict(mesh: Mesh, nodes: Ints, cells: Ints) -> Mesh:
    """Return a mesh of some of the nodes and cells, by their indices, ascending; all nodes of the cells are among them.

    Blocks, groups and data that have nothing left are still there, and empty.
    """
    new_node, new_cell = places_of(nodes, mesh.n_nodes), places_of(cells, mesh.n_cells)
    rows = np.split(cells, np.searchsorted(cells, mesh.offsets[1:-1]))
    blocks = [
        block._replace(nodes=new_node[block.nodes[of_block - start]].astype(block.nodes.dtype))
        for block, of_block, start in zip(mesh.blocks, rows, mesh.offsets, strict=False)
    ]

    def left(members: Ints, new: Ints) -> Ints:
        return new[members][new[members] >= 0]

    links = [replace(link, nodes=new_node[link.nodes]) for link in (mesh.model.periodic if mesh.model else ())]
    links = [replace(link, nodes=link.nodes[(link.nodes >= 0).all(axis=1)]) for link in links]
    return replace(
        mesh,
        points=mesh.points[nodes],
        blocks=tuple(blocks),
        node_number=mesh.node_number[nodes],
        cell_number=mesh.cell_number[cells],
        file_order=None if mesh.file_order is None else left(mesh.file_order, new_cell),
        cell_groups={name: left(members, new_cell) for name, members in mesh.cell_groups.items()},
        node_groups={name: left(members, new_node) for name, members in mesh.node_groups.items()},
        cell_data={name: values[cells] for name, values in mesh.cell_data.items()},
        node_data={name: values[nodes] for name, values in mesh.node_data.items()},
        model=mesh.model and replace(mesh.model, periodic=tuple(links)),
        deck=None,
    )


def _blocks(meshes: Sequence[Mesh], first: Sequence[int]) -> tuple[list[Block], list[Ints]]:
    """Blocks of the cells of all meshes, whose nodes begin at `first`; the new index (k,) of each mesh's cells."""
    index: list[Ints] = [np.empty(mesh.n_cells, np.int64) for mesh in meshes]
    blocks, done = [], 0
    for kind in dict.fromkeys(block.type for mesh in meshes for block in mesh.blocks):
        rows = []
        for mesh, new, start in zip(meshes, index, first, strict=False):
            for block, offset in zip(mesh.blocks, mesh.offsets, strict=False):
                if block.type == kind:
                    rows.append(block.nodes + start)
                    new[offset : offset + len(block.nodes)] = done + np.arange(len(block.nodes))
                    done += len(block.nodes)
        blocks.append(Block(kind, np.concatenate(rows)))
    return blocks, index


def _united(groups: Sequence[Mapping[str, Ints]], index: Sequence[Ints] | None) -> dict[str, Ints]:
    """Groups of several meshes, whose members have new indices; those of one name are one."""
    parts: dict[str, list[Ints]] = {}
    for k, own in enumerate(groups):
        for name, members in own.items():
            parts.setdefault(name, []).append(members if index is None else index[k][members])
    return {name: np.unique(np.concatenate(own)) for name, own in parts.items()}


def _data(data: Sequence[Mapping[str, NDArray]], index: Sequence[Ints]) -> dict[str, NDArray]:
    """Data of several meshes, whose rows have new indices; NaN or -1 where a mesh has none."""
    out: dict[str, NDArray] = {}
    for own, rows in zip(data, index, strict=True):
        for name, values in own.items():
            if name == "entity":
                continue
            if name not in out:
                size, kind = sum(map(len, index)), np.result_type(*(one[name] for one in data if name in one))
                out[name] = np.full((size, *values.shape[1:]), np.nan if kind.kind == "f" else -1, kind)
            if out[name].shape[1:] != values.shape[1:]:
                raise RequestError(f"the data {name!r} of the meshes have different shapes; join meshes without them")
            out[name][rows] = values
    return out


def _holds(name: str, condition: Condition, x: Floats) -> Bools:
    """(n,): where the condition of a group is true."""
    holds = np.asarray(condition(x.T))
    if holds.shape != (len(x),) or holds.dtype.kind != "b":
        what = f"{holds.dtype} {holds.shape}"
        raise RequestError(f"the condition of the group {name!r} must be true or false at each of {len(x)} points x "
                           f"(3, n), as x[0] == 0, not {what}")  # fmt: skip
    return holds


def _some(holds: Any, name: str, on: str) -> Ints:
    """Rows where a condition is true. Raises RequestError where it is nowhere."""
    if not holds.any():
        what = {"faces": "outer face has all nodes", "inner": "face between two cells has all nodes",
                "cells": "cell has its centre", "nodes": "node is"}[on]  # fmt: skip
        raise RequestError(f"the group {name!r} would be empty: no {what} where its condition is true")
    return np.flatnonzero(holds)


def _centres(mesh: Mesh) -> Floats:
    """(k, 3): mean of the corners of each cell."""
    parts = [mesh.points[b.nodes[:, : ALL_CELLS[b.type].n_corners]].mean(axis=1) for b in mesh.blocks]
    return np.concatenate([np.empty((0, 3)), *parts])


def _inner_faces(mesh: Mesh) -> Faces:
    """Faces between two cells, each once."""
    facets = Facets.of(mesh)
    number = np.flatnonzero(facets.opposite > np.arange(len(facets.opposite)))
    cell = facets.solid.cells[number // FACETS].astype(np.int64)
    return facets_of(mesh, FaceIncidence(np.arange(len(cell)), cell, number % FACETS, np.ones(len(cell), bool)))


def _with_faces(mesh: Mesh, name: str, faces: Faces) -> Mesh:
    """The mesh with a group of faces; those that are no cells yet become cells."""
    there = find_repeats(faces, cells_of_dim(mesh, mesh.dim - 1), mesh.n_nodes)
    missing = faces.take(np.flatnonzero(~mask_of(len(faces), there.face)))
    rows = [(FACE_TYPES[t], missing.nodes[missing.type == t][:, : N_NODES[t]]) for t in np.unique(missing.type)]
    members = np.append(there.cell, mesh.n_cells + np.arange(len(missing)))
    groups = {**mesh.cell_groups, name: members}
    tags = {other: own for other, own in mesh.group_tags.items() if other != name}
    return replace(with_cells(mesh, rows, int(mesh.cell_number.max(initial=0)) + 1, groups), group_tags=tags)


def with_cells(mesh: Mesh, new: Sequence[tuple[str, Ints]], first: int, groups: Mapping[str, Ints]) -> Mesh:
    """Return the mesh with more cells, (type, nodes) for each type: numbered from `first` on, the last in the file.

    `groups`: those of cells; members count the new cells behind the others.
    """
    more = Mesh.create(mesh.points, new, space_dim=mesh.space_dim)
    blocks, (old, own) = _blocks([mesh, more], [0, 0])
    index, number = np.append(old, own), np.empty(len(old) + len(own), np.int64)
    number[index] = np.append(mesh.cell_number, first + np.arange(len(own)))
    in_file = np.append(old if mesh.file_order is None else old[mesh.file_order], own)
    return replace(
        mesh,
        blocks=tuple(blocks),
        cell_number=number,
        file_order=None if (in_file[1:] > in_file[:-1]).all() else in_file,
        cell_groups={name: np.unique(index[members]) for name, members in groups.items()},
        cell_data=_data([{**mesh.cell_data}, {}], [old, own]),
    )
