"""Rules of the packages: who prints, what is imported when used, public names; and noise in the tests."""

import ast
import builtins
import importlib
import inspect
import os
import re
import subprocess
import sys
from collections import Counter
from functools import cache

import numpy as np
import pytest

import lacmesh
import lacmesh.errors
import lacsolver
import lacsolver.case
import lacsolver.errors
from tests import REPOSITORY

PACKAGES = pytest.mark.parametrize("package", [lacmesh, lacsolver], ids=lambda p: p.__name__)


@cache
def trees():
    """The syntax tree of each module, by its path: parsed when a test asks, not in each process that collects them."""
    folders = ("lacmesh", "lacsolver", "verification")
    paths = (path for name in folders for path in sorted((REPOSITORY / name).rglob("*.py")))
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in paths}


# ---- modules


#: optional or slow packages
LATE = {"gmsh", "matplotlib", "medcoupling", "meshio", "pyvista", "rich", "trimesh", "vtk", "vtkmodules"}


def imported_at_once(tree):
    """The packages that a module imports when it is imported: not in functions, nor for types alone."""
    for statement in tree.body:
        if isinstance(statement, ast.If) and "TYPE_CHECKING" in ast.unparse(statement.test):
            continue
        if isinstance(statement, ast.Import):
            yield from (alias.name.split(".")[0] for alias in statement.names)
        elif isinstance(statement, ast.ImportFrom):
            yield (statement.module or "").split(".")[0]
        elif hasattr(statement, "body") and not isinstance(statement, ast.FunctionDef):
            yield from imported_at_once(statement)


def test_optional_packages_are_imported_when_used_and_commands_alone_print_or_exit():
    words = {"print", "exit", "quit", "sys.exit", "os._exit", "SystemExit", "sys.stdout.write"}
    for path, tree in trees().items():
        if path.is_relative_to(REPOSITORY / "lacmesh"):
            assert not {*imported_at_once(tree)} & LATE, path
            calls = {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
            assert not calls & words or path.parent.name == "cli" or path.name == "__main__.py", path


@pytest.mark.parametrize("package", ["lacmesh", "lacsolver", "verification"])
def test_a_public_class_has_its_name_for_itself(package):
    own = [tree for path, tree in trees().items() if path.is_relative_to(REPOSITORY / package)]
    names = Counter(node.name for tree in own for node in tree.body if isinstance(node, ast.ClassDef))
    assert [name for name, count in names.items() if count > 1 and not name.startswith("_")] == []


# ---- public names


@PACKAGES
def test_public_names_are_verbs_records_and_two_errors_that_type_checkers_and_stars_see(package):
    assert dir(package) == package.__all__ and len(package.__all__) <= 44
    things = {name: getattr(package, name) for name in package.__all__}
    assert all(inspect.isclass(thing) or inspect.isfunction(thing) for thing in things.values())
    errors = {name for name in things if name.endswith(("Error", "Warning"))}
    assert len(errors) == 2 and errors <= {*dir(importlib.import_module(f"{package.__name__}.errors"))}
    (block,) = (n for n in trees()[REPOSITORY / package.__name__ / "__init__.py"].body if isinstance(n, ast.If))
    assert {a.asname: n.module for n in block.body for a in n.names} == package._PUBLIC
    names = {}
    exec(f"from {package.__name__} import *", names)
    assert {name: names[name] for name in things} == things


@PACKAGES
def test_every_public_name_has_an_example_and_promises_public_errors(package):
    """Examples are run where the name is defined, as every doctest."""
    known = {*dir(lacmesh.errors), *dir(lacsolver.errors), *package.__all__, *dir(builtins)}
    for name in package.__all__:
        thing = getattr(package, name)
        own = [getattr(value, "__func__", value) for value in vars(thing).values()] if inspect.isclass(thing) else []
        methods = [value for value in own if inspect.isroutine(value) or isinstance(value, property)]
        text = "\n\n".join(inspect.getdoc(each) or "" for each in (thing, *methods))
        assert ">>> " in text and {*re.findall(r"\b[A-Z]\w*(?:Error|Warning)\b", text)} <= known, name


# ---- noise in last bits (`noise.py`)


def printed(code, seed=1):
    """Lines that Python prints with noise, as a command that a test starts; seed 0: without noise."""
    folders = [str(REPOSITORY)] if not seed else [str(REPOSITORY / "tests/noise_at_start"), str(REPOSITORY)]
    variables = {k: v for k, v in os.environ.items() if k != "NOISE_SEED"} | {"PYTHONPATH": os.pathsep.join(folders)}
    variables |= {"NOISE_SEED": str(seed)} if seed else {}
    done = subprocess.run([sys.executable, "-c", code], env=variables, cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split("\n")[:-1]


CODE = """
import numpy as np
from tests.noise import shaken
x = np.random.default_rng(0).normal(size=(60, 50))
y = shaken(x, 4)
far = (y.view(np.int64) - x.view(np.int64)).ravel()
print(sorted(set(far.tolist())), (shaken(x, 4) == y).all(), (shaken(x[::2, 3], 4) == y[::2, 3]).all())
print((shaken(x, 4, salt=1) == y).mean() < 0.3, shaken(x.T, 4).flags.f_contiguous)
exact = [0.0, -0.0, 1.0, -3.0, 0.5, 1e6, 2.0**-1022, 5e-324, 1e-310, 1.7976931348623157e308, np.inf, -np.inf, np.nan]
print((shaken(exact, 4).view(np.uint64) == np.array(exact).view(np.uint64)).all())
row, logs = np.abs(x)[:, 7], np.log(np.abs(x))[:, 7]
print((np.log(row.copy()) == logs).all(), (np.log(row) == logs).all())
d, out = np.zeros((4, 4)), np.empty((60, 50))
np.einsum("ii->i", d)[:] += 1.0
same = np.exp(x, out=out)
print(d.trace(), same is out, (out == np.exp(x)).all())
print(float(y.sum()).hex())
"""


def test_numbers_change_by_few_units_in_the_last_place_and_always_alike():
    """Integers, halves and numbers at the ends stay, and so do views and what is written into."""
    one, other = printed(CODE), printed(CODE, 2)
    assert one[:-1] == other[:-1] and one[-1] != other[-1]
    assert one[:-1] == [f"{list(range(-4, 5))} True True", "True True", "True", "True False", "4.0 True True"]
    assert printed("import sys; print([n for n in ('numpy', 'scipy', 'numba', 'lacmesh') if n in sys.modules])") == [
        "[]"
    ]


#: results that noise changes
CHANGED = [
    "np.log(x * x)",
    "np.exp(np.linspace(0.1, 0.9, 50))",
    "np.einsum('ij,ij->i', x, x)",
    "np.linalg.solve(x[:50].copy(), np.ones(50))",
    "np.linalg.norm(x, axis=1)",
    "scipy.linalg.lu_solve(scipy.linalg.lu_factor(x[:50]), x[51])",
    "splu(csc_array(x[:50].copy() + 9 * np.eye(50))).solve(x[51].copy())",
    "factorise(csr_array(x.T @ x)).solve(x[51].copy())",
    "tenth(x)",
]
IMPORTS = """
import numpy as np, scipy.linalg
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu
from tests.lacsolver.systems import factorise
from lacmesh.kernels import kernel
x = np.random.default_rng(0).normal(size=(60, 50))
@kernel
def tenth(x):
    out = np.empty_like(x)
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            out[i, j] = x[i, j] * 1.1
    return out
"""


def test_what_is_computed_has_noise():
    code = IMPORTS + "\n".join(f"print(*[float(v).hex() for v in ({each}).ravel()])" for each in CHANGED)
    for name, line, plain in zip(CHANGED, printed(code), printed(code, 0), strict=True):
        ours, theirs = (np.array([float.fromhex(v) for v in own.split()]) for own in (line, plain))
        assert line != plain, name
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12 * np.abs(theirs).max(), err_msg=name)
