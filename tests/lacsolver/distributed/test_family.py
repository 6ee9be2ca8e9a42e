"""The verification family `distributed` on a small problem: two processes, of which each reads its part of the mesh."""

from __future__ import annotations

import pytest

from verification.families.balance import Touch
from verification.families.distributed import FAMILY, problems, run

pytestmark = pytest.mark.petsc


def test_two_processes_find_what_one_finds():
    touch = Touch((("QUAD4", "TRIA6"),), "plane_strain", "rigid", (), "finite", steps=2)
    outcome = run(touch, "", ((2, ("gamg",)),), levels=1)
    assert len(outcome.results) == 5 and all(result.passed for result in outcome.results), outcome.results


@pytest.mark.slow
def test_a_process_may_have_no_cell():
    """The last process has nodes of the rigid plate alone, which is longer than the block over it."""
    (case,) = (case for case in FAMILY.cases if case.name == "block_QUAD4_facet")
    problem, title, _ = case.solve.args
    assert len(list(problems(problem))) == 1
    outcome = run(problem, title, ((4, ("mumps",)),), levels=1)
    assert all(result.passed for result in outcome.results), outcome.results
