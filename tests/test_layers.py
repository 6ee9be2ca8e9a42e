"""Rules beyond the import layers of pyproject.toml: who prints, who exits, and what is imported only when used."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "lacmesh"
MODULES = sorted(PACKAGE.rglob("*.py"))


def is_command(path):
    """True for a module of the command, which may print and exit."""
    return path.parent.name == "cli" or path.name == "__main__.py"


#: optional or slow packages
LATE = {"gmsh", "matplotlib", "medcoupling", "meshio", "pyvista", "rich", "trimesh", "vtk", "vtkmodules"}


def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def statements_at_import(tree):
    """Every statement that runs when a module is imported: not the bodies of functions, nor what types alone need."""
    for statement in tree.body:
        if isinstance(statement, ast.If) and "TYPE_CHECKING" in ast.unparse(statement.test):
            continue
        if not isinstance(statement, ast.FunctionDef):
            yield statement
            yield from statements_at_import(statement) if hasattr(statement, "body") else ()


def imported(statement):
    if isinstance(statement, ast.Import):
        return {alias.name.split(".")[0] for alias in statement.names}
    if isinstance(statement, ast.ImportFrom):
        return {(statement.module or "").split(".")[0]}
    return set()


def test_optional_and_slow_packages_are_imported_when_used():
    early = {
        path: {n for statement in statements_at_import(tree_of(path)) for n in imported(statement)} for path in MODULES
    }
    assert {path: names & LATE for path, names in early.items() if names & LATE} == {}


def test_only_the_command_prints_or_exits():
    words = {"print", "exit", "quit", "sys.exit", "os._exit", "SystemExit", "sys.stdout.write"}
    for path in [path for path in MODULES if not is_command(path)]:
        calls = {ast.unparse(node.func) for node in ast.walk(tree_of(path)) if isinstance(node, ast.Call)}
        assert not calls & words, path
