"""XDMF: what we write and read again is the same; its structure is what dolfinx asks for; VTK and meshio read it.

dolfinx itself is not run here: `as_dolfinx` does what its `XDMFFile` does with a file (xdmf_utils.cpp, xdmf_mesh.cpp,
HDF5Interface.h), step by step.
"""

from __future__ import annotations

import json
import warnings
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshWarning, ReadError, RequestError, WriteError
from lacmesh.formats import read, write, xdmf
from lacmesh.formats.vtu.types import OF_TYPE as VTK_OF_TYPE
from lacmesh.formats.xdmf.mixed import starts
from lacmesh.formats.xdmf.types import ALIASES, OF_NAME, OF_NUMBER, OF_TYPE, XDMF_TYPES
from lacmesh.formats.xdmf.writer import told
from lacmesh.mesh import Mesh
from tests.formats.feature_cases import one_cell, solid
from tests.formats.msh_meshes import meshes, same
from tests.meshes import box
from tests.samples import samples

KINDS = tuple(OF_TYPE)


def test_the_table_is_sound():
    assert len(OF_TYPE) == len(OF_NAME) == len(OF_NUMBER) == len(XDMF_TYPES)
    assert set(ALIASES.values()) <= set(OF_NAME) and not set(ALIASES) & set(OF_NAME)
    assert set(CELLS) - set(OF_TYPE) == {"TRIA7", "PYRAM14"}


@pytest.mark.fuzz
@settings(max_examples=samples(20, 100), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mesh=meshes(kinds=KINDS))
def test_what_is_written_is_read(mesh, tmp_path):
    for options in ({}, {"binary": False}, {"compress": True}):
        path = tmp_path / "mesh.xdmf"
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            write(path, mesh, **options)
            assert same(mesh, read(path)) == [], options


def test_both_files_are_written_or_none(tmp_path):
    path, heavy = tmp_path / "a.xdmf", tmp_path / "a.h5"
    heavy.write_bytes(b"precious")
    with pytest.raises(WriteError, match="lacmesh did not write it"):
        write(path, solid())
    assert heavy.read_bytes() == b"precious" and len(list(tmp_path.iterdir())) == 1
    heavy.unlink()
    write(path, solid())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5", "a.xdmf"]
    before = heavy.read_bytes()
    with pytest.raises(WriteError):
        write(path, one_cell("PYRAM14"))
    with pytest.raises(RequestError, match="exists already"):
        write(path, solid(), force=False)
    path.unlink()
    with pytest.raises(RequestError, match=r"a\.h5 exists already"):
        write(path, solid(), force=False)
    assert heavy.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["a.h5"]
    with pytest.raises(ReadError, match=r"read the \.xdmf file"):
        read(heavy)


def test_halves_that_do_not_belong_together_are_noticed(tmp_path):
    write(tmp_path / "a.xdmf", solid())
    write(tmp_path / "b.xdmf", solid(cell_groups={"slave": [4]}))
    (tmp_path / "b.h5").replace(tmp_path / "a.h5")
    with pytest.raises(ReadError, match="not the file that was written"):
        read(tmp_path / "a.xdmf")
    (tmp_path / "a.h5").unlink()
    with pytest.raises(ReadError, match=r"a\.h5, which is not beside it"):
        read(tmp_path / "a.xdmf")


# What dolfinx asks for
#: what its reader knows, and the nodes of each
DOLFINX = {
    "polyvertex": 1, "polyline": 2, "edge_3": 3, "triangle": 3, "triangle_6": 6, "tetrahedron": 4, "tetrahedron_10": 10,
    "quadrilateral": 4, "quadrilateral_9": 9, "quadrilateral_16": 16, "hexahedron": 8, "hexahedron_27": 27,
}  # fmt: skip


def as_dolfinx(path, name, attribute=None):
    """Cells (k, n), points, and the values of an attribute, of the grid `name`: as read_mesh and read_meshtags do."""
    root = ElementTree.parse(path).getroot()
    assert root.tag == "Xdmf" and root.find("Domain") is not None
    grid = root.find("Domain").find(f"Grid[@Name='{name}']")
    heavy = path.with_suffix(".h5")  # dolfinx opens this file, whatever the items say

    def dataset(parent, dtype):
        item = parent.find("DataItem")
        assert item.get("Format") == "HDF"
        file, inside = item.text.strip().split(":")
        shape = [int(n) for n in item.get("Dimensions").split(" ")]
        with h5py.File(heavy, "r") as found:
            values = found[inside]
            assert file == heavy.name and list(values.shape) == shape and len(shape) <= 2
            assert values.dtype == dtype, "dolfinx may read no other type"
            return values[()]

    topology, geometry = grid.find("Topology"), grid.find("Geometry")
    width = DOLFINX[topology.get("TopologyType").lower()]
    cells = dataset(topology, np.int64)
    assert cells.shape[1] == width and int(topology.get("NumberOfElements")) == len(cells)
    points = dataset(geometry, np.float64)
    assert points.shape[1] == {"XY": 2, "XYZ": 3}[geometry.get("GeometryType")]
    if attribute is None:
        found = grid.find("Attribute")
    else:
        found = next(child for child in grid if child.get("Name") == attribute)
    return cells, points, None if found is None else dataset(found, np.int32)


def test_dolfinx_finds_the_mesh_and_its_tags(tmp_path):
    points, cells = box(2)
    faces = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    groups = {"body": range(8), "slave": [8, 9], "half été": [9, 10], "none": []}
    mesh = Mesh.create(points, [("HEXA8", cells), ("QUAD4", faces)], cell_groups=groups)
    path = tmp_path / "box.xdmf"
    write(path, mesh)
    cells, points, _ = as_dolfinx(path, "mesh")
    np.testing.assert_array_equal(cells, mesh.block("HEXA8"))
    np.testing.assert_array_equal(points, mesh.points)
    for name in ("slave", "half été"):
        facets, again, values = as_dolfinx(path, "facets", f"group:{name}")
        np.testing.assert_array_equal(facets, mesh.block("QUAD4"))
        np.testing.assert_array_equal(np.flatnonzero(values) + 8, mesh.cell_groups[name])
        np.testing.assert_array_equal(again, points)
    table = json.loads(told(ElementTree.parse(path).find("Domain/Grid/Information[@Name='tags']")))
    tags = as_dolfinx(path, "facets")[2]
    assert [table.get(str(t), []) for t in tags] == [["slave"], ["slave", "half été"], ["half été"], []]
    assert {tuple(table[str(t)]) for t in as_dolfinx(path, "mesh")[2]} == {("body",)}
    plane = Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]]), ("SEG2", [[0, 1]])])
    write(path, plane)
    assert as_dolfinx(path, "mesh")[1].shape == (3, 2)
    assert as_dolfinx(path, "facets")[0].tolist() == [[0, 1]]
    for kind in ("TRIA3", "TRIA6", "QUAD4", "QUAD9", "TETRA4", "TETRA10", "HEXA8", "HEXA27", "SEG3"):
        write(path, one_cell(kind))
        assert as_dolfinx(path, "mesh")[0].tolist() == [list(VTK_OF_TYPE[kind].nodes)]


def test_names_go_through_xml(tmp_path):
    mesh = solid(cell_groups={"a<b>&\"c'": [0], "tab\there": [1], "\x02": [2]}, name="<&>")
    write(tmp_path / "a.xdmf", mesh)
    assert same(mesh, xdmf.read(tmp_path / "a.xdmf")) == []
    assert "\x02" not in (tmp_path / "a.xdmf").read_text()


# What others see
@pytest.mark.vtk
@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize(
    "kinds", [[k] for k in KINDS] + [["TETRA4", "PYRAM5", "PENTA18"], ["SEG2", "SEG3"], ["HEXA20", "PENTA15"]]
)
def test_vtk_sees_the_cells(kinds, binary, tmp_path):
    vtk, pyvista = pytest.importorskip("vtkmodules.vtkIOXdmf2"), pytest.importorskip("pyvista")
    parts = [one_cell(kind) for kind in kinds]
    starts_at = np.cumsum([0, *(p.n_nodes for p in parts)])
    blocks = [(k, p.blocks[0].nodes + a) for k, p, a in zip(kinds, parts, starts_at, strict=False)]
    mesh = Mesh.create(
        np.vstack([p.points for p in parts]), blocks, space_dim=3, cell_data={"x": np.arange(len(kinds)) + 0.5}
    )
    write(tmp_path / "a.xdmf", mesh, binary=binary)
    reader = vtk.vtkXdmfReader()
    reader.SetFileName(str(tmp_path / "a.xdmf"))
    reader.Update()
    grid = pyvista.wrap(reader.GetOutputDataObject(0))
    grid = grid[0] if isinstance(grid, pyvista.MultiBlock) else grid
    assert grid.n_cells == len(kinds)
    np.testing.assert_allclose(grid.points, mesh.points, rtol=1e-6)
    np.testing.assert_array_equal(grid.cell_data["x"], mesh.cell_data["x"])
    for k, (kind, nodes) in enumerate(blocks):
        assert list(grid.get_cell(k).point_ids) == nodes[0][list(VTK_OF_TYPE[kind].nodes)].tolist()


def test_meshio_reads_a_grid_of_one_type(tmp_path):
    meshio = pytest.importorskip("meshio")
    points, cells = box(2)
    mesh = Mesh.create(points, [("HEXA8", cells)], cell_groups={"body": range(4)}, node_data={"heat": points[:, 0]})
    write(tmp_path / "a.xdmf", mesh)
    found = meshio.read(tmp_path / "a.xdmf")
    np.testing.assert_array_equal(found.cells_dict["hexahedron"], cells)
    np.testing.assert_array_equal(found.cell_data["group:body"][0], [1] * 4 + [0] * 4)
    np.testing.assert_array_equal(found.point_data["heat"], mesh.node_data["heat"])


@pytest.mark.parametrize("form", ["XML", "HDF", "Binary"])
def test_what_meshio_writes_is_read(form, tmp_path):
    meshio = pytest.importorskip("meshio")
    rng = np.random.default_rng(1)
    kinds = {"hexahedron": 8, "tetra": 4, "wedge": 6, "triangle6": 6, "hexahedron27": 27}
    cells = [(kind, rng.integers(0, 40, (3, n))) for kind, n in kinds.items()]
    given = meshio.Mesh(rng.random((40, 3)), cells, {"u": rng.random((40, 3))}, {"s": [rng.random(3) for _ in cells]})
    meshio.write(tmp_path / "a.xdmf", given, data_format=form)
    mesh = read(tmp_path / "a.xdmf")
    assert mesh.n_cells == 15 and set(mesh.cells_by_type) == {"HEXA8", "TETRA4", "PENTA6", "TRIA6", "HEXA27"}
    np.testing.assert_array_equal(mesh.points, given.points)
    for kind, ours in (("hexahedron27", "HEXA27"), ("wedge", "PENTA6")):
        nodes = mesh.block(ours)[:, VTK_OF_TYPE[ours].nodes]
        np.testing.assert_array_equal(nodes, dict(cells)[kind])
    np.testing.assert_array_equal(mesh.node_data["u"], given.point_data["u"])
    np.testing.assert_array_equal(mesh.cell_data["s"], np.concatenate(given.cell_data["s"]))


@pytest.mark.vtk
def test_what_vtk_writes_is_read(tmp_path):
    vtk = pytest.importorskip("vtkmodules.vtkIOXdmf2")
    pytest.importorskip("pyvista")
    from lacmesh.exchange.libraries import to_pyvista

    points, cells = box(2)  # VTK writes quadrangles of a mixture as polygons, without the number of their corners
    mesh = Mesh.create(points, [("HEXA8", cells)], cell_groups={"a": [1, 2]}, node_data={"heat": np.arange(27.0)})
    writer = vtk.vtkXdmfWriter()
    writer.SetFileName(str(tmp_path / "a.xdmf"))
    writer.SetInputData(to_pyvista(mesh))
    writer.SetHeavyDataFileName(str(tmp_path / "a.h5"))
    writer.Write()
    back = read(tmp_path / "a.xdmf")
    assert back.cells_by_type == mesh.cells_by_type
    np.testing.assert_array_equal(back.block("HEXA8"), mesh.block("HEXA8"))
    np.testing.assert_array_equal(back.node_data["heat"], mesh.node_data["heat"])
    assert {n: g.tolist() for n, g in back.cell_groups.items()} == {n: g.tolist() for n, g in mesh.cell_groups.items()}


# Files by hand
GEOMETRY = '<Geometry GeometryType="XY"><DataItem Dimensions="4 2" Format="XML">0 0 1 0 1 1 0 1</DataItem></Geometry>'


def item(values, dimensions, kind="Int", precision=8):
    head = f'Dimensions="{dimensions}" NumberType="{kind}" Precision="{precision}"'
    return f'<DataItem {head} Format="XML">{values}</DataItem>'


def grid(name, kind, count, items, rest="", geometry=GEOMETRY):
    topology = f'<Topology TopologyType="{kind}" NumberOfElements="{count}">{items}</Topology>'
    return f'<Grid Name="{name}" GridType="Uniform">{topology}{geometry}{rest}</Grid>'


def tags(name, values, center="Cell"):
    n = len(values.split())
    return f'<Attribute Name="{name}" Center="{center}">{item(values, n, "Int", 4)}</Attribute>'


def document(body):
    """Text of a file."""
    head = '<?xml version="1.0"?><!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []><Xdmf Version="3.0"><Domain>'
    return f"{head}{body}</Domain></Xdmf>"


def put(path, body):
    path.write_text(document(body))
    return path


def include(what):
    return f'<xi:include xmlns:xi="https://www.w3.org/2001/XInclude" xpointer="xpointer({what})"/>'


TRIANGLES = item("0 1 2 0 2 3", "2 3")


def test_tags_as_dolfinx_writes_them(tmp_path):
    """Grids of tags share the points by an include; tags of cells repeat cells of the mesh, in another order."""
    points = include("/Xdmf/Domain/Grid/Geometry")
    body = grid("mesh", "Triangle", 2, TRIANGLES)
    body += grid("cell tags", "Triangle", 1, item("3 0 2", "1 3"), tags("cell tags", "7"), points)
    body += grid("facet tags", "PolyLine", 2, item("0 1 2 3", "2 2"), tags("facet tags", "4 5"), points)
    with pytest.warns(LacmeshWarning, match="'cell tags' and 'facet tags' are groups"):
        mesh = read(put(tmp_path / "a.xdmf", body))
    assert mesh.cells_by_type == {"TRIA3": 2, "SEG2": 2} and mesh.space_dim == 2
    assert mesh.cell_groups["7"].tolist() == [1] and mesh.cell_groups["4"].tolist() == [2]
    assert mesh.cell_data["cell tags"].tolist() == [-1, 7, -1, -1]
    assert mesh.cell_data["facet tags"].tolist() == [-1, -1, 4, 5]
    assert read(tmp_path / "a.xdmf", mesh="facet tags").cells_by_type == {"SEG2": 2}
    with pytest.raises(RequestError, match="'facets'; did you mean facet tags"):
        read(tmp_path / "a.xdmf", mesh="facets")


def test_meshes_on_other_points_are_chosen_by_name(tmp_path):
    other = GEOMETRY.replace("1 1", "2 2")
    grids = grid("one", "Triangle", 2, TRIANGLES) + grid("two", "Triangle", 2, TRIANGLES, "", other)
    path = put(tmp_path / "a.xdmf", grids)
    with pytest.raises(RequestError, match="say which: one, two"):
        read(path)
    assert read(path, mesh="two").points[2].tolist() == [2, 2, 0]


def test_steps_of_a_collection(tmp_path):
    mesh = include("//Grid[@Name=&quot;mesh&quot;]/*[self::Topology or self::Geometry]")
    steps = "".join(
        f'<Grid Name="u" GridType="Uniform">{mesh}<Time Value="{t}"/>{tags("u", f"{k} 1 2 3", "Node")}</Grid>'
        for k, t in enumerate((0.0, 0.5))
    )
    times = f'<Grid Name="u" GridType="Collection" CollectionType="Temporal">{steps}</Grid>'
    mesh = read(put(tmp_path / "a.xdmf", grid("mesh", "Triangle", 2, TRIANGLES) + times))
    assert mesh.cells_by_type == {"TRIA3": 2}
    steps = {k: (s.field, s.number, s.time) for k, s in mesh.steps.items()}
    assert steps == {"u@0": ("u", 0, 0.0), "u@1": ("u", 1, 0.5)}
    assert mesh.node_data["u@1"].tolist() == [1, 1, 2, 3]


STRUCTURED = '<Grid GridType="Uniform"><Topology TopologyType="2DRectMesh"/></Grid>'
WRONG = {
    "a structured grid": (STRUCTURED, "has no <Geometry>|no DataItem"),
    "too few nodes": (grid("a", "Triangle", 3, TRIANGLES), "holds 6 nodes for 3 cells of 3"),
    "real nodes": (grid("a", "Triangle", 2, item("0 1 2 0 2 3", "2 3", "Float")), "nodes should be integers"),
    "odd dimensions": (grid("a", "Triangle", 2, item("0 1 2", "2 x")), "dimensions '2 x' are no numbers"),
    "an attribute too short": (grid("a", "Triangle", 2, TRIANGLES, tags("t", "1 2 3")), "holds 3 values for 2 rows"),
    "a broken mixture": (grid("a", "Mixed", 2, item("4 0 1 2 4 0 1", "7")), "the mixture is damaged"),
    "a long line": (grid("a", "Mixed", 1, item("2 3 0 1", "4")), "lines and vertices of several pieces"),
}  # fmt: skip


def test_the_compiled_walk_is_the_plain_one():
    rng = np.random.default_rng(4)
    width = np.zeros(51, np.int64)
    for kind in XDMF_TYPES:
        width[kind.number] = len(VTK_OF_TYPE[kind.type].nodes) + (2 if kind.counted else 1)
    for _ in range(200):
        cells = []
        for _ in range(int(rng.integers(0, 6))):
            kind = XDMF_TYPES[int(rng.integers(len(XDMF_TYPES)))]
            cells += [kind.number, *rng.integers(0, 60, width[kind.number] - 1).tolist()]
        values = np.array(cells, np.int64)[: int(rng.integers(len(cells) + 1)) if rng.random() < 0.5 else None]
        found = [np.zeros(len(values) // 2 + 1, np.int64) for _ in range(2)]
        counts = [starts(values, width, found[0]), starts.py_func(values, width, found[1])]
        assert counts[0] == counts[1]
        np.testing.assert_array_equal(*found)
