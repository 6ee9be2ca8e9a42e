"""What is written of a run beside its fields: its report, two runs compared, natural modes."""

from __future__ import annotations

import html
import json
import re

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.errors import ReadError, RequestError
from lacmesh.formats.vtu.collection import read_pvd
from lacsolver.case import read_case
from lacsolver.cli import main
from lacsolver.output import read_state
from lacsolver.output.modes import read_modes
from lacsolver.problem.problem import Problem
from lacsolver.reporting.comparing import compare_runs
from lacsolver.vibration.natural_modes import natural_modes
from tests.lacsolver.bad_cases import GOOD, HEAVY, blocks, put
from tests.lacsolver.patch_meshes import stack
from tests.lacsolver.test_plot import JOINT, SPACE, solved
from tests.test_view_page import unpacked
from tests.viewing import Browser

TOP = '[[displacement]]\ngroup = "top"\nuy = -0.1\n'
STEPS = '[steps]\ncount = 3\n[output]\nunits = "N, mm, MPa"\n'


@pytest.fixture(scope="module")
def space(tmp_path_factory):
    """The folder of a run in space, in three steps."""
    return solved(tmp_path_factory.mktemp("report"), SPACE + STEPS, stack("HEXA8", "TETRA4", 3, counts=(3, 2)))


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
    assert f"{zone['pressure_max']:.5g}" in text and "(MPa)" in text
    assert text.count('src="data:image/webp;base64,') == 2
    assert text.count("<h2>") == 8 and "value = &quot;t * (1 + x)&quot;" in text  # the case, as text
    assert not re.search(r"http(?!-equiv|://www.w3.org/2000/svg)", re.sub(r"base64,[^\"]*", "", text))


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
    assert "young = 1000.0" in (tmp_path / "other.html").read_text()


def test_a_run_without_contact_has_a_report_and_other_files_are_refused(tmp_path, space):
    load = '[[pressure]]\ngroup = "top"\nvalue = 1.0\n'
    folder = solved(tmp_path, GOOD.replace(JOINT, "").replace(load, "") + TOP, blocks())
    assert main(["report", str(folder.with_suffix(".toml")), "-o", str(tmp_path / "r.html"), "-q"]) == 0
    assert "<h2>Contact</h2>" not in (tmp_path / "r.html").read_text()
    with pytest.raises(RequestError, match="is written as"):
        ls.read_results(space).report(tmp_path / "r.pdf")
    with pytest.raises(ReadError, match="holds no results"):
        compare_runs(space, tmp_path)
    for content in ("{", "[]", '{"rigid": "no"}'):
        (tmp_path / "modes.json").write_text(content)
        with pytest.raises(ReadError, match="lacsolver modes wrote"):
            read_modes(tmp_path)


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


# ---- natural modes


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two blocks in contact, one of which only contact supports: their modes, and a run of the same case."""
    place = tmp_path_factory.mktemp("modes")
    put(blocks(), place)
    (place / "case.toml").write_text(HEAVY)
    assert main(["modes", str(place / "case.toml"), "-k", "4", "-q"]) == 0
    assert main(["run", str(place / "case.toml"), "-q"]) == 0
    return place


def test_modes_are_written_beside_the_case(folder):
    modes = natural_modes(Problem.of(read_case(folder / "case.toml")), count=4)
    there = folder / "case_modes"
    told = json.loads((there / "modes.json").read_text())
    assert told == read_modes(there)
    assert told["frequencies"] == modes.frequencies.tolist() and told["rigid"] == 1
    assert told["rigid_motions"] == ["'upper' moves along y"] and told["closed_rows"] == {"joint": 0}
    assert told["effective_masses"] == {a: modes.effective_masses[:, k].tolist() for k, a in enumerate("xy")}
    assert told["rigid_effective_masses"]["y"] == pytest.approx(1.0) and told["mass"] == pytest.approx(2.0)
    assert told["modal_masses"] == modes.modal_masses.tolist() and told["time"] is None
    files = read_pvd(there / "modes.pvd")
    assert list(files.items()) == [(float(k), f"fields/mode_{k:04d}.vtu") for k in range(1, 6)]
    shapes = np.concatenate([modes.rigid_shapes, modes.shapes])
    for file, shape in zip(files.values(), shapes, strict=True):
        u = lacmesh.read(there / file).node_data["displacement"]
        assert np.abs(u[:, :2] - shape).max() < 1e-15 and not u[:, 2].any()


def test_the_table_has_a_line_for_each_mode(folder, capsys):
    assert main(["modes", str(folder / "case.toml"), "-k", "2", "-o", str(folder / "few")]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    told = read_modes(folder / "few")
    f, part = told["frequencies"][0], told["effective_masses"]["x"][0] / told["mass"]
    assert ["1", "0"] in rows and ["2", f"{f:.6g}", f"{1 / f:.4g}", f"{part:.2%}"] in [row[:4] for row in rows]


def test_fewer_modes_replace_all_that_were_there(folder):
    words = ["modes", str(folder / "case.toml"), "-o", str(folder / "again"), "-q"]
    assert main([*words, "-k", "5"]) == 0
    (folder / "again" / "notes.txt").write_text("mine")
    assert main([*words, "-k", "1", "--mass", "lumped", "--force"]) == 0
    names = {path.name for path in (folder / "again").rglob("*") if path.is_file()}
    assert names == {"modes.json", "modes.pvd", "notes.txt", "mode_0001.vtu", "mode_0002.vtu"}


def test_modes_about_a_state_of_a_run(folder, capsys):
    words = ["modes", str(folder / "case.toml"), "-o", str(folder / "closed"), "--state", str(folder / "case")]
    assert main([*words, "--from", "1"]) == 0
    assert "joint 3" in capsys.readouterr().out
    case = read_case(folder / "case.toml")
    modes = natural_modes(Problem.of(case), at=read_state(folder / "case", case))
    told = read_modes(folder / "closed")
    assert told["frequencies"] == modes.frequencies.tolist()
    assert told["rigid"] == 0 and told["closed_rows"] == {"joint": 3} and told["time"] == 1.0
