"""docs/solver.md: its first run and its other commands work, it names every option and every public name."""

from __future__ import annotations

import argparse
import importlib
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import lacsolver
from lacsolver.case.keys import sections_of
from lacsolver.cli import COMMANDS, PROGRAM, main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "solver.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def part(title, level="##"):
    return re.search(rf"^{level} {title}\n(.*?)(?=^#+ |\Z)", PAGE, re.DOTALL | re.MULTILINE)[1]


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    """A folder with the mesh and the case, as a user's checkout has them after the first paragraph."""
    folder = tmp_path_factory.mktemp("first")
    shutil.copytree(ROOT / "data", folder / "data", ignore=shutil.ignore_patterns("*.lac.*"))
    (folder / "press.toml").write_text(blocks("toml")[0])
    return folder


@pytest.mark.vtk
@pytest.mark.slow
def test_commands_run_in_their_order(fresh, monkeypatch, capsys):
    monkeypatch.chdir(fresh)
    commands = [line[2:] for block in blocks("console") for line in block.splitlines() if line.startswith("$ ")]
    assert {shlex.split(command)[1] for command in commands} == set(COMMANDS)
    said = ""
    for command in commands:
        name, *words = shlex.split(command)
        assert (name, main(words)) == ("lacsolver", 0), command
        said += capsys.readouterr().out
    assert "rigid-body mode without support" in said
    for line in blocks("text")[0].splitlines()[1:]:
        step, time, iterations, halvings, _, *rest = line.split()
        assert re.search(
            rf"^ +{step} +{time} +{iterations} +{halvings} +\S+ +{' '.join(rest[:3])} +{rest[3]}$", said, re.M
        )
    printed = [line.split() for line in said.splitlines()]
    assert all(line.split() in printed for line in blocks("text")[1].splitlines())
    assert {
        "press",
        "press.png",
        "press_modes",
        "press_closed",
        "press_mode.png",
        "again",
        "contact.npz",
        "contact.mtx",
    } <= {path.name for path in fresh.iterdir()}
    for code in blocks("python"):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env={"PYTHONPATH": str(ROOT)}
        )
        assert done.returncode == 0, done.stderr


def options(name):
    """The options of a command, as its parser has them."""
    (choices,) = (a.choices for a in PROGRAM.parser._actions if isinstance(a, argparse._SubParsersAction))
    return {option for action in choices[name]._actions for option in action.option_strings}


def named(text):
    """The options in the first column of a table."""
    cells = re.findall(r"^\| (`-[^|]*) \|", text, re.MULTILINE)
    return {word for cell in cells for word in re.findall(r"(?<![\w-])--?[a-z]+", cell)}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_is_there(name):
    told = named(part(name, "###")) | named(part("Commands"))
    assert options(name) - told == ({"--json"} if name == "schema" else set())
    assert "`--json`" in part("schema", "###")
    assert named(part(name, "###")) <= options(name)


def test_every_public_name_is_on_the_page_on_python():
    """Functions and records of results by their use; those of a case are on its own page."""
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    words = {*re.findall(r"\w+", page)}
    records = {section for section in sections_of(lacsolver.Case)}
    told = {
        name
        for name in lacsolver.__all__
        if name in words or re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower() in records
    }
    assert {*lacsolver.__all__} - told == set()


def test_every_name_of_a_stage_is_there():
    rows = re.findall(r"^\| `(lacsolver[.\w]*)` \| (.*) \|$", part("From Python"), re.MULTILINE)
    named = [(module, name) for module, words in rows for name in re.findall(r"`([A-Za-z]\w+)`", words.split(":")[0])]
    assert len(named) > 15
    assert [pair for pair in named if not hasattr(importlib.import_module(pair[0]), pair[1])] == []


def test_every_array_of_matrices_is_there(fresh, monkeypatch):
    import numpy as np

    monkeypatch.chdir(fresh)
    assert main(["matrices", "press.toml", "-o", "all.npz", "-q"]) == 0
    rows = re.findall(r"^\| (`[^|]*) \|", part("matrices", "###"), re.MULTILINE)
    told = {n for row in rows for n in re.findall(r"`([A-Za-z_]+)`", row)}
    assert told == set(np.load("all.npz").files)
