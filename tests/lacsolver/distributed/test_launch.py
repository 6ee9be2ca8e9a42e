"""Start and end of processes: how many there are, what is missing or does not fit, and one message where one fails."""

import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from textwrap import indent
from types import SimpleNamespace

import numpy as np
import pytest

from lacmesh.errors import RequestError
from lacsolver import validation
from lacsolver.case import read_case
from lacsolver.distributed import launch
from lacsolver.distributed.launch import Launch, absence, import_petsc, launched, petsc_folders
from lacsolver.distributed.together import Report, StoppedError, together
from tests.lacsolver.bad_cases import GOOD, blocks, put
from tests.lacsolver.distributed.mpi import ROOT, environment, in_ranks, own_lines, words

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
        "import sys, lacsolver.cli, lacsolver.distributed.together\n"
        "sys.exit(any(name in sys.modules for name in ('mpi4py', 'petsc4py', 'numpy')))"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_petsc_is_looked_for_below_petsc_dir_first(tmp_path):
    for folder in ("a/lib/python3/dist-packages", "b/arch/lib"):
        (tmp_path / folder / "petsc4py").mkdir(parents=True)
    assert petsc_folders({"PETSC_DIR": str(tmp_path / "a")})[0] == tmp_path / "a/lib/python3/dist-packages"
    assert petsc_folders({"PETSC_DIR": str(tmp_path / "b"), "PETSC_ARCH": "arch"})[0] == tmp_path / "b/arch/lib"


def test_an_engine_that_is_missing_is_named_with_the_line_to_type(tmp_path, monkeypatch):
    """By the command, and by `validate`."""
    monkeypatch.setattr(launch, "find_spec", lambda name: None)
    assert "mpi4py" in absence({}) and "pip install 'lacmesh[petsc]'" in absence({})
    monkeypatch.setattr(launch, "find_spec", lambda name: name == "mpi4py" or None)
    monkeypatch.setattr(launch, "petsc_folders", lambda environment: [])
    assert "petsc4py" in absence({})
    put(blocks(), tmp_path)
    (tmp_path / "case.toml").write_text(GOOD + '[solver]\nengine = "petsc"\n')
    case = read_case(tmp_path / "case.toml")
    for told in ("PETSc is not installed; type this", ""):
        monkeypatch.setattr(validation, "absence", lambda told=told: told)
        assert [issue.message for issue in validation.validate(case).problems] == [told] * bool(told)


@pytest.mark.parametrize(
    ("started", "size", "words"),
    [(4, 4, None), (4, 1, r"4 processes were started \(PMI_SIZE\), but not by"), (1, 4, "MPI has 4 processes")],
)
def test_mpi_has_as_many_processes_as_were_started(started, size, words, monkeypatch):
    """Otherwise each process would take itself for the only one, or write the files of all."""
    world = SimpleNamespace(size=size)
    MPI = SimpleNamespace(Get_library_version=lambda: "MPICH 4", Is_initialized=lambda: True, COMM_WORLD=world)
    monkeypatch.setattr(launch, "_loaded_mpi", lambda: MPI)
    with nullcontext() if words is None else pytest.raises(RequestError, match=words):
        assert launch.import_mpi({"PMI_SIZE": str(started)}) is MPI


#: a petsc4py that does not fit: its files, and words of the message about it
LIBRARY = "lib/PETSc.cpython-39-x86_64-linux-gnu.so"
UNFIT = {
    "old, beside numpy 2": ({"__init__.py": "__version__ = '3.18.5'\n", "PETSc.py": "raise SystemExit\n"}, "numpy 1"),
    "of another Python": (
        {"__init__.py": "__version__ = '3.22.0'\n", "PETSc.py": "import imp_which_is_gone\n", LIBRARY: ""},
        "is of Python 3.9",
    ),
    "without its library": (
        {"__init__.py": "__version__ = '3.22.0'\n", "PETSc.py": "raise ImportError('libpetsc.so: cannot open')\n"},
        r"\(libpetsc.so: cannot open\)",
    ),
    "of complex numbers": (
        {
            "__init__.py": "__version__ = '3.22.0'\n",
            "PETSc.py": "class ScalarType: pass\nScalarType.__name__ = 'complex128'\n",
        },
        "float64 is needed",
    ),
}


@pytest.mark.parametrize("what", UNFIT)
def test_a_petsc_that_does_not_fit_is_refused(what, tmp_path, monkeypatch):
    """Before it crashes; compiled Python, as caches have it, is of no matter."""
    files, message = UNFIT[what]
    (tmp_path / "petsc4py" / "lib").mkdir(parents=True)
    (tmp_path / "petsc4py" / "lib" / "PETSc.cpython-38.pyc").touch()
    for name, text in files.items():
        (tmp_path / "petsc4py" / name).write_text(text)
    if "numpy" in what:
        monkeypatch.setattr(np, "__version__", "2.4.6")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(launch, "import_mpi", lambda environment: None)
    with pytest.raises(RequestError, match=message) as caught:
        import_petsc()
    for name in [name for name in sys.modules if name.split(".")[0] == "petsc4py"]:
        del sys.modules[name]
    assert caught.value.status == 2


@pytest.mark.parametrize("rank", [0, 1])
def test_the_first_process_alone_prints_what_any_process_reports(rank):
    """Warnings that it does not have itself, and the error, which ends all processes with one status."""
    other = Report(("pivot 7",), 4, ("flat cells",))
    world = SimpleNamespace(rank=rank, allgather=lambda own: [own, other], Barrier=list, Free=list)
    world.Dup, world.Ibarrier = lambda: world, lambda: SimpleNamespace(Test=lambda: True)
    said = []
    terminal = SimpleNamespace(heard=[], say=said.extend, warn=said.append)
    with pytest.raises(StoppedError) as caught, together(world, terminal):
        pass
    assert caught.value.status == 4 and said == ["rank 1: flat cells", "rank 1: pivot 7"] * (rank == 0)


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
told = comm.gather(PETSc.Options().getString('ksp_type'))
print(told) if told else None
from lacsolver.linear.petsc import petsc_errors
from lacsolver.linear import LinearError
try:
    with petsc_errors(): PETSc.KSP().create().setType('nonsense')
except LinearError as error: print(error) if comm.rank == 0 else None
try:
    os.kill(os.getpid(), signal.SIGTERM); time.sleep(20)
except KeyboardInterrupt: print('stopped') if comm.rank == 0 else None
"""


@pytest.mark.petsc
def test_petsc_starts_with_the_options_of_the_user_and_leaves_signals_and_errors_to_python():
    done = in_ranks(2, STARTED, PETSC_OPTIONS="-ksp_type cg -options_left 0")
    assert done.returncode == 0, done.stderr
    options, error, stopped = done.stdout.splitlines()
    assert options == "['cg', 'cg']" and stopped == "stopped"
    assert "its error 86 (" in error and "nonsense" in error


@pytest.mark.petsc
def test_processes_that_another_mpi_started_are_refused():
    """Each would take itself for the only one: here one process, whose environment tells of four."""
    told = {"PMI_SIZE": "4", "PMI_RANK": "0", "OMPI_COMM_WORLD_SIZE": ""}
    command = [sys.executable, "-c", STARTED]
    done = subprocess.run(command, env=environment(**told), capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and "4 processes were started (PMI_SIZE)" in done.stderr


# ---- processes that end together

#: a program whose ranks run BODY together; an error is printed as the command does, its status ends the program
PROGRAM = """
import os, signal, sys, time
from lacsolver.distributed.launch import import_mpi
from lacsolver.distributed.together import StoppedError, on_first, together
from lacmesh.errors import DataError
from lacsolver.linear import LinearError
MPI = import_mpi()
comm = MPI.COMM_WORLD
def stop(*_): raise KeyboardInterrupt
signal.signal(signal.SIGTERM, stop)
class Terminal:
    heard = []
    def describe(self, error): return [f"{type(error).__name__} {error}"], getattr(error, "status", 130)
    def say(self, lines): [print("lacsolver: error:", line, file=sys.stderr, flush=True) for line in lines]
    def warn(self, message): print("lacsolver: warning:", message, file=sys.stderr, flush=True)
terminal = Terminal()
try:
    with together(comm, terminal, patience=1.0):
BODY
except StoppedError as error:
    sys.exit(error.status)
"""
ON_FIRST = """\
assert on_first(comm, lambda: comm.rank + 7) == 7
def fail(): raise LinearError("full")
on_first(comm, fail)
comm.allreduce(1)"""
SIGNAL = """\
if comm.rank:
    comm.send(os.getpid(), 0)
else:
    waiting = comm.recv()
    time.sleep(0.5)
    os.kill(waiting, signal.SIGTERM)
    time.sleep(50)"""
#: number of processes, what they run, their status, the line they print; rank 0 may be in a reduction, as in PETSc,
#: that others never enter
TOGETHER = {
    "all end well; a warning that rank 0 has not is printed once": (
        3, 'print(comm.allreduce(1))\nterminal.heard += ["all have it"] + ["flat cells"] * (comm.rank > 0)',
        0, "warning: rank 1: flat cells",
    ),
    "one ends well long after the other": (
        2, 'terminal.heard += ["late"] * comm.rank\ntime.sleep(2.0 * comm.rank)', 0, "warning: rank 1: late",
    ),
    "an error of all": (2, 'raise LinearError("no solution")', 4, "error: LinearError no solution"),
    "an error of one": (
        2, 'if comm.rank: raise DataError("a bad cell")', 1, "error: rank 1: DataError a bad cell",
    ),
    "several fail, and others wait for them": (
        3, 'if comm.rank: raise LinearError(f"pivot {comm.rank}")\ncomm.allreduce(1)',
        4, "error: rank 1: LinearError pivot 1",
    ),
    "what rank 0 does alone is known to all": (2, ON_FIRST, 4, "error: LinearError full"),
    "a signal while others are waited for": (2, SIGNAL, 130, "error: rank 1: KeyboardInterrupt "),
}  # fmt: skip


def program(body):
    """The program with a block."""
    return PROGRAM.replace("BODY", indent(body, " " * 8))


@pytest.mark.petsc
@pytest.mark.parametrize("what", TOGETHER)
def test_processes_end_together_with_one_message(what):
    n, body, status, line = TOGETHER[what]
    begun = time.monotonic()
    done = in_ranks(n, program(body))
    assert (done.returncode, own_lines(done.stderr)) == (status, [f"lacsolver: {line}"])
    assert time.monotonic() - begun < 30


@pytest.mark.petsc
def test_a_killed_rank_ends_the_run():
    """The kernel kills a rank for want of memory, and mpiexec ends the others."""
    body = "if comm.rank:\n    print(os.getpid(), flush=True)\n    time.sleep(50)\ncomm.allreduce(1)"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words(2, program(body)), env=environment(), text=True, **pipes) as begun:
        os.kill(int(begun.stdout.readline()), signal.SIGKILL)
        begun.communicate(timeout=30)
    assert begun.returncode != 0
