"""Owners of nodes are equal numbers in boxes; a part has its cells, groups, data and cuts, and rows of stiffness."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Cut, Mesh, cut_skin, read
from lacmesh.errors import DataError, GroupNotFoundError, RequestError
from lacmesh.mesh import Model, Periodic
from lacmesh.origin import origin_of_mesh
from lacmesh.partition import distribute_nodes, part_of
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PAIRS, body, distorted, mixture, plane_mixture
from tests.meshes import box, random_mesh
from tests.samples import each_option

PARTS = (1, 2, 5)
BLOCKS = "data/two_blocks.msh"

# ---- owners


def owners(points, n):
    return distribute_nodes(Mesh.create(points, [("POI1", [[0]])]), n)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 8, 64])
def test_ranks_own_equal_numbers_of_nodes(n):
    points = np.random.default_rng(n).random((1000, 3)) * [1, 5, 2]
    count = np.bincount(owners(points, n), minlength=n)
    assert len(count) == n and count.max() - count.min() <= np.log2(n) + 1
    assert sorted(owners(points[:n], n)) == list(range(n))  # however few there are


def test_two_ranks_are_divided_across_the_longest_side_and_a_plane_of_nodes_by_the_others():
    """Eleven planes of 121 nodes: five and a half are the first half, whose last plane is divided along y."""
    points = np.random.default_rng(1).random((100, 3)) * [1, 3, 2]
    owner = owners(points, 2)
    assert points[owner == 0, 1].max() <= points[owner == 1, 1].min()
    points, _ = box(10)
    owner = owners(points, 2)
    divided = np.isclose(points[:, 0], 0.5)
    assert (owner[points[:, 0] < 0.45] == 0).all() and (owner[points[:, 0] > 0.55] == 1).all()
    assert points[divided & (owner == 0), 1].max() <= points[divided & (owner == 1), 1].min()
    assert owners(np.ones((6, 3)), 3).tolist() == [0, 0, 1, 1, 2, 2]


@pytest.mark.parametrize("n", [2, 3, 8])
@pytest.mark.parametrize("factor, shift", [(1e-3, 0.0), (25.4, 0.0), (1.0, 3e5), (0.7, -1.1e4), (1e200, 0.0)])
def test_owners_do_not_depend_on_units_position_and_numbering(n, factor, shift):
    points = box(12)[0] / 3 + [0.0, 0.0, 0.1]
    random = np.random.default_rng(n)
    moved, order = points + random.uniform(-1e-12, 1e-12, points.shape), random.permutation(len(points))
    assert np.array_equal(owners(points, n)[order], owners((moved * factor + shift)[order], n))


@pytest.mark.parametrize("n", [0, -1, 5])
def test_a_number_of_parts_that_cannot_be_is_refused(n):
    with pytest.raises(RequestError, match=f"1 to 4 parts, not {n}"):
        owners(np.eye(4, 3), n)


@pytest.mark.parametrize("wild", [np.nan, np.inf, -1.7e308])
def test_coordinates_that_are_not_finite_are_refused(wild):
    points = np.eye(4, 3) * 1e308
    points[2, 1] = wild
    with pytest.raises(DataError, match="node 3 has"):
        owners(points, 2)


# ---- parts


def parts_of(mesh, n, **options):
    owner = distribute_nodes(mesh, n)
    return [part_of(mesh, owner, rank, **options) for rank in range(n)]


def nodes_of_cells(mesh):
    """The nodes of each cell, one list a cell."""
    return [row.tolist() for block in mesh.blocks for row in block.nodes]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("n", PARTS)
def test_a_part_has_every_cell_at_its_own_nodes_and_all_that_belongs_to_it(seed, n):
    """Groups, numbers, data and the order of the file are those of the whole mesh, restricted to the part."""
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim=2 + seed % 2, order=1 + seed // 2, interior=seed % 3 == 0, twins=True)
    whole = nodes_of_cells(mesh)
    parts = parts_of(mesh, n)
    assert sorted(np.concatenate([part.node[part.own] for part in parts])) == list(range(mesh.n_nodes))
    for part in parts:
        own, small = set(part.node[part.own].tolist()), part.mesh
        assert part.cell.tolist() == [c for c, nodes in enumerate(whole) if own & set(nodes)]
        assert part.node.tolist() == sorted(own | {node for c in part.cell for node in whole[c]})
        assert [part.node[nodes].tolist() for nodes in nodes_of_cells(small)] == [whole[c] for c in part.cell]
        assert [b.type for b in small.blocks] == [b.type for b in mesh.blocks] and small.space_dim == mesh.space_dim
        assert np.array_equal(small.points, mesh.points[part.node])
        for what, index in (("node", part.node), ("cell", part.cell)):
            there, here = ({k: getattr(m, f"{what}_{k}") for k in ("number", "groups", "data")} for m in (mesh, small))
            assert np.array_equal(here["number"], there["number"][index])
            assert {name: index[ids].tolist() for name, ids in here["groups"].items()} == {
                name: np.intersect1d(ids, index).tolist() for name, ids in there["groups"].items()
            }
            assert here["data"].keys() == there["data"].keys()
            assert all(np.array_equal(here["data"][name], there["data"][name][index]) for name in there["data"])
        in_file = mesh.file_order[np.isin(mesh.file_order, part.cell)]
        assert np.array_equal(part.cell[small.file_order], in_file)
        assert (part.n_nodes, part.n_cells, part.dim) == (mesh.n_nodes, mesh.n_cells, mesh.dim)
        assert np.array_equal(part.origin, origin_of_mesh(mesh))


def stiffness(mesh, model, origin=None):
    space = Space.of(mesh, model, thickness=0.4 if model == "plane_stress" else None)
    if origin is not None:  # the whole mesh's, in place of that of the part
        space.__dict__.pop("local", None)
        space.__dict__["origin"] = origin
    return space, assemble_stiffness(space, Materials.of(space, Elastic(young=200.0, poisson=0.3))).tocsr()


SHAPES = [(name, model, lambda name=name: body(name, 2)) for name, model in PAIRS]
SHAPES += [(f"mixture {order}", "3d", lambda order=order: mixture(order)) for order in ("1", "2", "2-full")]
SHAPES += [(f"mixture {order}", "plane_strain", lambda order=order: plane_mixture(order)) for order in ("1", "2")]


@pytest.mark.parametrize("name, model, make", each_option(SHAPES, of=lambda row: [row[0].rstrip("0123456789"), row[1]]))
def test_own_rows_of_the_stiffness_are_those_of_the_whole_mesh(name, model, make):
    """To round-off, with the origin of the whole mesh, which lies far from 0 and has two bodies."""
    one = distorted(make(), 0.04, seed=4)
    x = one.points + np.array([1e3, 1e3, 0.0])
    blocks = [(b.type, np.concatenate([b.nodes, b.nodes + len(x)])) for b in one.blocks]
    mesh = Mesh.create(np.concatenate([x, x + np.array([4.0, 0.0, 0.0])]), blocks, space_dim=one.space_dim)
    space, K = stiffness(mesh, model)
    dim, of_body = space.dim, space.bodies
    for part in (part for n in PARTS for part in parts_of(mesh, n)):
        own = stiffness(part.mesh, model, space.origin)[1][
            (dim * np.flatnonzero(part.own)[:, None] + np.arange(dim)).ravel()
        ]
        columns = (dim * part.node[:, None] + np.arange(dim)).ravel()
        expected = K[columns[np.repeat(part.own, dim)]]
        assert np.array_equal(own.indptr, expected.indptr) and np.array_equal(columns[own.indices], expected.indices)
        assert np.abs(own.data - expected.data).max() <= 1e-14 * np.abs(expected.data).max()
        assert np.array_equal(part.body, of_body[part.node]) and part.n_bodies == 2


@pytest.mark.parametrize("n", PARTS)
def test_skins_are_whole_in_every_part_with_the_cells_that_touch_them(n):
    cut = cut_skin(read(BLOCKS), "slave", hexa="hexa")  # a child in six has no node on the skin
    mesh = cut.mesh
    faces = {name: mesh.cell_groups[name].tolist() for name in ("slave", "master")}
    nodes, parent = nodes_of_cells(mesh), mesh.cell_data["lac_parent"].tolist()
    skins = {c for cells in faces.values() for c in cells}
    on = {node for c in skins for node in nodes[c]}
    around = {c for c in range(mesh.n_cells) if on & set(nodes[c])}
    cut_up = {parent[c] for c in around} - {-1}
    siblings = {c for c in range(mesh.n_cells) if parent[c] in cut_up}
    assert len(around) > len(skins) and siblings - around
    for part, bare in zip(parts_of(mesh, n, everywhere=["slave", "master"]), parts_of(mesh, n), strict=True):
        assert set(part.cell.tolist()) == {*bare.cell.tolist(), *around, *siblings}
        assert {name: part.cell[part.mesh.cell_groups[name]].tolist() for name in faces} == faces
        small = Cut(part.mesh)
        assert small.n_macros == cut.n_macros and small.zones == cut.zones
        for k in range(cut.n_macros):
            assert part.cell[small.faces_of_macro[k]].tolist() == cut.faces_of_macro[k].tolist()
            assert part.node[small.internal_nodes[k]].tolist() == cut.internal_nodes[k].tolist()


def test_nodes_that_all_need_are_in_all_parts():
    """With the cells that have no other nodes, and no others."""
    row = Mesh.create([[k, 0] for k in range(6)], [("SEG2", [[k, k + 1] for k in range(5)])])
    asked = np.array([False, False, False, True, True, False])
    for owner, nodes, cells in (
        ([0, 0, 0, 1, 1, 1], [0, 1, 2, 3, 4], [0, 1, 2, 3]),
        ([0, 1, 1, 1, 1, 1], [0, 1, 3, 4], [0, 3]),
    ):
        part = part_of(row, np.array(owner), 0, nodes=asked)
        assert part.node.tolist() == nodes and part.cell.tolist() == cells


def test_periodic_nodes_stay_pairs():
    mesh = Mesh.create(
        [[0, 0], [1, 0], [0, 1], [1, 1]],
        [("SEG2", [[0, 2], [1, 3], [0, 1]])],
        model=Model(periodic=(Periodic((1, 1), (1, 2), (), np.array([[0, 1], [2, 3]])),)),
    )
    assert part_of(mesh, np.array([0, 0, 1, 1]), 0).node.tolist() == [0, 1, 2, 3]
    part = part_of(mesh, np.array([0, 1, 1, 1]), 0)
    assert part.node.tolist() == [0, 1, 2] and part.mesh.model.periodic[0].nodes.tolist() == [[0, 1]]


@pytest.mark.parametrize(
    "skip, rank, groups, error, says",
    [
        (0, 2, (), ValueError, "no rank 2 of 2"),
        (1, 0, (), ValueError, "no rank 0"),
        (0, 0, ["lower"], RequestError, "of dimension 3"),
        (0, 0, ["slav"], GroupNotFoundError, "did you mean slave"),
    ],
)
def test_a_wrong_rank_or_group_is_refused(skip, rank, groups, error, says):
    mesh = read(BLOCKS)
    with pytest.raises(error, match=says):
        part_of(mesh, distribute_nodes(mesh, 2)[skip:], rank, everywhere=groups)
