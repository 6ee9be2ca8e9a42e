"""Faults of a mesh that make a solution wrong without showing in it: the part of the check that solvers call.

It is cheap compared with a solution: no search in space, only the lengths of edges are computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.checks.findings import Finding, counted
from lacmesh.checks.skins import check_sharing
from lacmesh.checks.solids import check_facets
from lacmesh.checks.subject import PLACE, Subject, make_subject
from lacmesh.mesh import Ints, Mesh
from lacmesh.origin import from_origin, origin_of_mesh

#: rules of cells after which a solution may yet be right
_DOUBTED = ("mid-nodes-differ", "coincident-nodes")


def find_spoiling(mesh: Mesh, pairs: Sequence[tuple[str, str]]) -> tuple[Finding, ...]:
    """Findings of `check` that make a solution wrong (errors), or may do so (warnings).

    `pairs`: slave and master of each contact; a finding about one of them names it in `where`. Certainly wrong:
    duplicate or overlapping cells and non-manifold facets, where material counts twice; slave faces with all their
    nodes on the master, which can neither open nor transmit pressure. Possibly wrong: mid-nodes that two neighbouring
    cells do not share, where the body is torn; some nodes shared by slave and master, but for the front of a crack;
    cells with two coincident nodes.
    """
    origin = origin_of_mesh(mesh)
    mesh = from_origin(mesh, origin)
    subject = make_subject(mesh, (), (), (), {}, origin)
    with np.errstate(all="ignore"):  # places that are no numbers are others' to tell
        cells = [*check_facets(subject)[0], *_edges_without_length(subject)]
    findings = [_judged(finding, finding.rule not in _DOUBTED) for finding in cells]
    for pair in dict.fromkeys(pairs):
        skins = make_subject(mesh, pair[:1], pair[1:], (), {}, origin)
        if len(np.intersect1d(mesh.cells_of(pair[0]), mesh.cells_of(pair[1]))):
            continue  # one skin on both sides makes no contact at all, which who pairs them says
        shared = [finding for finding in check_sharing(skins)[0] if finding.severity != "info"]  # no front of a crack
        findings += [_judged(finding, _glued(skins), pair) for finding in shared]
    return tuple(findings)


def _judged(finding: Finding, surely_wrong: bool, pair: tuple[str, str] | None = None) -> Finding:
    """Return a finding with the severity that it has for a solution, and the pair it is about."""
    severity = "error" if surely_wrong else "warning"
    return replace(finding, severity=severity, where=finding.where._replace(pair=pair))


def _glued(skins: Subject) -> bool:
    """True if there is a slave face that has all its nodes on the master."""
    assert skins.master is not None
    nodes = skins.slave.faces.nodes
    return bool((np.isin(nodes, skins.master.nodes) | (nodes < 0)).all(axis=1).any())


def _edges_without_length(subject: Subject) -> Iterator[Finding]:
    """Report cells with an edge of zero length between two different nodes."""
    pairs = [np.empty((0, 2), np.int64), *(_short(subject.mesh, k) for k in range(len(subject.mesh.blocks)))]
    short = np.concatenate(pairs)
    if len(short):
        nodes = np.unique(short)
        message = (
            f"{len(nodes):,} nodes have the coordinates of another node of their cell ({subject.node_numbers(nodes)}): "
        )
        message += f"{counted(len(np.unique(short, axis=0)), 'edge has', 'edges have')} no length; merge the nodes"
        yield subject.found("coincident-nodes", message, nodes=nodes)


def _short(mesh: Mesh, block: int) -> Ints:
    """(k, 2): the ends of edges of a block's cells with negligible length compared with the cell's longest edge."""
    kind, nodes = mesh.blocks[block]
    if kind not in CELLS or not 1 < CELLS[kind].dim == mesh.dim or not len(nodes):
        return np.empty((0, 2), np.int64)
    ends = [np.sort(nodes[:, list(edge[:2])], axis=1) for edge in CELLS[kind].edges]
    length = np.stack([np.linalg.norm(mesh.points[e[:, 0]] - mesh.points[e[:, 1]], axis=1) for e in ends])
    nothing = length <= PLACE * length.max(axis=0)
    return np.concatenate([e[mine & (e[:, 0] < e[:, 1])] for e, mine in zip(ends, nothing, strict=True)])
