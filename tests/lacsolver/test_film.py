"""Films of a run: what is visible, its colours, the curves, and the pictures themselves."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import LacmeshError, ReadError, RequestError
from lacsolver.cli import main
from lacsolver.output.tables import read_table
from lacsolver.pictures import history
from lacsolver.pictures.filming import SHEET, _colour_scale, default_curve, film
from lacsolver.pictures.frames import DrawnSurface, Frame, Frames, read_frames
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.patch_meshes import stack

STEPS = '[[probe]]\ngroup = "{}"\n[steps]\ncount = 8\n'


def run(folder, text, mesh):
    put(mesh, folder)
    (folder / "case.toml").write_text(text)
    assert main(["run", str(folder / "case.toml"), "-q"]) == 0
    return folder / "case"


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    """Two blocks in the plane, pressed in eight steps: the folder of their results."""
    return run(tmp_path_factory.mktemp("plane"), GOOD + STEPS.format("top"), blocks())


@pytest.fixture(scope="module")
def space(tmp_path_factory):
    """Two blocks in space."""
    text = (
        GOOD.replace("plane_strain", "3d")
        .replace("uy = 0.0", "uz = 0.0")
        .replace("value = 1.0", 'value = "t * (1 + x)"')
    )
    text += '[[displacement]]\ngroup = "y0"\nuy = 0.0\n[steps]\ncount = 2\n'
    return run(tmp_path_factory.mktemp("space"), text, stack("HEXA8", "TETRA4", 3, counts=(3, 2)))


def pictures(path):
    """The pictures of a file, (height, width, 3) each, and for how long each stays."""
    from PIL import Image, ImageSequence

    with Image.open(path) as image:
        found = [(np.asarray(f.convert("RGB")), f.info.get("duration", 0)) for f in ImageSequence.Iterator(image)]
    return [picture for picture, _ in found], [stays for _, stays in found]


# ---- what is visible


def area(surface, x):
    corner = x[surface.triangles]
    return np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2


@pytest.mark.parametrize("kind", ["TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9"])
def test_a_plane_cell_is_covered(kind):
    cell = CELLS[kind]
    mesh = Mesh.create(np.array(cell.reference), [(kind, [list(range(cell.n_nodes))])])
    surface = DrawnSurface.of(mesh)
    assert math.isclose(area(surface, surface.points(mesh.points)), 0.5 if cell.family == "TRIA" else 4.0)
    assert len(surface.edges) == len(surface.outline) == len(surface.triangles)


@pytest.mark.parametrize(
    "kind, expected", [("TETRA4", 1.5 + math.sqrt(3) / 2), ("HEXA8", 24.0), ("HEXA20", 24.0), ("HEXA27", 24.0)]
)
def test_the_skin_of_a_solid_is_covered(kind, expected):
    cell = CELLS[kind]
    mesh = Mesh.create(np.array(cell.reference), [(kind, [list(range(cell.n_nodes))])])
    surface = DrawnSurface.of(mesh)
    assert math.isclose(area(surface, surface.points(mesh.points)), expected)


def test_faces_between_solids_are_not_in_sight():
    points = np.stack(np.meshgrid([0.0, 1], [0.0, 1], [0.0, 1, 2], indexing="ij"), axis=-1).reshape(-1, 3)
    lower = [0, 6, 9, 3, 1, 7, 10, 4]
    surface = DrawnSurface.of(Mesh.create(points, [("HEXA8", [lower, [n + 1 for n in lower]])]))
    assert math.isclose(area(surface, surface.points(points)), 10.0)
    assert len(surface.edges) == 20 and not len(surface.outline)


def test_children_of_a_cell_have_no_edges_between_them():
    points = [[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]]
    children = [("TRIA3", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])]
    assert len(DrawnSurface.of(Mesh.create(points, children)).edges) == 8
    assert len(DrawnSurface.of(Mesh.create(points, children, cell_data={"lac_parent": [7, 7, 7, 7]})).edges) == 4
    assert len(DrawnSurface.of(Mesh.create(points, children, cell_data={"lac_parent": [7, 7, 8, 8]})).edges) == 6


def test_a_bare_skin_is_seen_beside_the_body():
    points = [[0.0, 0], [1, 0], [1, 1], [0, 1], [0, 2], [1, 2], [0.5, 2]]
    mesh = Mesh.create(points, [("QUAD4", [[0, 1, 2, 3]]), ("SEG3", [[4, 5, 6]])])
    assert DrawnSurface.of(mesh).segments.tolist() == [[4, 6], [6, 5]]


# ---- values and places


def test_bodies_are_where_the_displacement_takes_them(plane):
    frames = read_frames(plane, "stress")
    assert [round(frame.time, 9) for frame in frames.frames] == [k / 8 for k in range(1, 9)]
    first, last = frames.frames[0], frames.frames[-1]
    table = read_table(plane / "history.csv")
    top = first.x[: frames.surface.n_nodes, 1].max() - last.x[: frames.surface.n_nodes, 1].max()
    assert top == pytest.approx(table["probe.top.uy"][0] - table["probe.top.uy"][-1])


def test_the_stress_is_von_mises(plane):
    """Uniform uniaxial pressure in plane strain: s = p sqrt(1 - nu + nu^2), with sigma_zz = -nu p."""
    frames = read_frames(plane, "stress")
    expected = math.sqrt(1 - 0.3 + 0.3**2)
    assert np.nanmax(np.abs(frames.frames[-1].value - expected)) < 1e-9
    assert frames.span == (0.0, pytest.approx(expected))


def test_pressure_is_on_the_slave_skin_alone(plane):
    frames = read_frames(plane, "pressure", 8)
    frame, surface = frames.frames[0], frames.surface
    valued = np.isfinite(frame.value)
    assert 0 < valued.sum() < len(valued) / 2
    assert frame.value[valued] == pytest.approx(1 / 8)
    assert np.ptp(frame.x[valued, 1]) < 1e-9 and not valued[surface.n_nodes :].any()


def test_times_are_chosen_evenly_with_both_ends(plane):
    assert [frame.time for frame in read_frames(plane, "stress", 3).frames] == [
        1 / 8,
        1 / 2,
        1.0,
    ]  # of two as near the first
    assert [frame.time for frame in read_frames(plane, "stress", 1).frames] == [1.0]
    assert len(read_frames(plane, "stress", 99).frames) == 8


# ---- curves


def test_the_default_curve():
    still, moved, pushed = np.zeros(2), np.r_[0.0, -1], np.r_[0.0, 9]
    table = {"time": np.r_[0.5, 1], "reaction.a.x": still, "reaction.b.x": pushed, "probe.b.ux": moved}
    assert default_curve(table) == "probe.b.ux:reaction.b.x"
    assert default_curve({**table, "probe.b.ux": still}) == "time:reaction.b.x"
    assert default_curve({"time": np.r_[0.5, 1]}) == ""


@pytest.mark.parametrize(
    "request_, said",
    [
        ({"path": "f.avi"}, "f.avi: a film is written as .gif, a sheet of its pictures as .png"),
        ({"folder": "nowhere"}, "nowhere is no folder; name the one that lacsolver run wrote"),
        ({"curves": ["time"]}, "'time' is no curve; write two columns of history.csv as time:reaction.GROUP.y"),
        ({"curves": ["time:reaction.top"]}, "history.csv has no column 'reaction.top'"),
        (
            {"colour": "red"},
            "bodies are coloured by stress or pressure, and zones by recovered or gap or status or slip",
        ),
        ({"frames": 0}, "a film has at least one frame, not 0"),
        ({"rate": 0.0}, "a film shows more than 0 and at most 100 pictures a second, not 0"),
        ({"scale": (2.0, 1.0)}, "a scale of colours from 2 to 1 is none; it needs low < high"),
        ({"scale": (0.0, 1.0), "log": True}, "a scale of colours from 0 to 1 is none; it needs 0 < low < high"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(plane, tmp_path, request_, said):
    given = {"folder": plane, "path": tmp_path / "f.gif", **request_}
    with pytest.raises(RequestError) as error:
        film(**given)
    assert str(error.value).startswith(said) and "\n" not in str(error.value)
    assert not (tmp_path / "f.gif").exists()


def test_a_folder_without_fields_or_contact(plane, tmp_path):
    (tmp_path / "history.csv").write_text("time,iterations\n1.0,2\n")
    with pytest.raises(RequestError, match="holds no fields to film"):
        film(tmp_path, tmp_path / "f.gif")
    (tmp_path / "fields").symlink_to(plane / "fields")
    (tmp_path / "solid.pvd").write_bytes((plane / "solid.pvd").read_bytes())
    with pytest.raises(RequestError, match="holds no contact to colour by"):
        film(tmp_path, tmp_path / "f.gif", colour="pressure")
    film(tmp_path, tmp_path / "f.png", frames=1)  # without reactions there is no curve, and the bodies are drawn


@pytest.mark.parametrize("text", ["", "time,a\n1.0\n", "time\nx\n"])
def test_a_damaged_history(plane, tmp_path, text):
    (tmp_path / "history.csv").write_text(text)
    with pytest.raises(ReadError, match=r"history\.csv: is damaged"):
        film(tmp_path, tmp_path / "f.gif")


def test_a_missing_package_is_said(plane, tmp_path, monkeypatch):
    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: None)
    with pytest.raises(RequestError, match="a film needs matplotlib; pip install"):
        film(plane, tmp_path / "f.gif")


# ---- pictures


@pytest.fixture(scope="module")
def filmed(plane, tmp_path_factory):
    """The pictures of a film of the run in the plane at four times, and for how long each stays."""
    path = tmp_path_factory.mktemp("film") / "f.gif"
    film(plane, path, rate=10.0, frames=4)
    return pictures(path)


def test_a_film_has_a_picture_each_time_and_stays_at_the_end(filmed):
    frames, stays = filmed
    assert len(frames) == 4 and stays == [100] * 3 + [1500]
    assert all((a != b).any(axis=2).sum() > 500 for a, b in pairwise(frames))


def test_the_scale_has_zero_and_the_values_of_either_sign():
    def ends(*values, log=False):
        frame = Frame(0.0, np.zeros((len(values), 3)), np.array(values), "")
        scale = _colour_scale(Frames(None, (frame,)), "pressure", None, log)
        return scale.low, scale.high

    assert ends(5.0, 5 + 1e-15, np.nan) == (0.0, 5 + 1e-15)
    assert ends(-3.0, -2.0) == (-3.0, 0.0) and ends(-3.0, 2.0) == (-3.0, 2.0)
    assert ends(0.0, 0.0) == ends(np.nan) == (0.0, 1.0)
    assert ends(2.0, 7.0, log=True) == (0.007, 7.0) and ends(0.0, log=True) == (0.001, 1.0)


def test_a_curve_of_round_off_is_level(space, tmp_path, monkeypatch):
    from matplotlib.axes import Axes

    widened, once = [], Axes.set_ylim
    monkeypatch.setattr(Axes, "set_ylim", lambda axes, *ends, **more: (widened.append(ends), once(axes, *ends, **more)))
    table = {"time": np.arange(3.0), "energy.total": 5 + 1e-14 * np.arange(3), "energy.kinetic": np.arange(3.0)}
    monkeypatch.setattr(history, "read_table", lambda path: table)
    history.plot_history(space, tmp_path / "h.png", ["energy.total"])
    assert [high - low for low, high in (ends for ends in widened if len(ends) == 2)] == [pytest.approx(5e-6)]
    widened.clear()
    history.plot_history(space, tmp_path / "h.png", ["energy.*"])
    assert not [ends for ends in widened if len(ends) == 2]  # as matplotlib chooses it


def test_one_scale_of_colours_for_all_times(filmed):
    """The middle of a body, whose stress grows from an eighth to all: from light to the darkest."""
    frames, _ = filmed
    high, wide, _ = frames[0].shape
    middle = [np.median(frame[high // 3 : high // 2, wide // 5 : 2 * wide // 5].sum(axis=2)) for frame in frames]
    assert all(np.diff(middle) < 0) and middle[0] > 450 and middle[-1] < 150


def test_a_sheet_has_so_many_pictures(plane, tmp_path, monkeypatch):
    from lacsolver.pictures import filming

    drawn = []
    once = filming._draw_plane
    monkeypatch.setattr(
        filming,
        "_draw_plane",
        lambda axes, surface, frame, scale: (drawn.append(frame.time), once(axes, surface, frame, scale)),
    )
    film(plane, tmp_path / "f.png")
    assert len(drawn) == SHEET and drawn[-1] == 1.0 and len(pictures(tmp_path / "f.png")[0]) == 1
    film(
        plane, tmp_path / "g.png", frames=2, colour="pressure", log=True, curves=["time:-contact.joint.fy", "time:time"]
    )
    assert len(drawn) == SHEET + 2


@pytest.mark.vtk
@pytest.mark.slow
def test_bodies_in_space_are_drawn_anew_each_time(space, tmp_path):
    film(space, tmp_path / "f.gif")
    frames, _ = pictures(tmp_path / "f.gif")
    left = [frame[:, : frame.shape[1] // 2].astype(int) for frame in frames]
    assert len(frames) == 2
    assert all((np.abs(a - b).sum(axis=2) > 30).sum() > 2000 for a, b in pairwise(left))
    film(space, tmp_path / "f.png", colour="pressure", camera=(0.0, 0.0, 1.0))
    assert len(pictures(tmp_path / "f.png")[0]) == 1


@pytest.mark.vtk
def test_where_nothing_can_be_drawn(space, tmp_path, monkeypatch):
    monkeypatch.setattr("lacmesh.view.offscreen.windows", lambda: iter(()))
    with pytest.raises(LacmeshError, match="nothing can be drawn here"):
        film(space, tmp_path / "f.gif")
    assert not (tmp_path / "f.gif").exists()


# ---- the command


def test_the_command(plane, tmp_path, capsys):
    target = tmp_path / "f.png"
    case = str(plane.with_suffix(".toml"))
    assert (
        main(
            [
                "film",
                case,
                "-o",
                str(target),
                "--curve=-probe.top.uy:-contact.joint.fy",
                "--scale",
                "0",
                "2",
                "--frames",
                "2",
            ]
        )
        == 0
    )
    assert capsys.readouterr().out.startswith(f"{target}: 0.0")
    before = target.read_bytes()
    assert main(["film", case, "-o", str(target)]) == 2
    assert "exists already; --force replaces it" in capsys.readouterr().err and target.read_bytes() == before
    assert main(["film", str(plane), "-o", str(target), "--force", "-q", "--title", "pressed", "--frames", "1"]) == 0
    assert capsys.readouterr().out == "" and target.read_bytes() != before
    assert main(["film", str(tmp_path / "none.toml"), "-o", str(target), "--force"]) == 2
    assert "is no folder; name the one that lacsolver run wrote" in capsys.readouterr().err


def test_a_field_of_the_contact_is_filmed_zone_by_zone(plane, tmp_path):
    film(plane, tmp_path / "f.gif", colour="gap", frames=2)
    frames, stays = pictures(tmp_path / "f.gif")
    assert len(frames) == 2 and stays[-1] == 1500
    assert all((a != b).any(axis=2).sum() > 20 for a, b in pairwise(frames))  # the time, and the model
    film(plane, tmp_path / "f.png", colour="status", frames=3)
    (sheet,), _ = pictures(tmp_path / "f.png")
    assert sheet.shape[0] == 2 * frames[0].shape[0] and abs(sheet.shape[1] - 2 * frames[0].shape[1]) <= 2
    with pytest.raises(RequestError, match="has no curves"):
        film(plane, tmp_path / "g.gif", colour="gap", curves=["time:time"])
