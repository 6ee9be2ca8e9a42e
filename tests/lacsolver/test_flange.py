"""The flange joint of data/ and its tutorial: script, mesh and case, and the forces of bolts that the page tells."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacsolver.constraints.cyclic import with_sectors
from lacsolver.validation import validate

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "tutorials" / "flange.md"
DATA = ROOT / "data" / "flange"
GROUPS = {
    *("upper", "lower", "bolt", "face_upper", "face_lower", "top", "bottom", "head", "nut", "end", "foot"),
    *("side_a", "side_b", "shank"),
}


def test_the_case_is_valid_and_has_its_bolt_and_its_sides():
    case = ls.read_case(DATA / "flange.toml")
    assert validate(case).problems == []
    mesh = lacmesh.read(DATA / "flange.msh")
    assert set(mesh.cell_groups) == GROUPS and mesh.cells_by_type["TETRA10"] == 2242
    assert with_sectors(case, mesh).cyclic[0].matching
    parts = lacmesh.split(mesh, "shank")
    assert all(len(parts.cell_groups[f"shank_{end}"]) == len(mesh.cell_groups["shank"]) for end in "ab")


@pytest.mark.gmsh
def test_the_script_makes_the_mesh(tmp_path):
    """Another version of gmsh may give other tetrahedra: the groups, and the volumes of the bodies."""
    subprocess.run(
        [sys.executable, DATA / "make_flange.py", tmp_path / "made.msh", "24"], check=True, capture_output=True
    )
    made = lacmesh.read(tmp_path / "made.msh")
    assert set(made.cell_groups) == GROUPS
    sizes = [measured(mesh, "bolt") for mesh in (made, lacmesh.read(DATA / "flange.msh"))]
    np.testing.assert_allclose(sizes, 2 * np.pi * (6**2 * 16 + 11**2 * 8), rtol=0.03)
    assert with_sectors(ls.read_case(DATA / "flange.toml"), made).cyclic[0].matching


def measured(mesh, group):
    from lacmesh.reference.quadrature import measure

    return sum(
        float(measure(kind, mesh.points[nodes]).sum()) for kind, _, nodes in mesh.select(mesh.cell_groups[group])
    )


@pytest.mark.slow
def test_the_tutorial_runs_and_tells_what_comes(tmp_path):
    """Forces in the table of the page are those of the run."""
    sys.path.insert(0, str(ROOT / "docs" / "tutorials"))
    try:
        run = importlib.import_module("run")
        printed = "".join(text for _, text in run.run_page(PAGE, tmp_path))
    finally:
        sys.path.remove(str(ROOT / "docs" / "tutorials"))
        sys.modules.pop("run", None)
    assert (tmp_path / "flange.png").is_file() and (tmp_path / "flange_bolts.png").is_file()
    lines = re.findall(
        r"t = ([\d.]+): pull ([\d.]+) kN, torque ([\d.]+) N m, bolt ([\d.]+) kN, gasket ([\d.]+)", printed
    )
    number = r" ([\d.]+) \|"
    table = re.findall(r"^\|" + 5 * number, PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    of_run = {float(t): tuple(map(float, values)) for t, *values in lines}
    assert len(table) == 3
    for t, *values in table:
        np.testing.assert_allclose(of_run[float(t)], tuple(map(float, values)), atol=0.06)
