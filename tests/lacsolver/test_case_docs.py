"""docs/case.md: its first example is a case that can be run, in the file and in Python."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from lacsolver.case import read_case
from lacsolver.cli import main
from lacsolver.validation import validate

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "case.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """A folder with `data/`, as a user's checkout has it."""
    shutil.copytree(ROOT / "data", tmp_path / "data", ignore=shutil.ignore_patterns("*.lac.*"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_first_example_can_be_run(fresh, capsys):
    (text,) = blocks("toml")
    (fresh / "case.toml").write_text(text, encoding="utf-8")
    assert main(["validate", "case.toml"]) == 0
    assert "rigid-body mode without support" in capsys.readouterr().out
    assert main(["run", "case.toml", "-q"]) == 0


def test_the_example_in_python_is_the_same_case(fresh):
    (fresh / "case.toml").write_text(blocks("toml")[0], encoding="utf-8")
    names = {}
    exec(compile(blocks("python")[0], "case.md", "exec"), names)
    found, told = validate(names["case"]), validate(read_case(fresh / "case.toml"))
    assert found.problems == [] and found.held == told.held and found.unknowns == told.unknowns > 0
