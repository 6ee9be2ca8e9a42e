"""Number of processes, start of MPI and PETSc, and messages where one of them is missing or does not fit."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from lacmesh.errors import RequestError
from lacsolver import validation
from lacsolver.case import read_case
from lacsolver.distributed import launch
from lacsolver.distributed.launch import Launch, absence, import_petsc, launched, petsc_folders
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.distributed.mpi import ROOT, environment, in_ranks

SRUN = {"SLURM_NTASKS": "8", "SLURM_STEP_NUM_TASKS": "4", "SLURM_PROCID": "3"}


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ({}, Launch(1, 0, "")),
        ({"OMPI_COMM_WORLD_SIZE": "4", "OMPI_COMM_WORLD_RANK": "2"}, Launch(4, 2, "OMPI_COMM_WORLD_SIZE")),
        ({"PMI_SIZE": "4", "PMI_RANK": "3"}, Launch(4, 3, "PMI_SIZE")),
        (SRUN, Launch(4, 3, "SLURM_STEP_NUM_TASKS")),
        ({"SLURM_NTASKS": "4", "SLURM_PROCID": "1"}, Launch(4, 1, "SLURM_NTASKS")),
        ({"SLURM_NTASKS": "4"}, Launch(1, 0, "")),
        ({"PMI_SIZE": "many"}, Launch(1, 0, "")),
    ],
)
def test_processes_are_counted_from_the_environment(told, expected):
    assert launched(told) == expected


def test_the_start_of_a_command_imports_neither_mpi_nor_numpy():
    code = (
        "import sys, lacsolver.cli.run, lacsolver.distributed.together\n"
        "sys.exit(any(name in sys.modules for name in ('mpi4py', 'petsc4py', 'numpy')))"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_petsc_is_looked_for_below_petsc_dir_first(tmp_path):
    for folder in ("a/lib/python3/dist-packages", "b/arch/lib"):
        (tmp_path / folder / "petsc4py").mkdir(parents=True)
    assert petsc_folders({"PETSC_DIR": str(tmp_path / "a")})[0] == tmp_path / "a/lib/python3/dist-packages"
    assert petsc_folders({"PETSC_DIR": str(tmp_path / "b"), "PETSC_ARCH": "arch"})[0] == tmp_path / "b/arch/lib"


def test_what_is_missing_is_said_with_the_line_to_type(monkeypatch):
    monkeypatch.setattr(launch, "find_spec", lambda name: None)
    assert absence({}).startswith("MPI for Python (mpi4py) is not installed; ")
    assert absence({}).endswith("pip install 'lacmesh[petsc]' installs it (docs/install_petsc.md)")
    monkeypatch.setattr(launch, "find_spec", lambda name: name == "mpi4py" or None)
    monkeypatch.setattr(launch, "petsc_folders", lambda environment: [])
    assert absence({}).startswith("PETSc for Python (petsc4py) is not installed; ")


def test_validate_tells_that_the_engine_is_missing(tmp_path, monkeypatch):
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD + '[solver]\nengine = "petsc"\n')
    monkeypatch.setattr(validation, "absence", lambda: "PETSc is not installed; type this")
    case = read_case(tmp_path / "case.toml")
    assert [issue.message for issue in validation.validate(case).problems] == ["PETSc is not installed; type this"]
    monkeypatch.setattr(validation, "absence", lambda: "")
    assert validation.validate(case).problems == []


def refused(folder, monkeypatch, files):
    """The message about a petsc4py made of some files, which is the first that Python finds."""
    (folder / "petsc4py" / "lib").mkdir(parents=True)
    (folder / "petsc4py" / "lib" / "PETSc.cpython-38.pyc").touch()  # compiled Python, as caches have: of no matter
    for name, text in files.items():
        (folder / "petsc4py" / name).write_text(text)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(launch, "import_mpi", lambda environment: None)
    with pytest.raises(RequestError) as caught:
        import_petsc()
    for name in [name for name in sys.modules if name.split(".")[0] == "petsc4py"]:
        del sys.modules[name]
    assert caught.value.status == 2
    return str(caught.value)


def test_an_old_petsc_beside_numpy_2_is_refused_before_it_crashes(tmp_path, monkeypatch):
    monkeypatch.setattr(np, "__version__", "2.4.6")
    files = {"__init__.py": "__version__ = '3.18.5'\n", "PETSc.py": "raise SystemExit\n"}
    said = refused(tmp_path, monkeypatch, files)
    assert said.startswith(f"petsc4py 3.18.5 ({tmp_path / 'petsc4py'}) needs numpy 1, and numpy 2.4.6 is installed; ")


def test_a_petsc_of_another_python_is_refused(tmp_path, monkeypatch):
    files = {"__init__.py": "__version__ = '3.22.0'\n", "PETSc.py": "import imp_which_is_gone\n"}
    said = refused(tmp_path, monkeypatch, {**files, "lib/PETSc.cpython-39-x86_64-linux-gnu.so": ""})
    mine = f"this is Python {sys.version_info.major}.{sys.version_info.minor}"
    assert f"petsc4py in {tmp_path / 'petsc4py'} is of Python 3.9, and {mine}; take that Python, or else " in said


def test_a_petsc_that_cannot_be_imported_is_refused_with_the_reason(tmp_path, monkeypatch):
    text = "raise ImportError('libpetsc.so: cannot open shared object file')\n"
    said = refused(tmp_path, monkeypatch, {"__init__.py": "__version__ = '3.22.0'\n", "PETSc.py": text})
    assert "(libpetsc.so: cannot open shared object file)" in said


def test_a_petsc_of_complex_numbers_is_refused(tmp_path, monkeypatch):
    text = "class ScalarType: pass\nScalarType.__name__ = 'complex128'\n"
    said = refused(tmp_path, monkeypatch, {"__init__.py": "__version__ = '3.22.0'\n", "PETSc.py": text})
    assert said.startswith("PETSc computes with complex128, and float64 is needed; ")


# ---- with PETSc

#: starts PETSc, and prints what it is asked to
STARTED = """
import signal, sys, time, os
def stop(*_): raise KeyboardInterrupt
signal.signal(signal.SIGTERM, stop)
from lacmesh.errors import RequestError
from lacsolver.distributed.launch import import_petsc
try:
    PETSc = import_petsc()
except RequestError as error:
    sys.exit(f"refused: {error}")
comm = PETSc.COMM_WORLD.tompi4py()
"""


@pytest.mark.petsc
def test_petsc_starts_on_all_ranks_with_the_options_of_the_user():
    code = STARTED + "told = comm.gather(PETSc.Options().getString('ksp_type'))\nprint(told) if told else None"
    done = in_ranks(2, code, PETSC_OPTIONS="-ksp_type cg -options_left 0")
    assert done.returncode == 0 and done.stdout.strip() == "['cg', 'cg']", done.stderr


@pytest.mark.petsc
def test_a_signal_is_still_pythons_and_an_error_of_petsc_is_one_of_the_linear_system():
    code = STARTED + (
        "from lacsolver.linear.petsc import petsc_errors\n"
        "from lacsolver.linear import LinearError\n"
        "try:\n    with petsc_errors(): PETSc.KSP().create().setType('nonsense')\n"
        "except LinearError as error: print(error)\n"
        "try:\n    os.kill(os.getpid(), signal.SIGTERM); time.sleep(20)\n"
        "except KeyboardInterrupt: print('stopped')\n"
    )
    done = in_ranks(1, code)
    assert done.returncode == 0, done.stderr
    said, stopped = done.stdout.splitlines()
    assert said.startswith("PETSc stopped with its error 86 (") and "nonsense" in said and stopped == "stopped"


@pytest.mark.petsc
def test_processes_that_another_mpi_started_are_refused():
    """Each would take itself for the only one: here one process, whose environment tells of four."""
    told = {"PMI_SIZE": "4", "PMI_RANK": "0", "OMPI_COMM_WORLD_SIZE": ""}
    command = [sys.executable, "-c", STARTED]
    done = subprocess.run(command, env=environment(**told), capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr.startswith("refused: 4 processes were started (PMI_SIZE), but not by the mpiexec of "), (
        done.stderr
    )
