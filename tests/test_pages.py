"""The pages: their commands and examples run and print what stands there; links, tables, figures and lists of names."""

import ast
import contextlib
import doctest
import importlib
import io
import json
import re
import subprocess
import sys
from dataclasses import fields as fields_of
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacsolver
from lacmesh import cut_skin, errors, raise_order, read
from lacmesh.cells import CELLS
from lacmesh.checks import RULES
from lacmesh.cutting.cut import CELL_RECORDS, NODE_RECORD
from lacmesh.cutting.patterns import RING_PARENTS, WHOLE_FACES, parent_pattern
from lacmesh.reference.shapes import shape
from lacsolver.case import errors as case_errors
from lacsolver.cli import PROGRAM
from lacsolver.cli import main as lacsolver_main
from lacsolver.equilibrium.stepping import NotConvergedError
from lacsolver.linear import errors as linear_errors
from lacsolver.output.summary import STEP_KEYS
from lacsolver.output.tables import CONTACT_COLUMNS, FRICTION_COLUMNS, TANGENT_COLUMNS
from lacsolver.results.results import STATUSES, FrictionFigures, ZoneFigures
from tests import REPOSITORY
from tests.lacsolver.written import ZONES, made_up
from tests.meshes import cell_with_faces
from tests.test_tutorials import shows_what_the_page_shows, tutorials
from verification.measures.cutting import sizes

__all__ = ["tutorials"]
DOCS = REPOSITORY / "docs"
PAGES = [REPOSITORY / "README.md", *sorted(DOCS.glob("*.md")), *sorted((DOCS / "tutorials").glob("*.md"))]
PACKAGES = ("lacmesh/*/__init__.py", "lacsolver/*/__init__.py")
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


def text_of(name):
    return (DOCS / name).read_text(encoding="utf-8")


def part_of(name, title, level="##"):
    """The part of a page below a heading."""
    return re.search(rf"^{level} {title}\n(.*?)(?=^##+ |\Z)", text_of(name), re.DOTALL | re.MULTILINE)[1]


def first_cells(text, start="`"):
    """The names in the first column of tables."""
    rows = re.findall(rf"^\| ({start}[^|]*) \|", text, re.MULTILINE)
    return [name for row in rows for name in re.findall(r"`([^`]+)`", row)]


# ---- commands and examples


def run_python(page, blocks):
    """Run blocks that share their names; one with prompts is a doctest. Return the names."""
    names = {}
    for k, block in enumerate(blocks):
        if ">>>" not in block:
            exec(compile(block, f"{page}[{k}]", "exec"), names)
            continue
        test = doctest.DocTestParser().get_doctest(block, names, f"{page}[{k}]", page, 0)
        report = []
        runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
        runner.run(test, out=report.append, clear_globs=False)
        assert not runner.failures, "".join(report)
        names = test.globs
    return names


def run(command, programs):
    """Run a command of a page, which fails if the page shows its error; what it printed."""
    printed = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")  # which has the bars of histograms
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        status = programs[command.words[0]](command.words[1:])
    assert (status == 0) != any(": error: " in line for line in command.shown), command.words
    printed.seek(0)
    return printed.read()


def of_page(name, *marks):
    return pytest.param(name, marks=[getattr(pytest.mark, mark) for mark in marks])


@pytest.mark.parametrize(
    "name",
    [
        of_page("README.md", "slow", "vtk", "gmsh"),
        of_page("solver.md", "slow", "vtk"),
        of_page("check.md"),
        of_page("quality.md"),
        of_page("partition.md"),
    ],
)
def test_commands_print_what_their_page_shows(tutorials, name, fresh):
    """All blocks of a page: TOML is a file, named by its first line; `text` is printed by some command."""
    page = DOCS / name
    (fresh / "build").mkdir()
    for block in tutorials.blocks(page, "toml"):
        (fresh / block.split()[1]).write_text(block, encoding="utf-8")
    done = [(command, run(command, tutorials.PROGRAMS)) for command in tutorials.commands(page)]
    assert len(done) >= 3 and shows_what_the_page_shows(done)
    printed = tutorials.commands(page)[0]._replace(shown="".join(tutorials.blocks(page, "text")).splitlines())
    assert shows_what_the_page_shows([(printed, "".join(out for _, out in done))])
    run_python(name, tutorials.blocks(page, "python"))
    if name == "solver.md":
        assert {command.words[1] for command, _ in done} == set(PROGRAM.group.commands)


#: pages whose examples read what their commands, or a run, write first
AFTER_COMMANDS = {"solver.md", "output.md", "partition.md", "check.md", "quality.md"}


@pytest.mark.parametrize("name", [p.name for p in PAGES if p.parent == DOCS and p.name not in AFTER_COMMANDS])
def test_examples_run(tutorials, name, fresh):
    run_python(name, tutorials.blocks(DOCS / name, "python"))


def test_examples_read_the_tables_of_a_run(tutorials, tmp_path):
    """Those of output.md, unchanged beside the tables of two steps."""
    made = made_up(tmp_path)
    made.steps(made.writer(), 2)
    with contextlib.chdir(made.folder):
        names = run_python("output.md", tutorials.blocks(DOCS / "output.md", "python"))
    times = [0.25, 0.5]
    assert names["force"] == [3 * t for t in times] and names["times"].tolist() == times
    n = len(names["macros"])
    assert n > 1 and names["pressure"].tolist() == [[t * k for k in range(n)] for t in times]


def cells_of(path, kind):
    """The texts of a notebook's cells of a kind; no outputs are kept in the file."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in notebook["cells"])
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == kind]


@pytest.mark.rows("first_pressure")
@pytest.mark.vtk
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_runs_and_shows_tables_and_a_picture(path, fresh):
    names, shown = {}, []
    for text in cells_of(path, "code"):
        tree = ast.parse(text)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "<cell>", "exec"), names)
        value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names) if last else None
        if hasattr(value, "_repr_png_"):
            assert value._repr_png_()[:4] == b"\x89PNG"
            shown.append("picture")
        elif hasattr(value, "_repr_html_"):
            assert "<table" in value._repr_html_()
            shown.append("table")
    assert shown.count("picture") == 1 and "table" in shown


# ---- links, tables, figures


def anchors(text):
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ +(.+)$", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}


@pytest.mark.parametrize("page", [*PAGES, *NOTEBOOKS], ids=lambda p: p.name)
def test_links_lead_somewhere(page):
    text = "\n".join(cells_of(page, "markdown")) if page in NOTEBOOKS else page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        path, _, anchor = target.partition("#")
        there = (page.parent / path) if path else page
        if re.match(r"[a-z]+:", target):
            continue
        assert there.exists(), target
        assert not anchor or anchor in anchors(there.read_text(encoding="utf-8")), target


def test_every_page_is_in_the_index_and_every_folder_and_no_other_path_in_the_architecture():
    linked = set(re.findall(r"\]\(([^)#]+\.md)\)", text_of("README.md")))
    assert {p.name for p in DOCS.glob("*.md")} - {"README.md"} <= linked
    paths = re.findall(r"`((?:\w+/)+(?:\w+\.py)?)`", text_of("architecture.md"))
    assert len(paths) > 60 and [path for path in paths if not (REPOSITORY / path).exists()] == []
    folders = {f"{path.parent.relative_to(REPOSITORY)}/" for name in PACKAGES for path in REPOSITORY.glob(name)}
    assert folders <= set(paths)


#: of a drawing: its date, and shapes of markers, whose names and number depend on last bits
_MADE_OF_LAST_BITS = re.compile(
    r'<metadata>.*?</metadata>|<defs>.*?</defs>|\b(?:id|xlink:href|clip-path)="[^"]*"', re.S
)


@pytest.mark.parametrize("name", ["hexa8_quad4_ring.svg", "patterns.svg"])
def test_tables_and_figures_are_current_and_figures_drawn_again_are_the_same(name, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(DOCS))
    make, figures, tables = (importlib.import_module(name) for name in ("make", "figures", "tables"))
    assert make.stale() == [], "run: python docs/make.py figures"
    page = "<!-- integrals: begin -->\n| wrong |\n<!-- integrals: end -->\n\n<!-- table: counts -->\n"
    kept, built = (tables.with_tables("cut.md", page, built=built) for built in (False, True))
    assert "| QUAD8 | \u22121/12 | 1/3 |  | none |" in kept and "wrong" not in kept and "<!-- table: counts -->" in kept
    assert "| 28 | 9 |" in built and "<!-- table: counts -->" not in built
    pages = {name: tables.with_tables(name, text_of(name), built=True) for name in tables.TABLES}
    assert not [name for name, text in pages.items() if "<!-- table: " in text]
    rows = [f"| `{name}` | {rule.severity} | {rule.means} | {rule.advice} |" for name, rule in RULES.items()]
    assert all(row in pages["check.md"] for row in rows)
    patterns = 1  # the overview, then one for each type of face of each cell, and a ring where there is one
    for kind, cell in CELLS.items():
        faces = {f.type for f in cell.facets} if cell.dim > 1 else set()
        patterns += len(faces) + (kind in RING_PARENTS) * len(faces - set(WHOLE_FACES))
    assert len(list((DOCS / "figures").glob("*.svg"))) == patterns
    figures.write_figure(name, tmp_path / name)
    mine, theirs = (
        [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?", _MADE_OF_LAST_BITS.sub("", path.read_text(encoding="utf-8")))]
        for path in (tmp_path / name, DOCS / "figures" / name)
    )
    np.testing.assert_allclose(mine, theirs, atol=0.02)


# ---- lists of names


def test_statuses_and_records_are_the_ones_listed():
    rows = re.findall(r"^\| (\d) \|.*\| (`.*`) \|$", text_of("conventions.md"), re.MULTILINE)
    listed = {name: int(status) for status, names in rows for name in re.findall(r"`(\w+)`", names)}
    known = [c for module in (errors, case_errors, linear_errors) for c in vars(module).values()]
    classes = [c for c in (*known, NotConvergedError) if isinstance(c, type) and issubclass(c, errors.LacmeshError)]
    assert listed == {c.__name__: c.status for c in classes}
    records = [(name, "cells") for name in CELL_RECORDS]
    assert re.findall(r"^\| `(lac_\w+)` \| (\w+) ", text_of("conventions.md"), re.MULTILINE) == [
        *records,
        (NODE_RECORD, "nodes"),
    ]


#: fields that a run with friction, and one that yields, write as well
RUBBED = ("shear", "slip", "path", "use", "dissipation")


def test_output_lists_every_key_column_and_field(tmp_path):
    made = made_up(tmp_path)
    made.steps(made.writer(), 1)
    figures = [f.name for f in fields_of(ZoneFigures) if f.name != "friction"] + list(FrictionFigures._fields)
    keys = [*json.loads((made.folder / "results.json").read_text()), "slave", "master", "why", *figures]
    optional = ("message", "units", "pretension", "cyclic")
    results = part_of("output.md", r"results\.json")
    listed = [key for key in first_cells(results) if key not in optional]
    assert listed == [*keys, "adjusted", "gap_bridged", "overlap_at_start"]
    assert all(f"`{word}`" in results for word in (*STEP_KEYS, *STATUSES))
    columns = [*CONTACT_COLUMNS, *(name.format(1) for name in TANGENT_COLUMNS), *FRICTION_COLUMNS]
    assert first_cells(part_of("output.md", r"contact_NAME\.csv")) == columns
    rows = re.findall(r"^\|[^|]*\| (`[^|]*)\|", part_of("output.md", "Fields for ParaView"), re.MULTILINE)
    meshes = [read(made.folder / "fields" / f"{stem}_0001.vtu") for stem in ("solid", f"contact_{ZONES[0]}")]
    there = {name for mesh in meshes for name in (*mesh.cell_data, *mesh.node_data)}
    there |= {"cell_number", "node_number", "group:NAME", *RUBBED, "shear_recovered", "plastic_strain"}
    assert set(re.findall(r"`([^`]+)`", "".join(rows))) == there


# ---- claims of cut.md


@pytest.mark.parametrize(
    ("name", "kind", "exact"), [("TETRA10", "cone", True), ("HEXA20", "cone", False), ("HEXA20", "ring", False)]
)
def test_children_of_a_curved_tetra10_have_its_map_and_those_of_a_hexa20_do_not(name, kind, exact):
    rng = np.random.default_rng(2)
    own = np.array(CELLS[name].reference)
    x = own + 0.1 * rng.uniform(-1, 1, own.shape)
    worst = 0.0
    for j in range(len(CELLS[name].facets)):
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


# ---- bridges to other programs: the scripts solve as lacsolver does, to 1e-9, and print what the page shows


BRIDGES = {
    "felupe": lambda u: u.reshape(-1, 3),
    "ngsolve": lambda u: u.reshape(3, -1).T,
    "mfem": lambda u: u.reshape(3, -1).T,
    "sfepy": lambda u: u.reshape(-1, 3),
    "dolfinx": lambda u: u.reshape(-1, 3),
}


@pytest.mark.parametrize(
    ("name", "order"),
    [
        *(pytest.param(name, 1, marks=getattr(pytest.mark, name)) for name in BRIDGES),
        pytest.param("felupe", 2, marks=[pytest.mark.felupe, pytest.mark.slow]),
    ],
)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_bridge_solves_as_lacsolver_does_and_prints_what_the_page_shows(name, order, monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "bridges"))
    path = REPOSITORY / "data" / "press_fit.msh"
    theirs = importlib.import_module(f"bridge_{name}").solve(path, **({"order": order} if order == 2 else {}))
    mesh = read(path) if order == 1 else raise_order(read(path))
    ours = lacsolver.solve(lacsolver.read_case(path.with_suffix(".toml")), mesh)
    pressure = ours.contact["fit"].pressure
    np.testing.assert_allclose(BRIDGES[name](theirs.u), ours.u, rtol=0, atol=1e-9 * abs(ours.u).max())
    np.testing.assert_allclose(theirs.pressure, pressure, rtol=0, atol=1e-9 * pressure.max())
    if order == 1:
        pattern = rf"^\$ python (\S*bridge_{name}\.py \S+)\n(.*)$"
        ((command, shown),) = re.findall(pattern, text_of("python.md"), re.MULTILINE)
        words = [sys.executable, *command.split()]
        printed = subprocess.run(words, cwd=REPOSITORY, capture_output=True, text=True, check=True).stdout
        assert printed.strip().splitlines()[-1] == shown


@pytest.mark.compiler
def test_a_program_in_cpp_reads_the_files(tutorials, fresh):
    """Compile the program of the page: its sums are those of the arrays."""
    page = DOCS / "python.md"
    (Path("read.cpp")).write_text("".join(tutorials.blocks(page, "cpp")))
    export, write = re.findall(r"^\$ (.*)$", tutorials.blocks(page, "console")[1], re.MULTILINE)[:2]
    assert lacsolver_main(export.split()[1:]) == 0
    subprocess.run(write.replace("python", sys.executable, 1), shell=True, check=True)
    subprocess.run(["g++", "-Wall", "-Werror", "-o", "read", "read.cpp"], check=True)
    printed = subprocess.run(["./read"], capture_output=True, text=True, check=True).stdout
    B, arrays = lacsolver.read_matrices("contact.npz")
    total = arrays["G"].sum()
    assert printed == f"{B.shape[0]} rows, {B.shape[1]} columns, {B.nnz} entries: {total:.6f} {total:.6f}\n"


# ---- the site of the pages


FACES = [(cell.name, j, f.type) for cell in CELLS.values() if cell.dim == 3 for j, f in enumerate(cell.facets)]


@pytest.mark.parametrize(("name", "j", "face"), [row for row in FACES if row[2] not in WHOLE_FACES])
def test_a_distorted_cell_keeps_its_volume_but_for_serendipity_faces(name, j, face):
    mesh = cell_with_faces(name, (j,))
    mesh = replace(mesh, points=mesh.points + 0.05 * np.random.default_rng(0).uniform(-1, 1, mesh.points.shape))
    for hexa in ("pyramid", "hexa") if name in RING_PARENTS else ("pyramid",):
        before, after = (sizes(m)[m.cell_dim == 3].sum() for m in (mesh, cut_skin(mesh, "slave", hexa=hexa).mesh))
        least, most = (1e-9, 2e-3 if hexa == "hexa" else 2e-4) if face == "QUAD8" else (-1, 1e-12)
        assert least < abs(after / before - 1) < most
