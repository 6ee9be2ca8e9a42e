"""Many spoilt files in worker processes, each with a limit of memory; what kills or stops a worker is a failure."""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path

from tests.bad_input.case import BYTES, SECONDS, WAITS, room
from tests.fuzz.trial import FAILED, READ, REFUSED, Outcome, tried


@dataclass
class Tally:
    """Tally of the files of a format: `failed` by number; `peak` in bytes; `slowest` in seconds."""

    format: str
    read: int = 0
    refused: int = 0
    failed: dict[int, str] = field(default_factory=dict)
    seconds: float = 0.0
    slowest: float = 0.0
    peak: int = 0

    def add(self, number: int, outcome: Outcome, seconds: float) -> None:
        """Count one file."""
        self.slowest = max(self.slowest, seconds)
        if outcome.what == READ:
            self.read += 1
        elif outcome.what == REFUSED:
            self.refused += 1
        else:
            self.failed[number] = outcome.text

    @staticmethod
    def head() -> str:
        """The first line of a table of tallies."""
        return f"{'format':16}{'read':>8}{'refused':>9}{'failed':>8}{'time s':>8}{'slowest s':>11}{'peak MB':>9}"

    def line(self) -> str:
        """A line of the table."""
        counts = f"{self.read:8}{self.refused:9}{len(self.failed):8}"
        return f"{self.format:16}{counts}{self.seconds:8.0f}{self.slowest:11.2f}{self.peak / 1e6:9.0f}"


@dataclass
class _Worker:
    """A process and what it is at: files `at` up to `stop`; `silent`: it will say no more."""

    process: multiprocessing.Process
    pipe: Connection
    at: int
    stop: int
    since: float
    silent: bool = False


def fuzz(name: str, numbers: range, workers: int = 2) -> Tally:
    """Try the files of these numbers."""
    tally = Tally(name)
    start = time.perf_counter()
    share = -(-len(numbers) // workers)
    running = [_started(name, lo, min(lo + share, numbers.stop)) for lo in range(numbers.start, numbers.stop, share)]
    while running:
        wait([w.pipe for w in running], timeout=1)
        running = [now for w in running if (now := _looked_at(w, tally)) is not None]
    tally.seconds = time.perf_counter() - start
    return tally


def _started(name: str, at: int, stop: int) -> _Worker:
    here, there = multiprocessing.Pipe(duplex=False)
    process = multiprocessing.get_context("fork").Process(target=_work, args=(name, at, stop, there))
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", DeprecationWarning
        )  # of threads that the parent has, and the child does not need
        process.start()
    there.close()
    return _Worker(process, here, at, stop, time.perf_counter())


def _looked_at(worker: _Worker, tally: Tally) -> _Worker | None:
    """Take what a worker has said; it, another one in its place where it died or hangs, or None when all is done."""
    for number, outcome, seconds, peak in _said(worker):
        tally.add(number, outcome, seconds)
        tally.peak = max(tally.peak, peak)
        worker.at, worker.since = number + 1, time.perf_counter()
    if worker.at >= worker.stop:
        worker.process.join()
        return None
    hangs = time.perf_counter() - worker.since > (WAITS + 1) * SECONDS
    if not hangs and not worker.silent:
        return worker
    worker.process.kill()
    worker.process.join()
    why = "does not end" if hangs else f"kills the process (exit code {worker.process.exitcode})"
    tally.add(worker.at, Outcome(FAILED, why), time.perf_counter() - worker.since)
    return _started(tally.format, worker.at + 1, worker.stop) if worker.at + 1 < worker.stop else None


def _said(worker: _Worker) -> Iterator[tuple[int, Outcome, float, int]]:
    try:
        while worker.pipe.poll():
            yield worker.pipe.recv()
    except (EOFError, OSError):
        worker.silent = True


def _work(name: str, at: int, stop: int, pipe: Connection) -> None:
    """Try files one after the other, in memory of our own where there is such a place."""
    home = "/dev/shm" if Path("/dev/shm").is_dir() else None
    with tempfile.TemporaryDirectory(dir=home) as folder, room(BYTES):
        for number in range(at, stop):
            start = time.perf_counter()
            outcome = tried(name, number, Path(folder))
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
            if peak > BYTES:
                outcome = Outcome(FAILED, f"memory: {peak} bytes")
            pipe.send((number, outcome, time.perf_counter() - start, peak))
    pipe.close()
