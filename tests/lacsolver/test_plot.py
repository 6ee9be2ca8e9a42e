"""The picture of the contact pressure: what it is made of, and that it is drawn."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lacmesh import Mesh
from lacmesh.errors import RequestError, WriteError
from lacmesh.scene.colours import BODIES, on_ramp, rgb
from lacsolver import plot, read_case
from lacsolver.cli import main
from lacsolver.contact import Zone
from lacsolver.output import read_state
from lacsolver.pictures.drawing import Skin, along, chains, magnification, pressed_span, pressed_window
from lacsolver.problem.skin import prepared
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.patch_meshes import stack
from tests.viewing import DATA, tones

DISC = GOOD.replace("blocks.msh", "disc_on_block.msh").replace('"x0"', '"symmetry_x"').replace("1.0\n", "25.0\n")


def module():
    """The module, whose name the function has."""
    return sys.modules["lacsolver.pictures.drawing"]


def solved(folder, text=GOOD, mesh=None):
    """The case, and the last state of its run."""
    if mesh is not None:
        put(mesh, folder)
    (folder / "case.toml").write_text(text)
    assert main(["run", str(folder / "case.toml"), "-q", "--force"]) == 0
    case = read_case(folder / "case.toml")
    return case, read_state(folder / "case", case)


def size(path):
    """Width and height of a PNG file, which is whole."""
    from PIL import Image

    with Image.open(path) as image:
        image.load()
        return image.size


# ---- in the plane


@pytest.fixture
def disc(tmp_path):
    """The disc on its block, pressed: some macro-elements in contact, most not."""
    (tmp_path / "disc_on_block.msh").write_bytes((DATA / "disc_on_block.msh").read_bytes())
    return solved(tmp_path, DISC)


def test_a_plane_model_is_drawn(disc, tmp_path):
    case, state = disc
    plot(case, state, tmp_path / "p.png")
    assert size(tmp_path / "p.png") == (1300, 1300)
    highest, none = tones(tmp_path / "p.png", "fde725", "440154")  # the ends of viridis
    assert highest > 300 and none > 300


def test_the_profile_is_the_pressure_along_the_skin(disc):
    case, state = disc
    zone = Zone.of(prepared(case), "slave", "master", "joint")
    p = state.multipliers["joint"]
    s, drawn = along(Skin(zone, p[zone.macro]), zone.slave.x)
    x = zone.slave.x[zone.slave.faces.nodes[:, :2]]
    whole = np.linalg.norm(x[:, 1] - x[:, 0], axis=1).sum()
    assert not np.isnan(s).any() and s[0] == 0.0 and math.isclose(s[-1], whole) and (np.diff(s) >= 0).all()
    length = np.bincount(zone.macro, np.linalg.norm(x[:, 1] - x[:, 0], axis=1))
    assert np.sum(np.diff(s)[::2] * drawn[::2]) == pytest.approx(p @ length)
    assert drawn.max() == p.max() > 0 and drawn.min() == 0.0
    begins, ends = drawn[0], drawn[-1]
    assert max(begins, ends) > 0.5 * p.max() and min(begins, ends) == 0.0  # pressed at one end of the arc


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


@pytest.mark.parametrize(("pressure", "place"), [(5.0, 1.0), (0.0, 0.0), (-3.0, 0.0)])
def test_a_uniform_pressure_has_one_colour_in_the_plane(disc, tmp_path, monkeypatch, pressure, place):
    case, state = disc
    p = pressure * (1 + 1e-15 * np.arange(len(state.multipliers["joint"])))
    drawn, lines = [], module()._lines
    monkeypatch.setattr(module(), "_lines", lambda pieces, **style: drawn.append(lines(pieces, **style)) or drawn[-1])
    plot(case, replace(state, multipliers={"joint": p}), tmp_path / "p.png")
    np.testing.assert_allclose(np.asarray(drawn[-1].norm(p)), place, rtol=0, atol=1e-9)


# ---- in space


@pytest.fixture
def pressed(tmp_path):
    """Two blocks in space, pressed unevenly."""
    mesh = stack("HEXA8", "TETRA4", 3, counts=(3, 2))
    text = GOOD.replace("plane_strain", "3d").replace("uy = 0.0", "uz = 0.0")
    text = text.replace("value = 1.0", 'value = "1 + x"')
    return solved(tmp_path, text + '[[displacement]]\ngroup = "y0"\nuy = 0.0\n', mesh)


def test_values_are_those_of_the_slave_faces_alone(pressed, tmp_path, monkeypatch):
    case, state = pressed
    given = {}

    def caught(mesh, path, **options):
        given.update(options, mesh=mesh)

    monkeypatch.setattr(module(), "picture", caught)
    plot(case, state, tmp_path / "p.png")
    faces, values = given["mesh"], given["values"]
    slave = faces.cell_groups["slave"]
    assert np.isfinite(values.values).sum() == len(slave)
    whole = prepared(case)
    zone = Zone.of(whole, "slave", "master", "joint")
    drawn = faces.cell_data["lac_macro"][slave]
    number = {int(m): p for m, p in zip(zone.number, state.multipliers["joint"], strict=True)}
    assert [number[int(m)] for m in drawn] == values.values[slave].tolist()
    assert 0 < min(number.values()) < max(number.values())
    assert (values.bad, values.good) == (0.0, max(number.values()))
    times = magnification(whole, state.u.reshape(-1, 3))
    assert f"displacement x {times:g}" in given["title"] and times > 1
    assert np.allclose(faces.points, whole.points + times * state.u.reshape(-1, 3), rtol=0, atol=1e-15)


@pytest.mark.vtk
def test_a_model_in_space_is_drawn(pressed, tmp_path):
    case, state = pressed
    plot(case, state, tmp_path / "p.png")
    assert size(tmp_path / "p.png") == (1600, 1000)
    assert min(tones(tmp_path / "p.png", "34489b", "56b4b8")) > 300


@pytest.mark.vtk
def test_where_nothing_can_be_drawn(pressed, tmp_path, monkeypatch):
    case, state = pressed
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "nothing")
    monkeypatch.setattr("lacmesh.view.offscreen.WINDOWS", ())
    monkeypatch.setattr(
        "lacmesh.view.offscreen.draw_in_subprocess", lambda *a: __import__("subprocess").CompletedProcess([], 1, "", "")
    )
    with pytest.raises(WriteError, match="nothing can be drawn here"):
        plot(case, state, tmp_path / "p.png")
    assert not (tmp_path / "p.png").exists()


def test_a_uniform_pressure_has_one_colour(tmp_path, monkeypatch):
    text = GOOD.replace("plane_strain", "3d").replace("uy = 0.0", "uz = 0.0").replace("value = 1.0", "value = 5.0")
    case, state = solved(
        tmp_path, text + '[[displacement]]\ngroup = "y0"\nuy = 0.0\n', stack("HEXA8", "TETRA4", 3, counts=(3, 2))
    )
    given = []
    monkeypatch.setattr(module(), "picture", lambda mesh, path, **options: given.append(options["values"]))
    plot(case, state, tmp_path / "p.png")
    plot(case, replace(state, multipliers={"joint": 0 * state.multipliers["joint"]}), tmp_path / "p.png")
    for values, ends in zip(given, ((0.0, pytest.approx(5.0)), (0.0, 1.0)), strict=True):
        assert (values.bad, values.good) == ends
        known = np.isfinite(values.values)
        found = on_ramp(values.values, values.bad, values.good)
        assert 0 < known.sum() < len(known) and np.ptp(found[known].astype(int), axis=0).max() <= 1
        assert np.array_equal(np.unique(found[~known], axis=0), rgb(BODIES[:1]))


# ---- zoomed


def test_a_zoomed_picture_shows_the_surroundings_of_the_contact(disc, tmp_path):
    case, state = disc
    zone = Zone.of(prepared(case), "slave", "master", "joint")
    skin = Skin(zone, state.multipliers["joint"][zone.macro])
    pressed = skin.zone.slave.x[np.unique(skin.zone.slave.faces.nodes[skin.pressure > 0, :2])]
    low, high = pressed_window([skin], zone.slave.x)
    assert (low < pressed.min(axis=0)).all() and (high > pressed.max(axis=0)).all()
    assert (high - low).max() == pytest.approx(2 * np.ptp(pressed, axis=0).max())
    begin, end = pressed_span([skin], zone.slave.x)
    s, p = along(skin, zone.slave.x)
    assert begin <= s[p > 0].min() and s[p > 0].max() < end < s[-1]
    plot(case, state, tmp_path / "whole.png")
    plot(case, state, tmp_path / "zoomed.png", zoom=True)
    assert size(tmp_path / "zoomed.png") == size(tmp_path / "whole.png")
    assert tones(tmp_path / "zoomed.png", "fde725")[0] > 1.3 * tones(tmp_path / "whole.png", "fde725")[0]


def test_without_pressure_a_zoomed_picture_shows_everything(disc):
    case, _ = disc
    zone = Zone.of(prepared(case), "slave", "master", "joint")
    assert pressed_window([Skin(zone, np.zeros(len(zone.macro)))], zone.slave.x) is None


def test_a_zoomed_picture_in_space_has_the_faces_near_the_contact(pressed, tmp_path, monkeypatch):
    case, state = pressed
    drawn = []
    monkeypatch.setattr(module(), "picture", lambda mesh, path, **options: drawn.append((mesh, options)))
    monkeypatch.setattr(module(), "_MARGIN", 0.1)
    plot(case, state, tmp_path / "p.png")
    plot(case, state, tmp_path / "p.png", zoom=True)
    (whole, _), (near, options) = drawn
    assert 0 < near.n_cells < whole.n_cells and "to scale" in options["title"]
    assert (
        len(near.cell_groups["slave"]) == len(whole.cell_groups["slave"]) == np.isfinite(options["values"].values).sum()
    )


def test_zoom_needs_a_plot(tmp_path, capsys):
    (tmp_path / "case.toml").write_text(GOOD)
    assert main(["run", str(tmp_path / "case.toml"), "--zoom"]) == 2
    assert "--plot" in capsys.readouterr().err


# ---- the request


@pytest.mark.parametrize("model, package", [("3d", "pyvista"), ("plane_strain", "matplotlib")])
def test_a_missing_package_is_said_before_anything_is_solved(tmp_path, capsys, monkeypatch, model, package):
    (tmp_path / "case.toml").write_text(GOOD.replace("plane_strain", model))
    monkeypatch.setattr(module(), "find_spec", lambda name: None)
    assert main(["run", str(tmp_path / "case.toml"), "--plot", str(tmp_path / "p.png")]) == 2
    line = f"lacsolver: error: a plot needs {package}; pip install 'lacmesh[view]' brings it\n"
    assert capsys.readouterr().err == line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["case.toml"]


def test_the_command_draws_and_says_so(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD)
    assert main(["run", "case.toml", "--plot", "p.png"]) == 0
    assert capsys.readouterr().out.endswith("the pressure at t = 1: p.png\n")
    assert size(tmp_path / "p.png") == (1300, 1300)
    before = (tmp_path / "p.png").read_bytes()
    assert main(["run", "case.toml", "--plot", "p.png", "-o", "again"]) == 2
    assert (tmp_path / "p.png").read_bytes() == before and not (tmp_path / "again").exists()
    assert main(["run", "case.toml", "--plot", "p.png", "--force", "-q"]) == 0


def test_only_contacts_are_drawn(tmp_path):
    case, state = solved(tmp_path, GOOD.replace("[[contact]]", "[[tie]]"), blocks())
    with pytest.raises(RequestError, match="a plot shows the pressure of contacts"):
        plot(case, state, tmp_path / "p.png")


# ---- magnified


def test_displacements_are_magnified_as_far_as_bodies_do_not_overlap():
    bar = Mesh.create([[0, 0], [10, 0]], [("SEG2", [[0, 1]])])
    u = np.zeros((2, 3))
    assert magnification(bar, u) == 1.0
    u[1, 0] = 1e-3
    assert magnification(bar, u) == 200.0
    assert magnification(bar, u, closed=1e-3) == 20.0
    assert magnification(bar, u, closed=1.0) == 1.0
    u[1, 0] = 5.0
    assert magnification(bar, u) == 1.0
