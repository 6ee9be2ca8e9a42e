"""The picture of contact: what it is made of, and that it is drawn, from a solution or from a folder."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lacmesh
import lacsolver as ls
from lacmesh import Mesh, Surface
from lacmesh.errors import ReadError, RequestError, WriteError
from lacmesh.formats.vtu.collection import read_pvd, write_pvd
from lacmesh.scene.colours import RESULT, STATES, rgb
from lacsolver.cli import main
from lacsolver.output.stored import stored_fields
from lacsolver.pictures.drawing import ContactPicture
from lacsolver.pictures.framing import largest_closed, magnification, pressed_span, pressed_window
from lacsolver.pictures.profiles import along, chains
from lacsolver.pictures.quantities import QUANTITIES, ColourScale
from lacsolver.pictures.skins import macro_places, outlines, rings_of, views_of
from lacsolver.results.units import Units
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.patch_meshes import stack
from tests.viewing import DATA, tones

JOINT = '[[contact]]\nname = "joint"\nslave = "slave"\nmaster = "master"\n'
DISC = GOOD.replace("blocks.msh", "disc_on_block.msh").replace('"x0"', '"symmetry_x"').replace("1.0\n", "25.0\n")
SPACE = (
    GOOD.replace("plane_strain", "3d").replace("uy = 0.0", "uz = 0.0").replace("value = 1.0", 'value = "t * (1 + x)"')
    + '[[displacement]]\ngroup = "y0"\nuy = 0.0\n'
)


def solved(folder, text=GOOD, mesh=None):
    """The folder of the results of a run."""
    if mesh is not None:
        put(mesh, folder)
    (folder / "case.toml").write_text(text)
    assert main(["run", str(folder / "case.toml"), "-q", "--force"]) == 0
    return folder / "case"


def size(path):
    """Width and height of a PNG file, which is whole."""
    from PIL import Image

    with Image.open(path) as image:
        image.load()
        return image.size


def picture(folder, field="pressure", **options):
    solution = ls.read_results(folder).solution()
    return ContactPicture.of(solution.mesh, solution.fields, field, **options)


# ---- in the plane


@pytest.fixture(scope="module")
def disc(tmp_path_factory):
    """The disc on its block, pressed: some macro-elements in contact, most not."""
    folder = tmp_path_factory.mktemp("disc")
    (folder / "disc_on_block.msh").write_bytes((DATA / "disc_on_block.msh").read_bytes())
    return solved(folder, DISC)


def test_a_plane_model_is_drawn_by_the_command_as_by_python(disc, tmp_path):
    """Half a circle touches half of a line: what has closed limits how far displacements are magnified."""
    assert main(["plot", str(disc), "--time", "1", "--field", "recovered", "-o", str(tmp_path / "p.png"), "-q"]) == 0
    assert ls.plot(disc, tmp_path / "q.png", time=1.0, field="recovered", title="case") == 1.0
    assert (tmp_path / "p.png").read_bytes() == (tmp_path / "q.png").read_bytes()
    wide, high = size(tmp_path / "p.png")
    assert wide > 1300 and high > 500 and min(tones(tmp_path / "p.png", RESULT[-2], RESULT[1])) > 50
    drawn = picture(disc)
    zone = drawn.zones["joint"]
    half = np.abs(zone.centre[zone.pressure > 0, 0]).max()
    assert 0.3 * half**2 / 2 < largest_closed(drawn.mesh, drawn.u, [zone]) < 3 * half**2 / 2


def test_the_profile_is_the_pressure_along_the_skin(disc, tmp_path):
    zone = ls.read_results(disc).solution().contact["joint"]
    x, p = zone.surface.x, zone.pressure
    ends = zone.surface.faces.nodes[:, :2]
    s, drawn = along(ends, p[zone.macro], x)
    lengths = np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
    assert not np.isnan(s).any() and s[0] == 0.0 and math.isclose(s[-1], lengths.sum()) and (np.diff(s) >= 0).all()
    assert np.sum(np.diff(s)[::2] * drawn[::2]) == pytest.approx(p @ np.bincount(zone.macro, lengths))
    assert drawn.max() == p.max() > 0
    assert max(drawn[0], drawn[-1]) > 0.5 * p.max() and min(drawn[0], drawn[-1]) == 0.0  # pressed at one end of the arc
    for field, values in (("pressure", p), ("gap", zone.gap)):
        axes = picture(disc, field).figure(tmp_path / "p.png").axes
        (profile,) = [ax for ax in axes if ax.get_xlabel().startswith("length along")]
        curves = {line.get_label(): np.nanmax(line.get_ydata()) for line in profile.lines}
        assert curves.pop("macro-elements") == np.nanmax(values)
        assert curves == (
            {"recovered": pytest.approx(np.nanmax(zone.pressure_recovered))} if field == "pressure" else {}
        )


@given(
    st.lists(st.integers(1, 6), min_size=1, max_size=6), st.lists(st.booleans(), min_size=6, max_size=6), st.randoms()
)
def test_chains_put_each_segment_after_the_one_before(lengths, closed, random):
    ends, node = [], 0
    for n, ring in zip(lengths, closed, strict=False):
        ring = ring and n > 1
        nodes = [*range(node, node + n + (not ring))]
        ends += [(nodes[k], nodes[(k + 1) % len(nodes)]) for k in range(n)]
        node += n + 1
    random.shuffle(ends)
    ends = np.array(ends)
    order, first = chains(ends)
    assert sorted(order) == list(range(len(ends))) and len(first) == len(lengths)
    follows = ends[order[1:], 0] == ends[order[:-1], 1]
    follows[first[1:] - 1] = True
    assert follows.all()


# ---- in space


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """Two blocks in space, pressed unevenly, in two steps."""
    text = SPACE + '[steps]\ncount = 2\n[output]\nunits = "N, mm, MPa"\n'
    return solved(tmp_path_factory.mktemp("pressed"), text, stack("HEXA8", "TETRA4", 3, counts=(3, 2)))


@pytest.fixture(scope="module")
def seen(pressed, tmp_path_factory):
    """The picture of these blocks, its figure, and what the scene of the model was made of."""
    given, once = {}, sys.modules["lacsolver.pictures.drawing"].make_scene

    def caught(mesh, skins, **options):
        given.update(options, mesh=mesh, skins=skins)
        return once(mesh, skins, **options)

    drawn = picture(pressed, units=Units.of("N, mm, MPa"))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sys.modules["lacsolver.pictures.drawing"], "make_scene", caught)
        return drawn, drawn.figure(tmp_path_factory.mktemp("seen") / "p.png"), given


@pytest.mark.vtk
def test_the_model_has_the_values_of_the_slave_faces_alone(pressed, seen):
    drawn, _, given = seen
    faces, values = given["mesh"], given["values"]
    solution = ls.read_results(pressed).solution()
    zone, (group,) = solution.contact["joint"], given["skins"]
    slave = faces.cell_groups[group]
    assert np.isfinite(values.values).sum() == len(slave) == len(zone.surface)
    assert [zone.pressure[m] for m in faces.cell_data["lac_macro"][slave]] == values.values[slave].tolist()
    assert 0 < zone.pressure.min() < zone.pressure.max() == values.good and values.bad == 0.0
    assert given["bodies"] == "ghost"  # nothing hides the skin
    u = np.asarray(solution.u)
    times = magnification(solution.mesh, u)
    assert times > 1 and np.allclose(faces.points, solution.mesh.points + times * u, rtol=0, atol=1e-15)
    assert f"displacement of the model x {times:g}" in drawn.heading


@pytest.mark.vtk
def test_a_panel_has_a_polygon_for_each_face_in_its_colour(seen):
    from matplotlib.collections import PolyCollection

    drawn, figure, _ = seen
    ((polygons, axes),) = [
        (own, ax) for ax in figure.axes for own in ax.collections if isinstance(own, PolyCollection) and own.axes
    ]
    zone = drawn.zones["joint"]
    assert len(polygons.get_paths()) == len(zone.surface)
    ends = np.array([polygon.vertices for polygon in polygons.get_paths()]).reshape(-1, 2)
    corners = zone.surface.x[np.unique(zone.surface.faces.corners)][:, :2]
    assert np.allclose([ends.min(axis=0), ends.max(axis=0)], [corners.min(axis=0), corners.max(axis=0)], atol=0.02)
    assert np.allclose(polygons.get_facecolors(), drawn.scale.rgba(zone.pressure[zone.macro]))
    assert axes.get_title().startswith("joint, seen along") and axes.get_xlabel() == "x (mm)"
    assert [ax.get_ylabel() for ax in figure.axes if "pressure" in ax.get_ylabel()] == ["contact pressure (MPa)"]


@pytest.mark.vtk
def test_a_model_in_space_is_drawn_at_the_time_that_is_asked_for(pressed, tmp_path, capsys):
    assert main(["plot", str(pressed), "--time", "0.5", "--field", "recovered", "-o", str(tmp_path / "p.png")]) == 0
    assert "MB" in capsys.readouterr().out
    assert size(tmp_path / "p.png")[0] > 1000 and min(tones(tmp_path / "p.png", "34489b", "56b4b8")) > 300
    assert main(["plot", str(pressed), "--field", "status", "--force", "-q"]) == 0  # without a name, into the folder
    assert tones(pressed / "status.png", STATES[2])[0] > 3000  # all macro-elements are closed


@pytest.mark.vtk
def test_where_nothing_can_be_drawn(pressed, tmp_path, monkeypatch):
    monkeypatch.setattr("lacmesh.view.offscreen.windows", lambda: iter(()))
    with pytest.raises(WriteError, match="nothing can be"):
        ls.plot(pressed, tmp_path / "p.png")
    assert not (tmp_path / "p.png").exists()


@pytest.mark.parametrize(("pressure", "place"), [(5.0, 1.0), (0.0, 0.0), (-3.0, 0.0)])
def test_round_off_is_drawn_as_nothing_and_a_uniform_pressure_has_one_colour(sheared, pressure, place):
    zone = ls.read_results(sheared).solution().contact["joint"]
    rows = np.arange(len(zone.gap))
    uniform = pressure * (1 + 1e-15 * rows)
    scale = ColourScale.of(QUANTITIES["pressure"], [replace(zone, pressure=uniform)], Units())
    np.testing.assert_allclose(np.asarray(scale.norm(uniform)), place, rtol=0, atol=1e-9)
    friction = zone.friction._replace(shear=1e-13 * zone.pressure[:, None])
    noise = replace(zone, gap=-1e-16 * (1 + rows), friction=friction)
    for name in ("gap", "shear"):
        assert not QUANTITIES[name].of(noise).any()
        assert ColourScale.of(QUANTITIES[name], [noise], Units()).high == 1.0
    small = replace(noise, gap=1e-9 * rows)
    np.testing.assert_array_equal(QUANTITIES["gap"].of(small), small.gap)


# ---- skins laid flat


def surface_of(points, kind, faces):
    mesh = Mesh.create(points, [(kind, faces)], space_dim=3)
    return Surface.of(mesh, np.arange(mesh.n_cells)), mesh.points


def cylinder(turn, radius=2.0, n=24, m=3, inward=False):
    """Faces on a part of a cylinder about z, which turn outward."""
    angle = np.linspace(0, turn, n + 1)
    full = math.isclose(turn, 2 * np.pi)
    z = np.linspace(0, 3.0, m + 1)
    points = np.stack([np.stack([radius * np.cos(a) + 0 * z, radius * np.sin(a) + 0 * z, z], axis=1) for a in angle])
    node = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    if full:
        node[n] = node[0]
    quads = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1).reshape(-1, 4)
    return surface_of(points.reshape(-1, 3), "QUAD4", quads[:, ::-1] if inward else quads)


@pytest.mark.parametrize("turn", [1.5, 3.5, 2 * np.pi])
@pytest.mark.parametrize("inward", [False, True])
def test_a_cylinder_is_unrolled(turn, inward):
    surface, x = cylinder(turn, inward=inward)
    (view,) = views_of(surface, x, np.arange(len(surface)))
    assert view.words == f"unrolled, {'inside' if inward else 'outside'} of radius 2"
    assert view.axes == ("length around", "z") and len(view.rows) == len(surface)
    s = view.paper[..., 0]
    assert s.min() == 0 and s.max() == pytest.approx(2 * turn, rel=1e-6) and np.ptp(view.paper[..., 1]) == 3.0
    assert np.ptp(s, axis=1) == pytest.approx(2 * turn / 24, rel=1e-6)  # no face is torn by the seam
    normal = np.cross(view.basis[:, 0], view.basis[:, 1])
    middle = x[surface.faces.corners].mean(axis=1) * [1, 1, 0]
    assert ((normal * middle).sum(axis=1) * (-1 if inward else 1) > 0).all()  # seen from where the master is
    assert len(np.unique(np.round(view.paper.mean(axis=1), 6), axis=0)) == len(surface)  # no face upon another


@pytest.mark.parametrize(("n", "views"), [(8, 1), (4, 2)])
def test_a_coarse_bore_is_unrolled_after_its_cut_too(n, views):
    surface, x = cylinder(2 * np.pi, n=n, m=2, inward=True)
    quads = surface.faces.corners
    middle = len(x) + np.arange(len(quads))[:, None]
    cut = np.concatenate([np.concatenate([quads[:, [k, (k + 1) % 4]], middle], axis=1) for k in range(4)])
    surface, x = surface_of(np.concatenate([x, x[quads].mean(axis=1)]), "TRIA3", cut)
    macro = np.arange(len(surface)) % len(quads)
    found = views_of(surface, x, macro)
    if n == 8:  # no macro-element is torn by the seam: each is as wide as a face of the octagon
        s = found[0].paper[..., 0]
        assert max(np.ptp(s[macro == k]) for k in range(len(quads))) == pytest.approx(2 * np.pi / 4, rel=1e-6)
    assert len(found) == views and found[0].words.startswith("unrolled, inside of radius 2" if n == 8 else "seen")


def test_a_flat_skin_is_seen_along_its_normal():
    quad = [[0, 0, 1], [2, 0, 1], [2, 1, 1], [0, 1, 1]]
    (view,) = views_of(*surface_of(quad, "QUAD4", [[0, 1, 2, 3]]), np.array([0]))
    assert view.words == "seen along \N{MINUS SIGN}z" and view.axes == ("x", "y") and view.flipped == (False, False)
    assert np.allclose(view.paper[0, :4], np.array(quad)[:, :2])
    (below,) = views_of(*surface_of(quad, "QUAD4", [[3, 2, 1, 0]]), np.array([0]))
    assert below.words == "seen along +z" and below.axes == ("x", "y") and below.flipped.count(True) == 1
    tilted = np.array(quad, float) @ np.array([[1, 0, 0], [0, 0.8, 0.6], [0, -0.6, 0.8]])
    (view,) = views_of(*surface_of(tilted, "QUAD4", [[0, 1, 2, 3]]), np.array([0]))
    sides = np.linalg.norm(np.diff(view.paper[0, :4], axis=0), axis=1)
    assert np.allclose(sides, [2, 1, 2]) and np.allclose(view.paper.reshape(-1, 2).min(axis=0), 0)


@pytest.mark.parametrize("kind", ["TRIA3", "TRIA6"])
def test_a_ball_is_seen_from_two_sides(kind):
    octahedron = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    mesh = Mesh.create(octahedron, [("TRIA3", faces)], space_dim=3)
    mesh = lacmesh.raise_order(mesh) if kind == "TRIA6" else mesh
    views = views_of(Surface.of(mesh, np.arange(8)), mesh.points, np.arange(8))
    assert len(views) == 2 and sorted(np.concatenate([view.rows for view in views])) == [*range(8)]
    assert views[0].words != views[1].words


def test_outlines_are_those_of_macro_elements():
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]]
    surface, x = surface_of(points, "TRIA3", [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    (view,) = views_of(surface, x, np.array([0, 0, 1, 1]))
    macro = np.array([0, 0, 1, 1])
    lines, ends = outlines(view, rings_of(surface), macro)
    length = np.linalg.norm(np.diff(lines, axis=1)[:, 0], axis=1)
    assert len(ends) == 6 and len(lines) == 8 and length.max() == 1.0  # one line twice, and no diagonal
    assert [(row, place.round(6).tolist()) for row, place, _ in macro_places(view, macro)] == [
        (0, [0.5, 0.5]),
        (1, [1.5, 0.5]),
    ]


# ---- friction


@pytest.fixture(scope="module")
def sheared(tmp_path_factory):
    """Two blocks in the plane that are pressed, then pulled along: some macro-elements stick, some slide."""
    text = GOOD.replace('master = "master"\n', 'master = "master"\nfriction = 0.4\n')
    text = text.replace('[[displacement]]\ngroup = "x0"\nux = 0.0\n', "").replace("uy = 0.0", "ux = 0.0\nuy = 0.0")
    text += '[[traction]]\ngroup = "top"\ntx = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.25]]\n[steps]\ntimes = [1.0, 2.0]\n'
    text = text.replace("value = 1.0", "value = [[0.0, 0.0], [1.0, 1.0], [2.0, 1.0]]")
    return solved(tmp_path_factory.mktemp("sheared"), text, blocks())


def test_friction_has_arrows_and_colours_for_what_sticks_and_slides(sheared, tmp_path):
    from matplotlib.quiver import Quiver

    drawn = picture(sheared)
    figure = drawn.figure(tmp_path / "p.png")
    zone = drawn.zones["joint"]
    (arrows,) = [own for ax in figure.axes for own in ax.collections if isinstance(own, Quiver)]
    on = np.linalg.norm(zone.shear_vector, axis=1) > 1e-9 * np.abs(zone.shear).max()
    assert len(arrows.U) == on.sum() > 0
    assert np.sign(arrows.U).tolist() == np.sign(zone.shear_vector[on, 0]).tolist()
    ((axes,),) = ([ax for ax in figure.axes if ax.get_xlabel().startswith("length along")],)
    assert "shear" in [line.get_label() for line in axes.lines]
    (band,) = [own for own in axes.collections if own.get_linewidth()[0] == 7]
    states = ColourScale("", -1.0, 2.0, states=True).rgba(np.unique(zone.status).astype(float))
    assert np.allclose(np.unique(band.get_colors(), axis=0), np.unique(states, axis=0))
    assert np.allclose(
        255 * ColourScale("", -1.0, 2.0, states=True).rgba(np.arange(-1.0, 3))[:, :3], rgb(STATES), atol=1
    )
    low, high, none = 255 * ColourScale("pressure", 0.0, 2.0).rgba(np.array([0.0, 2.0, np.nan]))
    assert np.allclose(low[:3], rgb(RESULT[:1])) and np.allclose(high[:3], rgb(RESULT[-1:])) and none[3] == 0
    for field in ("status", "slip", "shear", "path", "use"):
        picture(sheared, field).figure(tmp_path / "p.png")


# ---- zoomed


def test_a_zoomed_picture_shows_the_surroundings_of_the_contact(disc, tmp_path):
    zone = ls.read_results(disc).solution().contact["joint"]
    points = zone.surface.x[np.unique(zone.surface.faces.nodes[zone.pressure[zone.macro] > 0, :2])]
    low, high = pressed_window([zone], zone.surface.x)
    assert (low < points.min(axis=0)).all() and (high > points.max(axis=0)).all()
    assert (high - low).max() == pytest.approx(2 * np.ptp(points, axis=0).max())
    begin, end = pressed_span(zone)
    s, p = along(zone.surface.faces.nodes[:, :2], zone.pressure[zone.macro], zone.surface.x)
    assert begin <= s[p > 0].min() and s[p > 0].max() < end < s[-1]
    drawn = picture(disc, zoom=True)
    axes = drawn.figure(tmp_path / "p.png").axes
    (profile,) = [ax for ax in axes if ax.get_xlabel().startswith("length along")]
    window = pressed_window([zone], zone.surface.x + drawn.u).T[:2]
    assert np.allclose([axes[0].get_xlim(), axes[0].get_ylim()], window)
    assert profile.get_xlim() == (begin, end) and "to scale" in drawn.heading
    none = replace(zone, pressure=0 * zone.pressure)
    assert pressed_window([none], zone.surface.x) is None and pressed_span(none) is None


def test_zoomed_pictures_end_where_the_skin_does_and_have_a_frame_for_each_contact(disc, pressed, tmp_path):
    """All of a skin is under pressure: its surroundings are no more than it. Two contacts at the ends of a body."""
    whole, near = (
        [(ax.get_xlim(), ax.get_ylim()) for ax in picture(pressed, zoom=zoom).figure(tmp_path / "p.png").axes[1:]]
        for zoom in (False, True)
    )
    assert near == whole
    solution = ls.read_results(disc).solution()
    zone = solution.contact["joint"]
    zones = {"joint": zone, "far": replace(zone, pressure=zone.pressure[::-1].copy())}  # the other end is pressed
    drawn = ContactPicture.of(solution.mesh, replace(solution.fields, zones=zones), "pressure", zoom=True)
    frames = [ax for ax in drawn.figure(tmp_path / "p.png").axes if ax.get_ylabel() == "y"]
    for ax, one in zip(frames, zones.values(), strict=True):
        window = pressed_window([one], zone.surface.x + drawn.u)
        assert np.allclose([ax.get_xlim(), ax.get_ylim()], window.T[:2])


# ---- the request


def test_a_run_draws_and_says_so_and_keeps_a_picture_that_is_there(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD.replace("[[contact]]", "[[tie]]"))
    assert main(["run", "case.toml", "--plot", "p.png"]) == 0
    assert capsys.readouterr().out.endswith("the pressure at t = 1: p.png\n")
    assert size(tmp_path / "p.png")[0] > 1000
    before = (tmp_path / "p.png").read_bytes()
    assert main(["run", "case.toml", "--plot", "p.png", "-o", "again"]) == 2
    assert (tmp_path / "p.png").read_bytes() == before and not (tmp_path / "again").exists()
    assert main(["run", "case.toml", "--plot", "p.png", "--force", "-q"]) == 0


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"field": "presure"}, RequestError, "did you mean"),
        ({"field": "slip"}, RequestError, "contacts with friction"),
        ({"zone": ["jont"]}, RequestError, "did you mean"),
        ({"time": 0.7}, RequestError, "no fields were"),
        ({"path": "p.jpg"}, RequestError, "is written as"),
        ({"folder": "."}, ReadError, "holds no results"),
    ],
)
def test_what_is_not_there_is_refused(disc, tmp_path, options, error, words):
    with pytest.raises(error, match=words):
        ls.plot(**{"folder": disc, "path": tmp_path / "p.png", **options})


@pytest.mark.parametrize(
    ("words", "change", "missing", "says"),
    [
        ("run case.toml --zoom", ("", ""), "", "--plot"),
        ("run case.toml --plot p.png", (JOINT, ""), "", "no [[contact]]"),
        ("run case.toml --plot p.png", ("", ""), "matplotlib", "needs matplotlib; pip"),
        ("run case.toml --plot p.png", ("plane_strain", "3d"), "pyvista", "needs pyvista; pip"),
        ("plot DISC --history reaction.* --field gap -o p.png", ("", ""), "", "--field is for"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_solved(
    disc, tmp_path, monkeypatch, capsys, words, change, missing, says
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("lacsolver.pictures.drawing.find_spec", lambda name: None if name == missing else name)
    (tmp_path / "case.toml").write_text(GOOD.replace(*change) if change[0] else GOOD)
    assert main([word.replace("DISC", str(disc)) for word in words.split()]) == 2
    assert says in capsys.readouterr().err and [p.name for p in tmp_path.iterdir()] == ["case.toml"]


# ---- fields in other forms


def test_fields_in_med_and_in_pieces_of_several_processes_are_those_of_one_file(tmp_path):
    """A VTU of a plane model, taken apart into two pieces with a common row of nodes, as two processes write it."""
    folder = solved(tmp_path, GOOD + '[output]\nformat = "med"\n', blocks())
    in_med = picture(folder).zones["joint"].pressure
    folder = solved(tmp_path, GOOD)
    before = ls.read_results(folder).solution()
    assert np.array_equal(before.contact["joint"].pressure, in_med)
    ((time, file),) = read_pvd(folder / "solid.pvd").items()
    whole = lacmesh.read(folder / file)
    for k, cells in enumerate(np.split(np.arange(whole.n_cells), [whole.n_cells // 3])):
        lacmesh.write(folder / "fields" / f"piece_{k}.vtu", restricted(whole, cells))
    pieces = "".join(f'<Piece Source="piece_{k}.vtu"/>' for k in range(2))
    text = f"<VTKFile><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>"
    (folder / "fields" / "solid_0001.pvtu").write_text(text)
    write_pvd(folder / "solid.pvd", {time: "fields/solid_0001.pvtu"})
    after = ls.read_results(folder).solution()
    assert stored_fields(folder).times == [time]
    assert after.mesh.cells_by_type == before.mesh.cells_by_type and after.mesh.n_nodes == before.mesh.n_nodes
    order, other = np.argsort(before.mesh.node_number), np.argsort(after.mesh.node_number)
    assert np.array_equal(before.u[order], after.u[other])
    assert np.array_equal(before.contact["joint"].pressure, after.contact["joint"].pressure)
    ls.plot(folder, tmp_path / "p.png")


def restricted(mesh, cells):
    """Some cells of a mesh, with their nodes, numbers and data."""
    chosen = list(mesh.select(cells))
    used = np.unique(np.concatenate([nodes.ravel() for _, _, nodes in chosen]))
    nodes = {name: values[used] for name, values in mesh.node_data.items()}
    data = {name: values[cells] for name, values in mesh.cell_data.items()}
    numbers = {"node_number": mesh.node_number[used], "cell_number": mesh.cell_number[cells]}
    blocks = [(kind, np.searchsorted(used, own)) for kind, _, own in chosen]
    made = Mesh.create(mesh.points[used], blocks, space_dim=mesh.space_dim, **numbers)
    return replace(made, node_data=nodes, cell_data=data, zones=mesh.zones)


def test_units_are_words_alone(tmp_path):
    folder = solved(tmp_path, GOOD, blocks())
    before = (folder / "contact_joint.csv").read_bytes()
    assert "units" not in ls.read_results(folder).summary
    results = ls.read_results(solved(tmp_path, GOOD + '[output]\nunits = "N,mm, MPa"\n'))
    assert (folder / "contact_joint.csv").read_bytes() == before
    assert results.summary["units"] == "N, mm, MPa" and results.solution().units == Units("N", "mm", "MPa")
    assert results.solution().units.energy == "N mm"
    for wrong in ("N", "N, mm", "N, , MPa", "a, b, c, d, e"):
        with pytest.raises(ls.CaseError, match="names for force"):
            ls.parse_case(GOOD + f'[output]\nunits = "{wrong}"\n', tmp_path / "case.toml")


@pytest.mark.parametrize(
    ("u", "closed", "times"), [(0, None, 1), (1e-3, None, 200), (1e-3, 1e-3, 20), (1e-3, 1, 1), (5, None, 1)]
)
def test_displacements_are_magnified_as_far_as_bodies_do_not_overlap(u, closed, times):
    bar = Mesh.create([[0, 0], [10, 0]], [("SEG2", [[0, 1]])])
    assert (
        magnification(bar, np.array([[0.0, 0, 0], [u, 0, 0]]), **({} if closed is None else {"closed": closed}))
        == times
    )


# ---- magnified
