"""A broken solver makes the family that should notice fall short; the solver as it is does not."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import pytest

from lacsolver import NotConvergedError
from tests.verification import mutations
from verification.families import family


class Run(NamedTuple):
    """A case of a family on so many levels; `pairs`: which of its pairs of bodies, where it has many."""

    family: str
    case: str
    levels: int
    pairs: tuple[int, int] | None = None


def failing(run):
    """Quantities that are missed, by name."""
    (case,) = (case for case in family(run.family).cases if case.name == run.case)
    if run.pairs is not None:
        (given,) = case.solve.args
        case = replace(case, solve=partial(case.solve.func, replace(given, pairs=given.pairs[slice(*run.pairs)])))
    return {result.quantity for result in case.solve(levels=run.levels).results if not result.passed}


PLANE = Run("patch", "2d-QUAD8", 1, (0, 1))
SOLID = Run("patch", "3d-TETRA10", 1, (1, 2))
SKIN = Run("inf-sup", "TETRA4", 3)
PRESSED = Run("inf-sup", "pressed-TRIA3", 2)
WAVES = Run("balance", "waves-facet-2d", 1, (0, 1))
WARPED = Run("balance", "warped-hexa-3d", 1, (0, 1))
OVER_WAVES = Run("sliding", "waves_QUAD4_facet", 1)
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
    (mutations.stiff_normal, OVER_WAVES, "share of steps whose last 2 iterations are quadratic"),
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
