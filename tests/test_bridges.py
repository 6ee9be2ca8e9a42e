"""Contact for other programs: the scripts of bridges.md print what it says, and solve as lacsolver does, to 1e-9."""

from __future__ import annotations

import contextlib
import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacsolver.cli import main as lacsolver

ROOT = Path(__file__).resolve().parents[1]
BRIDGES = ROOT / "docs" / "bridges"
PAGE = BRIDGES.with_suffix(".md").read_text(encoding="utf-8")
MESH = ROOT / "data" / "press_fit.msh"
CONSOLE, FILES = re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
(CPP,) = re.findall(r"```cpp\n(.*?)```", PAGE, re.DOTALL)
NAMES = [
    pytest.param(name, marks=getattr(pytest.mark, name)) for name in ("felupe", "ngsolve", "mfem", "sfepy", "dolfinx")
]


def bridge(name):
    """The script of a program, as a module."""
    sys.path.insert(0, str(BRIDGES))
    try:
        return importlib.import_module(f"bridge_{name}")
    finally:
        sys.path.remove(str(BRIDGES))


def own(order):
    """lacsolver's own solution of the press fit."""
    case = ls.read_case(ROOT / "data" / "press_fit.toml")
    mesh = lacmesh.read(MESH)
    return ls.solve(case, lacmesh.raise_order(mesh) if order == 2 else mesh)


@pytest.mark.parametrize(
    ("name", "order"),
    [
        pytest.param("felupe", 1, marks=pytest.mark.felupe),
        pytest.param("felupe", 2, marks=[pytest.mark.felupe, pytest.mark.slow]),
        pytest.param("ngsolve", 1, marks=pytest.mark.ngsolve),
        pytest.param("mfem", 1, marks=pytest.mark.mfem),
        pytest.param("sfepy", 1, marks=pytest.mark.sfepy),
        pytest.param("dolfinx", 1, marks=pytest.mark.dolfinx),
    ],
)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_bridge_solves_as_lacsolver_does(name, order):
    theirs = bridge(name).solve(MESH, **({"order": order} if order == 2 else {}))
    ours = own(order)
    u = theirs.u.reshape(-1, 3) if name in ("felupe", "sfepy", "dolfinx") else theirs.u.reshape(3, -1).T
    np.testing.assert_allclose(u, ours.u, rtol=0, atol=1e-9 * abs(ours.u).max())
    pressure = ours.contact["fit"].pressure
    np.testing.assert_allclose(theirs.pressure, pressure, rtol=0, atol=1e-9 * pressure.max())


@pytest.mark.parametrize("name", NAMES)
def test_the_page_shows_what_a_script_prints(name):
    ((command, shown),) = re.findall(rf"^\$ python (\S*bridge_{name}\.py \S+)\n(.*)$", CONSOLE, re.MULTILINE)
    printed = subprocess.run([sys.executable, *command.split()], cwd=ROOT, capture_output=True, text=True, check=True)
    assert printed.stdout.strip().splitlines()[-1] == shown


@pytest.mark.parametrize("path", sorted(BRIDGES.glob("bridge_*.py")), ids=lambda p: p.stem)
def test_a_bridge_has_at_most_sixty_lines(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 60 and path.name in PAGE


@pytest.mark.compiler
def test_a_program_in_cpp_reads_the_files(tmp_path):
    """Compile the program of the page: its sums are those of the arrays."""
    commands = re.findall(r"^\$ (.*)$", FILES, re.MULTILINE)
    assert commands[0] == "lacsolver matrices data/press_fit.toml -o contact.npz --mtx"
    with contextlib.chdir(tmp_path):
        assert lacsolver(["matrices", str(ROOT / "data/press_fit.toml"), "-o", "contact.npz", "--mtx"]) == 0
        subprocess.run(commands[1].replace("python", sys.executable, 1), shell=True, check=True)
        Path("read.cpp").write_text(CPP)
        subprocess.run(["g++", "-Wall", "-Werror", "-o", "read", "read.cpp"], check=True)
        printed = subprocess.run(["./read"], capture_output=True, text=True, check=True).stdout
        B, arrays = ls.read_matrices("contact.npz")
    total = arrays["G"].sum()
    assert printed == f"{B.shape[0]} rows, {B.shape[1]} columns, {B.nnz} entries: {total:.6f} {total:.6f}\n"
