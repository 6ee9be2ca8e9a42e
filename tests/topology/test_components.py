"""Components: plain Python and scipy agree; bodies: compiled, and by scipy."""

import numpy as np
import pytest

from lacmesh.topology import components
from lacmesh.topology.bodies import label_bodies
from tests.topology import plain


@pytest.mark.parametrize(("n", "edges"), [(0, 0), (5, 0), (60, 40), (400, 300)])
def test_both_ways_give_the_same(n, edges, monkeypatch):
    i, j = np.random.default_rng(n).integers(0, max(n, 1), (2, edges))
    by_python = components.label_components(i, j, n)
    monkeypatch.setattr(components, "_MANY", -1)
    assert n == 0 or np.array_equal(components.label_components(i, j, n), by_python)


@pytest.mark.parametrize("cells", [0, 1, 30, 100])
def test_bodies_are_the_components_of_cells_and_nodes(cells):
    rng = np.random.default_rng(cells)
    nodes = rng.permuted(np.tile(np.arange(200), (cells, 1)), axis=1)[:, :4]
    nodes[rng.random(cells) < 0.5, 3] = -1  # triangles among quadrangles
    expected = plain.bodies(nodes, 200)
    assert np.array_equal(label_bodies([nodes], 200), expected)
    assert np.array_equal(label_bodies([nodes[:7], nodes[7:]], 200), expected)
