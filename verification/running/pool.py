"""Processes side by side, one a case; one that fails, hangs or is killed is reported, and the others go on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from lacmesh.errors import WriteError
from lacmesh.formats.output import signals_wait
from verification.records import Outcome
from verification.running.folder import CaseResult, forget, read_case_result, sweep, write_case_result
from verification.running.plan import ROOT, Planned

#: starts a worker; the family, the case, how many levels and the folder follow
COMMAND = (sys.executable, "-m", "verification.running.worker")
#: seconds after which a case is given up
PATIENCE = 3600.0
#: seconds between two looks at the processes
_PAUSE = 0.05
#: what libraries read the number of threads from
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
#: glibc keeps what is freed for the next array, as it does for the commands (`lacmesh.cli.program`)
_MEMORY = {
    "MALLOC_MMAP_THRESHOLD_": str(1 << 30),
    "MALLOC_TRIM_THRESHOLD_": str((1 << 31) - 1),
    "MALLOC_TOP_PAD_": str(1 << 26),
}


@dataclass
class _Running:
    """A case that is being solved. `cores`: those it may use; `log`: where it writes what it says."""

    planned: Planned
    process: subprocess.Popen[bytes]
    began: float
    cores: frozenset[int]
    log: Path


def solve_all(planned: Sequence[Planned], folder: Path, jobs: int) -> Generator[CaseResult, None, None]:
    """Solve cases in so many processes at once, and yield each as it ends; those that measure time come last, alone.

    The longest are begun first. When the iterator is closed, or an exception passes, what still runs is killed, and
    leaves nothing. Raises WriteError where no process can be started.
    """
    together = sorted((p for p in planned if not p.case.exclusive), key=lambda p: -p.case.seconds)
    exclusive = [p for p in planned if p.case.exclusive]
    yield from _solve(together, folder, _parts(jobs))
    yield from _solve(exclusive, folder, _parts(1))


def _solve(waiting: list[Planned], folder: Path, free: list[frozenset[int]]) -> Generator[CaseResult, None, None]:
    running: list[_Running] = []
    try:
        while waiting or running:
            while waiting and free:
                with signals_wait():  # none may be started and not be known
                    running.append(_start(waiting.pop(0), folder, free.pop()))
            ended = [one for one in running if one.process.poll() is not None or _late(one)]
            for one in ended:
                done = _end(one, folder)
                running.remove(one)
                free.append(one.cores)
                yield done
            if not ended:
                time.sleep(_PAUSE)
    finally:
        for one in running:
            _kill(one.process)
            one.log.unlink(missing_ok=True)
        sweep(folder)


def _start(planned: Planned, folder: Path, cores: frozenset[int]) -> _Running:
    case = planned.case
    log = folder / "cases" / case.family / f"{case.name}.log"
    command = [*COMMAND, case.family, case.name, str(planned.levels), str(folder.resolve())]
    env = {**os.environ, **_MEMORY, **dict.fromkeys(_THREADS, str(len(cores) or 1))}
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        forget(folder, case.family, case.name)
        with log.open("wb") as output:
            process = subprocess.Popen(
                command,
                cwd=ROOT,
                env=env,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
    except OSError as error:
        raise WriteError(log, f"case {case.id} cannot be started ({error.strerror or error})") from error
    if cores and hasattr(os, "sched_setaffinity"):
        with suppress(OSError):  # it has ended already
            os.sched_setaffinity(process.pid, cores)
    return _Running(planned, process, time.monotonic(), cores, log)


def _parts(jobs: int) -> list[frozenset[int]]:
    """The cores that each of so many processes may use."""
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    return [frozenset(cores[k::jobs] or cores) for k in range(jobs)]


def _late(one: _Running) -> bool:
    return time.monotonic() - one.began > PATIENCE


def _end(one: _Running, folder: Path) -> CaseResult:
    """End a process and return the outcome that it wrote, or one that says why there is none."""
    case, seconds = one.planned.case, time.monotonic() - one.began
    status = one.process.poll()
    _kill(one.process)
    done = read_case_result(folder, case.family, case.name)
    if done is None:
        outcome = Outcome(failure=f"{_why(status)}; see {one.log.relative_to(folder)}")
        return write_case_result(case, one.planned.levels, seconds, 0, outcome, folder, one.planned.sources)
    if not done.failure:
        one.log.unlink(missing_ok=True)
    return done


def _why(status: int | None) -> str:
    """Reason why a process left no outcome. `status`: its exit status, None if it was still running."""
    if status is None:
        return f"not done in {PATIENCE:g} s"
    if status >= 0:
        return f"the process ended with status {status} and no results"
    memory = ", perhaps for want of memory" if -status == signal.SIGKILL else ""
    return f"killed by {_signal(-status)}{memory}"


def _signal(number: int) -> str:
    known = {int(one): one.name for one in signal.Signals}
    return known.get(number, f"signal {number}")


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a process and those that it started."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
