"""Programs in several processes of `mpiexec`, on as many cores as there are."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
#: more processes than cores, which leave the cores to each other while they wait; root may run them
FREE = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}


def environment(**more):
    """The environment of this process, for programs in several processes."""
    return {**os.environ, **FREE, "PYTHONPATH": str(ROOT), **more}


def mpiexec():
    """The program that starts processes: that of this environment, or else that of the system."""
    beside = Path(sys.executable).with_name("mpiexec")
    return str(beside) if beside.exists() else shutil.which("mpiexec")


def words(n, code, *arguments):
    """The words of a command that runs some code in n processes."""
    return [mpiexec(), "-n", str(n), sys.executable, "-c", code, *map(str, arguments)]


def in_ranks(n, code, *arguments, timeout=60, **more):
    """Run some code in n processes, to their end; a hang is an error."""
    return subprocess.run(
        words(n, code, *arguments),
        env=environment(**more),
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def own_lines(text):
    """Lines of lacsolver in a text to which mpiexec adds its own."""
    return [line for line in text.splitlines() if line.startswith("lacsolver: ")]
