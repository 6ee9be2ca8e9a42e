"""Threads for kernels, which run without Python's lock: slices of rows, as many at once as there are cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np

_THREADS = 8


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(run: Callable[[slice], None], count: int) -> None:
    """Call `run` on slices of the rows 0 to `count`, one in each thread, with as many threads as available cores."""
    threads = min(available_cores(), _THREADS)
    ends = np.linspace(0, count, threads + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(run, (slice(a, b) for a, b in pairwise(ends))))
