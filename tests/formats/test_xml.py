"""VTU and XDMF: what we write is read again, and VTK and meshio see the same; we read every encoding of VTK's.

dolfinx itself is not run here: `as_dolfinx` does what its `XDMFFile` does with a file (xdmf_utils.cpp, xdmf_mesh.cpp,
HDF5Interface.h), step by step.
"""

from __future__ import annotations

import base64
import json
import lzma
import struct
import tracemalloc
import warnings
import zlib
from dataclasses import replace
from importlib.util import find_spec
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import LacmeshWarning, ReadError, RequestError, WriteError
from lacmesh.formats import detect_format, read, vtu, write
from lacmesh.formats.orders import VTK_CELLS, XDMF_CELLS
from lacmesh.mesh import Mesh
from tests.formats.feature_cases import one_cell, solid
from tests.formats.msh_meshes import meshes, same
from tests.meshes import box, random_mesh
from tests.samples import samples

#: how a file is coded
CODINGS = {"raw": {}, "text": {"binary": False}, "zlib": {"compress": True}}
codings = pytest.mark.parametrize("options", CODINGS.values(), ids=CODINGS)


@pytest.mark.fuzz
@pytest.mark.parametrize(("suffix", "kinds"), [(".vtu", tuple(VTK_CELLS)), (".xdmf", tuple(XDMF_CELLS))])
@settings(max_examples=samples(20, 120), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_what_is_written_is_read(suffix, kinds, data, tmp_path):
    mesh, path = data.draw(meshes(kinds=kinds)), tmp_path / f"mesh{suffix}"
    for coding, options in CODINGS.items():
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            write(path, mesh, **options)
            assert same(mesh, read(path)) == [], options
        assert suffix == ".xdmf" or detect_format(path).binary == (coding != "text")


@pytest.mark.parametrize("dtype", ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8", ">i4", ">f8"])
@codings
def test_every_kind_of_number(dtype, options, tmp_path):
    values = np.array([0, 1, 100, 127], dtype) if "f" not in dtype else np.array([np.pi, np.nan, -1e-30, 1e30], dtype)
    mesh = Mesh.create(np.eye(4, 3), [("POI1", [[0], [1], [2], [3]])], cell_data={"x": values}, space_dim=3)
    vtu.write(tmp_path / "a.vtu", mesh, **options)
    back = vtu.read(tmp_path / "a.vtu").cell_data["x"]
    np.testing.assert_array_equal(back, values)
    assert back.dtype == np.dtype(dtype).newbyteorder("=")


def test_odd_data(tmp_path):
    n = np.arange(4)
    data = {"flag": n > 1, "group:x": n % 2, "cell_number": n, "": n, "a\x01b": n, "text": np.array(list("abcd"))}
    data |= {"half": n.astype(np.float16), "column": n[:, None], "deep": np.arange(24).reshape(4, 2, 3)}
    mesh = Mesh.create(np.eye(4, 3), [("POI1", n[:, None])], cell_data=data, cell_groups={"x": [0]}, space_dim=3)
    with pytest.warns(LacmeshWarning, match=r"data 'text' \(<U1, shape \(4,\)\) are left out"):
        vtu.write(tmp_path / "a.vtu", mesh)
    back = vtu.read(tmp_path / "a.vtu")
    assert back.cell_data.keys() == data.keys() - {"text"}
    for name in back.cell_data:
        np.testing.assert_array_equal(back.cell_data[name], data[name])
        assert back.cell_data[name].shape == data[name].shape
    assert back.cell_groups.keys() == {"x"} and back.cell_number.tolist() == [1, 2, 3, 4]


# What VTK sees
def grid_of(path):
    pyvista = pytest.importorskip("pyvista")
    return pyvista.read(path)


@pytest.mark.vtk
@pytest.mark.parametrize("kind", [k for k in ALL_CELLS if k not in CELLS and k in VTK_CELLS])
def test_vtk_and_gmsh_agree_on_lagrange_cells(kind):
    """The place of each node in VTK's reference cell is that of the node in gmsh's."""
    vtk, gmsh = pytest.importorskip("vtk"), pytest.importorskip("gmsh")
    names = {68: "Curve", 69: "Triangle", 70: "Quadrilateral", 71: "Tetra", 72: "Hexahedron"}
    cell, table = VTK_CELLS[kind], ALL_CELLS[kind]
    gmsh.initialize(["-nt", "1"], readConfigFiles=False)
    try:
        _, dim, degree, n, x, _ = gmsh.model.mesh.getElementProperties(table.msh)
    finally:
        gmsh.finalize()
    ours = np.reshape(x, (n, dim))
    theirs = getattr(vtk, f"vtkLagrange{names[cell.number]}")()
    theirs.GetPoints().SetNumberOfPoints(n)
    theirs.GetPointIds().SetNumberOfIds(n)
    if cell.number in (70, 72):
        theirs.SetOrder(*[degree] * dim)
    elif cell.number != 68:
        theirs.Initialize()
    parametric = theirs.GetParametricCoords()
    found = np.array([parametric[k] for k in range(3 * n)]).reshape(n, 3)[:, :dim]
    np.testing.assert_allclose(
        found, (ours if cell.number in (69, 71) else (ours + 1) / 2)[list(cell.nodes)], atol=1e-6
    )


WRITERS = [
    (mode, compressor, header, order, base64_on)
    for mode in ("Ascii", "Binary", "Appended")
    for compressor in ("None", "ZLib", "LZ4", "LZMA")
    for header in ("32", "64")
    for order in ("Little", "Big")
    for base64_on in ((True, False) if mode == "Appended" else (True,))
    if mode != "Ascii" or (compressor, header, order) == ("None", "32", "Little")
]


@pytest.mark.vtk
@pytest.mark.parametrize("options", WRITERS, ids=lambda o: "-".join(map(str, o)))
def test_every_encoding_of_vtk_is_read(options, tmp_path):
    vtk = pytest.importorskip("vtk")
    from lacmesh.exchange.libraries import to_pyvista

    mode, compressor, header, order_of_bytes, in_base64 = options
    mesh = random_mesh(np.random.default_rng(7), slaves=3)
    many = np.arange(3 * mesh.n_nodes * 40).reshape(mesh.n_nodes, -1) / 7  # several blocks
    mesh = replace(mesh, node_data={**mesh.node_data, "many": many})
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetInputData(to_pyvista(mesh))
    writer.SetFileName(str(tmp_path / "a.vtu"))
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    getattr(writer, f"SetHeaderTypeToUInt{header}")()
    getattr(writer, f"SetByteOrderTo{order_of_bytes}Endian")()
    writer.SetEncodeAppendedData(in_base64)
    assert writer.Write() == 1
    assert same(mesh, vtu.read(tmp_path / "a.vtu")) == []


@pytest.mark.vtk
def test_other_cells_of_vtk(tmp_path):
    """Voxels, pixels and Lagrange cells of low order are our own; a polyhedron is named."""
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.ImageData(dimensions=(3, 2, 2)).cast_to_unstructured_grid()
    grid.save(tmp_path / "voxel.vtu")
    mesh = read(tmp_path / "voxel.vtu")
    assert mesh.cells_by_type == {"HEXA8": 2}
    x = mesh.points[mesh.blocks[0].nodes]
    np.testing.assert_allclose(np.linalg.det(x[:, [1, 3, 4]] - x[:, :1]), 1)
    pyvista.ImageData(dimensions=(3, 2, 1)).cast_to_unstructured_grid().save(tmp_path / "pixel.vtu")
    assert read(tmp_path / "pixel.vtu").cells_by_type == {"QUAD4": 2}
    cube = pyvista.Cube().triangulate()
    poly = [len(cube.regular_faces), *(n for f in cube.regular_faces.tolist() for n in (3, *f))]
    pyvista.UnstructuredGrid([len(poly), *poly], [42], cube.points).save(tmp_path / "poly.vtu")
    with pytest.raises(ReadError, match=r"polyhedra \(VTK's type 42"):
        read(tmp_path / "poly.vtu")


# Files by hand
HEAD = '<VTKFile type="UnstructuredGrid" version="{version}" byte_order="LittleEndian"{more}><UnstructuredGrid>'


def text_of(points, connectivity, offsets, types, version="1.0", more="", extra="", n=None, k=None):
    def array(name, kind, values, width=1):
        words = " ".join(str(v) for v in np.ravel(values).tolist())
        return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{width}" format="ascii">{words}</DataArray>'

    n, k = len(points) if n is None else n, len(types) if k is None else k
    return (
        HEAD.format(version=version, more=more)
        + f'<Piece NumberOfPoints="{n}" NumberOfCells="{k}">{extra}<Points>{array("p", "Float64", points, 3)}</Points>'
        + f"<Cells>{array('connectivity', 'Int64', connectivity)}{array('offsets', 'Int64', offsets)}"
        + f"{array('types', 'UInt8', types)}</Cells></Piece></UnstructuredGrid></VTKFile>"
    )


TRIANGLE = (np.eye(3), [0, 1, 2], [3], [5])


@pytest.mark.parametrize(("kind", "n"), [("HEXA27", 27), ("HEXA64", 64)])
def test_lagrange_hexahedra_of_vtk_8(tmp_path, kind, n):
    """VTK 9 reads files older than 2.1 with the last two vertical edges swapped, and so do we."""
    x, found = np.random.default_rng(0).random((n, 3)), {}
    for version in ("1.0", "2.1"):
        path = tmp_path / f"{version}.vtu"
        path.write_text(text_of(x, range(n), [n], [72], version))
        found[version] = read(path).block(kind)[0][list(VTK_CELLS[kind].nodes)].tolist()
        if kind == "HEXA64" and find_spec("pyvista"):
            assert list(grid_of(path).get_cell(0).point_ids) == found[version]
    assert found["2.1"] == list(range(n))
    assert kind == "HEXA64" or found["1.0"] == [*range(18), 19, 18, *range(20, 27)]


def test_pieces_are_put_together(tmp_path):
    one = text_of(
        *TRIANGLE, extra='<CellData><DataArray type="Float64" Name="x" format="ascii">5</DataArray></CellData>'
    )
    piece = one[one.index("<Piece") : one.index("</UnstructuredGrid>")]
    other = piece.replace(">5<", ">7<").replace("CellData", "Unknown")
    (tmp_path / "a.vtu").write_text(one.replace(piece, piece + other))
    with pytest.warns(LacmeshWarning, match="2 pieces are put together; nodes that several have stay apart"):
        mesh = read(tmp_path / "a.vtu")
    assert mesh.block("TRIA3").tolist() == [[0, 1, 2], [3, 4, 5]]
    np.testing.assert_array_equal(mesh.cell_data["x"], [5, np.nan])


def _packed(values, head=None):
    raw = np.array(values, "<i8").tobytes()
    block = zlib.compress(raw)
    head = [1, len(raw), 0, len(block)] if head is None else head
    return (base64.b64encode(struct.pack(f"<{len(head)}I", *head)) + base64.b64encode(block)).decode()


ZLIB = ' compressor="vtkZLibDataCompressor"'


def coded(packed, more=""):
    """A triangle, whose nodes stand there in another way."""
    return text_of(*TRIANGLE, more=more).replace('format="ascii">0 1 2', f'format="binary">{packed}')


WRONG_VTU = {
    "no piece": (HEAD.format(version="1.0", more="") + "</UnstructuredGrid></VTKFile>", "has no <Piece>"),
    "no count": (text_of(*TRIANGLE, k="many"), "NumberOfCells should be a number"),
    "offsets short": (text_of(np.eye(3), [0, 1, 2], [2], [5]), "offsets do not fit"),
    "types short": (text_of(np.eye(3), [0, 1, 2], [3], [], k=1), "0 types and 1 offsets"),
    "a polygon": (text_of(np.eye(5, 3), range(5), [5], [7]), "polygons of more than 4"),
    "a wide number": (text_of(np.eye(3), [0, 1, 2], [3], [300]), "too large for uint8"),
    "no base64": (text_of(*TRIANGLE).replace('format="ascii"', 'format="binary"'), "cannot be read"),
    "a bad header": (coded(_packed([0, 1, 2], [2**31, 8, 0]), ZLIB), "more than the file holds"),
    "a bomb": (coded(_packed(np.zeros(10**5), [1, 2**31, 0, 789]), ZLIB), "cannot be read"),
    "an odd compressor": (coded(_packed([0, 1, 2]), ' compressor="vtkX"'), "vtkX is not known"),
}  # fmt: skip


def _claimed(compressor, expand, n):
    """A header that claims the n zero bytes which its block holds, and both in base64."""
    block = expand(bytes(n))
    parts = struct.pack("<4I", 1, n, 0, len(block)), block
    return f' compressor="vtk{compressor}DataCompressor"', "".join(base64.b64encode(part).decode() for part in parts)


EXPANDABLE = {"ZLib": zlib.compress, "LZMA": lzma.compress}


@pytest.mark.rows("connectivity-ZLib", "T-ZLib")
@pytest.mark.parametrize("compressor", EXPANDABLE)
@pytest.mark.parametrize("place", ["Points", "connectivity", "offsets", "types", "T"])
def test_no_array_is_expanded_beyond_its_size(compressor, place, tmp_path):
    """A sound block of 20 MB of zeros, where a few bytes should be."""
    more, text = _claimed(compressor, EXPANDABLE[compressor], 20_000_000)
    field = '<CellData><DataArray type="Float64" Name="T" format="ascii">1</DataArray></CellData>'
    whole = text_of(*TRIANGLE, more=more).replace("</Piece>", field + "</Piece>")
    start = whole.index("<Points>" if place == "Points" else f'Name="{place}"')
    start = whole.index('format="ascii">', start)
    end = whole.index("</DataArray>", start)
    (tmp_path / "a.vtu").write_text(whole[:start] + 'format="binary">' + text + whole[end:])
    tracemalloc.start()
    try:
        with pytest.raises(ReadError, match=r"claims 20000000 bytes"):
            vtu.read(tmp_path / "a.vtu")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 4_000_000


@pytest.mark.parametrize("compressor", EXPANDABLE)
def test_arrays_of_their_size_are_expanded(compressor, tmp_path):
    """Some writers encode the header of an array apart from its bytes, as here, though VTK does not."""
    more, text = _claimed(compressor, EXPANDABLE[compressor], 800)
    field = f'<PointData><DataArray type="Float64" Name="T" format="binary">{text}</DataArray></PointData>'
    whole = text_of(np.eye(100, 3), [0, 1, 2], [3], [5], more=more).replace("</Piece>", field + "</Piece>")
    (tmp_path / "a.vtu").write_text(whole)
    assert vtu.read(tmp_path / "a.vtu").node_data["T"].tolist() == [0] * 100
    raw = np.array([0, 1, 2], "<i8").tobytes()
    apart = base64.b64encode(struct.pack("<I", len(raw))) + base64.b64encode(raw)
    (tmp_path / "a.vtu").write_text(coded(apart.decode()))
    assert read(tmp_path / "a.vtu").block("TRIA3").tolist() == [[0, 1, 2]]


def test_lists_of_files_are_named(tmp_path):
    pvd = '<VTKFile type="Collection"><Collection><DataSet file="part.vtu"/></Collection></VTKFile>'
    pvtu = '<VTKFile type="PUnstructuredGrid"><Piece Source="part.vtu"/></VTKFile>'
    for name, text in (("a.pvd", pvd), ("a.pvtu", pvtu)):
        (tmp_path / name).write_text(text)
        with pytest.raises(ReadError, match="one of them: part"):
            read(tmp_path / name)


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


# What dolfinx asks for
#: what its reader knows, and the nodes of each
DOLFINX = {
    "polyvertex": 1, "polyline": 2, "edge_3": 3, "triangle": 3, "triangle_6": 6, "tetrahedron": 4, "tetrahedron_10": 10,
    "quadrilateral": 4, "quadrilateral_9": 9, "quadrilateral_16": 16, "hexahedron": 8, "hexahedron_27": 27,
}  # fmt: skip


def as_dolfinx(path, name, attribute=None):
    """Cells (k, n), points, and the values of an attribute, of the grid `name`: as read_mesh and read_meshtags do."""
    root = ElementTree.parse(path).getroot()
    assert root.tag == "Xdmf"
    grid = root.find(f"./Domain/Grid[@Name='{name}']")

    def dataset(parent, dtype):
        item = parent.find("DataItem")
        file, inside = item.text.strip().split(":")
        with h5py.File(path.with_suffix(".h5")) as found:  # dolfinx opens this file, whatever the items say
            values = found[inside][()]
        assert (item.get("Format"), file) == ("HDF", path.with_suffix(".h5").name)
        assert item.get("Dimensions") == " ".join(map(str, values.shape)) and values.ndim <= 2
        assert values.dtype == dtype, "dolfinx may read no other type"
        return values

    topology, geometry = grid.find("Topology"), grid.find("Geometry")
    cells, points = dataset(topology, np.int64), dataset(geometry, np.float64)
    assert cells.shape[1] == DOLFINX[topology.get("TopologyType").lower()]
    assert int(topology.get("NumberOfElements")) == len(cells)
    assert points.shape[1] == {"XY": 2, "XYZ": 3}[geometry.get("GeometryType")]
    wanted = "Attribute" if attribute is None else f"Attribute[@Name='{attribute}']"
    found = grid.find(wanted)
    assert found is not None or attribute is None
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
    information = ElementTree.parse(path).find("Domain/Grid/Information[@Name='tags']")
    table = json.loads(ElementTree.fromstring("".join(information.itertext())).get("value"))
    tags = as_dolfinx(path, "facets")[2]
    assert [table.get(str(t), []) for t in tags] == [["slave"], ["slave", "half été"], ["half été"], []]
    assert {tuple(table[str(t)]) for t in as_dolfinx(path, "mesh")[2]} == {("body",)}
    plane = Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]]), ("SEG2", [[0, 1]])])
    write(path, plane)
    assert as_dolfinx(path, "mesh")[1].shape == (3, 2)
    assert as_dolfinx(path, "facets")[0].tolist() == [[0, 1]]
    for kind in ("TRIA3", "TRIA6", "QUAD4", "QUAD9", "TETRA4", "TETRA10", "HEXA8", "HEXA27", "SEG3"):
        write(path, one_cell(kind))
        assert as_dolfinx(path, "mesh")[0].tolist() == [list(VTK_CELLS[kind].nodes)]


# What others see
@pytest.mark.vtk
@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize(
    "kinds", [[k] for k in XDMF_CELLS] + [["TETRA4", "PYRAM5", "PENTA18"], ["SEG2", "SEG3"], ["HEXA20", "PENTA15"]]
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
        assert list(grid.get_cell(k).point_ids) == nodes[0][list(VTK_CELLS[kind].nodes)].tolist()


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
        nodes = mesh.block(ours)[:, VTK_CELLS[ours].nodes]
        np.testing.assert_array_equal(nodes, dict(cells)[kind])
    np.testing.assert_array_equal(mesh.node_data["u"], given.point_data["u"])
    np.testing.assert_array_equal(mesh.cell_data["s"], np.concatenate(given.cell_data["s"]))


# XDMF by hand
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


def put_xdmf(path, body):
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
        mesh = read(put_xdmf(tmp_path / "a.xdmf", body))
    assert mesh.cells_by_type == {"TRIA3": 2, "SEG2": 2} and mesh.space_dim == 2
    assert mesh.cell_groups["7"].tolist() == [1] and mesh.cell_groups["4"].tolist() == [2]
    assert mesh.cell_data["cell tags"].tolist() == [-1, 7, -1, -1]
    assert mesh.cell_data["facet tags"].tolist() == [-1, -1, 4, 5]
    assert read(tmp_path / "a.xdmf", mesh="facet tags").cells_by_type == {"SEG2": 2}
    with pytest.raises(RequestError, match="'facets'; did you mean facet tags"):
        read(tmp_path / "a.xdmf", mesh="facets")


def test_steps_of_a_collection(tmp_path):
    mesh = include("//Grid[@Name=&quot;mesh&quot;]/*[self::Topology or self::Geometry]")
    steps = "".join(
        f'<Grid Name="u" GridType="Uniform">{mesh}<Time Value="{t}"/>{tags("u", f"{k} 1 2 3", "Node")}</Grid>'
        for k, t in enumerate((0.0, 0.5))
    )
    times = f'<Grid Name="u" GridType="Collection" CollectionType="Temporal">{steps}</Grid>'
    mesh = read(put_xdmf(tmp_path / "a.xdmf", grid("mesh", "Triangle", 2, TRIANGLES) + times))
    assert mesh.cells_by_type == {"TRIA3": 2}
    steps = {k: (s.field, s.number, s.time) for k, s in mesh.steps.items()}
    assert steps == {"u@0": ("u", 0, 0.0), "u@1": ("u", 1, 0.5)}
    assert mesh.node_data["u@1"].tolist() == [1, 1, 2, 3]


STRUCTURED = '<Grid GridType="Uniform"><Topology TopologyType="2DRectMesh"/></Grid>'
WRONG_XDMF = {
    "a structured grid": (STRUCTURED, "has no <Geometry>|no DataItem"),
    "too few nodes": (grid("a", "Triangle", 3, TRIANGLES), "holds 2 cells, and announces 3"),
    "real nodes": (grid("a", "Triangle", 2, item("0 1 2 0 2 3", "2 3", "Float")), "nodes should be integers"),
    "odd dimensions": (grid("a", "Triangle", 2, item("0 1 2", "2 x")), "dimensions '2 x' are no numbers"),
    "an attribute too short": (grid("a", "Triangle", 2, TRIANGLES, tags("t", "1 2 3")), "holds 3 values for 2 rows"),
    "a broken mixture": (grid("a", "Mixed", 2, item("4 0 1 2 4 0 1", "7")), "the mixture is damaged"),
    "a long line": (grid("a", "Mixed", 1, item("2 3 0 1", "4")), "lines and vertices of several pieces"),
}  # fmt: skip
