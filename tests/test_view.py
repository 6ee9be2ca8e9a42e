"""Picture contents: visible faces of every cell type; slave, master, macro-elements; findings and values."""

from __future__ import annotations

import subprocess
import sys
import time
from typing import NamedTuple

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh, cut_skin, raise_order, scene
from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.errors import GroupNotFoundError, LacmeshWarning, RequestError
from lacmesh.quality.measures import SCALES
from lacmesh.reference.quadrature import measure
from lacmesh.scene import camera_of, colours, make_scene
from lacmesh.scene.edges import edges_of
from lacmesh.scene.layers import CURVED, curved_parts
from lacmesh.scene.marks import Values, cell_values, find_marks
from lacmesh.scene.placing import SEEN_AT, shows_skin
from lacmesh.scene.request import BODIES_AS
from lacmesh.scene.visible import BODY, MASTER, SLAVE, find_visible
from lacmesh.topology.skin import Faces
from lacmesh.view import page, page_text, picture
from tests.meshes import box, cell_with_faces, random_mesh
from tests.viewing import DATA

SOLIDS = [name for name, cell in CELLS.items() if cell.dim == 3]
LINEAR = [name for name, cell in CELLS.items() if cell.order == 1 and cell.dim > 1]
SURFACES = [name for name, cell in CELLS.items() if cell.dim == 2]


class Said(NamedTuple):
    """A finding, as a check would say it."""

    severity: str
    message: str
    cells: tuple[int, ...] = ()
    nodes: tuple[int, ...] = ()


def cube(n=2, slave_side=0, **rest):
    """A cube of HEXA8 whose facets at z = 0 (or 1) are the group `slave`."""
    points, hexahedra = box(n)
    low = hexahedra[:, [0, 3, 2, 1]] if slave_side == 0 else hexahedra[:, 4:]
    skin = low[(points[low][:, :, 2] == slave_side).all(axis=1)]
    faces = np.arange(len(skin))
    return Mesh.create(points, [("QUAD4", skin), ("HEXA8", hexahedra)], cell_groups={"slave": faces}, **rest)


def two_cubes():
    """A cube on another; the upper one carries the slave skin, the lower one the master."""
    upper, lower = cube(2), cube(3, slave_side=1)
    n = len(upper.block("QUAD4"))
    return Mesh.create(
        np.vstack([upper.points, lower.points - [0, 0, 1]]),
        [(kind, np.vstack([upper.block(kind), lower.block(kind) + upper.n_nodes])) for kind in ("QUAD4", "HEXA8")],
        cell_groups={"slave": np.arange(n), "master": np.arange(n, n + len(lower.block("QUAD4")))},
    )


def layers(drawn, kind):
    return [layer for layer in drawn.layers if layer.kind == kind]


def coloured(layer, colour):
    return (layer.rgb == colours.rgb((colour,))).all(axis=1)


def flux(drawn):
    """The volume inside the triangles of a scene, by the divergence theorem; and their area."""
    volume = area = 0.0
    for layer in layers(drawn, "faces"):
        a, b, c = np.moveaxis(layer.points[layer.cells], 1, 0)
        n = np.cross(b - a, c - a) / 2
        assert ((n * layer.normals[layer.cells[:, 0]]).sum(axis=1) > 0).all()
        volume += (n * (a + b + c)).sum() / 9
        area += np.linalg.norm(n, axis=1).sum()
    return volume, area


@pytest.mark.parametrize("name", SOLIDS)
def test_the_skin_of_every_solid_is_closed_and_turns_outward(name):
    mesh = cell_with_faces(name, facets=())
    volume = measure(name, mesh.points[mesh.block(name)]).sum()
    assert flux(make_scene(mesh))[0] == pytest.approx(volume, rel=1e-12)


@pytest.mark.parametrize("name", SURFACES)
def test_every_surface_cell_is_drawn_whole(name):
    mesh = cell_with_faces(name, facets=())
    assert flux(make_scene(mesh))[1] == pytest.approx(measure(name, mesh.points[mesh.block(name)]).sum(), rel=1e-12)


@pytest.mark.parametrize("name", [n for n, c in ALL_CELLS.items() if c.order == 3 and c.dim > 1])
def test_cells_of_higher_order_are_drawn_by_their_corners(name):
    cell, linear = ALL_CELLS[name], CELLS[ALL_CELLS[name].linear]
    corners = np.pad(np.array(linear.reference), ((0, cell.n_nodes - cell.n_corners), (0, 3 - cell.dim)))
    drawn = make_scene(Mesh.create(corners, [(name, [np.arange(cell.n_nodes)])]))
    assert sum(len(layer.cells) for layer in layers(drawn, "lines")) == len(linear.edges)


def test_curved_faces_are_drawn_curved():
    """A unit disc of one QUAD9: its edges are arcs to second order."""
    angle = np.pi / 4 * np.array([-3, -1, 1, 3, -2, 0, 2, 4])
    x = np.vstack([np.column_stack([np.cos(angle), np.sin(angle)]), [[0, 0]]])
    mesh = Mesh.create(x, [("QUAD9", [np.arange(9)])])
    assert flux(make_scene(mesh))[1] == pytest.approx(measure("QUAD9", mesh.points[None]).sum(), rel=0.02)
    radius = np.linalg.norm(np.vstack([layer.points for layer in layers(make_scene(mesh), "lines")]), axis=1)
    assert radius.min() > 0.98


def test_many_curved_faces_are_drawn_in_fewer_parts():
    def faces(kind, count):
        return Faces.join([(kind, np.zeros((count, CELLS[kind].n_nodes), int))])

    parts = [curved_parts(faces("TRIA6", count)) for count in (1, 5_000, 20_000, 1_000_000)]
    assert parts[0] == CURVED
    assert parts[-1] == 2
    assert parts == sorted(parts, reverse=True)
    assert curved_parts(faces("TRIA3", 1_000_000)) == CURVED


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (3, 1), (3, 2), (3, 3)])
@pytest.mark.parametrize("seed", range(4))
def test_neighbours_have_different_colours(dim, order, seed):
    mesh = random_mesh(np.random.default_rng(seed), dim, order, slaves=100)
    visible = find_visible(cut_skin(mesh, "slave").mesh)
    slaves = visible.faces.take(visible.rows(SLAVE))
    macro = visible.macro[visible.rows(SLAVE)]
    colour = colours.paint(macro, slaves.corners)
    ends, _, face = edges_of(slaves) if dim == 3 else (slaves.nodes[:, :2], None, np.arange(len(slaves)))
    for key in {tuple(sorted(e[:2])) for e in ends}:
        faces = face[[tuple(sorted(e[:2])) == key for e in ends]]
        assert len(set(colour[faces])) == len(set(macro[faces]))
    for name in np.unique(macro):
        assert len(set(colour[macro == name])) == 1


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_what_is_in_sight_is_what_one_cell_alone_has(dim, seed):
    """Against counting corners in a table; skin cells, twins, orphans and inner faces included."""
    from tests.meshes import facets_of

    rng = np.random.default_rng(100 + seed)
    mesh = random_mesh(rng, dim, slaves=8, interior=True, twins=True)
    visible = find_visible(mesh, "slave")

    def keys(rows):
        return sorted(tuple(sorted(c[c >= 0].tolist())) for c in visible.faces.corners[rows])

    slave_keys = {
        tuple(sorted(nodes[: CELLS[kind].n_corners].tolist()))
        for kind, _, rows in mesh.select(mesh.cell_groups["slave"])
        for nodes in rows
    }
    assert keys(visible.rows(SLAVE)) == sorted(slave_keys)
    if dim == 3:
        single = {key for key, owners in facets_of(mesh).items() if len(owners) == 1}
        assert keys(visible.rows(BODY)) == sorted(single - slave_keys)
    else:
        flat = [
            tuple(sorted(nodes.tolist()))
            for _, _, rows in mesh.select(np.flatnonzero(mesh.cell_dim == 2))
            for nodes in rows
        ]
        assert keys(visible.rows(BODY)) == sorted(flat)
    for row in range(len(visible.faces)):
        ((kind, _, nodes),) = mesh.select(visible.cell[[row]])
        corners = visible.faces.corners[row]
        assert set(corners[corners >= 0]) <= set(nodes[0])
        assert CELLS[kind].dim == mesh.dim


@pytest.mark.parametrize("order", ["1", "2", "2-full"])
def test_a_cut_shows_its_macros_and_internal_nodes(order):
    mesh = cube(3) if order == "1" else raise_order(cube(3), order)
    cut = cut_skin(mesh, "slave")
    drawn = make_scene(cut.mesh)
    (dots,) = layers(drawn, "dots")
    expected = np.concatenate(cut.internal_nodes)
    np.testing.assert_array_equal(dots.points, cut.mesh.points[np.sort(expected)])
    assert coloured(dots, colours.DOT).all()
    assert flux(drawn) == pytest.approx((1.0, 6.0))
    assert drawn.legend[0].words.startswith("9 macro-elements")
    assert [entry.kind for entry in drawn.legend] == ["area", "dot"]


def test_segments_of_a_plane_cut():
    square = Mesh.create(
        [[0, 0], [1, 0], [1, 1], [0, 1]],
        [("SEG2", [[0, 1], [1, 2]]), ("QUAD4", [[0, 1, 2, 3]])],
        cell_groups={"slave": [0]},
    )
    cut = cut_skin(square, "slave")
    drawn = make_scene(cut.mesh)
    ends, internal = layers(drawn, "dots")
    assert {tuple(p) for p in ends.points} == {(0, 0, 0), (1, 0, 0)}
    assert len(internal.points) == len(cut.internal_nodes[0])
    assert tuple(drawn.eye) == (0, 0, 1)
    visible = find_visible(cut.mesh)
    slaves = visible.rows(SLAVE)
    assert len(slaves) == 3
    assert (cut.mesh.cell_dim[visible.cell[slaves]] == 2).all()
    assert (cut.mesh.cell_dim[visible.skin[slaves]] == 1).all()


def test_the_master_has_a_colour_of_its_own():
    mesh = cut_skin(two_cubes(), "slave").mesh
    visible = find_visible(mesh, None, "master")
    assert [len(visible.rows(role)) for role in (BODY, SLAVE, MASTER)] == [5 * 4 + 5 * 9, 16, 9]
    assert (visible.skin[visible.role == MASTER] >= 0).all()
    assert (mesh.cell_dim[visible.cell] == 3).all()
    drawn = make_scene(mesh, None, "master")
    assert [entry.words for entry in drawn.legend][1] == "9 master faces"
    (master,) = [layer for layer in layers(drawn, "faces") if coloured(layer, colours.MASTER).all()]
    assert len(master.cells) == 18
    assert flux(drawn) == pytest.approx((2.0, 12.0))


def test_a_face_of_both_groups_is_slave():
    mesh = cube(2)
    visible = find_visible(mesh, "slave", "slave")
    assert (len(visible.rows(SLAVE)), len(visible.rows(MASTER))) == (4, 0)


def test_a_hidden_skin_is_turned_towards_the_eye():
    mesh = cut_skin(two_cubes(), "slave").mesh
    drawn = make_scene(mesh)
    body, skin = layers(drawn, "faces")
    normal = skin.normals.mean(axis=0)
    assert normal @ drawn.eye == pytest.approx(np.cos(np.radians(SEEN_AT)))
    assert skin.points[:, 2].min() > 0.1  # the lower cube ends at z = 0
    assert flux(drawn)[0] == pytest.approx(2.0)
    still = make_scene(mesh, explode=0, tilt=0)
    assert np.ptp(still.layers[1].points[:, 2]) == 0
    lifted = make_scene(mesh, explode=0.5, tilt=0)
    assert lifted.layers[1].points[:, 2] == pytest.approx(0.5 * np.sqrt(6))
    assert body.points[:, 2].min() == -1


def test_a_skin_that_nothing_hides_stays():
    mesh = cut_skin(cube(2), "slave").mesh
    with pytest.warns(LacmeshWarning, match="moves nothing: no other body is in sight"):
        drawn = make_scene(mesh, explode=0.5, tilt=30)
    assert drawn.layers[1].points[:, 2] == pytest.approx(0)
    assert drawn.eye[2] < 0


def test_near_and_cutaway_lay_the_inside_bare():
    mesh = cut_skin(cube(4), "slave").mesh
    assert flux(make_scene(mesh, "slave", near=0.2))[0] == pytest.approx(0.25)
    bare = make_scene(mesh, cutaway=(0, 0, 2)).layers[0]
    inside = coloured(bare, colours.INSIDE)
    assert inside.sum() == 4 * 16
    assert bare.points[inside][:, 2] == pytest.approx(0.5)
    with pytest.raises(RequestError, match="near means near slave faces"):
        make_scene(cube(4), near=0.2)


def test_orphan_nodes_and_empty_groups_change_nothing():
    mesh = two_cubes()
    far = Mesh.create(
        np.vstack([mesh.points, [[1e3, 0, 0], [0, 1e3, 5]]]),
        [(b.type, b.nodes) for b in mesh.blocks],
        cell_groups={**mesh.cell_groups, "none": []},
    )
    for options in ({}, {"near": 0.3}):
        ours = make_scene(mesh, "slave", "master", **options)
        theirs = make_scene(far, ["slave", "none"], ["master", "none"], **options)
        assert camera_of(ours, (800, 600)) == camera_of(theirs, (800, 600))
        assert ours.legend == theirs.legend
    assert make_scene(far, "none").legend == ()


def test_groups_of_a_mesh_without_a_cut_and_of_one_with():
    mesh = two_cubes()
    assert make_scene(mesh).legend == ()
    assert [entry.words for entry in make_scene(mesh, "slave").legend] == ["4 slave faces"]
    with pytest.raises(GroupNotFoundError, match="did you mean slave"):
        make_scene(mesh, ["slav"])
    with pytest.raises(GroupNotFoundError, match="did you mean master"):
        make_scene(mesh, "slave", "mastre")
    with pytest.raises(RequestError, match="nothing to draw"):
        make_scene(Mesh.create([[0, 0], [1, 0]], [("POI1", [[0]])]))


def test_a_mesh_of_lines_is_drawn():
    drawn = make_scene(Mesh.create([[0, 0], [1, 0], [2, 1]], [("SEG2", [[0, 1], [1, 2]])]))
    (lines,) = drawn.layers
    assert len(lines.cells) == 2


def test_loose_shells_are_drawn_but_not_the_skin_twice():
    points, hexahedra = box(1)
    points = np.vstack([points, [[0, 0, -1], [1, 0, -1], [0, 1, -1]]])
    skin = hexahedra[:, [0, 3, 2, 1]]
    mesh = Mesh.create(points, [("HEXA8", hexahedra), ("QUAD4", skin), ("TRIA3", [[8, 9, 10]])])
    assert flux(make_scene(mesh))[1] == pytest.approx(6.5)


@pytest.mark.parametrize("eye", [(1, -1.6, 0.9), (0, 0, 1), (0, 0, -3), (0, 1, 0)])
def test_everything_is_inside_the_frame(eye):
    findings = [Said("error", "one", cells=(3,)), Said("warning", "two", nodes=(1,))]
    for drawn in (make_scene(two_cubes(), camera=eye), make_scene(two_cubes(), "slave", camera=eye, findings=findings)):
        for size in ((1600, 1000), (400, 900)):
            camera = camera_of(drawn, size)
            back, up = np.subtract(camera["position"], camera["focal"]), np.array(camera["up"])
            x = np.vstack([layer.points for layer in drawn.layers]) - camera["focal"]
            height, width = x @ up / camera["scale"], x @ np.cross(up, back / np.linalg.norm(back)) / camera["scale"]
            assert 2 * drawn.low - 1 - 1e-9 < height.min() < height.max() < 2 * scene.HIGH - 1 + 1e-9
            assert (np.abs(width) < size[0] / size[1]).all()
            filled = np.ptp(height) / 2 / (scene.HIGH - drawn.low), np.ptp(width) / 2 / 0.94 / size[0] * size[1]
            assert max(filled) > 0.999


def test_findings_name_cells_by_the_numbers_of_the_file():
    mesh = two_cubes()
    renumbered = Mesh.create(
        mesh.points,
        [(b.type, b.nodes) for b in mesh.blocks],
        cell_groups=mesh.cell_groups,
        cell_number=1000 - 3 * np.arange(mesh.n_cells),
        node_number=5 * np.arange(mesh.n_nodes) + 7,
    )
    solid = int(np.flatnonzero(mesh.cell_dim == 3)[0])
    findings = [
        Said("info", "by the way", cells=(1000,)),
        Said("warning", "poor", cells=(1000 - 3 * solid, 999_999)),
        Said("error", "twice", cells=(1000, 997), nodes=(12,)),
    ]
    marks = find_marks(renumbered, findings)
    assert marks.severity == ("error", "warning", "info")
    assert marks.message[0] == "twice"
    assert sorted(marks.cell[marks.of == 0]) == [0, 1]
    assert marks.cell[marks.of == 1].tolist() == [solid] * 6
    assert marks.nodes.tolist() == [1]
    drawn = make_scene(renumbered, "slave", findings=findings)
    red, orange = colours.SEVERITIES["error"], colours.SEVERITIES["warning"]
    marked = [layer for layer in layers(drawn, "faces") if coloured(layer, red).any()]
    assert [layer.opacity for layer in marked] == [1.0, scene.layers.THROUGH]
    assert [coloured(layer, red).sum() for layer in marked] == [8, 8]
    assert [coloured(layer, orange).sum() for layer in marked] == [24, 24]
    assert [entry.words for entry in drawn.legend][-3:] == ["error: twice", "warning: poor", "info: by the way"]
    assert {label.words for label in drawn.labels} == {"1000", "997", str(1000 - 3 * solid), "node 12"}
    assert not any(coloured(layer, colours.PALETTE[0]).any() for layer in drawn.layers)


def test_what_is_cut_away_is_not_marked_and_hints_change_no_colour():
    mesh = cube(2)
    solid = mesh.cell_number[mesh.cell_dim == 3]
    findings = [Said("warning", "all", cells=tuple(solid.tolist()))]
    drawn = make_scene(mesh, "slave", findings=findings, cutaway=(0, 0, 1))
    marked = [layer for layer in layers(drawn, "faces") if coloured(layer, colours.SEVERITIES["warning"]).any()]
    assert [len(layer.cells) for layer in marked] == [4 * 12, 4 * 12]
    told = make_scene(mesh, "slave", findings=[Said("info", "fine", cells=(1,))])
    plain = make_scene(mesh, "slave")
    assert len(told.layers) == len(plain.layers)
    for ours, theirs in zip(told.layers, plain.layers, strict=True):
        np.testing.assert_array_equal(ours.rgb, theirs.rgb)


def test_many_findings_are_listed_and_labelled_in_part():
    findings = [Said("warning", f"finding {k}", cells=(k + 1,)) for k in range(12)]
    drawn = make_scene(two_cubes(), findings=findings)
    assert [entry.words for entry in drawn.legend][-1] == "and 7 more findings"
    assert len(drawn.labels) == scene.LABELLED
    assert make_scene(two_cubes(), findings=[]).legend[-1].words == "the check found nothing to say"


def test_cells_are_coloured_by_a_value():
    mesh = cut_skin(two_cubes(), "slave").mesh
    values = cell_values(mesh, "corner_jacobian")
    assert np.isnan(values.values[mesh.cell_dim < 2]).all()
    drawn = make_scene(mesh, None, "master", values=values)
    found = np.vstack([layer.rgb for layer in layers(drawn, "faces")])
    visible = find_visible(mesh, None, "master")
    expected = np.unique(colours.on_ramp(values.values[visible.cell], 0.0, 1.0), axis=0)
    np.testing.assert_array_equal(np.unique(found, axis=0), expected)
    worst = mesh.cell_number[values.worst(1)[0]]
    assert any(f"cell {worst}" in entry.words for entry in drawn.legend)
    assert not any("not defined" in entry.words for entry in drawn.legend)
    some = make_scene(mesh, values=cell_values(mesh, "diagonal"))  # of HEXA8 alone; the children are PYRAM5
    assert some.legend[-1].words == "diagonal is not defined on these cells"
    with pytest.raises(RequestError, match="did you mean corner_jacobian"):
        cell_values(mesh, "corner_jacobia")
    with pytest.raises(RequestError, match="no cell of this mesh has the measure 'oddy'"):
        cell_values(cell_with_faces("TETRA4", facets=()), "oddy")


@pytest.mark.parametrize("measure", sorted(SCALES))
def test_every_measure_has_a_bad_and_a_good_end(measure):
    mesh = one_of_each()
    values = cell_values(mesh, measure)
    known = values.values[np.isfinite(values.values)]
    assert len(known)
    better = SCALES[measure].better
    assert values.bad != values.good
    assert better * (values.good - values.bad) >= 0
    assert np.isin(values.worst(1), np.flatnonzero(values.values == (known.max() if better < 0 else known.min()))).all()
    if SCALES[measure].kind == "unit":
        assert {values.bad, values.good} == {0.0, 1.0}


def one_of_each():
    """Every family of linear cells, no two alike, apart from each other."""
    parts = [cell_with_faces(CELLS[name].name, facets=(), seed=k) for k, name in enumerate(LINEAR)]
    starts = np.cumsum([0, *(part.n_nodes for part in parts)])
    points = np.vstack([part.points + np.array([10.0 * k, 0, 0]) for k, part in enumerate(parts)])
    return Mesh.create(
        points, [(name, part.block(name) + start) for name, part, start in zip(LINEAR, parts, starts, strict=False)]
    )


def test_invalid_cells_are_red_and_named():
    mesh = cube(2)
    points = mesh.points.copy()
    points[np.flatnonzero((points == 0.5).all(axis=1))] += 0.7  # the inner node, beyond a corner
    mesh = Mesh.create(points, [(b.type, b.nodes) for b in mesh.blocks])
    values = cell_values(mesh, "corner_jacobian")
    assert values.invalid.sum() > 0
    drawn = make_scene(mesh, values=values)
    assert drawn.legend[-1].words.startswith(f"{values.invalid.sum()} invalid cell")
    assert coloured(drawn.layers[0], colours.INVALID).any()


def test_a_ramp_has_its_ends_and_the_worst_lie_at_its_bad_one():
    values = Values("aspect", np.array([1.0, np.nan, 9.0, 4.0]), 9.0, 1.0, np.zeros(4, bool))
    assert values.worst(2).tolist() == [2, 3]
    assert values.worst(9).tolist() == [2, 3, 0]
    found = colours.on_ramp(values.values, values.bad, values.good)
    np.testing.assert_array_equal(found[[2, 0]], colours.rgb((colours.RAMP[0], colours.RAMP[-1])))
    lightness = colours.on_ramp(np.linspace(0, 1, 50), 0.0, 1.0) @ [0.299, 0.587, 0.114]
    assert (np.diff(lightness) > 0).all()


@pytest.mark.parametrize("value", [5.0, 0.0, -3.0, 1e-12, 1e300, 1e-300])
def test_values_that_differ_by_round_off_have_one_colour_and_what_has_none_is_grey(value):
    values = np.array([value, value * (1 + 4e-15), value * (1 - 3e-15), np.nan])
    for low, high in (colours.ends_of(values), colours.ends_of(values, zero=True)):
        assert low < high and f"{low:.3g}" != f"{high:.3g}"
        found = colours.on_ramp(values, low, high)
        assert np.ptp(found[:3].astype(int), axis=0).max() <= 1  # one of 256 steps
        assert np.array_equal(found[3:], colours.rgb(colours.BODIES[:1]))
    assert np.array_equal(colours.on_ramp(values, value, value)[3:], colours.rgb(colours.BODIES[:1]))


def test_a_scale_has_its_values_and_zero():
    assert colours.ends_of(np.array([-3.0, 2.0])) == (-3.0, 2.0)
    assert colours.ends_of(np.array([-3.0, -2.0]), zero=True) == (-3.0, 0.0)
    assert colours.ends_of(np.array([np.nan, 5.0, 4.0]), zero=True) == (0.0, 5.0)
    assert colours.ends_of(np.array([np.nan])) == colours.ends_of(np.zeros(3), zero=True) == (0.0, 1.0)
    assert colours.ends_of(np.array([-1e308, 1e308])) == (-1e308, 1e308)


def test_cells_of_one_size_have_one_colour():
    values = cell_values(cube(3), "volume")  # 1 / 27 but for round-off
    assert np.ptp(values.values[np.isfinite(values.values)]) > 0
    drawn = make_scene(cube(3), values=values)
    shades = np.vstack([layer.rgb for layer in layers(drawn, "faces")]).astype(int)
    solid = shades[(shades != colours.rgb(colours.BODIES[:1])).any(axis=1)]
    assert len(solid) and np.ptp(solid, axis=0).max() <= 1  # one of 256 steps


@pytest.mark.vtk
def test_the_name_of_a_ramp_stands_above_its_ends():
    import pyvista

    from lacmesh.view.draw import Sheet, _add_ramp

    class Plotter:
        def __init__(self):
            self.words = {}

        def add_text(self, words, position, **_style):
            self.words[words] = position

        def add_actor(self, actor):
            pass

    plotter = Plotter()
    ramp = "pressure", -1.23e-100, 4.56e12, colours.RAMP
    _add_ramp(Sheet(plotter, pyvista, 1.0, {"size": (1600, 1000), "ramp": ramp}))
    name, low, high = (plotter.words[words] for words in ("pressure", "-1.23e-100", "4.56e+12"))
    assert name[1] > low[1] + 0.03 and low[1] == high[1] and low[0] + 10 * 0.011 < high[0]
    assert name[1] + 0.03 < make_scene(cube(), values=cell_values(cube(), "shape")).low + 0.005


def test_the_modules_need_no_pyvista():
    code = "import sys, lacmesh.view; assert not {'pyvista', 'vtk', 'vtkmodules'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_long_words_are_broken_or_shortened():
    findings = [Said("error", "long " * 40), Said("info", "short"), Said("info", "w" * 300)]
    drawn = make_scene(two_cubes(), "slave", findings=findings)
    wide, narrow = (scene.laid_out(drawn, size) for size in ((1600, 1000), (300, 1000)))
    assert [len(entry.colours) for entry in wide.legend] == [3, 1, 0, 0, 0, 0]
    assert wide.legend[1].words.startswith("error: long")
    assert wide.legend[3].words == "info: short"
    assert narrow.low > drawn.low
    for laid, size in ((wide, (1600, 1000)), (narrow, (300, 1000))):
        room = 0.98 * size[0] - scene.INDENT * scene.unit_of(size)
        assert max(len(entry.words) for entry in laid.legend) * scene.LETTER * scene.unit_of(size) <= room
    assert narrow.legend[2].words.endswith("...")
    assert "..." not in wide.legend[1].words + wide.legend[2].words


def test_only_the_skin_of_a_large_mesh_is_drawn():
    def drawn(n):
        points, hexahedra = box(n)
        mesh = Mesh.create(points, [("HEXA8", hexahedra)])
        start = time.process_time()
        scene = make_scene(mesh)
        assert sum(len(layer.cells) for layer in layers(scene, "faces")) == 2 * 6 * n**2
        return time.process_time() - start

    drawn(10)  # compiled
    assert drawn(80) < 40 * min(drawn(40) for _ in range(2))  # of eight times as many cells


@pytest.mark.parametrize(("bodies", "opacity"), [("solid", 1.0), ("ghost", 0.16), ("hidden", None)])
def test_bodies_may_be_seen_through_or_hidden(bodies, opacity):
    mesh = cut_skin(lacmesh.read(DATA / "two_blocks.msh"), "slave").mesh
    scene = make_scene(mesh, "slave", "master", bodies=bodies)
    faces = [layer for layer in scene.layers if layer.kind == "faces"]
    assert [layer.opacity for layer in faces] == ([] if opacity is None else [opacity]) + [1.0, 1.0]
    assert scene.moved == ("opened, tilted" if bodies == "solid" else "")
    assert scene.heading.endswith(" (opened, tilted)") == (bodies == "solid")


def test_bodies_are_drawn_in_no_other_way(tmp_path):
    with pytest.raises(RequestError, match="bodies are drawn solid, ghost, hidden, not 'gost'; did you mean ghost"):
        picture(DATA / "two_blocks.msh", tmp_path / "p.png", bodies="gost")
    with pytest.raises(RequestError, match="bodies are drawn"):
        page(DATA / "two_blocks.msh", tmp_path / "p.html", bodies="gost")


def test_slave_and_master_have_different_swatches_where_cells_are_coloured_by_values():
    mesh = cut_skin(lacmesh.read(DATA / "two_blocks.msh"), "slave").mesh
    scene = make_scene(mesh, "slave", "master", values=cell_values(mesh))
    slave, master, *_ = [entry for entry in scene.legend if entry.kind == "outline"]
    assert slave.colours == (colours.INK,) and master.colours == (colours.MASTER,)
    drawn = {tuple(colour) for layer in scene.layers if layer.kind == "lines" for colour in layer.rgb[:1].tolist()}
    assert tuple(colours.rgb([colours.MASTER])[0].tolist()) in drawn


def sandwich():
    """Three cubes on one another, each a group; the group `slave` is on both sides of the middle one."""
    points, hexahedra = box(2)
    n = len(points)
    low, high = hexahedra[:, [0, 3, 2, 1]], hexahedra[:, 4:]
    skin = np.vstack([f[(points[f][:, :, 2] == z).all(axis=1)] for f, z in ((low, 0), (high, 1))])
    solids = np.vstack([hexahedra + k * n for k in range(3)])
    x = np.vstack([points + np.array([0, 0, k - 1]) for k in range(3)])
    cells = np.split(np.arange(len(skin), len(skin) + len(solids)), 3)
    groups = {"slave": np.arange(len(skin)), **dict(zip(("foot", "core", "lid"), cells, strict=True))}
    return Mesh.create(x, [("QUAD4", skin + n), ("HEXA8", solids)], cell_groups=groups)


def opacity_of_bodies(drawn):
    return next(layer.opacity for layer in drawn.layers if layer.kind == "faces")


def test_bodies_are_ghosts_where_nothing_can_be_moved_to_show_the_slave():
    """A skin on both sides of a body, or an underside where bodies stay; else bodies are solid."""
    assert opacity_of_bodies(make_scene(sandwich(), "slave")) == BODIES_AS["ghost"]
    assert opacity_of_bodies(make_scene(sandwich(), "slave", bodies="solid")) == 1.0
    below = {"camera": (1, -1, 1), "explode": 0, "tilt": 0}
    assert opacity_of_bodies(make_scene(two_cubes(), "slave", **below)) == BODIES_AS["ghost"]
    for options in ({}, {"cutaway": (1, 0, 0), **below}):
        assert opacity_of_bodies(make_scene(two_cubes(), "slave", **options)) == 1.0
    assert opacity_of_bodies(make_scene(cube(2), "slave")) == 1.0
    for mesh, explode, way in ((sandwich(), None, "ghost"), (two_cubes(), 0, "ghost"), (two_cubes(), None, "solid")):
        assert f'"bodiesAs":"{way}"' in page_text(mesh, slave="slave", explode=explode, camera=(1, -1, 1))


@pytest.mark.parametrize(
    ("slave", "moved"),
    [("face_upper", "opened, tilted"), ("nut", ""), ("head", ""), (["face_upper", "nut", "head"], "")],
)
def test_bodies_stay_and_are_ghosts_where_no_motion_shows_the_slave(slave, moved):
    """Under the head of a bolt and above its nut: the bolt hides one by itself, however it is moved."""
    mesh = lacmesh.read(lacmesh.example("flange.msh"))
    drawn = make_scene(mesh, slave)
    assert drawn.moved == moved
    assert opacity_of_bodies(drawn) == (1.0 if moved else BODIES_AS["ghost"])
    text = page_text(mesh, slave=slave)
    assert f'"bodiesAs":"{"solid" if moved else "ghost"}"' in text
    assert f'"opened":{"true" if moved else "false"}' in text


@pytest.mark.parametrize("turn", [np.eye(3), np.array([[2, -2, 1], [1, 2, 2], [-2, -1, 2]]) / 3])
@pytest.mark.parametrize(("aside", "seen"), [(0.0, False), (0.1, False), (0.7, True)])
def test_what_another_body_leaves_bare_is_in_sight(turn, aside, seen):
    """A cube on three rows of faces: moved by a tenth it hides the middles of all, by seven tenths of one row."""
    mesh = two_cubes()
    visible = find_visible(mesh, "master", "slave")
    x = mesh.points + np.outer(visible.body_of_node != visible.slave_bodies[0], [aside, 0, 0.2])
    up = np.array([0.0, 0.0, 1.0])
    assert shows_skin(x @ turn.T, visible, turn @ up) == seen
    assert not shows_skin(x @ turn.T, visible, turn @ -up)  # the body itself hides it from below


def test_bodies_have_the_names_of_their_groups():
    """In the legend with their colours, and on a page under the pointer."""
    (line,) = [entry for entry in make_scene(sandwich()).legend if entry.words.startswith("bodies")]
    assert line.words == "bodies: 'foot', 'core', 'lid'" and line.colours == colours.BODIES[:3]
    assert not any("bodies" in entry.words for entry in make_scene(sandwich(), bodies="hidden").legend)
    assert """"bodyNames":["'foot'","'core'","'lid'"]""" in page_text(sandwich())
    assert not any("bodies" in entry.words for entry in make_scene(two_cubes()).legend)  # skins alone name them
    assert '"bodyNames":["the body with \'slave\'","the body with \'master\'"]' in page_text(two_cubes())
