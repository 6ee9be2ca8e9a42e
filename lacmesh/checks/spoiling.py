"""What makes the answer of a solver on a mesh wrong, and shows nowhere in it: the part of the check that solvers ask.

It costs little beside a solution, and looks at no place in space but the ends of edges.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from lacmesh.cells import CELLS
from lacmesh.checks.findings import Finding, counted
from lacmesh.checks.skins import check_sharing
from lacmesh.checks.solids import check_facets
from lacmesh.checks.subject import PLACE, Subject, make_subject
from lacmesh.mesh import Ints, Mesh
from lacmesh.origin import from_origin, origin_of_mesh


class Spoilt(NamedTuple):
    """A finding; `surely`: whether no answer can be right; `pair`: the slave and master it is about, None for cells."""

    finding: Finding
    surely: bool
    pair: tuple[str, str] | None = None


def find_spoiling(mesh: Mesh, pairs: Sequence[tuple[str, str]]) -> tuple[Spoilt, ...]:
    """What spoils an answer on a mesh, or may, in the words of `check`. `pairs`: slave and master of each contact.

    For sure: cells that are there twice, overlap or crowd a facet, which count twice; slave faces all of whose nodes
    are the master's, which can neither open nor press. It may: mid-nodes that two cells do not share, where the body
    is torn; some nodes that slave and master share, as at the tip of a crack; cells with two nodes at one place.
    """
    origin = origin_of_mesh(mesh)
    mesh = from_origin(mesh, origin)
    subject = make_subject(mesh, (), (), (), {}, origin)
    with np.errstate(all="ignore"):  # places that are no numbers are others' to tell
        cells = [*check_facets(subject)[0], *_edges_without_length(subject)]
    spoilt = [Spoilt(finding, finding.rule not in ("mid-nodes-differ", "coincident-nodes")) for finding in cells]
    for pair in dict.fromkeys(pairs):
        skins = make_subject(mesh, pair[:1], pair[1:], (), {}, origin)
        if len(np.intersect1d(mesh.cells_of(pair[0]), mesh.cells_of(pair[1]))):
            continue  # one skin on both sides makes no contact at all, which who pairs them says
        spoilt += [Spoilt(finding, _glued(skins), pair) for finding in check_sharing(skins)[0]]
    return tuple(spoilt)


def _glued(skins: Subject) -> bool:
    """Whether all nodes of some slave face are the master's."""
    assert skins.master is not None
    nodes = skins.slave.faces.nodes
    return bool((np.isin(nodes, skins.master.nodes) | (nodes < 0)).all(axis=1).any())


def _edges_without_length(subject: Subject) -> Iterator[Finding]:
    """Cells two of whose corners stand at one place and are two nodes."""
    pairs = [np.empty((0, 2), np.int64), *(_short(subject.mesh, k) for k in range(len(subject.mesh.blocks)))]
    short = np.concatenate(pairs)
    if len(short):
        nodes = np.unique(short)
        message = (
            f"{len(nodes):,} nodes stand at one place with another of their cell ({subject.node_numbers(nodes)}): "
        )
        message += f"{counted(len(np.unique(short, axis=0)), 'edge has', 'edges have')} no length; merge the nodes"
        yield subject.found("coincident-nodes", message, nodes=nodes)


def _short(mesh: Mesh, block: int) -> Ints:
    """(k, 2): the ends of edges of a block's cells that are nothing beside the cell's longest edge."""
    kind, nodes = mesh.blocks[block]
    if kind not in CELLS or not 1 < CELLS[kind].dim == mesh.dim or not len(nodes):
        return np.empty((0, 2), np.int64)
    ends = [np.sort(nodes[:, list(edge[:2])], axis=1) for edge in CELLS[kind].edges]
    length = np.stack([np.linalg.norm(mesh.points[e[:, 0]] - mesh.points[e[:, 1]], axis=1) for e in ends])
    nothing = length <= PLACE * length.max(axis=0)
    return np.concatenate([e[mine & (e[:, 0] < e[:, 1])] for e, mine in zip(ends, nothing, strict=True)])
