"""Owners of nodes are equal numbers in boxes; a part has its cells, groups, data, bodies, and its cut."""

from dataclasses import fields, is_dataclass, replace
from itertools import product

import numpy as np
import pytest

from lacmesh import Mesh, cut_skin, read
from lacmesh.cells import CELLS
from lacmesh.errors import CutError, DataError, GroupNotFoundError, RequestError
from lacmesh.mesh import Model, Periodic
from lacmesh.origin import origin_of_mesh
from lacmesh.partition import cut_part, distribute_nodes, part_of
from lacmesh.partition.parts import bisect
from lacmesh.topology.bodies import label_bodies
from tests.lacsolver.bodies import body
from tests.meshes import box, dressed, facets_of, random_mesh
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
def test_numbers_of_parts_that_cannot_be_and_wild_coordinates_are_refused(n):
    with pytest.raises(RequestError, match=f"1 to 4 parts, not {n}"):
        owners(np.eye(4, 3), n)
    for wild in (np.nan, np.inf, -1.7e308):
        with pytest.raises(DataError, match="node 3 has"):
            owners([[1e308, 0, 0], [0, 1e308, 0], [0, wild, 1e308], [0, 0, 0]], 2)


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
    bodies = label_bodies([b.nodes for b in mesh.blocks if CELLS[b.type].dim == mesh.dim], mesh.n_nodes)
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
        assert np.array_equal(part.body, bodies[part.node]) and part.n_bodies == bodies.max() + 1


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


# ---- parts that are cut are parts of the whole cut, cell by cell


def differences(one, other, place="part"):
    """The places at which two values, or parts, field by field, differ in value or type."""
    if isinstance(one, np.ndarray):
        same = one.dtype.kind == other.dtype.kind and one.shape == other.shape
        return [] if same and np.array_equal(one, other, equal_nan=one.dtype.kind == "f") else [place]
    if is_dataclass(one):
        one, other = ({f.name: getattr(k, f.name) for f in fields(k)} for k in (one, other))
    elif isinstance(one, tuple) and isinstance(other, tuple):
        one, other = (dict(enumerate(k)) for k in (one, other))
    if not isinstance(one, dict):
        return [] if one == other else [f"{place}: {one} {other}"]
    if one.keys() != other.keys():
        return [place]
    return [where for name in one for where in differences(one[name], other[name], f"{place}.{name}")]


def with_slave(mesh, *owned, copies=1, numbers=range(6)):
    """The mesh with its facets of one cell, or of two, as slave faces, `copies` of each, the first in the group.

    `numbers`: of the facets in their cells. Numbers of nodes and cells, order and data are random.
    """
    skin = {}
    for owners in facets_of(mesh).values():
        if len(owners) in owned and owners[0][1] in numbers:
            skin.setdefault(owners[0][2], []).append(owners[0][3])
    skin = {kind: np.repeat(rows, copies, axis=0) for kind, rows in skin.items()}
    blocks = [*((b.type, b.nodes) for b in mesh.blocks), *skin.items()]
    whole = dressed(np.random.default_rng(0), mesh.points, blocks, skin, mesh.space_dim)
    return replace(whole, cell_groups=whole.cell_groups | {"slave": np.arange(mesh.n_cells, whole.n_cells, copies)})


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


FAMILIES = [name for name, cell in CELLS.items() if cell.dim > 1]


@pytest.mark.rows(
    "1-TRIA3-3; 1-TRIA7-1; 1-TETRA4-1; 1-TETRA10-8; 1-PENTA6-8; 1-PENTA15-3; 1-PENTA18-2; 1-PYRAM5-1; 1-PYRAM13-8; "
    "1-PYRAM14-3; 2-TRIA6-2; 2-QUAD4-8; 2-QUAD8-3; 2-QUAD9-2; 2-HEXA8-3; 2-HEXA20-2; 2-HEXA27-1"
)
@pytest.mark.parametrize(("name", "n"), each_option(product(FAMILIES, (3, 2, 1, 8))))
@pytest.mark.parametrize("owners", [1, 2])
def test_parts_of_every_family_cut_on_the_outside_and_on_both_sides_of_interfaces(name, n, owners):
    for hexa in ("pyramid", "hexa", "auto") if CELLS[name].family in ("HEXA", "PENTA") else ("pyramid",):
        check(with_slave(body(name, 2), owners), n, hexa=hexa)


@pytest.mark.rows("6", "10")
@pytest.mark.filterwarnings("ignore:slave faces occur twice")
@pytest.mark.parametrize("seed", range(12))
def test_random_meshes(seed):
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim=2 + seed % 2, order=1 + seed % 3, slaves=6, interior=seed % 4 < 2, twins=True)
    check(mesh, 2 + seed % 5, hexa=("pyramid", "hexa", "auto")[seed % 3])


def test_several_zones_and_a_master():
    mesh = read(BLOCKS)
    parts = check(mesh, 4, ("slave", "top"), everywhere=("slave", "top", "master"))
    assert parts[0].mesh.zones == ("slave", "top")


def test_numbers_follow_the_largest_of_the_whole_mesh_which_another_part_has():
    mesh = with_slave(body("HEXA8", 3), 1, numbers=[5])
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
    mesh = with_slave(replace(mesh, points=x + np.array([0, 0, 50.0])), 1)
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
