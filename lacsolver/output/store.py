"""Records of arrays in one file, as `numpy.savez` writes it; the types of a record are the schema of its file.

A file has an array for every array of the record, named by its path in it (`restart.step.iterate.q`; a tuple and a
mapping count their members), and as JSON, in the bytes of `tree`, everything else, with the name of each array in its
place. Arrays that several processes share are written, and read, piece after piece: no process has the whole of them.
"""

from __future__ import annotations

import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from lacmesh.formats.output import replacing
from lacsolver.distributed.share import ALONE, Share
from lacsolver.results.whole import Order

_TREE, _ARRAY = "tree", ""
_NONE: Mapping[str, Order] = MappingProxyType({})
#: what reading a damaged file raises
DAMAGE = (
    *(OSError, ValueError, KeyError, TypeError, EOFError, IndexError, AttributeError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)


class _Rows(NamedTuple):
    """An array to be written: its type, its shape, and its rows piece after piece."""

    dtype: np.dtype
    shape: tuple[int, ...]
    pieces: Iterator[NDArray]


def save(path: Path, record: Any, share: Share = ALONE, orders: Mapping[str, Order] = _NONE) -> None:
    """Write a record; an existing file is replaced at the end. All processes of a `share` call this, the first writes.

    `orders`: by the name of an array, that of its rows in the whole model; others are those of the first process.
    Raises WriteError, on all processes.
    """
    arrays: dict[str, NDArray] = {}
    tree = pack(record, arrays)
    rows = {name: _rows_of(values, orders.get(name)) for name, values in arrays.items()}
    failed: Exception | None = None
    if share.rank == 0:
        try:
            _write(path, {_TREE: _rows_of(np.frombuffer(json.dumps(tree).encode(), np.uint8), None), **rows})
        except Exception as error:
            failed = error
    for array in rows.values():  # what other processes give, and what is left after a failure
        for _ in array.pieces:
            pass
    share.agree(failed)


def load(path: Path, kind: Any, part: str = "", empty: Callable[[str], bool] = lambda name: False) -> Any:
    """Return the record of a type that `save` wrote, or a `part` of it. Raises one of DAMAGE.

    `empty`: True for the names of arrays, within the part, whose rows are left in the file.
    """
    with opened(path) as file:
        tree = tree_of(file)
        return unpack(tree[part] if part else tree, kind, _Arrays(file, part, empty))


@contextmanager
def opened(path: Path) -> Iterator[np.lib.npyio.NpzFile]:
    """Open the arrays of a file; it is opened here because numpy does not close a file that it cannot read."""
    with path.open("rb") as raw, np.load(raw, allow_pickle=False) as file:
        yield file


def tree_of(file: Mapping[str, NDArray]) -> Any:
    """Return what a file has beside its arrays: numbers, names, and None."""
    return json.loads(file[_TREE].tobytes())


def rows_in(path: Path, name: str) -> Generator[NDArray, int, None]:
    """Yield rows of an array of a file, one after the other: as many as are sent; the first item is empty.

    Raises ValueError where it has fewer, and one of DAMAGE.
    """
    n = yield np.empty(0)
    with zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as file:
        shape, dtype = _head(file)
        width = int(np.prod(shape[1:], dtype=np.int64)) * dtype.itemsize
        while True:
            data = file.read(n * width)
            if len(data) < n * width:
                raise ValueError(f"{name} has {shape[0]} rows, and the model more")
            n = yield np.frombuffer(data, dtype).reshape(n, *shape[1:])


def pack(value: Any, arrays: dict[str, NDArray], name: str = "") -> Any:
    """Return a record as JSON has it, and add its arrays to `arrays`, whose names stand in their places."""

    def inside(members: Any) -> list[tuple[Any, Any]]:
        return [(key, pack(part, arrays, f"{name}.{place}".lstrip("."))) for place, key, part in members]

    if isinstance(value, np.ndarray):
        arrays[name] = value
        return {_ARRAY: name}
    if isinstance(value, np.generic):
        return value.item()
    if is_dataclass(value) or hasattr(value, "_fields"):
        names = [one.name for one in fields(value)] if is_dataclass(value) else value._fields
        return dict(inside((key, key, getattr(value, key)) for key in names))
    if isinstance(value, Mapping):
        return dict(inside((k, key, part) for k, (key, part) in enumerate(value.items())))
    if isinstance(value, (list, tuple)):
        return [part for _, part in inside((k, k, part) for k, part in enumerate(value))]
    return value


def unpack(tree: Any, kind: Any, arrays: Mapping[str, NDArray]) -> Any:
    """Return the record of a type from what `pack` made of it."""
    if isinstance(tree, dict) and _ARRAY in tree:
        return arrays[tree[_ARRAY]]
    origin, args = get_origin(kind), get_args(kind)
    if type(None) in args:
        return None if tree is None else unpack(tree, next(one for one in args if one is not type(None)), arrays)
    if isinstance(kind, type) and (is_dataclass(kind) or hasattr(kind, "_fields")):
        hints = get_type_hints(kind)
        return kind(**{name: unpack(part, hints[name], arrays) for name, part in tree.items()})
    if isinstance(tree, dict):
        return {name: unpack(part, args[1], arrays) for name, part in tree.items()}
    if origin is tuple:
        kinds = [args[0]] * len(tree) if Ellipsis in args else args
        return tuple(unpack(part, one, arrays) for part, one in zip(tree, kinds, strict=True))
    return tree


class _Arrays(Mapping[str, NDArray]):
    """The arrays of a part of a file by their names within it; those that are to be `empty` are without their rows."""

    def __init__(self, file: np.lib.npyio.NpzFile, part: str, empty: Callable[[str], bool]) -> None:
        self._file, self._part, self._empty = file, part, empty

    def __getitem__(self, name: str) -> NDArray:
        if not self._empty(name.removeprefix(f"{self._part}.")):
            return self._file[name]
        assert self._file.zip is not None
        with self._file.zip.open(f"{name}.npy") as file:
            shape, dtype = _head(file)
        return np.empty((0, *shape[1:]), dtype)

    def __iter__(self) -> Iterator[str]:
        return iter(self._file)

    def __len__(self) -> int:
        return len(self._file)


def _head(file: Any) -> tuple[tuple[int, ...], np.dtype]:
    """Return the shape and the type of the array that a file begins with."""
    npy.read_magic(file)
    shape, _, dtype = npy.read_array_header_1_0(file)
    return shape, dtype


def _rows_of(values: NDArray, order: Order | None) -> _Rows:
    """Return an array, or with an order that of the whole model, of which the `values` of each process are rows."""
    if order is None:
        return _Rows(values.dtype, values.shape, iter([values]))
    return _Rows(values.dtype, (order.n, *values.shape[1:]), order.pieces(values))


def _write(path: Path, arrays: Mapping[str, _Rows]) -> None:
    """Write arrays, piece after piece. Integers are compressed: those of faces and nodes hardly differ by rows."""
    with replacing(path) as (beside,), zipfile.ZipFile(beside, "w") as archive:
        for name, array in arrays.items():
            head = {"descr": npy.dtype_to_descr(array.dtype), "fortran_order": False, "shape": array.shape}
            member = zipfile.ZipInfo(f"{name}.npy")
            member.compress_type = zipfile.ZIP_STORED if array.dtype.kind == "f" else zipfile.ZIP_DEFLATED
            with archive.open(member, "w", force_zip64=True) as file:
                npy.write_array_header_1_0(file, head)
                for piece in array.pieces:
                    file.write(np.ascontiguousarray(piece).tobytes())
