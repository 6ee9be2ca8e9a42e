"""meshio, pyvista and trimesh: formats through meshio, whose faults are said; meshes there and back, and what they see.

What a format of meshio keeps is in `test_formats_table.py`, as files that are cut short."""

from __future__ import annotations

import re
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from lacmesh.cells import ALL_CELLS, CELLS, PIECES
from lacmesh.cutting.cut import Cut, cut_skin
from lacmesh.errors import DataError, GroupNotFoundError, LacmeshWarning, ReadError, RequestError, WriteError
from lacmesh.exchange.libraries import from_meshio, to_meshio, to_pyvista, to_trimesh
from lacmesh.formats import detect_format, read, title_of, write
from lacmesh.formats.by_meshio import misplaced_mid_nodes
from lacmesh.formats.orders import VTK_CELLS
from lacmesh.mesh import Mesh
from lacmesh.reference.shapes import shape
from tests.bad_input.case import small_files
from tests.formats.feature_cases import bare, one_cell, solid
from tests.formats.msh_meshes import order, plain
from tests.meshes import random_mesh

meshio = pytest.importorskip("meshio")


@pytest.mark.parametrize("name", ["a.vtk", "a.mesh", "a.off", "a.ply"])
@pytest.mark.parametrize("size", [0, 20])
def test_a_full_disk_is_told_as_one_whatever_meshio_warns_of(name, size, tmp_path):
    mesh = Mesh.create([[0, 0], [1, 0], [0, 1], [1, 1]], [("TRIA3", [[0, 1, 2], [1, 3, 2]])])
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        words = r"cannot be written \((File too large|not all of it was taken)"
        with small_files(size), pytest.raises(WriteError, match=words):
            write(tmp_path / name, mesh)
    finally:
        signal.signal(signal.SIGXFSZ, before)
    assert not list(tmp_path.iterdir())


_POINTS = "POINTS 8 double\n0 0 0 1 0 0 0 1 0 1 1 0 0 0 1 1 0 1 0 1 1 1 1 1\n"


def of_vtk(path, cells, data=""):
    """A file of VTK of a cube's corners; `cells`: (VTK's number of their type, nodes)."""
    offsets = " ".join(map(str, np.cumsum([0, *(len(nodes) for _, nodes in cells)])))
    listed = " ".join(str(n) for _, nodes in cells for n in nodes)
    head = f"# vtk DataFile Version 5.1\na cube\nASCII\nDATASET UNSTRUCTURED_GRID\n{_POINTS}"
    rows = f"OFFSETS vtktypeint64\n{offsets}\nCONNECTIVITY vtktypeint64\n{listed}\n"
    types = "\n".join(str(number) for number, _ in cells)
    text = f"{head}CELLS {len(cells) + 1} {len(listed.split())}\n{rows}CELL_TYPES {len(cells)}\n{types}\n{data}"
    path.write_text(text)
    return path


def test_cells_that_meshio_drops_are_named(tmp_path):
    voxel, line, tetra = (11, range(8)), (4, (0, 1, 3)), (10, (0, 1, 2, 4))
    with pytest.raises(ReadError, match=r"a\.vtk: has no cells .*\(type 11, voxels\)\); .*\.vtu"):
        read(of_vtk(tmp_path / "a.vtk", [voxel]))
    with pytest.warns(LacmeshWarning) as said:
        mesh = read(of_vtk(tmp_path / "b.vtk", [voxel, tetra, voxel, line]))
    assert mesh.cells_by_type == {"TETRA4": 1} and len(said) == 1
    assert re.search(r"^b\.vtk.*\(type 11, voxels\);.*\(type 4, lines of several pieces\)$", str(said[0].message))
    colours = "POINT_DATA 8\nCOLOR_SCALARS the%20tint 1\n" + "0.5 " * 8 + "\n"
    with pytest.warns(LacmeshWarning, match=r"the colours 'the tint'"):
        assert read(of_vtk(tmp_path / "a.vtk", [tetra], colours)).node_data == {}


def test_what_meshio_warns_of_is_one_warning(tmp_path, monkeypatch, capfd):
    from meshio._common import info, warn

    long = "that is " + "rather long, " * 12 + "for one line"

    def speak(*args, **options):
        for word in ("Skipping some time data.", long):
            warn(word)
            info("not for the user")
            warn(word)
        return meshio.Mesh(bare().points, [("tetra", bare().block("TETRA4"))])

    monkeypatch.setattr(meshio, "read", speak)
    monkeypatch.setenv("FORCE_COLOR", "1")
    (tmp_path / "a.stl").write_text("solid\nendsolid\n")
    with pytest.warns(LacmeshWarning) as said:
        read(tmp_path / "a.stl")
    assert [str(w.message).split(": ")[1] for w in said] == [f"Skipping some time data; {long}"]
    assert capfd.readouterr() == ("", "")


def test_a_third_component_is_said(tmp_path):
    u = np.arange(14.0).reshape(7, 2)
    with pytest.warns(LacmeshWarning, match=r"'u' have 2 components \(a third, 0, is added\)$"):
        write(tmp_path / "a.vtk", bare(node_data={"u": u}))
    assert read(tmp_path / "a.vtk").node_data["u"].tolist() == np.pad(u, ((0, 0), (0, 1))).tolist()


def test_cells_that_come_out_otherwise_are_an_error(tmp_path):
    with pytest.raises(WriteError, match=r"0 TETRA4 of 4 are left"):
        write(tmp_path / "a.off", solid())
    with pytest.raises(WriteError, match=r"cells of type TETRA10 .* not written as medit"):
        write(tmp_path / "a.mesh", one_cell("TETRA10"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("error", [SystemExit(1), KeyError("x"), MemoryError(), AssertionError()])
def test_whatever_meshio_raises_is_one_error(error, tmp_path, monkeypatch, capfd):
    def fail(*args, **options):
        print("Error: meshio says a word", file=sys.stderr)
        raise error

    (tmp_path / "a.stl").write_text("solid\nendsolid\n")
    monkeypatch.setattr(meshio, "read", fail)
    with pytest.raises(ReadError, match=rf"meshio fails \({type(error).__name__}: Error: meshio says a word\)"):
        read(tmp_path / "a.stl")
    monkeypatch.setattr(meshio, "write", fail)
    with pytest.raises(WriteError, match=r"b\.stl: meshio fails"):
        write(tmp_path / "b.stl", bare())
    assert [p.name for p in tmp_path.iterdir()] == ["a.stl"] and capfd.readouterr().err == ""


def test_files_that_are_not_what_their_suffix_says(tmp_path):
    (tmp_path / "a.stl").write_text("nonsense")
    with pytest.raises(ReadError):
        read(tmp_path / "a.stl")
    write(tmp_path / "a.vtu", bare())
    (tmp_path / "a.vtu").rename(tmp_path / "a.msh")
    assert detect_format(tmp_path / "a.msh").format == "vtu" and title_of(tmp_path / "a.msh") == "VTU"
    assert read(tmp_path / "a.msh").cells_by_type == {"TETRA4": 4}
    (tmp_path / "b.nas").write_text("$ a comment\nGRID    1               0.      0.      0.\n")
    assert detect_format(tmp_path / "b.nas").format == "nastran"
    with pytest.importorskip("h5py").File(tmp_path / "a.cgns", "w") as file:
        file.create_group("CGNSLibraryVersion")
    with pytest.raises(ReadError, match="is a CGNS file"):
        read(tmp_path / "a.cgns")


def test_mid_nodes_far_from_their_edges_are_seen(tmp_path):
    mesh = one_cell("TETRA10")
    assert misplaced_mid_nodes(mesh) == ""
    swapped = Mesh.create(mesh.points, [("TETRA10", mesh.block("TETRA10")[:, [0, 1, 2, 3, 5, 4, 6, 7, 8, 9]])])
    assert misplaced_mid_nodes(swapped) == "TETRA10 1"
    meshio.write(tmp_path / "a.bdf", meshio.Mesh(mesh.points, [("tetra10", swapped.block("TETRA10"))]))
    with pytest.raises(ReadError, match="mid-nodes far from their edges as meshio reads nastran"):
        read(tmp_path / "a.bdf")


# meshio
@pytest.mark.parametrize("seed", range(12))
def test_meshio_gives_back_what_it_got(seed):
    mesh = random_mesh(np.random.default_rng(seed), dim=2 + seed % 2, order=1 + seed // 6)
    back = from_meshio(to_meshio(mesh))
    assert plain(mesh) == plain(back) and order(mesh) == order(back)


@pytest.mark.parametrize("kind", ALL_CELLS)
def test_every_type_goes_through_meshio(kind):
    n = ALL_CELLS[kind].n_nodes
    mesh = Mesh.create(np.random.default_rng(0).random((n, 3)), [(kind, [np.random.default_rng(1).permutation(n)])])
    given = to_meshio(mesh)
    if kind in VTK_CELLS and kind in CELLS:  # meshio's own order is VTK's
        assert given.cells[0].data[0].tolist() == mesh.blocks[0].nodes[0][list(VTK_CELLS[kind].nodes)].tolist()
    assert plain(from_meshio(given)) == plain(mesh)


def test_a_cut_goes_through_meshio():
    cut = cut_skin(solid(cell_groups={"slave": [4, 5]}), "slave")
    given = to_meshio(cut.mesh)
    assert Cut(from_meshio(given)).zones == ("slave",)
    given.info = None
    assert Cut(from_meshio(given)).n_macros == cut.n_macros


def test_blocks_that_repeat_a_type_become_one():
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
@pytest.mark.parametrize("kind", VTK_CELLS)
def test_pyvista_has_every_type_of_vtk(kind):
    pytest.importorskip("pyvista")
    n = ALL_CELLS[kind].n_nodes
    grid = to_pyvista(Mesh.create(np.random.default_rng(0).random((n, 3)), [(kind, [range(n)])]))
    assert grid.n_cells == 1 and int(grid.celltypes[0]) == VTK_CELLS[kind].number
    assert list(grid.get_cell(0).point_ids) == list(VTK_CELLS[kind].nodes)


# trimesh
@pytest.mark.parametrize("kind", [kind for kind in PIECES if CELLS[kind].dim == 2])
def test_triangles_tile_the_face(kind):
    """In the reference element: the triangles turn as the face, use every node, and their areas make its area."""
    x = np.array(CELLS[kind].reference)[np.array(PIECES[kind])]
    areas = np.linalg.det(np.stack([x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]], axis=1)) / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx({"TRIA": 0.5, "QUAD": 4}[CELLS[kind].family], rel=1e-14)
    assert set(np.ravel(PIECES[kind])) == set(range(CELLS[kind].n_nodes))
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


MISSING = {
    "lacmesh[io]": [to_meshio, lambda m: to_trimesh(m, "a"), lambda m: write("a.stl", m), lambda m: read("a.stl")],
    "lacmesh[view]": [to_pyvista],
}


@pytest.mark.parametrize("extra", MISSING)
def test_what_is_missing_is_named_with_the_line_that_installs_it(extra, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("a.stl").write_text("solid\nendsolid\n")
    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: None)
    for call in MISSING[extra]:
        with pytest.raises(RequestError, match=rf"pip install '{re.escape(extra)}'"):
            call(solid())


def test_cells_that_others_lack_are_an_error():
    with pytest.raises(DataError, match="type 'polygon' are not read"):
        from_meshio(meshio.Mesh(np.eye(5, 3), [("polygon", [[0, 1, 2, 3, 4]])]))
    pytest.importorskip("pyvista")
    with pytest.raises(DataError, match="no cells of type PYRAM14"):
        to_pyvista(one_cell("PYRAM14"))
