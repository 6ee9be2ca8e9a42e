"""The wheel as a user has it: installed beside no checkout, its first lines run as they stand, and are typed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacsolver.cli import COMMANDS
from tests.packaging import PIP, PROJECT, build, install, linked_environment, user_environment

ROOT = Path(__file__).resolve().parents[1]
#: a case of a fraction of a second
CASE = "--case patch/2d-TRIA3"
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
def built(tmp_path_factory):
    """The wheel and the source distribution."""
    return build(tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """The folder of a user, and the Python of an environment that has the wheel, and our environment's dependencies."""
    folder = tmp_path_factory.mktemp("user")
    wheel, _ = built
    venv.create(folder / "env")
    packages = sysconfig.get_path("purelib", "venv", {"base": str(folder / "env"), "platbase": str(folder / "env")})
    python = folder / "env" / "bin" / "python"
    install(python, wheel)
    ours = sysconfig.get_path("purelib")
    Path(packages, "dependencies.pth").write_text(ours + "\n", encoding="utf-8")
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


# ---- base dependencies only


@pytest.fixture(scope="module")
def base(built, tmp_path_factory):
    """The folder of a user with a mesh and a case, and the variables of a shell whose environment has the base only."""
    folder = tmp_path_factory.mktemp("base")
    install(linked_environment(folder / "env", PROJECT["dependencies"]), built[0])
    for name in ("two_blocks.msh", "two_blocks.toml"):
        shutil.copy(ROOT / "data" / name, folder / name)
    return folder, user_environment(folder / "env")


def typed(base, line):
    """Run a line as a user types it in the folder; it must succeed, and what it prints comes back."""
    folder, env = base
    done = subprocess.run(line, shell=True, cwd=folder, env=env, capture_output=True, text=True)
    assert done.returncode == 0, f"{line}: {done.stderr}"
    return done.stdout


def test_the_environment_has_the_base_only(base):
    """All that the wheel requires is there, and nothing of its extras."""
    folder, _ = base
    subprocess.run([*PIP, "--python", str(folder / "env" / "bin" / "python"), "check"], check=True)
    looked_for = "import importlib.util as u; print([u.find_spec(n) for n in ('gmsh', 'pyvista', 'sympy', 'meshio')])"
    assert typed(base, f'python -c "{looked_for}"') == "[None, None, None, None]\n"
    assert typed(base, 'python -c "import lacmesh; print(lacmesh.__file__)"').startswith(str(folder))


def test_the_commands_run_with_the_base_only(base):
    typed(base, "lacmesh cut two_blocks.msh --slave slave -o two_blocks.lac.msh")
    typed(base, "lacmesh check two_blocks.lac.msh --slave slave --master master")
    assert "36 of 36" in typed(base, "lacsolver run two_blocks.toml -o results")
    assert (base[0] / "results" / "solid.pvd").is_file()
    if "example" in COMMANDS:
        assert "two_blocks" in typed(base, "lacsolver example")


def test_the_verification_is_in_the_wheel(base):
    """A case with levels of its quick suite, whose result is met, and the list of all."""
    assert "cases, about" in typed(base, "python -m verification list --suite quick")
    printed = typed(base, f"python -m verification run --suite quick {CASE} -j 1 -o report")
    manufactured = typed(base, "python -m verification run --family manufactured -o none 2>&1; true")
    assert "pip install 'lacmesh[verification]'" in manufactured  # which brings sympy
    assert "met 5 of 5" in printed and (base[0] / "report" / "report.html").is_file()


def test_the_source_distribution_builds_the_same_wheel(built, tmp_path):
    """From what is unpacked, with no checkout beside it, tests and data included."""
    wheel, source = built
    with tarfile.open(source) as archive:
        archive.extractall(tmp_path, filter="data")
    (unpacked,) = tmp_path.iterdir()
    assert (unpacked / "tests" / "test_wheel.py").is_file() and (unpacked / "data" / "two_blocks.msh").is_file()
    command = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(tmp_path / "again"),
        unpacked,
    ]
    subprocess.run(command, check=True, capture_output=True)
    (again,) = (tmp_path / "again").iterdir()
    ours, theirs = ({f.filename: f.CRC for f in zipfile.ZipFile(w).infolist()} for w in (wheel, again))
    assert ours == theirs


# ---- with a package index


@pytest.mark.slow
@pytest.mark.index
@pytest.mark.parametrize("tool", ["pipx", "uv"])
def test_the_wheel_is_installed_as_a_tool(tool, built, tmp_path):
    """`pipx install` and `uv tool install`: the commands lie in a folder of programs, and run from anywhere."""
    venv.create(tmp_path / "env", with_pip=True)
    env = user_environment(tmp_path / "env") | {
        "PIPX_HOME": str(tmp_path / "tools"), "PIPX_BIN_DIR": str(tmp_path / "bin"),
        "UV_TOOL_DIR": str(tmp_path / "tools"), "UV_TOOL_BIN_DIR": str(tmp_path / "bin"),
    }  # fmt: skip
    line = {"pipx": f"pipx install {built[0]}", "uv": f"uv tool install --no-config {built[0]}"}[tool]
    subprocess.run(f"pip -q install {tool} && {line}", shell=True, check=True, env=env, cwd=tmp_path)
    for name in ("lacmesh", "lacsolver"):
        done = subprocess.run([tmp_path / "bin" / name, "--version"], capture_output=True, text=True, env=env)
        assert done.stdout == f"{name} {lacmesh.__version__}\n", done.stderr


@pytest.mark.slow
@pytest.mark.index
@pytest.mark.vtk
def test_the_install_line_of_the_readme_as_it_is_typed(tmp_path):
    """In a copy of the checkout and a new environment; then the README's commands, and its picture is there."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^(pip install '\.\[.*\]')", readme, re.MULTILINE)
    commands = re.findall(r"^\$ (.*)$", readme, re.MULTILINE)
    names = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in names.splitlines():
        if not name.startswith(("docs/", "tests/")):
            (tmp_path / "checkout" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tmp_path / "checkout" / name)
    venv.create(tmp_path / "env", with_pip=True)
    base = tmp_path / "checkout", user_environment(tmp_path / "env")
    for words in (line, *commands):
        typed(base, words)
    assert (tmp_path / "checkout" / "two_blocks_pressure.png").stat().st_size > 10_000
