"""Sums of hashes of the rows of arrays: whoever adds which rows, in whatever order, the sum is the same.

The hash of a row depends on the name of the array, on the index of the row, and on every value in its place. It is made
of the finaliser of SplitMix64, a bijection of 64 bits: Steele, Lea, Flood, Fast splittable pseudorandom number
generators, OOPSLA 2014, with the constants of Stafford's variant 13. Two sums from different seeds have 128 bits.
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Ints

#: rows that are hashed at once, so that their hashes stay in a core's cache
ROWS = 1 << 13
#: 2^64 over the golden ratio: what SplitMix64 counts by
_STEP = np.uint64(0x9E3779B97F4A7C15)
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31))
_FACTORS = (np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB))


def row_sums(name: str, index: Ints, values: NDArray) -> NDArray[np.uint64]:
    """Return the sums (2,), modulo 2^64, of the hashes of some rows of an array.

    `name`: that of the array; `index` (k,): the indices of the rows in the whole of it; `values` (k, m): the rows.
    Integers count by their values, reals by their bits, -0.0 as 0.0.

    >>> first, last = row_sums("x", np.array([0]), np.array([[7]])), row_sums("x", np.array([1]), np.array([[8]]))
    >>> np.array_equal(row_sums("x", np.array([1, 0]), np.array([[8], [7]])), first + last)
    True
    """
    seed = np.frombuffer(hashlib.sha256(name.encode()).digest(), "<u8", 2).astype(np.uint64)
    sums = np.zeros(2, np.uint64)
    for start in range(0, len(index), ROWS):
        rows = slice(start, start + ROWS)
        columns = np.ascontiguousarray(_bits(values[rows]).T)
        for lane in range(2):
            sums[lane : lane + 1] += _hashes(index[rows].astype(np.uint64) * _STEP + seed[lane], columns).sum()
    return sums


def _bits(values: NDArray) -> NDArray[np.uint64]:
    """Return values as 64 bits each."""
    if values.dtype.kind == "f":
        return (values.astype(np.float64) + 0.0).view(np.uint64)
    return values.astype(np.int64).view(np.uint64)


def _hashes(h: NDArray[np.uint64], columns: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return the hashes (k,) of rows of columns (m, k), which are written into their first values h (k,)."""
    scratch = np.empty_like(h)
    mix(h, scratch)
    for column in columns:
        h ^= column
        mix(h, scratch)
    return h


def mix(z: NDArray[np.uint64], scratch: NDArray[np.uint64]) -> None:
    """Apply the finaliser of SplitMix64 to numbers z (k,) in place; `scratch` (k,) is written into."""
    for shift, factor in zip(_SHIFTS[:2], _FACTORS, strict=True):
        np.right_shift(z, shift, out=scratch)
        z ^= scratch
        z *= factor
    np.right_shift(z, _SHIFTS[2], out=scratch)
    z ^= scratch
