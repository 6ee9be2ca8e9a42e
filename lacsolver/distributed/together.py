"""End of a run on all its processes (ranks) at once: an error on one of them stops all, and is reported once.

Ranks meet at the end of a context, where a rank that fails waits for the others. If all come, rank 0 reports the error
of the lowest rank that has one. If some do not come, because they wait for the failed rank inside PETSc or MPI, the
failed rank reports its error itself and ends all processes by MPI's Abort. What collects data of all ranks while it
handles an error should be done by all of them; what rank 0 alone writes then must not take longer than `PATIENCE`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol, TypeVar

from lacmesh.errors import LacmeshError

#: seconds for which a failed rank waits for the others, one of which may still be writing files
PATIENCE = 30.0
#: the patience of the highest rank is longer by this part, so that of several failed ranks the lowest ends the run
_STAGGER = 0.3
#: seconds between two looks at the other ranks
_PAUSE = 0.02

T = TypeVar("T")


class StoppedError(LacmeshError):
    """A run on several processes was stopped by an error that has been reported already; `status` is that error's."""

    def __init__(self, status: int) -> None:
        super().__init__(f"stopped with status {status}, as reported")
        self.status = status


class Terminal(Protocol):
    """Interface of what prints the messages of a run. `heard`: the warnings of this rank."""

    heard: list[str]

    def describe(self, error: BaseException) -> tuple[Sequence[str], int]:
        """Return the lines of the message about an error of this rank, and the exit status."""

    def say(self, lines: Sequence[str]) -> None:
        """Print the message about the error that ends the run."""

    def warn(self, message: str) -> None:
        """Print a warning."""


class Report(NamedTuple):
    """The end of the run on one rank: lines about its error, exit status (0: no error), and warnings."""

    lines: tuple[str, ...]
    status: int
    heard: tuple[str, ...] = ()


@contextmanager
def together(comm: Any, terminal: Terminal, patience: float = PATIENCE) -> Iterator[None]:
    """Run a block on all ranks of an MPI communicator, and leave it on all of them in the same way.

    Rank 0 prints the error, and the warnings of other ranks that it did not have itself. Raises StoppedError on every
    rank if any rank raised anything.
    """
    own = comm.Dup()  # what the block sends cannot be mistaken for what is sent here
    report = Report((), 0)
    try:
        yield
    except BaseException as error:
        report = _report(error, terminal)
    report = _meet(own, report, terminal, patience)
    reports = own.allgather(report._replace(heard=tuple(terminal.heard)))
    if own.rank == 0:
        _print(reports, terminal)
    own.Barrier()  # if a rank ended before rank 0 has printed, mpiexec would end rank 0
    own.Free()
    if failed := [one.status for one in reports if one.lines]:
        raise StoppedError(failed[0])


def _report(error: BaseException, terminal: Terminal) -> Report:
    """Return the report of an error; for StoppedError one without lines, since another rank has them."""
    if isinstance(error, StoppedError):
        return Report((), error.status)
    lines, status = terminal.describe(error)
    return Report(tuple(lines), status)


def _meet(comm: Any, report: Report, terminal: Terminal, patience: float) -> Report:
    """Return the report of this rank once all ranks are here; end the run if this one failed and others do not come.

    A signal may arrive meanwhile, and is then what this rank reports.
    """
    request, begun = comm.Ibarrier(), time.monotonic()
    limit = patience * (1 + _STAGGER * comm.rank / comm.size)
    while True:
        try:
            while not request.Test():
                time.sleep(_PAUSE)  # and leave the processor to other ranks
                if report.status and time.monotonic() - begun > limit:
                    terminal.say(report.lines)
                    comm.Abort(report.status)
            return report
        except BaseException as error:
            report, begun = report if report.status else _report(error, terminal), time.monotonic()


def _print(reports: Sequence[Report], terminal: Terminal) -> None:
    """Print the warnings that only other ranks had, and the error of the lowest rank that has one."""
    known = set(reports[0].heard)
    for rank, report in enumerate(reports):
        for message in report.heard:
            if message not in known:
                terminal.warn(f"rank {rank}: {message}")
                known.add(message)
    for rank, report in enumerate(reports):
        if report.lines:
            terminal.say([f"rank {rank}: {line}" for line in report.lines] if rank else report.lines)
            return


def on_first(comm: Any, function: Callable[[], T]) -> T:
    """Call a function on rank 0 alone, and return its result on all ranks, which must be picklable.

    An error is raised on rank 0, and StoppedError on the others.
    """
    if comm.rank == 0:
        try:
            answer = function()
        except BaseException:
            comm.bcast((False, None))
            raise
        comm.bcast((True, answer))
        return answer
    done, received = comm.bcast(None)
    if not done:
        raise StoppedError(1)
    result: T = received
    return result
