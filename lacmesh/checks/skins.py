"""Checks of the skins by themselves: their faces, parent cells, orientation, and the nodes that they share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from shlex import quote
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.checks.findings import Finding, counted
from lacmesh.checks.subject import CheckedSkin, Subject, is_carried
from lacmesh.mesh import Floats, Ints, mask_of
from lacmesh.topology.orientation import analyse_orientation, face_normals
from lacmesh.topology.skin import FACE_TYPES, N_CORNERS, Faces, cells_of_dim, edge_uses, find_owners, find_repeats

_ORDER = np.array([CELLS[name].order for name in FACE_TYPES])


def check_groups(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Check that the groups contain faces of a skin, each of them once."""
    findings: list[Finding] = []
    for side in subject.sides:
        findings += _dimensions(subject, side)
        findings += _copies(subject, side)
    findings += _in_two_zones(subject)
    return findings, {}


def _dimensions(subject: Subject, side: CheckedSkin) -> Iterator[Finding]:
    mesh = subject.mesh
    for name, cells in zip(side.names, side.groups, strict=True):
        dims = mesh.cell_dim[cells]
        higher, lower = cells[dims > subject.dim], cells[dims < subject.dim]
        mine = cells[dims == subject.dim]
        odd = [c for kind, c, _ in mesh.select(mine) if is_carried(kind)]
        if len(higher):
            message = (
                f"the {side.what} group {name!r} has {counted(len(higher), 'cell')} of dimension {int(dims.max())} "
                f"({subject.numbers(higher)}); name the group of its skin, of dimension {subject.dim}"
            )
            yield subject.found("wrong-dimension", message, higher, group=name)
        elif not len(mine):
            message = (
                f"the {side.what} group {name!r} has no skin faces (cells of dimension {subject.dim}); name another"
            )
            yield subject.found("empty-skin", message, lower, group=name)
        elif len(lower):
            message = f"the {side.what} group {name!r} also has {counted(len(lower), 'cell')} of lower dimension "
            message += f"({subject.numbers(lower)}); remove them"
            yield subject.found("lower-dimension", message, lower, group=name)
        if odd:
            cells = np.concatenate(odd)
            message = side.counted(len(cells), "is", "are")
            message += f" of order 3 or higher ({subject.numbers(cells)})"
            yield subject.found(
                "unsupported-face", f"{message}; mesh with linear or quadratic cells", cells, group=name
            )


def _copies(subject: Subject, side: CheckedSkin) -> Iterator[Finding]:
    if len(side.copies):
        message = (
            f"{side.counted(len(side.copies), 'occurs', 'occur')} twice: "
            f"cells {subject.numbers(side.copies)} have the nodes of others in the groups; remove the copies"
        )
        yield subject.found("repeated-face", message, side.copies, group=side.group)
    if side.what == "slave" and len(side):
        blocks = list(cells_of_dim(subject.mesh, subject.dim))
        repeats = find_repeats(side.faces, blocks, subject.mesh.n_nodes)
        others = np.setdiff1d(repeats.cell, np.concatenate(side.groups))
        if len(others):
            message = counted(len(others), "skin cell of another group lies", "skin cells of other groups lie")
            message += f" on slave faces ({subject.numbers(others)}); both are cut"
            yield subject.found("duplicate", message, others, group=side.group)


def _in_two_zones(subject: Subject) -> Iterator[Finding]:
    groups = subject.slave.groups
    cells, count = np.unique(np.concatenate(groups), return_counts=True)
    twice = cells[count > 1]
    if len(twice):
        message = counted(len(twice), "cell is", "cells are")
        message += f" in several slave groups ({subject.numbers(twice)}); they belong to the zone of the first"
        yield subject.found("face-in-two-zones", message, twice, group=subject.slave.group)


def check_parents(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Check the parent cells of the faces, and the orientation of the faces."""
    return _of_sides(subject, _behind, _inward), {}


def _are_recorded(subject: Subject, cells: Ints) -> bool:
    """True if all of these cells are faces of macro-elements by the records of a cut."""
    macro = subject.mesh.cell_data.get("lac_macro")
    return macro is not None and bool((macro[cells] >= 0).all())


def _behind(subject: Subject, side: CheckedSkin) -> Iterator[Finding]:
    count = subject.behind(side)
    on_carried = _on_carried(subject, side)
    parentless, carried = side.cells[(count == 0) & ~on_carried], side.cells[(count == 0) & on_carried]
    if side.what == "slave" and subject.mesh.dim == 2 and _are_recorded(subject, parentless):
        return  # a shell that was cut as one
    if len(parentless) and side.what == "slave":
        message = f"{side.counted(len(parentless), 'has', 'have')} no parent cell ({subject.numbers(parentless)}); "
        message += "remove them from the group, or mesh the body (--skin-only cuts a shell)"
        yield subject.found("no-parent", message, parentless, group=side.group)
    elif len(parentless):
        message = (
            f"{side.counted(len(parentless), 'has', 'have')} no parent cell: the master, or that part of it, is rigid"
        )
        yield subject.found("bare-master", message, parentless, group=side.group)
    if len(carried):
        message = f"{side.counted(len(carried), 'lies', 'lie')} on cells of order 3 or higher "
        message += f"({subject.numbers(carried)}); mesh with linear or quadratic cells"
        yield subject.found("unsupported-face", message, carried, group=side.group)
    between = side.cells[count == 2]
    if len(between):
        message = f"{side.counted(len(between), 'lies', 'lie')} between two cells ({subject.numbers(between)}), where "
        message += "no gap can open; double the nodes, or remove them from the group"
        yield subject.found("interface", message, between, group=side.group)
    parents = subject.parents[side.what]
    odd = side.cells[np.unique(parents.face[~parents.same])]
    if len(odd):
        message = f"{side.counted(len(odd), 'does', 'do')} not have the mid-nodes of their parent cells "
        message += f"({subject.numbers(odd)}); elevate the order of both alike"
        yield subject.found("mid-nodes-differ", message, odd, group=side.group)


def _on_carried(subject: Subject, side: CheckedSkin) -> NDArray[np.bool_]:
    """(f,): True for faces that have the corners of a facet of a cell of order 3 or higher."""
    mesh = subject.mesh
    blocks = []
    for k, (kind, nodes) in enumerate(mesh.blocks):
        cell = ALL_CELLS[kind]
        if is_carried(kind) and cell.dim == subject.dim + 1:
            blocks.append((cell.linear, nodes[:, : cell.n_corners], mesh.offsets[k] + np.arange(len(nodes))))
    return mask_of(len(side), find_owners(side.faces, blocks, mesh.n_nodes).face)


def _inward(subject: Subject, side: CheckedSkin) -> Iterator[Finding]:
    orientation = analyse_orientation(subject.mesh, side.cells)
    against = np.intersect1d(orientation.to_flip, orientation.parentless)
    inward = np.setdiff1d(orientation.to_flip, orientation.parentless)
    advice = f"flip them: lacmesh orient {' '.join(f'--group {name}' for name in side.names)}"
    if len(inward):
        message = f"{len(inward):,} of {side.counted(len(side), 'points', 'point')} inward ({subject.numbers(inward)})"
        yield subject.found("orientation", f"{message}; {advice}", inward, group=side.group)
    if len(against):
        one, many = f"{side.what} face without parent cell points", f"{side.what} faces without parent cells point"
        message = counted(len(against), one, many)
        message += f" opposite to their neighbours, or inward ({subject.numbers(against)})"
        yield subject.found("orientation", f"{message}; {advice}", against, group=side.group)


def check_shape(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Check that each skin is a manifold surface of faces of one order."""
    return _of_sides(subject, _branches, _orders), {}


def _of_sides(subject: Subject, *rules: Callable[[Subject, CheckedSkin], Iterator[Finding]]) -> list[Finding]:
    """Findings of some rules on each skin that has faces."""
    return [finding for side in subject.sides if len(side) for rule in rules for finding in rule(subject, side)]


def _branches(subject: Subject, side: CheckedSkin) -> Iterator[Finding]:
    uses = edge_uses(side.faces)
    count = np.bincount(uses.edge)
    rows = np.unique(uses.face[count[uses.edge] > 2])
    if len(rows):
        cells = side.cells[rows]
        message = (
            f"three or more {side.what} faces meet at {counted(int((count > 2).sum()), 'edge')} (cells "
            f"{subject.numbers(cells)}); remove the branching faces from the group"
        )
        yield subject.found("non-manifold", message, cells, group=side.group)


def _orders(subject: Subject, side: CheckedSkin) -> Iterator[Finding]:
    order = _ORDER[side.faces.type]
    if order.min() < order.max():
        few = side.cells[order == (1 if 2 * (order == 1).sum() <= len(order) else 2)]
        message = f"the {side.what} skin has linear and quadratic faces (fewer of one: {subject.numbers(few)})"
        advice = "elevate the order of the linear part, or make two zones"
        yield subject.found("mixed-order", f"{message}; {advice}", few, group=side.group)


def check_sharing(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Find nodes that slave and master, or two zones, have in common."""
    findings = []
    slave, master = subject.slave, subject.master
    if master is not None:
        common = np.intersect1d(slave.nodes, master.nodes)
        closed = np.isin(slave.faces.nodes, common) | (slave.faces.nodes < 0)
        front = np.empty(0, np.int64) if closed.all(axis=1).any() else _front(subject)
        if len(front):
            message = (
                f"slave and master are the two sides of a crack, and share {counted(len(front), 'node')} of its front "
                f"({subject.node_numbers(front)}), which stay closed"
            )
            groups = f"{slave.group} / {master.group}"
            findings.append(subject.found("crack-front", message, nodes=front, group=groups))
        common = np.setdiff1d(common, front)
        inside = closed.all(axis=1) & (subject.behind(slave) == 2)
        if inside.any():
            findings.append(_joined(subject, inside, common))
        elif len(common):
            message = (
                f"slave and master share {counted(len(common), 'node')} ({subject.node_numbers(common)}), where no gap "
                "can open; double the nodes, or remove the faces that touch from one of the groups"
            )
            groups = f"{slave.group} / {master.group}"
            findings.append(subject.found("shared-nodes", message, nodes=common, group=groups))
    shared = _shared_by_zones(subject)
    if len(shared):
        message = (
            f"slave zones share {counted(len(shared), 'node')} ({subject.node_numbers(shared)}); keep a row of faces "
        )
        message += "between them, or make one zone"
        findings.append(subject.found("zones-share-nodes", message, nodes=shared, group=slave.group))
    return findings, {}


def _joined(subject: Subject, inside: NDArray[np.bool_], common: Ints) -> Finding:
    """Report slave faces, a mask (f,), that master faces share inside a body, with the command that divides it."""
    slave, master = subject.sides
    message = (
        f"bodies share {slave.counted(int(inside.sum()), 'with the master', 'with the master')}, where no gap can "
    )
    divide = " ".join(f"--faces {quote(name)}" for name in slave.names)
    message += f"open; divide the mesh there: lacmesh split MESH {divide}, and take "
    message += " and ".join(", ".join(f"{name}_{side}" for name in slave.names) for side in "ab")
    return subject.found(
        "shared-nodes", f"{message} as slave and master", nodes=common, group=f"{slave.group} / {master.group}"
    )


def _front(subject: Subject) -> Ints:
    """Nodes where the boundaries of both skins have an edge (in a plane, an end) in common, and lie on each other.

    The angle between the skins is below 60 degrees there: that of a crack is 0, that of skins side by side 180.
    """
    if subject.dim == 1 and subject.mesh.space_dim == 3:  # lines in space have no normals
        return np.empty(0, np.int64)
    slave, master = (_boundary_edges(side.faces) for side in subject.sides)
    nodes = np.array(sorted(node for edge in slave.keys() & master.keys() for node in slave[edge]), np.int64)
    nodes = np.unique(nodes)
    normals = [_mean_normals(subject, side, nodes) for side in subject.sides]
    return nodes[(normals[0] * normals[1]).sum(axis=1) < -0.5]


def _boundary_edges(faces: Faces) -> dict[tuple[int, ...], list[int]]:
    """Edges that one face has alone, by their corners: their nodes, with the mid-node of quadratic faces."""
    uses = edge_uses(faces)
    alone = np.flatnonzero(np.bincount(uses.edge)[uses.edge] == 1)
    n = N_CORNERS[faces.type[uses.face[alone]]]
    middle = np.full(len(alone), -1)
    curved = (_ORDER[faces.type[uses.face[alone]]] == 2) & (n > 2)
    middle[curved] = faces.nodes[uses.face[alone][curved], (n + uses.place[alone])[curved]]
    rows = np.column_stack([uses.start[alone], uses.stop[alone], middle]).tolist()
    return {tuple(sorted(row[:2])): [node for node in row if node >= 0] for row in rows}


def _mean_normals(subject: Subject, side: CheckedSkin, nodes: Ints) -> Floats:
    """(k, 3): unit normals of a skin at some of its nodes, the mean of those of the faces there; 0 for none."""
    listed = side.faces.nodes
    row, column = np.nonzero(np.isin(listed, nodes) & (listed >= 0))
    total = np.zeros((subject.mesh.n_nodes, 3))
    np.add.at(total, listed[row, column], face_normals(subject.mesh, side.faces)[row])
    size = np.linalg.norm(total[nodes], axis=1)
    return total[nodes] / np.where(size > 0, size, 1)[:, None]


def _shared_by_zones(subject: Subject) -> Ints:
    """Nodes that faces of two zones share."""
    side = subject.slave
    rows, place = np.nonzero(side.faces.nodes >= 0)
    node, zone = side.faces.nodes[rows, place], side.zone[rows]
    low = np.full(subject.mesh.n_nodes, len(side.names))
    high = np.full(subject.mesh.n_nodes, -1)
    np.minimum.at(low, node, zone)
    np.maximum.at(high, node, zone)
    return np.flatnonzero(low < high)
