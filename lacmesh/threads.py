"""Threads for kernels, which run without Python's lock: slices of rows, as many at once as there are cores.

The cores and the memory of this process, too.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_THREADS = 8
#: least number of rows or cells for a thread: fewer take less time than its start and what each thread does in Python
_WORTH = 512

T = TypeVar("T")


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def peak_memory() -> int:
    """Return the peak memory of this process in bytes; 0 if the system does not tell."""
    try:
        import resource
    except ImportError:  # not on Windows
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def worthwhile(threads: int, count: int) -> int:
    """Number of threads, at least 1 and at most `threads`, for work on `count` rows or cells."""
    return max(1, min(threads, count // _WORTH))


def in_threads(run: Callable[[slice], T], count: int) -> list[T]:
    """Call `run` on slices of the rows 0 to `count`, each in a thread, as many as there are cores and it is worth.

    Return the results in order.
    """
    threads = worthwhile(min(available_cores(), _THREADS), count)
    ends = [count * k // threads for k in range(threads + 1)]
    return side_by_side(lambda k: run(slice(ends[k], ends[k + 1])), threads)


def side_by_side(run: Callable[[int], T], threads: int) -> list[T]:
    """Call `run` on 0 to `threads` - 1, each in a thread of its own; return the results in order."""
    if threads == 1:
        return [run(0)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(run, range(threads)))
