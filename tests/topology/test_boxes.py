"""Pairs of boxes against all pairs compared: scattered, touching, of every size, without extent, and NaN."""

from __future__ import annotations

import numpy as np
import pytest

import lacmesh.topology.boxes as topology_boxes
from lacmesh.topology.boxes import meeting, meeting_each_other
from tests.topology import plain


def boxes(rng, n):
    low = rng.integers(0, 12, (n, 3)).astype(float)  # on whole numbers, so that many only touch
    size = rng.choice([0, 1, 1, 2, 9], (n, 3))
    low[rng.random(n) < 0.05] = np.nan
    return low, low + size


@pytest.mark.parametrize(("n", "m"), [(0, 5), (5, 0), (1, 1), (3, 200), (200, 150)])
@pytest.mark.parametrize("few", [0, 1 << 19], ids=["by the tree", "as few"])
def test_pairs_are_those_of_all_compared(n, m, few, monkeypatch):
    monkeypatch.setattr(topology_boxes, "_FEW", few)
    rng = np.random.default_rng(n + m)
    mine, other = boxes(rng, n), boxes(rng, m)
    expected = set(zip(*plain.meeting(*mine, *other), strict=True)) if n and m else set()
    found = list(zip(*meeting(*mine, *other), strict=True))
    assert set(found) == expected and len(found) == len(expected)
    if n:
        i, j = plain.meeting(*mine, *mine)
        found = list(zip(*meeting_each_other(*mine), strict=True))
        assert set(found) == set(zip(i[i < j], j[i < j], strict=True)) and len(found) == len(set(found))
