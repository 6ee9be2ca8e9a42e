"""Readers of a file in threads of one process, as processes of MPI would be: each has a slice, all call each method."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np

from lacmesh.formats import ids
from lacmesh.formats.ids import Index


class Reader:
    """Reader `rank` of `n`, which gives and takes what all have in a list."""

    def __init__(self, rank, n, barrier, given):
        self.rank, self.n, self._barrier, self._given = rank, n, barrier, given

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

    def gather(self, x):
        return np.concatenate(self._all(x))

    def repeated(self, number):
        return ids.repeated(self.gather(number))

    def index(self, own, wanted):
        return Index(self.gather(own.numbers))


def in_slices(slice_of, path, n):
    """Return the slices of a file, or the error of each of its readers."""
    barrier, given = Barrier(n, timeout=20), [None] * n

    def one(rank):
        try:
            return slice_of(path, Reader(rank, n, barrier, given))
        except Exception as error:
            return error

    with ThreadPoolExecutor(n) as pool:
        return list(pool.map(one, range(n)))
