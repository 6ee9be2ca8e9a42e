"""Assembly of a mesh, or of a slice of it, from the content of a msh file.

Numbers become indices, cells one block a type, physical tags groups, and our notes add what msh cannot hold. The
content of a slice has some of the nodes (`Content.node_rows`) and the places of all cells, of which the slice's are
taken here.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.communicator import SERIAL, Communicator
from lacmesh.errors import LacmeshWarning, some
from lacmesh.formats.ids import Index
from lacmesh.formats.msh import cells as msh_cells
from lacmesh.formats.msh import fields as msh_fields
from lacmesh.formats.msh.content import Content
from lacmesh.formats.msh.names import unnamed
from lacmesh.formats.msh.notes import SECTION, Notes
from lacmesh.formats.slices import MeshSlice, RowRange, Slice, whole_index
from lacmesh.mesh import Ints, Mesh, Model, Periodic, Tag, concatenated


def to_mesh(content: Content) -> Mesh:
    """Convert the content of a whole file to a mesh. Raises ReadError."""
    whole = to_slice(content)
    for message in whole.said:
        warnings.warn(LacmeshWarning(message), stacklevel=4)
    return whole.mesh()


def to_slice(content: Content, comm: Communicator = SERIAL) -> MeshSlice:
    """Convert the nodes that this process has read of a file, and the cells of its slice. Raises ReadError."""
    said: list[str] = []
    own = _node_index(content, comm)
    node_rows = content.node_rows or RowRange(0, own.n, own.n)
    notes = _fitting(content, node_rows.size, said)
    msh_cells.add_extra_cells(content, notes)
    whole = msh_cells.describe(content.pieces)
    content = replace(content, pieces=msh_cells.in_slice(content.pieces, whole.sizes, Slice(comm.rank, comm.size)))
    pairs = (link[-1] for link in content.links)
    nodes = whole_index(own, (*(p.nodes for p in content.pieces), *pairs), comm)
    cells = msh_cells.joined(content, whole, nodes, comm)
    index = {"node": own, "cell": msh_cells.cell_index(content, cells.number, comm)}
    groups, group_tags = cell_groups(content, cells.first, notes, index["cell"], comm, said)
    sizes = {"node": node_rows.size, "cell": sum(whole.sizes.values())}
    cell_data, node_data, steps, n_known = comm.on_each(
        lambda: msh_fields.to_mesh(content.source, content.rows, index, sizes, notes.fields)
    )
    node_groups = {name: known(own, number) for name, number in notes.node_groups.items()}
    _say_lost(content, notes, n_known + sum(map(len, node_groups.values())), comm, said)
    if whole.entities:
        cell_data["entity"] = cells.entity
    if cells.partition is not None:
        cell_data["partition"] = cells.partition
    entity = _node_entity(content, notes)
    if entity is not None:
        node_data["entity"] = entity
    return MeshSlice(
        rows=node_rows,
        points=content.points,
        space_dim=_space_dim(content, whole, notes, comm),
        node_number=content.node_number,
        cells=cells.rows,
        cell_number=cells.number,
        cell_place=cells.place,
        cell_groups=groups,
        node_groups=node_groups,
        cell_data=cell_data,
        node_data=node_data,
        noted={
            "group_tags": group_tags,
            "steps": steps,
            "zones": notes.zones,
            "model": _model(content, notes, nodes),
            "name": "mesh" if notes.name is None else notes.name,
        },
        said=tuple(said),
    )


def _node_index(content: Content, comm: Communicator) -> Index:
    """Map from the numbers of the nodes that are read to their indices among them. Raises ReadError."""
    numbers = content.node_number
    msh_cells.check_numbers("node", numbers, content.source, content.nodes_at, comm)
    bad = comm.gather(numbers[~np.isfinite(content.points).all(axis=1)])
    if len(bad):
        raise content.source.error(f"the coordinates of nodes {some(bad)} are not finite numbers", content.nodes_at)
    return Index(numbers, table=comm.size == 1)


def _fitting(content: Content, n_nodes: int, said: list[str]) -> Notes:
    """Our notes; what they say by number is dropped, with a warning, if they were written for another mesh."""
    notes = content.notes
    n_cells = sum(len(p.number) for p in content.pieces) + sum(len(c.number) for c in notes.extra_cells)
    numbered = notes.node_groups or notes.cell_groups or notes.extra_cells or notes.node_entity is not None
    if numbered and (notes.nodes, notes.cells) != (n_nodes, n_cells):
        said.append(
            f"the section ${SECTION} was written for {notes.nodes} nodes and {notes.cells} cells, and the file now "
            f"has {n_nodes} and {n_cells}: its node groups and further cells are left out"
        )
        notes.node_groups, notes.cell_groups, notes.extra_cells, notes.node_entity = {}, {}, (), None
    return notes


def _say_lost(content: Content, notes: Notes, n_placed: int, comm: Communicator, said: list[str]) -> None:
    """Say how many values and members of node groups have no place; `n_placed`: those in the slice that have one."""
    there = sum(len(r.number) for r in content.rows) + sum(map(len, notes.node_groups.values()))
    lost = there - int(comm.total(np.array(n_placed)))
    if lost:
        said.append(f"{lost} values or members belong to nodes or cells that the file does not hold: left out")


def _space_dim(content: Content, whole: msh_cells.AllCells, notes: Notes, comm: Communicator) -> int:
    """The dimension of the space: that of our notes, else 3 if there are solids or points out of the plane."""
    least = max((ALL_CELLS[name].dim for name in whole.sizes), default=0)
    dim = int(comm.greatest(np.array(max(least, Mesh.create(content.points, []).space_dim))))
    return dim if notes.space_dim is None else notes.space_dim


def _node_entity(content: Content, notes: Notes) -> Ints | None:
    """Entities of the nodes, (n, 2), from the file or from our notes; None if unknown. Raises ReadError."""
    if content.node_entity is not None or notes.node_entity is None:
        return content.node_entity
    n = len(content.node_number)
    dim, tag, count = notes.node_entity.T
    if (count < 0).any() or (count > n).any() or count.sum() != n or (np.abs([dim, tag]) >= 2**31).any():
        raise content.source.error(f"the entities of nodes in the section ${SECTION} do not fit the nodes")
    return np.repeat(np.stack([dim, tag], axis=1).astype(np.int32), count, axis=0)


def _model(content: Content, notes: Notes, nodes: Index) -> Model | None:
    boundary = content.boundary or notes.boundary
    periodic = []
    for slave, master, affine, pairs in content.links:
        places = nodes.places(pairs)
        periodic.append(Periodic(slave, master, affine, places[(places >= 0).all(axis=1)]))
    return Model(boundary, tuple(periodic)) if boundary or periodic else None


# ---- groups of a msh file, or of a slice of it: physical tags and our notes become groups of cells, by name


def known(index: Index, number: Ints) -> Ints:
    """The indices of those numbers that the slice has."""
    places = index.places(number)
    return places[places >= 0]


def cell_groups(
    content: Content, first: list[int], notes: Notes, index: Index, comm: Communicator, said: list[str]
) -> tuple[dict[str, Ints], dict[str, tuple[Tag, ...]]]:
    """Indices and tags of the cell groups, by name; a group without a name is named after its tag.

    `first`: the index of the first cell of each piece; `index`: from numbers of cells to indices.
    """
    members = _members(content, first, index)
    named: dict[Tag, str] = {}
    for dim, tag, name in content.names:
        for d in (dim,) if dim is not None else sorted({d for d, t in members if t == tag}):
            if named.setdefault((d, tag), name) != name:
                names = f"{named[d, tag]!r} and {name!r}"
                said.append(f"the physical group {d}:{tag} has two names, {names}: the first is kept")
    for name, tags in notes.groups.items():
        named.update(dict.fromkeys(tags, name))
    groups: dict[str, list[Ints]] = {name: [] for name in [*named.values(), *notes.groups]}
    group_tags: dict[str, list[Tag]] = {}
    for group in [*named, *sorted(t for t in members if t not in named)]:
        name = named.get(group, unnamed(group))
        while group not in named and name in groups:
            name += "'"
        group_tags.setdefault(name, []).append(group)
        groups.setdefault(name, []).extend(members.get(group, []))
    n_placed = 0
    for name, number in notes.cell_groups.items():
        here = known(index, number)
        groups.setdefault(name, []).append(here)
        n_placed += len(here)
    lost = sum(map(len, notes.cell_groups.values())) - int(comm.total(np.array(n_placed)))
    if lost:
        said.append(f"{lost} members of groups are cells that the file does not hold: left out")
    joined = {name: parts[0] if len(parts) == 1 else concatenated(parts) for name, parts in groups.items()}
    return joined, {name: tuple(tags) for name, tags in group_tags.items()}


def _members(content: Content, first: list[int], index: Index) -> dict[Tag, list[Ints]]:
    """Indices of the cells of each physical group, in parts."""
    members: dict[Tag, list[Ints]] = {}
    small = np.int32 if sum(len(p.number) for p in content.pieces) < 2**31 else np.int64
    for p, a in zip(content.pieces, first, strict=True):
        for tag in p.groups:
            members.setdefault(tag, []).append(np.arange(a, a + len(p.number), dtype=small))
        if p.physical is not None:
            for physical, rows in _by_value(p.physical):
                members.setdefault((ALL_CELLS[p.type].dim, physical), []).append(rows + a)
    repeated, _, dims, tags = content.repeats
    for dim in range(4):
        here = dims == dim
        if here.any():
            cells = index.places(repeated[here])
            for physical, rows in _by_value(tags[here]):
                members.setdefault((dim, physical), []).append(cells[rows])
    return members


def _by_value(values: Ints) -> Iterator[tuple[int, Ints]]:
    """Yield each value other than 0, and the rows that have it."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    cuts = np.flatnonzero(ordered[1:] != ordered[:-1]) + 1
    for rows in np.split(order, cuts):
        if len(rows) and values[rows[0]]:
            yield int(values[rows[0]]), rows
