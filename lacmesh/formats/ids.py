"""The ids (numbers) of nodes and cells in a file, and the way back from an id to an index.

Ids that count 1..n in order need no table; others have one, or a sorted list where they are scattered.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from lacmesh.mesh import Ints, mask_of

#: Rows converted at a time: a piece stays in the processor's cache.
CHUNK = 1 << 14


def counts_up(numbers: Ints) -> bool:
    """True if the numbers are 1, 2, ... n in order."""
    n = len(numbers)
    return n == 0 or (numbers[0] == 1 and numbers[-1] == n and np.array_equal(numbers, np.arange(1, n + 1)))


def repeated(numbers: Ints) -> int | None:
    """The smallest number that stands twice, or None."""
    n = len(numbers)
    if n < 2 or (numbers[1:] > numbers[:-1]).all():
        return None
    if numbers.min() >= 0 and _dense(numbers):
        seen = mask_of(int(numbers.max()) + 1, numbers)
        if np.count_nonzero(seen) == n:
            return None
    ordered = np.sort(numbers)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    return int(twice[0]) if len(twice) else None


def _dense(numbers: Ints) -> bool:
    return int(numbers.max()) < 10 * len(numbers) + 1_000_000


class Index:
    """Map from distinct positive numbers (n,) to indices 0..n-1; `more`: further numbers, which stand for `meant`.

    `table`: False for a map that is searched, so that it takes no more room than its numbers.
    """

    def __init__(
        self, numbers: Ints, more: Ints | None = None, meant: Ints | None = None, *, table: bool = True
    ) -> None:
        self.n = len(numbers)
        self.numbers, self._tabled = numbers, table
        self._places: Ints | None = None
        if more is not None and meant is not None and len(more):
            self._places = np.append(np.arange(self.n), Index(numbers).places(meant))
            self.numbers = np.append(numbers, more)

    @classmethod
    def counting(cls, n: int) -> Index:
        """Return the map from 1, 2, ... n to 0, 1, ... n - 1."""
        index = cls(np.empty(0, np.int64))
        index.n = n
        return index

    @classmethod
    def of_places(cls, numbers: Ints, places: Ints, n: int) -> Index:
        """Return the map from some numbers (k,) to their places (k,), indices below n, or -1."""
        index = cls(numbers, table=False)
        index.n, index._places = n, places
        return index

    @cached_property
    def _up(self) -> bool:
        return self._places is None and counts_up(self.numbers)

    @cached_property
    def _table(self) -> Ints | None:
        """Table from number to index, the last entry (-1) for unknown numbers; None if numbers are too scattered."""
        if not self._tabled or not _dense(self.numbers):
            return None
        table: Ints = np.full(int(self.numbers.max()) + 2, -1, np.int32 if self.n < 2**31 else np.int64)
        table[self.numbers] = np.arange(self.n) if self._places is None else self._places
        return table

    @cached_property
    def _ordered(self) -> tuple[Ints, Ints]:
        """The numbers in ascending order, and their places."""
        order = np.argsort(self.numbers, kind="stable")
        return self.numbers[order], order if self._places is None else self._places[order]

    def places(self, numbers: Ints) -> Ints:
        """The place of each number, any shape, int64; -1 where it is unknown."""
        numbers = np.asarray(numbers)
        if self._up:
            known = (numbers >= 1) & (numbers <= self.n)
            return np.where(known, numbers, 0).astype(np.int64) - 1
        if self._table is not None:
            last = len(self._table) - 1
            known = (numbers >= 0) & (numbers < last)
            return self._table[np.where(known, numbers, last)].astype(np.int64)
        ordered, places = self._ordered
        if not len(ordered):
            return np.full(numbers.shape, -1)
        k = np.minimum(np.searchsorted(ordered, numbers), len(ordered) - 1)
        return np.where(ordered[k] == numbers, places[k], -1)

    def convert(self, numbers: Ints, out: Ints) -> int | None:
        """Write the indices of rows of numbers to `out`; return the first row that has an unknown number, or None."""
        for a in range(0, len(numbers), CHUNK):
            piece = np.ascontiguousarray(numbers[a : a + CHUNK])
            places = piece - 1 if self._up else self.places(piece)
            if places.min(initial=0) < 0 or places.max(initial=0) >= self.n:
                return a + int(((places < 0) | (places >= self.n)).any(axis=1).argmax())
            out[a : a + CHUNK] = places
        return None
