"""Readers of a file in threads of one process, as processes of MPI would be: each has a slice, all call each method."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np

from lacmesh.communicator import Communicator


class Thread(Communicator):
    """Thread `rank` of `size`, which gives and takes what all have in a list."""

    def __init__(self, rank, size, barrier, given):
        self.rank, self.size, self._barrier, self._given = rank, size, barrier, given

    def _all(self, x):
        self._given[self.rank] = x
        self._barrier.wait()
        there = list(self._given)
        self._barrier.wait()
        return there

    def on_each(self, work):
        try:
            made, error = work(), None
        except Exception as failed:
            made, error = None, failed
        for first in self._all(error):
            if first is not None:
                raise first
        return made

    def total(self, x):
        return sum(self._all(x))

    def greatest(self, x):
        return np.max(self._all(x), axis=0)

    def before(self, count):
        return sum(self._all(count)[: self.rank])

    def gather(self, x):
        return np.concatenate(self._all(x))

    def exchange(self, x, counts, expected=None):
        parts = [np.split(rows, np.cumsum(n)[:-1])[self.rank] for rows, n in self._all((x, counts))]
        return np.concatenate(parts), np.array([len(part) for part in parts])


def in_threads(n, work):
    """Return what `work`, a function of a communicator, returns or raises in each of n threads."""
    barrier, given = Barrier(n, timeout=20), [None] * n

    def one(rank):
        try:
            return work(Thread(rank, n, barrier, given))
        except Exception as error:
            return error

    with ThreadPoolExecutor(n) as pool:
        return list(pool.map(one, range(n)))


def in_slices(slice_of, path, n):
    """Return the slices of a file, or the error of each of its readers."""
    return in_threads(n, lambda comm: slice_of(path, comm))
