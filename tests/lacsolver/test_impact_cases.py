"""The cases of data/impact and their tutorial: meshes made again, what a bar and a ball do, plots, validate."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh.errors import RequestError
from lacsolver.case import parse_case, read_case
from lacsolver.cli import main
from lacsolver.pictures.history import chosen
from lacsolver.results.motion import ENERGIES
from lacsolver.validation import validate
from tests.lacsolver.moving import PLANE, SMALL, SPEED, WALL, steps
from tests.lacsolver.tables import table
from verification.meshes.bars import bar_on_wall

IMPACT = Path(__file__).resolve().parents[2] / "data" / "impact"


@pytest.mark.parametrize(("name", "script"), [("bar_on_wall", "make_bar"), ("dropping_ball", "make_dropping_ball")])
def test_the_scripts_make_the_meshes_again(name, script, tmp_path):
    target = tmp_path / f"{name}.msh"
    subprocess.run([sys.executable, str(IMPACT / f"{script}.py"), str(target)], check=True, cwd=IMPACT.parents[1])
    made, there = lacmesh.read(target), lacmesh.read(IMPACT / target.name)
    np.testing.assert_allclose(made.points, there.points, rtol=0, atol=1e-12)
    for one, other in zip(made.blocks, there.blocks, strict=True):
        np.testing.assert_array_equal(one.nodes, other.nodes)


def history(case, folder):
    """The history of the bar's run."""
    with pytest.warns(lacmesh.errors.LacmeshWarning, match="massless nodes change the inertia of .* by -1.57%"):
        from lacsolver.output import create_output
        from lacsolver.running import run

        run(read_case(case), create_output(folder))
    return table(folder / "history.csv")


@pytest.fixture(scope="module")
def bar(tmp_path_factory):
    """The folder of the bar's run in a quarter of its steps, and its history; the case stands beside it."""
    folder = tmp_path_factory.mktemp("bar")
    text = (IMPACT / "bar_on_wall.toml").read_text().replace("count = 128", "count = 32")
    (folder / "bar.toml").write_text(text)
    (folder / "bar_on_wall.msh").write_bytes((IMPACT / "bar_on_wall.msh").read_bytes())
    return folder / "bar", history(folder / "bar.toml", folder / "bar")


@pytest.mark.slow
def test_the_bar_does_what_its_page_says(tmp_path):
    columns = history(IMPACT / "bar_on_wall.toml", tmp_path / "bar")
    t, p = columns["time"], columns["contact.impact.pressure_max"]
    assert not p[t < 0.95].any() and not p[t > 3.2].any()
    assert p[(t > 1.5) & (t < 2.8)].mean() == pytest.approx(0.01, rel=0.01)
    assert columns["contact.impact.impulse.y"][-1] == pytest.approx(2 * 0.01 * 0.25, rel=5e-3)
    assert columns["momentum.y"][-1] == pytest.approx(-0.0025 + columns["contact.impact.impulse.y"][-1], rel=1e-9)
    signs = [-1.0 if name == "external" else 1.0 for name in ENERGIES]
    energies = np.array([columns[f"energy.{name}"] for name in ENERGIES])
    assert np.abs(signs @ energies).max() < 1e-10 * energies.max()
    assert columns["probe.top.vy"][0] == pytest.approx(-0.01)


def test_results_and_fields_have_the_motion(bar):
    folder, columns = bar
    step = json.loads((folder / "results.json").read_text())["steps"][-1]
    assert list(step["energies"]) == list(ENERGIES)
    assert step["energies"]["kinetic"] == columns["energy.kinetic"][-1]
    assert step["momentum"]["linear"][1] == columns["momentum.y"][-1]
    assert step["momentum"]["angular"] == columns["momentum.angular"][-1]
    assert step["impulse"]["impact"][1] == columns["contact.impact.impulse.y"][-1]
    assert step["velocities"]["top"][1] == columns["probe.top.vy"][-1]
    assert step["accelerations"]["top"][1] == columns["probe.top.ay"][-1]
    fields = sorted((folder / "fields").glob("solid_*.vtu"))
    assert len(fields) == 32
    last = lacmesh.read(fields[-1])
    assert {"velocity", "acceleration"} <= set(last.node_data)


def test_a_run_goes_on_from_its_folder(bar, tmp_path):
    folder, columns = bar
    case = str(folder.with_suffix(".toml"))
    command = ["run", case, "-o", str(tmp_path / "more"), "-q", "--restart", str(folder)]
    assert main([*command, "--from", "3.5"]) == 0
    for name, values in table(tmp_path / "more" / "history.csv").items():
        assert np.isnan(values[-1]) or values[-1] == columns[name][-1], name


def test_a_plot_of_the_history(bar, tmp_path, capsys):
    folder, columns = bar
    target = tmp_path / "plot.png"
    command = ["plot", str(folder), "-o", str(target)]
    assert main([*command, "--history", "energy.*", "contact.impact.fy", "probe.top.vy"]) == 0
    assert target.read_bytes().startswith(b"\x89PNG") and "MB" in capsys.readouterr().out
    assert main(command) == 2 and "exists" in capsys.readouterr().err
    assert main([*command, "--force", "--history", "energy.kinetics"]) == 2
    assert "history.csv has no column 'energy.kinetics'; did you mean energy.kinetic" in capsys.readouterr().err
    assert main(["plot", str(folder), "-o", str(tmp_path / "plot.pdf")]) == 2
    with pytest.raises(RequestError, match="no energies and no reactions"):
        chosen({"time": columns["time"]}, [])


def test_validate_tells_of_the_motion(capsys):
    found = validate(read_case(IMPACT / "bar_on_wall.toml"))
    assert not found.problems
    motion = found.motion
    assert motion.speeds == pytest.approx((1.0, 1.0)) and motion.cell == pytest.approx(1 / 16)
    assert motion.crossed == pytest.approx(0.5) and motion.suggested == pytest.approx(1 / 16)
    assert motion.mass == pytest.approx(0.25) and motion.momentum == pytest.approx((0.0, -0.0025))
    text = PLANE + SMALL + WALL + "[dynamics]\n" + steps(1.0, 4)
    quadratic = validate(parse_case(text), bar_on_wall("QUAD8", 4)).motion
    assert quadratic.cell == pytest.approx(1 / 4)  # a wave goes from node to node, of which there are twice as many
    assert quadratic.suggested == pytest.approx(1 / 8 / SPEED)
    assert main(["validate", str(IMPACT / "bar_on_wall.toml")]) == 0
    said = capsys.readouterr().out
    assert "wave speeds" in said and "momentum at the start" in said


def test_the_ball_comes_back(tmp_path):
    """A few steps of the ball: it touches, and the account of energy closes."""
    text = (IMPACT / "dropping_ball.toml").read_text().replace("end = 0.012\ncount = 60", "end = 0.002\ncount = 10")
    (tmp_path / "ball.toml").write_text(text)
    (tmp_path / "dropping_ball.msh").write_bytes((IMPACT / "dropping_ball.msh").read_bytes())
    assert main(["run", str(tmp_path / "ball.toml"), "-q"]) == 0
    last = {name: values[-1] for name, values in table(tmp_path / "ball" / "history.csv").items()}
    assert last["contact.impact.fy"] > 50
    account = [(-1 if name == "external" else 1) * last[f"energy.{name}"] for name in ENERGIES]
    assert abs(sum(account)) < 1e-10 * last["energy.external"]
