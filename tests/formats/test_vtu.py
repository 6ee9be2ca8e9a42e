"""VTU: what we write and read again is the same; VTK sees the same, and we read every encoding of VTK's."""

from __future__ import annotations

import base64
import lzma
import struct
import tracemalloc
import warnings
import zlib
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import LacmeshWarning, ReadError
from lacmesh.formats import detect_format, read, vtu, write
from lacmesh.formats.meshio_mesh import from_meshio
from lacmesh.formats.table import WriteOptions
from lacmesh.formats.vtu.lz4 import expand
from lacmesh.formats.vtu.types import OF_NUMBER, OF_TYPE, READ_TOO, VTK_TYPES
from lacmesh.mesh import Mesh
from tests.formats.msh_meshes import meshes, same
from tests.meshes import random_mesh
from tests.samples import samples

KINDS = tuple(OF_TYPE)


def test_the_table_is_sound():
    for kind in (*VTK_TYPES, *READ_TOO):
        assert sorted(kind.nodes) == list(range(ALL_CELLS[kind.type].n_nodes))
    assert len(OF_NUMBER) == len(VTK_TYPES) + len(READ_TOO) and len(OF_TYPE) == len(VTK_TYPES)


#: how a file is coded
CODINGS = {"raw": {}, "text": {"binary": False}, "zlib": {"compress": True}}
codings = pytest.mark.parametrize("options", CODINGS.values(), ids=CODINGS)


@pytest.mark.fuzz
@settings(max_examples=samples(20, 120), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mesh=meshes(kinds=KINDS))
def test_what_is_written_is_read(mesh, tmp_path):
    for coding, options in CODINGS.items():
        path = tmp_path / "mesh.vtu"
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            vtu.write(path, mesh, WriteOptions(**options))
            assert same(mesh, vtu.read(path)) == [], options
        assert detect_format(path).binary == (coding != "text")


@pytest.mark.parametrize("dtype", ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8", ">i4", ">f8"])
@codings
def test_every_kind_of_number(dtype, options, tmp_path):
    values = np.array([0, 1, 100, 127], dtype) if "f" not in dtype else np.array([np.pi, np.nan, -1e-30, 1e30], dtype)
    mesh = Mesh.create(np.eye(4, 3), [("POI1", [[0], [1], [2], [3]])], cell_data={"x": values}, space_dim=3)
    vtu.write(tmp_path / "a.vtu", mesh, WriteOptions(**options))
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
@pytest.mark.parametrize("kind", [k for k in ALL_CELLS if k not in CELLS and k in OF_TYPE])
def test_vtk_and_gmsh_agree_on_lagrange_cells(kind):
    """The place of each node in VTK's reference cell is that of the node in gmsh's."""
    vtk, gmsh = pytest.importorskip("vtk"), pytest.importorskip("gmsh")
    names = {68: "Curve", 69: "Triangle", 70: "Quadrilateral", 71: "Tetra", 72: "Hexahedron"}
    cell, table = OF_TYPE[kind], ALL_CELLS[kind]
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


@codings
def test_meshio_reads_all_of_it(options, tmp_path):
    meshio = pytest.importorskip("meshio")
    mesh = random_mesh(np.random.default_rng(9), slaves=4)
    mesh = replace(mesh, zones=("left", "right"), name="two blocks")
    write(tmp_path / "a.vtu", mesh, **options)
    found = meshio.read(tmp_path / "a.vtu")
    assert {"group:slave", "cell_number", "rank"} <= found.cell_data.keys() and "node_number" in found.point_data
    assert same(mesh, from_meshio(found)) == []


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
        found[version] = read(path).block(kind)[0][list(OF_TYPE[kind].nodes)].tolist()
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


WRONG = {
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


def _lz4_zeros(raw):
    """A block of lz4: a literal 0, and a match one byte back of all the others but 5, which are literals."""
    more, last = divmod(len(raw) - 6 - 4 - 15, 255)
    return b"\x1f\0\1\0" + b"\xff" * more + bytes([last]) + b"\x50" + bytes(5)


EXPANDABLE = {"ZLib": zlib.compress, "LZMA": lzma.compress, "LZ4": _lz4_zeros}


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
    (tmp_path / "a.pvd").write_text(
        '<VTKFile type="Collection"><Collection><DataSet file="a_0.vtu"/></Collection></VTKFile>'
    )
    (tmp_path / "a.pvtu").write_text('<VTKFile type="PUnstructuredGrid"><Piece Source="a_1.vtu"/></VTKFile>')
    for name, part in (("a.pvd", "a_0.vtu"), ("a.pvtu", "a_1.vtu")):
        with pytest.raises(ReadError, match=f"read one of them: {part}"):
            read(tmp_path / name)


def test_the_compiled_lz4_is_the_plain_one():
    rng = np.random.default_rng(2)
    blocks = [b"\x50hello", b"\x14ab\x02\x00\x50hello", bytes([0xF0, 0, *range(15)]), b"\x0fa", b"\x10a\x05\x00", b""]
    blocks += [rng.integers(0, 256, int(n), np.uint8).tobytes() for n in rng.integers(1, 60, 300)]
    for block in blocks:
        data = np.frombuffer(block, np.uint8)
        outs = [np.zeros(64, np.uint8) for _ in range(2)]
        counts = [expand(data, outs[0]), expand.py_func(data, outs[1])]
        assert counts[0] == counts[1]
        np.testing.assert_array_equal(*outs)
    out = np.zeros(20, np.uint8)
    assert expand(np.frombuffer(b"\x25ab\x02\x00\x10c", np.uint8), out) == 12
    assert out[:12].tobytes() == b"ababababababac"[:11] + b"c"
