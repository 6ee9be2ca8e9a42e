"""Public names of each package: verbs, records and errors, each with an example; and the names that have moved."""

from __future__ import annotations

import ast
import builtins
import importlib
import inspect
import re
import subprocess
import sys
from operator import attrgetter
from pathlib import Path

import pytest

import lacmesh
import lacsolver
from lacsolver import read_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.results import Restart
from lacsolver.results.state import State

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = (lacmesh, lacsolver)
#: old public name -> where it is now
MOVED = {
    "lacmesh": {
        "Block": "lacmesh.mesh",
        "CELLS": "lacmesh.cells",
        "from_meshio": "lacmesh.exchange.libraries",
        "to_meshio": "lacmesh.exchange.libraries",
        "to_pyvista": "lacmesh.exchange.libraries",
        "to_trimesh": "lacmesh.exchange.libraries",
    },
    "lacsolver": {
        "BodyForce": "lacsolver.case",
        "Constraints": "lacsolver.constraints",
        "Contact": "lacsolver.case",
        "Displacement": "lacsolver.case",
        "Elastic": "lacsolver.bodies.material",
        "Force": "lacsolver.case",
        "Gravity": "lacsolver.case",
        "Interface": "lacsolver.contact",
        "Material": "lacsolver.case",
        "Materials": "lacsolver.bodies.material",
        "Orthotropic": "lacsolver.bodies.material",
        "Output": "lacsolver.case",
        "OutputFolder": "lacsolver.output",
        "Pairing": "lacsolver.contact",
        "Pressure": "lacsolver.case",
        "Probe": "lacsolver.case",
        "Rigid": "lacsolver.case",
        "Solver": "lacsolver.case",
        "Space": "lacsolver.space.space",
        "Spring": "lacsolver.case",
        "Steps": "lacsolver.case",
        "Temperature": "lacsolver.case",
        "Tie": "lacsolver.case",
        "Traction": "lacsolver.case",
        "Value": "lacsolver.case",
        "Zone": "lacsolver.contact",
        "assemble_stiffness": "lacsolver.bodies.small",
        "integrate": "lacsolver.contact",
        "stress": "lacsolver.bodies.small",
    },
}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_dir_lists_verbs_records_and_errors_and_nothing_else(package):
    assert dir(package) == package.__all__ and len(package.__all__) < 30
    things = [getattr(package, name) for name in dir(package)]
    assert all(inspect.isclass(thing) or inspect.isfunction(thing) for thing in things)


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
    known = {*lacmesh.__all__, *package.__all__, *dir(builtins)}
    for name in package.__all__:
        promised = re.findall(r"\b[A-Z]\w*(?:Error|Warning)\b", documentation(getattr(package, name)))
        assert {*promised} <= known, name


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.__name__)
def test_old_names_work_and_warn_of_their_new_place(package):
    assert MOVED[package.__name__] == package._MOVED
    for name, place in MOVED[package.__name__].items():
        words = f"{package.__name__}.{name} has moved: from {place} import {name}"
        with pytest.warns(DeprecationWarning, match=f"^{words}$"):
            assert getattr(package, name) is getattr(importlib.import_module(place), name)


def test_the_warning_names_the_line_of_the_user():
    done = subprocess.run([sys.executable, "-c", "from lacmesh import CELLS"], capture_output=True, text=True)
    assert done.returncode == 0
    assert done.stderr.startswith("<string>:1: DeprecationWarning: lacmesh.CELLS has moved: from lacmesh.cells import")


#: record, old field, where its value is now
FIELDS = [
    (State, "iterate", "step.iterate"),
    (State, "earlier", "step.earlier"),
    (State, "next_step", "step.step_size"),
    (Restart, "iterate", "step.iterate"),
    (Restart, "earlier", "step.earlier"),
]


@pytest.fixture(scope="module")
def records():
    """A state and a restart, by their class."""
    *_, state = march(Problem.of(read_case(ROOT / "data" / "two_blocks.toml")))
    return {State: state, Restart: Restart.of(state, 0.5, 2)}


@pytest.mark.parametrize("record, old, new", FIELDS, ids=lambda value: getattr(value, "__name__", value))
def test_old_fields_of_records_work_and_warn_of_the_new(records, record, old, new):
    made = records[record]
    with pytest.warns(DeprecationWarning, match=f"^{record.__name__}.{old} is now {new}$"):
        assert getattr(made, old) is attrgetter(new)(made)
