"""Public names of each package: verbs, records and two errors, each with an example."""

from __future__ import annotations

import ast
import builtins
import importlib
import inspect
import re
from dataclasses import fields
from pathlib import Path

import pytest

import lacmesh
import lacmesh.errors
import lacsolver
import lacsolver.case
import lacsolver.errors

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (lacmesh, lacsolver)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_dir_lists_verbs_records_and_errors_and_nothing_else(package):
    assert dir(package) == package.__all__ and len(package.__all__) <= 44
    things = [getattr(package, name) for name in dir(package)]
    assert all(inspect.isclass(thing) or inspect.isfunction(thing) for thing in things)


def test_every_section_of_a_case_has_its_record_at_the_door():
    """A case can be made without a look into inner modules."""
    types = " ".join(str(one.type) for one in fields(lacsolver.Case))
    records = {name for name, thing in vars(lacsolver.case).items() if inspect.isclass(thing) and name + "]" in types}
    assert {"Pretension", "Contact"} <= records <= {*lacsolver.__all__}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_type_checkers_see_the_names_that_users_see(package):
    (block,) = (n for n in ast.parse(Path(package.__file__).read_text(encoding="utf-8")).body if isinstance(n, ast.If))
    assert {a.asname: n.module for n in block.body for a in n.names} == package._PUBLIC


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_a_star_imports_every_public_name(package):
    names = {}
    exec(f"from {package.__name__} import *", names)
    assert {name: names[name] for name in package.__all__} == {n: getattr(package, n) for n in package.__all__}


def documentation(thing):
    """The docstrings of a public function, or of a record and its own methods."""
    own = [getattr(value, "__func__", value) for value in vars(thing).values()] if inspect.isclass(thing) else []
    methods = [value for value in own if inspect.isroutine(value) or isinstance(value, property)]
    return "\n\n".join(inspect.getdoc(each) or "" for each in (thing, *methods))


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_every_public_name_has_an_example(package):
    """Examples are run where the name is defined, as every doctest."""
    assert [name for name in package.__all__ if ">>> " not in documentation(getattr(package, name))] == []


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_errors_that_a_docstring_promises_are_public(package):
    known = {*dir(lacmesh.errors), *dir(lacsolver.errors), *package.__all__, *dir(builtins)}
    for name in package.__all__:
        promised = re.findall(r"\b[A-Z]\w*(?:Error|Warning)\b", documentation(getattr(package, name)))
        assert {*promised} <= known, name


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_two_errors_are_named_at_the_door(package):
    errors = [name for name in dir(package) if name.endswith(("Error", "Warning"))]
    assert len(errors) == 2 and {*errors} <= {*dir(importlib.import_module(f"{package.__name__}.errors"))}
