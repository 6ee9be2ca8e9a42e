"""Shapes of skins: exact ones on nodes that lie on them and nowhere else, of few faces too; what the commands say."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import FittedShape, Mesh, check, cut_skin, fit_surface, write
from lacmesh.gmsh import to_mesh
from lacmesh.smooth import height_of
from lacmesh.surface.normals import smoothed
from tests.checks.blocks import two_blocks
from tests.coarse_rings import rings
from tests.meshes import renumbered
from tests.samples import each_option
from tests.smooth import skins
from tests.smooth.skins import ANGLE, KINDS, block, chain, cone, cylinder, heights, plane, rolled, sphere, torus
from tests.surface.surfaces import whole
from verification.meshes.rings import octant, pair

#: surface -> its shape, and the lengths and angles that it has
EXACT = {
    plane: ("plane", {}),
    cylinder: ("cylinder", {"radius": 1.0}),
    sphere: ("sphere", {"radius": 1.0}),
    cone: ("cone", {"angle": np.degrees(ANGLE)}),
    torus: ("torus", {"radius": 3.0, "tube": 1.0}),
}


def only(mesh):
    found = fit_surface(mesh, "skin")
    assert len(found) == 1, [str(one) for one in found]
    return found[0]


def names(mesh, **options):
    return sorted({one.shape for one in fit_surface(mesh, "skin", **options)})


@pytest.mark.rows("plane-QUAD4-4", "cylinder-TRIA3-9")
@pytest.mark.parametrize("n", [4, 9])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("surface", EXACT)
def test_a_skin_on_an_exact_shape_is_that_shape(surface, kind, n):
    mesh = rolled(surface, n, kind)
    one = only(mesh)
    name, sizes = EXACT[surface]
    assert one.shape == name
    for what in ("radius", "tube", "angle"):
        assert getattr(one, what) == (pytest.approx(sizes[what], rel=1e-12) if what in sizes else None)
    assert one.distance < 1e-13 and one.nodes == mesh.n_nodes and len(one.faces) == mesh.n_cells
    if name in ("cylinder", "cone", "torus"):
        np.testing.assert_allclose(np.abs(one.axis), [0, 0, 1], atol=1e-12)
    if name != "plane":
        np.testing.assert_allclose(one.centre[:2], 0, atol=1e-12)


def listed_otherwise(mesh):
    """The mesh with its nodes and cells in another order, and cells that start at another corner."""
    rng = np.random.default_rng(3)
    other, _ = renumbered(mesh, rng)
    blocks = [(name, [np.roll(row, rng.integers(len(row))) for row in nodes]) for name, nodes in other.blocks]
    return Mesh.create(other.points, blocks, cell_groups=other.cell_groups, space_dim=3)


ROTATION = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
ROTATION *= np.linalg.det(ROTATION)
CHANGES = {
    "units": (lambda mesh: replace(mesh, points=1e-3 * mesh.points), 1e-3),
    "large": (lambda mesh: replace(mesh, points=1e6 * mesh.points), 1e6),
    "place": (lambda mesh: replace(mesh, points=mesh.points + np.array([3e3, -2e3, 1e3])), 1.0),
    "turned": (lambda mesh: replace(mesh, points=mesh.points @ ROTATION.T), 1.0),
    "numbers": (listed_otherwise, 1.0),
}


@pytest.mark.rows("plane-units", "cylinder-large")
@pytest.mark.parametrize(
    "surface, change", each_option(itertools.product([*EXACT, skins.ellipsoid, skins.waves], CHANGES))
)
def test_nothing_depends_on_units_place_turn_or_numbers(surface, change):
    mesh = rolled(surface, 7, "mixed")
    move, size = CHANGES[change]
    other = move(mesh)
    before, after = only(mesh), only(other)
    assert before.shape == after.shape
    if before.radius is not None:
        assert after.radius == pytest.approx(size * before.radius, rel=1e-10)
    if surface is not plane:
        a, b = np.sort(heights(mesh)[:, :4].ravel()), np.sort(heights(other)[:, :4].ravel()) / size
        scale = 1e-9 if change == "place" else 1e-11  # coordinates 3e3 away are rounded to 4e-13
        np.testing.assert_allclose(b, a, atol=scale * max(np.abs(a).max(), 1e-3))


@pytest.mark.parametrize(
    ("surface", "n"), each_option(itertools.product((skins.ellipsoid, skins.saddle, skins.waves), (5, 12, 40)))
)
def test_what_is_no_shape_is_of_free_form(surface, n):
    one = only(rolled(surface, n))
    assert one.shape == "free form" and one.no_height == 0
    assert one.radius is one.axis is one.centre is one.distance is None


def test_a_shape_off_by_more_than_rounding_is_of_free_form():
    """A millionth of the size is what a drawing has, not what rounding leaves; 1e-10 is what files round to."""
    mesh = rolled(cylinder, 8)
    noise = np.random.default_rng(0).uniform(-1, 1, mesh.points.shape)
    assert only(replace(mesh, points=mesh.points + 1e-10 * noise)).shape == "cylinder"
    assert only(replace(mesh, points=mesh.points + 1e-6 * noise)).shape == "free form"


def test_a_strip_of_one_row_of_faces_is_the_straight_shape():
    """Two circles about one axis also lie on a sphere: the strip between them is a cylinder or a cone."""
    for surface, name in ((cylinder, "cylinder"), (cone, "cone")):
        mesh = rolled(surface, 12, "QUAD4", ny=1, skew=0)
        assert only(mesh).shape == name
        value, x = heights(mesh)[:, :4], mesh.points[mesh.block("QUAD4")]
        straight = np.abs(np.roll(x, -1, axis=1) - x)[..., 2] > 1e-9
        assert np.abs(value[straight]).max() < 1e-14 and np.abs(value[~straight]).min() > 1e-4


# ---- lines and circles in the plane, of few faces too


def around(n, start=0.0, turn=2 * np.pi):
    """Points on the unit circle: n of a full turn, or n + 1 of a part of it."""
    angle = start + turn * np.arange(n + (turn < 2 * np.pi)) / n
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def test_a_line_and_a_circle():
    t = np.sort(np.random.default_rng(0).random(9))
    mesh = chain(np.stack([t, 2 * t + 1], axis=1), closed=False)
    line = only(mesh)
    assert line.shape == "line" and line.distance < 1e-15 and line.flat and height_of(mesh, whole(mesh)) is None
    np.testing.assert_allclose(line.axis, [2 / 5**0.5, -1 / 5**0.5, 0], atol=1e-14)  # to the right of the tangent
    circle = only(chain(3 * np.stack([np.cos(t), np.sin(t)], axis=1) + 7, closed=False))
    assert circle.shape == "circle" and circle.radius == pytest.approx(3, rel=1e-12)
    np.testing.assert_allclose(circle.centre, [7, 7, 0], atol=1e-11)


@pytest.mark.parametrize("n", [5, 6, 7, 8, 9])
def test_a_circle_of_few_faces(n):
    one = only(chain(around(n, 0.1)))
    assert one.shape == "circle" and one.radius == pytest.approx(1, rel=1e-12) and one.nodes == n
    assert one.turn == (None if n == 9 else pytest.approx(360 / n))
    for scale, shift in ((1e-6, 0.0), (1e6, 0.0), (1.0, 1e7)):
        there = only(chain(scale * (around(n) + shift)))
        assert there.shape == "circle" and there.radius == pytest.approx(scale, rel=1e-6)
    mesh = chain(around(n))
    assert height_of(mesh, whole(mesh)).value[:, 2] == pytest.approx(1 - np.cos(np.pi / n), rel=1e-9)


def test_an_angle_that_is_given_is_kept():
    for angle, name in ((40.0, "line"), (44.9, "line"), (45.1, "circle")):
        assert names(chain(around(8)), crease_angle=angle) == [name]


ARC, TOP = around(4, -np.pi / 2, np.pi), np.stack([np.linspace(0, -3, 5)[1:-1], np.ones(3)], axis=1)
LEG, FILLET = np.linspace(0, 1, 11)[:, None], around(10, np.pi, -np.pi / 2)
SMOOTH = {
    "a slot of half circles": (np.concatenate([ARC, TOP, -ARC - [3.0, 0.0], -TOP - [3.0, 0.0]]), True, 2, 2, 1.0),
    "a fillet between two legs": (
        np.concatenate([LEG * [0, 4] - [2, 4], 2 * FILLET[1:], LEG[1:] * [5, 0] + [0, 2]]), False, 1, 2, 2.0,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SMOOTH)
def test_lines_and_arcs_that_go_smoothly_into_each_other(name):
    points, closed, arcs, lines, radius = SMOOTH[name]
    mesh = chain(points, closed)
    found = fit_surface(mesh, "skin")
    assert sorted(one.shape for one in found) == ["circle"] * arcs + ["line"] * lines
    assert all(one.radius == pytest.approx(radius, rel=1e-12) for one in found if one.shape == "circle")
    assert sum(len(one.faces) for one in found) == mesh.n_cells
    assert sum(one.nodes for one in found) == len(points) + arcs + lines - (not closed)


POLYGONS = {
    "a triangle": around(3),
    "a square": around(4),
    "a square of two faces to a side": [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]],
    "a square without its corners": [
        [3, 2.2], [2.2, 3], [-2.2, 3], [-3, 2.2], [-3, -2.2], [-2.2, -3], [2.2, -3], [3, -2.2],
    ],
    "a hexagon of two faces to a side": np.repeat(around(6), 2, axis=0) / 2
    + np.stack([around(6), np.roll(around(6), -1, 0)], axis=1).reshape(-1, 2) / 2,
    "six faces on an ellipse": around(6) * [1.5, 1.0],
    "a house": [[0, 0], [2, 0], [2, 1], [1, 1.6], [0, 1]],
}  # fmt: skip


@pytest.mark.parametrize("name", POLYGONS)
def test_polygons_stay_sharp(name):
    assert names(chain(POLYGONS[name])) == ["line"]
    prism = revolved(np.array([[1.0, 0.0], [1.0, 0.5], [1.0, 1.0]]), len(POLYGONS[name]))
    x = np.column_stack([np.repeat(POLYGONS[name], 3, axis=0), prism.points[:, 2]])
    assert names(replace(prism, points=x)) == ["plane"]


# ---- skins of revolution


def revolved(meridian, n, kind="QUAD4"):
    """A skin of revolution about z of n faces around, through rings of nodes (r, z), or poles where r is 0."""
    r, z = np.transpose(meridian)
    i, j = np.meshgrid(np.arange(n), np.arange(len(r)), indexing="ij")
    angle = 2 * np.pi * i / n
    points = np.stack([r[j] * np.cos(angle), r[j] * np.sin(angle), z[j]], axis=-1).reshape(-1, 3)
    number = np.where(r[j] == 0, j, i * len(r) + j)
    low, high = number[:, :-1].ravel(), number[:, 1:].ravel()
    quads = np.stack([low, np.roll(number, -1, 0)[:, :-1].ravel(), np.roll(number, -1, 0)[:, 1:].ravel(), high], axis=1)
    at_low, at_high = quads[:, 0] == quads[:, 1], quads[:, 2] == quads[:, 3]
    four = quads[~at_low & ~at_high]
    three = np.concatenate([quads[at_low][:, [0, 2, 3]], quads[at_high][:, [0, 1, 2]]])
    if kind == "TRIA3":
        three, four = np.concatenate([three, four[:, [0, 1, 2]], four[:, [0, 2, 3]]]), four[:0]
    blocks = [(name, nodes) for name, nodes in (("QUAD4", four), ("TRIA3", three)) if len(nodes)]
    return Mesh.create(points, blocks, cell_groups={"skin": np.arange(len(four) + len(three))})


def ball(n, low=-np.pi / 2):
    way = np.linspace(low, np.pi / 2, max(n // 2, 2) + 1)
    return np.stack([np.cos(way).round(15), np.sin(way)], axis=1)


UP = np.linspace(0, 1, 4)
#: meridians of skins of n faces around
MERIDIANS = {
    "a cylinder": lambda n: np.stack([0 * UP + 1, UP], axis=1),
    "a sphere": ball,
    "a sphere, half": lambda n: ball(n, 0.0),
    "a cone": lambda n: np.stack([1 + 0.7 * UP, 2 * UP], axis=1),
}


def test_closed_shapes_and_a_cone_with_its_apex():
    i, j = np.meshgrid(np.arange(24), np.arange(18), indexing="ij")
    node = lambda p, q: (p % 24) * 18 + q % 18  # noqa: E731
    quads = np.stack([node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)], axis=-1).reshape(-1, 4)
    x = torus(2 * np.pi * np.stack([i.ravel() / 24, j.ravel() / 18], axis=1))
    found = only(Mesh.create(x, [("QUAD4", quads)], cell_groups={"skin": np.arange(len(quads))}))
    assert found.shape == "torus" and found.tube == pytest.approx(1, rel=1e-12)
    found = only(revolved(ball(24), 24))
    assert found.shape == "sphere" and found.turn is None and found.nodes == 24 * 11 + 2
    found = only(revolved(np.arange(5)[:, None] * [1, -0.3], 16))
    assert found.shape == "cone" and found.angle == pytest.approx(np.degrees(np.arctan2(1, 0.3)), rel=1e-12)
    np.testing.assert_allclose(found.centre, 0, atol=1e-12)
    np.testing.assert_allclose(np.abs(found.axis), [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("kind", ["QUAD4", "TRIA3"])
@pytest.mark.parametrize("n", [5, 6, 8])
@pytest.mark.parametrize("name", MERIDIANS)
def test_skins_of_few_faces(name, kind, n):
    one = only(revolved(MERIDIANS[name](n), n, kind))
    assert one.shape in name and one.turn > 40 and one.distance < 1e-14


@pytest.mark.parametrize("name", [name for name in MERIDIANS if name != "a cone"])
def test_four_faces_are_a_square(name):
    assert set(names(revolved(MERIDIANS[name](4), 4))) <= {"plane", "free form"}


def test_smoothed_normals_go_over_the_same_edges():
    """Normals at the nodes of a circle are radial, and those of the faces where the angle is given."""
    mesh = chain(around(8)[::-1])
    surface = replace(whole(mesh), height=height_of(mesh, whole(mesh)))
    radial = surface.x[surface.faces.nodes[:, :2]]
    sides = smoothed(surface, None)[:, :2]
    assert np.abs((sides * radial).sum(axis=2)) == pytest.approx(1)
    assert height_of(mesh, whole(mesh), 40.0) is None
    own = smoothed(whole(mesh), 40.0)[:, :2]
    assert np.abs((own * radial).sum(axis=2)) == pytest.approx(np.cos(np.pi / 8))


@pytest.mark.parametrize(("inner", "outer"), [(8, 8), (12, 8), (8, 12), (24, 6)])
def test_faces_of_coarse_circles_find_each_other(inner, outer):
    """Thin cells, and corners that reach deeper into the faces opposite than these cells do."""
    radii = np.linspace(0.9, 1, 8)
    pin = {"kind": "QUAD4", "n": inner, "radii": radii, "names": ("pin", "bore", "out")}
    hole = {"kind": "QUAD4", "n": outer, "radii": radii + 0.1, "turn": 0.2, "names": ("hole", "in", "rim")}
    found = check(cut_skin(rings(pin, hole, dim=2), "out").mesh, "out", "in").summary
    assert found["covered"] == pytest.approx(1)
    assert abs(found["gap"]["mean"]) < 0.15 * (1 - np.cos(np.pi / min(inner, outer)))


@pytest.mark.parametrize(
    ("points", "lacks"),
    [
        ([[0, 0, 0], [1, 0, 0.2], [2, 0, 0.1], [0, 1, 0], [1, 1.2, 0.3], [2, 1, 0]], 0),
        ([[0, 0, 0], [1, 0, 0.2], [2, 0, 0], [0, 1, 0.1], [1, 1, 0.2], [2, 1, 0.05]], 0),
        ([[0, 0, 0], [1, 0, 0.2], [1, 1, 0.2], [0, 1, 0.1]], 2),
    ],
)
def test_few_nodes_are_no_shape_and_fewer_have_no_fit(points, lacks):
    """Any four nodes lie on a sphere, any six on a few cylinders. Six have five neighbours each, enough for a fit."""
    faces = ("QUAD4", [[0, 1, 4, 3], [1, 2, 5, 4]]) if len(points) == 6 else ("TRIA3", [[0, 1, 2], [0, 2, 3]])
    mesh = Mesh.create(points, [faces], cell_groups={"skin": [0, 1]})
    one = only(mesh)
    assert one.shape == "free form" and one.nodes == len(points) and one.no_height == lacks
    assert not lacks or "2 of them have too few" in check(mesh, "skin").of_rule("faceted")[0].message


@pytest.mark.rows("4.0-False")
@pytest.mark.gmsh
@pytest.mark.parametrize(("size", "quads"), [(4.0, False), (2.0, False), (2.0, True)])
def test_a_bore_its_fillet_and_the_planes_beside_it(size, quads, gmsh):
    """A plate of 40 x 40 x 10 whose bore goes by a tangential fillet into the plane on top: one patch, three shapes."""
    occ = gmsh.model.occ
    body, _ = occ.cut([(3, occ.addBox(-20, -20, 0, 40, 40, 10))], [(3, occ.addCylinder(0, 0, -1, 0, 0, 12, 8))])
    occ.synchronize()
    boxes = {tag: gmsh.model.getBoundingBox(1, tag) for _, tag in gmsh.model.getEntities(1)}
    edge = [tag for tag, box in boxes.items() if abs(box[3] - 8) < 0.1 and box[2] > 9]
    occ.fillet([body[0][1]], edge, [3.0])
    occ.synchronize()
    for name, value in (("MeshSizeMin", size), ("MeshSizeMax", size), ("RecombineAll", int(quads))):
        gmsh.option.setNumber(f"Mesh.{name}", value)
    gmsh.model.mesh.generate(2)
    mesh = to_mesh()
    found = fit_surface(replace(mesh, cell_groups={"skin": np.flatnonzero(mesh.cell_dim == 2)}), "skin")
    kinds = [one.shape for one in found]
    assert kinds.count("plane") == 6 and kinds.count("cylinder") == 1 and "free form" not in kinds
    tori = [one for one in found if one.shape == "torus"]
    assert tori and all(abs(t.radius - 11) < 1e-10 and abs(t.tube - 3) < 1e-10 for t in tori)
    assert next(one.radius for one in found if one.shape == "cylinder") == pytest.approx(8, rel=1e-12)


# ---- what is said of them


@pytest.mark.parametrize(
    ("shape", "figures", "says"),
    [
        ("cylinder", {"radius": 12.000000000000002, "distance": 1.04e-13}, "radius 12, 98 nodes within 1e-13"),
        ("torus", {"radius": 11.0, "tube": 3.0, "distance": 5e-15}, "radii 11 and 3, 98 nodes within 5e-15"),
        ("free form", {"no_height": 1}, "98 nodes, 1 face without"),
        ("cone", {"angle": 45.0, "distance": 1e-12}, "half angle 45 degrees, 98 nodes within"),
    ],
)
def test_figures_in_words(shape, figures, says):
    assert str(FittedShape(shape, np.arange(4), 98, **figures)).startswith(f"{shape}, {says}")


def test_info_and_check_say_shapes(run):
    write("shell.msh", cut_skin(block("HEXA8"), "skin").mesh)
    assert "sphere" not in run("info shell.msh") and "shape of skin" in run("check shell.msh --slave skin")
    (line,) = [line for line in run("info -v shell.msh").splitlines() if line.startswith("skin:")]
    assert line.startswith("skin: sphere, radius 1.4, 25 nodes within ")
    (one,) = json.loads(run("info -v --json shell.msh"))["shapes"]["skin"]
    assert (one["shape"], one["faces"], one["nodes"]) == ("sphere", 64, 25) and one["tube"] is None
    assert one["radius"] == pytest.approx(1.4, rel=1e-12) and one["text"].startswith("sphere, radius 1.4")
    assert json.loads(run("check --json shell.msh --slave skin"))["summary"]["shapes"]["skin"] == [one]


def test_few_faces_that_are_taken_as_round_are_told(run):
    pin = {"kind": "QUAD4", "n": 8, "radii": (0.5, 1), "names": ("pin", "bore", "out")}
    hole = {"kind": "QUAD4", "n": 12, "radii": (1, 2), "names": ("hole", "in", "rim")}
    write("pin.msh", cut_skin(rings(pin, hole, dim=2), "out").mesh)
    (line,) = [line for line in run("info pin.msh --verbose").splitlines() if line.startswith("out:")]
    assert "circle, radius 1, 8 nodes" in line and "up to 45 degrees" in line
    for given in ("", "--crease-angle 40", "--surface faces"):
        found = json.loads(run(f"check pin.msh --slave out --master in --json {given}"))
        told = [one["message"] for one in found["findings"] if one["rule"] == "few-faces"]
        assert len(told) == (not given) and (abs(found["summary"]["gap"]["mean"]) < 1e-3 if told else not told)
        if told:
            assert "up to 45 degrees" in told[0] and "--crease-angle" in told[0]
            assert found["summary"]["shapes"]["out"][0]["turn"] == pytest.approx(45)
        else:
            assert found["summary"]["gap"]["mean"] > 0.02


def test_a_cut_without_records_has_its_shape_and_its_gaps():
    """By the check, where it is asked to recognise; from Python the cut must be recognised first."""
    cut = cut_skin(block("TETRA4"), "skin").mesh
    bare = replace(cut, cell_data={}, node_data={}, zones=())
    assert [one["shape"] for one in check(bare, "skin", recognise=True).summary["shapes"]["skin"]] == ["sphere"]
    assert only(bare).shape == "free form"
    within, around = (octant("TETRA4", (1, n), r) for n, r in ((4, (1.0, 2.0)), (3, (2.1, 3.0))))
    cut = cut_skin(pair(within, around), "slave").mesh
    bare = replace(cut, cell_data={}, node_data={}, zones=())
    gap, again = (check(mesh, "slave", "master", recognise=True).summary["gap"] for mesh in (cut, bare))
    assert again == pytest.approx(gap, rel=1e-12)  # of the macro-elements, not of each child for itself


def test_flat_and_fine_skins_say_nothing_coarse_ones_are_faceted_and_centres_are_those_of_the_file():
    assert check(two_blocks(), "slave", "master").summary["shapes"] == {}
    (one,) = check(block("HEXA8").moved((1e4, 0, -2e4)), "skin").summary["shapes"]["skin"]
    np.testing.assert_allclose(one["centre"], [1e4, 0, -2e4], atol=1e-8)
    bowl = lambda x: np.stack([x[:, 0], x[:, 1], 0.6 * x[:, 0] ** 2 + 0.4 * x[:, 1] ** 2], axis=1)  # noqa: E731
    coarse, fine = (check(rolled(bowl, n, skew=0, size=1.5), "skin").of_rule("faceted") for n in (2, 12))
    assert "up to 29 degrees" in coarse[0].message and len(coarse[0].cells) == 7 and not fine
