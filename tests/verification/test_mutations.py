"""A broken solver makes the family that should notice fall short; the solver as it is does not."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import pytest

from lacsolver import NotConvergedError
from tests.verification import mutations
from verification.families import family
from verification.families.manufactured import solution


class Run(NamedTuple):
    """A case of a family on so many levels; `pairs`: which of its pairs of bodies, where it has many."""

    family: str
    case: str
    levels: int
    pairs: tuple[int, int] | None = None


def failing(run):
    """What falls short, by its name."""
    (case,) = (case for case in family(run.family).cases if case.name == run.case)
    if run.pairs is not None:
        case = replace(case, given=replace(case.given, pairs=case.given.pairs[slice(*run.pairs)]))
    return {result.quantity for result in family(run.family).solve(case, run.levels).results if not result.passed}


PLANE = Run("patch", "2d-QUAD8", 1, (0, 1))
SOLID = Run("patch", "3d-TETRA10", 1, (1, 2))
SKIN = Run("inf-sup", "TETRA4", 3)
PRESSED = Run("inf-sup", "pressed-TRIA3", 2)
WAVES = Run("balance", "waves-facet-2d", 1, (0, 1))
WARPED = Run("balance", "warped-hexa-3d", 1, (0, 1))
HERTZ = Run("hertz", "2d-QUAD8-rigid", 3)

#: mutant -> case, and what must be among its failures
TABLE = [
    (mutations.tilted_normal, PLANE, "stress at integration points"),
    (mutations.tilted_normal, SOLID, "stress at integration points"),
    (mutations.tilted_normal, WAVES, "balance of moments"),
    (mutations.masters_normal, WAVES, "balance of moments"),
    (mutations.masters_normal, WARPED, "balance of moments"),
    (mutations.few_points, PLANE, "contact pressure p_m"),
    (mutations.few_points, SOLID, "contact pressure p_m"),
    (mutations.dropped_macro, PLANE, "contact pressure p_m"),
    (mutations.dropped_macro, SOLID, "contact pressure p_m"),
    (mutations.frozen_set, HERTZ, "p_m, L2"),
    (mutations.not_cut, SKIN, "least beta, cut, rim fixed"),
    (mutations.not_cut, PRESSED, "error of p_m over that of the best, cut"),
]


@pytest.mark.parametrize("run", dict.fromkeys(run for _, run, _ in TABLE), ids=lambda run: f"{run.family}-{run.case}")
def test_nothing_fails_as_it_is(run):
    assert failing(run) == set()


@pytest.mark.parametrize(("mutant", "run", "quantity"), TABLE, ids=[f"{m.__name__}-{run.case}" for m, run, _ in TABLE])
def test_a_mutant_is_seen(mutant, run, quantity, monkeypatch):
    mutant(monkeypatch)
    assert quantity in failing(run)


def test_a_frozen_set_does_not_converge(monkeypatch):
    mutations.frozen_set(monkeypatch, blind=False)
    with pytest.raises(NotConvergedError):
        failing(HERTZ)


def test_without_the_derivative_of_normals_the_last_iterations_are_linear(monkeypatch):
    row = next(case.given for case in family("manufactured").cases if case.name == "QUAD8")
    quadratic = _last_reduction(row)
    mutations.stiff_normal(monkeypatch)
    assert quadratic < 1e-4
    assert _last_reduction(row) > 1e-2


def _last_reduction(row):
    """What the last iteration left of the residual."""
    (state,) = solution(row, 0).solved.states
    return state.residuals[-1] / state.residuals[-2]
