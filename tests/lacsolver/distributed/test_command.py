"""`mpiexec -n 3 lacsolver run`: what a user sees is what one process would show, whatever engine is behind it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from lacsolver.cli import main
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.distributed.mpi import commands, environment, in_ranks, own_lines

pytestmark = pytest.mark.petsc

#: the command, with a warning on every rank, and what each rank runs with in a file of its own
COMMAND = """
import sys, warnings
from pathlib import Path
import lacsolver.running as running
solve = running.run
def run(case, folder, **rest):
    from lacmesh.errors import LacmeshWarning
    shared = rest["distribution"]
    warnings.warn(LacmeshWarning("of all"))
    told = f"{type(shared).__name__} {case.solver.threads} {folder.path}"
    Path(f"rank_{shared.comm.rank if hasattr(shared, 'comm') else 0}.txt").write_text(told)
    return solve(case, folder, **rest)
running.run = run
from lacsolver.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The good case and its mesh, in the folder that the command works in."""
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def alone(*words):
    """The command in one process."""
    command = [sys.executable, "-c", COMMAND, *words]
    return subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=60)


def shown(text):
    """The head, the step and the last line, without what depends on time, memory, round-off or the terminal's width."""
    head, step, *_, last = text.splitlines()
    return head, [word for k, word in enumerate(step.split()) if k != 4], last  # without the balance


def test_a_run_shows_what_one_process_shows(folder):
    done = in_ranks(3, COMMAND, "run", "case.toml", "-o", "several")
    assert done.returncode == 0, done.stderr
    assert own_lines(done.stderr) == ["lacsolver: warning: of all"]
    assert [(folder / f"rank_{k}.txt").read_text() for k in range(3)] == ["Processes 1 several"] * 3
    assert json.loads((folder / "several" / "results.json").read_text())["status"] == "done"
    serial = alone("run", "case.toml", "-o", "several", "--force")
    assert (folder / "rank_0.txt").read_text() == "Distribution None several"
    assert serial.returncode == 0 and shown(done.stdout) == shown(serial.stdout)
    assert done.stdout.count("results: several") == 1 and "\x1b" not in done.stdout
    # and the folder now holds results, which rank 0 finds
    refused = in_ranks(2, COMMAND, "run", "case.toml", "-o", "several")
    assert refused.returncode == 2
    (line,) = own_lines(refused.stderr)
    assert line.startswith("lacsolver: error: several holds results already; --force replaces them")


def test_what_all_processes_refuse_is_said_once(folder, capsys):
    """Mistakes of a case, as one process says them; and an engine that would solve the whole in each of two."""
    wrong = GOOD.replace("young", "yung").replace("[[displacement]]", "[[displacment]]", 1)
    (folder / "wrong.toml").write_text(wrong)
    (folder / "serial.toml").write_text(GOOD + '[solver]\nengine = "serial"\n')
    (status, mistakes), (refused, (line,)) = commands(2, ["run", "wrong.toml"], ["run", "serial.toml"])
    assert status == main(["run", "wrong.toml"]) == 1
    assert mistakes == own_lines(capsys.readouterr().err) != []
    assert refused == 2 and "2 processes were started" in line and "each would solve the whole" in line
    assert not (folder / "serial").exists()


def test_one_process_takes_the_engine_that_the_case_names(folder):
    (folder / "case.toml").write_text(GOOD + '[solver]\nengine = "petsc"\n')
    done = alone("run", "case.toml")
    assert done.returncode == 0, done.stderr
    assert (folder / "rank_0.txt").read_text() == "Processes None case"
