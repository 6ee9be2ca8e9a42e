"""The patch, press fit and Hertz rows of `cases.json`, as TOML cases through the command, and twins of the patches.

Press fits and spheres on meshes of those sizes are in the verification's families press_fit and hertz_engineering.

Facts of the rows, with their origin (code_aster's validation suite, and `peers.md` for its Newton iterations), are in
`ROWS`; the meshes are read from the shared folder where it is there.
"""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacsolver.cli import main
from lacsolver.space.space import COMPONENTS
from tests.lacsolver.patch_meshes import stack

PATCH = {"young": 2000.0, "poisson": 0.3, "pressure": 25.0}
PLANE, SOLID = {"Sym": "ux", "Group_3": "uy"}, {"Symx": "ux", "Symy": "uy", "Group_3": "uz"}
#: id: (mesh, model, slave, master, hexa, fixed)
ROWS = {
    "ssnp170a": ("ssnp170a.med", "plane_strain", "Group_1", "Group_2", None, PLANE),
    "ssnp170e-1": ("ssnp170e.med", "plane_strain", "Group_1", "Group_2", None, PLANE),
    "ssnp170e-2": ("ssnp170e.med", "plane_strain", "Group_2", "Group_1", None, PLANE),
    "ssnp170k": ("ssnp170k.med", "3d", "Group_1", "Group_2", None, SOLID),
    "ssnp170m": ("ssnp170m.med", "3d", "Group_1", "Group_2", "hexa", SOLID),
}
#: thick sphere of Lame: pressure 25 at r = 20, nothing at r = 40, at r = 30
LAME = 25 * 20**3 / (40**3 - 20**3) * (40**3 / 30**3 - 1)
#: p0 of code_aster's quadratic meshes of these bodies (the half-space has 2798.3), and its Newton iterations
HERTZ, NEWTON = 2910.0, {"ssnv104k": 77, "ssnv104l": 69}


def solved(folder: Path, text: str) -> tuple[dict, list[dict[str, str]]]:
    """Run a case as a user would; what results.json has, and the rows of the contact's table at the end."""
    case = folder / "case.toml"
    case.write_text(text)
    assert main(["run", str(case), "--quiet", "--force"]) == 0
    results = json.loads((folder / "case" / "results.json").read_text())
    (table,) = (folder / "case").glob("contact_*.csv")
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    last = max(float(row["time"]) for row in rows)
    assert results["balance"]["force"] <= 1e-12
    assert results["balance"]["moment"] <= 1e-12
    return results, [row for row in rows if float(row["time"]) == last]


def patch_text(mesh: Path, model: str, slave: str, master: str, hexa: str | None, fixed: dict, top: str) -> str:
    """A patch test as a case."""
    lines = [f'mesh = "{mesh}"', f'model = "{model}"', "[[material]]", "young = 2000.0", "poisson = 0.3", "[[contact]]"]
    lines += [f'slave = "{slave}"', f'master = "{master}"', *([f'hexa = "{hexa}"'] if hexa else [])]
    for group, component in fixed.items():
        lines += ["[[displacement]]", f'group = "{group}"', f"{component} = 0.0"]
    return "\n".join([*lines, "[[pressure]]", f'group = "{top}"', "value = 25.0"])


def check_patch(results: dict, rows: list[dict[str, str]], dim: int, size: float) -> None:
    """Stress, pressure, gap against the mesh size and coverage, all within 1e-10."""
    (zone,) = results["contact"].values()
    assert abs(zone["pressure_min"] / 25 - 1) < 1e-10
    assert abs(zone["pressure_max"] / 25 - 1) < 1e-10
    assert max(abs(zone["gap_min"]), abs(zone["gap_max"])) < 1e-10 * size
    assert abs(zone["coverage_min"] - 1) < 1e-10
    assert zone["coverage_max"] <= 1
    assert {row["status"] for row in rows} == {"1"}
    normal = "yy" if dim == 2 else "zz"
    for ranges in results["stress"].values():
        assert np.abs(np.array(ranges[normal]) / 25 + 1).max() < 1e-10
        across = [c for c in COMPONENTS if c in ranges and c not in (normal, "zz" if dim == 2 else normal)]
        assert max(np.abs(ranges[c]).max() for c in across) < 1e-10 * 25
    assert results["steps"][-1]["iterations"] <= 2  # code_aster's


def test_every_patch_of_the_suite_is_there(shared):
    listed = json.loads((shared / "reference" / "cases.json").read_text())["cases"]
    assert {row["id"] for row in listed if row["kind"] == "patch"} == set(ROWS)


@pytest.mark.shared
@pytest.mark.parametrize("row", ROWS)
def test_patch_of_the_suite(shared, tmp_path, row):
    name, model, slave, master, hexa, fixed = ROWS[row]
    mesh = shared / "reference" / "meshes" / name
    results, rows = solved(tmp_path, patch_text(mesh, model, slave, master, hexa, fixed, "Group_4"))
    faces = len(lacmesh.read(mesh).cells_of(slave))
    check_patch(results, rows, 2 if model != "3d" else 3, 50 / faces ** (1 if model != "3d" else 0.5))


@pytest.mark.parametrize("kinds", [("TRIA3", "QUAD4"), ("QUAD8", "TRIA6"), ("TETRA4", "HEXA8"), ("HEXA20", "TETRA10")])
def test_patch_twin(tmp_path, kinds):
    dim = 2 if kinds[0] in ("TRIA3", "QUAD8") else 3
    lacmesh.write(tmp_path / "blocks.med", stack(*kinds, dim))
    fixed = {"x0": "ux", "y0": "uy", "bottom": "uz"} if dim == 3 else {"x0": "ux", "bottom": "uy"}
    model = "3d" if dim == 3 else "plane_strain"
    text = patch_text(tmp_path / "blocks.med", model, "slave", "master", None, fixed, "top")
    results, rows = solved(tmp_path, text)
    check_patch(results, rows, dim, 0.25)


def press_fit_text(mesh: Path, slave: str, master: str, fixed: dict, inner: str) -> str:
    """The press fit as a case."""
    text = patch_text(mesh, "axisymmetric", slave, master, None, fixed, inner)
    return text.replace("[[displacement]]", 'normals = "smoothed"\n[[displacement]]', 1)


def check_press_fit(results: dict, tolerance: float) -> None:
    (zone,) = results["contact"].values()
    assert abs(zone["pressure_min"] / LAME - 1) < tolerance
    assert abs(zone["pressure_max"] / LAME - 1) < tolerance


@pytest.mark.shared
def test_press_fit_of_the_suite(shared, tmp_path):
    mesh = shared / "reference" / "meshes" / "ssnp173a.med"
    text = press_fit_text(mesh, "Group_2", "Group_1", {"Symx": "ux", "Symy": "uy"}, "Group_3")
    check_press_fit(solved(tmp_path, text)[0], 4e-4)


def hertz_text(mesh: Path, slave: str, master: str, up: str, down: str, kind: str) -> str:
    """The spheres as a case, in code_aster's ten steps; its tolerance, of residuals alone, is 1e-6."""
    return f"""
mesh = "{mesh}"
model = "axisymmetric"
[[material]]
young = 20000.0
poisson = 0.3
[[contact]]
slave = "{slave}"
master = "{master}"
normals = "smoothed"
geometry = "current"
[[displacement]]
group = "{up}"
kind = "{kind}"
uy = -2.0
[[displacement]]
group = "{down}"
kind = "{kind}"
uy = 2.0
[steps]
count = 10
[solver]
tolerance = 1e-8
"""


@pytest.mark.slow
@pytest.mark.shared
@pytest.mark.parametrize("row", NEWTON)
def test_hertz_of_the_suite(shared, tmp_path, row):
    mesh = shared / "reference" / "meshes" / f"{row}.med"
    results, _ = solved(tmp_path, hertz_text(mesh, "CON2", "CON1", "SPHSUP", "SPHINF", "node"))
    assert abs(results["contact"]["CON2"]["pressure_max"] / HERTZ - 1) < 0.03
    assert sum(step["iterations"] for step in results["steps"]) <= 0.6 * NEWTON[row]
    assert not any(step["halvings"] for step in results["steps"])
