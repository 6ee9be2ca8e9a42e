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
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lacmesh
from lacsolver.cli import COMMANDS
from tests.lacsolver.patch_meshes import stack
from tests.packaging import PACKAGES, PIP, PROJECT, build, install, linked_environment, user_environment

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
def user(built, tmp_path_factory):
    """The folder of a user with meshes, a case and scripts, and a shell's variables: the environment has the base."""
    folder = tmp_path_factory.mktemp("user")
    install(linked_environment(folder / "env", PROJECT["dependencies"]), built[0])
    for name in ("two_blocks.msh", "two_blocks.toml"):
        shutil.copy(ROOT / "data" / name, folder / name)
    mesh = stack("HEXA8", "HEXA8", 3, counts=(2, 1))
    supports = np.unique(np.concatenate([mesh.cells_of(name) for name in ("bottom", "x0", "y0")]))
    groups = {name: mesh.cells_of(of) for name, of in (("pin", "slave"), ("hole", "master"), ("top", "top"))}
    solids = {name: mesh.cells_of(name) for name in ("upper", "lower")}
    cell_groups = groups | {"base": supports} | solids
    lacmesh.write(folder / "assembly.msh", replace(mesh, cell_groups=cell_groups, group_tags={}))
    (folder / "first.py").write_text(SCRIPT, encoding="utf-8")
    return folder, user_environment(folder / "env")


def typed(user, line, **variables):
    """Run a line as a user types it in the folder; it must succeed, and what it prints comes back."""
    folder, env = user
    done = subprocess.run(line, shell=True, cwd=folder, env=env | variables, capture_output=True, text=True)
    assert done.returncode == 0, f"{line}: {done.stderr}"
    return done.stdout


@pytest.mark.vtk
def test_the_first_lines_run(user):
    """With our environment's packages, but for our own, which are those of the wheel."""
    line = "python -c \"import runpy, lacsolver; runpy.run_path('first.py'); print(lacsolver.__file__)\""
    *printed, place = typed(user, line, PYTHONPATH=sysconfig.get_path("purelib")).splitlines()
    assert place.startswith(str(user[0])) and printed == [
        "(43, 3) (4,)",
        "43 1.0 True",
        "1.0",
        "True 4 True",
        "contact.pin.area [1.] (4,)",
    ]


@pytest.mark.slow
def test_a_type_checker_knows_the_types(user):
    """A right script has no error, and one that takes a number for a mesh has one."""
    folder, env = user
    (folder / "wrong.py").write_text(
        "import lacsolver as ls\nls.solve(3)\nreveal_type(ls.solve('a.toml').contact['pin'].pressure)\n"
    )
    python = folder / "env" / "bin" / "python"
    check = [sys.executable, "-m", "mypy", "--python-executable", python, "--cache-dir", os.devnull]
    done = subprocess.run([*check, "first.py", "wrong.py"], cwd=folder, capture_output=True, text=True, env=env)
    *lines, last = done.stdout.splitlines()
    assert lines and all(line.startswith("wrong.py:") for line in lines) and last.startswith("Found 1 error in 1 file")
    assert 'Argument 1 to "solve"' in done.stdout and "numpy.ndarray" in done.stdout


def test_the_environment_has_the_base_only(user):
    """All that the wheel requires is there, and nothing of its extras."""
    folder, _ = user
    subprocess.run([*PIP, "--python", str(folder / "env" / "bin" / "python"), "check"], check=True)
    looked_for = "import importlib.util as u; print([u.find_spec(n) for n in ('gmsh', 'pyvista', 'sympy', 'meshio')])"
    assert typed(user, f'python -c "{looked_for}"') == "[None, None, None, None]\n"
    assert typed(user, 'python -c "import lacmesh; print(lacmesh.__file__)"').startswith(str(folder))


def test_the_commands_run_with_the_base_only(user):
    typed(user, "lacmesh cut two_blocks.msh --slave slave -o two_blocks.lac.msh")
    typed(user, "lacmesh check two_blocks.lac.msh --slave slave --master master")
    assert "36 of 36" in typed(user, "lacsolver run two_blocks.toml -o results")
    assert (user[0] / "results" / "solid.pvd").is_file()
    if "example" in COMMANDS:
        assert "two_blocks" in typed(user, "lacsolver example")


@pytest.mark.slow
def test_the_verification_is_in_the_wheel(user):
    """A case with levels of its quick suite, whose result is met, and the list of all."""
    assert "cases, about" in typed(user, "python -m verification list --suite quick")
    printed = typed(user, f"python -m verification run --suite quick {CASE} -j 1 -o report")
    manufactured = typed(user, "python -m verification run --family manufactured -o none 2>&1; true")
    assert "pip install 'lacmesh[verification]'" in manufactured  # which brings sympy
    assert "met 5 of 5" in printed and (user[0] / "report" / "report.html").is_file()


def test_the_wheel_has_the_files_of_the_checkout(built):
    """It was built from what the source distribution holds, with no checkout beside it, tests and data included."""
    wheel, source = built
    with tarfile.open(source) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert {"tests/test_wheel.py", "data/two_blocks.msh"} <= inside
    ours = {}
    for place, source_folder in (*((name, name) for name in PACKAGES), ("lacmesh/data", "data")):
        for name in kept(source_folder):
            ours[f"{place}/{name.relative_to(source_folder)}"] = zlib.crc32((ROOT / name).read_bytes())
    ours["verification/meshes/pin_in_lug.step"] = ours["lacmesh/data/pin_in_lug.step"]
    theirs = {f.filename: f.CRC for f in zipfile.ZipFile(wheel).infolist() if ".dist-info/" not in f.filename}
    assert theirs == ours


def kept(folder):
    """The files of a folder of the checkout, without what Python and the examples leave there."""
    names = (path.relative_to(ROOT) for path in (ROOT / folder).rglob("*") if path.is_file())
    return [n for n in names if "__pycache__" not in n.parts and not n.name.endswith((".lac.msh", ".lac.med"))]


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
    user = tmp_path / "checkout", user_environment(tmp_path / "env")
    for words in (line, *commands):
        typed(user, words)
    assert (tmp_path / "checkout" / "two_blocks_pressure.png").stat().st_size > 10_000
