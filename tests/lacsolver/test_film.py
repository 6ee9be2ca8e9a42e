"""Films of a run and of a natural mode: what is visible, its colours, the curves, and the pictures themselves."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

import lacmesh
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshError, ReadError, RequestError
from lacsolver.cli import main
from lacsolver.output.tables import read_table
from lacsolver.pictures import filming, history
from lacsolver.pictures.filming import SHEET, _colour_scale, default_curve, film
from lacsolver.pictures.frames import DrawnSurface, Frame, Frames, read_frames, read_mode
from tests.lacsolver.bad_cases import GOOD, HEAVY, blocks, put
from tests.lacsolver.patch_meshes import stack
from tests.lacsolver.test_plot import SPACE, solved

STEPS = '[[probe]]\ngroup = "{}"\n[steps]\ncount = 8\n'


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    """Two blocks in the plane, pressed in eight steps: the folder of their results."""
    return solved(tmp_path_factory.mktemp("plane"), GOOD + STEPS.format("top"), blocks())


@pytest.fixture(scope="module")
def modes(tmp_path_factory):
    """Natural modes of two blocks in contact, one of which only contact supports."""
    folder = tmp_path_factory.mktemp("modes")
    put(blocks(), folder)
    (folder / "case.toml").write_text(HEAVY)
    assert main(["modes", str(folder / "case.toml"), "-k", "4", "-q"]) == 0
    return folder / "case_modes"


def pictures(path):
    """The pictures of a file, (height, width, 3) each, and for how long each stays."""
    from PIL import Image, ImageSequence

    with Image.open(path) as image:
        found = [(np.asarray(f.convert("RGB")), f.info.get("duration", 0)) for f in ImageSequence.Iterator(image)]
    return [picture for picture, _ in found], [stays for _, stays in found]


def least_change(frames):
    """The least number of pixels that change from one picture to the next."""
    return min((a != b).any(axis=2).sum() for a, b in pairwise(frames))


# ---- what is visible


def area(surface, x):
    corner = x[surface.triangles]
    return np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2


SIZES = {"TRIA": 0.5, "QUAD": 4.0, "TETRA": 1.5 + math.sqrt(3) / 2, "HEXA": 24.0}
KINDS = ["TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9", "TETRA4", "HEXA8", "HEXA20", "HEXA27"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_plane_cell_or_the_skin_of_a_solid_is_covered(kind):
    cell = CELLS[kind]
    mesh = Mesh.create(np.array(cell.reference), [(kind, [list(range(cell.n_nodes))])])
    surface = DrawnSurface.of(mesh)
    assert math.isclose(area(surface, surface.points(mesh.points)), SIZES[cell.family])
    assert cell.dim == 3 or len(surface.edges) == len(surface.outline) == len(surface.triangles)


def test_faces_between_solids_are_not_in_sight_and_a_bare_skin_is():
    points = np.stack(np.meshgrid([0.0, 1], [0.0, 1], [0.0, 1, 2], indexing="ij"), axis=-1).reshape(-1, 3)
    lower = [0, 6, 9, 3, 1, 7, 10, 4]
    surface = DrawnSurface.of(Mesh.create(points, [("HEXA8", [lower, [n + 1 for n in lower]])]))
    assert math.isclose(area(surface, surface.points(points)), 10.0)
    assert len(surface.edges) == 20 and not len(surface.outline)
    points = [[0.0, 0], [1, 0], [1, 1], [0, 1], [0, 2], [1, 2], [0.5, 2]]
    mesh = Mesh.create(points, [("QUAD4", [[0, 1, 2, 3]]), ("SEG3", [[4, 5, 6]])])
    assert DrawnSurface.of(mesh).segments.tolist() == [[4, 6], [6, 5]]


@pytest.mark.parametrize(("parents", "edges"), [(None, 8), ([7, 7, 7, 7], 4), ([7, 7, 8, 8], 6)])
def test_children_of_a_cell_have_no_edges_between_them(parents, edges):
    points = [[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]]
    children = [("TRIA3", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])]
    data = {"lac_parent": parents} if parents else {}
    assert len(DrawnSurface.of(Mesh.create(points, children, cell_data=data)).edges) == edges


# ---- values and places


def test_bodies_are_where_the_displacement_takes_them_and_the_stress_is_von_mises(plane):
    """Uniform uniaxial pressure in plane strain: s = p sqrt(1 - nu + nu^2), with sigma_zz = -nu p."""
    frames = read_frames(plane, "stress")
    assert [round(frame.time, 9) for frame in frames.frames] == [k / 8 for k in range(1, 9)]
    first, last = frames.frames[0], frames.frames[-1]
    table = read_table(plane / "history.csv")
    top = first.x[: frames.surface.n_nodes, 1].max() - last.x[: frames.surface.n_nodes, 1].max()
    assert top == pytest.approx(table["probe.top.uy"][0] - table["probe.top.uy"][-1])
    expected = math.sqrt(1 - 0.3 + 0.3**2)
    assert np.nanmax(np.abs(last.value - expected)) < 1e-9 and frames.span == (0.0, pytest.approx(expected))


def test_pressure_is_on_the_slave_skin_alone(plane):
    frames = read_frames(plane, "pressure", 8)
    frame, surface = frames.frames[0], frames.surface
    valued = np.isfinite(frame.value)
    assert 0 < valued.sum() < len(valued) / 2 and frame.value[valued] == pytest.approx(1 / 8)
    assert np.ptp(frame.x[valued, 1]) < 1e-9 and not valued[surface.n_nodes :].any()


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


# ---- curves


@pytest.mark.parametrize(("column", "widths"), [("energy.total", [5e-6]), ("energy.*", [])])
def test_a_curve_of_round_off_is_level_and_the_default_is_one_that_moves(tmp_path, monkeypatch, column, widths):
    from matplotlib.axes import Axes

    widened, once = [], Axes.set_ylim
    monkeypatch.setattr(Axes, "set_ylim", lambda axes, *ends, **more: (widened.append(ends), once(axes, *ends, **more)))
    table = {"time": np.arange(3.0), "energy.total": 5 + 1e-14 * np.arange(3), "energy.kinetic": np.arange(3.0)}
    monkeypatch.setattr(history, "read_table", lambda path: table)
    history.plot_history(tmp_path, tmp_path / "h.png", [column])
    assert [ends[1] - ends[0] for ends in widened if len(ends) == 2] == pytest.approx(widths)
    still, moved, pushed = np.zeros(2), np.r_[0.0, -1], np.r_[0.0, 9]
    table = {"time": np.r_[0.5, 1], "reaction.a.x": still, "reaction.b.x": pushed, "probe.b.ux": moved}
    assert default_curve(table) == "probe.b.ux:reaction.b.x"
    assert default_curve({**table, "probe.b.ux": still}) == "time:reaction.b.x"
    assert default_curve({"time": np.r_[0.5, 1]}) == ""


# ---- refused


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"path": "f.avi"}, "is written as"),
        ({"folder": "nowhere"}, "is no folder"),
        ({"curves": ["time"]}, "is no curve"),
        ({"curves": ["time:reaction.top"]}, "has no column"),
        ({"colour": "red"}, "are coloured by"),
        ({"colour": "gap", "curves": ["time:time"]}, "has no curves"),
        ({"frames": 0}, "at least one"),
        ({"rate": 0.0}, "more than 0"),
        ({"scale": (2.0, 1.0)}, "low < high"),
        ({"scale": (0.0, 1.0), "log": True}, "0 < low"),
        ({"mode": 6, "folder": "MODES"}, "modes 1 to"),
        ({"folder": "MODES"}, "name one of"),
        ({"mode": 1, "folder": "MODES", "curves": ["time:time"]}, "has no history"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(plane, modes, tmp_path, request_, words):
    given = {"folder": plane, "path": tmp_path / "f.gif", **request_}
    given["folder"] = modes if given["folder"] == "MODES" else given["folder"]
    with pytest.raises(RequestError, match=words) as error:
        film(**given)
    assert "\n" not in str(error.value) and not (tmp_path / "f.gif").exists()


def test_a_folder_without_fields_contact_or_packages(plane, tmp_path, monkeypatch):
    (tmp_path / "history.csv").write_text("time,iterations\n1.0,2\n")
    with pytest.raises(RequestError, match="holds no fields"):
        film(tmp_path, tmp_path / "f.gif")
    (tmp_path / "fields").symlink_to(plane / "fields")
    (tmp_path / "solid.pvd").write_bytes((plane / "solid.pvd").read_bytes())
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


# ---- pictures


def test_a_film_has_a_picture_each_time_in_one_scale_of_colours_and_stays_at_the_end(plane, tmp_path):
    """The middle of a body, whose stress grows from a quarter to all: from light to the darkest."""
    film(plane, tmp_path / "f.gif", rate=10.0, frames=4)
    frames, stays = pictures(tmp_path / "f.gif")
    assert len(frames) == 4 and stays == [100] * 3 + [1500] and least_change(frames) > 500
    high, wide, _ = frames[0].shape
    middle = [np.median(frame[high // 3 : high // 2, wide // 5 : 2 * wide // 5].sum(axis=2)) for frame in frames]
    assert all(np.diff(middle) < 0) and middle[0] > 450 and middle[-1] < 150


def test_a_film_of_a_mode_goes_round_without_a_stop_and_one_of_the_contact_zone_by_zone(modes, plane, tmp_path):
    film(modes, tmp_path / "mode.gif", mode=3, frames=4, rate=10.0)
    frames, stays = pictures(tmp_path / "mode.gif")
    assert stays == [100] * 4 and least_change(frames) > 500
    film(plane, tmp_path / "f.gif", colour="gap", frames=2)
    frames, stays = pictures(tmp_path / "f.gif")
    assert len(frames) == 2 and stays[-1] == 1500 and least_change(frames) > 20  # the time, and the model
    film(plane, tmp_path / "f.png", colour="status", frames=3)
    (sheet,), _ = pictures(tmp_path / "f.png")
    assert sheet.shape[0] == 2 * frames[0].shape[0] and abs(sheet.shape[1] - 2 * frames[0].shape[1]) <= 2


@pytest.mark.parametrize(
    ("values", "log", "ends"),
    [
        ((5.0, 5 + 1e-15, np.nan), False, (0.0, 5 + 1e-15)),
        ((-3.0, -2.0), False, (-3.0, 0.0)),
        ((-3.0, 2.0), False, (-3.0, 2.0)),
        ((np.nan,), False, (0.0, 1.0)),
        ((2.0, 7.0), True, (0.007, 7.0)),
        ((0.0,), True, (0.001, 1.0)),
    ],
)
def test_the_scale_has_zero_and_the_values_of_either_sign(values, log, ends):
    frame = Frame(0.0, np.zeros((len(values), 3)), np.array(values), "")
    scale = _colour_scale(Frames(None, (frame,)), "pressure", None, log)
    assert (scale.low, scale.high) == ends


def test_a_sheet_has_so_many_pictures(plane, tmp_path, monkeypatch):
    times, once = [], filming._draw_plane
    monkeypatch.setattr(
        filming, "_draw_plane", lambda axes, of, frame, *a: (times.append(frame.time), once(axes, of, frame, *a))
    )
    film(plane, tmp_path / "f.png")
    assert len(times) == SHEET and times[-1] == 1.0 and len(pictures(tmp_path / "f.png")[0]) == 1
    curves = ["time:-contact.joint.fy", "time:time"]
    film(plane, tmp_path / "g.png", frames=2, colour="pressure", log=True, curves=curves)
    assert len(times) == SHEET + 2


@pytest.mark.vtk
@pytest.mark.slow
def test_bodies_in_space_are_drawn_anew_each_time(tmp_path):
    space = solved(tmp_path, SPACE + "[steps]\ncount = 2\n", stack("HEXA8", "TETRA4", 3, counts=(3, 2)))
    film(space, tmp_path / "f.gif")
    frames, _ = pictures(tmp_path / "f.gif")
    assert len(frames) == 2 and least_change([frame[:, : frame.shape[1] // 2] for frame in frames]) > 2000
    film(space, tmp_path / "f.png", colour="pressure", camera=(0.0, 0.0, 1.0))
    assert len(pictures(tmp_path / "f.png")[0]) == 1


@pytest.mark.vtk
def test_where_nothing_can_be_drawn(tmp_path, monkeypatch):
    space = solved(tmp_path, SPACE, stack("HEXA8", "TETRA4", 3, counts=(1, 1)))
    monkeypatch.setattr("lacmesh.view.offscreen.windows", lambda: iter(()))
    with pytest.raises(LacmeshError, match="nothing can be"):
        film(space, tmp_path / "f.gif")
    assert not (tmp_path / "f.gif").exists()


def test_the_command(plane, tmp_path, capsys):
    target, case = tmp_path / "f.png", str(plane.with_suffix(".toml"))
    options = ["--curve=-probe.top.uy:-contact.joint.fy", "--scale", "0", "2", "--frames", "2"]
    assert main(["film", case, "-o", str(target), *options]) == 0
    assert capsys.readouterr().out.startswith(f"{target}: 0.0")
    before = target.read_bytes()
    assert main(["film", case, "-o", str(target)]) == 2
    assert "exists already" in capsys.readouterr().err and target.read_bytes() == before
    assert main(["film", str(plane), "-o", str(target), "--force", "-q", "--title", "pressed", "--frames", "1"]) == 0
    assert capsys.readouterr().out == "" and target.read_bytes() != before
