"""Components: plain Python and scipy agree."""

import numpy as np
import pytest

from lacmesh.topology import components


@pytest.mark.parametrize(("n", "edges"), [(0, 0), (5, 0), (60, 40), (400, 300)])
def test_both_ways_give_the_same(n, edges, monkeypatch):
    i, j = np.random.default_rng(n).integers(0, max(n, 1), (2, edges))
    plain = components.label_components(i, j, n)
    monkeypatch.setattr(components, "_MANY", -1)
    assert n == 0 or np.array_equal(components.label_components(i, j, n), plain)
