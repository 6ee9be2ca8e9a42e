"""Nodes at one place, labelled: against every pair compared, with stray nodes, and with thousands at one place."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.checks import check
from lacmesh.checks.bodies import _on_sides, _unexplained, inside_edges, same_place
from tests.checks.blocks import two_blocks


@pytest.mark.parametrize("seed", range(5))
def test_places_are_those_of_every_pair_compared(seed):
    random = np.random.default_rng(seed)
    x = random.choice(random.integers(0, 4, (60, 3)).astype(float), 200) * 1e3
    x += random.uniform(-1, 1, x.shape) * 1e-7
    label = same_place(x, 1e-6)
    near = np.abs(x[:, None] - x).max(axis=2) <= 1e-6
    assert np.array_equal(label[:, None] == label, near)
    assert near.sum() > len(x)


@pytest.mark.parametrize("with_master", [False, True])
def test_unexplained_nodes_are_those_of_the_unexplained_pairs(with_master):
    random = np.random.default_rng(7)
    n = 600
    place, body = random.integers(0, 150, n), random.integers(0, 3, n)
    slave, master = (SimpleNamespace(nodes=np.flatnonzero(random.random(n) < 0.4)) for _ in range(2))
    subject = SimpleNamespace(
        mesh=SimpleNamespace(n_nodes=n),
        bodies=body,
        slave=slave,
        master=master if with_master else None,
        sides=(slave, master) if with_master else (slave,),
    )
    a, b = np.nonzero(np.triu(place[:, None] == place, 1))
    keep = ~_on_sides(subject, a, b)
    a, b = a[keep], b[keep]
    again, torn = _unexplained(subject, np.arange(n), place)
    assert np.array_equal(np.flatnonzero(again), np.unique([a, b]))
    same = body[a] == body[b]
    assert np.array_equal(np.flatnonzero(torn), np.unique([a[same], b[same]]))
    assert 0 < torn.sum() < again.sum() < n


def test_a_stray_node_does_not_bring_the_others_together():
    mesh = two_blocks("TETRA4", reach=0.2)
    points = mesh.points.copy()
    points[0] = 1e14
    found = check(replace(mesh, points=points), "slave", "master")
    assert "coincident-nodes" not in found.rules


def test_thousands_of_nodes_at_one_place():
    n = 4000
    turn = np.linspace(0, 1, n + 1)[:-1] * 0.5 * np.pi
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    further = np.stack([np.cos(turn + 1e-4), np.sin(turn + 1e-4)], axis=1)
    points = np.concatenate([np.zeros((n, 2)), ring, further])
    cells = np.arange(3 * n).reshape(3, n).T
    skin = np.column_stack([cells[:, 1], cells[:, 2]])[:1]
    mesh = Mesh.create(points, [("TRIA3", cells), ("SEG2", skin)], cell_groups={"slave": [n]})
    (finding,) = check(mesh, "slave").of_rule("coincident-nodes")
    assert len(finding.nodes) == n and "1 point " in finding.message


def test_every_node_of_a_place_inside_an_edge_is_found():
    points = np.array([[0, 0, 0], [2, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0.5, 0, 0]])
    subject = SimpleNamespace(mesh=SimpleNamespace(points=points), finite=np.ones(6, bool))
    node, edge = inside_edges(subject, np.arange(6), np.array([0, 0]), np.array([1, 2]))
    assert sorted(zip(node.tolist(), edge.tolist(), strict=True)) == [(2, 0), (4, 0), (5, 0), (5, 1)]
    node, edge = inside_edges(subject, np.arange(0), np.array([0]), np.array([1]))
    assert not len(node) and not len(edge)


def test_a_group_may_be_a_numpy_integer():
    mesh = two_blocks("QUAD4")
    tagged = replace(mesh, cell_groups={**mesh.cell_groups, "5": mesh.cell_groups["slave"]})
    by_name = check(tagged, "5", "master").as_dict()
    assert check(tagged, np.int64(5), "master").as_dict() == by_name
    assert check(tagged, [np.int32(5)], "master").as_dict() == by_name
