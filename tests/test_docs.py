"""The pages: tables and figures are current, links lead somewhere, examples run, and what they claim holds."""

from __future__ import annotations

import doctest
import importlib
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lacmesh import cut_skin, errors
from lacmesh.cells import CELLS
from lacmesh.cutting.cut import CELL_RECORDS, NODE_RECORD
from lacmesh.cutting.patterns import RING_PARENTS, WHOLE_FACES, parent_pattern
from lacmesh.reference.shapes import shape
from lacsolver.case import errors as case_errors
from lacsolver.equilibrium.stepping import NotConvergedError
from lacsolver.linear import errors as linear_errors
from tests.meshes import cell_with_faces
from tests.properties import volumes

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))


@pytest.fixture(scope="module")
def make_figures():
    """docs/make_figures.py, imported as when it runs: from its own folder."""
    before = set(sys.modules)
    sys.path.insert(0, str(DOCS))
    try:
        yield importlib.import_module("make_figures")
    finally:
        sys.path.remove(str(DOCS))
        for name in set(sys.modules) - before:
            if name.split(".")[0] in ("make_figures", "drawing"):
                del sys.modules[name]


# ---- tables and figures


@pytest.mark.parametrize("page", ["cut.md", "case.md", "conventions.md", "formats.md", "targets.md", "quality.md"])
def test_tables_are_current(make_figures, page):
    text = (DOCS / page).read_text(encoding="utf-8")
    assert make_figures.with_tables(page, text) == text, "run: python docs/make_figures.py"
    assert len(make_figures.TABLES[page]) == text.count(": begin -->") == text.count(": end -->")


def test_a_changed_table_is_seen(make_figures):
    text = (DOCS / "cut.md").read_text(encoding="utf-8")
    wrong = text.replace("| 28 | 9 |", "| 27 | 9 |")
    assert wrong != text and make_figures.with_tables("cut.md", wrong) == text


def every_pattern():
    """(cell, facet type, kind), from the tables of the cut and not from the script."""
    found = set()
    for name, cell in CELLS.items():
        for face in {f.type for f in cell.facets} if cell.dim > 1 else ():
            kinds = ("whole",) if face in WHOLE_FACES else ("cone", "ring") if name in RING_PARENTS else ("cone",)
            found |= {(name, face, kind) for kind in kinds}
    return sorted(found)


@pytest.mark.parametrize("pattern", every_pattern(), ids="_".join)
def test_every_pattern_has_its_figure(make_figures, pattern):
    name = "_".join(pattern).lower() + ".svg"
    path = DOCS / "figures" / name
    assert path.stat().st_size < 60_000
    digest = make_figures.digest(make_figures.figures()[name])
    assert digest in path.read_text(encoding="utf-8"), "run: python docs/make_figures.py"


def test_no_figure_is_stale_or_of_no_pattern(make_figures):
    assert make_figures.stale_figures() == []
    assert len(list((DOCS / "figures").glob("*.svg"))) == len(every_pattern()) + 1  # and the overview
    assert (DOCS / "figures" / make_figures.OVERVIEW).stat().st_size < 60_000


@pytest.mark.parametrize("name", ["hexa8_quad4_ring.svg", "penta15_tria6_cone.svg", "patterns.svg"])
def test_a_figure_drawn_again_is_the_same(make_figures, name, tmp_path):
    matplotlib = pytest.importorskip("matplotlib")
    kept = (DOCS / "figures" / name).read_text(encoding="utf-8")
    if f"matplotlib {matplotlib.__version__}<" not in kept:
        pytest.skip("drawn by another version of matplotlib")
    make_figures.write_figure(name, tmp_path / name)
    drawn = (tmp_path / name).read_text(encoding="utf-8")
    number = re.compile(r"-?\d+(?:\.\d+)?")
    assert number.sub("#", drawn) == number.sub("#", kept)
    mine, theirs = ([float(x) for x in number.findall(svg.split("<defs>", 1)[1])] for svg in (drawn, kept))
    np.testing.assert_allclose(mine, theirs, atol=0.02)


def test_figures_are_painted_from_back_to_front(make_figures):
    """The nearer of two cubes in line with the eye is painted last, whatever their order."""
    solids = sys.modules["drawing.solids"]
    cube = np.array(CELLS["HEXA8"].reference)
    for boxes, first in (([cube, cube + 5 * solids.EYE], 0), ([cube + 5 * solids.EYE, cube], 1)):
        planes = [[solids.plane(x[list(f)]) for f in solids.faces_of("HEXA8")] for x in boxes]
        assert solids.back_to_front(boxes, planes)[0] == first


# ---- links and examples


def anchors(text):
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ +(.+)$", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        there = (page.parent / path) if path else page
        assert there.exists(), f"{page.name}: {target}"
        if anchor:
            assert anchor in anchors(there.read_text(encoding="utf-8")), f"{page.name}: {target}"


def test_the_architecture_names_files_that_are_there():
    """Paths from the root of the repository, or inside lacsolver."""
    text = (DOCS / "architecture.md").read_text(encoding="utf-8").split("<!-- tree: end -->")[1]
    paths = re.findall(r"`((?:\w+/)+(?:\w+\.py)?)`", text)
    assert len(paths) > 60
    assert [p for p in paths if not (ROOT / p).exists() and not (ROOT / "lacsolver" / p).exists()] == []


def test_every_page_is_in_the_index():
    index = (DOCS / "README.md").read_text(encoding="utf-8")
    assert {p.name for p in PAGES} - {"README.md"} <= set(re.findall(r"\]\(([^)#]+\.md)\)", index))


#: run with the commands that make the files which the examples read
RUN_ELSEWHERE = {
    "overview.md": "tests/test_readme.py",
    "solver.md": "tests/lacsolver/test_solver_docs.py",
    "output.md": "tests/lacsolver/test_output_docs.py",
    "partition.md": "tests/partition/test_command.py",
}


def examples():
    for page in (p for p in PAGES if p.name not in RUN_ELSEWHERE):
        blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        if blocks:
            yield pytest.param(page.name, blocks, id=page.name)


@pytest.mark.parametrize(("page", "blocks"), list(examples()))
def test_examples_run(page, blocks):
    """Blocks of a page share their names; one with prompts is a doctest, another is run."""
    names = {}
    for k, block in enumerate(blocks):
        if ">>>" not in block:
            exec(compile(block, f"{page}[{k}]", "exec"), names)
            continue
        test = doctest.DocTestParser().get_doctest(block, names, f"{page}[{k}]", page, 0)
        runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
        report = []
        runner.run(test, out=report.append, clear_globs=False)
        assert not runner.failures, "".join(report)
        names = test.globs


# ---- what the pages claim, where no other test does


def moved(name, j, seed=0, by=0.05):
    """A cell with a slave face, its nodes moved at random."""
    mesh = cell_with_faces(name, (j,))
    move = by * np.random.default_rng(seed).uniform(-1, 1, mesh.points.shape)
    return replace(mesh, points=mesh.points + move * (1, 1, CELLS[name].dim == 3))


def volume_kept(name, j, hexa="pyramid"):
    before = moved(name, j)
    after = cut_skin(before, "slave", hexa=hexa).mesh
    sizes = [volumes(m)[m.cell_dim == m.dim].sum() for m in (before, after)]
    return abs(sizes[1] / sizes[0] - 1)


SOLIDS = [cell for cell in CELLS.values() if cell.dim == 3]
CUT_FACES = [(c.name, j, f.type) for c in SOLIDS for j, f in enumerate(c.facets) if f.type not in WHOLE_FACES]


@pytest.mark.parametrize(("name", "j", "face"), CUT_FACES)
def test_a_distorted_cell_keeps_its_volume_as_cut_md_says(name, j, face):
    for hexa in ("pyramid", "hexa") if name in RING_PARENTS else ("pyramid",):
        change = volume_kept(name, j, hexa)
        if face == "QUAD8":
            assert 1e-9 < change < (2e-3 if hexa == "hexa" else 2e-4)
        else:
            assert change < 1e-12


def test_children_of_a_curved_tetra10_have_its_map_and_those_of_a_hexa20_do_not():
    rng = np.random.default_rng(2)
    for name, kind, exact in (("TETRA10", "cone", True), ("HEXA20", "cone", False), ("HEXA20", "ring", False)):
        cell = CELLS[name]
        own = np.array(cell.reference)
        x = own + 0.1 * rng.uniform(-1, 1, own.shape)
        worst = 0.0
        for j in range(len(cell.facets)):
            pattern = parent_pattern(name, j, kind)
            where = np.vstack([own, pattern.on_face, pattern.inside])
            for block in pattern.children:
                child = CELLS[block.type]
                corners = np.array(child.reference[: child.n_corners])
                N = shape(block.type, 0.99 * rng.dirichlet(np.ones(child.n_corners), 20) @ corners)
                for nodes in block.nodes:
                    by_child, by_parent = N @ shape(name, where[nodes]) @ x, shape(name, N @ where[nodes]) @ x
                    worst = max(worst, np.abs(by_child - by_parent).max())
        assert worst < 1e-14 if exact else worst > 1e-3


def test_exit_statuses_are_the_errors_own():
    text = (DOCS / "conventions.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d) \|.*\| (`.*`) \|$", text, re.MULTILINE)
    listed = {name: int(status) for status, names in rows for name in re.findall(r"`(\w+)`", names)}
    known = [c for module in (errors, case_errors, linear_errors) for c in vars(module).values()]
    known.append(NotConvergedError)
    classes = {c.__name__: c for c in known if isinstance(c, type) and issubclass(c, errors.LacmeshError)}
    assert listed == {name: c.status for name, c in classes.items()}


def test_records_are_the_ones_listed():
    text = (DOCS / "conventions.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(lac_\w+)` \| (\w+) ", text, re.MULTILINE) == [
        *((name, "cells") for name in CELL_RECORDS),
        (NODE_RECORD, "nodes"),
    ]
