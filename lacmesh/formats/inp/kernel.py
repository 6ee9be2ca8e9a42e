"""Compiled scanners of the data lines of an .inp file: several times as fast as the array code of `inp.data`."""

from __future__ import annotations

import numpy as np

from lacmesh.kernels import kernel

_NEWLINE, _COMMA, _SPACE, _ZERO, _NINE = 10, 44, 32, 48, 57
_MOST_DIGITS = 18


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
