"""Run the commands and examples of the README unchanged."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lacmesh.cli import main as lacmesh
from lacsolver.cli import main as lacsolver

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """A folder with `data/`, as a user's checkout has it."""
    shutil.copytree(ROOT / "data", tmp_path / "data", ignore=shutil.ignore_patterns("*.lac.*"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_commands_run_in_their_order(fresh):
    commands = [line[2:] for block in blocks("console") for line in block.splitlines() if line.startswith("$ ")]
    assert len(commands) >= 5
    for command in commands:
        name, *args = shlex.split(command)
        assert {"lacmesh": lacmesh, "lacsolver": lacsolver}[name](args) == 0, command
    assert {"two_blocks.med", "quadratic.msh"} <= {p.name for p in fresh.iterdir()}


def test_python_runs(fresh):
    (code,) = blocks("python")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=fresh)
    assert done.returncode == 0, done.stderr
    assert "macro-elements" in done.stdout


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text()
    for target in re.findall(r"^make (\w+)", "\n".join(blocks("")), re.MULTILINE):
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


def test_links_resolve():
    for link in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / link).exists(), link


def test_changelog_has_this_version():
    import lacmesh

    assert f"## {lacmesh.__version__}" in (ROOT / "CHANGELOG.md").read_text()
