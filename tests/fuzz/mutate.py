"""Files made worse: bytes, numbers, words, lines and chunks changed, lost, doubled, put elsewhere.

HDF5 also through its own library: links, datasets and attributes lost, of another kind, shape or size.
"""

import re
import struct
from contextlib import suppress
from io import BytesIO

import h5py
import numpy as np

_INTEGERS = (0, 1, 2, 3, 4, 5, 8, 99, -1, -2, 2**31 - 1, -(2**31), 2**32 - 1, 10**12, 2**40, 2**62, 2**63 - 1, -(2**63))
_REALS = (0.0, -1.0, 1e308, -1e308, 1e-310, float("inf"), float("-inf"), float("nan"), 2.0**53, 1.5)
#: numbers as text that are wrong in most places, and what some languages take for numbers
NUMBERS = (
    *map(str, _INTEGERS), "2147483648", "9223372036854775808", "18446744073709551615", "99999999999999999999", "1.5",
    "-0.0", "1e-300", "1e308", "1e400", "nan", "NaN", "inf", "-inf", "1d5", "0x10", "1_000", "+5", "٣", "1.", ".5", "-",
    "e", "1e", "",
)  # fmt: skip
_WORDS = rb"[^\s,<>=\"]+"
_NUMBER = rb"(?<![\w.])[-+]?\d+\.?\d*(?:[eEdD][-+]?\d+)?"


def change_bytes(rng, data):
    """Flip a bit of a few bytes, or set them to zero, all ones, characters of numbers and lines, or anything."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 9))):
        at, new = rng.randrange(len(out)), rng.choice((0, 255, 10, 13, 32, *b"-.,e$*<>\"'&;0179", rng.randrange(256)))
        out[at] = new if rng.random() < 0.5 else out[at] ^ 1 << rng.randrange(8)
    return bytes(out)


def set_number(rng, data):
    """A binary number of 4 or 8 bytes, aligned or not, little or big endian."""
    kind, value = rng.choice((("q", rng.choice(_INTEGERS)), ("d", rng.choice(_REALS)), ("i", rng.choice(_INTEGERS))))
    value = (value + 2**31) % 2**32 - 2**31 if kind == "i" else value
    new = struct.pack(rng.choice("<<<>") + kind, value)
    at = rng.randrange(max(1, len(data) - len(new)))
    at -= at % rng.choice((1, 4, 8))
    return data[:at] + new + data[at + len(new) :]


def chunk(rng, data):
    """Remove the end, or remove, repeat or move a chunk, short more often than long, or insert random bytes."""
    start = rng.randrange(len(data) + 1)
    end = min(len(data), start + int(rng.expovariate(1) * rng.choice((1, 8, 200))) + 1)
    rest = data[:start] + data[end:]
    at = rng.randrange(len(rest) + 1)
    more = data[:start] + rng.randbytes(rng.choice((1, 2, 4, 8, 100))) + data[start:]
    return rng.choice((rest, data[:end] + data[start:], rest[:at] + data[start:end] + rest[at:], more, data[:start]))


def change_text(rng, data):
    """Remove a number, a word or a line, repeat it, or put another one of the file, or a neighbour, in its place."""
    if rng.random() < 0.2:
        lines = data.splitlines(keepends=True)
        at, to = rng.randrange(len(lines)), rng.randrange(len(lines))
        lines[at : at + 1] = rng.choice(([], [lines[at]] * 2, [lines[to]]))
        return b"".join(lines)
    number = rng.random() < 0.5
    pattern = re.compile(_NUMBER if number else _WORDS)
    found = pattern.search(data, rng.randrange(len(data))) or pattern.search(data)
    if found is None:
        return data
    old = found[0]
    if number:
        near = str(int(old) + rng.choice((-2, -1, 1, 2))) if re.fullmatch(rb"[-+]?\d+", old) else f"{old.decode()}1"
        new = rng.choice((near, rng.choice(NUMBERS))).encode()
    else:
        new = rng.choice((b"", old + b" " + old, rng.choice(pattern.findall(data))))
    return data[: found.start()] + new + data[found.end() :]


def mutated(rng, data, others, text):
    """The data with one to a few changes; of text, mostly changes of words, numbers and lines."""
    if rng.random() < 0.03:  # the head of one file and the tail of another
        other = rng.choice(others)
        return data[: rng.randrange(len(data))] + other[rng.randrange(len(other)) :]
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        operation = (
            change_text if text and rng.random() < 0.7 else rng.choice((change_bytes, change_bytes, set_number, chunk))
        )
        data = operation(rng, data) or b"\n"
    return data


# ---- HDF5

#: values of all kinds, for an attribute or a dataset
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
            names = []
            file.visit(names.append)
            name, other = rng.choice(names), rng.choice(names)
            with suppress(KeyError, ValueError, OSError, RuntimeError, TypeError):  # a change that HDF5 refuses
                if rng.random() < 0.4 and len(file[name].attrs):
                    _change_attribute(rng, file[name].attrs)
                elif isinstance(file[name], h5py.Dataset) and rng.random() < 0.8:
                    _change_values(rng, file, name)
                else:
                    _change_link(rng, file, name, other)
    return image.getvalue()


def _change_attribute(rng, attributes):
    name, kind = rng.choice(list(attributes)), rng.random()
    if kind < 0.2:
        del attributes[name]
    elif kind < 0.3:
        attributes[rng.choice(("NBR", "NDT", "TYP", "NUM", "MAI", "PFL", "ESP", "DIM", "NCO", "x"))] = attributes[name]
    elif kind < 0.7 and np.asarray(attributes[name]).dtype.kind in "iu":
        attributes[name] = np.int64(rng.choice(_INTEGERS))
    else:
        attributes[name] = rng.choice(VALUES)()


def _change_values(rng, file, name):
    """Some values, the type, or the shape of a dataset; its attributes stay."""
    old = file[name]
    values, attributes = np.asarray(old[()]), dict(old.attrs)
    if rng.random() < 0.45 and values.size and values.dtype.kind in "iuf":
        flat = values.reshape(-1).copy()
        with suppress(OverflowError):
            flat[rng.randrange(len(flat))] = rng.choice(_REALS if values.dtype.kind == "f" else _INTEGERS)
        old[()] = flat.reshape(values.shape)
        return
    del file[name]
    shape = rng.choice(((10**12,), (2**31, 3), (10**6, 10**6), (3 * 10**7,)))
    filters = rng.choice(({"compression": "gzip"}, {"compression": "lzf"}, {"fletcher32": True}, {"shuffle": True}))
    other = rng.choice((
        lambda: {"data": rng.choice(VALUES)()},
        lambda: {"data": np.resize(values, max(1, values.size + rng.choice((-3, -1, 1, 7))))},
        lambda: {"data": values.astype(rng.choice(("i1", "i8", ">f8", "f4", "u8", "S5", "c16")))},
        lambda: {"shape": shape, "dtype": rng.choice(("i4", "f8")), "chunks": (1000,) * len(shape)},
        lambda: {"data": values, "chunks": True, **filters},
    ))  # fmt: skip
    file.create_dataset(name, **other()).attrs.update(attributes)


def _change_link(rng, file, name, other):
    """Another link to an object, which may make a circle, a copy or a move; or something else in its place."""
    way = rng.choice(("link", "link", "copy", "move", *["replace"] * 6))
    if way == "link":
        file[f"{name}/{rng.choice(('MAI', 'NOE', 'TE4', 'x', 'é'))}"] = file[other]
    elif way == "copy":
        file.copy(other, file, f"{name}_again")
    elif way == "move":
        file.move(name, other + "_")
    else:
        del file[name]
        soft = h5py.SoftLink(rng.choice((f"/{name}", "/nowhere", f"/{other}")))
        external = h5py.ExternalLink(rng.choice(("elsewhere.h5", "/dev/zero", "")), "/x")
        new = rng.choice((None, None, None, rng.choice(VALUES)(), soft, external, np.dtype("f8")))  # a named type
        if new is not None:
            file[name] = new
