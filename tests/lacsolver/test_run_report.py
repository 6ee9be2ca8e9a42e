"""The report of a run, and two runs compared."""

from __future__ import annotations

import html
import json
import re

import numpy as np
import pytest

import lacsolver as ls
from lacmesh.errors import ReadError, RequestError
from lacsolver.cli import main
from lacsolver.reporting.comparing import compare_runs
from tests.browser import Browser
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.patch_meshes import stack
from tests.lacsolver.test_plot import SPACE
from tests.test_view_page import unpacked

STEPS = '[steps]\ncount = 3\n[output]\nunits = "N, mm, MPa"\n'


@pytest.fixture(scope="module")
def space(tmp_path_factory):
    """The folder of a run in space, in three steps."""
    folder = tmp_path_factory.mktemp("report")
    put(stack("HEXA8", "TETRA4", 3, counts=(3, 2)), folder)
    (folder / "case.toml").write_text(SPACE + STEPS)
    assert main(["run", str(folder / "case.toml"), "-q"]) == 0
    return folder / "case"


@pytest.fixture(scope="module")
def page(space):
    """The report of that run."""
    assert main(["report", str(space), "-q"]) == 0
    return space / "report.html"


@pytest.mark.vtk
def test_the_page_has_the_figures_of_the_run(space, page):
    text = page.read_text()
    results = ls.read_results(space)
    zone = results.summary["contact"]["joint"]
    assert f"{zone['pressure_max']:.5g}" in text and "largest pressure (MPa)" in text
    assert text.count('src="data:image/webp;base64,') == 2
    for heading in ("The model", "Contact", "Loads and supports", "Over time", "Convergence", "Stresses", "The case"):
        assert f"<h2>{heading}</h2>" in text
    assert "value = &quot;t * (1 + x)&quot;" in text  # the case, as text
    assert "http" not in re.sub(r"base64,[^\"]*", "", text).replace("http-equiv", "").replace(
        "http://www.w3.org/2000/svg", ""
    )


@pytest.mark.vtk
def test_the_model_has_the_pressures_of_every_time(space, page, tmp_path):
    text = page.read_text()
    inner = html.unescape(re.search(r'srcdoc="(.*?)" style', text, re.S)[1])
    (tmp_path / "model.html").write_text(inner)
    head, arrays = unpacked(tmp_path / "model.html")
    results = ls.read_results(space)
    assert head["moments"] == [f"t = {time:.6g}" for time in results.times]
    values = arrays["momentValues"].reshape(3, -1)
    for k, row in enumerate(values):
        zone = results.solution(k).contact["joint"]
        known = row[np.isfinite(row)]
        assert sorted(np.unique(known)) == sorted(np.unique(zone.pressure.astype(np.float32)))
    points = arrays["momentPoints"].reshape(3, -1, 3)
    assert np.abs(points[0] - points[2]).max() > 0 and np.allclose(points[-1], arrays["points"].reshape(-1, 3))
    assert head["values"]["onSkin"] and head["values"]["good"] == values[np.isfinite(values)].max()


@pytest.mark.vtk
@pytest.mark.browser
def test_the_model_turns_and_its_slider_shows_the_times(page, tmp_path):
    browser = Browser(tmp_path / "browser")
    try:
        browser.ask("Page.navigate", url=page.as_uri())
        inside = "document.querySelector('iframe')?.contentDocument?.documentElement?.dataset"
        browser.wait(f"{inside}?.state === 'ready'")
        assert browser.value(f"{inside}.glError") == "0" and browser.value(f"{inside}.moment") == "2"
        frame = "document.querySelector('iframe').contentDocument"
        slider = f"{frame}.getElementById('moment')"
        move = f"(s => {{ s.value = 0; s.dispatchEvent(new Event('input')); }})({slider})"
        browser.value(move)
        assert browser.value(f"{inside}.moment") == "0"
        assert browser.value(f"{frame}.getElementById('now').textContent").startswith("t = 0.33")
        assert browser.value(f"{inside}.glError") == "0" and browser.said == []
    finally:
        browser.close()


def test_a_plane_run_reports_when_it_ends(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD)
    assert main(["run", "case.toml", "--report", "r.html"]) == 0
    assert capsys.readouterr().out.endswith("the report: r.html\n")
    assert "<h2>Contact</h2>" in (tmp_path / "r.html").read_text()
    assert main(["run", "case.toml", "--report", "r.html", "-o", "again"]) == 2 and not (tmp_path / "again").exists()
    ls.read_results("case").report("other.html")
    assert (
        "Young" not in (tmp_path / "other.html").read_text()
        and "young = 1000.0" in (tmp_path / "other.html").read_text()
    )


def test_a_run_without_contact_has_a_report(tmp_path):
    put(blocks(), tmp_path)
    contact = '[[contact]]\nname = "joint"\nslave = "slave"\nmaster = "master"\n'
    text = GOOD.replace(contact, "") + '[[displacement]]\ngroup = "top"\nuy = -0.1\n'
    (tmp_path / "case.toml").write_text(text.replace('[[pressure]]\ngroup = "top"\nvalue = 1.0\n', ""))
    assert main(["run", str(tmp_path / "case.toml"), "-q"]) == 0
    assert main(["report", str(tmp_path / "case.toml"), "-o", str(tmp_path / "r.html"), "-q"]) == 0
    assert "<h2>Contact</h2>" not in (tmp_path / "r.html").read_text()


def test_what_is_no_report_is_said(tmp_path, space):
    with pytest.raises(RequestError, match=r"a report is written as \.html"):
        ls.read_results(space).report(tmp_path / "r.pdf")
    with pytest.raises(ReadError, match="holds no results"):
        compare_runs(space, tmp_path)


def test_runs_are_compared(space, tmp_path, capsys):
    assert main(["compare", str(space), str(space)]) == 0
    same = capsys.readouterr().out
    count = len(compare_runs(space, space))
    assert same == f"{count} of {count} figures are the same, but for round-off\n"
    summary = json.loads((space / "results.json").read_text())
    summary["contact"]["joint"]["pressure_max"] *= 1.25
    summary["contact"]["joint"]["resultant"][0] = 0.5 * summary["contact"]["joint"]["resultant"][2]
    del summary["energy"]
    (tmp_path / "results.json").write_text(json.dumps(summary))
    rows = {row.name: row for row in compare_runs(space, tmp_path) if not row.same}
    assert set(rows) == {"contact.joint.pressure_max", "contact.joint.resultant", "energy"}
    assert rows["contact.joint.pressure_max"].difference == pytest.approx(0.2)
    assert rows["contact.joint.resultant"].difference == pytest.approx(0.5)
    assert rows["energy"].second is None and np.isnan(rows["energy"].difference)
    assert main(["compare", str(space), str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "20 %" in printed and f"{count - 3} of {count} figures" in printed
