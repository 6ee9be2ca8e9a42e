"""Report of a cut's cost: children against parents, sizes, variants, the refusal, and its three forms."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lacmesh import Cut, Mesh, cut_skin, read, write
from lacmesh.cells import CELLS
from lacmesh.checks import Finding, check
from lacmesh.checks.findings import Where
from lacmesh.cli import main
from lacmesh.cutting.patterns import RING_PARENTS, WHOLE_FACES
from lacmesh.errors import CutError, RequestError, WriteError
from lacmesh.quality import corner_jacobian
from lacmesh.report import children_quality, cut_report, refuse_poor, write_report
from lacmesh.report.parents import parents_of
from tests.meshes import cell_with_faces, random_mesh

DATA = Path(__file__).resolve().parents[1] / "data"
#: every way to cut one cell by one of its facets
CASES = [
    (name, facet, hexa)
    for name, cell in CELLS.items()
    if cell.dim > 1
    for facet in range(len(cell.facets))
    for hexa in (("pyramid", "hexa") if name in RING_PARENTS and cell.dim == 3 else ("pyramid",))
    if cell.facets[facet].type not in WHOLE_FACES
]


@pytest.mark.parametrize(("name", "facet", "hexa"), CASES)
def test_parents_are_put_together_from_their_children(name, facet, hexa):
    mesh = cell_with_faces(name, (facet,), rotation=facet, inward=bool(facet % 2), seed=facet)
    cut = cut_skin(mesh, "slave", hexa=hexa)
    groups = list(parents_of(cut))
    assert sorted(kind for kind, *_ in groups) == sorted([name, CELLS[name].facets[facet].type])
    for kind, nodes, children in groups:
        assert set(nodes[0].tolist()) == set(mesh.block(kind)[0].tolist())
        before = corner_jacobian(kind, mesh.points[mesh.block(kind)])
        assert corner_jacobian(kind, cut.mesh.points[nodes]) == pytest.approx(before, abs=1e-12)
        owned = cut.parent_of_cell[children[0]]
        assert (owned == mesh.cell_number[mesh.offsets[[b.type for b in mesh.blocks].index(kind)]]).all()


@pytest.mark.filterwarnings("ignore:slave faces stand twice:lacmesh.LacmeshWarning")
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2), (3, 3)])
def test_children_are_compared_with_the_same_parents_with_and_without_the_mesh_before(seed, dim, order):
    rng = np.random.default_rng(seed)
    mesh = random_mesh(rng, dim, order, slaves=4, twins=seed % 2 == 1)
    cut = cut_skin(mesh, "slave")
    found, report = children_quality(cut), cut_report(mesh, cut)
    if not report.comparisons:
        assert found is None
        return
    assert found.children == sum(c.cells[1] for c in report.comparisons)
    assert found.parents + found.unknown == sum(c.cells[0] for c in report.comparisons)
    assert found.child.least == min(c.after["corner_jacobian"].least for c in report.comparisons if c.dim > 1)
    if not found.unknown:
        ratios = [c.ratio for c in report.comparisons if c.dim > 1]
        assert found.ratio.count == sum(r.count for r in ratios)
        assert found.ratio.least == pytest.approx(min(r.least for r in ratios), rel=1e-9)
        assert found.ratio.mean * found.ratio.count == pytest.approx(sum(r.mean * r.count for r in ratios), rel=1e-9)


def test_parents_cut_by_two_faces_are_counted_as_unknown():
    mesh = cell_with_faces("HEXA8", (0, 1))
    found = children_quality(cut_skin(mesh, "slave"))
    assert (found.parents, found.unknown) == (2, 1)  # both faces, not the hexahedron


@pytest.mark.parametrize("order", [1, 2])
def test_the_report_counts_and_measures(order):
    rng = np.random.default_rng(12)
    mesh = random_mesh(rng, 3, order, slaves=5)
    cut = cut_skin(mesh, "slave")
    report = cut_report(mesh, cut)
    touched = np.isin(mesh.cell_number, cut.parent_of_cell)
    dims = mesh.cell_dim[touched]
    assert [(c.dim, c.cells[0]) for c in report.comparisons] == [(d, (dims == d).sum()) for d in (3, 2)]
    for size in report.sizes:
        assert size.before > 0 and abs(size.change) < 1e-12, size
    assert {s.group for s in report.sizes} == {None, *(n for n, g in mesh.cell_groups.items() if touched[g].any())}
    values = [w.value for w in report.worst]
    assert values == sorted(values) and values[0] == pytest.approx(report.summary.worst[1])
    by_number = {int(n): k for k, n in enumerate(cut.mesh.cell_number)}
    for w in report.worst:
        cell = by_number[w.number]
        assert cut.parent_of_cell[cell] == w.parent
        assert w.groups == tuple(n for n, g in cut.mesh.cell_groups.items() if cell in g)
    assert report.internal == {"slave": (cut.n_macros, min(map(len, cut.internal_nodes)))}


def stretched(depth):
    """Two hexahedra on each other; the slave is the upper one's top. Flat ones are cut better as rings."""
    z = np.array([0, 1, 1 + depth])
    points = [(x, y, h) for h in z for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    cells = [[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 6, 7, 8, 9, 10, 11]]
    return Mesh.create(points, [("HEXA8", cells), ("QUAD4", [[8, 9, 10, 11]])], cell_groups={"slave": [2], "b": [0, 1]})


@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
def test_the_report_says_which_variant_is_better(hexa):
    mesh = stretched(0.2)
    least = {}
    for name in ("pyramid", "hexa"):
        made = cut_skin(mesh, "slave", hexa=name).mesh
        kinds = [(b.type, made.points[b.nodes[1 if b.type == "HEXA8" else 0 :]]) for b in made.blocks]
        least[name] = min(corner_jacobian(k, x).min() for k, x in kinds if CELLS[k].dim == 3 and len(x))
    report = cut_report(mesh, cut_skin(mesh, "slave", hexa=hexa))
    other, best = ("hexa", "pyramid")[hexa == "hexa"], max(least, key=least.get)
    assert report.variants.hexahedra == 1 and report.variants.now == pytest.approx(least[hexa])
    assert report.variants.least == pytest.approx(least)
    assert report.variants.better == {hexa: 0, other: int(best == other)}
    better = [w.better for w in report.worst if w.parent_type == "HEXA8"]
    assert all(b == ((best, pytest.approx(least[best])) if best != hexa else None) for b in better)


def test_a_cut_of_another_mesh_is_refused():
    mesh = stretched(1)
    other = replace(mesh, cell_number=mesh.cell_number + 50)
    with pytest.raises(CutError, match="the cut is of another mesh"):
        cut_report(other, cut_skin(mesh, "slave"))


# ---- what the check found


def checked(tmp_path, *findings):
    """The three forms of a report with findings, as text."""
    mesh = stretched(0.2)
    report = cut_report(mesh, cut_skin(mesh, "slave"), findings=findings)
    for suffix in (".html", ".md", ".json"):
        write_report(tmp_path / f"told{suffix}", report)
    return [(tmp_path / f"told{suffix}").read_text(encoding="utf-8") for suffix in (".html", ".md", ".json")]


def test_findings_stand_in_every_form(tmp_path):
    bad = Finding("shared-node", "error", (1, 2), (7,), Where("slave"), "node 7 is <of> both|sides; part them")
    good = Finding("bodies", "info", (), (), Where(), "the cells make 2 bodies")
    page, text, told = checked(tmp_path, bad, good)
    assert '<b class="missed">error, shared-node in slave</b>: node 7 is &lt;of&gt; both|sides; part them.' in page
    assert "<b>info, bodies</b>: the cells make 2 bodies." in page
    assert "**error, shared-node in slave**: node 7 is \\<of\\> both\\|sides; part them." in text
    assert json.loads(told)["findings"] == [bad.as_dict(), good.as_dict()]


def test_a_cut_with_nothing_found_is_told_from_one_that_was_not_checked(tmp_path):
    page, text, told = checked(tmp_path)
    assert "What the check found" in page and "What the check found\n\nNothing." in text
    assert json.loads(told)["findings"] == []
    mesh = stretched(0.2)
    report = cut_report(mesh, cut_skin(mesh, "slave"))
    assert report.as_json()["findings"] is None
    write_report(tmp_path / "not.html", report)
    assert "What the check found" not in (tmp_path / "not.html").read_text(encoding="utf-8")


def test_the_findings_of_a_check_can_be_told(tmp_path):
    mesh = stretched(0.2)
    cut = cut_skin(mesh, "slave")
    found = check(cut, "slave")
    assert cut_report(mesh, cut, findings=found).findings == found.findings


# ---- the refusal


def test_cells_below_the_least_quality_are_refused_by_name():
    mesh = stretched(0.2)
    cuts = {hexa: cut_skin(mesh, "slave", hexa=hexa) for hexa in ("pyramid", "hexa")}
    least = {hexa: cut_report(mesh, c).summary.worst[1] for hexa, c in cuts.items()}
    worse, better = sorted(least, key=least.get)
    middle = sum(least.values()) / 2
    assert least[worse] < middle < least[better]
    refuse_poor(mesh, cuts[better], middle)
    with pytest.raises(CutError) as error:
        refuse_poor(mesh, cuts[worse], middle)
    told = str(error.value)
    assert f"--hexa {better} is enough" in told and "of the HEXA8 2 at (" in told and f"{least[worse]:.3g}" in told
    assert error.value.cells and set(error.value.cells) <= set(cuts[worse].mesh.cell_number.tolist())
    assert error.value.status == 1
    with pytest.raises(CutError, match=r"refine the mesh, or ask for less|is better there, not enough"):
        refuse_poor(mesh, cuts[worse], 0.99)


def test_bad_parents_are_told_from_bad_cuts():
    mesh = stretched(0.2)
    points = mesh.points.copy()
    points[8:, 0] += 3  # the parent leans over
    mesh = replace(mesh, points=points)
    with pytest.raises(CutError, match="Their parents were below it before"):
        refuse_poor(mesh, cut_skin(mesh, "slave"), 0.5)


# ---- the three forms


def histograms(report):
    """Number of histograms of a report: a measure each of solids and of surfaces, and the ratio to the parent."""
    return sum(len(c.after) + 1 for c in report.comparisons if c.dim > 1)


@pytest.fixture(scope="module")
def report():
    mesh = random_mesh(np.random.default_rng(3), 3, 1, slaves=5)
    groups = {**mesh.cell_groups, "<b>&|*": mesh.cell_groups["all"]}
    mesh = replace(mesh, cell_groups=groups)
    return cut_report(mesh, cut_skin(mesh, "slave"))


def test_html_needs_nothing_else(report, tmp_path):
    path = tmp_path / "report.html"
    write_report(path, report, name="a <part> & more.msh")
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"https?:|//|src=|href=|@import|url\(|<script", text)
    assert "a &lt;part&gt; &amp; more.msh" in text and "<b>&|*" not in text and "&lt;b&gt;&amp;|*" in text
    assert text.count("<svg") == histograms(report) > 5
    for tag in ("table", "div", "p", "svg", "main", "details", "tr", "td"):
        assert len(re.findall(rf"<{tag}[ >]", text)) == text.count(f"</{tag}>"), tag
    assert len(text) < 200_000


@pytest.mark.browser
def test_html_opens_in_a_browser(report, tmp_path):
    """Nothing is said on the console, everything is there, and no row of charts or table runs out of the page."""
    from tests.viewing import Browser

    path = tmp_path / "report.html"
    write_report(path, report, name="part.msh")
    browser = Browser(tmp_path / "profile", flags=())
    try:
        browser.ask("Page.navigate", url=path.as_uri())
        browser.wait("location.protocol == 'file:' && document.readyState == 'complete'")
        assert browser.said == [] and browser.value("document.title") == "The cut of part.msh"
        wide = "[...document.querySelectorAll('svg')].filter(s => s.getBBox().width > 200).length"
        assert browser.value(wide) == histograms(report)
        for width, scheme in ((1200, "light"), (400, "light"), (400, "dark")):
            size = {"width": width, "height": 800, "deviceScaleFactor": 1, "mobile": False}
            browser.ask("Emulation.setDeviceMetricsOverride", **size)
            media = [{"name": "prefers-color-scheme", "value": scheme}]
            browser.ask("Emulation.setEmulatedMedia", features=media)
            assert browser.value("document.documentElement.scrollWidth <= window.innerWidth")
            ink, ground = (
                browser.value(f"getComputedStyle(document.body).{of}") for of in ("color", "backgroundColor")
            )
            ink, ground = (sum(map(int, re.findall(r"\d+", colour)[:3])) for colour in (ink, ground))
            assert (ink > ground + 300) if scheme == "dark" else (ground > ink + 300)
    finally:
        browser.close()


def test_markdown_has_every_table_row(report, tmp_path):
    path = tmp_path / "report.md"
    write_report(path, report, name="part.msh")
    text = path.read_text(encoding="utf-8")
    page = tmp_path / "report.html"
    write_report(page, report, name="part.msh")
    html = page.read_text(encoding="utf-8")
    assert text.startswith("# The cut of part.msh") and text.count("\n# ") == 0
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert sum(len(table.splitlines()) - 1 for table in tables) == html.count("<tr")
    for table in tables:
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1
    facts = re.findall(r"<span>([^<]*)</span><b>([^<]*)</b>", html)
    assert len(facts) == 6 and all(f"- {label}: **{value}**" in text for label, value in facts)
    assert "\\<b\\>&\\|\\*" in text and "█" in text


def test_json_has_its_schema(report, tmp_path):
    path = tmp_path / "report.json"
    write_report(path, report, name="part.msh")
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["schema"] == "lacmesh.cut_report/1" and found["name"] == "part.msh"
    assert list(found) == [
        *("name", "schema", "zones", "nodes", "cells", "replaced", "children", "touched", "sizes", "worst"),
        *("variants", "types_before", "types_after", "findings"),
    ]
    for touched in found["touched"]:
        assert list(touched) == ["dim", "cells", "invalid", "before", "after", "ratio_to_parent"]
        assert list(touched["before"]) == list(touched["after"])
    assert found["worst"][0]["corner_jacobian"] == report.worst[0].value


@pytest.mark.parametrize("suffix", [".html", ".md", ".json"])
def test_a_cut_that_touches_no_cell_has_a_report_too(suffix, tmp_path):
    mesh = cell_with_faces("HEXA27")
    write_report(tmp_path / f"r{suffix}", cut_report(mesh, cut_skin(mesh, "slave")))
    assert (tmp_path / f"r{suffix}").stat().st_size > 100


def test_reports_are_written_whole_or_not_at_all(report, tmp_path):
    path = tmp_path / "report.html"
    path.write_text("mine")
    with pytest.raises(RequestError, match="exists already"):
        write_report(path, report, force=False)
    with pytest.raises(RequestError, match=r"no report is written as '\.pdf'"):
        write_report(tmp_path / "report.pdf", report)
    with pytest.raises(WriteError, match="does not exist"):
        write_report(tmp_path / "no" / "report.md", report)
    (tmp_path / "folder.md").mkdir()
    with pytest.raises(WriteError, match="is no file"):
        write_report(tmp_path / "folder.md", report)
    assert path.read_text() == "mine" and sorted(p.name for p in tmp_path.iterdir()) == ["folder.md", "report.html"]


# ---- the command


@pytest.fixture
def msh(tmp_path):
    path = tmp_path / "part.msh"
    write(path, stretched(0.2))
    return path


def test_cut_refuses_what_is_below_the_least_quality(msh, tmp_path, capsys):
    out, told = tmp_path / "out.msh", tmp_path / "told.html"
    asked = ["cut", str(msh), "--slave", "slave", "-o", str(out)]
    assert main([*asked, "--min-quality", "0.9", "--report", str(told)]) == 1
    said = capsys.readouterr()
    assert "would have a quality below 0.9" in said.err and not said.out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["part.msh"]
    assert main([*asked, "--min-quality", "0.01", "--report", str(told)]) == 0
    assert f"report: {told}" in capsys.readouterr().out and told.read_text().startswith("<!DOCTYPE html>")
    assert Cut(read(out)).n_macros == 1


def test_a_cut_that_is_checked_reports_the_findings(tmp_path, capsys):
    told = tmp_path / "told.json"
    asked = ["cut", str(DATA / "two_blocks.msh"), "--slave", "slave", "--report", str(told), "-q", "--force"]
    assert main([*asked, "-o", str(tmp_path / "out.msh"), "--master", "master"]) == 0
    assert "gap" in [f["rule"] for f in json.loads(told.read_text())["findings"]]
    assert main([*asked, "-o", str(tmp_path / "out.msh")]) == 0
    assert json.loads(told.read_text())["findings"] is None


def test_a_cut_loads_neither_compiler_nor_measures(tmp_path):
    """Unless a report is asked for; so that it starts quickly."""
    asked = ["cut", str(DATA / "two_blocks.msh"), "--slave", "slave", "-o", str(tmp_path / "out.msh")]
    code = "import sys; from lacmesh.cli import main; main(sys.argv[1:]); print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code, *asked], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.splitlines()[-1].split())
    assert "lacmesh.quality.corner" in loaded
    assert not {"numba", "scipy", "matplotlib", "lacmesh.quality.measures", "lacmesh.report.compare"} & loaded


def test_reports_are_checked_before_anything_is_read(msh, tmp_path, capsys):
    asked = ["cut", str(msh), "--slave", "slave", "-o", str(tmp_path / "out.msh"), "--report"]
    assert main([*asked, str(tmp_path / "told.txt")]) == 2
    assert main([*asked, str(tmp_path / "no" / "told.md")]) == 3
    (tmp_path / "told.md").write_text("mine")
    assert main([*asked, str(tmp_path / "told.md")]) == 2
    assert main([*asked, str(tmp_path / "told.md"), "--force"]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out.msh", "part.msh", "told.md"]
    assert main(["cut", str(msh), "--slave", "slave", "--report", str(tmp_path / "told.json"), "-q"]) == 0
    assert json.loads((tmp_path / "told.json").read_text())["name"] == "part.msh"
    assert "no report is written as '.txt'" in capsys.readouterr().err


def test_a_mesh_cut_before_is_judged_by_its_children(msh, tmp_path, capsys):
    out = tmp_path / "out.msh"
    assert main(["cut", str(msh), "--slave", "slave", "-o", str(out), "-q"]) == 0
    again = ["cut", str(out), "--slave", "slave", "-o", str(tmp_path / "again.msh")]
    assert main([*again, "--min-quality", "0.9"]) == 1
    assert "cells of this cut have a quality below 0.9" in capsys.readouterr().err
    assert main([*again, "--report", str(tmp_path / "r.md")]) == 0
    assert "no report is written" in capsys.readouterr().err and not (tmp_path / "r.md").exists()


def test_quality_of_a_cut_tells_what_the_cut_cost(msh, tmp_path, capsys):
    out = tmp_path / "out.msh"
    assert main(["cut", str(msh), "--slave", "slave", "-o", str(out), "-q"]) == 0
    capsys.readouterr()
    assert main(["quality", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["cut"]
    mesh = read(msh)
    expected = cut_report(mesh, cut_skin(mesh, "slave"))
    assert found["children"] == 9 and found["parents"] == 2 and found["parents_unknown"] == 0
    assert found["ratio_to_parent"]["min"] == pytest.approx(min(c.ratio.least for c in expected.comparisons), rel=1e-9)
    assert main(["quality", str(out)]) == 0
    assert "cut: 9 children, 0 invalid; 2 parents put together again" in capsys.readouterr().out


def test_quality_prints_tables_and_bars(msh, capsys):
    assert main(["quality", str(msh)]) == 0
    told = capsys.readouterr().out
    assert "3 cells measured, 0 invalid, 0 poor" in told and "HEXA8: 2 cells, 0 invalid, 0 poor" in told
    assert "0.9 to 1" in told and ("█" in told or "#" in told) and "slave" in told
    assert main(["quality", str(msh), "--group", "b", "--measures", "skew,oddy,area"]) == 0
    told = capsys.readouterr().out
    assert "group b: 2 cells measured" in told and "oddy" in told and "QUAD4" not in told
    assert main(["quality", str(msh), "-q"]) == 0 and not capsys.readouterr().out


def test_quality_counts_invalid_cells_and_exits_0(tmp_path, capsys):
    mesh = stretched(0.2)
    points = mesh.points.copy()
    points[8] = [0.5, 0.5, 0.9]
    path = tmp_path / "bad.msh"
    write(path, replace(mesh, points=points))
    assert main(["quality", str(path)]) == 0
    told = capsys.readouterr().out
    assert "HEXA8: 2 cells, 1 invalid (1 at a corner" in told and "invalid at" in told


def test_plots_are_drawn(msh, tmp_path, capsys):
    image = pytest.importorskip("matplotlib.image")
    path = tmp_path / "q.png"
    assert main(["quality", str(msh), "--plot", str(path)]) == 0
    pixels = image.imread(path)
    assert pixels.shape[1] > 1000 and 0.02 < (pixels[..., :3].mean(axis=2) < 0.9).mean() < 0.6
    assert str(path) in capsys.readouterr().out
    assert main(["quality", str(msh), "--plot", str(path)]) == 2
    assert main(["quality", str(msh), "--plot", str(path), "--force", "-q"]) == 0


def test_a_plot_without_matplotlib_names_the_line_that_installs_it(msh, tmp_path, monkeypatch, capsys):

    monkeypatch.setattr("lacmesh.errors.find_spec", lambda name: None)
    assert main(["quality", str(msh), "--plot", str(tmp_path / "q.png")]) == 2
    assert "pip install 'lacmesh[view]'" in capsys.readouterr().err
