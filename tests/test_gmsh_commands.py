"""`lacmesh mesh`: what is listed of CAD files, their meshes, and wrong requests."""

import json
import re
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, LacmeshWarning, RequestError
from lacmesh.gmsh import CadShape, cad
from lacmesh.gmsh.cad import EntitySelection, list_cad, mesh_cad, parse_group
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian
from lacmesh.topology.orientation import analyse_orientation
from tests.samples import each_option
from tests.viewing import DATA
from verification.measures.cutting import sizes

pytestmark = pytest.mark.gmsh
LUG = DATA / "pin_in_lug.step"


# ---- geometries


@contextmanager
def session():
    """A quiet session of gmsh."""
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    try:
        yield gmsh
    finally:
        if gmsh.isInitialized():  # not after a window that could not be opened
            gmsh.logger.stop()  # else the next session begins with its lines
            gmsh.finalize()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files of every kind, by name; parts of an assembly have names as a CAD program gives them."""
    folder = tmp_path_factory.mktemp("cad")
    for name, text in SCRIPTS.items():
        (folder / name).write_text(text)
    with session() as gmsh:
        for names, text in GEOMETRIES.items():
            (folder / "made.geo").write_text(OCC + text)
            gmsh.open(str(folder / "made.geo"))
            if names.endswith(".stl"):
                gmsh.model.mesh.generate(2)
            for name in names.split():
                gmsh.write(str(folder / name))
            gmsh.clear()
    text = (folder / "assembly.step").read_text()
    for k, name in ((1, "Base plate"), (2, "Upper block")):
        text = re.sub(rf"'Open CASCADE STEP translator [\d.]+ \d\.{k}'", f"'{name}'", text)
    (folder / "assembly.step").write_text(text)
    return folder


OCC = 'SetFactory("OpenCASCADE");\n'
RECTANGLE = OCC + "Rectangle(1) = {0, 0, 0, 1, 2};\n"
PLATE = "Rectangle(1) = {-2, -1, 0, 4, 2}; Disk(2) = {0, 0, 0, 0.5, 0.5};\n"
PLATE += "BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }\n"
#: a box 2 x 3 x 4 with a round hole along z, and a ball; a plate with a hole; boxes; one without its lid
GEOMETRIES = {
    "solids.step solids.stp solids.brep": "Box(1) = {0, 0, 0, 2, 3, 4}; Cylinder(2) = {1, 1.5, -1, 0, 0, 6, 0.5};\n"
    "BooleanDifference{ Volume{1}; Delete; }{ Volume{2}; Delete; } Sphere(3) = {6, 0, 0, 1};\n",
    "plate.brep": PLATE,
    "box.iges box.igs": "Box(1) = {0, 0, 0, 2, 3, 4};\n",
    "assembly.step": "Box(1) = {0, 0, 0, 1, 1, 1}; Box(2) = {3, 0, 0, 1, 1, 1};\n",
    "open.stl": "Box(1) = {0, 0, 0, 1, 1, 1}; Physical Surface(1) = {1, 2, 3, 4, 5};\n",
}
#: a quadrangle in a tilted plane, and a triangle that stands on it
FOUR = """Point(1) = {0, 0, 1, .3}; Point(2) = {1, 0, 2, .3}; Point(3) = {1, 1, 3, .3}; Point(4) = {0, 1, 2, .3};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4}; Plane Surface(1) = {1};
"""
FIN = """Point(5) = {0, 0, 5, .3}; Line(5) = {2, 5}; Line(6) = {5, 1};
Curve Loop(2) = {1, 5, 6}; Plane Surface(2) = {2};
"""
#: a unit square drawn up by 2, a cylinder of radius 2 and height 3
SCRIPTS = {
    "plate.geo": OCC + PLATE + "Mesh.MeshSizeMax = 0.3;\n",
    "column.geo": FOUR.replace(", 1, .3", ", 0, .3").replace(", 2, .3", ", 0, .3").replace(", 3, .3", ", 0, .3")
    + 'out[] = Extrude {0, 0, 2} { Surface{1}; };\nPhysical Surface("top") = {out[0]}; Physical Surface(7) = {1};\n'
    'Physical Volume("body") = {1};\nMesh.ElementOrder = 2;\n',
    "round.geo_unrolled": "Point(1)={0,0,0,.5}; Point(2)={2,0,0,.5}; Point(3)={0,2,0,.5}; Point(4)={-2,0,0,.5};\n"
    "Point(5)={0,-2,0,.5}; Circle(1)={2,1,3}; Circle(2)={3,1,4}; Circle(3)={4,1,5}; Circle(4)={5,1,2};\n"
    "Curve Loop(1)={1,2,3,4}; Plane Surface(1)={1}; Extrude {0,0,3} {Surface{1};}\n",
}


def tagged_as(*tags, dim=None):
    return [EntitySelection(dim, tags)]


def size_of(mesh, cells):
    return sizes(mesh)[cells].sum()


def volume(mesh):
    return size_of(mesh, mesh.cell_dim == mesh.dim)


def edges_of(mesh, cells):
    """Lengths of the distinct edges of some cells, and their middles."""
    pairs = [np.sort(n[:, CELLS[k].edges], axis=2).reshape(-1, 2) for k, _, n in mesh.select(cells)]
    ends = mesh.points[np.unique(np.concatenate(pairs), axis=0)]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), ends.mean(axis=1)


def mean_edge(mesh, group):
    return edges_of(mesh, mesh.cell_groups[group])[0].mean()


# ---- listing


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
    normals = {tuple(np.round(s.normal)) for s in skin if s.normal and s.bodies == (lug.tag,)}
    assert normals == {tuple(s * np.eye(3)[k]) for k in range(3) for s in (-1, 1)}
    bottom = min(skin, key=lambda s: s.centre[2])
    assert bottom.normal == pytest.approx((0, 0, -1)) and bottom.measure == pytest.approx(36 * 32 - np.pi * 3.5**2)
    for s in skin:
        assert all(lo - 1e-6 <= c <= hi + 1e-6 for lo, c, hi in zip(s.box[0], s.centre, s.box[1], strict=True))


def test_the_built_in_kernel_is_listed_from_a_mesh(files):
    body, *skin = list_cad(files / "round.geo_unrolled")
    assert body.measure == pytest.approx(12 * np.pi, rel=1e-5) and body.centre == pytest.approx((0, 0, 1.5), abs=1e-5)
    assert sorted(round(s.radius, 3) for s in skin if s.radius is not None) == [2.0] * 4
    assert sum(s.measure for s in skin) == pytest.approx(2 * np.pi * 2 * 3 + 2 * np.pi * 4, rel=1e-5)
    ends = sorted(((s.normal, s.centre[2]) for s in skin if s.normal), key=lambda end: end[1])
    assert [(tuple(np.round(n, 9) + 0.0), round(z, 9)) for n, z in ends] == [((0, 0, -1), 0), ((0, 0, 1), 3)]
    column = list_cad(files / "column.geo")
    assert [s.groups for s in column if s.groups] == [("body",), ("2:7",), ("top",)]
    for s in column[1:]:  # every normal leaves the column
        assert np.dot(s.normal, np.subtract(s.centre, column[0].centre)) > 0.4


@pytest.mark.parametrize("name", ["plate.brep", "plate.geo"])
def test_a_plane_file_lists_curves(files, name):
    body, *skin = list_cad(files / name)
    assert (body.dim, body.measure) == (2, pytest.approx(8 - np.pi / 4, rel=1e-9))
    (hole,) = [s for s in skin if s.radius is not None]
    assert hole.radius == pytest.approx(-0.5, rel=1e-4) and hole.measure == pytest.approx(np.pi, rel=1e-9)
    sides = {tuple(np.round(s.normal, 6) + 0.0): round(s.measure, 9) for s in skin if s.normal}
    assert sides == {(1, 0, 0): 2, (-1, 0, 0): 2, (0, 1, 0): 4, (0, -1, 0): 4}


def test_the_list_is_printed(files, run):
    """With the names of the parts of an assembly."""
    for path, words in (
        (LUG, ("2 volumes, 20 surfaces", "hollow, r = 12", "round, r = 11.8", "Cylinder", "753.98", "(0, 0, -1)")),
        (files / "plate.geo", ("1 surface, 5 curves",)),
        (files / "assembly.step", ("1 Base plate Volume", "2 Upper block Volume")),
    ):
        out = " ".join(run(f"mesh {path} --list").split())
        assert all(part in out for part in words), out
    found = json.loads(run(f"mesh {LUG} --list --json"))
    assert found["file"] == str(LUG) and len(found["shapes"]) == 22
    assert set(found["shapes"][0]) == set(CadShape.__dataclass_fields__)


# ---- meshing

HOLED = 24 - np.pi + 4 / 3 * np.pi


@pytest.mark.parametrize(
    ("name", "size", "kinds"),
    each_option(
        [
            *((f"solids.{suffix}", HOLED, "TRIA3 TETRA4") for suffix in ("step", "stp", "brep")),
            *((f"box.{suffix}", 24, "TRIA3 TETRA4") for suffix in ("iges", "igs")),
            ("column.geo", 2, "TRIA6 TETRA10"),
            ("round.geo_unrolled", 12 * np.pi, "TRIA3 TETRA4"),
            ("plate.geo", 8 - np.pi / 4, "SEG2 TRIA3"),
        ],
        of=lambda row: [row[1:]],
    ),
)
def test_every_kind_of_file_is_meshed(files, name, size, kinds):
    mesh = mesh_cad(files / name)
    assert set(mesh.cells_by_type) == set(kinds.split())
    assert volume(mesh) == pytest.approx(size, rel=0.03)
    skin = np.flatnonzero(mesh.cell_dim == mesh.dim - 1)
    assert len(skin) and not len(analyse_orientation(mesh, skin).to_flip)
    assert sizes(mesh)[mesh.cell_dim == mesh.dim].min() > 0


def test_groups_by_tag_and_by_box(files, run):
    skin = [s for s in list_cad(files / "solids.step") if s.dim == 2]
    bore = next(s.tag for s in skin if s.radius == pytest.approx(-0.5))
    top = next(s.tag for s in skin if s.normal == pytest.approx((0, 0, 1)))
    said = [f"bore={bore}", "ends=box:-1,-1,-0.1,3,4,0.1", f"ends={top}", "body=3:1", "edge=1:1"]
    said.append("all=3:box:-9,-9,-9,9,9,9")
    command, out = (
        f"mesh {files / 'solids.step'} --size 0.4 --group {' --group '.join(said)} -o out.msh",
        Path("out.msh"),
    )
    out.touch()
    run(command, 2)
    assert "bore: " in run(f"{command} --force --msh 2.2 --ascii")
    assert out.read_bytes().startswith(b"$MeshFormat\n2.2 0")
    mesh = lacmesh.read(out)
    cells = mesh.cell_groups
    assert set(cells) == {"bore", "ends", "body", "edge", "all"}
    assert size_of(mesh, cells["bore"]) == pytest.approx(4 * np.pi, rel=0.06)
    assert size_of(mesh, cells["ends"]) == pytest.approx(2 * (6 - np.pi / 4), rel=0.03)
    assert {mesh.group_dim(n) for n in ("body", "all")} == {3} and mesh.group_dim("edge") == 1
    assert len(cells["all"]) == (mesh.cell_dim == 3).sum() > len(cells["body"]) > 0
    assert (mesh.cell_dim == 1).sum() == len(cells["edge"]) > 0  # other curves are left out, and points
    assert not (mesh.cell_dim == 0).any() and len(mesh.cells_of("entity:2:1"))  # a surface in no group


def test_groups_of_a_script_are_kept_and_groups_are_parsed(files):
    mesh = mesh_cad(files / "column.geo", groups={"side": tagged_as(13)}, order=1, size=0.5)
    assert {n: mesh.group_dim(n) for n in mesh.cell_groups} == {"top": 2, "2:7": 2, "body": 3, "side": 2}
    assert mesh.points[mesh.block("TRIA3")[mesh.cell_groups["top"]]][..., 2].min() == 2
    with pytest.raises(RequestError, match="named 'top' already"):
        mesh_cad(files / "column.geo", groups={"top": tagged_as(13)})
    assert parse_group("a=b=1") == ("a=b", EntitySelection(None, (1,)))
    assert parse_group("a=2:box:0,0,0,1,1,1") == ("a", EntitySelection(2, (), (0, 0, 0, 1, 1, 1)))
    assert parse_group("a=1:2,3") == ("a", EntitySelection(1, (2, 3)))


def test_size_is_the_length_of_edges(files):
    """Also where the script says otherwise; that of the slave in the plane, and beside the sizes of a script."""
    for name, size, order in (("solids.step", 0.35, None), ("column.geo", 0.25, 1)):
        mesh = mesh_cad(files / name, size=size, order=order)
        assert edges_of(mesh, np.flatnonzero(mesh.cell_dim == 2))[0].mean() == pytest.approx(size, rel=0.15)
    mesh = mesh_cad(files / "plate.geo", groups={"hole": tagged_as(5)}, slave=["hole"], slave_size=0.08)
    assert mean_edge(mesh, "hole") == pytest.approx(0.08, rel=0.1)
    mesh = mesh_cad(files / "column.geo", slave=["2:7"], slave_size=0.1, order=1)
    assert mean_edge(mesh, "2:7") == pytest.approx(0.1, rel=0.1)
    assert mean_edge(mesh, "top") == pytest.approx(mean_edge(mesh_cad(files / "column.geo", order=1), "top"), rel=0.05)


@pytest.mark.rows("4.0-2.0")
@pytest.mark.parametrize(("h", "far"), [(1.5, 5.0), (4.0, 2.0)])
def test_slave_faces_have_the_size_asked(h, far):
    """And cells that grow away from it, or shrink, where the slave's are the larger ones."""
    mesh = mesh_cad(LUG, groups={"bore": tagged_as(13)}, slave=["bore"], slave_size=h, size=far)
    length, _ = edges_of(mesh, mesh.cell_groups["bore"])
    assert length.mean() == pytest.approx(h, rel=0.1) and np.percentile(length, 95) < 1.35 * h
    lug = np.flatnonzero((mesh.cell_dim == 3) & (mesh.cell_data["entity"][:, 1] == 1))
    length, middle = edges_of(mesh, lug)
    away = np.hypot(middle[:, 0], middle[:, 2] - 32) - 12
    assert length[away < h / 2].mean() == pytest.approx(h, rel=0.25)
    assert length[away > 16].mean() == pytest.approx(far, rel=0.3)
    steps = [length[(away >= a) & (away < a + 3)].mean() for a in (0, 3, 6, 9)]
    assert (np.diff(steps) * (far - h) > 0).all()  # all the way


@pytest.mark.slow
def test_second_order_stands_on_the_geometry():
    mesh = mesh_cad(LUG, groups={"bore": tagged_as(13), "pin": tagged_as(15)}, size=5, order=2)
    assert set(mesh.cells_by_type) == {"TRIA6", "TETRA10"}
    for group, radius, axis in (("bore", 12, 32), ("pin", 11.8, 31.8)):
        x = mesh.points[mesh.nodes_on(mesh.cell_groups[group])]
        assert np.abs(np.hypot(x[:, 0], x[:, 2] - axis) - radius).max() < 1e-5
    X = np.vstack([np.array(CELLS["TETRA10"].reference), rule("TETRA", 6)[0]])
    assert np.linalg.det(jacobian("TETRA10", mesh.points[mesh.block("TETRA10")], X)).min() > 0
    assert volume(mesh) == pytest.approx(sum(s.measure for s in list_cad(LUG) if s.dim == 3), rel=2e-4)
    assert lacmesh.cut_skin(mesh, "bore").n_macros == len(mesh.cell_groups["bore"])


def test_cells_that_stay_invalid_are_told():
    with session() as gmsh:
        entity = gmsh.model.addDiscreteEntity(3)
        points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]], float)
        gmsh.model.mesh.addNodes(3, entity, range(1, 6), points.ravel())
        gmsh.model.mesh.addElementsByType(entity, 4, [8, 9], [1, 2, 3, 4, 1, 2, 3, 5])
        with pytest.warns(LacmeshWarning, match=r"1 cells are inverted or degenerate \(9\)"):
            cad.check_cells(gmsh, 3)


@pytest.mark.parametrize(
    ("text", "dim"),
    [
        (RECTANGLE, 1),
        (RECTANGLE + "Rotate {{1, 2, 3}, {0, 0, 0}, 0.7} {Surface{1};}\n", 1),
        (OCC + "Sphere(1) = {0, 0, 0, 1};\nDelete {Volume{1};}\n", 2),
        (OCC + "Box(1) = {0, 0, 0, 1, 1, 1};\n", 2),  # volumes, though only surfaces are meshed
        (FOUR, 1),
        (FOUR + FIN, 2),
    ],
)
def test_a_tag_alone_is_a_surface_unless_the_file_is_plane(text, dim, tmp_path):
    (tmp_path / "a.geo").write_text(text)
    mesh = mesh_cad(tmp_path / "a.geo", groups={"it": tagged_as(1), "curve": tagged_as(1, dim=1)}, dim=2)
    assert {name: mesh.group_dim(name) for name in mesh.cell_groups} == {"it": dim, "curve": 1}


def test_dim_2_meshes_shells_and_surfaces_of_a_solid_are_slaves_of_one(files, run):
    mesh = mesh_cad(files / "open.stl", dim=2, size=0.2, groups={"side": tagged_as(2)})
    assert mesh.group_dim("side") == 2 and set(mesh.cells_by_type) == {"SEG2", "TRIA3"}
    assert size_of(mesh, np.flatnonzero(mesh.cell_dim == 2)) == pytest.approx(5)
    with pytest.raises(DataError, match="no volume"):
        mesh_cad(files / "plate.brep", dim=3)
    command = f"mesh {LUG} --dim 2 --group slave=15 -o shell.msh --size 5 --slave-size 1.5"
    run(f"{command} --slave slave")
    mesh = lacmesh.read("shell.msh")
    (listed,) = [s for s in list_cad(LUG) if (s.dim, s.tag) == (2, 15)]
    assert size_of(mesh, mesh.cell_groups["slave"]) == pytest.approx(listed.measure, rel=0.01)
    assert mean_edge(mesh, "slave") == pytest.approx(1.5, rel=0.15) and mesh.group_dim("slave") == 2
    assert "no group of surfaces named 'slav'" in run(f"{command} --force --slave slav", 2)


# ---- what is wrong (tests/bad_input/command_cases.py has the others)


def test_what_the_reader_of_step_says_is_repeated(run):
    """A file that ends early is an error that names the line; one that lacks some of its lines, a warning."""
    lines = LUG.read_text().splitlines(keepends=True)
    early, lacking, broken = (Path(f"{name}.step") for name in ("early", "lacking", "broken"))
    early.write_text("".join(lines[:700]))
    lacking.write_text("".join(lines[:399] + lines[500:]))
    assert re.search(r"early\.step: .* Line 70\d: .*unexpected end", run("mesh early.step --list", 3))
    said = run("mesh lacking.step --list")
    assert "1 volume, 6 surfaces" in said
    assert re.search(r"warning: .*lacking\.step: its reader says Unresolved Reference", said)
    broken.write_text("".join(lines).replace("ADVANCED_FACE", "ADVANCD_FACE", 1))  # its body is lost
    with pytest.warns(LacmeshWarning, match=r"13 surfaces bound no volume \(7, 8"):
        shapes = list_cad(broken)
    assert [s.dim for s in shapes].count(3) == 1 and sum(s.dim == 2 and not s.bodies for s in shapes) == 13


def test_a_script_whose_last_line_has_no_end(tmp_path):
    """gmsh leaves statements out; lacmesh says so, and nothing where all is well."""
    text = OCC + 'Box(1) = {0, 0, 0, 1, 1, 1};\nPhysical Surface("a") = {1}; Physical Surface("b") = {2};'
    script = tmp_path / "box.geo"
    script.write_text(text)
    with pytest.warns(LacmeshWarning, match="last line has no end"):
        assert list_cad(script)
    script.write_text(text + "\n")
    assert {g for s in list_cad(script) for g in s.groups} == {"a", "b"}


def test_an_output_that_cannot_be_an_absent_gmsh_and_one_that_runs(files, run, monkeypatch):
    step = files / "solids.step"
    with monkeypatch.context() as patched:
        patched.setattr(cad, "opened", lambda *given: pytest.fail("meshed for nothing"))
        for words, status in (("-o out.xyz_", 2), ("-o no/out.msh", 3), ("", 2)):
            run(f"mesh {step} {words}", status)
    with session(), pytest.raises(RequestError, match="runs in this program"):
        list_cad(step)
    monkeypatch.setitem(sys.modules, "gmsh", None)
    assert "pip install 'lacmesh[gmsh]'" in run(f"mesh {step} --list", 2)
