"""Topology against plain twins: pairs of facets by a table, pairs of boxes all compared, components by scipy."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import lacmesh.topology.boxes as topology_boxes
from lacmesh import Mesh
from lacmesh.topology import skin
from lacmesh.topology.bodies import label_bodies, label_components
from lacmesh.topology.boxes import meeting, meeting_each_other
from lacmesh.topology.facets import (
    ABSENT,
    ALONE,
    CROWDED,
    FACET_TABLE,
    FACETS,
    Facets,
    Solid,
    pair_facets,
)
from lacmesh.topology.skin import label_rows
from tests.meshes import box, random_mesh

# ---- facets


def pairs_of_facets(solid):
    """`pair_facets` from a table of facets by their sorted corners; the winding from the cycle of the corners."""
    opposite = np.full(len(solid.cells) * FACETS, ABSENT)
    same = np.zeros(len(opposite), bool)
    table = {}
    for cell, (corners, family) in enumerate(zip(solid.corners, solid.family, strict=True)):
        for j, places in enumerate(FACET_TABLE[family]):
            if places[0] >= 0:
                listed = corners[places[places >= 0]].tolist()
                table.setdefault(tuple(sorted(listed)), []).append((cell * FACETS + j, listed))
    for owners in table.values():
        numbers = [number for number, _ in owners]
        opposite[numbers] = ALONE if len(owners) == 1 else CROWDED
        if len(owners) == 2:
            opposite[numbers] = numbers[::-1]
            same[numbers] = cycle(owners[0][1]) == cycle(owners[1][1])
    return opposite, same


def cycle(listed):
    """Winding of a facet: True if the larger of the two neighbours of the lowest corner follows it."""
    k = listed.index(min(listed))
    return k == 0 if len(listed) == 2 else listed[(k + 1) % len(listed)] > listed[k - 1]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("keys", ["spread", "few"])
def test_pairs_of_facets_are_those_of_a_table(seed, keys, monkeypatch):
    """Of a conforming mixture, of the same three times over, and of cells of random nodes."""
    if keys == "few":  # most facets have the hash of another one
        monkeypatch.setattr(skin, "_GOLDEN", 1 << 58)
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim=2 + seed % 2, twins=True)
    thrice = [(b.type, np.concatenate([b.nodes] * 3)) for b in mesh.blocks]
    wild = [(kind, [rng.permutation(9)[:n] for _ in range(30)]) for kind, n in (("HEXA8", 8), ("TETRA4", 4))]
    for one in (mesh, Mesh.create(mesh.points, thrice, space_dim=mesh.dim), Mesh.create(rng.random((9, 3)), wild)):
        solid = Solid.of(one)
        for mine, theirs in zip(pair_facets(solid), pairs_of_facets(solid), strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_a_copy_of_a_cell_is_left_out_three_cells_crowd_a_facet_and_no_cells_have_none():
    points, cells = box(2)
    twice = Facets.of(Mesh.create(points, [("HEXA8", np.vstack([cells, cells[:1]]))]))
    assert twice.copies.tolist() == [8] and len(twice.solid.cells) == 8
    assert (twice.opposite == ALONE).sum() == 24 and not twice.same.any()
    fan = Mesh.create([[0, 0], [1, 0], [0, 1], [1, 1], [1, -1]], [("TRIA3", [[0, 1, 2], [0, 1, 3], [0, 1, 4]])])
    assert (Facets.of(fan).opposite == CROWDED).sum() == 3
    none = Facets.of(Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])]))
    assert not len(none.opposite) and not len(none.boundary[0])


# ---- boxes


@pytest.mark.parametrize(("n", "m"), [(0, 5), (5, 0), (1, 1), (3, 200), (200, 150)])
@pytest.mark.parametrize("few", [0, 1 << 19], ids=["by the tree", "as few"])
def test_pairs_of_boxes_are_those_of_all_compared(n, m, few, monkeypatch):
    """Scattered, touching, of every size, without extent, and NaN."""

    def compared(low, high, other_low, other_high):
        return np.nonzero(((low[:, None] <= other_high) & (high[:, None] >= other_low)).all(axis=2))

    def boxes(n):
        low = rng.integers(0, 12, (n, 3)).astype(float)  # on whole numbers, so that many only touch
        size = rng.choice([0, 1, 1, 2, 9], (n, 3))
        low[rng.random(n) < 0.05] = np.nan
        return low, low + size

    monkeypatch.setattr(topology_boxes, "_FEW", few)
    rng = np.random.default_rng(n + m)
    mine, other = boxes(n), boxes(m)
    found = list(zip(*meeting(*mine, *other), strict=True))
    assert sorted(found) == sorted(zip(*compared(*mine, *other), strict=True))
    if n:
        i, j = compared(*mine, *mine)
        found = list(zip(*meeting_each_other(*mine), strict=True))
        assert sorted(found) == sorted(zip(i[i < j], j[i < j], strict=True))


# ---- components


@pytest.mark.parametrize(("n", "edges"), [(0, 0), (5, 0), (60, 40), (400, 300)])
def test_components_are_those_of_scipy(n, edges):
    i, j = np.random.default_rng(n).integers(0, max(n, 1), (2, edges))
    graph = coo_array((np.ones(edges, bool), (i, j)), shape=(n, n))
    assert n == 0 or np.array_equal(label_components(i, j, n), connected_components(graph, directed=False)[1])
    assert len(label_components(i, j, n)) == n


@pytest.mark.parametrize("factor", [skin._GOLDEN, 1 << 62])
def test_equal_rows_have_one_label_even_where_hashes_clash(factor, monkeypatch):
    monkeypatch.setattr(skin, "_GOLDEN", factor)
    rows = np.random.default_rng(3).integers(-1, 4, (300, 3))
    labels, count = label_rows(rows)
    expected = np.unique(rows, axis=0, return_inverse=True)[1].ravel()
    pairs = np.unique(np.stack([labels, expected]), axis=1)
    assert count == pairs.shape[1] == len(np.unique(expected)) == len(np.unique(labels))
    assert sorted(np.unique(labels)) == list(range(count))


@pytest.mark.parametrize("cells", [0, 1, 30, 100])
def test_bodies_are_the_components_of_the_graph_of_cells_and_nodes(cells):
    rng = np.random.default_rng(cells)
    nodes = rng.permuted(np.tile(np.arange(200), (cells, 1)), axis=1)[:, :4]
    nodes[rng.random(cells) < 0.5, 3] = -1  # triangles among quadrangles
    cell, place = np.nonzero(nodes >= 0)
    graph = coo_array((np.ones(len(cell), bool), (nodes[cell, place], 200 + cell)), shape=(200 + cells,) * 2)
    label = connected_components(graph, directed=False)[1]
    expected, seen = np.full(200, -1), {}
    for node in np.unique(nodes[nodes >= 0]).tolist():
        expected[node] = seen.setdefault(label[node], len(seen))
    assert np.array_equal(label_bodies([nodes], 200), expected)
    assert np.array_equal(label_bodies([nodes[:7], nodes[7:]], 200), expected)
