"""Quick cases of the family of joints pass: one of each kind; `python -m verification` has them all."""

from __future__ import annotations

import pytest

from tests.samples import one_of_each
from verification.families import cases, levels_in

KINDS = one_of_each(
    cases("quick", ("joints",)), lambda case: (case.solve.func, "finite" in case.name or "halves" in case.name)
)


@pytest.mark.fuzz
@pytest.mark.parametrize("case", KINDS, ids=lambda case: case.name)
def test_quick_cases_pass(case):
    outcome = case.solve(levels=levels_in(case, "quick"))
    assert [result.quantity for result in outcome.results if not result.passed] == []
