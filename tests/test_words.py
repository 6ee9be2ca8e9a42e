"""Names and docstrings that a stranger understands: one name for one thing, first lines that say what comes back."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("lacmesh", "lacsolver", "verification")
FOLDERS = (*PACKAGES, "tests", "tools", "benchmarks", "docs", "data")
#: a first line that starts so is a riddle, or half a sentence
RIDDLES = ("What", "Where", "Whether", "How", "That", "Of", "As", "Those", "The same")
#: an action that says whether it was due
ACTIONS = {"step"}
#: aliases of array types that many modules have for themselves
ALLOWED = {"Array", "Bools", "Complex", "Floats", "Ints"}


@cache
def trees(*folders: str) -> tuple[tuple[Path, ast.Module], ...]:
    """The modules of some folders, parsed."""
    paths = [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]
    return tuple((path.relative_to(ROOT), ast.parse(path.read_text(encoding="utf-8"))) for path in paths)


def public_types(tree: ast.Module) -> Iterator[str]:
    """The names of the classes and of the aliases of types that a module defines for others."""
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            yield node.name
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        for target in targets:
            if isinstance(target, ast.Name) and target.id[0].isupper() and not target.id.isupper():
                yield target.id


@pytest.mark.parametrize("package", PACKAGES)
def test_a_public_class_or_alias_has_its_name_for_itself(package):
    where = defaultdict(list)
    for path, tree in trees(package):
        for name in public_types(tree):
            if not name.startswith("_") and name not in ALLOWED:
                where[name].append(str(path))
    assert {name: paths for name, paths in where.items() if len(paths) > 1} == {}


def documented(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and first line of every docstring of a module."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            words = ast.get_docstring(node)
            if words:
                yield getattr(node, "lineno", 1), words.split("\n")[0]


@pytest.mark.parametrize("folder", FOLDERS)
def test_first_lines_say_what_comes_back_or_is_done(folder):
    bad = [
        f"{path}:{line}: {words}"
        for path, tree in trees(folder)
        for line, words in documented(tree)
        if words.startswith(tuple(f"{riddle} " for riddle in RIDDLES))
    ]
    assert bad == []


def asks(node: ast.FunctionDef) -> bool:
    """True for a function that reads as a question or a check: by its name, or as it returns a bool."""
    returns = isinstance(node.returns, ast.Name) and node.returns.id == "bool"
    return returns or node.name.lstrip("_").startswith(("is_", "has_", "check_"))


def changed_attributes(node: ast.FunctionDef) -> Iterator[int]:
    """Lines of a function that assign to an attribute of one of its arguments."""
    given = {one.arg for one in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)}
    for inner in ast.walk(node):
        targets = inner.targets if isinstance(inner, ast.Assign) else [getattr(inner, "target", None)]
        for target in targets if isinstance(inner, (ast.Assign, ast.AugAssign, ast.AnnAssign)) else ():
            if isinstance(target, ast.Attribute) and isinstance(target.value, ast.Name) and target.value.id in given:
                yield inner.lineno


def test_nothing_that_reads_as_a_question_changes_what_it_is_asked_of():
    bad = [
        f"{path}:{line}: {node.name}"
        for path, tree in trees(*PACKAGES)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and asks(node) and node.name not in ACTIONS
        for line in changed_attributes(node)
    ]
    assert bad == []
