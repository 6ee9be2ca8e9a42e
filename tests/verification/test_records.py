"""Figures against what must come out, records to JSON and back, and every case of every family as data."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lacmesh.report.charts import Line, Plot
from verification import families
from verification.records import (
    SUITES,
    Level,
    Published,
    Result,
    at_least,
    at_most,
    equal,
    informative,
    levels_of,
    rate,
)
from verification.running.folder import CaseResult, StoredPicture, made_of, parameters_of, plain

SAID = {"source": "here", "reason": "so"}


@pytest.mark.parametrize("number", [float, np.float64, np.float32], ids=lambda kind: kind.__name__)
def test_figures_are_held_against_their_bounds(number):
    """Verdicts are true or false and nothing else, whatever kind of number came out."""
    found = {
        "within": equal("q", number(1.25), 1.0, 0.25, **SAID),
        "off": equal("q", number(1.5), 1.0, 0.25, **SAID),
        "below": at_most("q", number(1.0), 1.0, **SAID),
        "above": at_most("q", number(1.5), 1.0, **SAID),
        "reached": at_least("q", number(1.0), 1.0, **SAID),
        "short": at_least("q", number(0.5), 1.0, **SAID),
        "informative": informative("q", number(9.0), **SAID),
    }
    assert all(type(result.passed) is bool and type(result.value) is float for result in found.values())
    assert {name for name, result in found.items() if not result.passed} == {"off", "above", "short"}


def test_nan_meets_nothing():
    nan = math.nan
    found = (equal("q", nan, 1, 1, **SAID), at_most("q", nan, 1, **SAID), at_least("q", nan, 1, **SAID))
    assert not any(result.passed for result in (*found, informative("q", nan, **SAID)))


H = (1.0, 0.5, 0.25, 0.125)


def rated(errors, wanted=2.0, **more):
    return rate("u", levels_of(H[: len(errors)], [10**k for k in range(len(errors))], errors), wanted, **SAID, **more)


@pytest.mark.parametrize(
    ("errors", "last", "passed"),
    [
        ([h**2 for h in H], None, True),
        ([h**1.9 for h in H], None, False),  # the slope
        ([1.0, 2**-3.2, 2**-4.1, 2**-7.5], None, False),  # steps 3.2, 0.9, 3.4: the slope is 2.3, one step below half
        ([1.0, 2**-3.2, 2**-4.3, 2**-7.5], None, True),
        ([1.0, 2**-1.0, 2**-3.0, 2**-5.0], None, False),  # the slope is 1.7 over all
        ([1.0, 2**-1.0, 2**-3.0, 2**-5.0], 3, True),
        ([1.0, 0.25, math.nan], None, False),
        ([1.0, 0.24, 0.0576, 0.0], None, True),  # nothing is left: faster than any rate
        ([1.0, 0.5, 0.25, 0.0], None, False),
    ],
)
def test_rates_are_judged_by_slope_and_steps(errors, last, passed):
    found = rated(errors, last=last)
    assert (found.passed, found.bound) == (passed, "at least")
    assert [level.error for level in found.levels] == pytest.approx(errors, nan_ok=True)


def test_two_levels_make_no_rate():
    assert rated([1.0, 0.9]).bound == "informative" and rated([1.0, 0.9]).passed and rated([1.0]).passed
    assert math.isnan(rated([1.0]).value) and rated([1.0, 0.9]).value == pytest.approx(-math.log2(0.9))
    assert not rated([1.0, math.nan]).passed
    assert rated([1.0, 0.9, 0.8], None).bound == "informative"


def test_each_level_has_the_rate_from_the_one_before():
    found = levels_of(H[:3], (1, 2, 3), (8.0, 2.0, 1.0))
    assert [(v.h, v.unknowns, v.error) for v in found] == [(1.0, 1, 8.0), (0.5, 2, 2.0), (0.25, 3, 1.0)]
    assert found[0].rate is None and [v.rate for v in found[1:]] == pytest.approx([2.0, 1.0])


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
DATA = st.recursive(st.none() | st.booleans() | st.integers() | NUMBERS | st.text(), st.lists, max_leaves=5)
st.register_type_strategy(float, NUMBERS)
RECORDS = {kind: st.from_type(kind) for kind in (Level, Published, Result, Line, Plot, StoredPicture)}
RECORDS[CaseResult] = st.builds(CaseResult, parameters=st.dictionaries(st.text(), DATA))


@pytest.mark.parametrize("kind", RECORDS, ids=lambda kind: kind.__name__)
def test_records_come_back_from_json(kind):
    @settings(max_examples=15, deadline=None, database=None)
    @given(RECORDS[kind])
    def there_and_back(record):
        assert made_of(kind, json.loads(json.dumps(plain(record), allow_nan=False))) == record

    there_and_back()


def test_what_is_not_finite_is_null():
    line = plain(Line("a", (0.0, math.nan, math.inf), (1.0, -math.inf, 2.0)))
    assert line["x"] == [0.0, None, None] and line["y"] == [1.0, None, 2.0]
    back = made_of(Line, line)
    assert np.isnan(back.x).tolist() == [False, True, True]
    assert plain(informative("q", math.nan, **SAID))["value"] is None


def test_numbers_of_numpy_are_numbers_in_json():
    found = plain({"a": np.float32(0.5), "b": np.int64(3), "c": np.bool_(False), "d": np.array([1.0, math.nan])})
    assert found == {"a": 0.5, "b": 3, "c": False, "d": [1.0, None]}
    assert [type(value) for value in found.values()] == [float, int, bool, list]


@pytest.mark.parametrize("value", [len, object(), {1}], ids=["function", "object", "set"])
def test_what_is_no_data_is_refused(value):
    with pytest.raises(TypeError, match="is no data"):
        plain({"given": (1, [value])})


@pytest.mark.parametrize("name", families.MODULES)
def test_the_cases_of_a_family_are_data(name):
    family = families.family(name)
    assert family.name == name and family.title and family.text
    assert family.cases and {case.family for case in family.cases} == {name}
    assert all(re.fullmatch(r"[A-Za-z0-9][\w.+-]*", case.name) for case in family.cases)  # they are names of files
    assert len({case.name.lower() for case in family.cases}) == len(family.cases)
    for case in family.cases:
        assert case.description and case.seconds > 0 and parameters_of(case), case.id
        assert json.loads(json.dumps(parameters_of(case), allow_nan=False)) == parameters_of(case)
        counts = [families.levels_in(case, suite) for suite in SUITES]
        assert set(case.levels) <= set(SUITES) and counts == sorted(counts) and counts[-1] > 0, case.id


def test_a_suite_falls_back_to_the_one_before_it():
    quick, full, everything = ({case.id for case in families.cases(suite)} for suite in SUITES)
    assert quick < full <= everything and quick
