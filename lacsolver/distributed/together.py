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
#: the patience of a rank without lines of its own is longer by this factor
_LONGER = 1.3
#: seconds for which a rank that is about to end the run listens for lower ranks that are, too
_LISTENS = 1.0
#: tag of the messages by which a rank says that it is about to end the run
_ENDING = 1
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

    A signal may arrive meanwhile, and is then what this rank reports. A rank without lines of its own waits longest.
    """
    request, begun = comm.Ibarrier(), time.monotonic()
    while True:
        try:
            if request.Test():
                return report
            time.sleep(_PAUSE)  # and leave the processor to other ranks
        except BaseException as error:
            if not report.status:
                report, begun = _report(error, terminal), time.monotonic()
        if report.status and time.monotonic() - begun > (patience if report.lines else _LONGER * patience):
            _end(comm, report, terminal)


def _end(comm: Any, report: Report, terminal: Terminal) -> None:
    """End all processes by MPI's Abort, and print the error of this rank unless a lower one is about to do so.

    A signal that arrives meanwhile is that of mpiexec, since another rank has ended the run.
    """
    sent = [comm.isend(None, rank, _ENDING) for rank in range(comm.rank + 1, comm.size)]  # kept until they arrive
    try:
        until = time.monotonic() + _LISTENS
        while time.monotonic() < until:
            if comm.iprobe(tag=_ENDING):
                time.sleep(10 * _LISTENS)  # of which it needs the first
            time.sleep(_PAUSE)
        terminal.say(_of_rank(comm.rank, report.lines or ("another rank failed, and does not come to an end",)))
    finally:
        comm.Abort(report.status)
        del sent


def _print(reports: Sequence[Report], terminal: Terminal) -> None:
    """Print the warnings that only other ranks had, and the error of the lowest rank that has one."""
    known = set(reports[0].heard)
    for rank, report in enumerate(reports):
        for message in [message for message in report.heard if message not in known]:
            terminal.warn(f"rank {rank}: {message}")
            known.add(message)
    for rank, report in enumerate(reports):
        if report.lines:
            terminal.say(_of_rank(rank, report.lines))
            return


def _of_rank(rank: int, lines: Sequence[str]) -> Sequence[str]:
    """Return lines with their rank in front, unless it is rank 0."""
    return [f"rank {rank}: {line}" for line in lines] if rank else lines


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
