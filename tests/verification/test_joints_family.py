"""Quick cases of the family of joints pass: one of each kind; `python -m verification` has them all."""

from __future__ import annotations

import pytest

from tests.samples import each_option
from verification.families import cases, levels_in

CASES = {case.name: case for case in cases("quick", ("joints",))}


def kind(row):
    """The function that solves a case, with whether it is of finite kinematics or of two halves."""
    (name,) = row
    return [(CASES[name].solve.func.__name__, "finite" in name or "halves" in name)]


@pytest.mark.parametrize("name", each_option([(name,) for name in CASES], of=kind))
def test_quick_cases_pass(name):
    case = CASES[name]
    outcome = case.solve(levels=levels_in(case, "quick"))
    assert [result.quantity for result in outcome.results if not result.passed] == []
