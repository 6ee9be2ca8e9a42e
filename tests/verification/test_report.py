"""The report of a run: what it says, what two runs differ in, its charts, and that a browser shows it."""

from __future__ import annotations

import io
import math
import re
from dataclasses import dataclass, replace
from functools import partial
from html import unescape

import numpy as np
import pytest
from PIL import Image

from lacmesh.report import charts
from lacmesh.report.charts import Chart, Line, Plot
from verification import report
from verification.records import (
    Case,
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
from verification.report import judging, outline
from verification.report.changes import Pair, _changed
from verification.report.words import reason_of
from verification.running.folder import Run, read_run, write_case_result, write_results

TYPES = ("TRIA3", "TRIA6", "QUAD4")
#: markup and signs, which must stay text
NASTY = '<img src=x onerror=alert(1)> & </script> | `a` "b"'


# ---- a run that never was: every kind of result, plot and picture


@dataclass(frozen=True)
class Given:
    """Definition of a case."""

    type: str
    rigid: bool = False


def converging(wanted, seed=0):
    """Levels of an error that falls at about a rate."""
    h = [1 / 2**k for k in range(2, 6)]
    jitter = 1 + 0.06 * np.sin(np.arange(4) * 2.3 + seed)
    return levels_of(h, [40, 160, 640, 2560], [0.1 * s**wanted * j for s, j in zip(h, jitter, strict=True)])


def outcome_of(k):
    """Rates met and missed, published figures, a name with markup, plots and a picture; the last has no outcome."""
    if k == 2:
        return Outcome(failure="SolverError: no equilibrium in step 3")
    theirs = (Published("Kratos, dual mortar", 0.32, "measured here"), Published("code_aster", 0.31, "V6.04.104"))
    results = (
        rate("u in the energy norm", converging(1.1, k), 0.95, source="Theorem 1", published=theirs),
        rate("p_m in L2", converging(0.8 + k, k), 0.9, source="the edge", reason="within a face"),
        informative("rms error, %", 0.29 + 0.01 * k, reason="beside the peers", published=theirs),
        equal("p0", 0.9997, 1.0, 1e-3, source="Hertz 1881", reason="the coarsest mesh gives 5e-4"),
        at_most(NASTY, 2e-14, 1e-12, source="action and reaction"),
        informative("decay", math.nan, reason="not bounded by the theory"),
    )
    content = io.BytesIO()
    Image.new("RGB", (320, 200), "teal").save(content, "png")
    lines = [Line(kind, (0.0, 0.5, 1.0), (1.0, math.nan, 0.5)[: 3 - (kind == "steps")], kind)
             for kind in ("line", "both", "steps", "points")]  # fmt: skip
    newton = Line("step 1", (0, 1, 2), (1.0, 1e-3, 1e-9))
    plots = (
        Plot("pressure", f"Pressure {k}", "r / a", "p / p0", tuple(lines)),
        Plot("Newton", f"Residuals {k}", "iteration", "residual", (newton,), log_y=True),
    )
    return Outcome(results, plots, (Picture("deformed", "two bodies", content.getvalue()),))


def make_run(path, change=lambda family, k, outcome: outcome):
    """Write the folder of a run, and read it again; `change`: what a later version might find, None for no case."""
    done = []
    for family in ("hertz", "unheard-of"):
        for k, name in enumerate(TYPES):
            case = Case(family, f"plane-{name}", f"{family} on {name}", partial(outcome_of, Given(name)), {"quick": 3})
            if (outcome := change(family, k, outcome_of(k))) is not None:
                done.append(write_case_result(case, 4, 1.7**k, 200_000_000, outcome, path, ""))
    write_results(path, Run(path, "1.2", "full", {"lacmesh": "1.2", "Python": "3.11.7"}, 754.0, tuple(done)))
    return read_run(path)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def written(run):
    report.write(run, run.path / "report.html")
    return run.path / "report.html"


# ---- its page


def test_the_page_needs_nothing_else_and_has_every_case_with_all_it_found(run, written):
    text = written.read_text(encoding="utf-8")
    assert not re.search(r"""src\s*=\s*["'](?!data:)|@import|url\(|https?://""", text)
    assert "default-src 'none'" in text and text.count("<img ") == 4
    ids, links = re.findall(r' id="([^"]*)"', text), re.findall(r' href="#([^"]*)"', text)
    assert len(set(ids)) == len(ids) and set(links) <= set(ids)
    parts = [part.partition("</details>")[0] for part in text.split("<details")[1:]]
    words = {re.search(r'id="([^"]*)"', part)[1]: unescape(re.sub("<[^>]*>", "", part)) for part in parts}
    assert set(words) == {done.id for done in run.done} and NASTY in words["hertz/plane-TRIA6"]
    for done in run.done:
        command = f"python -m verification run --family {done.family} --case {done.case} --suite full"
        told = [command, done.parameters["type"], done.failure, *(plot.title for plot in done.plots)]
        for result in done.results:
            told += [result.quantity, result.reason, result.source, *(p.who for p in result.published)]
            told += [f"{level.error:.2e}" for level in result.levels]
        assert [word for word in told if word not in words[done.id]] == []


def test_the_markdown_counts_and_names_what_fell_short(run, written):
    met = sum(r.passed and r.bound != "informative" for done in run.done for r in done.results)
    short = [(done.id, r.quantity) for done in run.done for r in done.results if not r.passed]
    said = written.with_suffix(".md").read_text(encoding="utf-8")
    assert all(f"### {done.case}" in said for done in run.done) and "<img" not in said.replace(r"\<img", "")
    for table in re.findall(r"(?:^\|.*\n)+", said, re.MULTILINE):
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1
    summary = said.split("\n# ")[0]
    assert f"{met} are met and {len(short)} missed; 2 cases came" in summary
    table = summary.split("## What fell short")[1].split("## ")[0]
    assert table.count("\n| ") - 1 == len(short) + 2
    assert {quantity for _, quantity in short} == {"p_m in L2", "decay"} and all(name in table for name, _ in short)
    assert "| hertz/plane-QUAD4 | **no outcome** |" in table
    brief = report.summary(run)
    assert all(f"| {name} |" in brief for name in ("hertz", "unheard-of"))
    assert re.search(r"\| hertz \| rms error.* \| 2 \| 0\.29 to 0\.30? \| 0\.32 \| Kratos", brief)


def test_a_report_is_made_whatever_is_gone(monkeypatch, tmp_path):
    """A family that does not load, a picture, and the folder of the run, whose results then stand beside the page."""

    def broken(name):
        raise NameError(name)

    run = make_run(tmp_path)
    (tmp_path / "cases" / "hertz" / "plane-TRIA6-0.png").unlink()
    monkeypatch.setattr(outline, "family", broken)
    (tmp_path / "away").mkdir()
    for place in (tmp_path, tmp_path / "away"):
        report.write(run, place / "page.html")
        text = (place / "page.html").read_text(encoding="utf-8")
        assert "<h1>Hertz</h1>" in text and "plane-TRIA6-0.png is not in the folder" in text
    assert (tmp_path / "away" / "page.json").read_bytes() == (tmp_path / "results.json").read_bytes()
    assert not (tmp_path / "page.json").exists()


# ---- verdicts, and two runs


def later(family, k, outcome):
    """In the later run a case of a family misses a figure, the second has larger errors, one is gone."""
    if family == "hertz" and k in (0, 1):
        first, *others = outcome.results
        grown = tuple(replace(level, error=level.error * 1.5) for level in first.levels)
        changed = replace(first, passed=False) if k == 0 else replace(first, levels=grown)
        return replace(outcome, results=(changed, *others))
    return None if (family, k) == ("unheard-of", 0) else outcome


def test_two_runs_that_differ(run, tmp_path):
    n = sum(len(done.results) + bool(done.failure) for done in run.done)
    assert report.compare(run, run).splitlines()[0] == f"No result differs, of {n}."
    other = make_run(tmp_path, later)
    forth, back = report.compare(run, other), report.compare(other, run)
    assert forth.splitlines()[0] == f"8 of {n} results differ: 1 fall short now, 6 vanished, 1 errors grown."
    assert back.splitlines()[0] == f"7 of {n} results differ: 1 met now, 6 appeared."
    assert re.search(r"hertz/plane-TRIA3 \| u in the energy norm .* met → missed \|", forth)
    assert "hertz/plane-TRIA6" in forth.split("### Errors grown")[1]


@pytest.mark.parametrize(
    ("old", "new", "changed"),
    [
        (at_most("a", 1e-13, 1e-10, source=""), at_most("a", 9e-13, 1e-10, source=""), False),
        (at_most("a", 1e-13, 1e-10, source=""), at_most("a", 2e-11, 1e-10, source=""), True),
        (informative("a", 1.0, reason=""), informative("a", 1.04, reason=""), False),
        (informative("a", 1.0, reason=""), informative("a", 0.94, reason=""), True),
        (informative("a", 1.0, reason=""), informative("a", math.nan, reason=""), True),
    ],
)
def test_what_counts_as_a_change(old, new, changed):
    assert _changed(Pair("f/c", "a", old, new)) is changed


@pytest.mark.parametrize(
    ("result", "theirs", "good", "used"),
    [
        (at_most("e", 0.2, 1.0, source=""), 0.3, True, 0.2),
        (at_most("e", 0.4, 1.0, source=""), 0.3, False, 0.4),
        (at_least("rate", 1.9, 1.0, source=""), 2.0, False, 1 / 1.9),
        (at_least("e", 0.0, 1.0, source=""), 1.0, False, math.inf),
        (equal("p", 1.01, 1.0, 0.1, source="", reason=""), 0.98, True, 0.1),
        (equal("p", 1.01, 1.0, 0.1, source="", reason=""), 1.001, False, 0.1),
        (equal("e", 1.0, 1.0, 0.0, source="", reason=""), 1.0, True, 0.0),
        (informative("p", 1.01, reason=""), 1.001, None, math.nan),
        (at_most("e", math.nan, 1.0, source=""), 0.3, None, math.inf),
    ],
)
def test_whose_figure_is_better_and_how_near_its_bound(result, theirs, good, used):
    assert judging.as_good(result, Published("they", theirs)) is good
    assert judging.used(result) == pytest.approx(used, nan_ok=True)


# ---- charts


def test_a_rate_of_errors_that_are_zero_is_told_without_one():
    missed = rate("beyond", levels_of([1.0, 0.5, 0.25], [1, 2, 3], [0.0, 0.0, 0.0]), 1.5, source="", reason="why")
    assert not missed.passed and reason_of(missed) == "why"


def drawn(line, *slopes, log=False):
    return charts.svg(Chart(Plot("", "", "x", "y", (line,), log, log), slopes))


def numbers(text, kind="stroke"):
    """Coordinates on a path of a chart."""
    return np.array(re.findall(r"(-?\d+\.\d) (-?\d+\.\d)", path(text, kind)), dtype=float)


def path(text, kind="stroke"):
    return re.search(rf'class="{kind}" d="([^"]*)"', text)[1]


@pytest.mark.parametrize("wanted", [0.95, 1.4, 3.0])
def test_the_triangle_has_the_slope_of_a_line_of_that_rate_and_lies_below(wanted):
    h = [level.h for level in converging(wanted)]
    text = drawn(Line("a", tuple(h), tuple(s**wanted for s in h)), wanted, log=True)
    line, (left, right, corner) = numbers(text), numbers(text, "slope")
    slope = np.subtract(*line[[0, -1]])
    assert np.subtract(right, left)[1] / np.subtract(right, left)[0] == pytest.approx(slope[1] / slope[0], rel=0.02)
    assert corner.tolist() == [right[0], left[1]]
    order = np.argsort(line[:, 0])
    assert np.all(np.array([left, right])[:, 1] > np.interp([left[0], right[0]], *line[order].T))
    assert left[1] <= charts.HEIGHT


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("values", [(), (0.0,), (-1.0, -2.0), (math.nan,), (1e-30, 1e30), (5.0, 5.0)])
def test_any_values_make_a_chart(values, log):
    text = drawn(Line("a", tuple(range(1, len(values) + 1)), values), 1.0, log=log).lower()
    assert "nan" not in text and "inf" not in text


@pytest.mark.parametrize("scale", [5.0, 1e-15, -2e12])
def test_round_off_is_no_curve_and_ticks_have_names_of_their_own(scale):
    def places(*values):
        text = drawn(Line("a", tuple(range(len(values))), tuple(scale * v for v in values)))
        names = re.findall(r'text-anchor="end">([^<]*)<', text)
        assert len(set(names)) == len(names) > 2
        return numbers(text)[:, 1]

    assert np.ptp(places(1.0, 1 + 1e-10, 1 - 1e-10)) < 0.2
    assert np.ptp(places(1.0, 1.0001)) > 200
    gap = Line("a", (0.0, 1.0, 2.0, 3.0, 4.0), (1.0, 2.0, math.nan, 2.0, 1.0), "both")
    assert path(drawn(gap)).count("M") == 2  # a line breaks where there is no value
    stairs = numbers(drawn(Line("b", (0.0, 1.0, 2.0), (1.0, 3.0), "steps")))
    assert len(stairs) == 4 and stairs[0, 1] == stairs[1, 1] > stairs[2, 1] == stairs[3, 1]
    long = Line("p", tuple(np.linspace(0, 1, 20000)), tuple(np.sin(np.linspace(0, 9, 20000))), "line")
    assert len(drawn(long)) < 20000
