"""Quick cases of the family of joints pass."""

from __future__ import annotations

import pytest

from verification.families import cases, joints, levels_in

QUICK = {case.name: case for case in cases("quick", ("joints",))}


@pytest.mark.parametrize("name", QUICK)
def test_quick_cases_pass(name):
    case = QUICK[name]
    outcome = joints.solve_case(case, levels_in(case, "quick"))
    assert [result.quantity for result in outcome.results if not result.passed] == []
