"""What is asked of the skins by themselves: their faces, the cells behind, how they turn, what they share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.checks.findings import Finding
from lacmesh.checks.subject import Side, Subject, is_carried
from lacmesh.faces import cells_of_dim
from lacmesh.mesh import Ints
from lacmesh.orientation import edge_uses, turning
from lacmesh.skin import FACE_TYPES, find_owners, find_repeats

_ORDER = np.array([CELLS[name].order for name in FACE_TYPES])


def check_groups(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Whether the groups hold the faces of a skin, each once."""
    found: list[Finding] = []
    for side in subject.sides:
        found += _dimensions(subject, side)
        found += _copies(subject, side)
    found += _in_two_zones(subject)
    return found, {}


def _dimensions(subject: Subject, side: Side) -> Iterator[Finding]:
    mesh = subject.mesh
    for name, cells in zip(side.names, side.groups, strict=True):
        dims = mesh.cell_dim[cells]
        higher, lower = cells[dims > subject.dim], cells[dims < subject.dim]
        mine = cells[dims == subject.dim]
        odd = [c for kind, c, _ in mesh.select(mine) if is_carried(kind)]
        if len(higher):
            message = (
                f"the {side.what} group {name!r} holds {len(higher)} cells of dimension {int(dims.max())} "
                f"({subject.numbers(higher)}); name the group of its skin, of dimension {subject.dim}"
            )
            yield subject.found("wrong-dimension", message, higher, group=name)
        elif not len(mine):
            message = (
                f"the {side.what} group {name!r} holds no skin faces (cells of dimension {subject.dim}); name another"
            )
            yield subject.found("empty-skin", message, lower, group=name)
        elif len(lower):
            message = f"the {side.what} group {name!r} also holds {len(lower)} cells of lower dimension; take them out"
            yield subject.found("lower-dimension", message, lower, group=name)
        if odd:
            cells = np.concatenate(odd)
            message = f"{len(cells)} {side.what} faces are of order 3 or higher ({subject.numbers(cells)})"
            yield subject.found(
                "unsupported-face", f"{message}; mesh with linear or quadratic cells", cells, group=name
            )


def _copies(subject: Subject, side: Side) -> Iterator[Finding]:
    if len(side.copies):
        message = (
            f"{len(side.copies)} {side.what} faces stand twice: cells {subject.numbers(side.copies)} lie on the nodes "
            "of others in the groups; remove the copies"
        )
        yield subject.found("repeated-face", message, side.copies, group=side.group)
    if side.what == "slave" and len(side):
        blocks = list(cells_of_dim(subject.mesh, subject.dim))
        repeats = find_repeats(side.faces, blocks, subject.mesh.n_nodes)
        others = np.setdiff1d(repeats.cell, np.concatenate(side.groups))
        if len(others):
            message = (
                f"{len(others)} skin cells of other groups lie on slave faces ({subject.numbers(others)}); both are cut"
            )
            yield subject.found("duplicate", message, others, group=side.group)


def _in_two_zones(subject: Subject) -> Iterator[Finding]:
    groups = subject.slave.groups
    cells, count = np.unique(np.concatenate(groups), return_counts=True)
    twice = cells[count > 1]
    if len(twice):
        message = f"{len(twice)} cells ({subject.numbers(twice)}) are in several slave groups; the first zone has them"
        yield subject.found("face-in-two-zones", message, twice, group=subject.slave.group)


def check_parents(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """What stands behind the faces, and how they turn."""
    found: list[Finding] = []
    for side in subject.sides:
        if len(side):
            found += _behind(subject, side)
            found += _turned(subject, side)
    return found, {}


def _behind(subject: Subject, side: Side) -> Iterator[Finding]:
    count = subject.behind(side)
    parents = subject.parents[side.what]
    on_carried = _on_carried(subject, side)
    bare = side.cells[(count == 0) & ~on_carried]
    if len(bare) and side.what == "slave":
        message = (
            f"{len(bare)} slave faces have no cell behind them ({subject.numbers(bare)}); take them out of the group, "
            "or mesh the body (a shell is cut with --skin-only)"
        )
        yield subject.found("no-parent", message, bare, group=side.group)
    elif len(bare):
        message = f"{len(bare)} of {len(side)} master faces have no cells behind them: that part of the master is rigid"
        yield subject.found("bare-master", message, bare, group=side.group)
    carried = side.cells[(count == 0) & on_carried]
    if len(carried):
        message = (
            f"the cells behind {len(carried)} {side.what} faces ({subject.numbers(carried)}) are of order 3 or higher"
        )
        yield subject.found(
            "unsupported-face", f"{message}; mesh with linear or quadratic cells", carried, group=side.group
        )
    between = side.cells[count == 2]
    if len(between):
        message = (
            f"{len(between)} {side.what} faces lie between two cells ({subject.numbers(between)}), where nothing "
            "opens; double the nodes, or take them out of the group"
        )
        yield subject.found("interface", message, between, group=side.group)
    odd = np.unique(parents.face[~parents.same])
    if len(odd):
        message = (
            f"{len(odd)} {side.what} faces and the cells behind them do not have the same mid-nodes "
            f"({subject.numbers(side.cells[odd])}); raise the order of both alike"
        )
        yield subject.found("mid-nodes-differ", message, side.cells[odd], group=side.group)


def _on_carried(subject: Subject, side: Side) -> NDArray[np.bool_]:
    """(f,): faces that are, by their corners, facets of cells of higher order."""
    mesh = subject.mesh
    blocks = []
    for k, (kind, nodes) in enumerate(mesh.blocks):
        cell = ALL_CELLS[kind]
        if is_carried(kind) and cell.dim == subject.dim + 1:
            blocks.append((cell.linear, nodes[:, : cell.n_corners], mesh.offsets[k] + np.arange(len(nodes))))
    out = np.zeros(len(side), bool)
    out[find_owners(side.faces, blocks, mesh.n_nodes).face] = True
    return out


def _turned(subject: Subject, side: Side) -> Iterator[Finding]:
    turn = turning(subject.mesh, side.cells)
    bare = np.intersect1d(turn.turned, turn.bare)
    inward = np.setdiff1d(turn.turned, turn.bare)
    if len(inward):
        message = f"{len(inward)} of {len(side)} {side.what} faces turn inward ({subject.numbers(inward)})"
        yield subject.found("orientation", f"{message}; turn them with lacmesh orient", inward, group=side.group)
    if len(bare):
        message = (
            f"{len(bare)} bare {side.what} faces turn against their neighbours, or inward ({subject.numbers(bare)})"
        )
        yield subject.found("orientation", f"{message}; turn them with lacmesh orient", bare, group=side.group)


def check_shape(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Whether each skin is a surface: no branches, one order."""
    found: list[Finding] = []
    for side in subject.sides:
        if len(side):
            found += _branches(subject, side)
            found += _orders(subject, side)
    return found, {}


def _branches(subject: Subject, side: Side) -> Iterator[Finding]:
    uses = edge_uses(side.faces)
    count = np.bincount(uses.edge)
    rows = np.unique(uses.face[count[uses.edge] > 2])
    if len(rows):
        cells = side.cells[rows]
        message = (
            f"three or more {side.what} faces meet at {int((count > 2).sum())} edges (cells {subject.numbers(cells)}); "
            "take those that branch off out of the group"
        )
        yield subject.found("non-manifold", message, cells, group=side.group)


def _orders(subject: Subject, side: Side) -> Iterator[Finding]:
    order = _ORDER[side.faces.type]
    if order.min() < order.max():
        few = side.cells[order == (1 if 2 * (order == 1).sum() <= len(order) else 2)]
        message = f"the {side.what} skin has linear and quadratic faces (fewer of one: {subject.numbers(few)})"
        advice = "raise the order of the linear part, or make two zones"
        yield subject.found("mixed-order", f"{message}; {advice}", few, group=side.group)


def check_sharing(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Nodes that slave and master, or two zones, have in common."""
    found = []
    slave, master = subject.slave, subject.master
    if master is not None:
        common = np.intersect1d(slave.nodes, master.nodes)
        if len(common):
            message = (
                f"slave and master share {len(common)} nodes ({subject.node_numbers(common)}): they cannot open there; "
                "double the nodes, or take the faces that touch out of one of the groups"
            )
            found.append(subject.found("shared-nodes", message, nodes=common, group=f"{slave.group} / {master.group}"))
    shared = _shared_by_zones(subject)
    if len(shared):
        message = (
            f"slave zones share {len(shared)} nodes ({subject.node_numbers(shared)}); keep them apart, or make one zone"
        )
        found.append(subject.found("zones-share-nodes", message, nodes=shared, group=slave.group))
    return found, {}


def _shared_by_zones(subject: Subject) -> Ints:
    """Nodes that faces of two zones have."""
    side = subject.slave
    rows, place = np.nonzero(side.faces.nodes >= 0)
    node, zone = side.faces.nodes[rows, place], side.zone[rows]
    low = np.full(subject.mesh.n_nodes, len(side.names))
    high = np.full(subject.mesh.n_nodes, -1)
    np.minimum.at(low, node, zone)
    np.maximum.at(high, node, zone)
    return np.flatnonzero(low < high)
