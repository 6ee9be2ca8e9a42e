"""Programs in several processes of `mpiexec`, on as many cores as there are: environment, and a Python with PETSc."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: more processes than cores, which leave the cores to each other while they wait, with a thread each; root may run them
FREE = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
}
_TRY = "from lacsolver.distributed.launch import import_petsc; import_petsc()"


def environment(**more: str) -> dict[str, str]:
    """The environment of this process, for programs in several processes."""
    return {**os.environ, **FREE, "PYTHONPATH": str(ROOT), **more}


def mpiexec(python: str = sys.executable) -> str:
    """The program that starts processes: that beside a Python, or else that of the system; '' if there is none."""
    beside = Path(python).with_name("mpiexec")
    return str(beside) if beside.exists() else shutil.which("mpiexec") or ""


def words(n: int, *arguments: object, python: str = sys.executable) -> list[str]:
    """The words of a command that starts n processes of a Python with some arguments."""
    return [mpiexec(python), "-n", str(n), python, *map(str, arguments)]


@cache
def python_with_petsc() -> str:
    """The Python that has PETSc: the one that runs, or that of `make .venv-petsc`; '' if neither has it."""
    beside = ROOT / ".venv-petsc" / "bin" / "python"
    candidates = [sys.executable, *([str(beside)] if beside.exists() else [])]
    return next((python for python in candidates if not _complaint(python)), "")


def missing() -> str:
    """A sentence about what programs in several processes lack here, and how to get it; '' if they lack nothing."""
    if python_with_petsc():
        return ""
    return f"{_complaint(sys.executable)}; in a checkout, make .venv-petsc installs all of it"


@cache
def _complaint(python: str) -> str:
    """The reason why a Python cannot start PETSc, '' if it can."""
    if not mpiexec(python):
        return "the program mpiexec is not installed (Debian: openmpi-bin)"
    process = _finished([python, "-c", _TRY])
    return "" if not process.returncode else process.stderr.strip().splitlines()[-1].partition(": ")[2]


def run(n: int, arguments: Sequence[object], timeout: float) -> subprocess.CompletedProcess[str]:
    """Run n processes of the Python that has PETSc to their end. Raises subprocess.TimeoutExpired."""
    return _finished(words(n, *arguments, python=python_with_petsc()), timeout)


def _finished(command: Sequence[str], timeout: float | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=ROOT, env=environment(), capture_output=True, text=True, timeout=timeout, check=False
    )
