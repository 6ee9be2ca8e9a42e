"""Stresses at nodes: exact where constant or linear, means of cells that have one point, parts that do not mix."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacsolver.bodies.small import points, weights
from lacsolver.results.nodal import extrapolation, nodal_stress
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PAIRS, body, distorted, mixture

#: cells with one point in the plane or in space; PYRAM5's four lie in one plane
ONE_POINT = [("TRIA3", "plane_strain"), ("TRIA3", "plane_stress"), ("TETRA4", "3d")]


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_constant_stress_stays_on_distorted_cells_and_linear_stress_on_affine_ones(name, model):
    space = Space.of(distorted(body(name, 2), 0.03), model)
    n = space.model.n_stress
    given = np.arange(1.0, n + 1)
    field = tuple(np.broadcast_to(given, (*at.shape[:2], n)) for at in points(space))
    assert nodal_stress(space, field) == pytest.approx(np.tile(given, (space.mesh.n_nodes, 1)), rel=1e-12)
    if (name, model) not in ONE_POINT and name != "PYRAM5":
        slopes = np.random.default_rng(5).uniform(-1, 1, (3, n))
        space = Space.of(body(name, 2), model)
        made = nodal_stress(space, tuple(at @ slopes + given for at in points(space)))
        assert made == pytest.approx(space.mesh.points @ slopes + given, rel=1e-11)


def test_pyramid5_tells_slopes_across_its_axis_only():
    E, ref = extrapolation("PYRAM5"), np.array(CELLS["PYRAM5"].reference)
    x = E @ np.array([[a, b] for a in (-1, 1) for b in (-1, 1)])  # whatever the points' order: two slopes, mean 0
    assert x[:4].mean(axis=0) == pytest.approx([0, 0], abs=1e-12)
    assert E.sum(axis=1) == pytest.approx(np.ones(len(ref)))
    assert E[4] == pytest.approx(np.full(4, 0.25))


@pytest.mark.parametrize(("name", "model"), ONE_POINT)
def test_one_point_cells_give_their_volume_weighted_mean(name, model):
    space = Space.of(distorted(body(name, 2), 0.05), model)
    (field,), (W,), (block,) = points(space), weights(space), space.blocks
    field = np.repeat(field[..., :1], space.model.n_stress, axis=2)
    node = int(block.nodes[0, 0])
    rows = np.flatnonzero((block.nodes == node).any(axis=1))
    assert len(rows) > 1
    expected = (field[rows, 0, 0] * W[rows, 0]).sum() / W[rows, 0].sum()
    assert nodal_stress(space, (field,))[node] == pytest.approx(np.full(space.model.n_stress, expected))


def test_stress_of_some_cells_does_not_mix_and_is_nan_elsewhere():
    """Cells of different types share one field."""
    mesh = body("QUAD4", 2)
    space, x = Space.of(mesh, "plane_strain"), mesh.points[:, 0]
    left = np.flatnonzero(mesh.points[mesh.blocks[0].nodes, 0].mean(axis=1) < 1.5)
    field = np.ones((4, 4, 4))
    field[left] = 5.0
    apart, mixed = nodal_stress(space, (field,), left), nodal_stress(space, (field,))
    assert apart[x <= 1.5] == pytest.approx(5.0) and np.isnan(apart[x > 1.5]).all()
    assert mixed[x == 1.5] == pytest.approx(3.0)
    space = Space.of(mixture(), "3d")
    assert nodal_stress(space, tuple(np.full((*at.shape[:2], 6), 7.0) for at in points(space))) == pytest.approx(7.0)
