"""gmsh's current model: as a mesh, cut in place, made from a mesh; against files, by way of gmsh's own functions."""

import subprocess
import sys
import tempfile
from dataclasses import replace

import numpy as np
import pytest

import lacmesh
from lacmesh import Cut, cut_skin
from lacmesh.cells import CELLS
from lacmesh.errors import CutError, DataError, GroupNotFoundError, LacmeshWarning, RequestError
from lacmesh.gmsh import cut_model, from_mesh, to_mesh
from tests.formats.msh_meshes import entities, plain
from tests.meshes import cell_with_faces, lenient, random_mesh

pytestmark = [pytest.mark.gmsh, pytest.mark.usefixtures("gmsh")]


# ---- models: as gmsh's scripts, with a slave as `cut_model` takes it, and a group of it


SQUARE = """
Point(1) = {0, 0, 0, 0.5}; Point(2) = {1, 0, 0, 0.5}; Point(3) = {1, 1, 0, 0.5}; Point(4) = {0, 1, 0, 0.5};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1}; Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
"""
#: two boxes of the built-in kernel, one on the other, meshed apart; unnamed groups, a tag in two dimensions
BOXES = f"""{SQUARE}
a() = Extrude{{0, 0, 1}}{{Surface{{1}};}}; b() = Translate{{0.1, 0, 1}}{{Duplicata{{Surface{{1}};}}}};
c() = Extrude{{0, 0, 1}}{{Surface{{b(0)}};}}; MeshSize{{PointsOf{{Volume{{c(1)}};}}}} = 0.35;
Physical Surface("master", 4) = {{a(0)}}; Physical Surface(5) = {{b(0)}};
Physical Volume("all", 5) = {{a(1), c(1)}}; Physical Volume("upper body", 6) = {{c(1)}};
"""
#: a transfinite, recombined box
BRICK = """
SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 2}; Transfinite Curve{:} = 3; Transfinite Surface{:};
Recombine Surface{:}; Transfinite Volume{1};
Physical Surface("ends") = {5, 6}; Physical Surface("end") = {6}; Physical Surface("side") = {1};
"""
MODELS = {
    "boxes": (BOXES, ["2:5"]),
    # a pin in a plate, whose faces match, and a ball apart; the slave is the bore, an interface
    "occ": (
        'SetFactory("OpenCASCADE"); Box(1) = {-1, -1, 0, 2, 2, 1}; Cylinder(2) = {0, 0, -0.5, 0, 0, 2, 0.5};\n'
        "BooleanFragments{Volume{1}; Delete;}{Volume{2}; Delete;} Sphere(9) = {3, 0, 0, 0.7}; Mesh.MeshSizeMax = 0.6;\n"
        's() = Surface In BoundingBox{-0.6, -0.6, -0.1, 0.6, 0.6, 1.1}; Physical Surface("bore") = {s(0)};\n'
        'Physical Volume("parts") = {1, 2, 3};',
        ["bore"],
    ),
    "hexahedra": (f"{BRICK}", ["ends", "side", "entity:2:6"]),
    "hexa27": (f"{BRICK} Mesh.SecondOrderIncomplete = 0; Mesh.ElementOrder = 2;", ["ends", "side"]),
    # a plate with a hole, in the plane: triangles and quadrangles, the slave is the hole's edge
    "plane": (
        'SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, 2, 1}; Disk(2) = {0.5, 0.5, 0, 0.2};\n'
        "BooleanDifference(3) = {Surface{1}; Delete;}{Surface{2}; Delete;}; Rectangle(4) = {2, 0, 0, 1, 1};\n"
        "BooleanFragments{Surface{3}; Delete;}{Surface{4}; Delete;} Recombine Surface{4}; Mesh.MeshSizeMax = 0.2;\n"
        'c() = Curve In BoundingBox{0.2, 0.2, -1, 0.8, 0.8, 1}; Physical Curve("hole") = {c()};',
        ["hole"],
    ),
    # hexahedra below, pyramids and tetrahedra on them, prisms above: every family of solids, the slave all around
    "mixture": (
        f"{SQUARE} Transfinite Curve{{1:4}} = 4; Transfinite Surface{{1}}; Recombine Surface{{1}};\n"
        "a() = Extrude{0, 0, 1}{Surface{1}; Layers{2}; Recombine;}; b() = Extrude{0, 0, 1}{Surface{a(0)};};\n"
        "c() = Extrude{0, 0, 0.5}{Surface{b(0)}; Layers{2}; Recombine;};\n"
        "Transfinite Surface{a(0)}; Recombine Surface{a(0)};\n"
        "Physical Surface(9) = CombinedBoundary{Volume{:};};",
        [9],
    ),
    # periodic and embedded entities
    "periodic": (
        'SetFactory("OpenCASCADE"); Box(1) = {0, 0, 0, 1, 1, 1}; Point(9) = {0.5, 0.5, 0.5};\n'
        "Point(10) = {0.3, 0.3, 1}; Point(11) = {0.6, 0.6, 1}; Line(13) = {10, 11};\n"
        "Point{9} In Volume{1}; Curve{13} In Surface{6};\n"
        'Periodic Surface{2} = {1} Translate{1, 0, 0}; Physical Surface("top") = {6}; Mesh.MeshSizeMax = 0.5;',
        ["top"],
    ),
    # no geometry: from a mesh with mixed cells
    "discrete": ("", ["slave"]),
}
PIN = 'SetFactory("OpenCASCADE"); Cylinder(1) = {0, 0, 0, 0, 0, 1, 1}; Physical Surface("pin") = {1};'


def build(gmsh, name, text=""):
    """Make a model of `MODELS`, or of another script, the current one."""
    if name == "discrete":
        from_mesh(random_mesh(np.random.default_rng(3), 3, slaves=4), name)
        return
    gmsh.model.add(name)
    with tempfile.NamedTemporaryFile("w", suffix=".geo") as file:
        file.write(f"{text or MODELS[name][0]}\n")  # a last line without an end is not read
        file.flush()
        gmsh.merge(file.name)
    gmsh.model.mesh.generate(gmsh.model.getDimension())


@pytest.fixture(params=MODELS)
def model(request, gmsh):
    with lenient():
        build(gmsh, request.param)
    return MODELS[request.param][1]


# ---- what is compared


def saved(gmsh, path):
    """The current model as a msh file with everything in it, read."""
    for name, value in {"Mesh.SaveAll": 1, "Mesh.Binary": 1, "Mesh.MshFileVersion": 4.1}.items():
        gmsh.option.setNumber(name, value)
    gmsh.write(str(path))
    gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
    for view in gmsh.view.getTags():
        gmsh.view.write(view, str(path), append=True)
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    return lacmesh.read(path)


def by_number(mesh, values, on="cell"):
    return dict(zip(getattr(mesh, f"{on}_number").tolist(), np.asarray(values).tolist(), strict=True))


def contents(mesh):
    """A mesh by numbers, but for its name, its steps, data that are none, and the order of its periodic links."""
    found = plain(mesh) | entities(mesh) | {"tags": mesh.group_tags, "boundary": mesh.model and mesh.model.boundary}
    for data in ("cell_data", "node_data"):
        found[data] = {key: values for key, values in found[data].items() if values[-1]}
    found["periodic"] = sorted((*link[:3], sorted(link[3])) for link in found["periodic"])
    return {key: value for key, value in found.items() if key not in ("name", "steps")}


def same(one, other, model=True):
    """Assert that two meshes are the same but for the order of nodes and cells, and without `model` for entities."""
    mine, theirs = contents(one), contents(other)
    different = {key for key in mine.keys() | theirs.keys() if mine.get(key) != theirs.get(key)}
    assert not different - (set() if model else {"boundary", "periodic"})


# ---- the model as a mesh


def discrete(gmsh, *entities):
    """A model of discrete entities (dimension, nodes, elements): elements are (number, cell type's, node tags)."""
    gmsh.model.add("mixed")
    tags = [gmsh.model.addDiscreteEntity(dim) for dim, *_ in entities]
    for tag, (dim, nodes, *_) in zip(tags, entities, strict=True):
        gmsh.model.mesh.addNodes(dim, tag, nodes, np.random.default_rng(0).random(3 * len(nodes)))
    for tag, (_, _, *elements) in zip(tags, entities, strict=True):
        for kind, numbers, nodes in elements:
            gmsh.model.mesh.addElementsByType(tag, kind, numbers, nodes)
    return tags


@pytest.mark.parametrize("turn", [1, -1])
def test_cells_that_get_elements_hides_are_found(gmsh, tmp_path, turn):
    """Two orders in one entity: gmsh's getElements shows one of them."""
    triangles = [(2, [1], [1, 2, 3]), (9, [2], [3, 2, 4, 5, 6, 7])][::turn]
    lines = (1, [3], [1, 2]), (8, [7], [3, 2, 5])
    face, _ = discrete(gmsh, (2, range(1, 9), *triangles), (1, [], *lines))
    gmsh.model.addPhysicalGroup(2, [face], name="both")
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    mesh = to_mesh()
    assert mesh.cells_by_type == {"SEG2": 1, "SEG3": 1, "TRIA3": 1, "TRIA6": 1}
    assert len(mesh.cell_groups["both"]) == 2 and gmsh.option.getNumber("Mesh.SaveAll") == 0
    same(mesh, saved(gmsh, tmp_path / "mixed.msh"))


@pytest.mark.parametrize(("last", "visible"), [(4, True), (5000, False), (1_000_005, True)])
def test_lines_that_get_elements_hides_are_found_whatever_their_numbers(gmsh, last, visible):
    """gmsh counts no lines: one of another order is found by its number."""
    discrete(gmsh, (1, range(1, 7), (1, [1, 3, last + 2], [1, 2, 2, 3, 3, 4]), (8, [last], [4, 5, 6])))
    gmsh.model.mesh.setVisibility([last], int(visible))
    numbers = {number: kind for number, (kind, *_) in plain(to_mesh())["cells"].items()}
    assert numbers == {1: "SEG2", 3: "SEG2", last + 2: "SEG2", last: "SEG3"}
    assert gmsh.model.mesh.getVisibility([1, last]).tolist() == [1, int(visible)]


def test_a_model_that_is_missing_is_refused(gmsh, monkeypatch):
    with pytest.raises(RequestError, match="has no mesh"):
        to_mesh()
    with monkeypatch.context() as patched, pytest.raises(RequestError, match="pip install"):
        patched.setitem(sys.modules, "gmsh", None)
        cut_model("slave")
    gmsh.finalize()
    with pytest.raises(RequestError, match="not running"):
        to_mesh()
    gmsh.initialize(interruptible=False)


# ---- the model cut


@pytest.mark.rows("periodic", "discrete")
@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_a_model_is_the_mesh_of_its_file_and_its_cut_that_of_this_mesh(model, gmsh, tmp_path):
    """gmsh's own functions see the cut."""
    file, mesh = saved(gmsh, tmp_path / "before.msh"), to_mesh()
    same(mesh, file)
    assert mesh.name == gmsh.model.getCurrent()
    assert np.array_equal(mesh.node_number, file.node_number) and np.array_equal(mesh.cell_number, file.cell_number)
    expected = cut_skin(file, model)
    entities = {tag: gmsh.model.getType(*tag) for tag in gmsh.model.getEntities()}
    parts = gmsh.model.getPartitions(*gmsh.model.getEntities(gmsh.model.getDimension())[-1]).size
    cut = cut_model(model)
    same(cut.mesh, expected.mesh, model=False)
    now = to_mesh()
    same(now, expected.mesh)
    assert {tag: gmsh.model.getType(*tag) for tag in gmsh.model.getEntities()} == entities
    again = Cut(now)
    assert again.zones == cut.zones and again.n_macros == cut.n_macros
    for name in ("macro_of_face", "child_kind", "parent_of_cell", "zone_of_face"):
        assert by_number(now, getattr(again, name)) == by_number(cut.mesh, getattr(cut, name))
    name = cut.mesh.group(model[0])
    nodes, _ = gmsh.model.mesh.getNodesForPhysicalGroup(*cut.mesh.group_tags[name][0])
    ours = cut.mesh.nodes_on(cut.mesh.cell_groups[name])
    assert set(nodes.tolist()) == set(cut.mesh.node_number[ours].tolist())
    _, numbers, _ = gmsh.model.mesh.getElements(cut.mesh.dim)
    assert min(gmsh.model.mesh.getElementQualities(np.concatenate(numbers), "minSJ")) > 0
    groups = {name: len(cells) for name, cells in cut.mesh.cell_groups.items() if len(cells)}
    # in MED, gmsh invents a name for unnamed groups
    for suffix in (".msh",) if parts or any(":" in name for name in groups) else (".msh", ".med"):
        gmsh.write(str(tmp_path / f"cut{suffix}"))
        back = lacmesh.read(tmp_path / f"cut{suffix}")
        assert {n: len(c) for n, c in back.cell_groups.items() if len(c)} == groups
    from_mesh(mesh, "copy")  # of the model before, without a geometry
    assert gmsh.model.getCurrent() == "copy"
    if not parts:  # a copy has none
        same(to_mesh(), mesh, model=mesh.name not in ("occ", "periodic"))  # gmsh reads no embedded entities
    assert all(gmsh.model.getType(*entity).startswith("Discrete") for entity in gmsh.model.getEntities() if entity[0])
    for _, tag in gmsh.model.getEntities(0):
        nodes, xyz, _ = gmsh.model.mesh.getNodes(0, tag)
        assert not len(nodes) or np.allclose(gmsh.model.getValue(0, tag, []), xyz)


@pytest.mark.parametrize("spec", ["side", 5, "5", "2:5", "entity:2:6"])
def test_every_way_to_name_the_slave_with_options_as_of_cut_skin(gmsh, spec):
    build(gmsh, "hexahedra")
    gmsh.model.removePhysicalGroups(gmsh.model.getPhysicalGroups())
    gmsh.model.addPhysicalGroup(2, [6], tag=5, name="side" if spec == "side" else "")
    cut = cut_model(spec, views=False, hexa="hexa")
    assert cut.n_macros == 4 and cut.mesh.points[cut.mesh.block("QUAD4")][-20:, :, 2].min() == 2
    assert cut.mesh.cells_by_type["HEXA8"] == 8 + 4 * 5 and not len(gmsh.view.getTags())


def test_the_geometry_stays_attached(gmsh):
    """New nodes have parametric coordinates like the others; gmsh can raise the order, mid-nodes on the cylinder."""
    build(gmsh, "pin", f"{PIN} Mesh.MeshSizeMax = 0.5;")
    old = to_mesh().node_number.max()
    cut_model("pin")
    nodes, points, parameters = gmsh.model.mesh.getNodes(2, 1, returnParametricCoord=True)
    assert len(parameters) == 2 * len(nodes) and nodes.max() > old
    projected = gmsh.model.getValue(2, 1, parameters).reshape(-1, 3)
    assert np.abs(np.hypot(*projected[:, :2].T) - 1).max() < 1e-9
    far = np.linalg.norm(projected - points.reshape(-1, 3), axis=1)
    assert far[nodes <= old].max() < 1e-6 and 0.001 < far[nodes > old].max() < 0.1  # on chords, nearest to there
    gmsh.model.mesh.setOrder(2)
    with pytest.warns(LacmeshWarning, match="earlier mesh"):  # other faces than those that were cut
        mesh = to_mesh()
    edges = mesh.block("TRIA6")[:, [0, 1, 3, 1, 2, 4, 2, 0, 5]].reshape(-1, 3)
    radius = np.hypot(*np.moveaxis(mesh.points[edges], 2, 0)[:2])
    on = (np.abs(radius[:, :2] - 1) < 1e-9).all(axis=1) & (mesh.node_number[edges[:, :2]] <= old).all(axis=1)
    skin = np.abs(np.diff(mesh.points[edges[:, :2]][..., 2], axis=1)).ravel() > 1e-9
    assert (on & skin).sum() > 20 and np.abs(radius[on & skin, 2] - 1).max() < 1e-9


def dump(gmsh):
    """All that gmsh says of its current model."""
    entities, groups, mesh = gmsh.model.getEntities(), gmsh.model.getPhysicalGroups(), gmsh.model.mesh
    elements = [[[a.tolist() for a in part] for part in mesh.getElements(*t)[1:]] for t in entities]
    nodes = [(t, gmsh.model.getType(*t), [a.tolist() for a in mesh.getNodes(*t)]) for t in entities]
    names = [(*g, gmsh.model.getPhysicalName(*g), *gmsh.model.getEntitiesForPhysicalGroup(*g)) for g in groups]
    bounds = [gmsh.model.getBoundary([t], combined=False) for t in entities]
    rest = gmsh.model.getAttributeNames(), gmsh.view.getTags().tolist(), gmsh.model.getCurrent()
    return repr([elements, nodes, names, bounds, rest])


def test_a_failure_leaves_the_model_untouched(gmsh):
    """A cut that is asked for again is there already; some of its groups with others cannot be cut."""
    build(gmsh, "boxes")
    uncut = dump(gmsh)
    for slave, options, error in (
        ("nothing", {}, GroupNotFoundError),
        ("entity:2:999", {}, GroupNotFoundError),
        ("all", {}, CutError),  # volumes
        ("2:5", {"hexa": "cube"}, RequestError),
        ("2:5", {"ring": 2}, RequestError),
    ):
        with pytest.raises(error):
            cut_model(slave, **options)
        assert dump(gmsh) == uncut
    assert cut_model("2:5").n_macros == cut_model("2:5").n_macros == len(to_mesh().cell_groups["2:5"]) // 3
    before = dump(gmsh)
    with pytest.raises(CutError):
        cut_model(["2:5", "master"])
    assert dump(gmsh) == before


INTERRUPTED = """
import signal, gmsh
from lacmesh.gmsh import cut_model
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
gmsh.model.mesh.generate(3)
add = gmsh.model.mesh.addElementsByType
def interrupted(*args):
    signal.raise_signal(signal.SIGINT)
    print("on", flush=True)
    add(*args)
gmsh.model.mesh.addElementsByType = interrupted
try:
    cut_model("entity:2:1")
except KeyboardInterrupt:
    cells = gmsh.model.mesh.getElements(3)[1][0]
    whole = abs(sum(gmsh.model.mesh.getElementQualities(cells, "volume")) - 1) < 1e-12
    print("interrupted", whole, signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""


def test_an_interrupt_waits_until_the_model_is_whole():
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.splitlines()[-1] == "interrupted True True", done.stderr


# ---- the records as views


def test_views_are_of_one_model_and_not_of_an_earlier_mesh(gmsh):
    """A cut model and the same model uncut, side by side; then the first is meshed anew."""
    build(gmsh, "boxes")
    uncut = to_mesh()
    cut = cut_model("2:5")
    from_mesh(uncut, "uncut")
    assert not lacmesh.cutting.cut.is_cut(to_mesh())
    gmsh.model.setCurrent("boxes")
    assert Cut(to_mesh()).n_macros == cut.n_macros
    gmsh.model.setCurrent("uncut")
    assert cut_model("2:5").n_macros == cut.n_macros
    option = gmsh.view.option
    shown = [option.getString(v, "Name") for v in gmsh.view.getTags() if option.getNumber(v, "Visible")]
    assert shown == ["lac_macro", "lac_macro"]
    gmsh.model.setCurrent("boxes")
    gmsh.model.mesh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeFactor", 0.6)
    gmsh.model.mesh.generate(3)
    with pytest.warns(LacmeshWarning, match="earlier mesh"):
        assert not set(to_mesh().cell_data) - {"entity"}
    with pytest.warns(LacmeshWarning, match="earlier mesh"):
        cut = cut_model("2:5")
    assert [option.getString(v, "Name") for v in gmsh.view.getTags()].count("lac_macro") == 2
    assert Cut(to_mesh()).n_macros == cut.n_macros


@pytest.mark.filterwarnings("ignore:.*InterpolationScheme")
def test_fields_of_the_user_are_carried_to_children_and_a_saved_cut_is_a_cut_when_read(gmsh, tmp_path):
    build(gmsh, "boxes")
    mesh = to_mesh()
    temperature = gmsh.view.add("temperature")
    gmsh.view.addHomogeneousModelData(temperature, 0, "boxes", "NodeData", mesh.node_number, mesh.points[:, 0], 2.5)
    cut = cut_model("2:5")
    temperature = next(v for v in gmsh.view.getTags() if gmsh.view.option.getString(v, "Name") == "temperature")
    kind, numbers, values, moment, _ = gmsh.view.getHomogeneousModelData(temperature, 0)
    assert (kind, moment, len(numbers)) == ("NodeData", 2.5, cut.mesh.n_nodes)
    x = by_number(cut.mesh, cut.mesh.points[:, 0], "node")
    assert np.allclose(values, [x[n] for n in numbers.tolist()], atol=1e-14)
    gmsh.view.remove(temperature)
    back = Cut(saved(gmsh, tmp_path / "cut.msh"))
    gmsh.clear()
    gmsh.open(str(tmp_path / "cut.msh"))
    for again in (back, Cut(to_mesh())):
        assert again.n_macros == cut.n_macros and again.zones == cut.zones


# ---- meshes as models


@pytest.mark.parametrize("name", [name for name, cell in CELLS.items() if cell.dim > 1])
@pytest.mark.filterwarnings("ignore:.*only lacmesh reads")
def test_every_cell_goes_into_a_model_and_back(name):
    mesh = replace(cell_with_faces(name), name=name)
    from_mesh(mesh)
    mine, back = plain(mesh), plain(to_mesh())
    assert all(back[key] == mine[key] for key in ("points", "cells", "space_dim", "cell_groups", "name"))


def test_a_wrong_mesh_leaves_no_model_behind(gmsh):
    build(gmsh, "boxes")
    mesh = to_mesh()
    before = dump(gmsh)
    wrong = replace(mesh, cell_data={"entity": np.ones(mesh.n_cells)})
    for change, *asked, words in (
        (from_mesh, mesh, "boxes", "already"),
        (from_mesh, wrong, "wrong", "entity"),
    ):
        with pytest.raises((RequestError, DataError), match=words):
            change(*asked)
    assert gmsh.model.list() == ["", "boxes"] and dump(gmsh) == before
    gmsh.model.mesh.partition(3)
    with pytest.raises(RequestError, match="unpartition"):
        cut_model("2:5")
