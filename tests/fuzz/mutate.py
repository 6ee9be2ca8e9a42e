"""Files made worse: bytes, numbers, words, lines and chunks changed, lost, doubled, put elsewhere.

HDF5 also through its own library: links, datasets and attributes lost, of another kind, shape or size.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from contextlib import suppress
from io import BytesIO

import h5py
import numpy as np

#: Numbers as text that are wrong in most places, and what some languages take for numbers.
NUMBERS = (
    "0", "-1", "1", "2", "3", "4", "7", "99", "-99", "1000000", "1000000000000", "-1000000000000", "2147483647",
    "2147483648", "-2147483648", "4294967295", "9223372036854775807", "9223372036854775808",
    "-9223372036854775808", "18446744073709551615", "99999999999999999999", "1.5", "-0.0", "1e-300", "1e308",
    "-1e308", "1e400", "nan", "NaN", "inf", "-inf", "1d5", "0x10", "1_000", "+5", "٣", "1.", ".5", "-", "e", "1e", "",
)  # fmt: skip
_INTEGERS = (0, 1, 2, 3, 4, 5, 8, 99, -1, -2, 2**31 - 1, -(2**31), 2**32 - 1, 10**12, 2**40, 2**62, 2**63 - 1, -(2**63))
_REALS = (0.0, -1.0, 1e308, -1e308, 1e-310, float("inf"), float("-inf"), float("nan"), 2.0**53, 1.5)
_WORDS = rb"[^\s,<>=\"]+"
_NUMBER = rb"(?<![\w.])[-+]?\d+\.?\d*(?:[eEdD][-+]?\d+)?"


def _span(rng, data, most=200):
    """A random part of the data, short more often than long."""
    start = rng.randrange(len(data) + 1)
    return start, min(len(data), start + int(rng.expovariate(1) * rng.choice((1, 8, most))) + 1)


def flip_bits(rng, data):
    """Change a few bits."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def set_bytes(rng, data):
    """Change a few bytes to zero, all ones, characters of numbers and lines, or anything."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 10))):
        out[rng.randrange(len(out))] = rng.choice((0, 255, 10, 13, 32, *b"-.,e$*<>\"'&;0179", rng.randrange(256)))
    return bytes(out)


def set_number(rng, data):
    """A binary number of 4 or 8 bytes, aligned or not, little or big endian."""
    kind, value = rng.choice((("q", rng.choice(_INTEGERS)), ("d", rng.choice(_REALS)), ("i", rng.choice(_INTEGERS))))
    value = (value + 2**31) % 2**32 - 2**31 if kind == "i" and isinstance(value, int) else value
    new = struct.pack(rng.choice("<<<>") + kind, value)
    at = rng.randrange(max(1, len(data) - len(new)))
    at -= at % rng.choice((1, 4, 8))
    return data[:at] + new + data[at + len(new) :]


def truncate(rng, data):
    """Remove the end."""
    return data[: rng.randrange(len(data))]


def chunk(rng, data):
    """Remove, repeat or move a chunk, or insert random bytes."""
    start, end = _span(rng, data)
    rest = data[:start] + data[end:]
    at = rng.randrange(len(rest) + 1)
    more = rng.randbytes(rng.choice((1, 2, 4, 8, 100)))
    moved = rest[:at] + data[start:end] + rest[at:]
    return rng.choice((rest, data[:end] + data[start:], moved, data[:start] + more + data[start:]))


def _replaced(rng, data, pattern, new: Callable[[bytes], bytes]):
    """Replace one match of a pattern, searched from a random place so that every part of the text is reached."""
    start = rng.randrange(len(data) + 1)
    found = re.compile(pattern).search(data, start) or re.compile(pattern).search(data)
    return data if found is None else data[: found.start()] + new(found[0]) + data[found.end() :]


def other_number(rng, data):
    """Replace a number in the text by another one."""
    return _replaced(rng, data, _NUMBER, lambda old: rng.choice(NUMBERS).encode())


def near_number(rng, data):
    """Replace a number in the text by a neighbouring one."""

    def new(old):
        try:
            return str(int(old) + rng.choice((-2, -1, 1, 2))).encode()
        except ValueError:
            return old + b"1"

    return _replaced(rng, data, _NUMBER, new)


def other_word(rng, data):
    """Remove a word, repeat it, or replace it by another one of the file."""
    found = re.findall(_WORDS, data) or [b""]
    return _replaced(rng, data, _WORDS, lambda old: rng.choice((b"", old + b" " + old, rng.choice(found))))


def other_line(rng, data):
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


BYTES = (
    *(flip_bits, set_bytes, set_number) * 3,  # these leave the rest of a file where it was
    *(truncate, chunk, chunk, chunk, chunk),
)
TEXT = (other_number, near_number, other_word, other_word, other_word, other_line)


def mutated(rng, data, others, text):
    """The data with one to a few changes; of text, mostly changes of words, numbers and lines."""
    if rng.random() < 0.03:  # the head of one file and the tail of another
        other = rng.choice(others)
        return data[: rng.randrange(len(data))] + other[rng.randrange(len(other)) :]
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        operation = rng.choice(TEXT if text and rng.random() < 0.7 else BYTES)
        data = operation(rng, data) or b"\n"
    return data


# ---- HDF5

_EXTREME = (0, 1, 2, -1, -2, 5, 99, 2**31 - 1, -(2**31), 2**40, 2**62, 2**63 - 1, -(2**63))
_REAL = (0.0, -1.0, 1e308, float("inf"), float("nan"), 0.5)
#: Values of all kinds, for an attribute or a dataset.
VALUES = (
    lambda: np.int32(-5), lambda: np.int64(2**62), lambda: np.uint64(2**64 - 1), lambda: np.float64("nan"),
    lambda: np.bytes_(b"text"), lambda: "text of any length", lambda: "é" * 70, lambda: np.array([0.5]),
    lambda: np.array([], "i4"), lambda: np.zeros((0, 3)), lambda: np.array([2**62, -(2**62)]),
    lambda: np.arange(12, dtype="i4").reshape(3, 4), lambda: np.arange(7, dtype=">i8"),
    lambda: np.arange(7, dtype="u1"), lambda: np.ones(5, bool), lambda: np.ones(3, complex), lambda: np.zeros(4, "f2"),
    lambda: np.zeros(2, [("a", "i4"), ("b", "f8", 3)]), lambda: np.zeros((2, 2), "S80"), lambda: h5py.Empty("f8"),
    lambda: np.array(["a", "bc"], h5py.string_dtype()),
)  # fmt: skip


def mutated_hdf5(rng, data):
    """The file with one to a few of its objects changed."""
    image = BytesIO(data)
    with h5py.File(image, "r+") as file:
        for _ in range(rng.choice((1, 1, 1, 2, 3))):
            with suppress(KeyError, ValueError, OSError, RuntimeError, TypeError):  # a change that HDF5 refuses
                _change(rng, file)
    return image.getvalue()


def _change(rng, file):
    names = []
    file.visit(names.append)
    holder = rng.choice(names)
    if rng.random() < 0.4 and len(file[holder].attrs):
        _change_attribute(rng, file[holder].attrs)
    elif isinstance(file[holder], h5py.Dataset) and rng.random() < 0.8:
        _change_values(rng, file, holder)
    else:
        _change_link(rng, file, holder, names)


def _change_attribute(rng, attributes):
    name = rng.choice(list(attributes))
    kind = rng.random()
    if kind < 0.2:
        del attributes[name]
    elif kind < 0.6:
        old = np.asarray(attributes[name])
        attributes[name] = np.int64(rng.choice(_EXTREME)) if old.dtype.kind in "iu" else rng.choice(VALUES)()
    elif kind < 0.7:
        attributes[rng.choice(("NBR", "NDT", "TYP", "NUM", "MAI", "PFL", "ESP", "DIM", "NCO", "x"))] = attributes[name]
    else:
        attributes[name] = rng.choice(VALUES)()


def _change_values(rng, file, name):
    """Some values, the type, or the shape of a dataset; its attributes stay."""
    old = file[name]
    values, attributes = np.asarray(old[()]), dict(old.attrs)
    kind = rng.random()
    if kind < 0.45 and values.size and values.dtype.kind in "iuf":
        flat = values.reshape(-1).copy()
        for _ in range(rng.choice((1, 1, 3))):
            new = rng.choice(_REAL) if values.dtype.kind == "f" else rng.choice(_EXTREME)
            with suppress(OverflowError):
                flat[rng.randrange(len(flat))] = new
        old[()] = flat.reshape(values.shape)
        return
    del file[name]
    shapes, types = ((10**12,), (2**31, 3), (10**6, 10**6), (3 * 10**7,)), ("i1", "i8", ">f8", "f4", "u8", "S5", "c16")
    shape = rng.choice(shapes)
    filters = rng.choice(({"compression": "gzip"}, {"compression": "lzf"}, {"fletcher32": True}, {"shuffle": True}))
    other = rng.choice((
        lambda: {"data": rng.choice(VALUES)()},
        lambda: {"data": np.resize(values, max(1, values.size + rng.choice((-3, -1, 1, 7))))},
        lambda: {"data": values.astype(rng.choice(types))},
        lambda: {"shape": shape, "dtype": rng.choice(("i4", "f8")), "chunks": (1000,) * len(shape)},
        lambda: {"data": values, "chunks": True, **filters},
        lambda: {"data": h5py.Empty("i4")},
    ))  # fmt: skip
    file.create_dataset(name, **other()).attrs.update(attributes)


def _change_link(rng, file, name, names):
    """Another link to an object, which may make a circle, a copy, a move; or something else in its place."""
    other = rng.choice(names)
    if rng.random() < 0.4:
        place = f"{name}/{rng.choice(('MAI', 'NOE', 'TE4', 'x', 'é'))}"
        more = lambda: file.__setitem__(place, file[other])  # noqa: E731
        rng.choice(
            (more, more, lambda: file.copy(other, file, f"{name}_again"), lambda: file.move(name, other + "_"))
        )()
        return
    del file[name]
    soft, external = rng.choice((f"/{name}", "/nowhere", f"/{other}")), rng.choice(("elsewhere.h5", "/dev/zero", ""))
    links = h5py.SoftLink(soft), h5py.ExternalLink(external, "/x"), np.dtype("f8")  # the last is a named type
    new = rng.choice((None, None, "group", rng.choice(VALUES)(), *links))
    if new is not None and not isinstance(new, str):
        file[name] = new
    elif new is not None:
        file.create_group(name)
