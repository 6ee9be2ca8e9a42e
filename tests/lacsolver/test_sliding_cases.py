"""The cases of data/sliding: their meshes can be made again, they are valid, and shorter ones behave as they should."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacsolver.cli import main
from lacsolver.pictures.frames import read_frames
from tests.lacsolver.tables import table

SLIDING = Path(__file__).resolve().parents[2] / "data" / "sliding"
CASES = sorted(path.stem for path in SLIDING.glob("*.toml"))


@pytest.fixture
def script(monkeypatch):
    """A script beside the meshes, as a module."""
    monkeypatch.syspath_prepend(SLIDING)
    return lambda name: importlib.import_module(name)


def solved(folder, name, *changes):
    """history.csv by column, and results.json, of a case with changes (old text, new); its mesh may be in `folder`."""
    text = (SLIDING / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    mesh = folder / f"{name}.msh"
    if not mesh.exists():
        mesh.write_bytes((SLIDING / mesh.name).read_bytes())
    (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    assert main(["run", str(folder / f"{name}.toml"), "-q"]) == 0
    return table(folder / name / "history.csv"), json.loads((folder / name / "results.json").read_text())


def test_there_is_a_case_for_each_mesh():
    assert sorted(path.stem for path in SLIDING.glob("*.msh")) == CASES
    assert len(CASES) == 5 and all(path.stat().st_size < 300_000 for path in SLIDING.iterdir() if path.is_file())


@pytest.mark.parametrize("name", ["ring", "ironing", "ball", "snap_fit"])
def test_the_scripts_make_the_meshes_again(name, tmp_path):
    kept = sorted(SLIDING.glob(f"{name}*.msh"))
    target = tmp_path if len(kept) > 1 else tmp_path / kept[0].name
    subprocess.run([sys.executable, str(SLIDING / f"make_{name}.py"), str(target)], check=True, cwd=SLIDING.parents[1])
    for path in kept:
        made, there = lacmesh.read(tmp_path / path.name), lacmesh.read(path)
        assert np.allclose(made.points, there.points, rtol=0, atol=1e-9)
        for one, other in zip(made.blocks, there.blocks, strict=True):
            assert one.type == other.type and (one.nodes == other.nodes).all()
        for groups in ("cell_groups", "node_groups"):
            one, other = getattr(made, groups), getattr(there, groups)
            assert list(one) == list(other) and all((one[key] == other[key]).all() for key in one)


@pytest.mark.parametrize("name", CASES)
def test_cases_are_valid(name, capsys):
    assert main(["validate", str(SLIDING / f"{name}.toml")]) == 0
    assert not capsys.readouterr().err


def test_skins_turn_outward_and_cells_are_right_handed(script):
    solids = script("solids")
    disc = solids.half_disc(2.0, 4, 3)
    corner = disc.points[disc.cells]
    (ux, uy), (vx, vy) = (np.moveaxis(np.roll(corner, k, axis=1) - corner, 2, 0) for k in (-1, 1))
    assert (ux * vy - uy * vx > 0).all()
    arc = solids.skin(disc, lambda x, y: np.isclose(np.hypot(x, y), 2.0))
    ends = disc.points[arc]
    along = ends[:, 1] - ends[:, 0]
    assert len(arc) == 16
    assert (along[:, 1] * ends.mean(axis=1)[:, 0] - along[:, 0] * ends.mean(axis=1)[:, 1] > 0).all()
    brick = solids.brick(*(np.linspace(0, 1, n) for n in (2, 3, 4)))
    top = brick.points[solids.skin(brick, lambda x, y, z: np.isclose(z, 1))]
    assert len(top) == 2 and (np.cross(top[:, 1] - top[:, 0], top[:, 2] - top[:, 0])[:, 2] > 0).all()


# ---- what they do


def test_the_ring_lies_down_on_the_block(tmp_path):
    """The first twelve steps: one contact, alike on both sides, in balance."""
    columns, told = solved(tmp_path, "ring", ("uy = -90.0", 'uy = "-90 * t"'), ("count = 20", "end = 0.6\ncount = 12"))
    assert max(told["balance"].values()) <= 1e-12
    down, foot = columns["reaction.ends.y"], columns["reaction.bottom.y"]
    assert np.allclose(down, -foot, rtol=0, atol=1e-7 * np.abs(down).max())
    assert np.abs(columns["reaction.ends.x"]).max() < 1e-7 * np.abs(down).max()
    touched = columns["time"] > 20 / 90
    assert np.abs(down[~touched]).max() < 1e-9 * np.abs(down).max() and (np.diff(-down[touched]) > 0).all()
    # the block is pressed down in its middle first, later more where one of the two contacts will be
    middle, side = ([np.interp(t, columns["time"], columns[f"probe.{p}.uy"]) for t in (0.4, 0.6)] for p in ("PA", "PB"))
    assert middle[0] < -4 < side[0] < 0 and side[1] < middle[1] - 1


@pytest.mark.slow
def test_the_ball_keeps_its_volume(tmp_path, script):
    script("make_ball").main(tmp_path / "ball.msh", 5, 3)
    columns, told = solved(tmp_path, "ball", ("count = 20", "count = 8"))
    top, bottom = columns["reaction.top_plate.y"], columns["reaction.bottom_plate.y"]
    assert np.allclose(top, -bottom, rtol=1e-9) and top[-1] < 3 * np.interp(0.5, columns["time"], top) < -75
    assert np.abs(columns["reaction.at [0, 0].y"]).max() < 1e-9 * np.abs(top).max()
    assert told["balance"]["force"] <= 1e-12
    assert columns["probe.top_plate.uy"][-1] == -4.0
    frames = read_frames(tmp_path / "ball", "stress")
    x = frames.frames[-1].x
    own = np.isfinite(frames.frames[-1].value)  # the plates have no stress
    # gaps vanish in the mean of a macro-element: corners of this coarse skin stand 0.05 beyond the plates
    assert np.ptp(x[own, 1]) == pytest.approx(12.0, abs=0.12)
    before = volume(frames.surface, undeformed(tmp_path / "ball", frames.surface))
    assert volume(frames.surface, x) == pytest.approx(before, rel=0.01)
    area = columns["contact.top.area"]
    assert (np.diff(area) > -1e-6 * area[:-1]).all() and area[-1] > 150
    assert columns["probe.equator.ux"][-1] > 1.0


def undeformed(folder, surface):
    return surface.points(lacmesh.read(min((folder / "fields").glob("solid_*.vtu"))).points)


def volume(surface, x):
    """Volume of the full revolution, by Pappus for each triangle."""
    a, b, c = np.moveaxis(x[surface.triangles][..., :2], 1, 0)
    area = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    return 2 * np.pi * (area * (a + b + c)[:, 0] / 3).sum()


@pytest.mark.slow
def test_ironing_costs_no_force_in_the_mean(tmp_path, script):
    """Without friction: the drag is odd about the middle of the block, its ripple little beside the push."""
    script("make_ironing").make_plane(tmp_path / "ironing_2d.msh", 24)
    columns, told = solved(tmp_path, "ironing_2d", ("count = 48", "count = 24"))
    assert max(told["balance"].values()) <= 1e-12
    on = columns["time"] > 1 + 1e-9
    way, drag, push = (columns[name][on] for name in ("probe.top.ux", "reaction.top.x", "reaction.top.y"))
    push = -push
    assert way[-1] == 4.5 and (push > 0).all()
    assert abs(drag.mean()) < 2e-3 * push.mean()
    assert ripple(way, drag) < 2e-3 * push.mean() and ripple(way, push) < 2e-2 * push.mean()


def ripple(way, force):
    """Largest distance of a force from the smooth curve fitted to it, a polynomial of degree 5."""
    return np.abs(force - np.polyval(np.polyfit(way, force, 5), way)).max()


@pytest.mark.slow
def test_the_hook_snaps_in(tmp_path):
    """Pushed on until it is behind the ledge: up the slope, along the top, pulled on by itself, free again."""
    columns, told = solved(tmp_path, "snap_fit", ("end = 1.25\ncount = 50", "end = 1.0\ncount = 10"))
    force, lift = columns["reaction.base.x"], columns["probe.tip.uy"]
    peak = int(force.argmax())
    assert force[peak] > 0.1 and lift[peak] > 1.5
    # on top the ledge carries a cantilever, 32.3 long up to the crest, bent by 2.5: 3 E I / L^3 of a plate
    on_top = np.interp(0.6, columns["time"], columns["reaction.ledge.y"])
    assert on_top == pytest.approx(3 * 2000 / (1 - 0.35**2) * 2.0**3 / 12 * 2.5 / 32.3**3, rel=0.1)
    assert force[peak:].min() < -0.05
    assert abs(force[-1]) < 1e-9 * force[peak] and abs(lift[-1]) < 1e-9 and told["energy"] < 1e-12
    zone = told["contact"]["slave"]
    assert zone["active"] == 0 and columns["probe.tip.ux"][-1] == pytest.approx(14.5)
