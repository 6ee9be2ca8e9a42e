"""The wheel as a user has it: installed beside no checkout, its first lines run as they stand, and are typed."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import venv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh

ROOT = Path(__file__).resolve().parents[1]
#: the lines of a first program, which also name every field that a solution promises
SCRIPT = """
import lacmesh
import lacsolver as ls

mesh = lacmesh.read("assembly.msh")
case = ls.Case(
    model="3d",
    material=[ls.Material(young=210e3, poisson=0.3)],
    contact=[ls.Contact(slave="pin", master="hole")],
    displacement=[ls.Displacement(group="base", ux=0, uy=0, uz=0)],
    force=[ls.Force(group="top", fz=-1000.0, total=True)],
)
solution = ls.solve(case, mesh)
print(solution.u.shape, solution.contact["pin"].pressure.shape)
contact = solution.contact["pin"]
fields = contact.gap, contact.status, contact.area, contact.centre, contact.normal, contact.recovered, contact.force
stress, equivalent = solution.stress(), solution.von_mises()
print(solution.mesh.n_nodes, solution.time, solution.iterations > 0)
grid, picture = solution.to_pyvista(), solution.plot()
solution.save("folder")
for solution in ls.march(case, mesh):
    print(solution.time)

system = ls.assemble(case, mesh)
matrices = system.K, system.f, system.fixed, system.u0, system.dofs
pair = ls.contact_matrices(mesh, "pin", "hole")
found = ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0)
print(abs(found.u - solution.u.ravel()).max() < 1e-9 * abs(found.u).max(), found.status.sum(), found.iterations > 0)
results = ls.read_results("folder")
print(sorted(results.history)[0], results.times, results.solution(0).contact["pin"].pressure.shape)
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder of a user, and the Python of an environment that has the wheel, and our environment's dependencies."""
    folder = tmp_path_factory.mktemp("user")
    wheels = folder / "wheels"
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", str(wheels), str(ROOT)], check=True)
    venv.create(folder / "env")
    packages = sysconfig.get_path("purelib", "venv", {"base": str(folder / "env"), "platbase": str(folder / "env")})
    (wheel,) = wheels.glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", packages, str(wheel)], check=True)
    ours = sysconfig.get_path("purelib")
    Path(packages, "dependencies.pth").write_text(ours + "\n", encoding="utf-8")
    python = folder / "env" / "bin" / "python"
    mesh = lacmesh.read(ROOT / "data" / "two_blocks.msh")
    held = np.unique(np.concatenate([mesh.cells_of(name) for name in ("bottom", "symmetry_x", "symmetry_y")]))
    groups = {"pin": mesh.cells_of("slave"), "hole": mesh.cells_of("master"), "top": mesh.cells_of("top"), "base": held}
    solids = {name: mesh.cells_of(name) for name in ("upper", "lower")}
    lacmesh.write(folder / "assembly.msh", replace(mesh, cell_groups=groups | solids, group_tags={}))
    (folder / "first.py").write_text(SCRIPT, encoding="utf-8")
    return folder, python


def ran(installed, *args):
    folder, python = installed
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run([python, *args], cwd=folder, capture_output=True, text=True, env=env)


def test_the_packages_are_those_of_the_wheel(installed):
    done = ran(installed, "-c", "import lacmesh, lacsolver; print(lacmesh.__file__); print(lacsolver.__file__)")
    assert done.stdout.count(str(installed[0])) == 2, done.stderr


@pytest.mark.vtk
def test_the_first_lines_run(installed):
    done = ran(installed, "first.py")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "(512, 3) (36,)",
        "512 1.0 True",
        "1.0",
        "True 36 True",
        "contact.pin.area [1.] (36,)",
    ]


def test_a_type_checker_knows_the_types(installed):
    """A right script has no error, and one that takes a number for a mesh has one."""
    folder, _ = installed
    (folder / "wrong.py").write_text(
        "import lacsolver as ls\nls.solve(3)\nreveal_type(ls.solve('a.toml').contact['pin'].pressure)\n"
    )
    check = [sys.executable, "-m", "mypy", "--python-executable", installed[1], "--cache-dir", folder / "cache"]
    env = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "MYPYPATH")}
    right, wrong = (
        subprocess.run([*check, name], cwd=folder, capture_output=True, text=True, env=env)
        for name in ("first.py", "wrong.py")
    )
    assert right.returncode == 0, right.stdout
    assert wrong.stdout.count("error") >= 1 and 'Argument 1 to "solve"' in wrong.stdout
    assert "numpy.ndarray" in wrong.stdout
