"""Arrays of indices: masks, places, positions; numbers (ids) in a file, and the way back from a number to an index."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.integer]
#: rows converted at a time: a piece stays in the processor's cache
CHUNK = 1 << 14


def codes(values: Ints) -> Ints:
    """Distinct values of small integers >= 0, ascending; quicker to start than np.unique, which loads numpy.ma.

    >>> codes(np.array([5, 2, 5])).tolist()
    [2, 5]
    """
    return np.flatnonzero(np.bincount(values))


def concatenated(parts: Iterable[Ints]) -> Ints:
    """Return arrays of integers one after the other; an empty one of no arrays."""
    return np.concatenate([np.empty(0, np.int64), *parts])


def mask_of(size: int, *indices: Any) -> NDArray[np.bool_]:
    """Return a mask (size,), True at some indices: arrays, numbers or slices.

    >>> mask_of(4, np.array([0, 3]), 2).tolist()
    [True, False, True, True]
    """
    mask = np.zeros(size, bool)
    for index in indices:
        mask[index] = True
    return mask


def places_of(members: Ints, size: int, dtype: type[np.integer] = np.int64) -> Ints:
    """Return the place (size,) of each index in an array of indices, -1 of those that are not in it.

    >>> places_of(np.array([3, 0]), 4).tolist()
    [1, -1, -1, 0]
    """
    places = np.full(size, -1, dtype)
    places[members] = np.arange(len(members), dtype=dtype)
    return places


def positions(index: Ints, members: Ints) -> Ints:
    """Return the position in `index` (k,), ascending, of each member, in the shape of `members`; -1 if it is not there.

    >>> positions(np.array([2, 5, 7]), np.array([[7, 2], [3, 9]])).tolist()
    [[2, 0], [-1, -1]]
    """
    if not len(index):
        return np.full(members.shape, -1)
    place = np.minimum(np.searchsorted(index, members), len(index) - 1)
    return np.where(index[place] == members, place, -1)


def repeated(numbers: Ints) -> int | None:
    """Return the smallest number that occurs twice, or None. Ids as in files, in any order, are marked off in a table.

    >>> repeated(np.array([7, 5, 6])), repeated(np.array([7, 5, 7])), repeated(np.array([10**18, 0, 10**18]))
    (None, 7, 1000000000000000000)
    """
    if (numbers[1:] > numbers[:-1]).all():
        return None
    low = int(numbers.min())
    size = int(numbers.max()) - low + 1
    if _is_dense(size, len(numbers)) and np.count_nonzero(mask_of(size, numbers - low)) == len(numbers):
        return None
    ordered = np.sort(numbers)  # np.unique hashes, at a tenth of the speed
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    return int(twice[0]) if len(twice) else None


def _is_dense(size: int, n: int) -> bool:
    """True if a table of this size for n numbers is worth its memory."""
    return size < 10 * n + 1_000_000


def distinct(numbers: Ints) -> bool:
    """True if no number occurs twice."""
    return repeated(numbers) is None


def numbered(numbers: Ints) -> Ints:
    """Return the numbers of nodes or cells; 1, 2 ... if they are not positive and distinct."""
    positive = numbers.min(initial=1) > 0 and repeated(numbers) is None
    return numbers if positive else np.arange(1, len(numbers) + 1)


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


def by_value(values: Ints, members: Ints) -> Iterator[tuple[int, Ints]]:
    """Iterate over the distinct `values` (n,), ascending, with those of the `members` (n,) that have each.

    >>> [(value, some.tolist()) for value, some in by_value(np.array([7, 3, 7]), np.array([0, 1, 2]))]
    [(3, [1]), (7, [0, 2])]
    """
    order = np.argsort(values, kind="stable")
    distinct_values, starts = np.unique(values[order], return_index=True)
    return zip(distinct_values.tolist(), np.split(members[order], starts[1:]), strict=False)


class Index:
    """Map from distinct numbers (n,) to indices 0..n-1; 1, 2 ... n in order need no table, scattered ones a list."""

    def __init__(self, numbers: Ints) -> None:
        self.n, self.numbers = len(numbers), numbers

    @cached_property
    def _up(self) -> bool:
        return np.array_equal(self.numbers, np.arange(1, self.n + 1))

    @cached_property
    def _table(self) -> Ints | None:
        """Table from number to index, the last entry (-1) for unknown numbers; None if numbers are too scattered."""
        largest = int(self.numbers.max())
        if self.numbers.min() < 0 or not _is_dense(largest, self.n):
            return None
        return np.append(places_of(self.numbers, largest + 1, np.int32 if self.n < 2**31 else np.int64), -1)

    @cached_property
    def _ordered(self) -> tuple[Ints, Ints]:
        """The numbers in ascending order, and their indices."""
        order = np.argsort(self.numbers, kind="stable")
        return self.numbers[order], order

    def places(self, numbers: Ints) -> Ints:
        """Return the index of each number, any shape, int64; -1 where it is unknown."""
        numbers = np.asarray(numbers)
        if self._up:
            return np.where((numbers >= 1) & (numbers <= self.n), numbers, 0).astype(np.int64) - 1
        if self._table is not None:
            last = len(self._table) - 1
            return self._table[np.where((numbers >= 0) & (numbers < last), numbers, last)].astype(np.int64)
        ordered, places = self._ordered
        at = positions(ordered, numbers)
        return np.where(at >= 0, places[at], -1)

    def convert(self, numbers: Ints, out: Ints) -> int | None:
        """Write the indices of rows of numbers to `out`; return the first row that has an unknown number, or None."""
        for a in range(0, len(numbers), CHUNK):
            piece = np.ascontiguousarray(numbers[a : a + CHUNK])
            places = piece - 1 if self._up else self.places(piece)
            if places.min(initial=0) < 0 or places.max(initial=0) >= self.n:
                return a + int(((places < 0) | (places >= self.n)).any(axis=1).argmax())
            out[a : a + CHUNK] = places
        return None
