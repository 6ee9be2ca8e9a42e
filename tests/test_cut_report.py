"""`lacmesh cut`: the report of its cost, the cells that it refuses, the programs that it cuts for, the master."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacmesh import Cut, Mesh, cut_skin, generate, read, write
from lacmesh.checks import Finding, check
from lacmesh.checks.findings import Where
from lacmesh.cli import main
from lacmesh.errors import CutError, RequestError, WriteError
from lacmesh.report import children_quality, cut_report, refuse_poor, write_report
from tests.meshes import cell_with_faces, random_mesh

DATA = Path(__file__).resolve().parents[1] / "data"
BLOCKS = str(DATA / "two_blocks.msh")
FORMS = (".html", ".md", ".json")


def stretched(depth=0.2):
    """Two hexahedra on each other; the slave is the upper one's top. Flat ones are cut better as rings."""
    mesh = generate.box((1, 1, [0, 1, 1 + depth])).only("body", "top")
    return mesh.renamed(body="b", top="slave")


@pytest.fixture(scope="module")
def report():
    mesh = random_mesh(np.random.default_rng(3), 3, 1, slaves=5)
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "<b>&|*": mesh.cell_groups["all"]})
    return cut_report(mesh, cut_skin(mesh, "slave"))


@pytest.fixture
def msh(tmp_path):
    path = tmp_path / "part.msh"
    write(path, stretched())
    return path


# ---- what the report counts and measures


@pytest.mark.rows("2-1-4", "2-2-3")
@pytest.mark.filterwarnings("ignore:slave faces stand twice:lacmesh.LacmeshWarning")
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2), (3, 3)])
def test_the_report_counts_and_measures(seed, dim, order):
    mesh = random_mesh(np.random.default_rng(seed), dim, order, slaves=4, twins=seed % 2 == 1)
    cut = cut_skin(mesh, "slave")
    found, report = children_quality(cut), cut_report(mesh, cut)
    touched = np.isin(mesh.cell_number, cut.parent_of_cell)
    dims = mesh.cell_dim[touched]
    cells = [(d, (dims == d).sum()) for d in (dim, dim - 1)]
    assert [(c.dim, c.cells[0]) for c in report.comparisons] == [row for row in cells if row[1]]
    values = [w.corner_jacobian for w in report.worst]
    assert values == pytest.approx(sorted(values), abs=1e-9)
    by_number = {int(n): k for k, n in enumerate(cut.mesh.cell_number)}
    for w in report.worst:
        cell = by_number[w.cell]
        assert cut.parent_of_cell[cell] == w.parent
        assert w.groups == tuple(n for n, g in cut.mesh.cell_groups.items() if cell in g)
    assert report.internal == {"slave": (cut.n_macros, min(map(len, cut.internal_nodes)))}
    if not report.comparisons:
        assert found is None
        return
    assert values[0] == pytest.approx(report.summary.worst[1])
    assert found.children == sum(c.cells[1] for c in report.comparisons)
    assert found.child.least == min(c.after["corner_jacobian"].least for c in report.comparisons if c.dim > 1)
    assert found.invalid == sum(c.invalid[1] for c in report.comparisons)


def test_a_cut_of_another_mesh_is_refused():
    mesh = stretched(1)
    with pytest.raises(CutError, match="of another mesh"):
        cut_report(replace(mesh, cell_number=mesh.cell_number + 50), cut_skin(mesh, "slave"))


# ---- the refusal of poor cells


def test_cells_below_the_least_quality_are_refused_by_name():
    mesh = stretched()
    cuts = {hexa: cut_skin(mesh, "slave", hexa=hexa) for hexa in ("pyramid", "hexa")}
    least = {hexa: cut_report(mesh, c).summary.worst[1] for hexa, c in cuts.items()}
    worse, better = sorted(least, key=least.get)
    middle = sum(least.values()) / 2
    assert least[worse] < middle < least[better]
    refuse_poor(mesh, cuts[better], middle)
    with pytest.raises(CutError, match=rf"HEXA8 2 at \(.* {least[worse]:.3g} .*--hexa {better} is enough") as error:
        refuse_poor(mesh, cuts[worse], middle)
    assert error.value.cells and set(error.value.cells) <= set(cuts[worse].mesh.cell_number.tolist())
    assert error.value.status == 1
    with pytest.raises(CutError, match=r"refine the mesh, or ask for less|is better there, not enough"):
        refuse_poor(mesh, cuts[worse], 0.99)
    leaning = mesh.moved(lambda x: [x[0] + 3 * (x[2] > 1), x[1], x[2]])
    with pytest.raises(CutError, match="parents were below it before"):
        refuse_poor(leaning, cut_skin(leaning, "slave"), 0.5)


# ---- the three forms


def written(folder, report, name="part.msh"):
    """The three forms of a report, as text."""
    for suffix in FORMS:
        write_report(folder / f"told{suffix}", report, name=name)
    return [(folder / f"told{suffix}").read_text(encoding="utf-8") for suffix in FORMS]


def test_findings_of_the_check_are_in_every_form(tmp_path):
    mesh = stretched()
    cut = cut_skin(mesh, "slave")
    bad = Finding("shared-node", "error", (1, 2), (7,), Where("slave"), "node 7 is <of> both|sides; part them")
    page, text, told = written(tmp_path, cut_report(mesh, cut, findings=(bad,)))
    assert "node 7 is &lt;of&gt; both|sides; part them." in page
    assert "node 7 is \\<of\\> both\\|sides; part them." in text
    assert json.loads(told)["findings"] == json.loads(json.dumps([bad.as_dict()]))
    found = check(cut, "slave")
    assert cut_report(mesh, cut, findings=found).findings == found.findings
    for findings, listed in (((), []), (None, None)):  # nothing is found, and nothing was sought
        page, text, told = written(tmp_path, cut_report(mesh, cut, findings=findings))
        assert json.loads(told)["findings"] == listed
        assert all(("What the check found" in form) == (findings is not None) for form in (page, text))


def test_the_forms_say_the_same_and_need_nothing_else(report, tmp_path):
    html, text, plain = written(tmp_path, report, name="a <part> & more.msh")
    assert not re.search(r"https?:|//|src=|href=|@import|url\(|<script", html)
    assert "a &lt;part&gt; &amp; more.msh" in html and "<b>&|*" not in html and "&lt;b&gt;&amp;|*" in html
    for tag in set(re.findall(r"</(\w+)>", html)):
        assert len(re.findall(rf"<{tag}[ >]", html)) == html.count(f"</{tag}>"), tag
    assert text.startswith("# The cut of a") and "\\<b\\>\\&\\|\\*" in text
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert sum(len(table.splitlines()) - 1 for table in tables) == html.count("<tr")
    for table in tables:
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1
    found = json.loads(plain)
    assert found["name"] == "a <part> & more.msh"
    assert list(found) == ["name", "summary", "internal", "comparisons", "worst", "findings"]
    for own in found["comparisons"]:
        assert list(own) == ["dim", "cells", "invalid", "before", "after", "ratio"]
        assert list(own["before"]) == list(own["after"])
    assert found["worst"][0]["corner_jacobian"] == report.worst[0].corner_jacobian


def test_a_cut_that_touches_no_cell_has_a_report_too(tmp_path):
    mesh = cell_with_faces("HEXA27")
    assert all(len(form) > 100 for form in written(tmp_path, cut_report(mesh, cut_skin(mesh, "slave"))))


def test_reports_are_written_whole_or_not_at_all(report, tmp_path):
    path = tmp_path / "report.html"
    path.write_text("mine")
    (tmp_path / "folder.md").mkdir()
    for name, error, words in (
        ("report.html", RequestError, "exists already"),
        ("report.pdf", RequestError, r"written as '\.pdf'"),
        ("no/report.md", WriteError, "does not exist"),
        ("folder.md", WriteError, "is no file"),
    ):
        with pytest.raises(error, match=words):
            write_report(tmp_path / name, report, force=False)
    assert path.read_text() == "mine" and sorted(p.name for p in tmp_path.iterdir()) == ["folder.md", "report.html"]


# ---- the command: reports and least quality


def test_the_command_refuses_poor_cells_and_reports_before_it_cuts(msh, tmp_path, capsys):
    out, told = tmp_path / "out.msh", tmp_path / "told.html"
    asked = ["cut", str(msh), "--slave", "slave", "-o", str(out), "--report"]
    assert main([*asked, str(told), "--min-quality", "0.9"]) == 1
    said = capsys.readouterr()
    assert "quality below 0.9" in said.err and not said.out
    assert main([*asked, str(tmp_path / "told.txt")]) == 2
    assert main([*asked, str(tmp_path / "no" / "told.md")]) == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["part.msh"]
    told.write_text("mine")
    assert main([*asked, str(told)]) == 2
    assert main([*asked, str(told), "--force", "--min-quality", "0.01"]) == 0
    assert f"report: {told}" in capsys.readouterr().out and told.read_text().startswith("<!DOCTYPE html>")
    assert Cut(read(out)).n_macros == 1
    again = ["cut", str(out), "--slave", "slave", "-o", str(tmp_path / "again.msh")]  # it is judged by its children
    assert main([*again, "--min-quality", "0.9"]) == 1
    assert main([*again, "--report", str(tmp_path / "r.md")]) == 0
    said = capsys.readouterr().err
    assert "quality below 0.9" in said and "no report is written" in said and not (tmp_path / "r.md").exists()


def test_a_cut_that_is_checked_reports_the_findings(tmp_path):
    told = tmp_path / "told.json"
    asked = ["cut", BLOCKS, "--slave", "slave", "--report", str(told), "-q", "--force", "-o", str(tmp_path / "out.msh")]
    assert main([*asked, "--master", "master"]) == 0
    assert "gap" in [f["rule"] for f in json.loads(told.read_text())["findings"]]
    assert main(asked) == 0
    assert json.loads(told.read_text())["findings"] is None and json.loads(told.read_text())["name"] == "two_blocks.msh"


# ---- the command: programs and masters


def refused(capsys, target, *args):
    """The sentence of a command that must fail on the data, and leave nothing."""
    assert main(["cut", BLOCKS, "--slave", "slave", "-o", str(target), *args]) == 1
    assert not list(target.parent.iterdir())
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_cells_that_the_program_lacks_are_refused_before_the_cut(tmp_path, capsys):
    said = refused(capsys, tmp_path / "out.inp", "--for", "calculix")
    assert all(words in said for words in ("180 PYRAM5", "CalculiX", "--hexa hexa"))
    assert "mixture" in refused(capsys, tmp_path / "out.xdmf", "--for", "fenics", "--hexa", "hexa")


@pytest.mark.parametrize(("program", "hexa"), [("calculix", "hexa"), ("abaqus", "pyramid")])
def test_inp_is_written_for_the_program(tmp_path, program, hexa, capsys):
    """Also by `convert`, of a cut in another format, if the program takes its cells."""
    cut, target = tmp_path / "cut.msh", tmp_path / "out.inp"
    assert main(["cut", BLOCKS, "--slave", "slave", "-o", str(target), "--for", program, "--hexa", hexa]) == 0
    assert ("C3D5" in target.read_text()) == (program == "abaqus") and "C3D8" in target.read_text()
    assert "macro-elements of slave 36" in " ".join(capsys.readouterr().out.split())
    assert main(["cut", BLOCKS, "--slave", "slave", "-o", str(cut), "-q"]) == 0
    takes = main(["convert", str(cut), str(target), "--for", program, "-q", "--force"]) == 0
    assert takes == (program == "abaqus") and ("PYRAM5" in capsys.readouterr().err) != takes
    assert ("C3D5" in target.read_text()) == takes


@pytest.mark.parametrize("program", ["gmsh", "aster"])
def test_other_files_may_be_for_a_program_too(tmp_path, program, capsys):
    target = tmp_path / "out.med"
    assert main(["cut", BLOCKS, "--slave", "slave", "-o", str(target), "--for", program]) == 0
    assert lacmesh.read(target).n_cells > 1268
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note: ")]
    assert len(notes) == (program == "aster") and all("DECOUPE_LAC" in note and BLOCKS in note for note in notes)


def test_a_cut_is_checked_against_its_master_and_not_written_if_it_forbids(tmp_path, capsys):
    said = refused(capsys, tmp_path / "out.msh", "--master", "symmetry_x")
    assert "shared-nodes" in said and "share 7 nodes" in said
    assert main(["cut", BLOCKS, "--slave", "slave", "--master", "master", "-o", str(tmp_path / "out.msh")]) == 0
    printed = capsys.readouterr()
    assert "check " in printed.out and not printed.err


def test_a_master_far_away_is_found_within_the_search_distance(tmp_path, capsys):
    far = read(BLOCKS)
    upper = np.isin(np.arange(far.n_nodes), far.nodes_on(far.cell_groups["upper"]))
    write(tmp_path / "far.msh", replace(far, points=far.points + 5.0 * np.outer(upper, [0, 0, 1])))
    asked = ["cut", str(tmp_path / "far.msh"), "--slave", "slave", "--master", "master", "-q"]
    assert main([*asked, "-o", str(tmp_path / "out.msh")]) == 1
    assert "increase --search-distance" in capsys.readouterr().err
    assert main([*asked, "-o", str(tmp_path / "out.msh"), "--search-distance", "6"]) == 0
    assert main([*asked, "-o", str(tmp_path / "other.msh"), "--search-distance", "inf"]) == 2


def test_a_shell_that_was_cut_as_one_passes_the_check():
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    shell = Mesh.create(np.vstack([np.zeros(3), np.eye(3)]), [("TRIA3", faces)], cell_groups={"s": range(4)})
    assert check(shell, "s").rules[:2] == ("no-cells", "no-parent")
    assert not check(cut_skin(shell, "s", skin_only=True)).errors


# ---- `lacmesh quality`


def test_quality_prints_tables_and_what_the_cut_has_cost(msh, tmp_path, capsys):
    out = tmp_path / "out.msh"
    assert main(["quality", str(msh)]) == 0
    told = capsys.readouterr().out
    assert "3 cells measured, 0 invalid, 0 poor" in told and "HEXA8: 2 cells, 0 invalid, 0 poor" in told
    assert main(["quality", str(msh), "--group", "b", "--measures", "skew,oddy,area"]) == 0
    told = capsys.readouterr().out
    assert "group b: 2 cells measured" in told and "oddy" in told and "QUAD4" not in told
    assert main(["quality", str(msh), "-q"]) == 0 and not capsys.readouterr().out
    folded = stretched().moved(lambda x: np.where((x[2] > 1.1) & (x[0] + x[1] == 0), [[0.5], [0.5], [0.9]], x))
    write(tmp_path / "bad.msh", folded)
    assert main(["quality", str(tmp_path / "bad.msh")]) == 0
    assert "HEXA8: 2 cells, 1 invalid (1 at a corner" in capsys.readouterr().out
    assert main(["cut", str(msh), "--slave", "slave", "-o", str(out), "-q"]) == 0
    assert main(["quality", str(out)]) == 0
    assert "cut: 9 children, 0 invalid" in capsys.readouterr().out
    assert main(["quality", str(out), "--json"]) == 0
    found, mesh = json.loads(capsys.readouterr().out)["cut"], read(msh)
    expected = min(c.after["corner_jacobian"].least for c in cut_report(mesh, cut_skin(mesh, "slave")).comparisons)
    assert (found["children"], found["invalid_children"]) == (9, 0)
    assert found["corner_jacobian"]["min"] == pytest.approx(expected, rel=1e-9)


def test_plots_are_drawn(msh, tmp_path, capsys, monkeypatch):
    image = pytest.importorskip("matplotlib.image")
    path = tmp_path / "q.png"
    assert main(["quality", str(msh), "--plot", str(path)]) == 0
    pixels = image.imread(path)
    assert pixels.shape[1] > 1000 and 0.02 < (pixels[..., :3].mean(axis=2) < 0.9).mean() < 0.6
    assert str(path) in capsys.readouterr().out
    assert main(["quality", str(msh), "--plot", str(path)]) == 2
    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: None)
    assert main(["quality", str(msh), "--plot", str(path), "--force"]) == 2
    assert "pip install 'lacmesh[view]'" in capsys.readouterr().err
