"""Requirements of tests that a machine may lack, and the count of the tests that are skipped for them.

A test says what it needs by a mark (those of `NEEDS`) or by the fixture `shared`. What is absent skips it, visibly.
With LACMESH_ALL=1 (`make test`) a package that is absent fails its tests instead, and a session whose skipped tests are
not those expected fails. Works alone and under pytest-xdist, whose workers collect and whose
controller counts.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[1]
#: a picture of a triangle
DRAW = """
import sys
from lacmesh import Mesh
from lacmesh.view import picture
picture(Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]])]), sys.argv[1])
"""


def all_needed():
    """True if every package must be installed, as `make test` demands."""
    return os.environ.get("LACMESH_ALL") == "1"


#: need -> why what it asks for is absent, or None, as far as it is known
_known = {}


def absence(need):
    """Reason why `need` is not available on this machine, or None."""
    if need not in _known:
        _known[need] = NEEDS[need]()
    return _known[need]


def shared_folder():
    """The folder whose `reference` holds meshes and cuts of others: beside the checkout, or $LACMESH_SHARED."""
    return Path(os.environ.get("LACMESH_SHARED") or REPOSITORY.parent / "shared")


def _no_shared():
    folder = shared_folder() / "reference"
    return None if folder.is_dir() else f"{folder} is absent (LACMESH_SHARED may name another shared folder)"


def _no_gmsh():
    if find_spec("gmsh") is None:
        return "gmsh is not installed"
    return _complaint("import gmsh")  # it may be installed and lack a library of the system


def _no_package(name):
    return f"{name} is not installed" if find_spec(name) is None else None


def _no_program(name, package):
    return f"the program {name} is not installed (Debian: {package})" if shutil.which(name) is None else None


def _no_petsc():
    if shutil.which("mpiexec") is None and not Path(sys.executable).with_name("mpiexec").exists():
        return "the program mpiexec is not installed (Debian: openmpi-bin; make petsc)"
    return _complaint("from lacsolver.distributed.launch import import_petsc; import_petsc()")


def _no_index():
    with tempfile.TemporaryDirectory() as folder:
        code = "import sys; from pip._internal.cli.main import main; sys.exit(main(sys.argv[1:]))"
        command = ["-q", "download", "--no-deps", "--no-cache-dir", "--retries", "0", "--dest", folder, "iniconfig"]
        return "no package index is reached by pip" if _complaint(code, *command) else None


def _no_vtk():
    if find_spec("pyvista") is None:
        return "pyvista is not installed"
    with tempfile.TemporaryDirectory() as folder:
        return _complaint(DRAW, str(Path(folder) / "triangle.png"))


def _complaint(code, *arguments):
    """The last words of a child process that runs some code, or None where it goes well."""
    command = [sys.executable, "-c", code, *arguments]
    child = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    if child.returncode == 0:
        return None
    return (child.stderr.strip().splitlines() or [f"a child process died ({child.returncode})"])[-1]


#: names of the doctests that need pyvista
DRAWN_EXAMPLES = {"lacsolver.pictures.drawing.plot", "lacsolver.pictures.filming.film"}
#: mark -> why what it asks for is absent, or None
NEEDS = {
    "shared": _no_shared,
    "gmsh": _no_gmsh,
    "vtk": _no_vtk,
    "medcoupling": lambda: _no_package("medcoupling"),
    "meshio": lambda: _no_package("meshio") or _no_package("netCDF4"),
    "trimesh": lambda: _no_package("trimesh"),
    "browser": lambda: _no_program("chromium", "chromium"),
    "petsc": _no_petsc,
    "calculix": lambda: _no_program("ccx", "calculix-ccx"),
    "index": _no_index,
    "zsh": lambda: _no_program("zsh", "zsh"),
    "fish": lambda: _no_program("fish", "fish"),
    "paraview": lambda: _no_program("pvbatch", "paraview python3-paraview") or _no_program("Xvfb", "xvfb"),
    "window": lambda: _no_program("Xvfb", "xvfb") or _no_program("xdotool", "xdotool") or _no_package("PIL"),
    "felupe": lambda: _no_package("felupe"),
    "ngsolve": lambda: _no_package("ngsolve"),
    "mfem": lambda: _no_package("mfem"),
    "sfepy": lambda: _no_package("sfepy"),
    "dolfinx": lambda: _no_package("dolfinx"),
    "compiler": lambda: _no_program("g++", "g++"),
    "docs": lambda: _no_package("sphinx") or _no_package("myst_parser") or _no_package("furo"),
}


#: what a test may lack even under `make test`
FORGIVEN = (
    "shared",
    "index",
    "paraview",
    "window",
    "zsh",
    "fish",
    "docs",
    "felupe",
    "ngsolve",
    "mfem",
    "sfepy",
    "dolfinx",
    "compiler",
)


def missing(item):
    """List the requirements of a test that this machine lacks: (need, why) pairs."""
    words = {marker.name for marker in item.iter_markers()} | ({"shared"} & {*getattr(item, "fixturenames", ())})
    return [(need, absence(need)) for need in NEEDS if need in words and absence(need)]


def forgiven(need):
    """True if a test may be skipped for want of `need`."""
    return need in FORGIVEN or not all_needed()


class Tally:
    """A pytest plugin that counts skipped tests, and those that were to be expected."""

    def __init__(self, config):
        self.config = config
        _known.update(getattr(config, "workerinput", {}).get("absence", {}))
        self.skipped = self.expected = self.files = 0

    @property
    def worker(self):
        """Dictionary in which a worker of pytest-xdist leaves data for its controller; None in other processes."""
        return getattr(self.config, "workeroutput", None)

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node):
        """Tell the workers of `make test` what is absent, lest each draws a picture to know it."""
        node.workerinput["absence"] = {need: absence(need) for need in NEEDS} if all_needed() else {}

    def pytest_itemcollected(self, item):
        """Mark the examples that draw: they stand in docstrings, where no mark can be set."""
        if item.name in DRAWN_EXAMPLES:
            item.add_marker("vtk")

    def pytest_runtest_setup(self, item):
        """Skip a test that lacks something, or fail it if nothing may be lacking."""
        lacks = missing(item)
        refused = [f"{need}: {why}" for need, why in lacks if not forgiven(need)]
        if refused:
            pytest.fail(f"LACMESH_ALL=1 asks for every package; {'; '.join(refused)}", pytrace=False)
        if lacks:
            pytest.skip("; ".join(why for _, why in lacks))

    def pytest_collection_finish(self, session):
        """Count what is to be skipped, once deselected tests are gone."""
        if not self.config.option.collectonly:
            self.expected = sum(
                all(forgiven(need) for need, _ in lacks) for item in session.items if (lacks := missing(item))
            )

    def pytest_collectreport(self, report):
        """Count files skipped whole: none is expected."""
        self.files += report.skipped

    def pytest_runtest_logreport(self, report):
        """Count a skipped test."""
        self.skipped += report.skipped and not hasattr(report, "wasxfail")

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node):
        """Take over a worker's counts: each collects every test."""
        counts = getattr(node, "workeroutput", {})
        self.expected = max(self.expected, counts.get("expected", 0))
        self.files = max(self.files, counts.get("files", 0))

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session):
        """Leave the counts to the controller, or fail where they differ."""
        if self.worker is not None:
            self.worker.update(expected=self.expected, files=self.files)
        elif all_needed() and self.skipped + self.files != self.expected and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter):
        """The counts, in a line."""
        count = self.skipped + self.files
        bad = all_needed() and count != self.expected
        terminalreporter.write_line(f"skipped: {count}, expected: {self.expected}", red=bad, bold=bad)
