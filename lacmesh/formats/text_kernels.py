"""Compiled scanners of text: fields, integers and names; several times as fast as their twins on arrays."""

from __future__ import annotations

import numpy as np

from lacmesh.kernels import kernel

_NEWLINE, _COMMA, _SPACE, _ZERO, _NINE = 10, 44, 32, 48, 57
#: of an integer
_MOST_DIGITS = 18
#: the classes of bytes in names (`mail.names`), and the longest names that are regular
_BLANK, _LETTER, _DIGIT = 0, 1, 2
_NAME_LETTERS, _NAME_DIGITS = 7, 9


@kernel
def count_fields(text, counts):  # type: ignore[no-untyped-def]
    """Write the number of fields of each line to `counts`; one comma at a line's end adds none, a blank line has 0.

    `text` (n,) bytes, of whole lines; `counts` holds a row for each.
    """
    line = commas = 0
    filled = trailing = False
    for byte in text:
        if byte == _NEWLINE:
            counts[line] = commas + 1 - trailing if filled else 0
            line += 1
            commas = 0
            filled = trailing = False
        elif byte > _SPACE:
            filled = True
            trailing = byte == _COMMA
            commas += trailing


@kernel
def scan_integers(text, values):  # type: ignore[no-untyped-def]
    """Write the integers of a text of commas and blanks to `values`; return their number, -1 if anything else is there.

    `values` holds n // 2 + 1 rows for `text` (n,).
    """
    n = n_digits = 0
    value = np.int64(0)
    for byte in text:
        if _ZERO <= byte <= _NINE:
            value = 10 * value + (byte - _ZERO)
            n_digits += 1
            if n_digits > _MOST_DIGITS:
                return -1
        elif byte == _COMMA or byte <= _SPACE:
            if n_digits:
                values[n] = value
                n += 1
                value = np.int64(0)
                n_digits = 0
        else:
            return -1
    return n if n_digits == 0 else -1


@kernel
def scan_names(text, class_of, number, prefix, first):  # type: ignore[no-untyped-def]
    """Write for each word its number, its letters as an integer, and whether it begins a line; return the word count.

    `text` (n,) bytes, `class_of` (256,) the class of each byte; the outputs hold n // 2 + 1 rows at least. Returns -1
    if a word is not letters and a number (without leading zeros, of 9 digits at most).
    """
    n_words = 0
    n_letters = n_digits = 0
    value = np.int64(0)
    code = np.int64(0)
    new_line = True
    for k in range(len(text) + 1):
        byte = text[k] if k < len(text) else np.uint8(32)
        here = class_of[byte]
        if here == _LETTER:
            if n_digits > 0 or n_letters == _NAME_LETTERS:
                return -1
            code |= np.int64(byte) << (8 * n_letters)
            n_letters += 1
        elif here == _DIGIT:
            if n_letters == 0 or n_digits == _NAME_DIGITS or (n_digits == 1 and value == 0):
                return -1
            value = 10 * value + (byte - 48)
            n_digits += 1
        elif here == _BLANK:
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
