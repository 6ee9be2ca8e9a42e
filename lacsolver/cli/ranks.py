"""The processes (ranks) of `mpiexec` or `srun` that run a command: refused, or made to act as one."""

from __future__ import annotations

import os
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from lacmesh.cli.program import EXPECTED, Run
from lacmesh.errors import LacmeshWarning, RequestError
from lacsolver.distributed.launch import Launch, absence, import_mpi, launched, one_thread_each
from lacsolver.distributed.together import StoppedError, on_first, together

T = TypeVar("T")
#: seconds for which other ranks leave it to rank 0 to report what is missing: Open MPI then ends them
_PAUSE = 2.0


def check_alone(environment: Mapping[str, str] = os.environ) -> None:
    """Raise RequestError if this process is one of several: each would do the whole and write the same files."""
    n, _, name = launched(environment)
    if n > 1:
        raise RequestError(
            f"{n} processes were started ({name}), and each would solve the whole and write the same files; "
            "start one, whose cores are [solver] threads; for one with a case of its own, unset that variable"
        )


@dataclass(frozen=True)
class Ranks:
    """The processes that run a command: their number, the rank of this one, and MPI's communicator if several do."""

    n: int = 1
    rank: int = 0
    comm: Any = None

    def on_first(self, function: Callable[[], T]) -> T:
        """Call a function on rank 0 alone, and return its result on all ranks."""
        return function() if self.comm is None else on_first(self.comm, function)


@contextmanager
def all_ranks(run: Run) -> Iterator[Ranks]:
    """Run a command in all processes of `mpiexec` as one: rank 0 alone prints, and an error of any rank stops all.

    Raises RequestError if there are several and MPI or PETSc is missing, StoppedError after an error was printed.
    """
    launch = launched()
    if launch.n == 1:
        yield Ranks()
        return
    comm = _world(launch)
    os.environ["TERM"] = "dumb"  # Open MPI gives each process a terminal, even where its output goes to a file
    run.quiet |= comm.rank > 0
    with together(comm, _Terminal(run, comm.rank)):
        yield Ranks(launch.n, comm.rank, comm)


def _world(launch: Launch) -> Any:
    """Return MPI's communicator of all processes. Raises RequestError if MPI or PETSc is missing, or is another one."""
    one_thread_each()
    try:
        if missing := absence():
            started = f"{launch.n} processes were started ({launch.variable})"
            raise RequestError(f"{started}, and {missing}; else start one process, whose cores are [solver] threads")
        return import_mpi().COMM_WORLD
    except RequestError as error:
        try:
            time.sleep(_PAUSE if launch.rank else 0)
        except BaseException:  # a signal of mpiexec, since rank 0 has ended
            raise StoppedError(error.status) from None
        raise


class _Terminal:
    """The messages of a command that runs in several processes (`lacsolver.distributed.together.Terminal`)."""

    def __init__(self, run: Run, rank: int) -> None:
        self.run, self.rank = run, rank
        self.heard: list[str] = []
        self._show = warnings.showwarning
        warnings.showwarning = self._hear  # type: ignore[assignment]  # until the command ends, which restores it

    def describe(self, error: BaseException) -> tuple[Sequence[str], int]:
        """Return the lines of the message about an error of this rank, and the exit status."""
        if self.run.verbose and isinstance(error, Exception) and not isinstance(error, EXPECTED):
            traceback.print_exception(error)
        return self.run.program.message(error)

    def say(self, lines: Sequence[str]) -> None:
        """Print the message about the error that ends the run."""
        self.run.program.fail(lines, 0)

    def warn(self, message: str) -> None:
        """Print a warning."""
        self._show(LacmeshWarning(message), LacmeshWarning, "", 0)

    def _hear(self, message: Warning | str, category: type[Warning], *place: Any) -> None:
        """Keep a warning, and print that of rank 0."""
        if issubclass(category, LacmeshWarning):
            self.heard.append(str(message))
        if self.rank == 0:
            self._show(message, category, *place)
