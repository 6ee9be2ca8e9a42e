"""The cells that are merged behind a chain of segments: array code against a walk around one chain at a time."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import cut_skin
from lacmesh.cutting.recognition import PLACE
from lacmesh.cutting.regroup import _apart, _candidates, cells_around, find_cones, find_rings, merged
from lacmesh.topology.faces import distinct_faces
from tests.meshes import random_mesh


def owners(cells, *edge):
    """The cells that have an edge; none where more than two have it."""
    found = [
        k for k, nodes in enumerate(cells) if any({nodes[i - 1], nodes[i]} == set(edge) for i in range(len(nodes)))
    ]
    return found if len(found) <= 2 else []


def across(cells, cell, *edge):
    """The other cell at an edge, or None."""
    both = owners(cells, *edge)
    return next((k for k in both if k != cell), None) if cell in both else None


def beside(cells, cell, node, other):
    """The neighbour in a quadrangle of one of its corners that is not `other`, which is one too; or None."""
    if cell is None or len(cells[cell]) < 4 or node not in cells[cell]:
        return None
    k = cells[cell].index(node)
    before, after = cells[cell][k - 1], cells[cell][(k + 1) % 4]
    return after if before == other else before if after == other else None


def fans(cells, span, chain, sides):
    """The fans of two or three triangles around the middle of a chain that a cut has made: (cells, parent)."""
    a, n, b = chain
    for start in owners(cells, a, n):
        fan, outline, spoke, cell = [], [], a, start
        while cell is not None and len(cells[cell]) == 3 and len(fan) < 3:
            fan.append(cell)
            (third,) = set(cells[cell]) - {n, spoke}
            if third == b:
                first, last = (min(span[k][0] for k in fan), max(span[k][1] for k in fan))
                in_a_row = last - first + 1 == sum(high - low + 1 for low, high in (span[k] for k in fan))
                merged = any(low < high for low, high in (span[k] for k in fan))
                if (len(fan) == 2 and in_a_row) or (len(fan) == 3 and (sides == 2 or merged)):
                    yield fan, (a, b, *outline[::-1])
                break
            outline.append(third)
            cell, spoke = across(cells, cell, n, third), third


def rings(cells, chain):
    """The four quadrangles behind a chain of three segments that are the ring in one quadrangle: (cells, parent)."""
    a, n, m, b = chain
    for first in owners(cells, a, n):
        v4, inner = beside(cells, first, a, n), beside(cells, first, n, a)
        middle = across(cells, first, n, inner)
        other = beside(cells, middle, m, n)
        last = across(cells, middle, m, other) if middle is not None else None
        v3 = beside(cells, last, b, m)
        far = across(cells, middle, inner, other) if middle is not None else None
        joined = beside(cells, middle, n, m) == inner and beside(cells, last, m, b) == other
        closed = beside(cells, far, inner, other) == v4 and beside(cells, far, other, inner) == v3
        if joined and closed and None not in (v3, v4, far):
            yield [first, middle, last, far], (a, b, v3, v4)


def merges(found):
    """{(chain, cells, parent)} of merges."""
    return {
        (int(chain), tuple(gone.tolist()), tuple(parent[parent >= 0].tolist()))
        for one in found
        for chain, gone, parent in zip(one.chain, one.gone, one.parent, strict=True)
    }


@pytest.mark.parametrize("seed", range(12))
def test_merges_are_those_of_one_chain_at_a_time(seed):
    mesh = random_mesh(np.random.default_rng(seed), dim=2, slaves=6, interior=bool(seed % 2))
    mesh = cut_skin(mesh, "slave").mesh
    faces, _ = distinct_faces(mesh, mesh.cells_of("slave"))
    pairs, triples, _ = _candidates(mesh, faces, PLACE)
    near = cells_around(mesh, np.unique(np.concatenate([pairs.nodes.ravel(), triples.nodes.ravel()])))
    sides, rounds = (near.behind(pairs.nodes) >= 0).sum(axis=1), 0
    while True:
        cells = [tuple(nodes[nodes >= 0].tolist()) for nodes in near.nodes]
        span = list(zip(near.first.tolist(), near.last.tolist(), strict=True))
        expected = {
            (k, tuple(gone), parent)
            for k, chain in enumerate(pairs.nodes.tolist())
            for gone, parent in fans(cells, span, chain, sides[k])
        } | {
            (k, tuple(gone), parent)
            for k, chain in enumerate(triples.nodes.tolist())
            for gone, parent in rings(cells, chain)
        }
        found = [find_rings(near, triples.nodes), *find_cones(near, pairs.nodes, sides)]
        assert merges(found) == expected
        if not expected:
            break
        near, rounds = merged(near, _apart(found, len(near.nodes))), rounds + 1
    assert rounds
