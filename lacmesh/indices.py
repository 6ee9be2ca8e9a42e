"""Arrays of indices: masks, places, positions, and what is distinct."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.integer]


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


def distinct(numbers: Ints) -> bool:
    """True if no number occurs twice. Ids as in files, a few millions in any order, are marked off in a table.

    >>> distinct(np.array([7, 5, 6])), distinct(np.array([7, 5, 7])), distinct(np.array([10**18, 0, 10**18]))
    (True, False, False)
    """
    if (numbers[1:] > numbers[:-1]).all():
        return True
    low, high = int(numbers.min()), int(numbers.max())
    if high - low >= 4 * len(numbers):
        ascending = np.sort(numbers)  # np.unique hashes, at a tenth of the speed
        return bool((ascending[1:] > ascending[:-1]).all())
    seen = mask_of(high - low + 1, numbers - low if low else numbers)
    return int(np.count_nonzero(seen)) == len(numbers)
