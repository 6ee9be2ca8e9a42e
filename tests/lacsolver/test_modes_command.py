"""`lacsolver modes` as a user meets it: what it prints and writes; the film of a mode."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

import lacmesh
from lacmesh.errors import ReadError
from lacmesh.formats.vtu.collection import read_pvd
from lacsolver.case import read_case
from lacsolver.cli import main
from lacsolver.output import read_state
from lacsolver.output.modes import read_modes
from lacsolver.pictures.filming import film
from lacsolver.pictures.frames import read_mode
from lacsolver.problem.problem import Problem
from lacsolver.vibration.natural_modes import natural_modes
from tests.lacsolver.bad_cases import HEAVY, blocks, put
from tests.lacsolver.test_film import pictures


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two blocks in contact, one of which only contact supports: their modes, and a run of the same case."""
    place = tmp_path_factory.mktemp("modes")
    put(blocks(), place)
    (place / "case.toml").write_text(HEAVY)
    assert main(["modes", str(place / "case.toml"), "-k", "4", "-q"]) == 0
    assert main(["run", str(place / "case.toml"), "-q"]) == 0
    return place


def test_modes_are_written_beside_the_case(folder):
    modes = natural_modes(Problem.of(read_case(folder / "case.toml")), count=4)
    there = folder / "case_modes"
    told = json.loads((there / "modes.json").read_text())
    assert told == read_modes(there)
    assert told["frequencies"] == modes.frequencies.tolist() and told["rigid"] == 1
    assert told["rigid_motions"] == ["'upper' moves along y"] and told["closed_rows"] == {"joint": 0}
    assert told["effective_masses"] == {a: modes.effective_masses[:, k].tolist() for k, a in enumerate("xy")}
    assert told["rigid_effective_masses"]["y"] == pytest.approx(1.0) and told["mass"] == pytest.approx(2.0)
    assert told["modal_masses"] == modes.modal_masses.tolist() and told["time"] is None
    files = read_pvd(there / "modes.pvd")
    assert list(files.items()) == [(float(k), f"fields/mode_{k:04d}.vtu") for k in range(1, 6)]
    shapes = np.concatenate([modes.rigid_shapes, modes.shapes])
    for file, shape in zip(files.values(), shapes, strict=True):
        u = lacmesh.read(there / file).node_data["displacement"]
        assert np.abs(u[:, :2] - shape).max() < 1e-15 and not u[:, 2].any()


def test_the_table_has_a_line_for_each_mode(folder, capsys):
    assert main(["modes", str(folder / "case.toml"), "-k", "2", "-o", str(folder / "few")]) == 0
    lines = capsys.readouterr().out.splitlines()
    told = read_modes(folder / "few")
    rows = [line.split() for line in lines if line.strip()]
    assert rows[0] == ["mode", "frequency", "period", "mass", "x", "mass", "y"]
    assert ["1", "0"] in rows
    f, part = told["frequencies"][0], told["effective_masses"]["x"][0] / told["mass"]
    assert ["2", f"{f:.6g}", f"{1 / f:.4g}", f"{part:.2%}"] in [row[:4] for row in rows]
    assert "mode 1, rigid: 'upper' moves along y" in lines
    assert "closed rows: joint 0 (of the undeformed bodies)" in lines
    assert f"results: {folder / 'few'} (modes.json, modes.pvd for ParaView)" in lines


def test_fewer_modes_replace_all_that_were_there(folder):
    words = ["modes", str(folder / "case.toml"), "-o", str(folder / "again"), "-q"]
    assert main([*words, "-k", "5"]) == 0
    (folder / "again" / "notes.txt").write_text("mine")
    assert main([*words, "-k", "1", "--mass", "lumped", "--force"]) == 0
    names = {path.name for path in (folder / "again").rglob("*") if path.is_file()}
    assert names == {"modes.json", "modes.pvd", "notes.txt", "mode_0001.vtu", "mode_0002.vtu"}


def test_modes_about_a_state_of_a_run(folder, capsys):
    words = ["modes", str(folder / "case.toml"), "-o", str(folder / "closed"), "--state", str(folder / "case")]
    assert main([*words, "--from", "1"]) == 0
    assert "closed rows: joint 3 (at t = 1)" in capsys.readouterr().out.splitlines()
    case = read_case(folder / "case.toml")
    modes = natural_modes(Problem.of(case), at=read_state(folder / "case", case))
    told = read_modes(folder / "closed")
    assert told["frequencies"] == modes.frequencies.tolist()
    assert told["rigid"] == 0 and told["closed_rows"] == {"joint": 3} and told["time"] == 1.0


def test_a_damaged_summary_is_an_error(tmp_path):
    for content in ("{", "[]", '{"rigid": "no"}'):
        (tmp_path / "modes.json").write_text(content)
        with pytest.raises(ReadError, match="name a folder that lacsolver modes wrote"):
            read_modes(tmp_path)


# ---- the film of a mode


def test_frames_are_one_period(folder):
    frames = read_mode(folder / "case_modes", 2, 8)
    x = np.stack([frame.x for frame in frames.frames])
    still = lacmesh.read(folder / "case_modes" / "fields" / "mode_0002.vtu").points
    moved = (x - frames.surface.points(still))[:, : len(still)]
    assert np.abs(moved[0] + moved[4]).max() < 1e-12 and np.abs(moved[2]).max() < 1e-12
    assert np.abs(moved[1] - np.sqrt(0.5) * moved[0]).max() < 1e-12
    far = np.linalg.norm(moved[0], axis=1).max()
    assert far == pytest.approx(0.08 * 2.0)  # of the blocks' height
    assert frames.span == pytest.approx((0.0, 1.0), abs=1e-12)


def test_a_film_of_a_mode_goes_round_without_a_stop(folder, tmp_path):
    film(folder / "case_modes", tmp_path / "mode.gif", mode=3, frames=4, rate=10.0)
    shown, stays = pictures(tmp_path / "mode.gif")
    assert stays == [100] * 4
    assert all((a != b).any(axis=2).sum() > 500 for a, b in pairwise(shown))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("--mode 6", "case_modes holds the modes 1 to 5, and not 6"),
        ("", "case_modes holds natural modes, and not a run; name one of them by --mode"),
        ("--mode 1 --curve time:time", "a natural mode has no history to draw curves of; leave --curve out"),
    ],
)
def test_what_cannot_be_filmed(folder, capsys, words, says):
    command = ["film", str(folder / "case_modes"), "-o", str(folder / "none.gif"), *words.split()]
    assert main(command) == 2
    assert says in capsys.readouterr().err and not (folder / "none.gif").exists()
