"""The names of nodes and cells in a .mail file, as integers.

A name like N12 or MA12 is letters and a number: its key is the number, plus a multiple of `STEP` that stands for the
letters. Any other name gets a key by the order in which it is met. So nothing is done name by name where names are
regular, as all programs write them.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh.formats.text import decoded, is_long, parsed
from lacmesh.mesh import Ints, mask_of

#: Keys of one prefix are numbers below this; names of no such form have keys from _OTHER on.
STEP = 10**10
_OTHER = 10**17
_REGULAR = re.compile(rb"([A-Za-z_]{1,7})(0|[1-9][0-9]{0,8})")
_MOST_PREFIXES = 16
#: What a byte is in a name: nothing (a separator), a letter, a digit, something else.
_BLANK, _LETTER, _DIGIT, _OTHERS = 0, 1, 2, 3
_CLASS = np.full(256, _OTHERS, np.uint8)
_CLASS[[9, 10, 11, 12, 13, 32, ord(","), ord("=")]] = _BLANK
_CLASS[[*range(ord("A"), ord("Z") + 1), *range(ord("a"), ord("z") + 1), ord("_")]] = _LETTER
_CLASS[[*range(ord("0"), ord("9") + 1)]] = _DIGIT
_DIGITS_ONLY = bytes(c if _CLASS[c] == _DIGIT else 32 for c in range(256))
_SPACED = bytes(32 if _CLASS[c] == _BLANK and c not in b"\r\n" else c for c in range(256))


class Words(NamedTuple):
    """Words of a text: its bytes (n,) and, for each word, its begin, its end, and whether it begins a line."""

    text: NDArray[np.uint8]
    begin: Ints
    end: Ints
    first: NDArray[np.bool_]


def words(text: bytes) -> Words:
    """Split a text of whole lines into words."""
    letters = np.frombuffer(text, np.uint8)
    inside = np.zeros(len(letters) + 2, bool)
    np.not_equal(_CLASS[letters], _BLANK, out=inside[1:-1])
    change = np.flatnonzero(inside[1:] != inside[:-1])
    begin, end = change[::2], change[1::2]
    lines = np.flatnonzero(letters == 10) + 1
    first = mask_of(len(begin) + 1, np.searchsorted(begin, lines))
    first[0] = True
    return Words(letters, begin, end, first[:-1])


#: of words that are letters and a number: the numbers, the letters as integers, and which words begin a line
Scanned = tuple[Ints, Ints, NDArray[np.bool_]]


def scanned(text: bytes) -> Scanned | None:
    """Split a text of whole lines into words; None if one is not letters and a number. Compiled."""
    from lacmesh.formats.text_kernels import scan_names

    size = len(text) // 2 + 1
    number, prefix, first = np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size, bool)
    n = scan_names(np.frombuffer(text, np.uint8), _CLASS, number, prefix, first)
    return None if n < 0 else (number[:n], prefix[:n], first[:n])


def scanned_by_arrays(text: bytes) -> Scanned | None:
    """Split a text as `scanned` does, by numpy alone: without the time to load the compiler."""
    letters = np.frombuffer(text, np.uint8)
    kind = np.zeros(len(letters) + 2, np.uint8)
    kind[1:-1] = _CLASS[letters]
    before, after = kind[:-1], kind[1:]
    begin = np.flatnonzero((before == _BLANK) & (after != _BLANK))
    digits = np.flatnonzero((before == _LETTER) & (after == _DIGIT))
    wrong = (after == _OTHERS) | ((after == _DIGIT) & (before == _BLANK)) | ((after == _LETTER) & (before == _DIGIT))
    if wrong.any() or len(digits) != len(begin):
        return None
    if not len(begin):
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, bool)
    size = digits - begin
    end = np.flatnonzero((before == _DIGIT) & (after == _BLANK))
    leading = (letters[digits] == ord("0")) & (end - digits > 1)
    if size.max() > 7 or (end - digits).max() > 9 or leading.any():
        return None
    prefix = np.zeros(len(begin), np.int64)
    for k in range(int(size.max())):
        prefix |= np.where(size > k, letters[np.minimum(begin + k, len(letters) - 1)], 0).astype(np.int64) << 8 * k
    numbers = parsed(text.translate(_DIGITS_ONLY), np.int64)
    return None if numbers is None else (numbers, prefix, words(text).first)


class Names:
    """The keys given so far in one file, for nodes and cells alike."""

    def __init__(self) -> None:
        self._prefixes: dict[bytes, int] = {}
        self._others: dict[bytes, int] = {}

    def keys(self, text: bytes) -> Ints:
        """The keys of all words of a text, int64."""
        return self.lines(text)[0]

    def lines(self, text: bytes) -> tuple[Ints, NDArray[np.bool_]]:
        """The keys of all words of a text whose lines are whole, and which words begin a line."""
        regular = scanned(text) if is_long(text) else scanned_by_arrays(text)
        if regular is not None:
            number, prefix, first = regular
            keys = self._with_prefixes(number, prefix)
            if keys is not None:
                return keys, first
        keys = np.array([self._key(word) for word in text.translate(_SPACED).split()], np.int64)
        return keys, words(text).first

    def _with_prefixes(self, numbers: Ints, prefix: Ints) -> Ints | None:
        """Add the key offset of each prefix (its letters as an integer) to its number; None for too many prefixes."""
        if not len(numbers):
            return numbers
        left = np.ones(len(prefix), bool)
        for _ in range(_MOST_PREFIXES):
            code = int(prefix[left.argmax()])
            here = prefix == code
            numbers[here] += self._base(code.to_bytes(7, "little").rstrip(b"\0"))
            left &= ~here
            if not left.any():
                return numbers
        return None

    def _base(self, prefix: bytes) -> int:
        return STEP * self._prefixes.setdefault(prefix, len(self._prefixes))

    def _key(self, word: bytes) -> int:
        regular = _REGULAR.fullmatch(word)
        if regular:
            return self._base(regular[1]) + int(regular[2])
        return self._others.setdefault(word, _OTHER + len(self._others))

    def name(self, key: int) -> str:
        """The name that has a key."""
        if key >= _OTHER:
            return decoded(list(self._others)[key - _OTHER])
        return decoded(list(self._prefixes)[key // STEP]) + str(key % STEP)


def numbers(keys: Ints) -> Ints | None:
    """Numbers in the names with these keys; None if a name has no number, or two names have the same."""
    if not len(keys):
        return keys
    if keys.max() >= _OTHER:
        return None
    ids = keys % STEP
    ordered = np.sort(ids)
    return None if (ordered[1:] == ordered[:-1]).any() else ids
