"""Faces that cross: the compiled test against every piece compared with every other, and cases that are known."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacmesh.checks.crossing import PIECES, crossing
from lacmesh.topology.skin import Faces
from tests.checks import plain
from tests.meshes import pad
from tests.samples import samples


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", range(samples(1, 4)))
@pytest.mark.parametrize("kinds", [("SEG2", "SEG3"), ("TRIA3", "QUAD4"), ("TRIA6", "QUAD8"), ("TRIA7", "QUAD9")])
def test_faces_that_cross_are_those_of_all_pieces_compared(kinds, seed):
    rng = np.random.default_rng(seed)
    parts, points = [], []
    for kind in kinds:
        x = pad(CELLS[kind].reference) + rng.normal(0, 0.05, (15, CELLS[kind].n_nodes, 3))
        x = x @ np.linalg.qr(rng.normal(size=(15, 3, 3)))[0] + rng.uniform(0, 6, (15, 1, 3))
        parts.append((kind, sum(map(len, points)) + np.arange(x.shape[0] * x.shape[1]).reshape(x.shape[:2])))
        points.append(x.reshape(-1, 3))
    flat = np.array([1, 1, 0]) if kinds[0] == "SEG2" else np.ones(3)
    x = np.concatenate(points) * flat
    faces = Faces.join(parts)
    pairs = crossing(x, faces)
    assert np.array_equal(pairs, plain.crossing(x, faces))
    assert 0 < len(pairs) < 400


def test_neighbours_do_not_cross_and_a_copy_does():
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.2], [0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    assert not len(crossing(x, Faces.join([("TRIA3", np.array([[0, 1, 2], [2, 1, 3]]))])))
    assert crossing(x, Faces.join([("TRIA3", np.array([[0, 1, 2], [4, 5, 6]]))])).tolist() == [[0, 1]]
    assert set(PIECES) == {name for name, cell in CELLS.items() if cell.dim in (1, 2)}
