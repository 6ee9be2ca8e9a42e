"""`lacmesh cut`: the report of its cost, the cells that it refuses, the programs that it cuts for, the master."""

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
from lacmesh.errors import CutError, RequestError, WriteError
from lacmesh.report import children_quality, cut_report, refuse_poor, write_report
from tests.meshes import cell_with_faces, random_mesh

DATA = Path(__file__).resolve().parents[1] / "data"
BLOCKS = str(DATA / "two_blocks.msh")
CUT = f"cut {BLOCKS} --slave slave"
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
@pytest.mark.filterwarnings("ignore:slave faces occur twice:lacmesh.LacmeshWarning")
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


def test_the_command_refuses_poor_cells_and_reports_before_it_cuts(msh, run):
    asked, told = "cut part.msh --slave slave -o out.msh --report", Path("told.html")
    said = run(f"{asked} {told} --min-quality 0.9", 1)
    assert "quality below 0.9" in said and said.startswith("lacmesh: error: ")
    run(f"{asked} told.txt", 2)
    run(f"{asked} no/told.md", 3)
    assert [p.name for p in Path().iterdir()] == ["part.msh"]
    told.write_text("mine")
    run(f"{asked} {told}", 2)
    assert f"report: {told}" in run(f"{asked} {told} --force --min-quality 0.01")
    assert told.read_text().startswith("<!DOCTYPE html>") and Cut(read("out.msh")).n_macros == 1
    again = "cut out.msh --slave slave -o again.msh"  # it is judged by its children
    assert "quality below 0.9" in run(f"{again} --min-quality 0.9", 1)
    assert "no report is written" in run(f"{again} --report r.md") and not Path("r.md").exists()


# ---- the command: programs and masters


#: what a cut of the blocks is for -> its output, words of the one sentence with which it is refused, and leaves nothing
REFUSED = {
    "--for calculix": ("out.inp", ("180 PYRAM5", "CalculiX", "--hexa hexa")),
    "--for fenics --hexa hexa": ("out.xdmf", ("mixture",)),
    "--master symmetry_x": ("out.msh", ("shared-nodes", "share 7 nodes")),
}


@pytest.mark.parametrize("options", REFUSED)
def test_what_the_program_or_the_check_forbids_is_refused_before_it_is_written(options, run):
    target, words = REFUSED[options]
    said = run(f"{CUT} -o {target} {options}", 1)
    assert all(word in said for word in words) and said.count("\n") == 1 and not list(Path().iterdir())


@pytest.mark.parametrize(("program", "hexa"), [("calculix", "hexa"), ("abaqus", "pyramid")])
def test_inp_is_written_for_the_program(program, hexa, run):
    """Also by `convert`, of a cut in another format, if the program takes its cells."""
    said, target = run(f"{CUT} -o out.inp --for {program} --hexa {hexa}"), Path("out.inp")
    assert ("C3D5" in target.read_text()) == (program == "abaqus") and "C3D8" in target.read_text()
    assert "macro-elements of slave 36" in " ".join(said.split())
    run(f"{CUT} -o cut.msh -q")
    takes = program == "abaqus"
    said = run(f"convert cut.msh out.inp --for {program} -q --force", 0 if takes else 1)
    assert ("PYRAM5" in said) != takes and ("C3D5" in target.read_text()) == takes


@pytest.mark.parametrize("program", ["gmsh", "aster"])
def test_other_files_may_be_for_a_program_too(program, run):
    notes = [line for line in run(f"{CUT} -o out.med --for {program}").splitlines() if line.startswith("note: ")]
    assert lacmesh.read("out.med").n_cells > 1268
    assert len(notes) == (program == "aster") and all("DECOUPE_LAC" in note and BLOCKS in note for note in notes)


def test_a_cut_is_checked_against_its_master_which_is_found_within_the_search_distance(run):
    said = run(f"{CUT} --master master -o out.msh")
    assert "check " in said and "lacmesh: " not in said
    far = read(BLOCKS)
    upper = np.isin(np.arange(far.n_nodes), far.nodes_on(far.cell_groups["upper"]))
    write("far.msh", replace(far, points=far.points + 5.0 * np.outer(upper, [0, 0, 1])))
    asked = "cut far.msh --slave slave --master master -q -o other.msh"
    assert "increase --search-distance" in run(asked, 1)
    run(f"{asked} --search-distance 6")
    run(f"{asked} --force --search-distance inf", 2)


def test_a_shell_that_was_cut_as_one_passes_the_check():
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    shell = Mesh.create(np.vstack([np.zeros(3), np.eye(3)]), [("TRIA3", faces)], cell_groups={"s": range(4)})
    assert check(shell, "s").rules[:2] == ("no-cells", "no-parent")
    assert not check(cut_skin(shell, "s", skin_only=True)).errors


# ---- `lacmesh quality`


def test_quality_prints_tables_and_what_the_cut_has_cost(msh, run):
    told = run("quality part.msh")
    assert "3 cells measured, 0 invalid, 0 poor" in told and "HEXA8: 2 cells, 0 invalid, 0 poor" in told
    told = run("quality part.msh --group b --measures skew,oddy,area")
    assert "group b: 2 cells measured" in told and "oddy" in told and "QUAD4" not in told
    assert not run("quality part.msh -q")
    folded = stretched().moved(lambda x: np.where((x[2] > 1.1) & (x[0] + x[1] == 0), [[0.5], [0.5], [0.9]], x))
    write("bad.msh", folded)
    assert "HEXA8: 2 cells, 1 invalid (1 at a corner" in run("quality bad.msh")
    run("cut part.msh --slave slave -o out.msh -q")
    assert "cut: 9 children, 0 invalid" in run("quality out.msh")
    found, mesh = json.loads(run("quality out.msh --json"))["cut"], read(msh)
    expected = min(c.after["corner_jacobian"].least for c in cut_report(mesh, cut_skin(mesh, "slave")).comparisons)
    assert (found["children"], found["invalid_children"]) == (9, 0)
    assert found["corner_jacobian"]["min"] == pytest.approx(expected, rel=1e-9)


def test_plots_are_drawn(msh, run, monkeypatch):
    image = pytest.importorskip("matplotlib.image")
    asked = "quality part.msh --plot q.png"
    assert "q.png" in run(asked)
    pixels = image.imread("q.png")
    assert pixels.shape[1] > 1000 and 0.02 < (pixels[..., :3].mean(axis=2) < 0.9).mean() < 0.6
    run(asked, 2)
    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: None)
    assert "pip install 'lacmesh[view]'" in run(f"{asked} --force", 2)
