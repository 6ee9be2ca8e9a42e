"""A deck whose contact slides, as a user runs it: imported, solved with the progress shown, compared with CalculiX.

It is like `contact2` of CalculiX's own tests: 1,572 unknowns, 14 macro-elements with smoothed normals, 36 iterations.
"""

import json
import shutil
from contextlib import chdir, redirect_stdout
from io import StringIO

import numpy as np
import pytest

from lacsolver.case import read_case
from lacsolver.cli import main
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem, read_mesh
from tests.formats.decks import solved as run_calculix
from tests.lacsolver.moving_decks import PRESSED, SLID, die_on_block, printed

PROGRAM = shutil.which("ccx")
pytestmark = pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
STEPS = PRESSED[0] + SLID[0]


@pytest.fixture(scope="module")
def deck(tmp_path_factory):
    """The folder of the deck and of its case."""
    folder = tmp_path_factory.mktemp("die")
    (folder / "die.inp").write_text(die_on_block())
    with chdir(folder):
        assert main(["import", "die.inp"]) == 0
    return folder


@pytest.fixture(scope="module")
def forces(deck):
    """Times of a run of the case, and the support's reactions (steps, 3)."""
    with chdir(deck), redirect_stdout(StringIO()) as printed:
        assert main(["run", "die.toml", "-o", "out"]) == 0
    lines = printed.getvalue().splitlines()
    head = next(k for k, line in enumerate(lines) if line.split()[:3] == ["step", "time", "iterations"])
    assert [int(line.split()[0]) for line in lines[head + 1 : head + 1 + STEPS]] == list(range(1, STEPS + 1))
    steps = json.loads((deck / "out" / "results.json").read_text())["steps"]
    assert sum(step["iterations"] for step in steps) <= 41
    return np.array([step["time"] for step in steps]), np.array([step["reactions"]["W_Z0"] for step in steps])


def test_each_step_is_shown_and_the_foot_ends_in_the_middle(forces):
    """Without friction the block pushes straight up, but for its slope and its faces: 1 %; in the middle exactly."""
    _, force = forces
    assert (np.abs(force[:, :2]) < 0.01 * force[:, 2:]).all() and np.abs(force[-1, :2]).max() < 1e-6 * force[-1, 2]
    assert (np.diff(force[: PRESSED[0], 2]) > 20).all()


@pytest.mark.slow
def test_each_iteration_is_told(deck):
    case, told = read_case(deck / "die.toml"), []
    for count, state in enumerate(march(Problem.of(case, read_mesh(case)), progress=told.append), 1):
        own = [iteration.number for iteration in told if iteration.time == state.time]
        assert own == list(range(1, state.iterations + 1)), f"step {count}"


@pytest.mark.calculix
def test_the_forces_are_those_of_calculix(deck, forces):
    """Six of 14 faces touch, each with one pressure: the two agree as far as that allows.

    CalculiX takes the place of the contact from the start of an increment: its force leans by a tenth, not so here.
    """
    times, force = forces
    at, rows = printed(run_calculix(deck / "die.inp", PROGRAM), "total force")
    theirs = np.array([row[0] for row in rows])
    np.testing.assert_allclose(at, times, rtol=1e-6)
    off = force[:, 2] / theirs[:, 2] - 1
    assert np.abs(off).max() < 0.1 and np.abs(off).mean() < 0.04
