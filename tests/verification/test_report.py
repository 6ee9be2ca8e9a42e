"""The report of a run: what it says, what it holds, what two runs differ in, and what a browser shows of it."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from html.parser import HTMLParser

import numpy as np
import pytest

from lacmesh.report import charts
from lacmesh.report.charts import Chart, Line, Plot
from tests.verification.report_runs import NASTY, TYPES, make_run
from tests.viewing import Browser
from verification import report
from verification.records import Published, at_least, at_most, equal, informative, levels_of, rate
from verification.report import convergence, judging, outline
from verification.report.words import reason_of

WIDTHS = {"laptop": (1366, 900), "phone": (390, 844)}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def written(run):
    report.write(run, run.path / "report.html")
    return run.path / "report.html"


class Parsed(HTMLParser):
    """Ids and links of a page, its tags, and the words of each section of a case."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.tags, self.case, self.words = [], [], Counter(), "", {}
        self.open = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.tags[tag] += 1
        self.ids += [found["id"]] if "id" in found else []
        self.links += [found["href"]] if "href" in found else []
        if tag == "details":
            self.case = found["id"]
        if tag not in ("meta", "input", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag
        if tag == "details":
            self.case = ""

    def handle_data(self, data):
        self.words[self.case] = self.words.get(self.case, "") + data


@pytest.fixture(scope="module")
def page(written):
    return Parsed(written.read_text(encoding="utf-8"))


def test_the_page_needs_nothing_else(written, page):
    text = written.read_text(encoding="utf-8")
    assert not re.search(r"""src\s*=\s*["'](?!data:)|@import|url\(|https?://""", text)
    assert "default-src 'none'" in text
    assert not page.open
    assert page.tags["script"] == 1


def test_every_link_leads_somewhere_and_every_id_is_one(page):
    assert len(set(page.ids)) == len(page.ids)
    assert {link[1:] for link in page.links} <= set(page.ids)
    assert all(link.startswith("#") for link in page.links)


def test_every_case_has_its_section_with_all_it_found(run, page):
    assert {done.id for done in run.done} == set(page.words) - {""}
    for done in run.done:
        words = page.words[done.id]
        assert f"python -m verification run --family {done.family} --case {done.case} --suite full" in words
        assert done.parameters["type"] in words
        assert done.failure in words
        for result in done.results:
            assert result.quantity in words
            assert result.reason in words
            assert result.source in words
            assert all(p.who in words for p in result.published)
            assert all(f"{level.error:.2e}" in words for level in result.levels)
        assert all(plot.title in words for plot in done.plots)


def test_the_summary_counts_and_names_what_fell_short(run, written):
    met = sum(r.passed and r.bound != "informative" for done in run.done for r in done.results)
    short = [(done.id, r.quantity) for done in run.done for r in done.results if not r.passed]
    failed = [done.id for done in run.done if done.failure]
    said = written.with_suffix(".md").read_text(encoding="utf-8").split("\n# ")[0]
    assert f"{met} are met and {len(short)} missed; {len(failed)} case came" in said
    table = said.split("## What fell short")[1].split("## ")[0]
    assert len(failed) == 1
    assert table.count("\n| ") - 1 == len(short) + len(failed)
    assert all(f"| {name} | {quantity.replace('_', chr(92) + '_')} |" in table for name, quantity in short)
    assert all(f"| {name} | **no outcome** |" in table for name in failed)


def test_names_stay_text(written, page):
    assert page.tags["img"] == 3
    assert NASTY in page.words["patch/plane-TRIA6"]
    assert "<img" not in written.with_suffix(".md").read_text(encoding="utf-8").replace(r"\<img", "")


def test_the_results_stand_beside_a_report_that_is_not_in_their_folder(run, written, tmp_path):
    report.write(run, tmp_path / "page.html")
    assert (tmp_path / "page.json").read_bytes() == (run.path / "results.json").read_bytes()
    assert not written.with_suffix(".json").exists(), "the run's folder has them once"


def test_markdown_stands_beside(run, written):
    said = written.with_suffix(".md").read_text(encoding="utf-8")
    assert all(f"### {done.case}" in said for done in run.done)
    for table in re.findall(r"(?:^\|.*\n)+", said, re.MULTILINE):
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1


def test_a_family_that_does_not_load_costs_no_report(run, monkeypatch, tmp_path):
    def broken(name):
        raise NameError(name)

    monkeypatch.setattr(outline, "family", broken)
    report.write(run, tmp_path / "a.html")
    assert "<h1>Hertz</h1>" in (tmp_path / "a.html").read_text(encoding="utf-8")


def test_a_picture_that_is_gone_is_told(tmp_path):
    run = make_run(tmp_path, TYPES[:2])
    (tmp_path / "cases" / "hertz" / "plane-TRIA6-0.png").unlink()
    report.write(run, tmp_path / "a.html")
    assert "plane-TRIA6-0.png is not in the folder" in (tmp_path / "a.html").read_text(encoding="utf-8")


def test_a_chart_is_light(run):
    plots = [plot for done in run.done for plot in done.plots]
    line = Line("p", tuple(np.linspace(0, 1, 20000)), tuple(np.sin(np.linspace(0, 9, 20000))), "line")
    plots.append(Plot("pressure", "long", "x", "p", (line,)))
    assert max(len(charts.svg(Chart(plot))) for plot in plots) < 20000


def test_the_summary_in_short_has_all_families_and_what_others_published(run):
    said = report.summary(run)
    assert all(f"| {name} |" in said for name in ("patch", "hertz", "inf-sup", "unheard-of"))
    assert "| hertz/plane-QUAD4 | p\\_m in L2 | 0.799 | ≥ 0.900 |" in said
    assert re.search(r"\| hertz \| rms error.* \| 6 \| 0\.29 to 0\.34 \| 0\.32 \| Kratos", said)


def test_two_runs_that_are_the_same(run):
    assert report.compare(run, run).splitlines()[0] == f"No result differs, of {figures(run)}."


def figures(run):
    return sum(len(done.results) + bool(done.failure) for done in run.done)


def test_two_runs_that_differ(run, tmp_path):
    """In the later run one case of a family misses a figure, the second has larger errors, the third is gone."""
    later = make_run(tmp_path, twist=True)
    forth, back = report.compare(run, later), report.compare(later, run)
    first = f"10 of {figures(run)} results differ: 3 fall short now, 6 vanished, 1 errors grown."
    assert forth.splitlines()[0] == first
    assert back.splitlines()[0] == f"9 of {figures(run)} results differ: 3 met now, 6 appeared."
    assert "| hertz/plane-TRIA3 | u in the energy norm | 1.050 | 1.050 | 2.72e-03 | 2.72e-03 | met → missed |" in forth
    assert "5.86e-04 | 8.78e-04 | met |" in forth.split("### Errors grown")[1]


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
    from verification.report.changes import Pair, _changed

    assert _changed(Pair("f/c", "a", old, new)) is changed


@pytest.mark.parametrize(
    ("result", "theirs", "good"),
    [
        (at_most("e", 0.2, 1.0, source=""), 0.3, True),
        (at_most("e", 0.4, 1.0, source=""), 0.3, False),
        (at_least("rate", 1.9, 1.0, source=""), 2.0, False),
        (equal("p", 1.01, 1.0, 0.1, source="", reason=""), 0.98, True),
        (equal("p", 1.01, 1.0, 0.1, source="", reason=""), 1.001, False),
        (informative("p", 1.01, reason=""), 1.001, None),
        (at_most("e", math.nan, 1.0, source=""), 0.3, None),
    ],
)
def test_whose_figure_is_better(result, theirs, good):
    assert judging.as_good(result, Published("they", theirs)) is good


def test_the_worst_figure_is_the_one_furthest_from_what_must_be():
    assert judging.used(at_most("e", 2.0, 1.0, source="")) == 2
    assert judging.used(at_most("e", math.nan, 1.0, source="")) == math.inf
    assert judging.used(at_least("e", 0.0, 1.0, source="")) == math.inf
    assert judging.used(equal("e", 1.0, 1.0, 0.0, source="", reason="")) == 0


def numbers(path):
    return np.array(re.findall(r"(-?\d+\.\d) (-?\d+\.\d)", path), dtype=float)


@pytest.mark.parametrize("wanted", [0.95, 1.4, 3.0])
def test_the_triangle_has_the_slope_of_a_line_of_that_rate_and_lies_below(wanted):
    from tests.verification.report_runs import converging

    result = rate("u", converging(wanted), wanted, source="")
    h = [level.h for level in result.levels]
    exact = Line("a", tuple(h), tuple(s**wanted for s in h))
    text = charts.svg(Chart(Plot("", "", "h", "e", (exact,), True, True), (wanted,)))
    line = numbers(re.search(r'class="stroke" d="([^"]*)"', text)[1])
    left, right, corner = numbers(re.search(r'class="slope" d="([^"]*)"', text)[1])
    slope = np.subtract(*line[[0, -1]])
    assert np.subtract(right, left)[1] / np.subtract(right, left)[0] == pytest.approx(slope[1] / slope[0], rel=0.02)
    assert corner.tolist() == [right[0], left[1]]
    order = np.argsort(line[:, 0])
    assert np.all(np.array([left, right])[:, 1] > np.interp([left[0], right[0]], *line[order].T))
    assert left[1] <= charts.HEIGHT


def test_a_line_breaks_where_there_is_no_value_and_steps_hold():
    gap = Line("a", (0.0, 1.0, 2.0, 3.0, 4.0), (1.0, 2.0, math.nan, 2.0, 1.0), "both")
    text = charts.svg(Chart(Plot("", "", "x", "y", (gap,))))
    assert re.search(r'class="stroke" d="([^"]*)"', text)[1].count("M") == 2
    stairs = Line("b", (0.0, 1.0, 2.0), (1.0, 3.0), "steps")
    path = numbers(re.search(r'class="stroke" d="([^"]*)"', charts.svg(Chart(Plot("", "", "x", "y", (stairs,)))))[1])
    assert len(path) == 4
    assert path[0, 1] == path[1, 1] > path[2, 1] == path[3, 1]
    assert path[1, 0] == path[2, 0]


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("values", [(), (0.0,), (-1.0, -2.0), (math.nan,), (1e-30, 1e30), (5.0, 5.0)])
def test_any_values_make_a_chart(values, log):
    line = Line("a", tuple(range(1, len(values) + 1)), values)
    text = charts.svg(Chart(Plot("", "", "x", "y", (line,), log, log), (1.0,)))
    assert "nan" not in text.lower()
    assert "inf" not in text


@pytest.mark.parametrize("scale", [5.0, 1e-15, -2e12])
def test_round_off_is_no_curve_and_ticks_have_names_of_their_own(scale):
    def places(*values):
        line = Line("a", tuple(range(len(values))), tuple(scale * v for v in values))
        text = charts.svg(Chart(Plot("", "", "x", "y", (line,))))
        names = re.findall(r'text-anchor="end">([^<]*)<', text)
        assert len(set(names)) == len(names) > 2
        return numbers(re.search(r'class="stroke" d="([^"]*)"', text)[1])[:, 1]

    assert np.ptp(places(1.0, 1 + 1e-10, 1 - 1e-10)) < 0.2
    assert np.ptp(places(1.0, 1.0001)) > 200


def test_the_cases_of_a_family_share_charts_of_so_many_lines(run):
    cases = [done for done in run.done if done.family == "hertz"]
    drawn = list(convergence.charts_of(cases))
    assert [chart.slopes for chart in drawn] == [(0.95,), (0.9,), (1.4,)]
    assert max(len(chart.plot.lines) for chart in convergence.charts_of(cases * 4)) == charts.COLOURS


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A browser, started once."""
    started = Browser(tmp_path_factory.mktemp("browser"), flags=("--disable-gpu",), size=WIDTHS["laptop"])
    yield started
    started.close()


def resize(browser, size):
    width, height = size
    browser.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)


def visit(browser, name):
    browser.value(f"new Promise(done => {{ location.hash = {json.dumps(name)}; setTimeout(done, 0, true) }})")


SEEN = "[...document.querySelectorAll('.page')].filter(p => p.checkVisibility()).map(p => p.id)"


@pytest.mark.browser
def test_nothing_is_said_and_every_picture_is_there(written, run, browser):
    browser.open(written)
    assert browser.said == []
    assert browser.value(SEEN) == ["summary"]
    found = browser.value("[...document.images].map(i => [i.complete, i.naturalWidth, i.alt])")
    assert len(found) == sum(len(done.pictures) for done in run.done) == 3
    assert all(complete and width == 320 and alt for complete, width, alt in found)
    assert browser.value("[...document.querySelectorAll('svg.chart')].every(s => s.querySelector('.stroke, .mark'))")
    assert browser.value("document.querySelectorAll('svg.drawing').length") == 3


@pytest.mark.browser
def test_a_family_a_case_and_a_figure_are_gone_to(written, browser):
    browser.open(written, "hertz/plane-TRIA3")
    assert browser.value(SEEN) == ["hertz"]
    place = "document.getElementById('hertz/plane-TRIA3')"
    assert browser.value(f"{place}.open")
    assert abs(browser.value(f"{place}.getBoundingClientRect().top")) < 60
    assert not browser.value("document.getElementById('hertz/plane-TRIA6').open")
    assert browser.value("document.getElementById('hertz/plane-QUAD4').open")  # it has a figure that is missed
    visit(browser, "patch")
    assert browser.value(SEEN) == ["patch"]
    assert browser.value("document.querySelector('nav [aria-current]').hash") == "#patch"


@pytest.mark.browser
def test_tables_sort_by_number_and_by_word_with_mouse_and_keys(written, browser):
    browser.open(written, "hertz/plane-QUAD4")
    table = "document.getElementById('hertz/plane-QUAD4').querySelector('table')"
    column = f"[...{table}.tBodies[0].rows].map(r => r.cells[1].textContent)"
    head = f"{table}.tHead.rows[0].cells[1]"
    browser.value(f"{head}.querySelector('button').scrollIntoView({{block: 'center'}})")
    place = browser.value(f"(b => [b.left + b.width / 2, b.top + b.height / 2])({head}.getBoundingClientRect())")
    browser.click(*place)
    up = browser.value(column)
    assert browser.value(f"{head}.getAttribute('aria-sort')") == "ascending"
    assert [float(v) for v in up] == sorted(float(v) for v in up)
    browser.value(f"{head}.querySelector('button').focus()")
    for kind in ("keyDown", "keyUp"):
        browser.ask("Input.dispatchKeyEvent", type=kind, key="Enter", code="Enter", text="\r", windowsVirtualKeyCode=13)
    assert browser.value(column) == up[::-1]
    assert browser.value(f"{head}.getAttribute('aria-sort')") == "descending"
    browser.value(f"{table}.tHead.rows[0].cells[0].querySelector('button').click()")
    names = browser.value(f"[...{table}.tBodies[0].rows].map(r => r.cells[0].textContent)")
    assert [names[0], names[-1]] == ["balance of forces", "u in the energy norm"]
    assert browser.value(f"{head}.hasAttribute('aria-sort')") is False


@pytest.mark.browser
def test_only_what_fell_short(written, browser):
    browser.open(written, "hertz")
    browser.value("document.getElementById('short').click()")
    cases = "[...document.querySelectorAll('#hertz .case')].filter(c => c.checkVisibility()).map(c => c.id)"
    assert browser.value(cases) == ["hertz/plane-QUAD4"]
    rows = "[...document.querySelectorAll('.page.seen tbody tr.met')].filter(r => r.checkVisibility()).length"
    assert browser.value(rows) == 0
    browser.value("document.getElementById('short').click()")
    assert len(browser.value(cases)) == 6


@pytest.mark.browser
@pytest.mark.parametrize("width", WIDTHS)
def test_no_page_is_wider_than_the_screen(written, browser, width):
    resize(browser, WIDTHS[width])
    browser.open(written)
    browser.value("document.querySelectorAll('details').forEach(d => { d.open = true })")
    for name in ("summary", "patch", "hertz", "inf-sup", "unheard-of"):
        visit(browser, name)
        assert browser.value(SEEN) == [name]
        assert browser.value("document.documentElement.scrollWidth <= innerWidth"), name
        small = "[...document.querySelectorAll('.page.seen td, .page.seen p')]"
        assert browser.value(f"{small}.every(e => parseFloat(getComputedStyle(e).fontSize) >= 12)")
    resize(browser, WIDTHS["laptop"])


@pytest.mark.browser
def test_paper_and_a_browser_without_script_have_all(written, browser):
    browser.open(written)
    browser.ask("Emulation.setEmulatedMedia", media="print")
    browser.value("dispatchEvent(new Event('beforeprint'))")
    shown = "[...document.querySelectorAll('.page, .case > *, figure')].every(e => e.checkVisibility())"
    assert browser.value(shown)
    assert not browser.value("document.querySelector('nav').checkVisibility()")
    browser.value("dispatchEvent(new Event('afterprint'))")
    browser.ask("Emulation.setEmulatedMedia", media="")
    assert not browser.value(shown)
    text = written.read_text(encoding="utf-8")
    bare = written.with_name("bare.html")
    bare.write_text(re.sub(r"<script>.*</script>", "<script>document.documentElement.dataset.state = 1</script>", text,
                           flags=re.DOTALL), encoding="utf-8")  # fmt: skip
    browser.open(bare)
    assert browser.value(shown)


@pytest.mark.browser
def test_a_picture_grows_at_a_click(written, browser):
    browser.open(written, "hertz")
    size = "document.querySelector('.enlarge img').getBoundingClientRect().width"
    before = browser.value(size)
    browser.value("document.querySelector('.enlarge').click()")
    assert browser.value(size) > 1.5 * before


def test_a_rate_of_errors_that_are_zero_is_told_without_one():
    missed = rate("beyond", levels_of([1.0, 0.5, 0.25], [1, 2, 3], [0.0, 0.0, 0.0]), 1.5, source="", reason="why")
    assert not missed.passed and reason_of(missed) == "why"
