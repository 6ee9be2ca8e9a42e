"""gmsh's current model: as a mesh, cut in place, made from a mesh; against files, by way of gmsh's own functions."""

from __future__ import annotations

import signal
import subprocess
import sys
import warnings
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import lacmesh
from lacmesh import Cut, Mesh, cut_skin
from lacmesh.cells import CELLS
from lacmesh.errors import CutError, DataError, GroupNotFoundError, LacmeshWarning, RequestError
from lacmesh.gmsh import cut_model, from_mesh, to_mesh, update_model
from lacmesh.mesh import Block
from tests import properties
from tests.meshes import cell_with_faces, random_mesh

pytestmark = pytest.mark.gmsh


@pytest.fixture(autouse=True)
def gmsh():
    import gmsh

    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.finalize()


# ---- models


def boxes(gmsh):
    """Two boxes of the built-in kernel, one on the other, meshed apart; unnamed groups, a tag in two dimensions."""
    geo = gmsh.model.geo
    gmsh.model.add("boxes")
    for z, h in ((0.0, 0.5), (1.0, 0.35)):  # not quite above each other, or the kernel would join their faces
        corners = [geo.addPoint(x + 0.1 * z, y, z, h) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
        lines = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
        geo.extrude([(2, geo.addPlaneSurface([geo.addCurveLoop(lines)]))], 0, 0, 1)
    geo.synchronize()
    low, high = (faces_at(gmsh, 1.0, body) for body in (1, 2))
    gmsh.model.addPhysicalGroup(2, low, tag=4, name="master")
    gmsh.model.addPhysicalGroup(2, high, tag=5)
    gmsh.model.addPhysicalGroup(3, [1, 2], tag=5, name="all")
    gmsh.model.addPhysicalGroup(3, [2], tag=6, name="upper body")
    gmsh.model.mesh.generate(3)
    return ["2:5"], "2:5"


def faces_at(gmsh, z, body):
    """The faces of a volume in the plane at height z."""
    bounds = gmsh.model.getBoundary([(3, body)], oriented=False)
    boxes = {t: gmsh.model.getBoundingBox(d, t) for d, t in bounds}
    return [t for t, b in boxes.items() if abs(b[2] - z) < 1e-4 and abs(b[5] - z) < 1e-4]


def occ_volumes(gmsh):
    """Three OCC volumes: a pin in a plate, whose faces match, and a ball apart; the slave is the bore, an interface."""
    occ = gmsh.model.occ
    gmsh.model.add("occ")
    plate, pin = occ.addBox(-1, -1, 0, 2, 2, 1), occ.addCylinder(0, 0, -0.5, 0, 0, 2, 0.5)
    occ.fragment([(3, plate)], [(3, pin)])
    occ.addSphere(3, 0, 0, 0.7)
    occ.synchronize()
    (bore,) = [t for d, t in gmsh.model.getEntities(2) if gmsh.model.getType(d, t) == "Cylinder"][1:2]
    gmsh.model.addPhysicalGroup(2, [bore], name="bore")
    gmsh.model.addPhysicalGroup(3, [1, 2], name="parts")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
    gmsh.model.mesh.generate(3)
    return ["bore", f"entity:2:{bore}"], "bore"


def hexahedra(gmsh, order=1, incomplete=1):
    """A transfinite, recombined box: HEXA8, or HEXA20, or HEXA27."""
    gmsh.model.add("hexahedra")
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 2)
    gmsh.model.occ.synchronize()
    for _, tag in gmsh.model.getEntities(1):
        gmsh.model.mesh.setTransfiniteCurve(tag, 3)
    for _, tag in gmsh.model.getEntities(2):
        gmsh.model.mesh.setTransfiniteSurface(tag)
        gmsh.model.mesh.setRecombine(2, tag)
    gmsh.model.mesh.setTransfiniteVolume(1)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.model.addPhysicalGroup(2, [5, 6], name="ends")
    gmsh.model.addPhysicalGroup(2, [6], name="end")
    gmsh.model.addPhysicalGroup(2, [1], name="side")
    gmsh.model.mesh.generate(3)
    return ["ends", "side"], "ends"


def hexa20(gmsh):
    return hexahedra(gmsh, 2)


def hexa27(gmsh):
    return hexahedra(gmsh, 2, 0)


def second_order(gmsh):
    slave = boxes(gmsh)
    gmsh.model.mesh.setOrder(2)
    return slave


def plane(gmsh):
    """A plate with a hole, in the plane: triangles and quadrangles, the slave is the hole's edge."""
    occ = gmsh.model.occ
    gmsh.model.add("plane")
    occ.cut([(2, occ.addRectangle(0, 0, 0, 2, 1))], [(2, occ.addDisk(0.5, 0.5, 0, 0.2, 0.2))])
    occ.fragment([(2, 1)], [(2, occ.addRectangle(2, 0, 0, 1, 1))])
    occ.synchronize()
    arcs = [t for d, t in gmsh.model.getEntities(1) if gmsh.model.getType(d, t) in ("Circle", "Ellipse")]
    gmsh.model.addPhysicalGroup(1, arcs, name="hole")
    gmsh.model.mesh.setRecombine(2, 2)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)
    gmsh.model.mesh.generate(2)
    return ["hole"], "hole"


def mixture(gmsh):
    """Hexahedra below, pyramids and tetrahedra on them, prisms above: every family of solids, the slave all around."""
    geo = gmsh.model.geo
    gmsh.model.add("mixture")
    corners = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lines = [geo.addLine(corners[k], corners[(k + 1) % 4]) for k in range(4)]
    for line in lines:
        geo.mesh.setTransfiniteCurve(line, 4)
    base = geo.addPlaneSurface([geo.addCurveLoop(lines)])
    geo.mesh.setTransfiniteSurface(base)
    geo.mesh.setRecombine(2, base)
    (_, top), *_ = geo.extrude([(2, base)], 0, 0, 1, [2], recombine=True)
    (_, high), *_ = geo.extrude([(2, top)], 0, 0, 1)
    geo.extrude([(2, high)], 0, 0, 0.5, [2], recombine=True)
    geo.synchronize()
    gmsh.model.mesh.setTransfiniteSurface(top)
    gmsh.model.mesh.setRecombine(2, top)
    gmsh.model.mesh.generate(3)
    outer = gmsh.model.getBoundary(gmsh.model.getEntities(3), oriented=False)
    gmsh.model.addPhysicalGroup(2, [t for _, t in outer], tag=9)
    return [9], "9"


def discrete(gmsh):
    """A model that has no geometry: from a mesh with mixed cells."""
    mesh = random_mesh(np.random.default_rng(3), 3, slaves=4)
    from_mesh(mesh, "discrete")
    return ["slave"], "slave"


def periodic(gmsh):
    """Periodic and embedded entities."""
    occ = gmsh.model.occ
    gmsh.model.add("periodic")
    occ.addBox(0, 0, 0, 1, 1, 1)
    point = occ.addPoint(0.5, 0.5, 0.5)
    line = occ.addLine(occ.addPoint(0.3, 0.3, 1), occ.addPoint(0.6, 0.6, 1))
    occ.synchronize()
    gmsh.model.mesh.embed(0, [point], 3, 1)
    gmsh.model.mesh.embed(1, [line], 2, 6)
    gmsh.model.mesh.setPeriodic(2, [2], [1], [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    gmsh.model.addPhysicalGroup(2, [6], name="top")
    gmsh.model.mesh.setSize(gmsh.model.getEntities(0), 0.5)
    gmsh.model.mesh.generate(3)
    return ["top"], "top"


def partitioned(gmsh):
    slave = boxes(gmsh)
    gmsh.model.mesh.partition(3)
    return slave


MODELS = [boxes, occ_volumes, hexahedra, hexa20, hexa27, second_order, plane, mixture, discrete, periodic, partitioned]


# ---- what is compared


def saved(gmsh, path, **options):
    """The current model as a msh file with everything in it, read."""
    for name, value in {"SaveAll": 1, "Binary": 1, "MshFileVersion": 4.1, **options}.items():
        gmsh.option.setNumber(f"Mesh.{name}", value)
    gmsh.write(str(path))
    gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
    for view in gmsh.view.getTags():
        gmsh.view.write(view, str(path), append=True)
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    return lacmesh.read(path)


def cells_of(mesh):
    """number -> (type, node numbers)."""
    rows = {}
    for kind, cells, nodes in mesh.select(np.arange(mesh.n_cells)):
        rows |= {
            int(mesh.cell_number[c]): (kind, *mesh.node_number[n].tolist()) for c, n in zip(cells, nodes, strict=True)
        }
    return rows


def by_number(mesh, values, on="cell"):
    numbers = mesh.cell_number if on == "cell" else mesh.node_number
    return dict(zip(numbers.tolist(), np.asarray(values).tolist(), strict=True))


def same(one, other, model=True):
    """Assert that two meshes are the same but for the order of nodes and cells."""
    assert cells_of(one) == cells_of(other)
    assert by_number(one, one.points, "node") == by_number(other, other.points, "node")
    assert one.space_dim == other.space_dim
    for what in ("cell_groups", "node_groups"):
        numbers = "cell_number" if what == "cell_groups" else "node_number"
        mine, theirs = (
            {n: sorted(getattr(m, numbers)[ids].tolist()) for n, ids in getattr(m, what).items()} for m in (one, other)
        )
        assert mine == theirs
    assert one.group_tags == other.group_tags
    for on in ("cell", "node"):
        mine, theirs = getattr(one, f"{on}_data"), getattr(other, f"{on}_data")
        keys = [{k for k, v in data.items() if not (v == -1).all()} for data in (mine, theirs)]
        assert keys[0] == keys[1]
        for key in keys[0]:
            np.testing.assert_equal(by_number(one, mine[key], on), by_number(other, theirs[key], on), err_msg=key)
    assert one.zones == other.zones
    if model:
        assert (one.model is None) == (other.model is None)
    if model and one.model is not None:
        assert dict(one.model.boundary) == dict(other.model.boundary)
        links = [
            sorted((p.slave, p.master, p.affine, sorted(m.node_number[p.nodes].tolist())) for p in m.model.periodic)
            for m in (one, other)
        ]
        assert links[0] == links[1]


@pytest.fixture(params=MODELS, ids=lambda f: f.__name__)
def model(request, gmsh):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        return request.param(gmsh)


# ---- the model as a mesh


@pytest.mark.filterwarnings("ignore:.*InterpolationScheme")  # gmsh's way to write a view
def test_a_model_is_the_mesh_of_its_file(model, gmsh, tmp_path):
    file = saved(gmsh, tmp_path / "model.msh")
    mesh = to_mesh()
    same(mesh, file)
    assert mesh.name == gmsh.model.getCurrent()
    assert np.array_equal(mesh.node_number, file.node_number) and np.array_equal(mesh.cell_number, file.cell_number)


@pytest.mark.parametrize("first", ["TRIA3", "TRIA6"])
def test_cells_that_get_elements_hides_are_found(gmsh, tmp_path, first):
    """Two orders in one entity: gmsh's getElements shows one of them."""
    gmsh.model.add("mixed")
    entity = gmsh.model.addDiscreteEntity(2)
    gmsh.model.mesh.addNodes(2, entity, range(1, 9), np.random.default_rng(0).random(24))
    rows = {"TRIA3": (2, [1], [1, 2, 3]), "TRIA6": (9, [2], [3, 2, 4, 5, 6, 7])}
    for name in sorted(rows, reverse=first == "TRIA6"):
        gmsh.model.mesh.addElementsByType(entity, *rows[name])
    line = gmsh.model.addDiscreteEntity(1)
    gmsh.model.mesh.addElementsByType(line, 1, [3], [1, 2])
    gmsh.model.mesh.addElementsByType(line, 8, [7], [3, 2, 5])
    gmsh.model.addPhysicalGroup(2, [entity], name="both")
    gmsh.option.setNumber("Mesh.SaveAll", 0)
    mesh = to_mesh()
    assert mesh.cells_by_type == {"SEG2": 1, "SEG3": 1, "TRIA3": 1, "TRIA6": 1}
    assert len(mesh.cell_groups["both"]) == 2
    assert gmsh.option.getNumber("Mesh.SaveAll") == 0
    same(mesh, saved(gmsh, tmp_path / "mixed.msh"))


@pytest.mark.parametrize(("last", "visible"), [(4, True), (5000, False), (2_500_000, True)])
def test_lines_that_get_elements_hides_are_found_whatever_their_numbers(gmsh, last, visible):
    """gmsh counts no lines: one of another order is found by its number."""
    gmsh.model.add("mixed")
    line = gmsh.model.addDiscreteEntity(1)
    gmsh.model.mesh.addNodes(1, line, range(1, 7), np.random.default_rng(0).random(18))
    gmsh.model.mesh.addElementsByType(line, 1, [1, 3, last + 2], [1, 2, 2, 3, 3, 4])
    gmsh.model.mesh.addElementsByType(line, 8, [last], [4, 5, 6])
    gmsh.model.mesh.setVisibility([last], int(visible))
    mesh = to_mesh()
    numbers = {kind: mesh.cell_number[cells].tolist() for kind, cells, _ in mesh.select(np.arange(mesh.n_cells))}
    assert numbers == {"SEG2": [1, 3, last + 2], "SEG3": [last]}
    assert gmsh.model.mesh.getVisibility([1, last]).tolist() == [1, int(visible)]


def test_what_is_missing_is_said(gmsh, monkeypatch):
    with pytest.raises(RequestError, match="has no mesh"):
        to_mesh()
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(RequestError, match=r"pip install 'lacmesh\[gmsh\]'"):
        cut_model("slave")
    monkeypatch.undo()
    gmsh.finalize()
    with pytest.raises(RequestError, match="not running"):
        to_mesh()
    gmsh.initialize(interruptible=False)


# ---- the model cut


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_a_cut_model_is_the_cut_of_its_file(model, gmsh, tmp_path):
    slave, _ = model
    before = saved(gmsh, tmp_path / "before.msh")
    expected = cut_skin(before, slave)
    entities = {tag: gmsh.model.getType(*tag) for tag in gmsh.model.getEntities()}
    cut = cut_model(slave)
    same(cut.mesh, expected.mesh, model=False)
    now = to_mesh()
    same(now, expected.mesh)
    assert {tag: gmsh.model.getType(*tag) for tag in gmsh.model.getEntities()} == entities
    again = Cut(now)
    assert again.zones == cut.zones and again.n_macros == cut.n_macros
    for name in ("macro_of_face", "child_kind", "parent_of_cell", "zone_of_face"):
        assert by_number(now, getattr(again, name)) == by_number(cut.mesh, getattr(cut, name))


@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_gmshs_own_functions_see_the_cut(model, gmsh, tmp_path):
    slave, group = model
    parts = bool(gmsh.model.getPartitions(*gmsh.model.getEntities(gmsh.model.getDimension())[-1]).size)
    cut = cut_model(slave)
    seen = {}
    for kind, numbers, _ in zip(*gmsh.model.mesh.getElements(), strict=True):
        name = next(n for n, c in CELLS.items() if c.msh == kind)
        seen[name] = len(numbers)
    assert seen == cut.mesh.cells_by_type
    dim, tag = cut.mesh.group_tags[cut.mesh.group(group)][0]
    nodes, _ = gmsh.model.mesh.getNodesForPhysicalGroup(dim, tag)
    faces = cut.mesh.cell_groups[cut.mesh.group(group)]
    ours = np.unique(np.concatenate([n.ravel() for _, _, n in cut.mesh.select(faces)]))
    assert set(nodes.tolist()) == set(cut.mesh.node_number[ours].tolist())
    _, numbers, _ = gmsh.model.mesh.getElements(cut.mesh.dim)
    assert min(gmsh.model.mesh.getElementQualities(np.concatenate(numbers), "minSJ")) > 0
    for suffix in (".msh", ".med", ".vtk"):
        gmsh.write(str(tmp_path / f"cut{suffix}"))
    groups = {name: len(cells) for name, cells in cut.mesh.cell_groups.items() if len(cells)}
    back = lacmesh.read(tmp_path / "cut.msh")
    assert {n: len(c) for n, c in back.cell_groups.items() if len(c)} == groups
    if not parts and not any(":" in name for name in groups):  # in MED, gmsh invents a name for unnamed groups
        back = lacmesh.read(tmp_path / "cut.med")
        assert {n: len(c) for n, c in back.cell_groups.items()} == groups


@pytest.mark.parametrize("spec", ["side", 5, "5", "2:5", "entity:2:6"])
def test_every_way_to_name_the_slave(gmsh, spec):
    hexahedra(gmsh)
    gmsh.model.removePhysicalGroups(gmsh.model.getPhysicalGroups())
    gmsh.model.addPhysicalGroup(2, [6], tag=5, name="side" if spec == "side" else "")
    cut = cut_model(spec, views=False)
    assert cut.n_macros == 4
    assert cut.mesh.points[cut.mesh.block("TRIA3")][..., 2].min() == 2
    assert not len(gmsh.view.getTags())


def test_options_are_those_of_cut_skin(gmsh):
    import inspect

    ours, theirs = (inspect.signature(f).parameters for f in (cut_model, cut_skin))
    shared = {n: (p.kind, p.default) for n, p in theirs.items() if n not in ("mesh", "slave")}
    assert {n: (p.kind, p.default) for n, p in ours.items() if n not in ("slave", "views")} == shared
    hexahedra(gmsh)
    assert cut_model("ends", hexa="hexa").mesh.cells_by_type["HEXA8"] == 8 + 8 * 5
    assert gmsh.model.mesh.getElementTypes(3).tolist() == [5]


def test_the_geometry_stays_attached(gmsh):
    """New nodes have parametric coordinates like the others; gmsh can raise the order, mid-nodes on the cylinder."""
    gmsh.model.add("pin")
    gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [1], name="pin")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
    gmsh.model.mesh.generate(3)
    old = to_mesh().node_number.max()
    cut_model("pin")
    nodes, points, parameters = gmsh.model.mesh.getNodes(2, 1, returnParametricCoord=True)
    assert len(parameters) == 2 * len(nodes) and nodes.max() > old
    projected = gmsh.model.getValue(2, 1, parameters).reshape(-1, 3)
    points = points.reshape(-1, 3)
    assert np.abs(np.hypot(*projected[:, :2].T) - 1).max() < 1e-9
    far = np.linalg.norm(projected - points, axis=1)
    assert far[nodes <= old].max() < 1e-6 and 0.001 < far[nodes > old].max() < 0.1  # on chords, nearest to there
    gmsh.model.mesh.setOrder(2)
    with pytest.warns(LacmeshWarning, match="earlier mesh"):  # other faces than those that were cut
        mesh = to_mesh()
    edges = mesh.block("TRIA6")[:, [0, 1, 3, 1, 2, 4, 2, 0, 5]].reshape(-1, 3)
    radius = np.hypot(*np.moveaxis(mesh.points[edges], 2, 0)[:2])
    on = (np.abs(radius[:, :2] - 1) < 1e-9).all(axis=1) & (mesh.node_number[edges[:, :2]] <= old).all(axis=1)
    skin = np.abs(np.diff(mesh.points[edges[:, :2]][..., 2], axis=1)).ravel() > 1e-9
    assert (on & skin).sum() > 20 and np.abs(radius[on & skin, 2] - 1).max() < 1e-9


def test_many_cells_are_taken_out_at_once(gmsh, monkeypatch):
    """The quick way to take cells out of a large entity gives what the plain one does."""
    hexahedra(gmsh)
    mesh = to_mesh()
    expected = cut_model(["ends", "side"]).mesh
    from_mesh(mesh, "again")
    monkeypatch.setattr("lacmesh.gmsh.update._MANY_REMOVED", 0)
    cut_model(["ends", "side"])
    same(to_mesh(), expected)


def dump(gmsh):
    """All that gmsh says of its current model."""
    entities = gmsh.model.getEntities()
    mesh = gmsh.model.mesh
    return repr(
        [
            [(t, gmsh.model.getType(*t), [a.tolist() for a in mesh.getNodes(*t)]) for t in entities],
            [[[a.tolist() for a in part] for part in mesh.getElements(*t)[1:]] for t in entities],
            [(g, gmsh.model.getPhysicalName(*g)) for g in gmsh.model.getPhysicalGroups()],
            [gmsh.model.getEntitiesForPhysicalGroup(*g).tolist() for g in gmsh.model.getPhysicalGroups()],
            [gmsh.model.getBoundary([t], combined=False) for t in entities],
            gmsh.model.getAttributeNames(),
            gmsh.view.getTags().tolist(),
            gmsh.model.getCurrent(),
        ]
    )


@pytest.mark.parametrize(
    ("slave", "options", "error"),
    [
        ("nothing", {}, GroupNotFoundError),
        ("all", {}, CutError),  # volumes
        ("2:5", {"hexa": "cube"}, RequestError),
        ("2:5", {"ring": 2}, RequestError),
        ("entity:2:999", {}, GroupNotFoundError),
    ],
)
def test_a_failure_leaves_the_model_untouched(gmsh, slave, options, error):
    boxes(gmsh)
    before = dump(gmsh)
    with pytest.raises(error):
        cut_model(slave, **options)
    assert dump(gmsh) == before


def test_a_model_is_not_cut_twice(gmsh):
    slave, _ = boxes(gmsh)
    cut_model(slave)
    before = dump(gmsh)
    assert cut_model(slave).n_macros == len(to_mesh().cell_groups["2:5"]) // 3
    with pytest.raises(CutError, match="cut already"):
        cut_model(["2:5", "master"])
    assert dump(gmsh) == before


def test_an_interrupt_waits_until_the_model_is_whole(gmsh, monkeypatch):
    slave, _ = boxes(gmsh)
    add = gmsh.model.mesh.addElementsByType

    def interrupted(*args):
        signal.raise_signal(signal.SIGINT)
        return add(*args)

    monkeypatch.setattr(gmsh.model.mesh, "addElementsByType", interrupted)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever a gmsh of another test has set
    try:
        with pytest.raises(KeyboardInterrupt):
            cut_model(slave)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, handler)
    mesh = to_mesh()
    assert Cut(mesh).n_macros > 10
    assert properties.volumes(mesh)[mesh.cell_dim == 3].sum() == pytest.approx(2, rel=1e-12)


INTERRUPTED = """
import signal, gmsh
from lacmesh.gmsh import cut_model
gmsh.initialize()  # which lets an interrupt end the process
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
gmsh.model.mesh.generate(3)
add = gmsh.model.mesh.addElementsByType
def interrupted(*args):
    signal.raise_signal(signal.SIGINT)
    print("went on", flush=True)
    return add(*args)
gmsh.model.mesh.addElementsByType = interrupted
cut_model("entity:2:1")
print("not interrupted", flush=True)
"""


def test_an_interrupt_that_ends_the_process_waits_too():
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True)
    assert done.returncode == -signal.SIGINT
    assert set(done.stdout.splitlines()) == {"went on"}


# ---- the records as views


def test_records_of_an_earlier_mesh_are_not_believed(gmsh):
    slave, _ = boxes(gmsh)
    cut_model(slave)
    gmsh.model.mesh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeFactor", 0.6)
    gmsh.model.mesh.generate(3)
    with pytest.warns(LacmeshWarning, match="earlier mesh"):
        mesh = to_mesh()
    assert not set(mesh.cell_data) - {"entity"}
    with pytest.warns(LacmeshWarning, match="earlier mesh"):
        cut = cut_model(slave)
    assert sorted(gmsh.view.option.getString(v, "Name") for v in gmsh.view.getTags()).count("lac_macro") == 1
    assert Cut(to_mesh()).n_macros == cut.n_macros


def test_views_are_of_one_model(gmsh, tmp_path):
    """A cut model and the same model uncut, side by side."""
    slave, _ = boxes(gmsh)
    uncut = to_mesh()
    cut = cut_model(slave)
    from_mesh(uncut, "uncut")
    assert not lacmesh.cutting.cut.is_cut(to_mesh())
    gmsh.model.setCurrent("boxes")
    assert Cut(to_mesh()).n_macros == cut.n_macros
    gmsh.model.setCurrent("uncut")
    assert cut_model(slave).n_macros == cut.n_macros
    shown = [
        gmsh.view.option.getString(v, "Name") for v in gmsh.view.getTags() if gmsh.view.option.getNumber(v, "Visible")
    ]
    assert shown == ["lac_macro", "lac_macro"]


def test_fields_of_the_user_are_carried_to_children(gmsh):
    slave, _ = boxes(gmsh)
    mesh = to_mesh()
    temperature = gmsh.view.add("temperature")
    gmsh.view.addHomogeneousModelData(temperature, 0, "boxes", "NodeData", mesh.node_number, mesh.points[:, 0], 2.5)
    cut = cut_model(slave)
    kind, numbers, values, time, _ = gmsh.view.getHomogeneousModelData(temperature, 0)
    assert (kind, time, len(numbers)) == ("NodeData", 2.5, cut.mesh.n_nodes)
    x = dict(zip(cut.mesh.node_number.tolist(), cut.mesh.points[:, 0], strict=True))
    assert np.allclose(values, [x[n] for n in numbers.tolist()], atol=1e-14)


@pytest.mark.filterwarnings("ignore:.*InterpolationScheme")
def test_a_cut_saved_by_gmsh_is_a_cut_when_read(gmsh, tmp_path):
    """Mesh and views in one file: the docs say so."""
    slave, _ = boxes(gmsh)
    cut = cut_model(slave)
    back = Cut(saved(gmsh, tmp_path / "cut.msh"))
    assert back.n_macros == cut.n_macros and back.zones == cut.zones
    gmsh.clear()
    gmsh.open(str(tmp_path / "cut.msh"))
    again = Cut(to_mesh())
    assert again.n_macros == cut.n_macros and again.zones == cut.zones


# ---- meshes as models


@pytest.mark.parametrize("name", [name for name, cell in CELLS.items() if cell.dim > 1])
@pytest.mark.filterwarnings("ignore:.*only lacmesh reads")
def test_every_cell_goes_into_a_model_and_back(gmsh, name):
    mesh = replace(cell_with_faces(name), name=name)
    from_mesh(mesh)
    back = to_mesh()
    assert cells_of(back) == cells_of(mesh)
    assert by_number(back, back.points, "node") == by_number(mesh, mesh.points, "node")
    for group, cells in mesh.cell_groups.items():
        assert set(back.cell_number[back.cell_groups[group]]) == set(mesh.cell_number[cells])
    assert back.space_dim == mesh.space_dim and back.name == name


@pytest.mark.parametrize("seed", range(6))
def test_random_meshes_go_into_a_model_and_back(gmsh, seed):
    """Overlapping groups, node groups, fields, odd numbers, orphans."""
    mesh = random_mesh(np.random.default_rng(seed), 2 + seed % 2, slaves=4)
    mesh = replace(mesh, cell_data={**mesh.cell_data, "wide": np.ones((mesh.n_cells, 2))})
    from_mesh(mesh, "random")
    back = to_mesh()
    there = {}
    for on in ("cell", "node"):  # the data are in the order of the numbers of `back`
        numbers, data = f"{on}_number", f"{on}_data"
        order = np.argsort(getattr(back, numbers))[np.argsort(np.argsort(getattr(mesh, numbers)))]
        there[data] = {**getattr(mesh, data), "entity": getattr(back, data)["entity"][order]}
    expected = replace(mesh, **there)
    same(back, replace(expected, group_tags=back.group_tags), model=False)
    for key in mesh.cell_data:
        assert back.cell_data[key].dtype.kind == mesh.cell_data[key].dtype.kind


@pytest.mark.parametrize("build", [boxes, periodic, hexa20])
def test_a_model_copied_through_a_mesh_is_the_same(gmsh, build):
    build(gmsh)
    mesh = to_mesh()
    from_mesh(mesh, "copy")
    assert gmsh.model.getCurrent() == "copy"
    same(to_mesh(), mesh)
    for dim, tag in gmsh.model.getEntities():
        assert dim == 0 or gmsh.model.getType(dim, tag).startswith("Discrete")
        if dim == 0:
            nodes, xyz, _ = gmsh.model.mesh.getNodes(0, tag)
            assert len(nodes) == 0 or np.allclose(gmsh.model.getValue(0, tag, []), xyz)


def test_a_wrong_mesh_leaves_no_model_behind(gmsh):
    boxes(gmsh)
    mesh = to_mesh()
    before = dump(gmsh)
    with pytest.raises(RequestError, match="already"):
        from_mesh(mesh, "boxes")
    with pytest.raises(DataError, match="entity"):
        from_mesh(replace(mesh, cell_data={"entity": np.ones(mesh.n_cells)}), "wrong")
    assert gmsh.model.list() == ["", "boxes"] and dump(gmsh) == before


# ---- models brought to another mesh


def test_an_order_raised_outside_comes_back(gmsh):
    boxes(gmsh)
    types = [gmsh.model.getType(*t) for t in gmsh.model.getEntities()]
    mesh = lacmesh.raise_order(to_mesh())
    update_model(mesh)
    same(to_mesh(), mesh)
    assert [gmsh.model.getType(*t) for t in gmsh.model.getEntities()] == types


def test_what_is_the_same_is_not_touched(gmsh, monkeypatch):
    boxes(gmsh)
    mesh = to_mesh()

    def refuse(*args):
        raise AssertionError(args)

    for name in ("removeElements", "addElementsByType", "addNodes", "setNode", "clear"):
        monkeypatch.setattr(gmsh.model.mesh, name, refuse)
    monkeypatch.setattr(gmsh.model, "addPhysicalGroup", refuse)
    monkeypatch.setattr(gmsh.model, "addDiscreteEntity", refuse)
    update_model(mesh)


def test_groups_moved_nodes_and_reversed_faces_come_back(gmsh):
    boxes(gmsh)
    mesh = to_mesh()
    faces = mesh.cell_groups["2:5"]
    k = [b.type for b in mesh.blocks].index("TRIA3")
    nodes = mesh.blocks[k].nodes.copy()
    nodes[faces - mesh.offsets[k]] = nodes[faces - mesh.offsets[k]][:, ::-1]
    blocks = [b if j != k else Block("TRIA3", nodes) for j, b in enumerate(mesh.blocks)]
    points = mesh.points.copy()
    points[-1] += 0.01
    groups = {name: cells for name, cells in mesh.cell_groups.items() if name != "upper body"}
    groups["half of it"] = faces[::2]
    changed = replace(mesh, blocks=tuple(blocks), points=points, cell_groups=groups)
    update_model(changed)
    back = to_mesh()
    assert cells_of(back) == cells_of(changed)
    assert by_number(back, back.points, "node") == by_number(changed, changed.points, "node")
    numbers = {n: set(changed.cell_number[c].tolist()) for n, c in groups.items()}
    assert {n: set(back.cell_number[c].tolist()) for n, c in back.cell_groups.items()} == numbers
    assert len([t for t in gmsh.model.getEntities(2) if gmsh.model.getType(*t) == "Discrete surface"]) == 1


def test_moved_nodes_keep_their_parameters(gmsh, monkeypatch):
    """Nodes of a cylinder turned on it: gmsh is asked for an entity's once, and each node has its own parameters."""
    gmsh.model.add("pin")
    gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
    gmsh.model.mesh.generate(2)
    mesh = to_mesh()
    side = (mesh.node_data["entity"] == [2, 1]).all(axis=1)
    points = mesh.points.copy()
    turn = np.array([[np.cos(0.01), -np.sin(0.01)], [np.sin(0.01), np.cos(0.01)]])
    points[side, :2] = points[side, :2] @ turn.T
    asked, get = [], gmsh.model.mesh.getNodes
    with monkeypatch.context() as patched:
        patched.setattr(gmsh.model.mesh, "getNodes", lambda *a, **kw: (asked.append((a, kw)), get(*a, **kw))[1])
        update_model(replace(mesh, points=points))
    with_parameters = [a for a, kw in asked if kw.get("returnParametricCoord")]
    assert side.sum() > 20 and len(with_parameters) == 1
    nodes, xyz, parameters = gmsh.model.mesh.getNodes(2, 1, returnParametricCoord=True)
    order = np.argsort(nodes)
    assert np.abs(xyz.reshape(-1, 3)[order] - points[side][np.argsort(mesh.node_number[side])]).max() < 1e-12
    assert np.abs(gmsh.model.getValue(2, 1, parameters) - xyz).max() < 1e-6


def test_nodes_that_are_gone_make_the_mesh_anew(gmsh):
    """Half of the cells taken out, with the nodes that only they had."""
    periodic(gmsh)
    mesh = to_mesh()
    keep = np.sort(np.concatenate([np.arange(a, (a + b + 1) // 2) for a, b in pairwise(mesh.offsets)]))
    used = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(keep)]))
    new = np.full(mesh.n_nodes, -1)
    new[used] = np.arange(len(used))
    half = Mesh.create(
        mesh.points[used],
        [(kind, new[nodes]) for kind, _, nodes in mesh.select(keep)],
        node_number=mesh.node_number[used],
        cell_number=mesh.cell_number[keep],
        cell_data={"entity": mesh.cell_data["entity"][keep]},
        node_data={"entity": mesh.node_data["entity"][used]},
        space_dim=3,
    )
    with pytest.warns(LacmeshWarning, match="periodic links are lost"):
        update_model(half)
    back = to_mesh()
    assert cells_of(back) == cells_of(half) and back.n_nodes == half.n_nodes and not back.cell_groups
    assert gmsh.model.getType(3, 1) == "Volume"


def test_a_partitioned_model_takes_no_other_mesh(gmsh):
    partitioned(gmsh)
    with pytest.raises(RequestError, match="unpartition"):
        update_model(to_mesh())
