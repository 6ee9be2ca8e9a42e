"""`lacmesh mesh`: what is listed of CAD files, what their meshes are, and what is said of bad ones."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.cli import main
from lacmesh.errors import DataError, LacmeshWarning, ReadError, RequestError
from lacmesh.gmsh import cad
from lacmesh.gmsh.cad import EntitySelection, list_cad, mesh_cad, parse_group
from lacmesh.reference.quadrature import measure
from lacmesh.topology.orientation import analyse_orientation
from tests.samples import each_option

pytestmark = pytest.mark.gmsh
LUG = Path(__file__).resolve().parents[1] / "data" / "pin_in_lug.step"


# ---- geometries


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files of every kind, by name."""
    import gmsh

    folder = tmp_path_factory.mktemp("cad")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for build in (two_solids, one_box, extruded, arcs, nested_shells, overlapping_shells, open_shell, plate):
            gmsh.clear()
            gmsh.model.add(build.__name__)
            for name in build(gmsh):
                gmsh.write(str(folder / name))
    finally:
        gmsh.finalize()
    for name, text in SCRIPTS.items():
        (folder / name).write_text(text)
    return folder


def two_solids(gmsh):
    """A box 2 x 3 x 4 with a round hole along z, and a ball."""
    occ = gmsh.model.occ
    occ.cut([(3, occ.addBox(0, 0, 0, 2, 3, 4))], [(3, occ.addCylinder(1, 1.5, -1, 0, 0, 6, 0.5))])
    occ.addSphere(6, 0, 0, 1)
    occ.synchronize()
    return "solids.step", "solids.stp", "solids.brep"


def one_box(gmsh):
    gmsh.model.occ.addBox(0, 0, 0, 2, 3, 4)
    gmsh.model.occ.synchronize()
    return "box.iges", "box.igs"


def extruded(gmsh):
    """A unit square drawn up by 2, by the built-in kernel; named groups, one of them of the skin."""
    geo = gmsh.model.geo
    points = [geo.addPoint(x, y, 0, 0.3) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines = [geo.addLine(points[k], points[(k + 1) % 4]) for k in range(4)]
    drawn = geo.extrude([(2, geo.addPlaneSurface([geo.addCurveLoop(lines)]))], 0, 0, 2)
    geo.synchronize()
    gmsh.model.addPhysicalGroup(2, [drawn[0][1]], name="top")
    gmsh.model.addPhysicalGroup(3, [1], name="body")
    return ("column.geo_unrolled",)


def arcs(gmsh):
    """A cylinder of radius 2 and height 3 of the built-in kernel: four arcs drawn up."""
    geo = gmsh.model.geo
    centre, *rim = [geo.addPoint(x, y, 0, 0.5) for x, y in ((0, 0), (2, 0), (0, 2), (-2, 0), (0, -2))]
    lines = [geo.addCircleArc(rim[k], centre, rim[(k + 1) % 4]) for k in range(4)]
    geo.extrude([(2, geo.addPlaneSurface([geo.addCurveLoop(lines)]))], 0, 0, 3)
    geo.synchronize()
    return ("round.geo_unrolled",)


def nested_shells(gmsh):
    """A box with a round void, in which a small box floats, and another box beside."""
    occ = gmsh.model.occ
    occ.addBox(0, 0, 0, 10, 10, 10)
    occ.addSphere(5, 5, 5, 4)
    occ.addBox(4, 4, 4, 2, 2, 2)
    occ.addBox(20, 0, 0, 1, 1, 1)
    occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1)
    gmsh.model.mesh.generate(2)
    return ("nested.stl",)


def overlapping_shells(gmsh):
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.addBox(0.5, 0.5, 0.5, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(2)
    return ("overlapping.stl",)


def open_shell(gmsh):
    """A box without its lid."""
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(2)
    gmsh.model.addPhysicalGroup(2, [1, 2, 3, 4, 5])
    return ("open.stl",)


def plate(gmsh):
    """A plate 4 x 2 with a hole of radius 0.5 in its middle, in the plane."""
    occ = gmsh.model.occ
    occ.cut([(2, occ.addRectangle(-2, -1, 0, 4, 2))], [(2, occ.addDisk(0, 0, 0, 0.5, 0.5))])
    occ.synchronize()
    return ("plate.brep",)


SCRIPTS = {
    "plate.geo": 'SetFactory("OpenCASCADE");\nRectangle(1) = {-2, -1, 0, 4, 2};\nDisk(2) = {0, 0, 0, 0.5, 0.5};\n'
    "BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }\nMesh.MeshSizeMax = 0.3;\n",
    "column.geo": "lc = 0.3;\nPoint(1) = {0, 0, 0, lc}; Point(2) = {1, 0, 0, lc};\nPoint(3) = {1, 1, 0, lc}; "
    "Point(4) = {0, 1, 0, lc};\nLine(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};\n"
    "Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};\nout[] = Extrude {0, 0, 2} { Surface{1}; };\n"
    'Physical Surface("top") = {out[0]}; Physical Surface(7) = {1};\nMesh.ElementOrder = 2;\n',
    "three_sides.geo": "Point(1)={0,0,0,.3}; Point(2)={1,0,0,.3}; Point(3)={0,1,0,.3}; Point(4)={0,0,1,.3};\n"
    "Line(1)={1,2}; Line(2)={2,3}; Line(3)={3,1}; Line(4)={1,4}; Line(5)={2,4}; Line(6)={3,4};\n"
    "Curve Loop(1)={1,2,3}; Plane Surface(1)={1}; Curve Loop(2)={1,5,-4}; Plane Surface(2)={2};\n"
    "Curve Loop(3)={2,6,-5}; Plane Surface(3)={3};\nSurface Loop(1)={1,2,3}; Volume(1)={1};\n",
}


def volume(mesh):
    return sum(measure(kind, mesh.points[n]).sum() for kind, n in mesh.blocks if CELLS[kind].dim == mesh.dim)


def area(mesh, cells):
    return sum(measure(kind, mesh.points[n]).sum() for kind, _, n in mesh.select(cells))


def edges_of(mesh, cells):
    """Lengths of the distinct edges of some cells, and their middles."""
    pairs = [np.sort(n[:, CELLS[k].edges], axis=2).reshape(-1, 2) for k, _, n in mesh.select(cells)]
    ends = mesh.points[np.unique(np.concatenate(pairs), axis=0)]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), ends.mean(axis=1)


# ---- listing


def test_parts_of_an_assembly_have_their_names(tmp_path, capsys):
    """gmsh writes an assembly of two boxes; the names of its products are those that a CAD program would give."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for x in (0, 3):
            gmsh.model.occ.addBox(x, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "assembly.step"))
    finally:
        gmsh.finalize()
    text = (tmp_path / "assembly.step").read_text()
    for k, name in ((1, "Base plate"), (2, "Upper block")):
        text = re.sub(rf"'Open CASCADE STEP translator [\d.]+ 1\.{k}'", f"'{name}'", text)
    (tmp_path / "assembly.step").write_text(text)
    assert [s.name for s in list_cad(tmp_path / "assembly.step") if s.dim == 3] == ["Base plate", "Upper block"]
    assert main(["mesh", str(tmp_path / "assembly.step"), "--list"]) == 0
    assert re.search(r"1 +Base plate +Volume", capsys.readouterr().out)


def test_a_step_file_is_listed_exactly():
    shapes = list_cad(LUG)
    assert [s.dim for s in shapes] == [3] * 2 + [2] * 20
    lug, pin, *skin = shapes
    ends = np.pi * (11.8**3 - 10.8**3) / 3  # two chamfers, 1 high, of half a pin
    assert pin.measure == pytest.approx(np.pi / 2 * 11.8**2 * 28 + ends, rel=1e-9)
    assert pin.centre[1:] == pytest.approx((0, 31.8), abs=1e-9) and pin.bodies == ()
    (bore,) = [s for s in skin if s.radius == pytest.approx(-12)]
    assert bore.type == "Cylinder" and bore.bodies == (lug.tag,) and bore.normal is None
    assert bore.measure == pytest.approx(np.pi * 12 * 20, rel=1e-9)
    assert np.allclose(bore.box, [(0, -10, 20), (12, 10, 44)], atol=0.01)
    assert pytest.approx(11.8) in [s.radius for s in skin if s.bodies == (pin.tag,)]
    normals = {s.normal: s for s in skin if s.normal and s.bodies == (lug.tag,)}
    assert {tuple(np.round(n)) for n in normals} == {tuple(s * np.eye(3)[k]) for k in range(3) for s in (-1, 1)}
    bottom = min(skin, key=lambda s: s.centre[2])
    assert bottom.normal == pytest.approx((0, 0, -1)) and bottom.measure == pytest.approx(36 * 32 - np.pi * 3.5**2)
    for s in skin:
        assert all(lo - 1e-6 <= c <= hi + 1e-6 for lo, c, hi in zip(s.box[0], s.centre, s.box[1], strict=True))


def round_shapes(shapes):
    return sorted(round(s.radius, 3) for s in shapes if s.radius is not None)


def test_the_built_in_kernel_is_listed_from_a_mesh(files):
    body, *skin = list_cad(files / "round.geo_unrolled")
    assert body.measure == pytest.approx(12 * np.pi, rel=1e-5) and body.centre == pytest.approx((0, 0, 1.5), abs=1e-5)
    assert round_shapes(skin) == [2.0] * 4
    assert sum(s.measure for s in skin) == pytest.approx(2 * np.pi * 2 * 3 + 2 * np.pi * 4, rel=1e-5)
    ends = sorted(((s.normal, s.centre[2]) for s in skin if s.normal), key=lambda end: end[1])
    assert [(tuple(np.round(n, 9) + 0.0), round(z, 9)) for n, z in ends] == [((0, 0, -1), 0), ((0, 0, 1), 3)]
    column = list_cad(files / "column.geo_unrolled")
    assert [s.groups for s in column if s.groups] == [("body",), ("top",)]
    for s in column[1:]:  # every normal leaves the column
        assert np.dot(s.normal, np.subtract(s.centre, column[0].centre)) > 0.4


@pytest.mark.parametrize("name", ["plate.brep", "plate.geo"])
def test_a_plane_file_lists_curves(files, name):
    body, *skin = list_cad(files / name)
    assert (body.dim, body.measure) == (2, pytest.approx(8 - np.pi / 4, rel=1e-9))
    (hole,) = [s for s in skin if s.radius is not None]
    assert hole.radius == pytest.approx(-0.5, rel=1e-4) and hole.measure == pytest.approx(np.pi, rel=1e-9)
    sides = {tuple(np.round(s.normal, 6) + 0.0): s.measure for s in skin if s.normal}
    expected = {(1, 0, 0): 2, (-1, 0, 0): 2, (0, 1, 0): 4, (0, -1, 0): 4}
    assert sides == {n: pytest.approx(length) for n, length in expected.items()}


def test_an_stl_has_bodies_with_voids(files):
    shapes = list_cad(files / "nested.stl")
    ball = 4 / 3 * np.pi * 4**3
    volumes = sorted(s.measure for s in shapes if s.dim == 3)
    assert volumes == [pytest.approx(1), pytest.approx(8), pytest.approx(1000 - ball, rel=0.01)]
    skin = [s for s in shapes if s.dim == 2]
    assert sum(s.measure for s in skin if s.normal) == pytest.approx(6 * (100 + 4 + 1))
    inside = [s for s in skin if s.radius is not None or s.normal is None]
    assert {s.bodies for s in inside} == {next((s.tag,) for s in shapes if s.dim == 3 and s.measure > 10)}


def test_the_list_is_printed(files, capsys):
    assert main(["mesh", str(LUG), "--list"]) == 0
    out = capsys.readouterr().out
    for words in ("2 volumes, 20 surfaces", "hollow, r = 12", "round, r = 11.8", "Cylinder", "753.98", "(0, 0, -1)"):
        assert words in out
    assert main(["mesh", str(LUG), "--list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["file"] == str(LUG) and len(found["shapes"]) == 22
    assert set(found["shapes"][0]) == set(cad.CadShape.__dataclass_fields__)
    assert main(["mesh", str(files / "plate.geo"), "--list"]) == 0
    assert "1 surface, 5 curves" in capsys.readouterr().out


# ---- meshing


@pytest.mark.parametrize(
    ("name", "volume_", "kinds"),
    each_option(
        [
            ("solids.step", 24 - np.pi + 4 / 3 * np.pi, {"TRIA3", "TETRA4"}),
            ("solids.stp", 24 - np.pi + 4 / 3 * np.pi, {"TRIA3", "TETRA4"}),
            ("solids.brep", 24 - np.pi + 4 / 3 * np.pi, {"TRIA3", "TETRA4"}),
            ("box.iges", 24, {"TRIA3", "TETRA4"}),
            ("box.igs", 24, {"TRIA3", "TETRA4"}),
            ("column.geo", 2, {"TRIA6", "TETRA10"}),
            ("column.geo_unrolled", 2, {"TRIA3", "TETRA4"}),
            ("nested.stl", 1009 - 4 / 3 * np.pi * 64, {"TRIA3", "TETRA4"}),
            ("plate.geo", 8 - np.pi / 4, {"SEG2", "TRIA3"}),
        ],
        of=lambda row: [row[1:]],
    ),
)
def test_every_kind_of_file_is_meshed(files, name, volume_, kinds):
    mesh = mesh_cad(files / name)
    assert set(mesh.cells_by_type) == kinds
    assert volume(mesh) == pytest.approx(volume_, rel=0.03)
    skin = np.flatnonzero(mesh.cell_dim == mesh.dim - 1)
    assert len(skin) and not len(analyse_orientation(mesh, skin).to_flip)
    for kind, x in ((k, mesh.points[n]) for k, n in mesh.blocks if CELLS[k].dim == mesh.dim):
        assert measure(kind, x).min() > 0


def test_groups_by_tag_and_by_box(files, tmp_path, capsys):
    target = tmp_path / "out.msh"
    skin = [s for s in list_cad(files / "solids.step") if s.dim == 2]
    bore = next(s.tag for s in skin if s.radius == pytest.approx(-0.5))
    top = next(s.tag for s in skin if s.normal == pytest.approx((0, 0, 1)))
    said = [f"bore={bore}", "ends=box:-1,-1,-0.1,3,4,0.1", f"ends={top}", "body=3:1", "edge=1:1"]
    said.append("all=3:box:-9,-9,-9,9,9,9")
    command = ["mesh", str(files / "solids.step"), "-o", str(target), "--size", "0.4"]
    assert main([*command, *(a for s in said for a in ("--group", s))]) == 0
    assert "bore: " in capsys.readouterr().out
    mesh = lacmesh.read(target)
    assert set(mesh.cell_groups) == {"bore", "ends", "body", "edge", "all"}
    assert area(mesh, mesh.cell_groups["bore"]) == pytest.approx(4 * np.pi, rel=0.06)
    assert area(mesh, mesh.cell_groups["ends"]) == pytest.approx(2 * (6 - np.pi / 4), rel=0.03)
    cells = mesh.cell_groups
    assert {mesh.group_dim(n) for n in ("body", "all")} == {3} and mesh.group_dim("edge") == 1
    assert len(cells["all"]) == (mesh.cell_dim == 3).sum() > len(cells["body"]) > 0
    assert (mesh.cell_dim == 1).sum() == len(cells["edge"]) > 0  # other curves are left out, and points
    assert not (mesh.cell_dim == 0).any()
    assert len(mesh.cells_of("entity:2:1"))  # a surface in no group


def test_groups_of_a_script_are_kept(files):
    mesh = mesh_cad(files / "column.geo", groups={"side": [EntitySelection(None, (13,))]}, order=1, size=0.5)
    assert {n: mesh.group_dim(n) for n in mesh.cell_groups} == {"top": 2, "2:7": 2, "side": 2}
    assert mesh.points[mesh.block("TRIA3")[mesh.cell_groups["top"]]][..., 2].min() == 2
    with pytest.raises(RequestError, match="named 'top' already"):
        mesh_cad(files / "column.geo", groups={"top": [EntitySelection(None, (13,))]})


def test_size_is_the_length_of_edges(files):
    """Also where the script says otherwise."""
    for name, size, order in (("solids.step", 0.35, None), ("column.geo", 0.25, 1)):
        mesh = mesh_cad(files / name, size=size, order=order)
        assert edges_of(mesh, np.flatnonzero(mesh.cell_dim == 2))[0].mean() == pytest.approx(size, rel=0.15)


@pytest.mark.parametrize(("h", "far"), [(1.5, 5.0), (4.0, 2.0)])
def test_slave_faces_have_the_size_asked(h, far):
    """And cells that grow away from it, or shrink, where the slave's are the larger ones."""
    mesh = mesh_cad(LUG, groups={"bore": [EntitySelection(None, (13,))]}, slave=["bore"], slave_size=h, size=far)
    length, _ = edges_of(mesh, mesh.cell_groups["bore"])
    assert length.mean() == pytest.approx(h, rel=0.1)
    assert np.percentile(length, 95) < 1.35 * h
    lug = np.flatnonzero((mesh.cell_dim == 3) & (mesh.cell_data["entity"][:, 1] == 1))
    length, middle = edges_of(mesh, lug)
    away = np.hypot(middle[:, 0], middle[:, 2] - 32) - 12
    near, further = length[away < h / 2], length[away > 16]
    assert near.mean() == pytest.approx(h, rel=0.25) and further.mean() == pytest.approx(far, rel=0.3)
    steps = [length[(away >= a) & (away < a + 3)].mean() for a in (0, 3, 6, 9)]
    assert (np.diff(steps) * (far - h) > 0).all()  # all the way


def test_slave_size_in_the_plane_and_beside_the_sizes_of_a_script(files):
    mesh = mesh_cad(
        files / "plate.geo", groups={"hole": [EntitySelection(None, (5,))]}, slave=["hole"], slave_size=0.08
    )
    assert edges_of(mesh, mesh.cell_groups["hole"])[0].mean() == pytest.approx(0.08, rel=0.1)
    mesh = mesh_cad(files / "column.geo", slave=["2:7"], slave_size=0.1, order=1)
    assert edges_of(mesh, mesh.cell_groups["2:7"])[0].mean() == pytest.approx(0.1, rel=0.1)
    plain = mesh_cad(files / "column.geo", order=1)
    top = [edges_of(m, m.cell_groups["top"])[0].mean() for m in (mesh, plain)]
    assert top[0] == pytest.approx(top[1], rel=0.05)


def test_second_order_stands_on_the_geometry():
    bore, pin = EntitySelection(None, (13,)), EntitySelection(None, (15,))
    mesh = mesh_cad(LUG, groups={"bore": [bore], "pin": [pin]}, size=5, order=2)
    assert set(mesh.cells_by_type) == {"TRIA6", "TETRA10"}
    for group, radius, axis in (("bore", 12, 32), ("pin", 11.8, 31.8)):
        ((_, _, nodes),) = mesh.select(mesh.cell_groups[group])
        x = mesh.points[nodes]
        assert np.abs(np.hypot(x[..., 0], x[..., 2] - axis) - radius).max() < 1e-5
    from lacmesh.reference.quadrature import rule
    from lacmesh.reference.shapes import jacobian

    X = np.vstack([np.array(CELLS["TETRA10"].reference), rule("TETRA", 6)[0]])
    assert np.linalg.det(jacobian("TETRA10", mesh.points[mesh.block("TETRA10")], X)).min() > 0
    exact = {s.tag: s.measure for s in list_cad(LUG) if s.dim == 3}
    assert volume(mesh) == pytest.approx(sum(exact.values()), rel=2e-4)
    assert lacmesh.cut_skin(mesh, "bore").n_macros == len(mesh.cell_groups["bore"])


def test_cells_that_stay_invalid_are_told():
    import gmsh

    from lacmesh.gmsh import mesher

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        entity = gmsh.model.addDiscreteEntity(3)
        points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]], float)
        gmsh.model.mesh.addNodes(3, entity, range(1, 6), points.ravel())
        gmsh.model.mesh.addElementsByType(entity, 4, [8, 9], [1, 2, 3, 4, 1, 2, 3, 5])
        with pytest.warns(LacmeshWarning, match=r"1 cells are inverted or degenerate \(9\)"):
            mesher.check_cells(gmsh, 3)
    finally:
        gmsh.finalize()


@pytest.mark.parametrize("suffix", [".msh", ".med"])
def test_the_output_is_what_its_suffix_says(files, tmp_path, suffix):
    target = tmp_path / f"out{suffix}"
    command = ["mesh", str(files / "solids.step"), "-o", str(target), "--group", "ball=8", "--size", "1", "-q"]
    assert main(command) == 0
    mesh = lacmesh.read(target)
    assert len(mesh.cell_groups["ball"]) and mesh.dim == 3
    assert main(command) == 2
    assert main([*command, "--force"]) == 0
    if suffix == ".msh":
        assert main([*command, "--force", "--msh", "2.2", "--ascii"]) == 0
        assert target.read_bytes().startswith(b"$MeshFormat\n2.2 0")


# ---- groups without a name, in the commands that follow

TAGS = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1}; Box(2) = {0, 0, 1.1, 1, 1, 1};
Physical Surface(5) = {6}; Physical Volume(5) = {1, 2};
Physical Surface("master", 7) = {11};
"""


@pytest.fixture(scope="module")
def tagged(tmp_path_factory):
    """Two boxes; 5 is the tag of a surface and of the volumes, and neither has a name."""
    folder = tmp_path_factory.mktemp("tagged")
    (folder / "tags.geo").write_text(TAGS)
    command = ["mesh", str(folder / "tags.geo"), "-o", str(folder / "tags.msh"), "--size", "0.5", "-q"]
    assert main([*command, "--slave", "2:5", "--slave-size", "0.4"]) == 0
    return folder / "tags.msh"


@pytest.mark.parametrize(
    ("spec", "master", "status"),
    [("2:5", "7", 0), ("2:5", "2:7", 0), ("entity:2:6", "entity:2:11", 0), ("5", "7", 2), ("entity:2:99", "7", 2)],
)
def test_every_command_takes_every_way_to_name_a_group(tagged, tmp_path, spec, master, status, capsys):
    cut, page = tmp_path / "cut.msh", tmp_path / "cut.html"
    assert main(["cut", str(tagged), "--slave", spec, "-o", str(cut), "-q"]) == status
    if status:
        said = capsys.readouterr().err
        wanted = "tag 5 means several groups (2:5, 3:5)" if spec == "5" else "no entity named 'entity:2:99'"
        assert wanted in said and said.count("\n") == 1
    assert main(["check", str(tagged), "--slave", spec, "--json"]) == status
    assert main(["view", str(tagged), "--slave", spec, "--master", master, "-o", str(page), "-q"]) == status
    if not status:
        assert lacmesh.Cut(lacmesh.read(cut)).n_macros == len(lacmesh.read(tagged).cell_groups["2:5"]) > 8
        assert main(["check", str(cut), "--slave", spec, "--master", master, "-q"]) == 0
        assert main(["quality", str(cut), "--group", spec, "-q"]) == 0
        assert main(["orient", str(cut), "--group", spec, "-o", str(tmp_path / "o.msh"), "-q"]) == 0


# ---- what is wrong (tests/bad_input/command_cases.py has the others)


@pytest.mark.parametrize(
    ("name", "status", "words"),
    [
        ("three_sides.geo", 1, "cannot mesh it|without cells"),
        ("nothing.step", 3, "No such file"),
        ("open.stl", 1, "24 edges .*--dim 2"),
        ("overlapping.stl", 1, "cannot mesh it"),
    ],
)
def test_a_bad_file_is_one_sentence(files, tmp_path, name, status, words, capsys):
    assert main(["mesh", str(files / name), "-o", str(tmp_path / "out.msh")]) == status
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1 and re.search(words, said.err)
    assert said.err.startswith(f"lacmesh: error: {files / name}")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--group", "=1"], "says no group"),
        (["--group", "x=1,a"], "says no group"),
        (["--group", "x=box:0,0,0,1,1"], "says no group"),
        (["--slave", "x"], "go together"),
        (["--json"], "--json goes with"),
    ],
)
def test_a_bad_request_is_status_2(files, tmp_path, options, words, capsys):
    assert main(["mesh", str(files / "solids.step"), "-o", str(tmp_path / "out.msh"), *options]) == 2
    said = capsys.readouterr()
    assert words in said.err and said.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_what_the_reader_of_step_says_is_repeated(tmp_path, capsys):
    """A file that ends early is an error that names the line; one that lacks some of its lines, a warning."""
    lines = LUG.read_text().splitlines(keepends=True)
    early, lacking = tmp_path / "early.step", tmp_path / "lacking.step"
    early.write_text("".join(lines[:700]))
    lacking.write_text("".join(lines[:399] + lines[500:]))
    assert main(["mesh", str(early), "--list"]) == 3
    assert re.search(
        r"early\.step: gmsh cannot read it as STEP .* Line 70\d: .*unexpected end", capsys.readouterr().err
    )
    assert main(["mesh", str(lacking), "--list"]) == 0
    said = capsys.readouterr()
    assert "1 volume, 6 surfaces" in said.out
    assert re.search(r"warning: .*lacking\.step: its reader says Unresolved Reference", said.err)


def test_surfaces_of_a_body_that_is_lost_are_told(tmp_path, capsys):
    """One face of the lug is no face: its others bound nothing."""
    broken = tmp_path / "broken.step"
    broken.write_text(LUG.read_text().replace("ADVANCED_FACE", "ADVANCD_FACE", 1))
    with pytest.warns(LacmeshWarning, match=r"13 surfaces bound no volume \(7, 8"):
        shapes = list_cad(broken)
    assert [s.dim for s in shapes].count(3) == 1 and sum(s.dim == 2 and not s.bodies for s in shapes) == 13
    assert main(["mesh", str(broken), "--list"]) == 0
    assert "of body" in capsys.readouterr().out


def test_a_script_whose_last_line_has_no_end(tmp_path):
    """gmsh leaves statements out; lacmesh says so, and nothing where all is well."""
    text = 'SetFactory("OpenCASCADE");\nBox(1) = {0, 0, 0, 1, 1, 1};\n'
    text += 'Physical Surface("a") = {1}; Physical Surface("b") = {2};'
    script = tmp_path / "box.geo"
    script.write_text(text)
    with pytest.warns(LacmeshWarning, match="last line has no end"):
        assert list_cad(script)
    script.write_text(text + "\n")
    assert {g for s in list_cad(script) for g in s.groups} == {"a", "b"}


def test_an_output_that_cannot_be_is_said_before_meshing(files, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(cad, "_run_child", lambda folder: pytest.fail("meshed for nothing"))
    step = str(files / "solids.step")
    assert main(["mesh", step, "-o", str(tmp_path / "out.xyz_")]) == 2
    assert main(["mesh", step, "-o", str(tmp_path / "no" / "out.msh")]) == 3
    assert main(["mesh", step]) == 2
    capsys.readouterr()


def test_without_gmsh_the_line_that_installs_it(files, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    assert main(["mesh", str(files / "solids.step"), "--list"]) == 2
    assert "pip install 'lacmesh[gmsh]'" in capsys.readouterr().err


def test_a_child_that_dies_is_one_sentence(files, monkeypatch):
    monkeypatch.setattr(cad, "_run_child", lambda folder: (-signal.SIGSEGV, "Aborted\n"))
    with pytest.raises(ReadError, match=r"gmsh died on it \(status -11: Aborted\)"):
        list_cad(files / "solids.step")


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupt_stops_gmsh_too(tmp_path, number, status):
    """A mesh that would take minutes; neither the child nor a file is left."""
    env = dict(os.environ, TMPDIR=str(tmp_path))
    command = [sys.executable, "-m", "lacmesh", "mesh", str(LUG), "-o", str(tmp_path / "out.msh"), "--size", "0.2"]
    process = subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    child = ""
    for _ in range(6000):
        child = child or children.read_text().strip() if children.exists() else ""
        if child and any(tmp_path.glob("lacmesh-*/printed")):
            break
        time.sleep(0.05)
    time.sleep(1.0)  # gmsh is at work
    process.send_signal(number)
    _, said = process.communicate(timeout=300)
    assert process.returncode == status and "nothing was written" in said
    assert child and not Path(f"/proc/{child}").exists()
    assert not list(tmp_path.iterdir())


def test_groups_are_parsed():
    assert parse_group("a=b=1") == ("a=b", EntitySelection(None, (1,)))
    assert parse_group("a=2:box:0,0,0,1,1,1") == ("a", EntitySelection(2, (), (0, 0, 0, 1, 1, 1)))
    assert parse_group("a=1:2,3") == ("a", EntitySelection(1, (2, 3)))


FOUR = """Point(1) = {0, 0, 1, .3}; Point(2) = {1, 0, 2, .3}; Point(3) = {1, 1, 3, .3}; Point(4) = {0, 1, 2, .3};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
"""
FIN = """Point(5) = {0, 0, 5, .3}; Line(5) = {2, 5}; Line(6) = {5, 1};
Curve Loop(2) = {1, 5, 6}; Plane Surface(2) = {2};
"""
OCC = 'SetFactory("OpenCASCADE");\n'


@pytest.mark.parametrize(
    ("text", "dim"),
    [
        (f"{OCC}Rectangle(1) = {{0, 0, 0, 1, 2}};\n", 1),
        (f"{OCC}Rectangle(1) = {{0, 0, 0, 1, 2}};\nRotate {{{{1, 2, 3}}, {{0, 0, 0}}, 0.7}} {{Surface{{1}};}}\n", 1),
        (f"{OCC}Sphere(1) = {{0, 0, 0, 1}};\nDelete {{Volume{{1}};}}\n", 2),
        (f"{OCC}Box(1) = {{0, 0, 0, 1, 1, 1}};\n", 2),  # volumes, though only surfaces are meshed
        (FOUR, 1),
        (FOUR + FIN, 2),
    ],
)
def test_a_tag_alone_is_a_surface_unless_the_file_is_plane(text, dim, tmp_path):
    script = tmp_path / "a.geo"
    script.write_text(text)
    mesh = mesh_cad(script, groups={"it": [EntitySelection(None, (1,))], "curve": [EntitySelection(1, (1,))]}, dim=2)
    assert {name: mesh.group_dim(name) for name in mesh.cell_groups} == {"it": dim, "curve": 1}


def test_surfaces_of_a_solid_are_slaves_of_a_shell(tmp_path, capsys):
    target = tmp_path / "shell.msh"
    command = ["mesh", str(LUG), "--dim", "2", "--group", "slave=15", "-o", str(target), "--size", "5"]
    assert main([*command, "--slave", "slave", "--slave-size", "1.5"]) == 0
    mesh = lacmesh.read(target)
    (listed,) = [s for s in list_cad(LUG) if (s.dim, s.tag) == (2, 15)]
    assert area(mesh, mesh.cell_groups["slave"]) == pytest.approx(listed.measure, rel=0.01)
    assert edges_of(mesh, mesh.cell_groups["slave"])[0].mean() == pytest.approx(1.5, rel=0.15)
    assert set(mesh.cell_dim[mesh.cell_groups["slave"]]) == {2}
    assert main([*command, "--force", "--slave", "slav", "--slave-size", "1.5"]) == 2
    assert "no group of surfaces named 'slav'" in capsys.readouterr().err


def test_dim_2_meshes_a_shell(files):
    mesh = mesh_cad(files / "open.stl", dim=2, size=0.2, groups={"side": [EntitySelection(None, (2,))]})
    assert mesh.group_dim("side") == 2
    assert set(mesh.cells_by_type) == {"SEG2", "TRIA3"}
    assert area(mesh, np.flatnonzero(mesh.cell_dim == 2)) == pytest.approx(5)
    with pytest.raises(DataError, match="no volume"):
        mesh_cad(files / "plate.brep", dim=3)
