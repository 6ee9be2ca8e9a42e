"""Names and docstrings that a stranger understands: one name for one thing, first lines that say what comes back."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

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


class Module(NamedTuple):
    """Facts of a module, without its tree: keeping a million nodes takes longer than reading them."""

    path: Path
    types: list[str]
    first_lines: list[tuple[int, str]]
    changed: list[tuple[int, str]]
    texts: list[tuple[int, str]]
    locals: list[tuple[int, str]]


@cache
def modules(folder: str) -> tuple[Module, ...]:
    """The modules of a folder, each read once."""
    return tuple(map(module, sorted((ROOT / folder).rglob("*.py"))))


def module(path: Path) -> Module:
    """The names, docstrings, questions and strings of a module."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = list(ast.walk(tree))
    facts = (public_types(tree), documented(nodes), changed_by_questions(nodes), texts(nodes), local_names(nodes))
    return Module(path.relative_to(ROOT), *map(list, facts))


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
    for one in modules(package):
        for name in one.types:
            if not name.startswith("_") and name not in ALLOWED:
                where[name].append(str(one.path))
    assert {name: paths for name, paths in where.items() if len(paths) > 1} == {}


def documented(nodes: list[ast.AST]) -> Iterator[tuple[int, str]]:
    """Line and first line of every docstring of a module."""
    for node in nodes:
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            words = ast.get_docstring(node)
            if words:
                yield getattr(node, "lineno", 1), words.split("\n")[0]


@pytest.mark.parametrize("folder", FOLDERS)
def test_first_lines_say_what_comes_back_or_is_done(folder):
    bad = [
        f"{one.path}:{line}: {words}"
        for one in modules(folder)
        for line, words in one.first_lines
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


def changed_by_questions(nodes: list[ast.AST]) -> Iterator[tuple[int, str]]:
    """Line, and name of a function that reads as a question, where it changes what it is asked of."""
    for node in nodes:
        if isinstance(node, ast.FunctionDef) and asks(node) and node.name not in ACTIONS:
            for line in changed_attributes(node):
                yield line, node.name


@pytest.mark.parametrize("package", PACKAGES)
def test_nothing_that_reads_as_a_question_changes_what_it_is_asked_of(package):
    assert [f"{one.path}:{line}: {name}" for one in modules(package) for line, name in one.changed] == []


#: locals and arguments that say that something was computed, and not which quantity it is
EMPTY_NAMES = {"found", "made", "told", "held"}
#: packages where a quantity may still have such a name
NOT_YET_NAMED = (
    "lacsolver/bodies", "lacsolver/contact", "lacsolver/equilibrium", "lacsolver/results", "lacsolver/saddle",
)  # fmt: skip


def local_names(nodes: list[ast.AST]) -> Iterator[tuple[int, str]]:
    """Line and name of everything that a module assigns to, and of every argument; without the fields of records."""
    bodies = (one for node in nodes if isinstance(node, ast.ClassDef) for one in node.body)
    fields = {id(one.target) for one in bodies if isinstance(one, ast.AnnAssign)}
    for node in nodes:
        if isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and id(node) not in fields:
            yield node.lineno, node.id


def test_an_empty_name_is_seen_where_it_is_a_local_and_not_where_it_is_a_field():
    code = "class A:\n    held: int\ndef f(told):\n    made = told\n    found: int = made\n"
    names = [name for _, name in local_names(list(ast.walk(ast.parse(code)))) if name in EMPTY_NAMES]
    assert sorted(names) == ["found", "made", "told"]


@pytest.mark.parametrize("package", PACKAGES)
def test_locals_are_named_after_their_quantities(package):
    bad = [f"{one.path}:{line}: {name}" for one in modules(package)
           if not one.path.as_posix().startswith(NOT_YET_NAMED)
           for line, name in one.locals if name in EMPTY_NAMES]  # fmt: skip
    assert bad == []


#: words that pages, messages and docstrings no longer use (docs/conventions.md has what is used instead)
RETIRED = (
    r"inside out",
    r"hangs? together",
    r"turns? (?:its|their) back",
    r"bare (?:skin|rigid skin|slave face|master face)s?",
    r"crowded facets?",
    r"(?:the|a|its|their|curved) rims?",
    r"held by contact alone",
    r"will not do",
    r"mesh again there",
    r"raises? the order",
    r"worst child(?:ren)?",
    r"dragged (?:search|attempt)|search is dragged|\*dragged\*",
    r"foreseen (?:place|state)",
    r"(?:is|are|was|were) told (?:by|in|at|of|as|once)\b",
    r"quadratic kin",
    r"frustum",
)
#: pages of what was decided, of what changed, and of the old words themselves
OF_THE_PAST = {"docs/decisions.md", "docs/conventions.md", "CHANGELOG.md"}


def pages() -> list[Path]:
    """The pages for users, without the reports of the verification, which it writes itself."""
    docs = [path for path in (ROOT / "docs").rglob("*.md") if "verification" not in path.relative_to(ROOT).parts[1]]
    return sorted(path for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *docs]
                  if str(path.relative_to(ROOT)) not in OF_THE_PAST)  # fmt: skip


def texts(nodes: list[ast.AST]) -> Iterator[tuple[int, str]]:
    """Line and text of every string of a module, docstrings among them."""
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value


def retired(text: str) -> list[str]:
    """The retired words of a text."""
    return re.findall(rf"\b(?:{'|'.join(RETIRED)})\b|\*dragged\*", " ".join(text.split()), re.IGNORECASE)


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.stem)
def test_pages_use_the_words_of_the_field(page):
    assert retired(page.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("package", ["lacmesh", "lacsolver"])
def test_messages_and_docstrings_use_the_words_of_the_field(package):
    bad = [f"{one.path}:{line}: {words}" for one in modules(package) for line, text in one.texts
           if (words := retired(text))]  # fmt: skip
    assert bad == []


def test_retired_words_are_found():
    assert retired("a cell is inside\nout, and the rim is bare") == ["inside out", "the rim"]
    assert retired("crowded-facet, primary, trim, and the frame") == []


def test_the_conventions_list_every_retired_word():
    """A row for each, with the word that is used instead."""
    text = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", text.split("no longer used")[1].split("\n## ")[0], re.MULTILINE)
    old = " ".join(row[0] for row in rows[1:])
    assert len(rows) > 20
    for word in ("inside out", "rim", "bare skin", "crowded facet", "worst child", "held by contact alone", "dragged"):
        assert word in old
