"""Run the commands and examples of the README and of the overview unchanged."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from lacmesh.cli import main as lacmesh
from lacsolver.cli import main as lacsolver

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
OVERVIEW = ROOT / "docs" / "overview.md"
both = pytest.mark.parametrize("page", [README, OVERVIEW], ids=lambda page: page.stem)


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)


def run_commands(page):
    """Run the commands of a page in their order, and return how many there are."""
    commands = [line[2:] for block in blocks(page, "console") for line in block.splitlines() if line.startswith("$ ")]
    for command in commands:
        name, *args = shlex.split(command)
        assert {"lacmesh": lacmesh, "lacsolver": lacsolver}[name](args) == 0, command
    return len(commands)


#: runs commands (sys.argv[2:]) with the modules sys.argv[1] out of reach
WITHOUT = """
import json, shlex, sys
from importlib.machinery import PathFinder
gone, found = set(json.loads(sys.argv[1])), PathFinder.find_spec
PathFinder.find_spec = lambda name, *rest: None if name in gone else found(name, *rest)
from lacmesh.cli import main as lacmesh
from lacsolver.cli import main as lacsolver
for command in sys.argv[2:]:
    name, *args = shlex.split(command)
    assert {"lacmesh": lacmesh, "lacsolver": lacsolver}[name](args) == 0, command
exec(sys.stdin.read())
"""


def out_of_reach(named):
    """The modules of all extras that an installation with the extras `named` does not bring by itself."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    bare = {extra: {re.match(r"[\w-]+", need)[0] for need in needs} for extra, needs in extras.items()}
    brought = {re.match(r"[\w-]+", need)[0] for need in project["dependencies"]}.union(*(bare[e] for e in named))
    left = set().union(*bare.values()) - brought - {project["name"]}
    return [module for module, owners in packages_distributions().items() if left & set(owners)]


@pytest.mark.vtk
def test_the_readme_runs_with_what_its_install_line_brings(fresh):
    """Its commands and its Python, in an installation by the line that stands there; less of one fails."""
    (line,) = re.findall(r"^pip install '\.\[(.*)\]'", "\n".join(blocks(README, "")), re.MULTILINE)
    commands = [c[2:] for block in blocks(README, "console") for c in block.splitlines()]
    (code,) = blocks(README, "python")

    def run(named, commands):
        arguments = [sys.executable, "-c", WITHOUT, json.dumps(out_of_reach(named)), *commands]
        return subprocess.run(arguments, input=code, capture_output=True, text=True, cwd=fresh)

    assert "pyvista" in out_of_reach([]) and "numpy" not in out_of_reach([])
    done = run(line.split(","), commands)
    assert done.returncode == 0 and "macro-elements" in done.stdout, done.stderr
    assert "largest pressure 17.5" in done.stdout  # that of the picture, which the first command draws
    assert len(commands) == 3 and (fresh / "two_blocks" / "solid.pvd").is_file()
    assert {"two_blocks.lac.msh", "two_blocks_pressure.png"} <= {p.name for p in fresh.iterdir()}
    without = run([], [commands[0].replace("-o two_blocks", "-o again").replace("pressure.png", "again.png")])
    assert without.returncode != 0 and "pip install 'lacmesh[view]'" in without.stderr


@pytest.mark.slow
def test_commands_of_the_overview_run(fresh):
    assert run_commands(OVERVIEW) >= 15
    assert {"two_blocks.med", "quadratic.msh"} <= {p.name for p in fresh.iterdir()}


def test_python_of_the_overview_runs(fresh):
    (code,) = blocks(OVERVIEW, "python")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=fresh)
    assert done.returncode == 0, done.stderr
    assert "macro-elements" in done.stdout


def test_the_readme_fits_on_a_screen():
    """About sixty lines, with one picture."""
    text = README.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 75 and text.count("![") == 1


@both
def test_make_targets_exist(page):
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make (\w+)", "\n".join(blocks(page, "")), re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_contributing_tells_every_target():
    told = re.findall(r"^\| `make (\w+)` \|", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)
    makefile = (ROOT / "Makefile").read_text()
    helped = re.findall(r"^(\w+):.* ## ", makefile, re.MULTILINE)
    phony = re.search(r"^\.PHONY: (.+)$", makefile, re.MULTILINE)[1].split()
    assert sorted([*told, "help", "install"]) == sorted(helped) == sorted(phony)


def test_quick_runs_tests_of_every_package():
    """Some that are there, of each folder of tests but those that hold nothing but long ones."""
    # as typed by hand: under `make test` the names of folders would be printed beside the command
    env = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    made = subprocess.run(["make", "--dry-run", "quick"], cwd=ROOT, env=env, capture_output=True, text=True, check=True)
    quick = [Path(word) for word in made.stdout.splitlines()[-1].split() if word.startswith("tests/")]
    assert quick and all((ROOT / path).is_file() for path in quick)
    folders = {path.parent.relative_to(ROOT) for path in (ROOT / "tests").rglob("test_*.py")}
    assert folders - {path.parent for path in quick} == {Path("tests/bad_input"), Path("tests/fuzz")}


@both
def test_links_resolve(page):
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        assert (page.parent / link).exists(), link


def test_changelog_has_this_version():
    import lacmesh

    assert f"## {lacmesh.__version__}" in (ROOT / "CHANGELOG.md").read_text()
