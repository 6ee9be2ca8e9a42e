"""HDF5 made worse through its own library: links, datasets and attributes lost, of another kind, shape or size."""

from __future__ import annotations

import random
from collections.abc import Callable
from contextlib import suppress
from io import BytesIO
from typing import Any

import h5py
import numpy as np

_EXTREME = (0, 1, 2, -1, -2, 5, 99, 2**31 - 1, -(2**31), 2**40, 2**62, 2**63 - 1, -(2**63))
_REAL = (0.0, -1.0, 1e308, float("inf"), float("nan"), 0.5)
#: Values of all kinds, for an attribute or a dataset.
VALUES: tuple[Callable[[], Any], ...] = (
    lambda: np.int32(-5),
    lambda: np.int64(2**62),
    lambda: np.uint64(2**64 - 1),
    lambda: np.float64("nan"),
    lambda: np.bytes_(b"text"),
    lambda: "text of any length",
    lambda: "é" * 70,
    lambda: np.array([0.5]),
    lambda: np.array([], "i4"),
    lambda: np.zeros((0, 3)),
    lambda: np.array([2**62, -(2**62)]),
    lambda: np.arange(12, dtype="i4").reshape(3, 4),
    lambda: np.arange(7, dtype=">i8"),
    lambda: np.arange(7, dtype="u1"),
    lambda: np.ones(5, bool),
    lambda: np.ones(3, complex),
    lambda: np.zeros(4, "f2"),
    lambda: np.zeros(2, [("a", "i4"), ("b", "f8", 3)]),
    lambda: np.zeros((2, 2), "S80"),
    lambda: h5py.Empty("f8"),
    lambda: np.array(["a", "bc"], h5py.string_dtype()),
)


def mutated(rng: random.Random, data: bytes) -> bytes:
    """The file with one to a few of its objects changed."""
    image = BytesIO(data)
    with h5py.File(image, "r+") as file:
        for _ in range(rng.choice((1, 1, 1, 2, 3))):
            with suppress(KeyError, ValueError, OSError, RuntimeError, TypeError):  # a change that HDF5 refuses
                _change(rng, file)
    return image.getvalue()


def _change(rng: random.Random, file: h5py.File) -> None:
    names: list[str] = []
    file.visit(names.append)
    holder = rng.choice(names)
    if rng.random() < 0.4 and len(file[holder].attrs):
        _change_attribute(rng, file[holder].attrs)
    elif isinstance(file[holder], h5py.Dataset) and rng.random() < 0.8:
        _change_values(rng, file, holder)
    else:
        _change_link(rng, file, holder, names)


def _change_attribute(rng: random.Random, attributes: Any) -> None:
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


def _change_values(rng: random.Random, file: h5py.File, name: str) -> None:
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
    if kind < 0.55:
        made = file.create_dataset(name, data=rng.choice(VALUES)())
    elif kind < 0.65:
        made = file.create_dataset(name, data=np.resize(values, max(1, values.size + rng.choice((-3, -1, 1, 7)))))
    elif kind < 0.75:
        made = file.create_dataset(name, data=values.astype(rng.choice(("i1", "i8", ">f8", "f4", "u8", "S5", "c16"))))
    elif kind < 0.85:
        shape = rng.choice(((10**12,), (2**31, 3), (10**6, 10**6), (3 * 10**7,)))
        made = file.create_dataset(name, shape=shape, dtype=rng.choice(("i4", "f8")), chunks=(1000,) * len(shape))
    elif kind < 0.95:
        filters = rng.choice(({"compression": "gzip"}, {"compression": "lzf"}, {"fletcher32": True}, {"shuffle": True}))
        made = file.create_dataset(name, data=values, chunks=True, **filters)
    else:
        made = file.create_dataset(name, data=h5py.Empty("i4"))
    made.attrs.update(attributes)


def _change_link(rng: random.Random, file: h5py.File, name: str, names: list[str]) -> None:
    other = rng.choice(names)
    kind = rng.random()
    if kind < 0.2:
        file[f"{name}/{rng.choice(('MAI', 'NOE', 'TE4', 'x', 'é'))}"] = file[other]  # may make a circle
        return
    if kind < 0.3:
        file.copy(other, file, f"{name}_again")
        return
    if kind < 0.4:
        file.move(name, other + "_")
        return
    del file[name]
    if kind < 0.6:
        return
    if kind < 0.7:
        file[name] = h5py.SoftLink(rng.choice(("/" + name, "/nowhere", "/" + other)))
    elif kind < 0.75:
        file[name] = h5py.ExternalLink(rng.choice(("elsewhere.h5", "/dev/zero", "")), "/x")
    elif kind < 0.85:
        file.create_group(name)
    elif kind < 0.95:
        file[name] = rng.choice(VALUES)()
    else:
        file[name] = np.dtype("f8")  # a named type
