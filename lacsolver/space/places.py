"""Nodes that a record of the case acts on: those of a group of cells or of nodes, or the node at a place.

Displacements, rigid bodies, forces, springs and probes all find their nodes here.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lacmesh.errors import DataError, GroupNotFoundError, RequestError, did_you_mean, some
from lacmesh.mesh import Floats, Ints, mask_of
from lacsolver.case.entry import Entry
from lacsolver.case.errors import CaseError, Issue
from lacsolver.case.joints import Coupling, Equation
from lacsolver.case.records import AtNodes, Rigid
from lacsolver.space.space import Space

#: records that name nodes by a group
OfNodes = AtNodes | Rigid | Equation | Coupling
#: largest distance of a place from its node, relative to the bodies' extent
_NEAR = 1e-6


def nodes_of(space: Space, record: OfNodes) -> Ints:
    """Return the sorted nodes (k,) that a record names by `group` and `kind`, or by `at`; of several, its own.

    A group of cells means the nodes of its cells, whatever their dimension; without a `kind`, a name that both a cell
    group and a node group have means the cells. Raises CaseError for a group that is missing or empty, and for a place
    that has no node, or several (of two bodies that touch). Nodes of no cell, such as centres of arcs, are taken only
    if there is no other node at the place.
    """
    at = record.at if isinstance(record, AtNodes) else None
    if at is not None:
        return space.own_nodes(_node_at(space, record, np.array(at)))
    assert record.group is not None  # the schema asks for a group where there is no `at`
    cells = cells_of(space, record)
    nodes = space.mesh.node_groups[record.group] if cells is None else space.mesh.nodes_on(cells)
    if not space.share.total(np.array(len(nodes))):
        raise wrong(record, f"the group {record.group!r} is empty; name one that has cells or nodes")
    return space.own_nodes(nodes)


def cells_of(space: Space, record: OfNodes) -> Ints | None:
    """Return the sorted indices of the cells of a record's group, None if it is a group of nodes.

    Raises CaseError for a group that the mesh lacks.
    """
    mesh, group = space.mesh, record.group
    assert group is not None
    if record.kind != "node":
        try:
            return mesh.cells_of(group)
        except RequestError as error:
            if record.kind == "cell" or not isinstance(error, GroupNotFoundError):
                raise wrong(record, str(error)) from None
    if group in mesh.node_groups:
        return None
    known = [*mesh.node_groups] if record.kind == "node" else [*mesh.cell_groups, *mesh.node_groups]
    what = "node group" if record.kind == "node" else "group"
    raise wrong(record, f"no {what} named {group!r}{did_you_mean(group, known)}")


def nodes_before_cut(space: Space, record: AtNodes) -> Ints:
    """Return the nodes (k,) of a record without those that a cut made, so that its total is that of no cut.

    A node that is named by its place keeps its own. Raises CaseError for a group that has nodes of the cut alone.
    """
    nodes = nodes_of(space, record)
    if record.at is not None:
        return nodes
    kept = nodes[~space.made_by_cut[nodes]]
    if not space.share.total(np.array(len(kept))):
        message = f"the group {record.group!r} has only nodes that the cut made, on which forces and springs do not act"
        raise wrong(record, f"{message}; name one that has nodes of the mesh before the cut")
    return kept


def on_bodies(space: Space, nodes: Ints, what: str, moved: Ints | None = None) -> Ints:
    """Return distinct nodes. Raises DataError for nodes that are neither on cells of the space nor in `moved`."""
    nodes = np.unique(np.asarray(nodes, dtype=np.int64))
    loose = nodes[~space.attached[nodes]]
    loose = loose if moved is None else np.setdiff1d(loose, moved)
    if len(loose):
        numbers = ", ".join(str(n) for n in space.mesh.node_number[loose[:10]])
        raise DataError(f"{what} at nodes {numbers}, which belong to no cell of a body; name nodes of a body")
    return nodes


def name_of(record: Entry) -> str:
    """Return the name of a record in results: its name, its group, or `at [x, y, z]`."""
    name = getattr(record, "name", None) or getattr(record, "group", None)
    return str(name) if name else f"at [{_written(getattr(record, 'at', ()))}]"


def where_of(record: Entry) -> str:
    """Return where a record acts: its groups, its group or place, or `everywhere`."""
    groups = getattr(record, "groups", None)
    return ", ".join(groups) if groups else name_of(record) if {"group", "name"} & set(vars(record)) else "everywhere"


def said(record: Entry) -> str:
    """Describe a record in a message: `displacement 'left' (press.toml, line 12)`."""
    name = getattr(record, "group", None)
    return _with_line(record, repr(name) if name else name_of(record))


def in_words(record: Entry, _row: int = 0) -> str:
    """Describe a record that has a name in a message, as each row of its equations: `coupling 'head' (line 12)`."""
    return _with_line(record, repr(name_of(record)))


def _with_line(record: Entry, which: str) -> str:
    return f"{record.SECTION.name} {which}" + (f" ({record.place})" if record.place else "")


def wrong(record: Entry, message: str) -> CaseError:
    """Return the error for a record, with its line in the file."""
    place = f"{record.place}: " if record.place else ""
    return CaseError([Issue(f"{place}{record.SECTION.name}: {message}")])


def _written(at: Iterable[float]) -> str:
    """Format a place with all its digits, which may distinguish it from another."""
    return ", ".join(repr(float(c)).removesuffix(".0") for c in at)


def _node_at(space: Space, record: Entry, at: Floats) -> Ints:
    """Return the node (1,) at a place; none (0,) if another process has it."""
    points = space.mesh.points[:, : space.dim]
    candidate = mask_of(len(points), space.mesh.nodes_on(np.flatnonzero(space.mesh.cell_dim > 0)))
    away = np.linalg.norm(points - at, axis=1)
    near = away <= _NEAR * space.extent
    place = _written(at)
    if not space.share.total(np.array(near.any(), int)):
        k = int(np.where(candidate, away, np.inf).argmin() if candidate.any() else away.argmin())
        there = ", ".join(space.told(points[k], 8))
        number = space.mesh.node_number[k]
        raise wrong(record, f"no node at [{place}]; the nearest is node {number} at [{there}], {away[k]:.6g} away")
    nodes_there = np.flatnonzero(near & candidate if (near & candidate).any() else near)
    if len(nodes_there) > 1:
        numbers = some(space.mesh.node_number[nodes_there])
        raise wrong(
            record, f"nodes {numbers} are all at [{place}]; name a group of nodes that has the one that is meant"
        )
    return nodes_there
