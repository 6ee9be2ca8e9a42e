"""The family `distributed`: its problems, how solutions are compared, and what is said where PETSc is missing."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from verification import mpiexec
from verification.cli import main
from verification.divided import FailedError, found
from verification.families import distributed
from verification.families.balance import Touch, mesh_of, text
from verification.families.distributed import FAMILY, FEW, PLANE, RANKS, SOLID, Free, compared, problems
from verification.meshes.stacks import PLANE_KINDS, SOLID_KINDS
from verification.records import Case
from verification.running.plan import suite_of
from verification.solving import solve

GIVEN = Touch((("QUAD4", "TRIA3"),), "plane_strain", "waves")


@pytest.fixture(scope="module")
def alone():
    """A solution by one process."""
    return solve(text(GIVEN), mesh_of(GIVEN, *GIVEN.pairs[0]))


def test_every_kind_of_cells_is_divided():
    named = {kind for pairs in (PLANE, SOLID) for pair in pairs for kind in pair}
    types = {kind.split()[0] for kind in (*PLANE_KINDS, *SOLID_KINDS)}
    assert {kind.split()[0] for kind in named} >= types


def test_goal_1_is_asked_for():
    """1, 2, 3, 4 and 8 processes, and each backend."""
    assert [n for n, _ in RANKS] == [1, 2, 3, 4, 8]
    assert all(set(backends) == {"multigrid", "gamg", "hypre", "mumps"} for n, backends in RANKS if n < 8)
    assert {backend for _, backends in FEW for backend in backends} == {"multigrid", "gamg", "hypre", "mumps"}
    names = {case.name for case in FAMILY.cases}
    assert {"cells-2d", "cells-3d", "floating-3d", "tower-finite", "tie-3d", "rigid-3d", "ring"} <= names
    assert {f"free-{name}" for name in ("bars", "spin", "top", "plate", "wall", "thrown")} <= names


def test_problems_are_cases_and_meshes():
    for case in FAMILY.cases:
        if case.name in ("tie-2d", "floating-2d", "block_QUAD4_facet", "ring") or case.name.startswith("free"):
            for words, mesh in problems(case.solve.args[0]):
                assert "[[contact]]" in words or "[[tie]]" in words
                assert mesh.n_cells > 10 and not mesh.zones


def test_states_of_one_process_differ_by_nothing(alone):
    states = [found(state, alone.problem) for state in alone.states]
    same = compared(alone, states, 2, "gamg")
    assert (same.sets, same.u, same.p) == (0, 0.0, 0.0) and 0 < same.balance < 1e-12


@pytest.mark.parametrize("field", ["sets", "u", "p", "balance"])
def test_a_difference_is_seen(alone, field):
    (state,) = [found(state, alone.problem) for state in alone.states]
    changed = {
        "sets": replace(state, status=1 - state.status),
        "u": replace(state, u=state.u * (1 + 1e-8)),
        "p": replace(state, pressure=state.pressure * (1 + 1e-8)),
        "balance": replace(
            state, force=state.force * (1 + 1e-8 * (np.arange(state.force.size) % 7).reshape(state.force.shape))
        ),
    }[field]
    results = {r.quantity.split(":")[0]: r for r in distributed._judged([compared(alone, [changed], 2, "gamg")])}
    wrong = [name for name, result in results.items() if not result.passed]
    words = {"sets": "macro-elements", "u": "displacement", "p": "pressure", "balance": "balance"}[field]
    assert len(wrong) == 1 and wrong[0].startswith(words)


@pytest.mark.parametrize("field", ["velocity", "energies"])
def test_a_difference_of_a_motion_is_seen(field):
    (problem,) = problems(Free("wall"))
    alone = solve(*problem)
    states = [found(state, alone.problem) for state in alone.states]
    same = compared(alone, states, 2, "mumps")
    assert (same.u, same.motion) == (0.0, 0.0) and all(result.passed for result in distributed._judged([same]))
    assert all(state.velocity.any() and state.energies[0] > 0 for state in states)
    states[-1] = replace(states[-1], **{field: getattr(states[-1], field) * (1 + 1e-8)})
    wrong = [r.quantity for r in distributed._judged([compared(alone, states, 2, "mumps")]) if not r.passed]
    assert wrong == ["velocities and energies, relative difference: mumps, n = 2"]


def test_steps_at_other_times_are_no_solution(alone):
    state = found(alone.state, alone.problem)
    with pytest.raises(FailedError, match="took 2 steps, and one process 1"):
        compared(alone, [state, state], 2, "gamg")


def test_without_petsc_the_family_is_refused_or_left_out(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(mpiexec, "python_with_petsc", lambda: "")
    monkeypatch.setattr(mpiexec, "_complaint", lambda python: "MPI is not installed")
    words = ["run", "--suite", "all", "-o", str(tmp_path / "run"), "--case"]
    assert main([*words, "distributed/tie-2d"]) == 2
    said = capsys.readouterr().err
    assert (
        "family distributed cannot be run: MPI is not installed; in a checkout, make petsc installs all of it" in said
    )
    assert not (tmp_path / "run").exists()


def test_other_families_run_without_petsc(monkeypatch, capsys):
    from verification.cli import run
    from verification.running.plan import Planned

    monkeypatch.setattr(mpiexec, "python_with_petsc", lambda: "")
    monkeypatch.setattr(mpiexec, "_complaint", lambda python: "MPI is not installed")
    cases = (
        Case("distributed", "a", "", partial(print), {"all": 1}),
        Case("patch", "b", "", partial(print), {"all": 1}),
    )
    left = run._possible([Planned(case, 1, "") for case in cases])
    assert [planned.case.name for planned in left] == ["b"]
    assert capsys.readouterr().out.startswith("family distributed is left out (1 of the cases): MPI is not installed; ")


def test_the_family_is_run_without_a_suite():
    assert suite_of(None, "distributed", "quick") == "all"
    assert suite_of(None, "patch", "quick") == suite_of(None, None, "quick") == "quick"
    assert suite_of("full", "distributed", "quick") == "full"
