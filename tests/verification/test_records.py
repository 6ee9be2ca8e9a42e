"""Results against their bounds, records to JSON and back, cases as data, and the report of a run."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.verification.fakes import Given
from verification import families, report
from verification.pages import charts
from verification.pages.charts import Chart, Line, Plot
from verification.records import (
    SUITES,
    Case,
    Level,
    Outcome,
    Picture,
    Published,
    Result,
    at_least,
    at_most,
    equal,
    informative,
    levels_of,
    rate,
)
from verification.report import judging, outline
from verification.running.folder import (
    CaseResult,
    Run,
    StoredPicture,
    made_of,
    parameters_of,
    plain,
    read_run,
    write_case_result,
    write_results,
)

SAID = {"source": "here", "reason": "so"}


@pytest.mark.parametrize("number", [float, np.float64, np.float32], ids=lambda kind: kind.__name__)
@pytest.mark.parametrize(
    ("bound", "limits", "value", "passed"),
    [
        (equal, (1.0, 0.25), 1.25, True),
        (equal, (1.0, 0.25), 1.5, False),
        (equal, (1.0, 1.0), math.nan, False),
        (at_most, (1.0,), 1.0, True),
        (at_most, (1.0,), 1.5, False),
        (at_most, (1.0,), math.nan, False),
        (at_least, (1.0,), 1.0, True),
        (at_least, (1.0,), 0.5, False),
        (at_least, (1.0,), math.nan, False),
        (informative, (), 9.0, True),
        (informative, (), math.nan, False),
    ],
)
def test_results_are_compared_with_their_bounds(bound, limits, value, passed, number):
    """Verdicts are true or false and nothing else, whatever kind of number came out."""
    result = bound("q", number(value), *limits, **SAID)
    assert result.passed is passed and type(result.value) is float


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
        ([1.0, 2**-0.5, 2**-3.0, 2**-5.0], 3, True),  # a step to the first of the last levels is not theirs
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


def test_what_is_not_finite_is_null_and_numbers_of_numpy_are_numbers_in_json():
    line = plain(Line("a", (0.0, math.nan, math.inf), (1.0, -math.inf, 2.0)))
    assert line["x"] == [0.0, None, None] and line["y"] == [1.0, None, 2.0]
    assert np.isnan(made_of(Line, line).x).tolist() == [False, True, True]
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


# ---- the report of a run


#: markup and signs, which must stay text
NASTY = '<img src=x onerror=alert(1)> & </script> | `a` "b"'


def reported(k):
    """Rates met and missed, published values, a name with markup, plots and a picture; the third has no outcome."""
    if k == 2:
        return Outcome(failure="SolverError: no equilibrium in step 3")
    theirs = (Published("Kratos, dual mortar", 0.32, "measured here"), Published("code_aster", 0.31, "V6.04.104"))
    energy, mean = (levels_of(H, (40, 160, 640, 2560), [h**falls for h in H]) for falls in (1.1, 0.8 + k))
    results = (
        rate("u in the energy norm", energy, 0.95, source="Theorem 1", published=theirs),
        rate("p_m in L2", mean, 0.9, source="the edge", reason="within a face"),
        informative("rms error, %", 0.29 + 0.01 * k, reason="beside the peers", published=theirs),
        equal("p0", 0.9997, 1.0, 1e-3, source="Hertz 1881", reason="the coarsest mesh gives 5e-4"),
        at_most(NASTY, 2e-14, 1e-12, source="action and reaction"),
        informative("decay", math.nan, reason="not bounded by the theory"),
    )
    lines = [Line(kind, (0.0, 0.5, 1.0), (1.0, math.nan, 0.5)[: 3 - (kind == "steps")], kind)
             for kind in ("line", "both", "steps", "points")]  # fmt: skip
    newton = Plot("Newton", "Residuals", "iteration", "residual", (Line("step 1", (0, 1), (1, 1e-9)),), log_y=True)
    plots = (Plot("pressure", f"Pressure {k}", "r / a", "p / p0", tuple(lines)), newton)
    return Outcome(results, plots, (Picture("deformed", "two bodies", b"a picture"),))


def later(family, k, outcome):
    """A case misses a result and has others that are 6 % larger, the second has larger errors, one is gone."""
    if k == 2 or family != "hertz":
        return outcome if (family, k) != ("unheard-of", 0) else None
    first, *others = outcome.results
    others = [replace(r, value=(1 + 0.06 * (k == 0)) * r.value) if r.bound != "equal" else r for r in others]
    grown = tuple(replace(level, error=level.error * 1.5) for level in first.levels)
    changed = replace(first, passed=False) if k == 0 else replace(first, levels=grown)
    return replace(outcome, results=(changed, *others))


def make_run(path, change=lambda family, k, outcome: outcome):
    """Write the folder of a run, and read it again; `change`: what a later version might find, None for no case."""
    done = []
    for family in ("hertz", "unheard-of"):
        for k, name in enumerate(("TRIA3", "TRIA6", "QUAD4")):
            case = Case(family, f"plane-{name}", f"{family} on {name}", partial(reported, Given()), {"quick": 3})
            if (outcome := change(family, k, reported(k))) is not None:
                done.append(write_case_result(case, 4, 1.7**k, 200_000_000, outcome, path, ""))
    write_results(path, Run(path, "1.2", "full", {"lacmesh": "1.2", "Python": "3.11.7"}, 754.0, tuple(done)))
    return read_run(path)


def test_a_report_counts_and_names_what_is_missed_whatever_is_gone(tmp_path, monkeypatch):
    """A family that does not load, a picture, and the folder of the run, whose results then are beside the page."""

    def broken(name):
        raise NameError(name)

    run = make_run(tmp_path)
    (tmp_path / "cases" / "hertz" / "plane-TRIA6-0.png").unlink()
    monkeypatch.setattr(outline, "family", broken)
    (tmp_path / "away").mkdir()
    for place in (tmp_path, tmp_path / "away"):
        report.write(run, place / "page.html")
        text = (place / "page.html").read_text(encoding="utf-8")
        assert not re.search(r"""src\s*=\s*["'](?!data:)|@import|url\(|https?://""", text)
        assert all(f'id="{done.id}"' in text for done in run.done) and "plane-TRIA6-0.png is not in" in text
    assert (tmp_path / "away" / "page.json").read_bytes() == (tmp_path / "results.json").read_bytes()
    met = sum(r.passed and r.bound != "informative" for done in run.done for r in done.results)
    missed = [(done.id, r.quantity) for done in run.done for r in done.results if not r.passed]
    summary = (tmp_path / "page.md").read_text(encoding="utf-8").split("\n# ")[0]
    assert f"{met} are met and {len(missed)} missed; 2 cases came" in summary
    assert {quantity for _, quantity in missed} == {"p_m in L2", "decay"} and all(name in summary for name, _ in missed)
    assert "| hertz/plane-QUAD4 | **no outcome** |" in summary
    assert re.search(r"\| hertz \| rms error.* \| 2 \| 0\.29 to 0\.30? \| 0\.32 \| Kratos", report.summary(run))


def test_two_runs_that_differ(tmp_path):
    run, other = make_run(tmp_path / "one"), make_run(tmp_path / "two", later)
    n = sum(len(done.results) + bool(done.failure) for done in run.done)
    assert report.compare(run, run).splitlines()[0] == f"No result differs, of {n}."
    forth, back = report.compare(run, other), report.compare(other, run)
    assert f"10 of {n} results differ: 1 fall short now, 6 vanished, 2 values changed, 1 errors grown." in forth
    assert f"9 of {n} results differ: 1 met now, 6 appeared, 2 values changed." in back
    assert re.search(r"hertz/plane-TRIA3 \| u in the energy norm .* met → missed \|", forth)
    assert "hertz/plane-TRIA6" in forth.split("### Errors grown")[1]


@pytest.mark.parametrize(
    ("make", "limits", "value", "theirs", "good", "used"),
    [
        (at_most, (1.0,), 0.2, 0.3, True, 0.2),
        (at_most, (1.0,), 0.4, 0.3, False, 0.4),
        (at_least, (1.0,), 1.9, 2.0, False, 1 / 1.9),
        (at_least, (1.0,), 0.0, 1.0, False, math.inf),
        (equal, (1.0, 0.1), 1.01, 0.98, True, 0.1),
        (equal, (1.0, 0.1), 1.01, 1.001, False, 0.1),
        (equal, (1.0, 0.0), 1.0, 1.0, True, 0.0),
        (informative, (), 1.01, 1.001, None, math.nan),
        (at_most, (1.0,), math.nan, 0.3, None, math.inf),
    ],
)
def test_whose_figure_is_better_and_how_near_its_bound(make, limits, value, theirs, good, used):
    result = make("q", value, *limits, **SAID)
    assert judging.as_good(result, Published("they", theirs)) is good
    assert judging.used(result) == pytest.approx(used, nan_ok=True)


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("values", [(), (0.0,), (-1.0, -2.0), (math.nan,), (1e-30, 1e30), (5.0, 5.0), (1.0, 0.5, 0.25)])
def test_any_values_make_a_chart(values, log):
    line = Line("a", tuple(range(1, len(values) + 1)), values)
    text = charts.svg(Chart(Plot("", "", "x", "y", (line,), log, log), (1.0,))).lower()
    sloping = log and sum(v > 0 for v in values) > 1
    assert "nan" not in text and "inf" not in text and text.count('class="slope"') == sloping


@pytest.mark.parametrize(("low", "high", "values"), [(-2.5, 1.2, [0.01, 0.1, 1, 10]), (-2, 0, [0.01, 0.1, 1])])
def test_powers_of_ten_are_named_within_an_axis(low, high, values):
    assert [value for value, _ in charts.Axis(low, high, 0.0, 1.0, log=True).ticks()] == pytest.approx(values)


@pytest.mark.parametrize("count", [40, 41])
def test_marks_of_more_than_40_points_are_dots(count):
    line = Line("a", tuple(range(count)), tuple(range(count)), "points")
    assert ('class="dots"' in charts.svg(Chart(Plot("", "", "x", "y", (line,))))) == (count > 40)


def test_points_that_cannot_be_told_apart_are_not_drawn():
    """Of points a quarter of a unit apart each second one, and the last."""
    x = np.arange(400) / 4
    kept, _ = charts._thinned(x, np.zeros(400))
    assert kept.tolist() == [*x[::2], x[-1]]
