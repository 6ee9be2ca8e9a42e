"""The verification family `distributed` on a small problem: two processes, of which each reads its part of the mesh."""

from __future__ import annotations

import pytest

from verification.families.balance import Touch
from verification.families.distributed import FAMILY, Divided, problems
from verification.records import Case

pytestmark = pytest.mark.petsc


def test_two_processes_find_what_one_finds():
    given = Divided(Touch((("QUAD4", "TRIA6"),), "plane_strain", "rigid", (), "finite", steps=2), ((2, ("gamg",)),))
    outcome = FAMILY.solve(Case("distributed", "one", "", given, {"all": 1}), 1)
    assert len(outcome.results) == 5 and all(result.passed for result in outcome.results), outcome.results


@pytest.mark.slow
def test_a_process_may_have_no_cell():
    """The last process has nodes of the rigid plate alone, which is longer than the block over it."""
    (case,) = (case for case in FAMILY.cases if case.name == "block_QUAD4_facet")
    short = Divided(case.parameters.given, ((4, ("mumps",)),))
    assert len(list(problems(short.given))) == 1
    outcome = FAMILY.solve(Case("distributed", "one", "", short, {"all": 1}), 1)
    assert all(result.passed for result in outcome.results), outcome.results
