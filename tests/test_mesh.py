"""The mesh as a value: nothing writes into it, groups are named alike everywhere, modules are there when named."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh, cut_skin, measure_quality, orient
from lacmesh.errors import GroupNotFoundError
from lacmesh.mesh import Periodic
from tests.checks.blocks import two_blocks


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
            for change in (
                lambda d: d.__setitem__("new", 1),
                lambda d: d.update(new=1),
                lambda d: d.clear(),
                lambda d: d.setdefault("new", 1),
            ):
                with pytest.raises(TypeError, match="another mesh"):
                    change(held)
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
        np.testing.assert_array_equal(made.points, mesh.points)
        assert dict(made.cell_groups).keys() == mesh.cell_groups.keys()
        for array in arrays(made):
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


@pytest.mark.parametrize("spec", [7, (2, 7), "2:7"])
def test_a_tag_that_is_not_there(spec):
    mesh = two_blocks()
    for ask in (orient, measure_quality):
        with pytest.raises(GroupNotFoundError, match="no cell group named '"):
            ask(mesh, spec)


@pytest.mark.parametrize("module", ["formats", "mesh", "errors", "checks", "quality", "surface", "gmsh", "cutting"])
def test_a_module_is_there_whatever_was_imported(module):
    """`lacmesh.formats` was an AttributeError until something else had imported it."""
    done = subprocess.run(
        [sys.executable, "-c", f"import lacmesh; print(lacmesh.{module}.__name__)"],
        capture_output=True,
        text=True,
    )
    assert (done.stdout.strip(), done.stderr) == (f"lacmesh.{module}", "")


def test_what_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'lacmesh' has no attribute 'format'"):
        _ = lacmesh.format
