"""`mpiexec -n 3 lacsolver run`: what a user sees is what one process would show, whatever engine is behind it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.distributed.mpi import environment, in_ranks, own_lines

pytestmark = pytest.mark.petsc

#: the command, with an engine that solves on rank 0 and writes its arguments into a file on each
COMMAND = """
import sys
from dataclasses import replace
from pathlib import Path
import lacsolver.distributed.running as running
def run(case, folder, **rest):
    from lacmesh.errors import LacmeshWarning
    from lacsolver.distributed.launch import import_petsc
    from lacsolver.distributed.together import on_first
    from lacsolver.running import run as solve
    import warnings
    comm = import_petsc().COMM_WORLD.tompi4py()
    warnings.warn(LacmeshWarning("of all"))
    told = f"{case.solver.engine_for(comm.size)} {case.solver.threads} {folder.path}"
    Path(f"rank_{comm.rank}.txt").write_text(told)
    plain = replace(case, solver=replace(case.solver, engine="serial"))
    return on_first(comm, lambda: solve(plain, folder, **rest))
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
    """The lines that do not depend on time, memory and the width of the terminal: the steps, and the last one."""
    lines = text.splitlines()
    return [*lines[:2], lines[-1]]


def test_a_run_shows_what_one_process_shows(folder):
    done = in_ranks(3, COMMAND, "run", "case.toml", "-o", "several")
    assert done.returncode == 0, done.stderr
    assert own_lines(done.stderr) == ["lacsolver: warning: of all"]
    assert [(folder / f"rank_{k}.txt").read_text() for k in range(3)] == ["petsc 1 several"] * 3
    assert json.loads((folder / "several" / "results.json").read_text())["status"] == "done"
    (folder / "rank_0.txt").unlink()
    serial = alone("run", "case.toml", "-o", "several", "--force")
    assert not (folder / "rank_0.txt").exists()  # one process takes the serial engine
    assert serial.returncode == 0 and shown(done.stdout) == shown(serial.stdout)
    assert done.stdout.count("results: several") == 1 and "\x1b" not in done.stdout
    # and the folder now holds results, which rank 0 finds
    refused = in_ranks(2, COMMAND, "run", "case.toml", "-o", "several")
    assert refused.returncode == 2
    (line,) = own_lines(refused.stderr)
    assert line.startswith("lacsolver: error: several holds results already; --force replaces them")


def test_mistakes_of_a_case_are_reported_once(folder):
    (folder / "case.toml").write_text(GOOD.replace("young", "yung").replace("[[displacement]]", "[[displacment]]", 1))
    several, serial = in_ranks(2, COMMAND, "run", "case.toml"), alone("run", "case.toml")
    assert several.returncode == serial.returncode == 1
    assert own_lines(several.stderr) == own_lines(serial.stderr) != []


def test_the_serial_engine_in_several_processes_is_refused(folder):
    (folder / "case.toml").write_text(GOOD + '[solver]\nengine = "serial"\n')
    done = in_ranks(2, COMMAND, "run", "case.toml")
    assert done.returncode == 2
    (line,) = own_lines(done.stderr)
    assert "2 processes were started" in line and "each would solve the whole" in line
    assert not (folder / "case").exists()


def test_one_process_takes_the_engine_that_the_case_names(folder):
    (folder / "case.toml").write_text(GOOD + '[solver]\nengine = "petsc"\n')
    done = alone("run", "case.toml")
    assert done.returncode == 0, done.stderr
    assert (folder / "rank_0.txt").read_text() == "petsc None case"
