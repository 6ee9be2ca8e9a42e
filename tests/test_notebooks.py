"""The notebooks: every cell runs, what it shows has HTML or a picture, and no outputs are kept in the files."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def cells(path, kind):
    """The texts of the cells of a kind."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert (notebook["nbformat"], notebook["metadata"]["kernelspec"]["name"]) == (4, "python3")
    assert all(not cell.get("outputs") and cell.get("execution_count") is None for cell in notebook["cells"])
    return ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == kind]


def run(text, names):
    """Run a cell, and return the value of its last expression, as Jupyter shows it."""
    tree = ast.parse(text)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<cell>", "exec"), names)
    return eval(compile(ast.Expression(last.value), "<cell>", "eval"), names) if last else None


def test_there_are_two():
    assert [path.stem for path in NOTEBOOKS] == ["first_pressure", "friction"]


@pytest.mark.vtk
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_runs_and_shows_tables_and_a_picture(path, fresh):
    names, shown = {}, []
    for text in cells(path, "code"):
        value = run(text, names)
        if hasattr(value, "_repr_png_"):
            assert value._repr_png_()[:4] == b"\x89PNG"
            shown.append("picture")
        elif hasattr(value, "_repr_html_"):
            assert "<table" in value._repr_html_()
            shown.append("table")
    assert shown.count("picture") == 1 and "table" in shown


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_links_of_a_notebook_lead_somewhere(path):
    for target in re.findall(r"\]\(([^)]+)\)", "\n".join(cells(path, "markdown"))):
        assert (path.parent / target).exists(), target
