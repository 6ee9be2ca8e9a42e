"""The owner of each node: equal numbers in boxes, which do not depend on position, units and numbering."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.errors import DataError, RequestError
from lacmesh.partition import distribute_nodes
from tests.meshes import box, random_mesh


def cloud(points):
    return Mesh.create(points, [("POI1", [[0]])])


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 8, 64])
def test_ranks_own_equal_numbers_of_nodes(n):
    points = np.random.default_rng(n).random((1000, 3)) * [1, 5, 2]
    count = np.bincount(distribute_nodes(cloud(points), n), minlength=n)
    assert len(count) == n and count.max() - count.min() <= np.log2(n) + 1


def test_every_rank_owns_a_node_however_few_there_are():
    points = np.random.default_rng(0).random((13, 3))
    assert sorted(distribute_nodes(cloud(points), 13)) == list(range(13))


def test_two_ranks_are_divided_across_the_longest_side():
    points = np.random.default_rng(1).random((100, 3)) * [1, 3, 2]
    owner = distribute_nodes(cloud(points), 2)
    assert points[owner == 0, 1].max() <= points[owner == 1, 1].min()


def test_a_plane_of_nodes_is_divided_by_the_other_coordinates():
    """Eleven planes of 121 nodes: five and a half are the first half, whose last plane is divided along y."""
    points, _ = box(10)
    owner = distribute_nodes(cloud(points), 2)
    divided = np.isclose(points[:, 0], 0.5)
    assert (owner[points[:, 0] < 0.45] == 0).all() and (owner[points[:, 0] > 0.55] == 1).all()
    assert points[divided & (owner == 0), 1].max() <= points[divided & (owner == 1), 1].min()


@pytest.mark.parametrize("n", [2, 3, 8])
@pytest.mark.parametrize("factor, shift", [(1e-3, 0.0), (25.4, 0.0), (1.0, 3e5), (0.7, -1.1e4), (1e200, 0.0)])
def test_owners_do_not_depend_on_units_nor_on_the_position(n, factor, shift):
    points, _ = box(12)
    points = points / 3 + [0.0, 0.0, 0.1]
    rounding = np.random.default_rng(n).uniform(-1e-12, 1e-12, points.shape)
    owner = distribute_nodes(cloud(points), n)
    assert np.array_equal(owner, distribute_nodes(cloud((points + rounding) * factor + shift), n))


def test_owners_do_not_depend_on_the_numbering():
    points, _ = box(7)
    order = np.random.default_rng(2).permutation(len(points))
    assert np.array_equal(distribute_nodes(cloud(points), 5)[order], distribute_nodes(cloud(points[order]), 5))


def test_nodes_at_one_place_are_divided_too():
    assert distribute_nodes(cloud(np.ones((6, 3))), 3).tolist() == [0, 0, 1, 1, 2, 2]


def test_nodes_of_no_cell_have_owners():
    mesh = random_mesh(np.random.default_rng(3))
    assert np.bincount(distribute_nodes(mesh, 2)).sum() == mesh.n_nodes


@pytest.mark.parametrize("n", [0, -1, 5])
def test_a_number_of_parts_that_cannot_be_is_refused(n):
    with pytest.raises(RequestError, match=f"a mesh of 4 nodes has from 1 to 4 parts, not {n}"):
        distribute_nodes(cloud(np.eye(4, 3)), n)


@pytest.mark.parametrize("wild", [np.nan, np.inf, -1.7e308])
def test_coordinates_that_are_not_finite_are_refused(wild):
    points = np.eye(4, 3) * 1e308
    points[2, 1] = wild
    with pytest.raises(DataError, match="node 3 has a coordinate that is not finite, or is huge"):
        distribute_nodes(cloud(points), 2)
