"""The mesh as a value: nothing writes into it, groups are named alike everywhere; and a mesh of a higher order."""

import copy
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lacmesh
from lacmesh import Mesh, cut_skin, generate, measure_quality, orient, raise_order
from lacmesh.cells import CELLS
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.mesh import Periodic
from lacmesh.quality import validity_of
from tests.checks.blocks import two_blocks
from tests.coarse_rings import rings
from tests.meshes import cell_with_faces, facets_of, pad, random_mesh
from tests.samples import samples
from verification.measures.cutting import same_up_to_numbers, sizes
from verification.meshes.blocks import bent, nodes_of
from verification.meshes.rings import sleeve

MODULES = "formats mesh errors checks quality surface gmsh cutting"
TARGETS = {
    "2": {"TRIA3": "TRIA6", "QUAD4": "QUAD8", "TETRA4": "TETRA10", "HEXA8": "HEXA20", "PENTA6": "PENTA15",
          "PYRAM5": "PYRAM13", "SEG2": "SEG3", "POI1": "POI1"},
    "2-full": {"TRIA3": "TRIA6", "QUAD4": "QUAD9", "TETRA4": "TETRA10", "HEXA8": "HEXA27", "PENTA6": "PENTA18",
               "PYRAM5": "PYRAM14", "QUAD8": "QUAD9", "HEXA20": "HEXA27", "PENTA15": "PENTA18",
               "PYRAM13": "PYRAM14"},
}  # fmt: skip


CHANGES = ("__setitem__", "new", 1), ("update", {"new": 1}), ("clear",), ("setdefault", "new", 1)


def arrays(mesh):
    yield from (mesh.points, mesh.node_number, mesh.cell_number, mesh.offsets, mesh.cell_dim)
    yield from (b.nodes for b in mesh.blocks)
    for held in (mesh.cell_groups, mesh.node_groups, mesh.cell_data, mesh.node_data):
        yield from held.values()
    if mesh.file_order is not None:
        yield mesh.file_order


def meshes(folder):
    mesh = replace(two_blocks(), node_groups={"some": np.arange(3)}, file_order=np.arange(two_blocks().n_cells))
    yield mesh
    yield cut_skin(mesh, "slave").mesh
    for suffix in (".msh", ".med", ".mail", ".vtu"):
        lacmesh.write(folder / f"a{suffix}", mesh)
        yield lacmesh.read(folder / f"a{suffix}")


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_nothing_of_a_mesh_can_be_written_into(tmp_path):
    for mesh in meshes(tmp_path):
        for array in arrays(mesh):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
        for held in (mesh.cell_groups, mesh.node_groups, mesh.cell_data, mesh.node_data, mesh.group_tags, mesh.steps):
            for change, *what in CHANGES:
                with pytest.raises(TypeError, match="another mesh"):
                    getattr(held, change)(*what)
    link = Periodic((1, 1), (1, 2), (), np.zeros((1, 2), int))
    with pytest.raises(ValueError, match="read-only"):
        link.nodes[0] = 1


def test_what_a_mesh_is_made_of_is_not_copied_and_stays_its_owners():
    points, nodes, group, data = np.eye(3), np.array([[0, 1, 2]]), np.array([0]), np.ones(1)
    mesh = Mesh.create(points, [("TRIA3", nodes)], cell_groups={"a": group}, cell_data={"p": data})
    for mine, its in ((points, mesh.points), (nodes, mesh.block("TRIA3")), (group, mesh.cell_groups["a"])):
        assert np.shares_memory(mine, its) and mine.flags.writeable
    assert replace(mesh, name="other").points is mesh.points
    assert np.shares_memory(data, mesh.cell_data["p"])


def test_a_mesh_is_copied_and_pickled():
    mesh = cut_skin(two_blocks(), "slave").mesh
    for made in (copy.deepcopy(mesh), pickle.loads(pickle.dumps(mesh))):
        assert dict(made.cell_groups).keys() == mesh.cell_groups.keys()
        for array, before in zip(arrays(made), arrays(mesh), strict=True):
            np.testing.assert_array_equal(array, before)
            assert not array.flags.writeable


@pytest.mark.parametrize("spec", ["slave", 5, np.int64(5), "5", "2:5", (2, 5)])
def test_a_group_by_its_name_or_tag(spec):
    """orient(m, 1) and measure_quality(m, 1) died with a TypeError."""
    mesh = replace(two_blocks(), group_tags={"slave": ((2, 5),), "master": ((2, 6),), "body": ((3, 6),)})
    assert mesh.group(spec) == "slave"
    np.testing.assert_array_equal(mesh.cells_of(spec), mesh.cell_groups["slave"])
    wanted = measure_quality(mesh, "slave")
    assert measure_quality(mesh, spec).count == wanted.count
    assert orient(mesh, spec).n_cells == mesh.n_cells
    if not isinstance(spec, tuple):  # a sequence is several groups there
        assert cut_skin(mesh, spec).zones == ("slave",)
        assert lacmesh.check(mesh, spec).summary["slave_faces"] == 4
        assert lacmesh.recognise(mesh, spec) is None


@pytest.mark.parametrize("module", MODULES.split())
def test_a_module_is_there_whatever_was_imported(module):
    """`lacmesh.formats` was an AttributeError until something else had imported it."""
    code = f"import lacmesh; print(lacmesh.{module}.__name__)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.stdout.strip(), done.stderr) == (f"lacmesh.{module}", "")
    with pytest.raises(AttributeError, match="no attribute 'format'"):
        _ = lacmesh.format


# ---- the order raised


@pytest.mark.parametrize(("order", "name"), [(o, n) for o, table in TARGETS.items() for n in table])
def test_each_type_becomes_the_right_one_in_place(order, name):
    cell, target = CELLS[name], TARGETS[order][name]
    points, expected = (pad(np.reshape(CELLS[n].reference, (CELLS[n].n_nodes, cell.dim))) for n in (name, target))
    raised = raise_order(Mesh.create(points, [(name, [np.arange(cell.n_nodes)])]), order)
    assert raised.cells_by_type == {target: 1}
    np.testing.assert_allclose(raised.points[raised.block(target)[0]], expected, atol=1e-15)


@pytest.mark.fuzz
@settings(max_examples=samples(12, 30), deadline=None)
@given(seed=st.integers(0, 10**9), dim=st.sampled_from([2, 3]), order=st.sampled_from(["2", "2-full"]))
def test_random_meshes(seed, dim, order):
    mesh = random_mesh(np.random.default_rng(seed), dim)
    raised = raise_order(mesh, order)
    for owners in facets_of(raised).values():
        assert len({frozenset(nodes.tolist()) for *_, nodes in owners}) == 1, "mid-nodes differ across a facet"
    row = {int(n): k for k, n in enumerate(mesh.cell_number)}
    source = np.array([row[int(n)] for n in raised.cell_number])
    np.testing.assert_allclose(sizes(raised), sizes(mesh)[source], rtol=1e-12)
    assert set(raised.cell_number) == set(mesh.cell_number)
    for name, members in mesh.cell_groups.items():
        assert sorted(source[raised.cell_groups[name]]) == members.tolist()
    np.testing.assert_array_equal(raised.points[: mesh.n_nodes], mesh.points)
    np.testing.assert_allclose(raised.node_data["where"], raised.points, atol=1e-13)
    assert len(raised.node_groups["every"]) == raised.n_nodes
    assert len(np.unique(raised.points.round(10), axis=0)) == raised.n_nodes
    twice = raise_order(raised, order)
    assert twice.n_nodes == raised.n_nodes
    full = raise_order(raised, "2-full")
    assert same_up_to_numbers(full, raise_order(mesh, "2-full"))


def test_types_that_become_one_share_a_block_and_keep_the_file_s_order():
    x = [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0], [0.5, 0.5], [0, 0.5], [2, 0], [2, 1]]
    mesh = Mesh.create(
        x,
        [("TRIA3", [[1, 3, 2]]), ("QUAD4", [[1, 7, 8, 3]]), ("TRIA6", [[0, 1, 2, 4, 5, 6]])],
        cell_number=[5, 6, 9],
        file_order=np.array([2, 0, 1]),
        cell_groups={"linear": [0], "quadratic": [2]},
        cell_data={"colour": [0.5, 0.6, 0.9]},
    )
    raised = raise_order(mesh)
    assert [(b.type, len(b.nodes)) for b in raised.blocks] == [("TRIA6", 2), ("QUAD8", 1)]
    assert raised.n_nodes == 9 + 5  # the shared edges keep the mid-node that they have
    assert raised.cell_number.tolist() == [5, 9, 6] and raised.cell_number[raised.file_order].tolist() == [9, 5, 6]
    assert raised.cell_number[raised.cell_groups["quadratic"]].tolist() == [9]
    assert raised.cell_data["colour"].tolist() == [0.5, 0.9, 0.6]


def test_requests_that_cannot_be_met():
    mesh = cell_with_faces("HEXA8")
    for asked, order, error, words in (
        (mesh, "3", RequestError, "order is one of"),
        (cut_skin(mesh, "slave").mesh, "2", CutError, "carries a cut"),
    ):
        with pytest.raises(error, match=words):
            raise_order(asked, order)


def test_cells_that_are_quadratic_already_keep_their_own_mid_nodes():
    """Also where two of them disagree about an edge: that is for a check to say, not for us to mend."""
    x = [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0], [0.5, 0.5], [0, 0.5], [1, 0.5], [0.5, 1], [0.5, 0.5]]
    cells = [[0, 1, 2, 4, 5, 6], [1, 3, 2, 7, 8, 9]]
    raised = raise_order(Mesh.create(x, [("TRIA6", cells)]))
    np.testing.assert_array_equal(raised.block("TRIA6"), cells)


def test_new_nodes_take_the_entity_of_the_lowest_cell_they_lie_on():
    mesh = cell_with_faces("HEXA8")
    cells = np.array([[3, 1], [2, 9]], np.int32)
    nodes = np.array([[0, k + 1] for k in range(8)], np.int32)
    raised = raise_order(replace(mesh, cell_data={"entity": cells}, node_data={"entity": nodes}), "2-full")
    new = raised.node_data["entity"][8:].tolist()
    assert new.count([2, 9]) == 5 and new.count([3, 1]) == 14


# ---- curved skins


ORDERS = ("2", "2-full")


def both(mesh, order="2"):
    """The mesh with new nodes on its smooth surface, and the ways that they have there from the middles."""
    smooth, straight = (raise_order(mesh, order, surface=surface) for surface in ("smooth", "faces"))
    assert [(b.type, b.nodes.tolist()) for b in smooth.blocks] == [(b.type, b.nodes.tolist()) for b in straight.blocks]
    return smooth, smooth.points - straight.points


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("slope", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["TETRA4", "HEXA8", "PENTA6"])
def test_new_nodes_lie_on_cylinders_and_cones_up_to_their_rims(kind, slope, order):
    """Nodes on the edge of a skin lie in the plane of the end too; planes and edges inside the body stay straight."""
    mesh, z = sleeve(kind, (2, 5, 2), (1.0, 1.75), 0.6, slope=slope, jitter=0.15), 0.6
    raised, way = both(mesh, order)
    skins = [nodes_of(raised, name) for name in ("low", "high")]
    for nodes, radius in zip(skins, (1.0, 1.75), strict=True):
        r = np.linalg.norm(raised.points[nodes, :2], axis=1)
        np.testing.assert_allclose(r, radius * (1 + slope * raised.points[nodes, 2]), atol=1e-14)
    ends = np.isclose(raised.points[:, 2], 0.0) | np.isclose(raised.points[:, 2], z)
    np.testing.assert_allclose(way[ends, 2], 0.0, atol=1e-15)
    others = np.setdiff1d(np.arange(raised.n_nodes), np.concatenate(skins))
    assert (way[others] == 0).all() and validity_of(raised).min() > 0.2


@pytest.mark.parametrize("kind", ["TETRA4", "HEXA8"])
def test_new_nodes_are_near_a_skin_of_free_form(kind):
    """An elliptic sleeve: what is left of the distance from chords is that of the fits."""
    mesh = bent(sleeve(kind, (2, 12, 4), (1.0, 1.75), 0.6), lambda x: x * [1.0, 0.7, 1.0])
    raised, way = both(mesh)
    nodes = nodes_of(raised, "high")
    off = [np.abs(np.hypot(x[nodes, 0], x[nodes, 1] / 0.7) - 1.75).max() for x in (raised.points, raised.points - way)]
    assert off[0] < 0.1 * off[1]


def test_edges_at_which_a_skin_turns_by_more_than_the_crease_angle_stay_straight():
    """A bar with six sides, and flat skins, to the last bit."""
    bar = rings({"kind": "HEXA8", "n": 6, "radii": [0.4, 1.0], "heights": [0.0, 0.5]}, dim=3)
    for mesh in (bar, generate.box(2).only("body")):
        _, way = both(mesh, "2-full")
        assert (way == 0).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_a_cell_that_curved_edges_would_make_invalid_keeps_straight_ones(dim):
    """The hole of a ring goes into a layer of cells that is thinner than the arcs are high; this is warned of once."""
    kind = {2: "QUAD4", 3: "HEXA8"}[dim]
    mesh = rings({"kind": kind, "n": 10, "radii": [1.0, 1.03, 2.0], "heights": [0.0, 0.5][: dim - 1]}, dim=dim)
    with pytest.warns(LacmeshWarning, match="10 cells on curved surfaces keep straight edges") as told:
        raised = raise_order(mesh)
    assert len(told) == 1 and validity_of(raised).min() > 0.2
    inner, outer = (nodes_of(raised, name) for name in ("inner", "outer"))
    assert np.linalg.norm(raised.points[inner, :2], axis=1).min() < 0.96
    np.testing.assert_allclose(np.linalg.norm(raised.points[outer, :2], axis=1), 2.0, atol=1e-14)
