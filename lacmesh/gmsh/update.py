"""Update of gmsh's current model to a mesh, by the differences between them.

    entities = where cells, nodes and groups of the mesh belong in gmsh's terms   (`formats.entities.assign`)
    change = cells that go, cells and nodes that come, nodes that move             (`_change`)
    model = changed: entities, nodes, cells, groups, views                         (`_apply`)

All that can be wrong with a mesh is found before the model is changed.
"""

from __future__ import annotations

import signal
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from lacmesh.cells import ALL_CELLS
from lacmesh.cutting.assemble import with_node_entities
from lacmesh.cutting.records import CELL_RECORDS, NODE_RECORD
from lacmesh.errors import LacmeshWarning, RequestError
from lacmesh.formats.entities import Assignment, assign
from lacmesh.formats.ids import Index
from lacmesh.formats.msh.notes import Notes
from lacmesh.formats.msh.writer import add_numbers, names_of, positive_numbers
from lacmesh.gmsh import session, views
from lacmesh.gmsh.attribute import write_notes
from lacmesh.gmsh.model import Read
from lacmesh.mesh import Floats, Ints, Mesh, Tag

#: gmsh takes cells out of an entity one by one, moving those behind (removed times all, some 5e8 a second measured).
_MANY_REMOVED = 10**9

_EMPTY = Mesh.create(np.empty((0, 3)), [])


@dataclass(frozen=True)
class _Change:
    """Changes from an old mesh to a new one.

    Indices: `gone` of the old cells; `come` of the new cells, `born` and `moved` of the new nodes; `vanished`: how many
    old nodes the new mesh lacks.
    """

    gone: Ints
    come: Ints
    born: Ints
    moved: Ints
    vanished: int


def apply_cut(before: Read, mesh: Mesh, shown: bool) -> None:
    """Update the current model, `before`, to its cut mesh. `shown`: the records become views."""
    gmsh = session.running()
    left_out = () if shown else (*CELL_RECORDS, NODE_RECORD)
    _apply(gmsh, before, _in_parts(before, mesh), left_out)


def apply_mesh(before: Read, mesh: Mesh) -> None:
    """Update the current model, `before`, to a mesh. Raises RequestError where the model is partitioned."""
    if before.parent:
        raise RequestError("the model is partitioned: gmsh.model.mesh.unpartition() first")
    _apply(session.running(), before, mesh, ())


def new_model(mesh: Mesh, name: str) -> None:
    """Make a new model from a mesh, which becomes the current one. Raises RequestError."""
    gmsh = session.running()
    if name in gmsh.model.list():
        raise RequestError(f"gmsh has a model named {name!r} already; say another name")
    if "partition" in mesh.cell_data:
        _warn("partitions are not made again in gmsh's model: left out")
    current = gmsh.model.getCurrent() if gmsh.model.list() else None
    gmsh.model.add(name)
    try:
        _apply(gmsh, Read(name, _EMPTY), mesh, ())
    except BaseException:
        gmsh.model.remove()
        if current is not None:
            gmsh.model.setCurrent(current)
        raise


def _warn(message: str) -> None:
    warnings.warn(LacmeshWarning(message), stacklevel=4)


def _in_parts(before: Read, mesh: Mesh) -> Mesh:
    """A cut mesh with the entities that hold its cells and nodes in the model: parts, where it is partitioned."""
    if not before.parent:
        return mesh
    parent = mesh.cell_data["lac_parent"]
    root = np.where(parent >= 0, parent, mesh.cell_number)
    index = Index(before.raw.cell_number).places(root)
    nodes = np.zeros((mesh.n_nodes, 2), np.int32)
    nodes[: before.raw.n_nodes] = before.raw.node_data["entity"]
    cell_data = {**mesh.cell_data, "entity": before.raw.cell_data["entity"][index]}
    new = replace(mesh, cell_data=cell_data, node_data={**mesh.node_data, "entity": nodes})
    cells = zip(mesh.blocks, np.split(index, mesh.offsets[1:-1]), strict=True)
    return with_node_entities(new, before.raw, ((b.type, b.nodes, rows) for b, rows in cells))


def _apply(gmsh: Any, before: Read, mesh: Mesh, left_out: tuple[str, ...]) -> None:
    where = "in gmsh's model"
    nodes = positive_numbers(mesh.node_number, "nodes", where)
    cells = positive_numbers(mesh.cell_number, "cells", where)
    mesh = replace(mesh, node_number=nodes, cell_number=cells)
    table = assign(mesh)
    tags = np.array([(e.dim, e.tag) for e in table.entities], np.int32).reshape(-1, 2)
    notes = Notes(mesh.n_nodes, mesh.n_cells)
    names = dict(names_of(mesh, table, notes))
    add_numbers(notes, mesh, table, mesh.node_number, mesh.cell_number, "4.1")
    notes.name = None if mesh.name in ("mesh", before.name) else mesh.name
    old = before.raw
    change = _change(old, mesh, tags[table.cell])
    with _uninterrupted():
        if change.vanished:
            old = _clear(gmsh, old)
            change = _change(old, mesh, tags[table.cell])
        added = _add_entities(gmsh, table, mesh)
        _add_nodes(gmsh, table, mesh, change)
        _remove_cells(gmsh, old, change.gone)
        _add_cells(gmsh, table, mesh, change.come)
        _set_groups(gmsh, table, names)
        if not old.n_nodes:
            _add_links(gmsh, mesh)
        elif added:
            gmsh.model.mesh.reclassifyNodes()
        notes.fields = views.write_views(gmsh, before.name, mesh, before.held, left_out)
        write_notes(gmsh, notes)


def _change(old: Mesh, new: Mesh, entity: Ints) -> _Change:
    """Changes from `old` to `new`, whose cells are on the entities (n_cells, 2)."""
    place = Index(old.cell_number).places(new.cell_number)
    same = place >= 0
    if same.any():
        same[same] = (old.cell_data["entity"][place[same]] == entity[same]).all(axis=1)
    first = {b.type: (int(old.offsets[k]), b.nodes) for k, b in enumerate(old.blocks)}
    for block, (a, b) in zip(new.blocks, pairwise(new.offsets.tolist()), strict=True):
        start, nodes = first.get(block.type, (0, block.nodes[:0]))
        row = place[a:b] - start
        rows = np.flatnonzero(same[a:b] & (row >= 0) & (row < len(nodes)))
        kept = old.node_number[nodes[row[rows]]] == new.node_number[block.nodes[rows]]
        same[a:b] = False
        same[a + rows[kept.all(axis=1)]] = True
    gone = np.ones(old.n_cells, bool)
    gone[place[same]] = False
    at = Index(old.node_number).places(new.node_number)
    there = np.flatnonzero(at >= 0)
    moved = there[(old.points[at[there]] != new.points[there]).any(axis=1)]
    return _Change(
        gone=np.flatnonzero(gone & _known_to_gmsh(old)),
        come=np.flatnonzero(~same & _known_to_gmsh(new)),
        born=np.flatnonzero(at < 0),
        moved=moved,
        vanished=old.n_nodes - len(there),
    )


def _known_to_gmsh(mesh: Mesh) -> Ints:
    """(n_cells,): True for cells of a type that gmsh has."""
    known = np.array([ALL_CELLS[b.type].msh is not None for b in mesh.blocks], bool)
    return np.repeat(known, np.diff(mesh.offsets))


def _clear(gmsh: Any, old: Mesh) -> Mesh:
    """Remove the whole mesh from the model, and return what is left: an empty mesh."""
    if old.model is not None and old.model.periodic:
        _warn("nodes are gone, so the mesh is made anew in gmsh's model: its periodic links are lost")
    gmsh.model.mesh.clear()
    return _EMPTY


def _add_entities(gmsh: Any, table: Assignment, mesh: Mesh) -> bool:
    """Add the entities that the model lacks, as discrete ones; return True if there were any."""
    there = {(int(d), int(t)) for d, t in gmsh.model.getEntities()}
    lacking = [(e.dim, e.tag) for e in table.entities if (e.dim, e.tag) not in there]
    last = [max((t for d, t in (*there, *lacking) if d == dim), default=0) for dim in range(-1, 4)]  # of dim - 1
    for dim, tag in lacking:
        bounds = [b for b in table.boundary.get((dim, tag), ()) if abs(b) <= last[dim]]
        gmsh.model.addDiscreteEntity(dim, tag, bounds if dim > 1 else [abs(b) for b in bounds])
    for dim, tag in lacking:
        inside = [b - last[dim] for b in table.boundary.get((dim, tag), ()) if b > last[dim]]
        if inside:
            gmsh.model.mesh.embed(dim - 1, inside, dim, tag)
    row = {(e.dim, e.tag): k for k, e in enumerate(table.entities)}
    for dim, tag in (t for t in lacking if t[0] == 0):
        nodes = np.flatnonzero(table.node == row[dim, tag])
        if len(nodes):
            gmsh.model.setCoordinates(tag, *mesh.points[nodes[0]])
    return bool(lacking)


def _add_nodes(gmsh: Any, table: Assignment, mesh: Mesh, change: _Change) -> None:
    """Add new nodes to their entities, and move those whose coordinates have changed."""
    for row, nodes in _by_key(table.node[change.born], change.born):
        dim, tag, _ = table.entities[row]
        points = mesh.points[nodes].ravel()
        gmsh.model.mesh.addNodes(dim, tag, mesh.node_number[nodes], points, _parameters(gmsh, dim, tag, points))
    for row, nodes in _by_key(table.node[change.moved], change.moved):
        dim, tag, _ = table.entities[row]
        points = mesh.points[nodes]
        parameters_of_nodes = _parameters(gmsh, dim, tag, points.ravel()).reshape(len(nodes), -1)
        for node, xyz, parameters in zip(mesh.node_number[nodes].tolist(), points, parameters_of_nodes, strict=True):
            gmsh.model.mesh.setNode(node, xyz, parameters)


def _parameters(gmsh: Any, dim: int, tag: int, points: Floats) -> Floats:
    """Parametric coordinates of points on an entity, if its nodes have such; otherwise an empty array."""
    none = np.empty(0)
    if dim not in (1, 2):
        return none
    nodes, _, parameters = gmsh.model.mesh.getNodes(dim, tag, returnParametricCoord=True)
    if len(parameters) != dim * len(nodes) or gmsh.model.getType(dim, tag).startswith(("Discrete", "Partition")):
        return none
    return gmsh.model.getParametrization(dim, tag, points)


def _remove_cells(gmsh: Any, old: Mesh, gone: Ints) -> None:
    """Remove cells from their entities; if there are many, remove all of the entity's, and put the others back."""
    entity = old.cell_data["entity"] if len(gone) else gone
    for (dim, tag), cells in _by_entity(entity[gone], gone):
        here = np.flatnonzero((entity == [dim, tag]).all(axis=1))
        if len(cells) * len(here) < _MANY_REMOVED:
            gmsh.model.mesh.removeElements(dim, tag, old.cell_number[cells])
            continue
        gmsh.model.mesh.removeElements(dim, tag)
        for cell_type, stay, nodes in old.select(np.setdiff1d(here, cells, assume_unique=True)):
            if ALL_CELLS[cell_type].msh is not None:
                rows = old.node_number[nodes].ravel()
                gmsh.model.mesh.addElementsByType(tag, ALL_CELLS[cell_type].msh, old.cell_number[stay], rows)


def _add_cells(gmsh: Any, table: Assignment, mesh: Mesh, come: Ints) -> None:
    for cell_type, cells, nodes in mesh.select(come):
        for row, which in _by_key(table.cell[cells], np.arange(len(cells))):
            numbers = mesh.cell_number[cells[which]]
            rows = mesh.node_number[nodes[which]]
            gmsh.model.mesh.addElementsByType(table.entities[row].tag, ALL_CELLS[cell_type].msh, numbers, rows.ravel())


def _set_groups(gmsh: Any, table: Assignment, names: dict[Tag, str]) -> None:
    """Make the physical groups those of the mesh; entities without cells stay in theirs."""
    full = {(table.entities[row].dim, table.entities[row].tag) for row in np.unique(table.cell).tolist()}
    wanted: dict[Tag, set[int]] = {tag: set() for tags in table.group_tags.values() for tag in tags}
    for e in table.entities:
        for group in e.groups:
            wanted[e.dim, group].add(e.tag)
    there = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        members = {abs(int(t)) for t in gmsh.model.getEntitiesForPhysicalGroup(dim, tag)}
        there[dim, tag] = members, gmsh.model.getPhysicalName(dim, tag)
        wanted[dim, tag] = {t for t in members if (dim, t) not in full} | wanted.get((dim, tag), set())
    for (dim, tag), members in wanted.items():
        name = names.get((dim, tag), "")
        if there.get((dim, tag)) == (members, name):
            continue
        if (dim, tag) in there:
            gmsh.model.removePhysicalGroups([(dim, tag)])
        if members:
            gmsh.model.addPhysicalGroup(dim, sorted(members), tag, name)


def _add_links(gmsh: Any, mesh: Mesh) -> None:
    """Periodic links of curves and surfaces; gmsh finds the pairs of nodes again."""
    for link in mesh.model.periodic if mesh.model is not None else ():
        if link.slave[0] in (1, 2) and len(link.affine) == 16:
            gmsh.model.mesh.setPeriodic(link.slave[0], [link.slave[1]], [link.master[1]], link.affine)


def _by_entity(entity: Ints, members: Ints) -> Iterator[tuple[Tag, Ints]]:
    """Yield each entity, and the members that are on it: `entity` (n, 2), `members` (n,)."""
    if len(members):
        tags, which = np.unique(entity, axis=0, return_inverse=True)
        for row, some in _by_key(which.ravel(), members):
            yield (int(tags[row, 0]), int(tags[row, 1])), some


def _by_key(key: Ints, members: Ints) -> Iterator[tuple[int, Ints]]:
    """Yield each key, and the members that have it, in their order."""
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    for some in np.split(order, np.flatnonzero(ordered[1:] != ordered[:-1]) + 1):
        if len(some):
            yield int(key[some[0]]), members[some]


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Defer an interrupt (SIGINT) until the model is consistent again, then raise it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: arrived.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before if before is not None else signal.SIG_DFL)
        if arrived:
            signal.raise_signal(signal.SIGINT)
