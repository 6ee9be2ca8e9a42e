"""The wheel as a user has it, beside no checkout; files for the forge, conda and containers agree with the project."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
import zlib
from dataclasses import replace
from importlib.metadata import distribution
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
import yaml

import lacmesh
from tests import REPOSITORY
from tests.lacsolver.patch_meshes import stack

PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
MAKEFILE = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
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
contact = solution.contact["pin"]
fields = contact.gap, contact.status, contact.area, contact.centre, contact.normal, contact.recovered, contact.force
stress, equivalent = solution.stress(), solution.von_mises()
grid, picture = solution.to_pyvista(), solution.plot()
solution.save("folder")
system = ls.assemble(case, mesh)
matrices = system.K, system.f, system.fixed, system.u0, system.dofs
pair = ls.contact_matrices(mesh, "pin", "hole")
found = ls.solve_contact(system.K, system.f, pair.B, pair.G, fixed=system.fixed, u0=system.u0)
results = ls.read_results("folder")
print(solution.u.shape, contact.pressure.shape, solution.mesh.n_nodes, solution.time, solution.iterations > 0)
print([solution.time for solution in ls.march(case, mesh)])
print(abs(found.u - solution.u.ravel()).max() < 1e-9 * abs(found.u).max(), found.status.sum(), found.iterations > 0)
print(sorted(results.history)[0], results.times, results.solution(0).contact["pin"].pressure.shape)
"""


def bare(requirement):
    """The name of the package that is required: `numpy` of `numpy>=1.26; extra == 'x'`."""
    return re.match(r"[\w.-]+", requirement)[0]


def packages_of(requirements):
    """The distributions installed here that requirements ask for, and those that these need; no optional ones."""
    needed, waiting = {}, list(requirements)
    while waiting:
        requirement = waiting.pop()
        try:
            name, package = bare(requirement), distribution(bare(requirement))
        except ModuleNotFoundError:  # of another Python or system
            assert ";" in requirement
            continue
        if name not in needed:
            needed[name] = package
            waiting += [r for r in package.requires or () if "extra" not in r]
    return needed.values()


def environment(folder, wheel, extras=()):
    """A new environment with the wheel, and what it requires as links to the packages installed here: its variables."""
    venv.create(folder)
    inside = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder), "platbase": str(folder)}))
    for package in packages_of(chain(PROJECT["dependencies"], *(EXTRAS[extra] for extra in extras))):
        names = {file.parts[0] for file in package.files or ()} - {"..", "__pycache__"}
        for name in names - {path.name for path in inside.iterdir()}:
            (inside / name).symlink_to(Path(package.locate_file(name)).resolve())
    pip = [sys.executable, "-m", "pip", "-q", "--disable-pip-version-check", "--python", folder / "bin" / "python"]
    subprocess.run([*pip, "install", "--no-deps", "--no-compile", wheel], check=True)
    subprocess.run([*pip, "check"], check=True)  # all that the wheel requires is there
    return user_environment(folder)


def user_environment(folder):
    """The variables of a user's shell, with the programs of an environment first."""
    env = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "MYPY", "MAKE"))}
    return env | {"PATH": f"{folder / 'bin'}{os.pathsep}{env['PATH']}"}


def typed(folder, env, line):
    """Run a line as a user types it in a folder; it must succeed, and what it prints comes back."""
    done = subprocess.run(line, shell=True, cwd=folder, env=env, capture_output=True, text=True)
    assert done.returncode == 0, f"{line}: {done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The wheel and the source distribution, as `make wheel` builds them."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(REPOSITORY)]
    subprocess.run(command, check=True, capture_output=True)
    return next(folder.glob("*.whl")), next(folder.glob("*.tar.gz"))


@pytest.fixture(scope="module")
def user(built, tmp_path_factory):
    """A user's folder with data/ and a first program, and a shell's variables: the environment has the base alone."""
    folder = tmp_path_factory.mktemp("user")
    shutil.copytree(REPOSITORY / "data", folder / "data")
    mesh = stack("HEXA8", "HEXA8", 3, counts=(2, 1))
    supports = np.unique(np.concatenate([mesh.cells_of(name) for name in ("bottom", "x0", "y0")]))
    names = {"pin": "slave", "hole": "master", "top": "top", "upper": "upper", "lower": "lower"}
    groups = {name: mesh.cells_of(of) for name, of in names.items()} | {"base": supports}
    lacmesh.write(folder / "assembly.msh", replace(mesh, cell_groups=groups, group_tags={}))
    (folder / "first.py").write_text(SCRIPT, encoding="utf-8")
    return folder, environment(folder / "env", built[0])


@pytest.mark.slow
@pytest.mark.vtk
def test_the_readme_and_a_first_program_run_with_what_the_install_line_brings(user, built):
    folder, _ = user
    (line,) = re.findall(r"^pip install '\.\[(.*)\]'", README, re.MULTILINE)
    env = environment(folder / "view", built[0], line.split(","))
    for command in re.findall(r"^\$ (.*)$", README, re.MULTILINE):
        typed(folder, env, command)
    assert (folder / "two_blocks_pressure.png").stat().st_size > 10_000
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    (folder / "readme.py").write_text(code, encoding="utf-8")
    assert "largest pressure 17.5" in typed(folder, env, "python readme.py")
    assert typed(folder, env, "python first.py").splitlines() == [
        "(43, 3) (4,) 43 1.0 True",
        "[1.0]",
        "True 4 True",
        "contact.pin.area [1.] (4,)",
    ]


def test_the_commands_run_with_the_base_only(user):
    folder, _ = user
    modules = "import importlib.util as u; print([u.find_spec(n) for n in ('gmsh', 'pyvista', 'sympy', 'meshio')])"
    assert typed(*user, f'python -c "{modules}"') == "[None, None, None, None]\n"
    assert typed(*user, 'python -c "import lacmesh; print(lacmesh.__file__)"').startswith(str(folder))
    typed(*user, "lacmesh cut data/two_blocks.msh --slave slave -o cut.msh")
    typed(*user, "lacmesh check cut.msh --slave slave --master master")
    assert "36 of 36" in typed(*user, "lacsolver run data/two_blocks.toml -o results")
    page = Path(typed(*user, "lacsolver docs solver --path").strip())
    assert page.is_relative_to(folder) and page.read_text().startswith("# ")
    assert (folder / "results" / "solid.pvd").is_file() and "two_blocks" in typed(*user, "lacsolver example")
    done = subprocess.run("lacsolver run data/two_blocks.toml -o r --plot p.png", shell=True, cwd=folder, env=user[1],
                          capture_output=True, text=True)  # fmt: skip
    assert done.returncode == 2 and "lacmesh[view]" in done.stderr


@pytest.mark.slow
def test_the_verification_and_benchmarks_run(user, built):
    """A case of the quick suite is met; benchmarks give tables in small sizes, but `start`, which has one."""
    words = "--suite quick --case patch/2d-TRIA3 -j 1 -o report"
    env = environment(user[0] / "with_extra", built[0], ["verification"])
    assert "met 5 of 5" in typed(user[0], env, f"python -m verification run {words}")
    assert (user[0] / "report" / "report.html").is_file()
    for name in re.search(r"for name in start ([\w. ]+); do OPENBLAS", MAKEFILE)[1].split():
        done = typed(REPOSITORY, {**os.environ}, f"{sys.executable} -m benchmarks.{name} --quick")
        assert done.count("|") > 8, done


def test_the_wheel_has_the_files_of_the_checkout(built):
    """It was built from what the source distribution holds, with no checkout beside it, tests and data included."""
    with tarfile.open(built[1]) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert {"tests/test_packages.py", "data/two_blocks.msh"} <= inside
    ours = {}
    for place, source in {
        "lacmesh/data": "data",
        "lacmesh/docs": "docs",
        **{name: name for name in ("lacmesh", "lacsolver", "verification")},
    }.items():
        for path in (REPOSITORY / source).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts and ".lac." not in path.name:
                ours[f"{place}/{path.relative_to(REPOSITORY / source)}"] = zlib.crc32(path.read_bytes())
    ours["verification/meshes/pin_in_lug.step"] = ours["lacmesh/data/pin_in_lug.step"]
    files = zipfile.ZipFile(built[0]).infolist()
    assert {file.filename: file.CRC for file in files if ".dist-info/" not in file.filename} == ours


# ---- files of the checkout


def test_recipe_and_table_of_dependencies_agree_with_the_project():
    recipe = yaml.safe_load((REPOSITORY / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == lacmesh.__version__
    ours = {r.replace(">=", " >=") for r in PROJECT["dependencies"] if bare(r) != "rslab"}  # which conda-forge lacks
    assert set(recipe["requirements"]["run"]) == ours | {f"python {PROJECT['requires-python']}"}
    points = [f"{name} = {target}" for name, target in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == points
    text = (REPOSITORY / "docs" / "decisions.md").read_text(encoding="utf-8")
    head, *rows = re.findall(r"^\| ([\w, -]+) \| ([^|]+) \| ([^|]+) \|$", text, re.MULTILINE)
    assert head == ("package", "used for", "replacement")
    needs = {bare(need) for need in chain(PROJECT["dependencies"], *EXTRAS.values())} - {"lacmesh"}
    assert {name for row in rows for name in row[0].split(", ")} == needs
    cited = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == lacmesh.__version__ and cited["license"] == PROJECT["license"]
    named = [PROJECT["readme"], *PROJECT["license-files"], *re.findall(r"[\w/]+\.md", cited["abstract"])]
    assert len(named) == 6 and all((REPOSITORY / name).is_file() for name in named)
    assert f"## {lacmesh.__version__}" in (REPOSITORY / "CHANGELOG.md").read_text()


def test_targets_are_listed_and_quick_runs_tests_of_every_folder():
    """Of each folder of tests but those that hold nothing but long ones."""
    helped = re.findall(r"^(\w+):.* ## ", MAKEFILE, re.MULTILINE)
    assert helped == ["demo", "test", "verify", "bench", "docs", "lint", "wheel", "clean"]
    contributing = (REPOSITORY / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `make (\w+)` \|", contributing, re.MULTILINE)) == sorted(helped)
    assert re.search(r"^\.PHONY: help (.+)$", MAKEFILE, re.MULTILINE)[1].split() == helped
    pages = "".join(path.read_text(encoding="utf-8") for path in (REPOSITORY / "docs").glob("*.md"))
    typed_so = re.findall(r"^make (\w+)", README, re.MULTILINE) + re.findall(r"`make (\w+)", contributing + pages)
    assert {*typed_so} <= {*helped}
    # as typed by hand: under `make test` the names of folders would be printed beside the command
    env = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    words = ["make", "--dry-run", "test", "QUICK=1"]
    made = subprocess.run(words, cwd=REPOSITORY, env=env, capture_output=True, text=True, check=True)
    quick = [Path(word) for word in made.stdout.splitlines()[-1].split() if word.startswith("tests/")]
    assert quick and all((REPOSITORY / path).is_file() for path in quick)
    folders = {path.parent.relative_to(REPOSITORY) for path in (REPOSITORY / "tests").rglob("test_*.py")}
    assert folders - {path.parent for path in quick} == {Path("tests/bad_input"), Path("tests/fuzz")}
