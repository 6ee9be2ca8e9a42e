"""Results against their bounds, records to text and back, cases as data, the report of a run, changes between two."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from pydantic import TypeAdapter

from verification import charts, families, report
from verification.cases import as_text
from verification.charts import Line, Plot
from verification.comparison import changes
from verification.records import (
    SUITES,
    Level,
    Outcome,
    Picture,
    Published,
    at_least,
    at_most,
    equal,
    informative,
    levels_of,
    rate,
)
from verification.running import CaseResult, Run, rows

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


def test_outcomes_come_back_from_text():
    """Numbers of numpy too, what is not finite, and the bytes of pictures."""
    levels = levels_of((1.0, 0.5), (9, 25), (1.0, 0.25))
    odd = Level(math.inf, 9, np.float64(0.5)), Level(0.25, 25, -math.inf, math.nan)
    result = rate("u", levels, 2.0, source="é", published=[Published("they", 1.9)])
    others = (
        equal("v", 1.0, np.float32(1.0), np.float64(0.5), **SAID),
        informative("w", math.nan, reason="", levels=odd),
    )
    outcome = Outcome((result, *others), (Picture("p", "seen", b"\x89PNG\0"),), "why")
    assert repr(TypeAdapter(Outcome).validate_json(as_text(outcome))) == repr(outcome).replace("np.", "").replace(
        "float32(1.0)", "1.0").replace("float64(0.5)", "0.5")  # fmt: skip


@pytest.mark.parametrize("value", [len, object()], ids=["function", "object"])
def test_what_is_no_data_is_refused(value):
    with pytest.raises(ValueError, match="has no attribute 'tolist'"):
        as_text({"given": (1, [value])})


@pytest.mark.parametrize("name", families.MODULES)
def test_the_cases_of_a_family_are_data(name):
    family = families.family(name)
    assert family.name == name and family.title and family.text
    assert family.cases and {case.family for case in family.cases} == {name}
    assert all(re.fullmatch(r"[A-Za-z0-9][\w.+-]*", case.name) for case in family.cases)  # they are names of files
    assert len({case.name.lower() for case in family.cases}) == len(family.cases)
    for case in family.cases:
        assert case.description and case.seconds > 0 and case.parameters and as_text(case.parameters), case.id
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
        at_most("twice", 0.5, 1.0, source="one"),
        at_most("twice", 0.6, 1.0, source="two"),
        informative("decay", math.nan, reason="not bounded by the theory"),
    )
    return Outcome(results, (Picture("deformed", "two bodies", b"a picture"),))


def make_run(path, change=lambda name, k: reported(k)):
    """Write `results.json` of a run and return the run; `change`: the outcome of a case, None for no case."""
    names = [
        (family, cell, k) for family in ("hertz", "unheard-of") for k, cell in enumerate(("TRIA3", "TRIA6", "QUAD4"))
    ]
    outcomes = [(f, c, change(f"{f}/{c}", k)) for f, c, k in names]
    done = tuple(CaseResult(f, c, 4, 1.7, "", outcome) for f, c, outcome in outcomes if outcome is not None)
    run = Run(path, "1.2", "full", {"lacmesh": "1.2", "Python": "3.11.7"}, done)
    path.mkdir(exist_ok=True)
    listed = list(rows(run, informative=True))
    (path / "results.json").write_text(json.dumps({"version": "1.2", "results": listed}, allow_nan=False))
    return run


def test_report_names_missed_results_first_and_needs_no_other_file(tmp_path):
    run = make_run(tmp_path)
    page = report.page(run)
    assert not re.search(r"""src\s*=\s*["'](?!data:)|@import|url\(|https?://""", page) and "<img src=x" not in page
    missed, families_, *_ = page.partition("<h2>Missed</h2>")[2].split("<h2>")
    cells = [re.findall("<td>([^<]*)</td>", row) for row in missed.split("<tr")[2:]]
    assert [row[:2] for row in cells] == [
        [f"{family}/{cell}", quantity] for family in ("hertz", "unheard-of")
        for cell, quantity in (("TRIA3", "p_m in L2"), ("TRIA3", "decay"), ("TRIA6", "decay"), ("QUAD4", "outcome"))
    ]  # fmt: skip
    assert re.search("<td>all</td><td></td><td>6</td><td>22</td><td>8</td><td>10</td><td>inf</td>", families_)
    assert "SolverError: no equilibrium in step 3" in missed and "data:image/webp" in page and "data:image/png" in page
    assert re.search(r"u in the energy norm</td><td>2</td><td>1.1</td><td>0.32</td><td>Kratos, dual mortar", page)
    free = "<td>rms error, %</td><td>2</td><td>0.29 to 0.3</td><td>beside the peers</td>"
    assert free not in page and free in report.page(run, informative=True)


def test_a_run_and_its_figures_have_no_differences(tmp_path):
    report.write(make_run(tmp_path / "run"), tmp_path / "figures.json")
    assert (tmp_path / "figures.json").read_text().count("\n") == 2 * (7 + 7 + 1) + 2
    for one, other in product((tmp_path / "run", tmp_path / "figures.json"), repeat=2):
        (line,) = changes(one, other)
        assert line.startswith(
            "30 results in both: 0 missed now, 0 met now, 0 with another bound, 0 with another value"
        )


def test_two_runs_that_differ(tmp_path):
    def later(name, k):
        if name == "unheard-of/TRIA3":
            return None
        if name != "hertz/TRIA6":
            return reported(k)
        energy, mean, _, p0, nasty, first, second, _ = reported(k).results
        return Outcome((
            replace(energy, passed=False), replace(mean, value=mean.value * (1 + 2e-6)),
            replace(p0, value=p0.value * (1 + 5e-7)), replace(nasty, value=1.5e-14), replace(first, expected=0.9),
            replace(second, value=math.nan), at_most("new", 0.0, 1.0, source=""),
        ))  # fmt: skip

    make_run(tmp_path / "one"), make_run(tmp_path / "two", later)
    first, *forth = changes(tmp_path / "one", tmp_path / "two")
    assert first.startswith("22 results in both: 1 missed now, 0 met now, 1 with another bound, 2 with another value")
    assert [line.partition(": ")[::2][0] + ":" + line.split(": ")[2].split(" (")[0] for line in forth[:4]] == [
        "missed now:u in the energy norm", "with another bound:twice", "with another value:p_m in L2",
        "with another value:twice",
    ]  # fmt: skip
    assert forth[3].startswith("with another value: hertz/TRIA6: twice (2): 0.6 (at most 1.0) -> no number")
    assert forth[4:] == ["gone: hertz/TRIA6: decay", "gone: unheard-of/TRIA3", "new: hertz/TRIA6: new"]
    assert "0 missed now, 1 met now" in next(changes(tmp_path / "two", tmp_path / "one"))


@pytest.mark.parametrize(
    ("make", "limits", "value", "used"),
    [
        (at_most, (1.0,), 0.2, 0.2),
        (at_most, (0.0,), 0.0, 0.0),
        (at_most, (0.0,), 1.0, math.inf),
        (at_least, (1.0,), 1.9, 1 / 1.9),
        (at_least, (1.0,), 0.0, math.inf),
        (equal, (1.0, 0.1), 1.01, 0.1),
        (equal, (1.0, 0.0), 1.0, 0.0),
        (informative, (), 1.01, math.nan),
        (informative, (), math.nan, math.inf),
        (at_most, (1.0,), math.nan, math.inf),
    ],
)
def test_ratio_of_a_value_to_its_bound(make, limits, value, used):
    assert report.ratio(make("q", value, *limits, **SAID)) == pytest.approx(used, nan_ok=True)


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("values", [(), (0.0,), (-1.0, -2.0), (math.nan,), (1e-30, 1e30), (5.0, 5.0), (1.0, 0.5, 0.25)])
def test_any_values_make_a_chart(values, log):
    line = Line("a", tuple(range(1, len(values) + 1)), values)
    lines = (line, charts.sloping([line], 2.0))
    assert charts.drawn([Plot("", "x", "y", lines, log, log)] * 4).startswith("data:image/webp;base64,")


def test_line_of_a_slope_is_below_the_others():
    line = charts.sloping([Line("a", (1.0, 0.5, 0.25), (2.0, 1.0, 0.05))], 1.0)
    assert line.x == (0.25, 0.5, 1.0) and line.y == pytest.approx([0.03, 0.06, 0.12])
