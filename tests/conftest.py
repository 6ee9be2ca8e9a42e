"""What a machine may lack skips its tests. With LACMESH_ALL=1 (`make test`) that is an error, as any other skip."""

import gc
import os
import shutil
import signal
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest
from _pytest.doctest import DoctestModule
from hypothesis import settings

from lacmesh.cli import main
from tests import REPOSITORY
from tests.samples import FUZZ

# no test is there after a failure of the machine, and to wait until files are on the disk takes a twentieth of the time
os.fsync = lambda _: None
# no example is too slow by the clock; but for `make verify FUZZ=1`, the same examples in every run
settings.register_profile("any machine", deadline=None, derandomize=not FUZZ)
settings.load_profile("any machine")

#: the folder whose `reference` holds meshes and cuts of others: beside the checkout, or $LACMESH_SHARED
SHARED = Path(os.environ.get("LACMESH_SHARED") or REPOSITORY.parent / "shared")
#: mark -> packages that its tests import, and programs ($) that they run
NEEDS = {
    "gmsh": "gmsh", "vtk": "pyvista", "medcoupling": "medcoupling", "meshio": "meshio netCDF4", "trimesh": "trimesh",
    "felupe": "felupe", "ngsolve": "ngsolve", "mfem": "mfem", "sfepy": "sfepy", "dolfinx": "dolfinx",
    "browser": "$chromium", "calculix": "$ccx", "compiler": "$g++", "petsc": "$mpiexec",
}  # fmt: skip
#: marks that a machine may lack even under `make test`
FORGIVEN = {"shared", "compiler", "felupe", "ngsolve", "mfem", "sfepy", "dolfinx"}
#: doctests that need pyvista: no mark can be set in a docstring
DRAWN_EXAMPLES = {"lacsolver.pictures.drawing.plot", "lacsolver.pictures.filming.film"}
EVERYTHING = os.environ.get("LACMESH_ALL") == "1"
SKIPPED_FOR = pytest.StashKey[bool]()


@cache
def absence(need):
    """Reason why tests with a mark cannot run on this machine, or an empty string."""
    found = {word: which(word[1:]) if word[0] == "$" else find_spec(word) for word in NEEDS.get(need, "").split()}
    missing = [f"{word.strip('$')} is not installed" for word, place in found.items() if place is None]
    if need == "shared" and not (SHARED / "reference").is_dir():
        missing += [f"{SHARED / 'reference'} is absent (LACMESH_SHARED may name another shared folder)"]
    if need == "petsc" and not missing:
        code = "from lacsolver.distributed.launch import import_petsc; import_petsc()"
        child = subprocess.run([sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True)
        missing += [(child.stderr.strip() or "a child process died").splitlines()[-1]] if child.returncode else []
    return "; ".join(missing)


def which(name):
    """The path of a program, also of one beside Python."""
    return shutil.which(name) or shutil.which(name, path=Path(sys.executable).parent)


def pytest_itemcollected(item):
    if item.name in DRAWN_EXAMPLES:
        item.add_marker("vtk")


@pytest.hookimpl(wrapper=True)
def pytest_pycollect_makeitem(collector, obj):
    """Mark the rows of a test slow that its mark `rows` does not name, in one text or several."""
    found = yield
    marks = getattr(obj, "pytestmark", ()) if found else ()
    for mark in (mark for mark in marks if mark.name == "rows"):
        named = {row for text in mark.args for row in text.split("; ")}
        others = [item for item in found if item.callspec.id not in named]
        if len(found) != len(others) + len(named):
            raise collector.CollectError(f"{obj.__name__} has no rows {named - {item.callspec.id for item in found}}")
        for item in others:
            item.add_marker("slow")
    return found


def pytest_runtest_setup(item):
    """Skip a test that lacks something, or fail it if nothing may be lacking."""
    needs = {mark.name for mark in item.iter_markers()} | ({"shared"} & {*getattr(item, "fixturenames", ())})
    lacking = {need: why for need in sorted(needs) if (why := absence(need))}
    if EVERYTHING and not FORGIVEN.issuperset(lacking):
        pytest.fail(f"LACMESH_ALL=1 asks for every package; {'; '.join(lacking.values())}", pytrace=False)
    if lacking:
        item.stash[SKIPPED_FOR] = True
        pytest.skip("; ".join(lacking.values()))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    report = yield
    return report if item.stash.get(SKIPPED_FOR, False) or hasattr(report, "wasxfail") else refused(report)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report():
    return refused((yield))


def refused(report):
    """A report in which a skip is a failure where nothing may be lacking."""
    if EVERYTHING and report.skipped:
        report.outcome, report.longrepr = "failed", f"LACMESH_ALL=1 allows no skip: {report.longrepr}"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path):
    """Seek no examples in the tests themselves, which have none: it takes a second for every hundred files."""
    found = yield
    return [one for one in found if not (isinstance(one, DoctestModule) and "tests" in file_path.parts)]


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection(session):
    """Collect the tests without Python's search for garbage, which is also spared what they are made of: they stay."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_configure():
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # `nohup make test &`: commands that tests start, and
        signal.signal(signal.SIGINT, signal.default_int_handler)  # interrupt, would inherit that they do not listen


@pytest.fixture(scope="session")
def shared():
    """The folder `../shared`, or $LACMESH_SHARED: `shared / "reference"` is there."""
    return SHARED


@pytest.fixture
def every_thread(monkeypatch):
    """Take as many threads as are asked for, however few rows or cells there are."""
    monkeypatch.setattr("lacmesh.threads._WORTH", 1)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Runs a command of lacmesh in a folder of its own, which must end in a status: what it prints, errors last."""
    monkeypatch.chdir(tmp_path)

    def ran(words, status=0):
        capsys.readouterr()
        found = main(words.split() if isinstance(words, str) else list(map(str, words)))
        said = "".join(capsys.readouterr())
        assert found == status, said
        return said

    return ran


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """A folder with `data/`, as a user's checkout has it."""
    shutil.copytree(REPOSITORY / "data", tmp_path / "data", ignore=shutil.ignore_patterns("*.lac.*"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def gmsh():
    """Yield gmsh without a model, with the options that it starts with."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    yield gmsh
    gmsh.finalize()
