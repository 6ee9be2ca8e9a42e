"""meshio, pyvista and trimesh: there and back, and what they see."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.cutting.cut import Cut, cut_skin
from lacmesh.errors import DataError, GroupNotFoundError, RequestError
from lacmesh.exchange.libraries import TRIANGLES, from_meshio, to_meshio, to_pyvista, to_trimesh
from lacmesh.formats import write
from lacmesh.formats.vtu.types import OF_TYPE
from lacmesh.mesh import Mesh
from lacmesh.reference.shapes import shape
from tests.formats.feature_cases import one_cell, solid
from tests.formats.msh_meshes import order, plain
from tests.meshes import random_mesh

# meshio


@pytest.mark.parametrize("seed", range(12))
def test_meshio_gives_back_what_it_got(seed):
    pytest.importorskip("meshio")
    mesh = random_mesh(np.random.default_rng(seed), dim=2 + seed % 2, order=1 + seed // 6)
    back = from_meshio(to_meshio(mesh))
    assert plain(mesh) == plain(back) and order(mesh) == order(back)


@pytest.mark.parametrize("kind", ALL_CELLS)
def test_every_type_goes_through_meshio(kind):
    pytest.importorskip("meshio")
    n = ALL_CELLS[kind].n_nodes
    mesh = Mesh.create(np.random.default_rng(0).random((n, 3)), [(kind, [np.random.default_rng(1).permutation(n)])])
    given = to_meshio(mesh)
    if kind in OF_TYPE and kind in CELLS:  # meshio's own order is VTK's
        assert given.cells[0].data[0].tolist() == mesh.blocks[0].nodes[0][list(OF_TYPE[kind].nodes)].tolist()
    assert plain(from_meshio(given)) == plain(mesh)


def test_a_cut_goes_through_meshio():
    pytest.importorskip("meshio")
    cut = cut_skin(solid(cell_groups={"slave": [4, 5]}), "slave")
    given = to_meshio(cut.mesh)
    assert Cut(from_meshio(given)).zones == ("slave",)
    given.info = None
    assert Cut(from_meshio(given)).n_macros == cut.n_macros


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_what_meshio_reads_from_gmsh_has_groups(version, tmp_path):
    meshio = pytest.importorskip("meshio")
    mesh = solid(cell_groups={"body": [0, 1, 2, 3], "slave": [4, 5, 6]})
    write(tmp_path / "a.msh", mesh, msh=version)
    found = from_meshio(meshio.read(tmp_path / "a.msh"))
    assert {name: len(cells) for name, cells in found.cell_groups.items()} == {"body": 4, "slave": 3}
    assert found.cells_by_type == mesh.cells_by_type


def test_cells_that_we_lack_are_an_error():
    meshio = pytest.importorskip("meshio")
    with pytest.raises(DataError, match="cells of meshio's type 'polygon' are not read"):
        from_meshio(meshio.Mesh(np.eye(5, 3), [("polygon", [[0, 1, 2, 3, 4]])]))


def test_blocks_that_repeat_a_type_become_one():
    meshio = pytest.importorskip("meshio")
    blocks = [("triangle", [[0, 1, 2]]), ("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 2, 3]])]
    given = meshio.Mesh(np.eye(4, 3), blocks, cell_data={"x": [[1], [2], [3]]}, cell_sets={"a": [[0], [], [0]]})
    mesh = from_meshio(given)
    assert mesh.cells_by_type == {"TRIA3": 2, "QUAD4": 1}
    assert mesh.cell_data["x"][mesh.file_order].tolist() == [1, 2, 3]
    assert mesh.cell_data["x"][mesh.cell_groups["a"]].tolist() == [1, 3]


# pyvista


@pytest.mark.vtk
def test_pyvista_has_cells_groups_data_and_numbers():
    pytest.importorskip("pyvista")
    mesh = random_mesh(np.random.default_rng(8), slaves=4)
    grid, rows = to_pyvista(mesh), mesh.file_order
    np.testing.assert_array_equal(grid.points, mesh.points)
    np.testing.assert_array_equal(grid.cell_data["cell_number"], mesh.cell_number[rows])
    np.testing.assert_array_equal(grid.point_data["node_number"], mesh.node_number)
    np.testing.assert_array_equal(
        np.flatnonzero(grid.cell_data["group:slave"]), np.flatnonzero(np.isin(rows, mesh.cell_groups["slave"]))
    )
    np.testing.assert_array_equal(grid.cell_data["colour"], mesh.cell_data["colour"][rows])
    np.testing.assert_array_equal(grid.point_data["where"], mesh.node_data["where"])
    solid_cells = mesh.cell_dim[rows] == 3
    assert (grid.compute_cell_sizes()["Volume"][solid_cells] > 0).all()
    few = to_pyvista(mesh, groups=False, data=False)
    assert set(few.cell_data) == {"cell_number"} and set(few.point_data) == {"node_number"}


@pytest.mark.vtk
@pytest.mark.parametrize("kind", OF_TYPE)
def test_pyvista_has_every_type_of_vtk(kind):
    pytest.importorskip("pyvista")
    n = ALL_CELLS[kind].n_nodes
    grid = to_pyvista(Mesh.create(np.random.default_rng(0).random((n, 3)), [(kind, [range(n)])]))
    assert grid.n_cells == 1 and int(grid.celltypes[0]) == OF_TYPE[kind].number
    assert list(grid.get_cell(0).point_ids) == list(OF_TYPE[kind].nodes)


@pytest.mark.vtk
def test_a_cell_that_vtk_lacks_is_an_error():
    pytest.importorskip("pyvista")
    with pytest.raises(DataError, match="VTK has no cells of type PYRAM14, the mesh has 1"):
        to_pyvista(one_cell("PYRAM14"))


# trimesh


@pytest.mark.parametrize("kind", TRIANGLES)
def test_triangles_tile_the_face(kind):
    """In the reference element: the triangles turn as the face, use every node, and their areas make its area."""
    x = np.array(CELLS[kind].reference)[np.array(TRIANGLES[kind])]
    areas = np.linalg.det(np.stack([x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]], axis=1)) / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx({"TRIA": 0.5, "QUAD": 4}[CELLS[kind].family], rel=1e-14)
    assert set(np.ravel(TRIANGLES[kind])) == set(range(CELLS[kind].n_nodes))
    assert shape(kind, x.reshape(-1, 2)) is not None


def test_trimesh_has_the_faces_of_a_group():
    trimesh = pytest.importorskip("trimesh")
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [9, 9, 9], [2, 1, 0]], float)
    mesh = Mesh.create(
        points,
        [("TRIA3", [[1, 4, 2]]), ("QUAD4", [[0, 1, 2, 3]]), ("SEG2", [[0, 1]])],
        cell_groups={"slave": [0, 1, 2], "line": [2]},
        cell_number=[30, 10, 20],
        node_number=range(100, 107),
    )
    skin = to_trimesh(mesh, "slave")
    assert isinstance(skin, trimesh.Trimesh) and skin.area == pytest.approx(1.5, rel=1e-14)
    assert skin.metadata["cell"].tolist() == [0, 1, 1] and skin.metadata["cell_number"].tolist() == [30, 10, 10]
    assert skin.metadata["node"].tolist() == [0, 1, 2, 3, 4]
    assert skin.metadata["node_number"].tolist() == [100, 101, 102, 103, 104]
    np.testing.assert_array_equal(skin.vertices, points[:5])
    assert (skin.face_normals == [0, 0, 1]).all()
    with pytest.raises(DataError, match="'line' has no faces of dimension 2"):
        to_trimesh(mesh, "line")
    with pytest.raises(GroupNotFoundError, match="did you mean slave"):
        to_trimesh(mesh, "slav")


# Without them


@pytest.mark.parametrize(
    ("call", "extra"),
    [
        (lambda m: to_meshio(m), "meshio; pip install 'lacmesh[io]'"),
        (lambda m: to_pyvista(m), "pyvista; pip install 'lacmesh[view]'"),
        (lambda m: to_trimesh(m, "a"), "trimesh; pip install 'lacmesh[io]'"),
    ],
    ids=["meshio", "pyvista", "trimesh"],
)
def test_what_is_missing_is_named_with_the_line_that_installs_it(call, extra, monkeypatch):
    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: None)
    with pytest.raises(RequestError) as caught:
        call(solid())
    assert extra in str(caught.value)
