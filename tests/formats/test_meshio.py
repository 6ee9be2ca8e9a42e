"""Formats through meshio: what it breaks is an error, what it loses is said, and nothing is left half-written."""

from __future__ import annotations

import signal
import sys
from dataclasses import replace

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacmesh.cutting.cut import cut_skin
from lacmesh.errors import LacmeshWarning, ReadError, RequestError, WriteError
from lacmesh.formats import detect_format, read, title_of, write
from lacmesh.formats.meshio_mesh import NAMES
from lacmesh.formats.round_trip import match, misplaced_mid_nodes, round_trip_losses
from lacmesh.formats.table import OF_NAME
from lacmesh.formats.vtu.types import OF_TYPE
from lacmesh.mesh import Mesh
from tests.formats.feature_cases import OF_MESHIO, bare, one_cell, solid

meshio = pytest.importorskip("meshio")


@pytest.mark.vtk
@pytest.mark.parametrize("kind", sorted(OF_NAME["vtk"].fidelity[0].takes))
def test_vtk_takes_cells_for_what_they_are(kind, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    mesh = one_cell(kind)
    write(tmp_path / "a.vtk", mesh)
    grid = pyvista.read(tmp_path / "a.vtk")
    assert int(grid.celltypes[0]) == OF_TYPE[kind].number
    assert list(grid.get_cell(0).point_ids) == list(OF_TYPE[kind].nodes)
    grid.save(tmp_path / "b.vtk")
    assert read(tmp_path / "b.vtk").block(kind).tolist() == mesh.block(kind).tolist()


@pytest.mark.parametrize("name", ["a.vtk", "a.mesh", "a.off", "a.ply"])
@pytest.mark.parametrize("size", [0, 20])
def test_a_full_disk_is_told_as_one_whatever_meshio_warns_of(name, size, tmp_path):
    resource = pytest.importorskip("resource")
    mesh = Mesh.create([[0, 0], [1, 0], [0, 1], [1, 1]], [("TRIA3", [[0, 1, 2], [1, 3, 2]])])
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        with pytest.raises(WriteError, match=r"cannot be written \((File too large|not all of it was taken)"):
            write(tmp_path / name, mesh)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert not list(tmp_path.iterdir())


@pytest.mark.vtk
def test_vtk_finds_every_array_by_its_name(tmp_path):
    """Groups, numbers, the records of a cut and fields, of all kinds of numbers, as VTK reads them."""
    pyvista = pytest.importorskip("pyvista")
    groups = {"slave": [4, 5], "Körper 100%20": [0, 1], 'a "b"\t%': [1, 2], "empty": []}
    mesh = cut_skin(
        solid(cell_groups=groups, node_groups={"a corner": [0, 3]}, cell_number=range(101, 108)), "slave"
    ).mesh
    n = mesh.n_nodes
    fields = {
        dtype: np.arange(n).astype(dtype) for dtype in ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "f4", "f8", "?")
    }
    fields |= {
        "big": np.full(n, 2**64 - 5, np.uint64),
        "gap": np.full(n, np.nan),
        "move": np.arange(3.0 * n).reshape(n, 3),
    }
    mesh = replace(mesh, node_data={**mesh.node_data, **fields})
    write(tmp_path / "a.vtk", mesh)
    grid = pyvista.read(tmp_path / "a.vtk")
    for found, groups, data, numbers, key in (
        (grid.cell_data, mesh.cell_groups, mesh.cell_data, mesh.cell_number, "cell_number"),
        (grid.point_data, mesh.node_groups, mesh.node_data, mesh.node_number, "node_number"),
    ):
        marks = {f"group:{g}": np.isin(np.arange(len(numbers)), members) for g, members in groups.items()}
        wanted = {key: numbers, **marks, **data}
        assert set(found.keys()) == set(wanted)
        for name, values in wanted.items():
            np.testing.assert_array_equal(np.asarray(found[name]), np.asarray(values), err_msg=name)
    back = read(tmp_path / "a.vtk")
    assert back.cell_groups.keys() == mesh.cell_groups.keys() and back.node_groups["a corner"].tolist() == [0, 3]


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
    with pytest.raises(
        ReadError, match=r"a\.vtk: has no cells as meshio reads it \(File .*\(type 11, voxels\)\); .*\.vtu"
    ):
        read(of_vtk(tmp_path / "a.vtk", [voxel]))
    with pytest.warns(LacmeshWarning) as said:
        mesh = read(of_vtk(tmp_path / "b.vtk", [voxel, tetra, voxel, line]))
    cannot = "File contains cells that meshio cannot handle"
    assert [str(w.message) for w in said] == [
        f"b.vtk as meshio reads it: {cannot} (type 11, voxels); {cannot} (type 4, lines of several pieces)"
    ]
    assert mesh.cells_by_type == {"TETRA4": 1}


def test_colours_that_meshio_skips_are_named(tmp_path):
    path = of_vtk(
        tmp_path / "a.vtk", [(10, (0, 1, 2, 4))], "POINT_DATA 8\nCOLOR_SCALARS the%20tint 1\n" + "0.5 " * 8 + "\n"
    )
    with pytest.warns(LacmeshWarning, match=r"^a\.vtk as meshio reads it: the colours 'the tint' are left out$"):
        assert read(path).node_data == {}


def test_what_meshio_warns_of_is_one_warning(tmp_path, monkeypatch, capfd):
    from meshio._common import info, warn

    def speak(*args, **options):
        for word in ("Skipping some time data.", "that is " + "rather long, " * 12 + "for one line"):
            warn(word)
            info("not for the user")
            warn(word)
        return meshio.Mesh(bare().points, [("tetra", bare().block("TETRA4"))])

    monkeypatch.setattr(meshio, "read", speak)
    monkeypatch.setenv("FORCE_COLOR", "1")
    (tmp_path / "a.stl").write_text("solid\nendsolid\n")
    with pytest.warns(LacmeshWarning) as said:
        read(tmp_path / "a.stl")
    long = "that is " + "rather long, " * 12 + "for one line"
    assert [str(w.message) for w in said] == [f"a.stl as meshio reads it: Skipping some time data; {long}"]
    assert capfd.readouterr() == ("", "")


def test_a_third_component_is_said(tmp_path):
    u = np.arange(14.0).reshape(7, 2)
    with pytest.warns(
        LacmeshWarning, match=r"loses that the node data 'u' have 2 components \(a third, 0, is added\)$"
    ):
        write(tmp_path / "a.vtk", bare(node_data={"u": u}))
    assert read(tmp_path / "a.vtk").node_data["u"].tolist() == np.pad(u, ((0, 0), (0, 1))).tolist()


@pytest.mark.vtk
@pytest.mark.parametrize("suffix", [".e", ".avs"])
@pytest.mark.parametrize("kind", ["TRIA3", "QUAD4", "TETRA4", "HEXA8", "PENTA6", "PYRAM5"])
def test_vtk_reads_linear_cells_of_other_formats(kind, suffix, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    mesh = one_cell(kind)
    write(tmp_path / f"a{suffix}", mesh)
    grid = pyvista.read(tmp_path / f"a{suffix}")
    grid = grid.combine() if isinstance(grid, pyvista.MultiBlock) else grid
    np.testing.assert_allclose(grid.points[grid.get_cell(0).point_ids], mesh.points, rtol=1e-6)


@pytest.mark.gmsh
@pytest.mark.parametrize(
    ("suffix", "kind"),
    [
        (s, k)
        for s in (".mesh", ".obj", ".stl")
        for k in ("TRIA3", "QUAD4", "TETRA4", "HEXA8")
        if s == ".mesh" or k == "TRIA3"
    ],
)
def test_gmsh_reads_linear_cells_of_other_formats(suffix, kind, tmp_path):
    gmsh = pytest.importorskip("gmsh")
    mesh = one_cell(kind)
    write(tmp_path / f"a{suffix}", mesh)
    gmsh.initialize(["-nt", "1", "-v", "0"], readConfigFiles=False)
    try:
        gmsh.merge(str(tmp_path / f"a{suffix}"))
        types, _, nodes = gmsh.model.mesh.getElements()
        tags, x, _ = gmsh.model.mesh.getNodes()
    finally:
        gmsh.finalize()
    place = {tag: point for tag, point in zip(tags.tolist(), x.reshape(-1, 3), strict=True)}
    here = types.tolist().index(CELLS[kind].msh)
    np.testing.assert_allclose([place[n] for n in nodes[here].tolist()], mesh.points, atol=1e-6)


def test_a_cgns_file_is_named(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.cgns", "w") as file:
        file.create_group("CGNSLibraryVersion")
    with pytest.raises(ReadError, match=r"is a CGNS file, which is not read; gmsh makes a \.msh of it"):
        read(tmp_path / "a.cgns")


@pytest.mark.parametrize("suffix", sorted(OF_MESHIO))
def test_a_surface_or_solid_goes_there_and_back(suffix, tmp_path):
    """The cells of a mesh that the format takes, whatever else it loses."""
    mesh = Mesh.create(bare().points, [("TRIA3", [[0, 2, 1], [0, 1, 3], [4, 5, 6]])])
    if suffix in (".f3grid", ".su2"):
        mesh = bare()
    try:
        write(tmp_path / f"a{suffix}", mesh)
    except LacmeshWarning as said:  # warnings are errors here
        assert "loses" in str(said)
        with pytest.warns(LacmeshWarning):
            write(tmp_path / f"a{suffix}", mesh)
    back = read(tmp_path / f"a{suffix}")
    assert back.cells_by_type == mesh.cells_by_type
    kind = mesh.blocks[0].type
    np.testing.assert_allclose(back.points[back.block(kind)], mesh.points[mesh.block(kind)], atol=1e-6)
    assert detect_format(tmp_path / f"a{suffix}").format == OF_MESHIO[suffix]


def test_what_is_lost_is_said(tmp_path):
    mesh = solid(cell_groups={"slave": [4, 5]}, node_number=range(10, 80, 10), cell_data={"x": np.arange(7.0)})
    with pytest.warns(LacmeshWarning) as said:
        write(tmp_path / "a.mesh", mesh)
    assert [str(w.message) for w in said] == [
        "written by meshio as medit, which loses the cell groups 'slave'; "
        "the numbers of nodes (they are 1, 2, ...); the cell data 'x'"
    ]


def test_cells_that_come_out_otherwise_are_an_error(tmp_path):
    with pytest.raises(WriteError, match=r"format off does not keep the cells \(0 TETRA4 of 4 are left\)"):
        write(tmp_path / "a.off", solid())
    with pytest.raises(WriteError, match=r"a\.mesh: cells of type TETRA10 \(the mesh has 1\) are not written as medit"):
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


def test_without_meshio_the_line_that_installs_it(tmp_path, monkeypatch):
    (tmp_path / "a.stl").write_text("solid\nendsolid\n")
    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: None)
    for call in (lambda: read(tmp_path / "a.stl"), lambda: write(tmp_path / "b.stl", bare())):
        with pytest.raises(RequestError, match=r"this needs meshio; pip install 'lacmesh\[io\]' brings it"):
            call()


def test_mid_nodes_far_from_their_edges_are_seen(tmp_path):
    mesh = one_cell("TETRA10")
    assert misplaced_mid_nodes(mesh) == ""
    swapped = Mesh.create(mesh.points, [("TETRA10", mesh.block("TETRA10")[:, [0, 1, 2, 3, 5, 4, 6, 7, 8, 9]])])
    assert misplaced_mid_nodes(swapped) == "TETRA10 1"
    meshio.write(tmp_path / "a.bdf", meshio.Mesh(mesh.points, [("tetra10", swapped.block("TETRA10"))]))
    with pytest.raises(ReadError, match="mid-nodes far from their edges as meshio reads nastran"):
        read(tmp_path / "a.bdf")


def test_names_are_meshios():
    from meshio._common import num_nodes_per_cell

    for ours, theirs in NAMES.items():
        count = num_nodes_per_cell.get(theirs)
        assert count in (None, OF_TYPE[ours].nodes and len(OF_TYPE[ours].nodes) if ours in OF_TYPE else count), ours
    assert NAMES["TETRA10"] == "tetra10" and NAMES["POI1"] == "vertex" and NAMES["PENTA15"] == "wedge15"


def test_losses_of_nothing_are_none():
    mesh = solid(cell_groups={"slave": [4, 5]}, node_data={"x": np.arange(7.0)})
    where = match(mesh, mesh)
    assert not isinstance(where, str) and round_trip_losses(mesh, mesh, where) == []
    assert match(mesh, bare()) == "0 TRIA3 of 3"
