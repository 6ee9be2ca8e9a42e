"""Numbers (ids) of nodes and cells in a file, and the way back from a number to an index.

Numbers that count 1..n in order need no table; others have one, or a sorted list where they are scattered.
"""

from __future__ import annotations

from collections.abc import Iterable
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


def numbered(numbers: Ints) -> Ints:
    """The numbers of nodes or cells; 1, 2 ... if they are not positive and distinct."""
    positive = numbers.min(initial=1) > 0 and repeated(numbers) is None
    return numbers if positive else np.arange(1, len(numbers) + 1)


def _dense(numbers: Ints) -> bool:
    return int(numbers.max()) < 10 * len(numbers) + 1_000_000


def divided(label: Ints, n: int, groups: Iterable[Ints]) -> tuple[Ints, list[int], list[tuple[int, ...]]]:
    """Divide labels (k,) from 0 to n - 1 so that rows of equal label are in the same groups of rows.

    Return the labels (k,), and of each label the one that it comes from, and the places of its groups. Rows inside a
    group get a new label, behind all others, where rows of their label are outside.
    """
    label, count = label.astype(np.int32), np.bincount(label, minlength=n)
    source, inside = list(range(n)), [tuple[int, ...]()] * n
    for g, rows in enumerate(groups):
        hit = np.bincount(label[rows], minlength=len(count))
        touched = np.flatnonzero(hit)
        part = touched[hit[touched] < count[touched]]
        new = np.arange(len(count), dtype=np.int32)
        new[part] = len(count) + np.arange(len(part))
        label[rows] = new[label[rows]]
        count[part] -= hit[part]
        count = np.append(count, hit[part])
        source += [source[c] for c in part.tolist()]
        inside += [inside[c] for c in part.tolist()]
        for c in new[touched].tolist():
            inside[c] = (*inside[c], g)
    return label, source, inside


class Index:
    """Map from distinct numbers (n,) to indices 0..n-1."""

    def __init__(self, numbers: Ints) -> None:
        self.n, self.numbers = len(numbers), numbers

    @cached_property
    def _up(self) -> bool:
        return counts_up(self.numbers)

    @cached_property
    def _table(self) -> Ints | None:
        """Table from number to index, the last entry (-1) for unknown numbers; None if numbers are too scattered."""
        if self.numbers.min(initial=0) < 0 or not _dense(self.numbers):
            return None
        table: Ints = np.full(int(self.numbers.max()) + 2, -1, np.int32 if self.n < 2**31 else np.int64)
        table[self.numbers] = np.arange(self.n)
        return table

    @cached_property
    def _ordered(self) -> tuple[Ints, Ints]:
        """The numbers in ascending order, and their indices."""
        order = np.argsort(self.numbers, kind="stable")
        return self.numbers[order], order

    def places(self, numbers: Ints) -> Ints:
        """The index of each number, any shape, int64; -1 where it is unknown."""
        numbers = np.asarray(numbers)
        if self._up:
            known = (numbers >= 1) & (numbers <= self.n)
            return np.where(known, numbers, 0).astype(np.int64) - 1
        if self._table is not None:
            last = len(self._table) - 1
            known = (numbers >= 0) & (numbers < last)
            return self._table[np.where(known, numbers, last)].astype(np.int64)
        ordered, places = self._ordered
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
