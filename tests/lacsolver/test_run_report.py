"""What is written of a run beside its fields: its report, two runs compared, natural modes."""

import json
import re
from importlib.util import find_spec

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.errors import ReadError, RequestError
from lacmesh.formats.vtu import read_pvd
from lacsolver.case import read_case
from lacsolver.cli import main
from lacsolver.output import read_state
from lacsolver.output.modes import read_modes
from lacsolver.problem.problem import Problem
from lacsolver.vibration.natural_modes import natural_modes
from tests.lacsolver.bad_cases import GOOD, HEAVY, blocks, put, without
from tests.lacsolver.test_pictures import solved, solved_in_space


@pytest.fixture(scope="module")
def space(tmp_path_factory):
    """The folder of a run in space, in three steps."""
    return solved_in_space(tmp_path_factory.mktemp("report"), 3)


@pytest.fixture(scope="module")
def page(space):
    """The report of that run."""
    assert main(["report", str(space), "-q"]) == 0
    return space / "report.html"


# ---- the report


@pytest.mark.vtk
def test_the_page_has_the_figures_of_the_run(space, page, tmp_path):
    """In Markdown it has its pictures beside it."""
    text, results = page.read_text(), ls.read_results(space)
    assert f"{results.summary['contact']['joint']['pressure_max']:.5g}" in text and "(MPa)" in text
    assert text.count('src="data:image/png;base64,') == 4
    assert text.count("<h2>") == 7 and "value = &quot;t * (1 + x)&quot;" in text  # the case, as text
    assert not re.search(r"http(?!-equiv)|<script", re.sub(r"base64,[^\"]*", "", text))
    turning = find_spec("trame_pyvista") is not None
    assert ('href="report_model.html"' in text) == turning == (page.parent / "report_model.html").exists()
    assert main(["report", str(space), "-o", str(tmp_path / "r.md"), "-q"]) == 0
    text = (tmp_path / "r.md").read_text()
    low, high = results.summary["stress"][""]["zz"]
    assert low < high and f"{low:.5g} .. {high:.5g}" in text
    shown = re.findall(r"\]\((r_\w+\.png)\)", text)
    assert shown == [f"r_{name}.png" for name in ("pressure", "status", "curves", "convergence")]
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in shown)
    assert main(["report", str(space), "-o", str(tmp_path / "r.md"), "-q"]) == 2
    assert main(["report", str(space), "-o", str(tmp_path / "s.md"), "--case", str(tmp_path / "no.toml")]) == 3


def test_a_plane_run_reports_when_it_ends_and_one_without_contact_too(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD)
    assert main(["run", "case.toml", "--report", "r.html"]) == 0
    assert capsys.readouterr().out.endswith("the report: r.html\n")
    assert "<h2>Contact</h2>" in (tmp_path / "r.html").read_text()
    assert main(["run", "case.toml", "--report", "r.html", "-o", "again"]) == 2 and not (tmp_path / "again").exists()
    ls.read_results("case").report("other.html")
    assert "young = 1000.0" in (tmp_path / "other.html").read_text()
    with pytest.raises(RequestError, match="is written as"):
        ls.read_results("case").report("r.pdf")
    solved(tmp_path, without("contact", "pressure") + '[[displacement]]\ngroup = "top"\nuy = -0.1\n')
    assert main(["report", "case.toml", "-o", "r.html", "-q", "--force"]) == 0
    assert "<h2>Contact</h2>" not in (tmp_path / "r.html").read_text()


# ---- natural modes


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two blocks in contact, one of which only contact supports: a case, and its run."""
    place = tmp_path_factory.mktemp("modes")
    solved(place, HEAVY, blocks())
    return place


def modes_of(folder, name, *words):
    assert main(["modes", str(folder / "case.toml"), "-o", str(folder / name), *words]) == 0
    return read_modes(folder / name)


def test_modes_are_written_and_each_has_a_line(folder, capsys):
    modes = natural_modes(Problem.of(read_case(folder / "case.toml")), count=4)
    told, there = modes_of(folder, "modes", "-k", "4"), folder / "modes"
    assert told == json.loads((there / "modes.json").read_text())
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
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    f, part = told["frequencies"][0], told["effective_masses"]["x"][0] / told["mass"]
    assert ["1", "0"] in rows and ["2", f"{f:.6g}", f"{1 / f:.4g}", f"{part:.2%}"] in [row[:4] for row in rows]


def test_fewer_modes_replace_all_that_were_there_and_damaged_ones_are_told(folder, tmp_path):
    modes_of(folder, "again", "-q", "-k", "5")
    (folder / "again" / "notes.txt").write_text("mine")
    modes_of(folder, "again", "-q", "-k", "1", "--mass", "lumped", "--force")
    names = {path.name for path in (folder / "again").rglob("*") if path.is_file()}
    assert names == {"modes.json", "modes.pvd", "notes.txt", "mode_0001.vtu", "mode_0002.vtu"}
    for content in ("{", "[]", '{"rigid": "no"}'):
        (tmp_path / "modes.json").write_text(content)
        with pytest.raises(ReadError, match="lacsolver modes wrote"):
            read_modes(tmp_path)


def test_modes_about_a_state_of_a_run(folder, capsys):
    told = modes_of(folder, "closed", "--state", str(folder / "case"), "--from", "1")
    assert "joint 3" in capsys.readouterr().out
    case = read_case(folder / "case.toml")
    modes = natural_modes(Problem.of(case), at=read_state(folder / "case", case))
    assert told["frequencies"] == modes.frequencies.tolist()
    assert told["rigid"] == 0 and told["closed_rows"] == {"joint": 3} and told["time"] == 1.0
