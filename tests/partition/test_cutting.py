"""Parts that are cut are parts of the whole cut, cell by cell: every family, both variants, interfaces and numbers."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin, read
from lacmesh.cells import CELLS
from lacmesh.errors import CutError, RequestError
from lacmesh.partition import cut_part, distribute_nodes, part_of, read_part, write_parts
from lacmesh.partition.bisection import bisect
from tests.lacsolver.bodies import body, mixture, plane_mixture
from tests.meshes import facets_of, random_mesh
from tests.partition.compare import differences
from tests.samples import each_option

BLOCKS = "data/two_blocks.msh"


def with_slave(mesh, choose, seed=0, copies=1):
    """The mesh with some of its facets as slave faces, numbered at random; `choose` (owners): which.

    Each skin cell is there `copies` times, the first of them in the group.
    """
    skin = {}
    for owners in facets_of(mesh).values():
        if choose(owners):
            skin.setdefault(owners[0][2], []).append(owners[0][3])
    blocks = [(b.type, b.nodes) for b in mesh.blocks]
    blocks += [(kind, np.repeat(rows, copies, axis=0)) for kind, rows in skin.items()]
    n = sum(len(nodes) for _, nodes in blocks)
    rng = np.random.default_rng(seed)
    return Mesh.create(
        mesh.points,
        blocks,
        space_dim=mesh.space_dim,
        node_number=rng.permutation(3 * mesh.n_nodes)[: mesh.n_nodes] + 1,
        cell_number=rng.permutation(3 * n)[:n] + 1,
        file_order=rng.permutation(n),
        cell_groups={"slave": np.arange(mesh.n_cells, n, copies), "body": np.arange(mesh.n_cells)},
        node_groups={"half": np.arange(0, mesh.n_nodes, 2), "all": np.arange(mesh.n_nodes)},
        cell_data={"colour": rng.random(n)},
        node_data={"heat": rng.random(mesh.n_nodes)},
    )


def check(mesh, n, slave=("slave",), hexa="pyramid", everywhere=None):
    """The parts of a mesh, cut, against the parts of the mesh that is cut as a whole."""
    everywhere = everywhere or slave
    whole = cut_skin(mesh, slave, hexa=hexa, recognise=False).mesh
    owner = distribute_nodes(mesh, n)
    parts = [cut_part(part_of(mesh, owner, rank, everywhere=everywhere), slave, hexa=hexa) for rank in range(n)]
    after = np.full(whole.n_nodes, -1, owner.dtype)
    for part in parts:
        after[part.node[part.own]] = part.rank
    assert (after[: mesh.n_nodes] == owner).all() and (after >= 0).all()
    for part in parts:
        both = part_of(whole, after, part.rank, everywhere=everywhere), part
        orders = [k.mesh.file_order for k in both]  # which a mesh may leave out if it is that of its cells
        orders = [np.arange(part.mesh.n_cells) if order is None else order for order in orders]
        both = [replace(k, mesh=replace(k.mesh, file_order=order)) for k, order in zip(both, orders, strict=True)]
        assert differences(*both) == []
    return parts


def of_one_body(owners):
    return len(owners) == 1


FAMILIES = [name for name, cell in CELLS.items() if cell.dim > 1]


@pytest.mark.parametrize(("name", "n"), each_option(product(FAMILIES, (3, 2, 1, 8))))
def test_parts_of_every_family(name, n):
    mesh = with_slave(body(name, 2), of_one_body)
    for hexa in ("pyramid", "hexa", "auto") if CELLS[name].family in ("HEXA", "PENTA") else ("pyramid",):
        check(mesh, n, hexa=hexa)


@pytest.mark.parametrize("name", each_option([(name,) for name in FAMILIES], of=lambda row: [CELLS[row[0]].family]))
def test_interfaces_inside_a_body_are_cut_on_both_sides(name):
    mesh = with_slave(body(name, 2), lambda owners: len(owners) == 2)
    for hexa in ("pyramid", "hexa") if CELLS[name].family == "HEXA" else ("pyramid",):
        check(mesh, 4, hexa=hexa)


@pytest.mark.parametrize(("order", "hexa"), each_option(product(("1", "2", "2-full"), ("auto", "hexa", "pyramid"))))
def test_mixtures_where_one_face_decides_for_others_far_away(order, hexa):
    """A hexahedron takes the variant `hexa` only if all slave faces that its neighbours connect it with do."""
    check(with_slave(mixture(order), of_one_body), 5, hexa=hexa)
    check(with_slave(mixture(order), lambda owners: True), 3, hexa=hexa)
    check(with_slave(plane_mixture(order), lambda owners: True), 4, hexa=hexa)


@pytest.mark.parametrize("n", [2, 5])
def test_other_cells_on_the_slave_faces_are_cut_too(n):
    check(with_slave(mixture(), of_one_body, copies=3), n)


@pytest.mark.filterwarnings("ignore:slave faces stand twice")
@pytest.mark.parametrize("seed", range(12))
def test_random_meshes(seed):
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim=2 + seed % 2, order=1 + seed % 3, slaves=6, interior=seed % 4 < 2, twins=True)
    check(mesh, 2 + seed % 5, hexa=("pyramid", "hexa", "auto")[seed % 3])


def test_several_zones_and_a_master():
    mesh = read(BLOCKS)
    parts = check(mesh, 4, ("slave", "top"), everywhere=("slave", "top", "master"))
    assert parts[0].mesh.zones == ("slave", "top")


def test_parts_that_are_read_are_cut_as_those_in_memory(tmp_path):
    mesh = read(BLOCKS)
    owner = distribute_nodes(mesh, 3)
    write_parts(tmp_path, mesh, owner)
    for rank in range(3):
        groups = {"everywhere": ["slave", "master"]}
        there, here = part_of(mesh, owner, rank, **groups), read_part(tmp_path, rank, **groups)
        assert differences(cut_part(there, "slave"), cut_part(here, "slave")) == []


def test_numbers_follow_the_largest_of_the_whole_mesh_which_another_part_has():
    mesh = with_slave(body("HEXA8", 3), lambda owners: len(owners) == 1 and owners[0][1] == 5)
    far = bisect(mesh.points.T, 2)
    numbers = np.where(far == 1, mesh.node_number + 10**6, mesh.node_number)
    check(replace(mesh, node_number=numbers), 2)
    check(replace(mesh, cell_number=mesh.cell_number.astype(np.int64) + 2**31 * (np.arange(mesh.n_cells) == 0)), 3)


def test_new_nodes_outside_the_box_of_the_old_ones_move_the_origin_alike():
    """Faces of HEXA20 that bulge, far from 0: a node in the middle of one is the nearest to 0."""
    mesh = body("HEXA20", 1)
    x = mesh.points.copy()
    x[:8, 2] -= 0.2 * (x[:8, 2] < 0.5)
    x[8:, 2] -= 0.3 * (x[8:, 2] < 0.4)
    mesh = with_slave(replace(mesh, points=x + np.array([0, 0, 50.0])), of_one_body)
    parts = check(mesh, 2)
    assert parts[0].origin[2] != part_of(mesh, distribute_nodes(mesh, 2), 0).origin[2]


def test_a_part_of_a_cut_mesh_stays_as_it_is_and_the_slave_must_be_in_every_part():
    mesh = read(BLOCKS)
    cut = cut_skin(mesh, "slave").mesh
    part = part_of(cut, distribute_nodes(cut, 3), 1, everywhere=["slave", "top"])
    assert cut_part(part, "slave") is part
    with pytest.raises(CutError, match="is cut already"):
        cut_part(part, "top")
    with pytest.raises(RequestError, match="'slave' is not in"):
        cut_part(part_of(mesh, distribute_nodes(mesh, 3), 1, everywhere=["master"]), "slave")
