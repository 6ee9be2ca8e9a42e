"""Pictures and films of contact and of natural modes: what they are made of, and that they are drawn, from a folder."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

import lacmesh
import lacsolver as ls
from lacmesh import Mesh, Surface, generate
from lacmesh.cells import CELLS
from lacmesh.drawing import Drawing, rgb
from lacmesh.errors import ReadError, RequestError, WriteError
from lacsolver.cli import main
from lacsolver.output.states import Written
from lacsolver.output.store import load, save
from lacsolver.output.tables import read_table
from lacsolver.pictures import filming
from lacsolver.pictures.drawing import ContactPicture
from lacsolver.pictures.filming import SHEET, _ends, default_curve, film
from lacsolver.pictures.frames import DrawnSurface, Frame, Frames, read_frames, read_mode
from lacsolver.pictures.framing import largest_closed, magnification, pressed_span, pressed_window
from lacsolver.pictures.history import Panel, draw_panels
from lacsolver.pictures.plane import along, level_out
from lacsolver.pictures.quantities import QUANTITIES, RESULT, STATES, ColourScale
from lacsolver.pictures.skins import outlines, rings_of, views_of
from lacsolver.results.units import Units
from tests.lacsolver.bad_cases import GOOD, HEAVY, blocks, put
from tests.lacsolver.patch_meshes import stack
from tests.viewing import DATA

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


def picture(folder, field="pressure", **options):
    solution = ls.read_results(folder).solution()
    return ContactPicture.of(solution.mesh, solution.fields, field, **options)


def axes_of(drawn, label="length along"):
    """The figure's frames with a profile, or with the bodies (label "y")."""
    frames = drawn.figure().axes
    return [ax for ax in frames if label in (ax.get_ylabel(), ax.get_xlabel()[: len(label)])]


@pytest.fixture(scope="module")
def disc(tmp_path_factory):
    """The disc on its block, pressed: some macro-elements in contact, most not."""
    folder = tmp_path_factory.mktemp("disc")
    (folder / "disc_on_block.msh").write_bytes((DATA / "disc_on_block.msh").read_bytes())
    return solved(folder, DISC)


def solved_in_space(folder, count):
    """Two blocks in space, pressed unevenly, in so many steps: the folder of their results."""
    text = SPACE + f'[steps]\ncount = {count}\n[output]\nunits = "N, mm, MPa"\n'
    return solved(folder, text, stack("HEXA8", "TETRA4", 3, counts=(3, 2)))


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """The results of two blocks in space."""
    return solved_in_space(tmp_path_factory.mktemp("pressed"), 2)


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    """Two blocks in the plane, pressed in eight steps: the folder of their results."""
    text = GOOD + '[[probe]]\ngroup = "top"\n[steps]\ncount = 8\n'
    return solved(tmp_path_factory.mktemp("plane"), text, blocks())


@pytest.fixture(scope="module")
def sheared(tmp_path_factory):
    """Two blocks in the plane that are pressed, then pulled along: some macro-elements stick, some slide."""
    text = GOOD.replace('master = "master"\n', 'master = "master"\nfriction = 0.4\n')
    text = text.replace('[[displacement]]\ngroup = "x0"\nux = 0.0\n', "").replace("uy = 0.0", "ux = 0.0\nuy = 0.0")
    text += '[[traction]]\ngroup = "top"\ntx = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.25]]\n[steps]\ntimes = [1.0, 2.0]\n'
    text = text.replace("value = 1.0", "value = [[0.0, 0.0], [1.0, 1.0], [2.0, 1.0]]")
    return solved(tmp_path_factory.mktemp("sheared"), text, blocks())


@pytest.fixture(scope="module")
def modes(tmp_path_factory):
    """Natural modes of two blocks in contact, one of which only contact supports."""
    folder = tmp_path_factory.mktemp("modes")
    put(blocks(), folder)
    (folder / "case.toml").write_text(HEAVY)
    assert main(["modes", str(folder / "case.toml"), "-k", "4", "-q"]) == 0
    return folder / "case_modes"


def test_a_plane_model_is_drawn_by_the_command_as_by_python(disc, tmp_path):
    """Half a circle touches half of a line: what has closed limits how far displacements are magnified."""
    assert main(["plot", str(disc), "--time", "1", "--field", "recovered", "-o", str(tmp_path / "p.png"), "-q"]) == 0
    assert ls.plot(disc, tmp_path / "q.png", time=1.0, field="recovered", title="case") == 1.0
    assert (tmp_path / "p.png").read_bytes() == (tmp_path / "q.png").read_bytes()
    drawn = picture(disc)
    zone = drawn.zones["joint"]
    half = np.abs(zone.centre[zone.pressure > 0, 0]).max()
    assert 0.3 * half**2 / 2 < largest_closed(drawn.mesh, drawn.u, [zone]) < 3 * half**2 / 2


@pytest.mark.parametrize(
    ("u", "closed", "times"), [(0, None, 1), (1e-3, None, 200), (1e-3, 1e-3, 20), (1e-3, 1, 1), (5, None, 1)]
)
def test_displacements_are_magnified_as_far_as_bodies_do_not_overlap(u, closed, times):
    bar = generate.line(1, (0, 0), (10, 0))
    options = {} if closed is None else {"closed": closed}
    assert magnification(bar, np.array([[0.0, 0, 0], [u, 0, 0]]), **options) == times


def test_the_profile_is_the_pressure_along_the_skin(disc):
    zone = ls.read_results(disc).solution().contact["joint"]
    x, p = zone.surface.x, zone.pressure
    ends = zone.surface.faces.nodes[:, :2]
    s, drawn = along(ends, p[zone.macro], x)
    lengths = np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1)
    assert not np.isnan(s).any() and s[0] == 0.0 and math.isclose(s[-1], lengths.sum()) and (np.diff(s) >= 0).all()
    assert np.sum(np.diff(s)[::2] * drawn[::2]) == pytest.approx(p @ np.bincount(zone.macro, lengths))
    assert drawn.max() == p.max() > 0
    assert max(drawn[0], drawn[-1]) > 0.5 * p.max() and min(drawn[0], drawn[-1]) == 0.0  # pressed at one end of the arc
    for field, wanted in (
        ("pressure", {"macro-elements": p, "recovered": zone.pressure_recovered}),
        ("gap", {"macro-elements": zone.gap}),
    ):
        (profile,) = axes_of(picture(disc, field))
        curves = {line.get_label(): np.nanmax(line.get_ydata()) for line in profile.lines}
        assert curves == {name: pytest.approx(np.nanmax(values)) for name, values in wanted.items()}


def test_zoomed_pictures_show_the_surroundings_of_each_contact(disc):
    """Two contacts at the ends of a body have a frame each."""
    solution = ls.read_results(disc).solution()
    zone = solution.contact["joint"]
    points = zone.surface.x[np.unique(zone.surface.faces.nodes[zone.pressure[zone.macro] > 0, :2])]
    low, high = pressed_window([zone], zone.surface.x)
    assert (low < points.min(axis=0)).all() and (high > points.max(axis=0)).all()
    assert (high - low).max() == pytest.approx(2 * np.ptp(points, axis=0).max())
    begin, end = pressed_span(zone)
    s, p = along(zone.surface.faces.nodes[:, :2], zone.pressure[zone.macro], zone.surface.x)
    assert begin <= s[p > 0].min() and s[p > 0].max() < end < s[-1]
    none = replace(zone, pressure=0 * zone.pressure)
    assert pressed_window([none], zone.surface.x) is pressed_span(none) is None
    zones = {"joint": zone, "far": replace(zone, pressure=zone.pressure[::-1].copy())}  # the other end is pressed
    drawn = ContactPicture.of(solution.mesh, replace(solution.fields, zones=zones), "pressure", zoom=True)
    for ax, one in zip(axes_of(drawn, "y"), zones.values(), strict=True):
        window = pressed_window([one], zone.surface.x + drawn.u)
        assert np.allclose([ax.get_xlim(), ax.get_ylim()], window.T[:2])


def test_friction_has_arrows_and_colours_for_what_sticks_and_slides(sheared):
    from matplotlib.quiver import Quiver

    drawn = picture(sheared)
    figure, zone = drawn.figure(), drawn.zones["joint"]
    (arrows,) = [own for ax in figure.axes for own in ax.collections if isinstance(own, Quiver)]
    on = np.linalg.norm(zone.shear_vector, axis=1) > 1e-9 * np.abs(zone.shear).max()
    assert len(arrows.U) == on.sum() > 0
    assert np.sign(arrows.U).tolist() == np.sign(zone.shear_vector[on, 0]).tolist()
    scale, pressures = ColourScale("", -1.0, 2.0, states=True), ColourScale("pressure", 0.0, 2.0)
    assert np.allclose(255 * scale.rgba(np.arange(-1.0, 3))[:, :3], rgb(STATES), atol=1)
    low, high, none = 255 * pressures.rgba(np.array([0.0, 2.0, np.nan]))
    assert np.allclose([low[:3], high[:3]], rgb((RESULT[0], RESULT[-1]))) and none[3] == 0
    for field in ("status", "slip", "shear", "path", "use"):
        picture(sheared, field).figure()


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


def test_the_range_of_a_curve_is_widened_where_its_values_differ_by_round_off():
    for values, widened in (([5.0, 5.0 + 1e-12, np.nan], True), ([5.0, 6.0, np.nan], False), ([np.nan] * 3, False)):
        axes = Figure().subplots()
        axes.plot(values)
        before = axes.get_ylim()
        level_out(axes, np.array(values))
        assert (axes.get_ylim() != before) == widened
        assert np.ptp(axes.get_ylim()) >= 4e-6 and (not widened or np.ptp(axes.get_ylim()) < 1e-5)


@pytest.mark.slow
@pytest.mark.vtk
def test_a_model_in_space_has_the_values_of_its_slave_faces_and_a_panel_a_polygon_for_each(pressed, tmp_path):
    from matplotlib.collections import PolyCollection

    given, add_skins = {}, Drawing.add_skins

    def caught(self, values):
        given.update(values=values, drawing=self)
        return add_skins(self, values)

    drawn = picture(pressed, units=Units.of("N, mm, MPa"))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Drawing, "add_skins", caught)
        figure = drawn.figure()
    faces, values, solution = given["drawing"].mesh, given["values"], ls.read_results(pressed).solution()
    zone, slave = solution.contact["joint"], given["drawing"].slaves
    assert np.isfinite(values.values).sum() == len(slave) == len(zone.surface)
    assert [zone.pressure[m] for m in faces.cell_data["lac_macro"][slave]] == values.values[slave].tolist()
    assert 0 < zone.pressure.min() < zone.pressure.max() == values.good and values.bad == 0.0
    u = np.asarray(solution.u)
    times = magnification(solution.mesh, u)
    assert times > 1 and np.allclose(faces.points, solution.mesh.points + times * u, rtol=0, atol=1e-15)
    (polygons,) = [own for ax in figure.axes for own in ax.collections if isinstance(own, PolyCollection) and own.axes]
    assert len(polygons.get_paths()) == len(zone.surface)
    assert np.allclose(polygons.get_facecolors(), drawn.scale.rgba(zone.pressure[zone.macro]))
    assert [ax.get_ylabel() for ax in figure.axes if "pressure" in ax.get_ylabel()] == ["contact pressure (MPa)"]


@pytest.mark.vtk
def test_a_model_in_space_is_drawn_at_a_time_unless_nothing_can_be_drawn(pressed, tmp_path, monkeypatch):
    figure = picture(pressed).figure()
    (image,) = [image for axes in figure.axes for image in axes.images]
    high, wide = np.array(image.get_size()) / figure.dpi
    assert wide == pytest.approx(2 * 5.0) and high < wide  # twice the size of its part of the picture
    assert ls.plot(pressed, tmp_path / "p.png", time=0.5, field="recovered") == 0.5
    assert main(["plot", str(pressed), "--field", "status", "--force", "-q"]) == 0  # without a name, into the folder
    assert (pressed / "status.png").exists()

    def no_renderer():
        raise WriteError("picture", "nothing can be drawn here")

    for module in ("drawing", "filming"):
        monkeypatch.setattr(f"lacsolver.pictures.{module}.check_renderer", no_renderer)
    for draw, name in ((ls.plot, "q.png"), (film, "f.gif")):
        with pytest.raises(WriteError, match="nothing can be"):
            draw(pressed, tmp_path / name)
        assert not (tmp_path / name).exists()


# ---- skins laid flat


def surface_of(points, kind, faces):
    mesh = Mesh.create(points, [(kind, faces)], space_dim=3)
    return Surface.of(mesh, np.arange(mesh.n_cells)), mesh.points


def cylinder(turn, n=24, m=3, inward=False):
    """Faces on a part of a cylinder of radius 2 about z, of a tube around it (which they look into) or within."""
    radii = (2, 3) if inward else (1, 2)
    tube = generate.ring((1, n, m), radii, "HEXA8", angle=np.degrees(turn), height=3.0)
    c, s = np.cos(4.0), np.sin(4.0)  # it begins anywhere
    skin = tube.only("inner" if inward else "outer").moved(lambda x: [c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]])
    return Surface.of(skin, np.arange(skin.n_cells)), skin.points


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
    (other,) = views_of(surface, x, np.where(view.rows % 5 == 2, -1, view.rows))  # some are of no macro-element
    assert np.array_equal(other.paper, view.paper)


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


def test_edges_between_macro_elements_and_at_the_end_of_a_skin_are_drawn():
    """Three faces in a row, of which the first two are one macro-element."""
    points = [[x, y, 0] for y in (0, 1) for x in range(4)]
    surface, x = surface_of(points, "QUAD4", [[k, k + 1, k + 5, k + 4] for k in range(3)])
    macro = np.array([0, 0, 1])
    (view,) = views_of(surface, x, macro)
    every, ends = ([tuple(middle) for middle in some.mean(axis=1)] for some in outlines(view, rings_of(surface), macro))
    rim = {*((x + 0.5, y) for x in range(3) for y in (0, 1)), (0, 0.5), (3, 0.5)}
    assert len(ends) == len(rim) and set(ends) == rim
    assert set(every) == rim | {(2, 0.5)}


@pytest.mark.parametrize("kind", ["TRIA3", "TRIA6"])
def test_a_ball_is_seen_from_two_sides(kind):
    octahedron = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    faces = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])
    mesh = Mesh.create(octahedron, [("TRIA3", faces)], space_dim=3)
    mesh = lacmesh.raise_order(mesh) if kind == "TRIA6" else mesh
    views = views_of(Surface.of(mesh, np.arange(8)), mesh.points, np.arange(8))
    assert len(views) == 2 and sorted(np.concatenate([view.rows for view in views])) == [*range(8)]
    assert views[0].words != views[1].words


@pytest.mark.slow
def test_a_run_draws_and_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD.replace("[[contact]]", "[[tie]]"))
    assert main(["run", "case.toml", "--plot", "p.png"]) == 0
    assert capsys.readouterr().out.endswith("the pressure at t = 1: p.png\n")
    assert main(["run", "case.toml", "--plot", "p.png", "--force", "-q"]) == 0


@pytest.mark.parametrize(
    ("words", "text", "missing", "says"),
    [
        ("run case.toml --zoom", GOOD, "", "--plot"),
        ("run case.toml --plot p.png", GOOD.replace(JOINT, ""), "", "no [[contact]]"),
        ("run case.toml --plot p.png", GOOD, "matplotlib", "needs matplotlib; pip"),
        ("run case.toml --plot p.png", GOOD.replace("plane_strain", "3d"), "pyvista", "needs pyvista; pip"),
        ("plot DISC --history reaction.* --field gap -o p.png", GOOD, "", "--field is for"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_solved(
    disc, tmp_path, monkeypatch, capsys, words, text, missing, says
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("lacsolver.pictures.drawing.find_spec", lambda name: None if name == missing else name)
    (tmp_path / "case.toml").write_text(text)
    assert main([word.replace("DISC", str(disc)) for word in words.split()]) == 2
    assert says in capsys.readouterr().err and [p.name for p in tmp_path.iterdir()] == ["case.toml"]


def test_fields_are_read_and_exported_whatever_the_format(tmp_path, capsys):
    """A run with `format = "med"` has the file at its end that `lacsolver export` makes of any run."""
    in_med = solved(tmp_path, GOOD + '[output]\nformat = "med"\n', blocks()).rename(tmp_path / "med")
    folder = solved(tmp_path, GOOD)
    before, after = (ls.read_results(one).solution() for one in (folder, in_med))
    assert np.array_equal(before.u, after.u) and before.mesh.cells_by_type == after.mesh.cells_by_type
    assert np.array_equal(before.contact["joint"].pressure, after.contact["joint"].pressure)
    assert main(["export", str(folder), "--to", "med"]) == 0
    one, other = (lacmesh.read(place / "results.med") for place in (folder, in_med))
    assert one.steps == other.steps and one.node_data.keys() == other.node_data.keys()
    assert all(np.array_equal(one.node_data[k], other.node_data[k], equal_nan=True) for k in one.node_data)
    for words, says in (
        (["--to", "med"], "exists already"), (["--to", "med", "-o", "a.vtu"], "exported as .med"),
        ([], "exists already"), (["--to", "inp"], "name its CASE.toml"), (["--partial"], "leave it out"),
    ):  # fmt: skip
        assert main(["export", str(folder), *words]) == 2 and says in capsys.readouterr().err


def test_units_are_words_alone(plane):
    assert "units" not in ls.read_results(plane).summary
    case = ls.parse_case(GOOD + '[output]\nunits = "N,mm, MPa"\n')
    assert Units.of(case.output.units) == Units("N", "mm", "MPa") and Units("N", "mm", "MPa").energy == "N mm"
    for wrong in ("N", "N, mm", "N, , MPa", "a, b, c, d, e"):
        with pytest.raises(ls.CaseError, match="names for force"):
            ls.parse_case(GOOD + f'[output]\nunits = "{wrong}"\n')


# ---- films: what is visible


def area(surface, x):
    corner = x[surface.triangles]
    return np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2


SIZES = {"TRIA": 0.5, "QUAD": 4.0, "TETRA": 1.5 + math.sqrt(3) / 2, "HEXA": 24.0}


@pytest.mark.parametrize("kind", ["TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9", "TETRA4", "HEXA8", "HEXA27"])
def test_a_plane_cell_or_the_skin_of_a_solid_is_covered(kind):
    cell = CELLS[kind]
    mesh = Mesh.create(np.array(cell.reference), [(kind, [list(range(cell.n_nodes))])])
    surface = DrawnSurface.of(mesh)
    assert math.isclose(area(surface, surface.points(mesh.points)), SIZES[cell.family])
    assert cell.dim == 3 or len(surface.edges) == len(surface.outline) == len(surface.triangles)


def test_faces_between_solids_are_not_in_sight_and_a_bare_skin_is():
    mesh = generate.box((1, 1, 2), (1, 1, 2)).only("body")
    surface = DrawnSurface.of(mesh)
    assert math.isclose(area(surface, surface.points(mesh.points)), 10.0)
    assert len(surface.edges) == 20 and not len(surface.outline)
    mesh = lacmesh.join(generate.rectangle(1).only("body"), generate.line(1, (0, 2), (1, 2), "SEG3"))
    assert DrawnSurface.of(mesh).segments.tolist() == [[4, 6], [6, 5]]


@pytest.mark.parametrize(("parents", "edges"), [(None, 8), ([7, 7, 7, 7], 4), ([7, 7, 8, 8], 6)])
def test_children_of_a_cell_have_no_edges_between_them(parents, edges):
    points = [[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]]
    children = [("TRIA3", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])]
    data = {"lac_parent": parents} if parents else {}
    assert len(DrawnSurface.of(Mesh.create(points, children, cell_data=data)).edges) == edges


# ---- films: values, places, curves


def test_bodies_are_where_the_displacement_takes_them_and_have_its_values(plane):
    """Uniform uniaxial pressure in plane strain: von Mises s = p sqrt(1 - nu + nu^2), with sigma_zz = -nu p."""
    frames = read_frames(plane, "stress")
    first, last = frames.frames[0], frames.frames[-1]
    table = read_table(plane / "history.csv")
    top = first.x[: frames.surface.n_nodes, 1].max() - last.x[: frames.surface.n_nodes, 1].max()
    assert top == pytest.approx(table["probe.top.uy"][0] - table["probe.top.uy"][-1])
    expected = math.sqrt(1 - 0.3 + 0.3**2)
    assert np.nanmax(np.abs(last.value - expected)) < 1e-9 and frames.span == (0.0, pytest.approx(expected))
    frames = read_frames(plane, "pressure", 8)  # on the slave skin alone
    frame, valued = frames.frames[0], np.isfinite(frames.frames[0].value)
    assert 0 < valued.sum() < len(valued) / 2 and frame.value[valued] == pytest.approx(1 / 8)
    assert np.ptp(frame.x[valued, 1]) < 1e-9 and not valued[frames.surface.n_nodes :].any()


@pytest.mark.parametrize(("count", "times"), [(3, [1 / 8, 1 / 2, 1.0]), (1, [1.0]), (99, [k / 8 for k in range(1, 9)])])
def test_times_are_chosen_evenly_with_both_ends(plane, count, times):
    """Of two that are as near the first."""
    assert [frame.time for frame in read_frames(plane, "stress", count).frames] == pytest.approx(times)


def test_frames_of_a_mode_are_one_period(modes):
    frames = read_mode(modes, 2, 8)
    x = np.stack([frame.x for frame in frames.frames])
    still = lacmesh.read(modes / "fields" / "mode_0002.vtu").points
    moved = (x - frames.surface.points(still))[:, : len(still)]
    assert np.abs(moved[0] + moved[4]).max() < 1e-12 and np.abs(moved[2]).max() < 1e-12
    assert np.abs(moved[1] - np.sqrt(0.5) * moved[0]).max() < 1e-12
    assert np.linalg.norm(moved[0], axis=1).max() == pytest.approx(0.08 * 2.0)  # of the blocks' height
    assert frames.span == pytest.approx((0.0, 1.0), abs=1e-12)


def test_the_default_curve_is_one_that_moves_and_a_history_is_drawn(plane, tmp_path):
    still, moved, pushed = np.zeros(2), np.r_[0.0, -1], np.r_[0.0, 9]
    table = {"time": np.r_[0.5, 1], "reaction.a.x": still, "reaction.b.x": pushed, "probe.b.ux": moved}
    assert default_curve(table) == "probe.b.ux:reaction.b.x"
    assert default_curve({**table, "probe.b.ux": still}) == "time:reaction.b.x"
    assert default_curve({"time": np.r_[0.5, 1]}) == ""
    assert main(["plot", str(plane), "--history", "reaction.*", "-o", str(tmp_path / "h.png"), "-q"]) == 0
    panel = Panel("u", {"top": (np.r_[0.0, 1.0], moved)})
    one, three = (len(imread(io.BytesIO(draw_panels([panel] * count)))) for count in (1, 3))
    assert 2 * one < three < 3 * one  # a panel is as high with others as alone


@pytest.mark.parametrize(
    ("values", "log", "ends"),
    [
        ((5.0, 5 + 1e-15, np.nan), False, (0.0, 5 + 1e-15)),
        *(((-3.0, high), False, (-3.0, max(high, 0.0))) for high in (-2.0, 2.0)),
        ((np.nan,), False, (0.0, 1.0)),
        ((2.0, 7.0), True, (0.007, 7.0)),
        ((0.0,), True, (0.001, 1.0)),
    ],
)
def test_the_scale_has_zero_and_the_values_of_either_sign(values, log, ends):
    frame = Frame(0.0, np.zeros((len(values), 3)), np.array(values), "")
    scale = ColourScale("", **_ends(None, log, Frames(None, (frame,)).span))
    assert (scale.low, scale.high) == ends


@pytest.mark.parametrize(
    ("draw", "request_", "words"),
    [
        *((ls.plot, {"field": "presure"}, "did you mean"), (ls.plot, {"field": "slip"}, "with friction")),
        *((ls.plot, {"zone": ["jont"]}, "did you mean"), (ls.plot, {"time": 0.7}, "no fields were")),
        *((ls.plot, {"path": "p.jpg"}, "is written as"), (film, {"path": "f.avi"}, "is written as")),
        *((film, {"folder": "nowhere"}, "is no folder"), (film, {"curves": ["time"]}, "is no curve")),
        *((film, {"curves": ["time:reaction.top"]}, "has no column"), (film, {"colour": "red"}, "are coloured by")),
        (film, {"colour": "gap", "curves": ["time:time"]}, "has no curves"),
        *((film, {"frames": 0}, "at least one"), (film, {"rate": 0.0}, "more than 0")),
        *((film, {"scale": (2.0, 1.0)}, "low < high"), (film, {"scale": (0.0, 1.0), "log": True}, "0 < low")),
        *((film, {"mode": 6, "folder": "MODES"}, "modes 1 to"), (film, {"folder": "MODES"}, "name one of")),
        (film, {"mode": 1, "folder": "MODES", "curves": ["time:time"]}, "has no history"),
    ],
)  # fmt: skip
def test_what_is_not_there_or_makes_no_sense_is_one_sentence(plane, modes, tmp_path, draw, request_, words):
    given = {"folder": plane, "path": tmp_path / ("p.png" if draw is ls.plot else "f.gif"), **request_}
    given["folder"] = modes if given["folder"] == "MODES" else given["folder"]
    with pytest.raises(RequestError, match=words) as error:
        draw(**given)
    assert "\n" not in str(error.value) and not list(tmp_path.iterdir())


def test_a_folder_without_fields_contact_or_packages(plane, tmp_path, monkeypatch):
    (tmp_path / "history.csv").write_text("time,iterations\n1.0,2\n")
    with pytest.raises(RequestError, match="holds no fields"):
        film(tmp_path, tmp_path / "f.gif")
    (tmp_path / "mesh.npz").symlink_to(plane / "mesh.npz")
    written = load(plane / "state_0008.npz", Written)
    save(tmp_path / "state_0008.npz", written._replace(fields=replace(written.fields, zones={})))
    with pytest.raises(RequestError, match="holds no contact"):
        film(tmp_path, tmp_path / "f.gif", colour="pressure")
    film(tmp_path, tmp_path / "f.png", frames=1)  # without reactions there is no curve, and the bodies are drawn
    for text in ("", "time,a\n1.0\n", "time\nx\n"):
        (tmp_path / "history.csv").write_text(text)
        with pytest.raises(ReadError, match="is damaged"):
            film(tmp_path, tmp_path / "f.gif")
    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: None)
    with pytest.raises(RequestError, match="needs matplotlib; pip"):
        film(plane, tmp_path / "f.gif")


def stays(path):
    """For how long each picture of a film stays; no two after one another are the same."""
    from PIL import Image, ImageSequence

    with Image.open(path) as image:
        found = [(np.asarray(f.convert("RGB")), f.info.get("duration", 0)) for f in ImageSequence.Iterator(image)]
    assert all((found[k][0] != found[k + 1][0]).any() for k in range(len(found) - 1))
    return [duration for _, duration in found]


def test_a_film_stays_at_its_end_one_of_a_mode_goes_round_and_a_sheet_has_so_many_pictures(
    plane, modes, tmp_path, monkeypatch
):
    film(modes, tmp_path / "mode.gif", mode=3, frames=4, rate=10.0)
    assert stays(tmp_path / "mode.gif") == [100] * 4
    times, once = [], filming._draw_plane
    monkeypatch.setattr(
        filming, "_draw_plane", lambda axes, of, frame, *a: (times.append(frame.time), once(axes, of, frame, *a))
    )
    for name, count, options in (
        ("f.gif", 4, {"rate": 10.0, "frames": 4}),
        ("f.png", SHEET, {}),
        ("g.png", 2, {"frames": 2, "colour": "pressure", "log": True, "curves": ["time:-contact.joint.fy"]}),
    ):  # fmt: skip
        times.clear()
        film(plane, tmp_path / name, **options)
        assert len(times) == count and times[-1] == 1.0
        assert stays(tmp_path / name) == ([100] * 3 + [1500] if name == "f.gif" else [0])
    film(plane, tmp_path / "h.gif", colour="gap", frames=2)  # of the contact, zone by zone
    assert stays(tmp_path / "h.gif")[-1] == 1500
    film(plane, tmp_path / "h.png", colour="status", frames=3)


@pytest.mark.vtk
@pytest.mark.slow
def test_bodies_in_space_are_drawn_anew_each_time(pressed, tmp_path):
    film(pressed, tmp_path / "f.gif")
    film(pressed, tmp_path / "f.png", colour="pressure", camera=(0.0, 0.0, 1.0))
    assert len(stays(tmp_path / "f.gif")) == 2 and len(stays(tmp_path / "f.png")) == 1


def test_the_command_film(plane, tmp_path, capsys):
    target, case = tmp_path / "f.png", str(plane.with_suffix(".toml"))
    options = ["--curve=-probe.top.uy:-contact.joint.fy", "--scale", "0", "2", "--frames", "2"]
    assert main(["film", case, "-o", str(target), *options]) == 0
    assert capsys.readouterr().out.startswith(f"{target}: 0.0")
    before = target.read_bytes()
    assert main(["film", case, "-o", str(target)]) == 2
    assert "exists already" in capsys.readouterr().err and target.read_bytes() == before
    assert main(["film", str(plane), "-o", str(target), "--force", "-q", "--title", "pressed", "--frames", "1"]) == 0
    assert capsys.readouterr().out == "" and target.read_bytes() != before
