"""The tutorials, run as their pages stand: commands, scripts, what they print, and their pictures."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

import lacmesh

TUTORIALS = Path(__file__).resolve().parents[1] / "docs" / "tutorials"
PAGES = sorted(TUTORIALS.glob("*.md"))


@pytest.fixture(scope="module")
def tutorials():
    """docs/tutorials/run.py, as a module."""
    sys.path.insert(0, str(TUTORIALS))
    try:
        yield importlib.import_module("run")
    finally:
        sys.path.remove(str(TUTORIALS))
        sys.modules.pop("run", None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tutorials")


def is_picture(path):
    return path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 50_000


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_pictures_and_links_are_there(page):
    text = page.read_text(encoding="utf-8")
    pictures = re.findall(r"!\[[^\]]+\]\((\S+\.png)\)", text)
    assert pictures and all(is_picture(TUTORIALS / name) for name in pictures)
    for target in re.findall(r"\[[^\]]+\]\(([^)#]+)\)", text):
        assert (TUTORIALS / target).is_file()


def test_no_picture_is_left_over():
    named = {n for page in PAGES for n in re.findall(r"\((\S+\.png)\)", page.read_text(encoding="utf-8"))}
    assert {p.name for p in TUTORIALS.glob("*.png")} == named


def test_the_page_is_the_script(tutorials):
    """gmsh_script.md tells gmsh_script.py in pieces: all of it, in its order, word for word."""
    script = (TUTORIALS / "gmsh_script.py").read_text(encoding="utf-8").partition('"""\n\n')[2]
    pieces = tutorials.blocks(TUTORIALS / "gmsh_script.md", "python")
    told = [line for line in "".join(pieces[: len(pieces) - 2]).splitlines() if line]
    assert told == [line for line in script.splitlines() if line]


@pytest.mark.gmsh
@pytest.mark.filterwarnings("ignore:.*InterpolationScheme")  # the page says so
def test_the_script_runs_and_so_does_the_rest_of_its_page(tutorials, folder, monkeypatch, capsys):
    printed = tutorials.run_script(folder)
    cut = lacmesh.Cut(lacmesh.read(folder / "roller.med"))
    assert printed.strip() == f"{cut.n_macros} macro-elements, {cut.mesh.n_cells} cells"
    assert cut.n_macros == 12 * 14 and cut.mesh.cells_by_type["HEXA8"] == 12 * 14 * 5 + 12 * 14 * 5
    by_gmsh = lacmesh.read(folder / "roller.msh")
    groups = {n: len(c) for n, c in cut.mesh.cell_groups.items()}
    assert {n: len(c) for n, c in by_gmsh.cell_groups.items()} == groups
    monkeypatch.chdir(folder)
    space = {}
    for piece in tutorials.blocks(TUTORIALS / "gmsh_script.md", "python")[-2:]:
        exec(compile(piece, "gmsh_script.md", "exec"), space)
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"(\d+) macro-elements in cube\.msh", lines[0])
    assert lines[1] == lines[0].replace("in cube.msh", "in the model cube")
    assert lines[2] == "roller has cells of the types [11 17]"


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_picture_of_the_script_is_drawn(tutorials, tmp_path):
    tutorials.run_script(tmp_path)
    tutorials.draw_script(tmp_path)
    assert is_picture(tmp_path / "roller.png")


def plain(text):
    """A line without the spaces and rules that make it a table."""
    return " ".join(text.split())


@pytest.mark.slow
@pytest.mark.gmsh
@pytest.mark.vtk
def test_the_commands_run_and_print_what_the_page_shows(tutorials, folder):
    page = TUTORIALS / "step_to_med.md"
    done = tutorials.run_page(page, folder)
    assert [command.words[1] for command, _ in done] == [
        *("mesh", "mesh", "view", "cut", "view", "check", "view", "convert", "info")
    ]
    for command, printed in done:
        lines = {plain(line) for line in printed.splitlines()}
        assert {plain(line) for line in command.shown} <= lines
    assert len(done[0][0].shown) == 10  # the list, whose surfaces the next command names
    assert len([p for p in folder.glob("lug*.png") if is_picture(p)]) == 3
    cut = lacmesh.Cut(lacmesh.read(folder / "lug.lac.med"))
    assert cut.zones == ("bore",) and cut.n_macros == len(cut.mesh.cell_groups["bore"]) // 3
    assert set(cut.mesh.cell_groups) == {"bore", "pin", "bolt", "ends", "symmetry", "lug", "shaft"}
    checked = done[5][1]
    for claim in (f"{cut.n_macros} of {cut.n_macros} macro-elements own an internal dof", "2 separate bodies"):
        assert claim in checked
    for claim in ("no errors, 2 warnings", "poor-cell", "only in part", "to 0.40"):
        assert claim in checked


@pytest.mark.gmsh
def test_the_step_file_is_its_scripts(tmp_path):
    """Of the same shapes, whatever version of gmsh writes it; with neither day nor machine in it."""
    from lacmesh.gmsh.cad import list_cad

    kept = TUTORIALS.parents[1] / "data" / "pin_in_lug.step"
    script = kept.parent / "make_pin_in_lug.py"
    subprocess.run([sys.executable, str(script), str(tmp_path / kept.name)], check=True, capture_output=True)
    ours, made = (list_cad(path) for path in (kept, tmp_path / kept.name))
    assert [(s.dim, s.type) for s in made] == [(s.dim, s.type) for s in ours]
    for a, b in zip(ours, made, strict=True):
        assert a.measure == pytest.approx(b.measure, rel=1e-9) and a.radius == (b.radius and pytest.approx(b.radius))
    assert kept.stat().st_size < 100_000
    assert not re.search(r"\d{4}-\d\d-\d\dT", kept.read_text(encoding="utf-8"))
