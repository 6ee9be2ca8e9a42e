"""A part has what its process needs: every cell at its nodes, groups, data and cuts, and the rows of the stiffness."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Cut, Mesh, cut_skin, read
from lacmesh.errors import GroupNotFoundError, RequestError
from lacmesh.mesh import Model, Periodic
from lacmesh.origin import origin_of_mesh
from lacmesh.partition import distribute_nodes, part_of
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.space.space import Space
from tests.lacsolver.bodies import PAIRS, body, distorted, mixture, plane_mixture
from tests.meshes import random_mesh

PARTS = (1, 2, 5)
BLOCKS = "data/two_blocks.msh"


def parts_of(mesh, n, **options):
    owner = distribute_nodes(mesh, n)
    return [part_of(mesh, owner, rank, **options) for rank in range(n)]


def nodes_of_cells(mesh):
    """The nodes of each cell, one list a cell."""
    return [row.tolist() for block in mesh.blocks for row in block.nodes]


def random_one(seed):
    rng = np.random.default_rng(seed)
    return random_mesh(rng, dim=2 + seed % 2, order=1 + seed // 2, interior=seed % 3 == 0, twins=True)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("n", PARTS)
def test_a_part_has_every_cell_at_its_own_nodes_and_all_that_belongs_to_it(seed, n):
    mesh = random_one(seed)
    whole = nodes_of_cells(mesh)
    parts = parts_of(mesh, n)
    assert sorted(np.concatenate([part.node[part.own] for part in parts])) == list(range(mesh.n_nodes))
    for part in parts:
        own = set(part.node[part.own].tolist())
        assert part.cell.tolist() == [c for c, nodes in enumerate(whole) if own & set(nodes)]
        here = own | {node for c in part.cell for node in whole[c]}
        assert part.node.tolist() == sorted(here)
        assert [part.node[nodes].tolist() for nodes in nodes_of_cells(part.mesh)] == [whole[c] for c in part.cell]
        _check_carried(part, mesh)


def _check_carried(part, mesh):
    """Groups, numbers, data and the order of the file are those of the whole mesh, restricted to the part."""
    small = part.mesh
    assert [b.type for b in small.blocks] == [b.type for b in mesh.blocks] and small.space_dim == mesh.space_dim
    assert np.array_equal(small.points, mesh.points[part.node])
    assert np.array_equal(small.node_number, mesh.node_number[part.node])
    assert np.array_equal(small.cell_number, mesh.cell_number[part.cell])
    for there, here, index in (
        (mesh.cell_groups, small.cell_groups, part.cell),
        (mesh.node_groups, small.node_groups, part.node),
    ):
        assert {name: index[ids].tolist() for name, ids in here.items()} == {
            name: np.intersect1d(ids, index).tolist() for name, ids in there.items()
        }
    for there, here, index in (
        (mesh.cell_data, small.cell_data, part.cell),
        (mesh.node_data, small.node_data, part.node),
    ):
        assert there.keys() == here.keys() and all(np.array_equal(here[name], there[name][index]) for name in there)
    in_file = mesh.file_order[np.isin(mesh.file_order, part.cell)]
    assert np.array_equal(part.cell[small.file_order], in_file)
    assert (part.n_nodes, part.n_cells, part.dim) == (mesh.n_nodes, mesh.n_cells, mesh.dim)
    assert np.array_equal(part.origin, origin_of_mesh(mesh))


def dressed(mesh, shift):
    """The mesh far from 0, with a second body beside it, of the same cells."""
    x = mesh.points + np.array([shift, shift, 0.0])
    blocks = [(b.type, np.concatenate([b.nodes, b.nodes + len(x)])) for b in mesh.blocks]
    return Mesh.create(np.concatenate([x, x + np.array([4.0, 0.0, 0.0])]), blocks, space_dim=mesh.space_dim)


def stiffness(mesh, model, origin=None):
    space = Space.of(mesh, model, thickness=0.4 if model == "plane_stress" else None)
    if origin is not None:  # the whole mesh's, in place of that of the part
        space.__dict__.pop("local", None)
        space.__dict__["origin"] = origin
    return space, assemble_stiffness(space, Materials.of(space, Elastic(young=200.0, poisson=0.3)))


def own_rows(part, K, dim):
    """(rows, columns of the whole mesh, values) of the own rows of a part's stiffness."""
    K = K.tocsr()
    rows = (dim * np.flatnonzero(part.own)[:, None] + np.arange(dim)).ravel()
    columns = (dim * part.node[:, None] + np.arange(dim)).ravel()
    own = K[rows]
    return columns[rows], columns[own.indices], own


SHAPES = [(name, model, lambda name=name: body(name, 2)) for name, model in PAIRS]
SHAPES += [(f"mixture {order}", "3d", lambda order=order: mixture(order)) for order in ("1", "2", "2-full")]
SHAPES += [(f"mixture {order}", "plane_strain", lambda order=order: plane_mixture(order)) for order in ("1", "2")]


@pytest.mark.parametrize("name, model, make", SHAPES, ids=[f"{name}-{model}" for name, model, _ in SHAPES])
def test_own_rows_of_the_stiffness_are_those_of_the_whole_mesh(name, model, make):
    """To round-off, with the origin of the whole mesh."""
    mesh = dressed(distorted(make(), 0.04, seed=4), 1e3)
    space, K = stiffness(mesh, model)
    K, of_body = K.tocsr(), space.bodies
    for n in PARTS:
        for part in parts_of(mesh, n):
            _, small = stiffness(part.mesh, model, space.origin)
            rows, columns, own = own_rows(part, small, space.dim)
            expected = K[rows]
            assert np.array_equal(own.indptr, expected.indptr) and np.array_equal(columns, expected.indices)
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
    bare = parts_of(mesh, n)
    for part, without in zip(parts_of(mesh, n, everywhere=["slave", "master"]), bare, strict=True):
        assert set(part.cell.tolist()) == {*without.cell.tolist(), *around, *siblings}
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
    part = part_of(row, np.repeat([0, 1], 3), 0, nodes=asked)
    assert part.node.tolist() == [0, 1, 2, 3, 4] and part.cell.tolist() == [0, 1, 2, 3]
    part = part_of(row, np.array([0, 1, 1, 1, 1, 1]), 0, nodes=asked)
    assert part.node.tolist() == [0, 1, 3, 4] and part.cell.tolist() == [0, 3]


def test_periodic_nodes_stay_pairs():
    mesh = Mesh.create(
        [[0, 0], [1, 0], [0, 1], [1, 1]],
        [("SEG2", [[0, 2], [1, 3], [0, 1]])],
        model=Model(periodic=(Periodic((1, 1), (1, 2), (), np.array([[0, 1], [2, 3]])),)),
    )
    part = part_of(mesh, np.array([0, 0, 1, 1]), 0)
    assert part.node.tolist() == [0, 1, 2, 3]
    part = part_of(mesh, np.array([0, 1, 1, 1]), 0)
    assert part.node.tolist() == [0, 1, 2] and part.mesh.model.periodic[0].nodes.tolist() == [[0, 1]]


def test_a_wrong_rank_or_group_is_refused():
    mesh = read(BLOCKS)
    owner = distribute_nodes(mesh, 2)
    with pytest.raises(ValueError, match="no rank 2 of 2"):
        part_of(mesh, owner, 2)
    with pytest.raises(ValueError, match="no rank 0"):
        part_of(mesh, owner[1:], 0)
    with pytest.raises(RequestError, match="'lower' holds cells of dimension 3; name a group of skin faces"):
        part_of(mesh, owner, 0, everywhere=["lower"])
    with pytest.raises(GroupNotFoundError, match="did you mean slave"):
        part_of(mesh, owner, 0, everywhere=["slav"])
