"""Lengths, areas and volumes of cells and groups, against boxes that are distorted within, and a ball."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.report import describe
from lacmesh.report.records import cell_sizes, group_sizes
from tests.lacsolver.bodies import PLANES, SOLIDS, body


@pytest.mark.parametrize("name", SOLIDS + PLANES)
def test_cells_fill_their_box_wherever_it_lies(name):
    dim = CELLS[name].dim
    low, high = [1.0] * dim, [2.0, 3.0, 1.5][:dim]
    mesh = body(name, 2, low, high)
    whole = float(np.prod(np.array(high) - low))
    assert cell_sizes(mesh).sum() == pytest.approx(whole, rel=1e-13)
    far = Mesh.create(mesh.points + 1e6 * np.eye(3)[:dim].sum(axis=0), mesh.blocks, space_dim=dim)
    assert cell_sizes(far).sum() == pytest.approx(whole, rel=1e-9)


def test_groups_count_their_cells_of_the_highest_dimension():
    points = [[0, 0], [2, 0], [2, 1], [0, 1]]
    blocks = [("QUAD4", [[0, 1, 2, 3]]), ("SEG2", [[0, 1], [1, 2]]), ("POI1", [[0]])]
    mesh = Mesh.create(points, blocks, cell_groups={"both": [0, 1], "edges": [1, 2], "point": [3]})
    assert group_sizes(mesh) == {"both": 2.0, "edges": 3.0, "point": 0.0}
    assert describe(mesh)["groups"]["edges"] == {"dim": 1, "cells": 2, "size": 3.0}


def test_a_curved_edge_has_its_length():
    a = np.linspace(0, np.pi / 2, 17)
    arc = Mesh.create(
        np.stack([np.cos(a), np.sin(a)], axis=1), [("SEG3", [[2 * k, 2 * k + 2, 2 * k + 1] for k in range(8)])]
    )
    assert cell_sizes(arc).sum() == pytest.approx(np.pi / 2, rel=1e-5)
