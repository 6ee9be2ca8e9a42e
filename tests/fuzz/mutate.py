"""Files made worse: bytes, numbers, words, lines and chunks changed, lost, doubled, put elsewhere."""

from __future__ import annotations

import random
import re
import struct
from collections.abc import Callable, Sequence

#: Numbers as text that are wrong in most places, and what some languages take for numbers.
NUMBERS = (
    *("0", "-1", "1", "2", "3", "4", "7", "99", "-99", "1000000", "1000000000000", "-1000000000000"),
    *("2147483647", "2147483648", "-2147483648", "4294967295", "9223372036854775807", "9223372036854775808"),
    *("-9223372036854775808", "18446744073709551615", "99999999999999999999", "1.5", "-0.0", "1e-300", "1e308"),
    *(
        "-1e308",
        "1e400",
        "nan",
        "NaN",
        "inf",
        "-inf",
        "1d5",
        "0x10",
        "1_000",
        "+5",
        "٣",
        "1.",
        ".5",
        "-",
        "e",
        "1e",
        "",
    ),
)
_INTEGERS = (0, 1, 2, 3, 4, 5, 8, 99, -1, -2, 2**31 - 1, -(2**31), 2**32 - 1, 10**12, 2**40, 2**62, 2**63 - 1, -(2**63))
_REALS = (0.0, -1.0, 1e308, -1e308, 1e-310, float("inf"), float("-inf"), float("nan"), 2.0**53, 1.5)
_WORDS = rb"[^\s,<>=\"]+"
_NUMBER = rb"(?<![\w.])[-+]?\d+\.?\d*(?:[eEdD][-+]?\d+)?"

Operation = Callable[[random.Random, bytes], bytes]


def _span(rng: random.Random, data: bytes, most: int = 200) -> tuple[int, int]:
    """A random part of the data, short more often than long."""
    start = rng.randrange(len(data) + 1)
    return start, min(len(data), start + int(rng.expovariate(1) * rng.choice((1, 8, most))) + 1)


def flip_bits(rng: random.Random, data: bytes) -> bytes:
    """Change a few bits."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def set_bytes(rng: random.Random, data: bytes) -> bytes:
    """Change a few bytes to zero, all ones, characters of numbers and lines, or anything."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 10))):
        out[rng.randrange(len(out))] = rng.choice((0, 255, 10, 13, 32, *b"-.,e$*<>\"'&;0179", rng.randrange(256)))
    return bytes(out)


def set_number(rng: random.Random, data: bytes) -> bytes:
    """A binary number of 4 or 8 bytes, aligned or not, little or big endian."""
    kind, value = rng.choice((("q", rng.choice(_INTEGERS)), ("d", rng.choice(_REALS)), ("i", rng.choice(_INTEGERS))))
    value = (value + 2**31) % 2**32 - 2**31 if kind == "i" and isinstance(value, int) else value
    new = struct.pack(rng.choice("<<<>") + kind, value)
    at = rng.randrange(max(1, len(data) - len(new)))
    at -= at % rng.choice((1, 4, 8))
    return data[:at] + new + data[at + len(new) :]


def truncate(rng: random.Random, data: bytes) -> bytes:
    """Remove the end."""
    return data[: rng.randrange(len(data))]


def cut_out(rng: random.Random, data: bytes) -> bytes:
    """Remove a chunk."""
    start, end = _span(rng, data)
    return data[:start] + data[end:]


def double(rng: random.Random, data: bytes) -> bytes:
    """Repeat a chunk."""
    start, end = _span(rng, data)
    return data[:end] + data[start:]


def move(rng: random.Random, data: bytes) -> bytes:
    """Move a chunk."""
    start, end = _span(rng, data)
    rest = data[:start] + data[end:]
    at = rng.randrange(len(rest) + 1)
    return rest[:at] + data[start:end] + rest[at:]


def insert(rng: random.Random, data: bytes) -> bytes:
    """Insert random bytes."""
    at = rng.randrange(len(data) + 1)
    return data[:at] + rng.randbytes(rng.choice((1, 2, 4, 8, 100))) + data[at:]


def _replaced(rng: random.Random, data: bytes, pattern: bytes, new: Callable[[bytes], bytes]) -> bytes:
    """Replace one match of a pattern, searched from a random place so that every part of the text is reached."""
    start = rng.randrange(len(data) + 1)
    found = re.compile(pattern).search(data, start) or re.compile(pattern).search(data)
    return data if found is None else data[: found.start()] + new(found[0]) + data[found.end() :]


def other_number(rng: random.Random, data: bytes) -> bytes:
    """Replace a number in the text by another one."""
    return _replaced(rng, data, _NUMBER, lambda old: rng.choice(NUMBERS).encode())


def near_number(rng: random.Random, data: bytes) -> bytes:
    """Replace a number in the text by a neighbouring one."""

    def new(old: bytes) -> bytes:
        try:
            return str(int(old) + rng.choice((-2, -1, 1, 2))).encode()
        except ValueError:
            return old + b"1"

    return _replaced(rng, data, _NUMBER, new)


def no_word(rng: random.Random, data: bytes) -> bytes:
    """Remove a word."""
    return _replaced(rng, data, _WORDS, lambda old: b"")


def word_twice(rng: random.Random, data: bytes) -> bytes:
    """Repeat a word."""
    return _replaced(rng, data, _WORDS, lambda old: old + b" " + old)


def other_word(rng: random.Random, data: bytes) -> bytes:
    """Replace a word by another one of the file."""
    found = re.findall(_WORDS, data)
    return _replaced(rng, data, _WORDS, lambda old: rng.choice(found)) if found else data


def other_line(rng: random.Random, data: bytes) -> bytes:
    """Remove, repeat or move a line."""
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
    if rng.random() < 0.4:
        del lines[at]
    elif rng.random() < 0.5:
        lines.insert(to, lines[at])
    else:
        lines[at], lines[to] = lines[to], lines[at]
    return b"".join(lines)


BYTES: tuple[Operation, ...] = (
    *(flip_bits, set_bytes, set_number) * 3,  # these leave the rest of a file where it was
    *(truncate, cut_out, double, move, insert),
)
TEXT: tuple[Operation, ...] = (other_number, near_number, no_word, word_twice, other_word, other_line)


def mutated(rng: random.Random, data: bytes, others: Sequence[bytes], text: bool) -> bytes:
    """The data with one to a few changes; of text, mostly changes of words, numbers and lines."""
    if rng.random() < 0.03:  # the head of one file and the tail of another
        other = rng.choice(others)
        return data[: rng.randrange(len(data))] + other[rng.randrange(len(other)) :]
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        operation = rng.choice(TEXT if text and rng.random() < 0.7 else BYTES)
        data = operation(rng, data) or b"\n"
    return data
