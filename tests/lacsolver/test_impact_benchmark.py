"""The benchmark of impacts by multigrid at a small size: V-cycles of a step in contact against an elastic solve."""

from __future__ import annotations

import sys
from unittest.mock import patch

import pytest

from lacsolver.saddle.stiffness import FactorCache
from tests import REPOSITORY

sys.path.append(str(REPOSITORY / "benchmarks"))

import impact


def test_a_step_in_contact_takes_at_most_one_and_a_half_elastic_solves():
    found = impact.measured(9, 20)
    assert found["unknowns"] > 2000 and found["in contact"] > 12 and found["closed"] > 60
    assert found["alone"] < 30 and found["cycles"] <= 1.5 * found["alone"]
    assert found["account"] < 1e-10 and 0.95 < found["energy"] < 1.001
    assert impact.line(found).count("|") == 9


@pytest.mark.slow
def test_the_hierarchy_of_the_first_tiny_step_would_take_many_times_more():
    """Mutation: the start of a motion takes a step of dt / 1000, whose matrix is all mass."""
    with patch.object(FactorCache, "forget", lambda self: None), pytest.MonkeyPatch.context() as context:
        context.setattr(impact, "elastic", lambda step, tolerance: 20)
        assert impact.measured(6, 6)["cycles"] > 60
