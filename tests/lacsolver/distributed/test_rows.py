"""Matrices do not depend on the number of processes: rows of K, B, D and G agree to round-off for 1, 2, 3, 4 and 8."""

from __future__ import annotations

import json
from functools import cache

import pytest

from tests.lacsolver.distributed.mpi import printed
from tests.lacsolver.invariant_cases import CASES

pytestmark = pytest.mark.petsc
FEW, MANY = (1, 2, 3, 4), (8,)
#: B is not D where the skins are curved and follow the deformation
NAMES = ["in space, finite, smoothed", "two zones", "tie in space"]


@cache
def differing(numbers):
    """Numbers of rows that differ, by number of processes and case."""
    lines = printed(max(numbers), "rows", json.dumps(numbers), json.dumps(NAMES))
    return {(line["n"], line["name"]): line for line in lines}


@pytest.mark.parametrize(
    ("n", "numbers"), [*((n, FEW) for n in FEW), *(pytest.param(n, MANY, marks=pytest.mark.slow) for n in MANY)]
)
def test_rows_are_the_same(n, numbers):
    for name in NAMES:
        one = differing(numbers)[n, name]
        assert one["K"] == [0, one["rows"]["K"]]  # each row on one process
        for key in "BDG":
            assert one[key] == [0, n * one["rows"][key]] and one[key][1]  # all rows on all of them


def test_the_cases_have_what_is_compared():
    assert {CASES[name].dim for name in NAMES} == {2, 3}
    assert {CASES[name].finite for name in NAMES} == {False, True}
