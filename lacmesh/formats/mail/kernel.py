"""Compiled scanner of the words of a .mail text: ten times as fast as the array code of `mail.names`."""

from __future__ import annotations

import numpy as np

from lacmesh.kernels import kernel

_BLANK, _LETTER, _DIGIT = 0, 1, 2
_MOST_LETTERS, _MOST_DIGITS = 7, 9


@kernel
def scan(text, kind_of, number, prefix, first):  # type: ignore[no-untyped-def]
    """Write for each word its number, its letters as an integer, and whether it begins a line; return the word count.

    `text` (n,) bytes, `kind_of` (256,) the class of each byte; the outputs hold n // 2 + 1 rows at least. Returns -1 if
    a word is not letters and a number (without leading zeros, of 9 digits at most).
    """
    n_words = 0
    n_letters = n_digits = 0
    value = np.int64(0)
    code = np.int64(0)
    new_line = True
    for k in range(len(text) + 1):
        byte = text[k] if k < len(text) else np.uint8(32)
        kind = kind_of[byte]
        if kind == _LETTER:
            if n_digits > 0 or n_letters == _MOST_LETTERS:
                return -1
            code |= np.int64(byte) << (8 * n_letters)
            n_letters += 1
        elif kind == _DIGIT:
            if n_letters == 0 or n_digits == _MOST_DIGITS or (n_digits == 1 and value == 0):
                return -1
            value = 10 * value + (byte - 48)
            n_digits += 1
        elif kind == _BLANK:
            if n_letters > 0:
                if n_digits == 0:
                    return -1
                number[n_words], prefix[n_words], first[n_words] = value, code, new_line
                n_words += 1
                n_letters = n_digits = 0
                value = code = np.int64(0)
                new_line = False
            if byte == 10:
                new_line = True
        else:
            return -1
    return n_words
