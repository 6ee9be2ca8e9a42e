"""Every linear solver and engine that a case may name solves it, or is named as missing."""

from __future__ import annotations

import pytest

import lacsolver.saddle.stiffness
from lacmesh.errors import LacmeshError
from lacsolver.case import Solver
from lacsolver.linear import analyse, backends
from lacsolver.output import create_output
from lacsolver.running import run
from tests.answers import Ran, check_tower
from tests.problems import stacked

BACKENDS = ("auto", "rslab", "pardiso", "mumps", "cholmod", "superlu", "multigrid")


@pytest.fixture
def solve(tmp_path, monkeypatch):
    """Run three blocks with these keys of [solver]; returns the backends and threads that it analysed with."""
    asked = []

    def recorded(K, *, backend, threads, **rest):
        made = analyse(K, backend=backend, threads=threads, **rest)
        asked.append((made.backend, threads))
        return made

    def ran(**keys):
        case = stacked(1.0, "pyramid", Solver(**keys)).case()
        run(case, create_output(tmp_path / "out"))
        check_tower(Ran(case, case.mesh, tmp_path / "out"), 34 + 13 * 4)
        return asked

    monkeypatch.setattr(lacsolver.saddle.stiffness, "analyse", recorded)
    monkeypatch.setattr(lacsolver.problem.problem, "available_cores", lambda: 7)
    return ran


@pytest.mark.parametrize("backend", BACKENDS)
def test_every_backend_solves_or_is_missing(solve, backend):
    known = backends()
    if backend != "auto" and not known[backend].installed:
        with pytest.raises(LacmeshError, match=f"{backend} is not installed"):
            solve(backend=backend)
        return
    wanted = backend if backend != "auto" else next(b.name for b in known.values() if b.direct and b.installed)
    assert solve(backend=backend, threads=3) == [(wanted, 3)]


def test_all_cores_are_taken_where_no_number_is_given(solve):
    assert [threads for _, threads in solve()] == [7]


@pytest.mark.parametrize("keys", [{"engine": "auto"}, {"engine": "serial"}], ids=str)
def test_one_process_solves(solve, keys):
    solve(**keys)


@pytest.mark.parametrize("keys", [{"engine": "petsc"}, {"backend": "gamg"}, {"backend": "hypre"}], ids=str)
def test_engines_of_several_processes_are_not_taken_for_the_serial_one(solve, keys):
    with pytest.raises(LacmeshError, match=r"engine petsc"):
        solve(**keys)
