"""HDF5 for MED: checked reading of files that may be damaged, and writing of files that libmed accepts.

Whatever is missing, damaged, of the wrong kind or size is a ReadError that names the place inside the file.
When writing, every group tracks the order in which its links were created, or libmed fails in MEDfamilyCr; attributes
are not tracked, or libmed fails on a group with more than 8; the file format is held at HDF5 1.10.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError, WriteError
from lacmesh.formats.journal import journalled
from lacmesh.formats.slices import RowRange
from lacmesh.mesh import Floats, Ints

#: How a link is called; h5py gives bytes for what is not UTF-8.
Name = str | bytes
#: What h5py raises on a damaged file.
_DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, OverflowError, MemoryError)
_MISSING: Final = object()


def text(name: Any) -> str:
    """A name as MED keeps it: UTF-8 or else latin-1, up to the first NUL, without the blanks that fill it up.

    >>> text(b"SKIN  "), text(b"c" + bytes([0xF4]) + b"t" + bytes([0xE9, 0, 0]))
    ('SKIN', 'côté')
    """
    if isinstance(name, bytes):
        name = name.split(b"\0", 1)[0]
        try:
            name = name.decode("utf-8")
        except UnicodeDecodeError:
            name = name.decode("latin-1")
    return str(name).split("\0", 1)[0].rstrip(" ")


def reason(error: BaseException) -> str:
    """Message of an HDF5 error on one line, without its fixed beginning; the system's message if there is one.

    >>> reason(OSError("Unable to synchronously open file (truncated file: eof = 96, stored_eof = 2048)"))
    'it is cut short: 96 of its 2048 bytes are there'
    >>> reason(RuntimeError("Unable to get group info (addr overflow)"))
    'HDF5: addr overflow'
    """
    if isinstance(error, OSError) and error.strerror and "\n" not in error.strerror and "(" not in error.strerror:
        return error.strerror
    said = " ".join(str(error).strip("'").split()) or type(error).__name__  # a KeyError comes with quotes
    short = re.search(r"truncated file: eof = (\d+).* stored_eof = (\d+)", said)
    if short:
        return f"it is cut short: {short[1]} of its {short[2]} bytes are there"
    if "on disk image buffer" in said:  # asked for, and refused, before any of it is used
        return "HDF5: an object of absurd size"
    bracketed = re.fullmatch(r"[^()]*\((.*)\)", said)
    return f"HDF5: {bracketed[1] if bracketed else said}"


@contextmanager
def opened(path: Path) -> Iterator[Branch]:
    """Open a file for reading and yield its root. Raises ReadError, also for damage found inside the block."""
    try:
        size = path.stat().st_size
        with h5py.File(path, "r") as file:
            yield Branch(path, file, size)
    except (OSError, RuntimeError) as error:
        raise ReadError(path, f"cannot be read ({reason(error)})") from error


@dataclass(frozen=True)
class Branch:
    """A group of a file; every access returns what was asked for or raises ReadError."""

    path: Path
    group: h5py.Group
    file_size: int

    def error(self, message: str, name: Name = "") -> ReadError:
        """A ReadError about `name` in this group, or about the group."""
        place = text(self.group.name or "") + ("/" + text(name) if name else "")
        return ReadError(self.path, message, place.replace("//", "/"))

    @contextmanager
    def _looking_at(self, name: Name) -> Iterator[None]:
        try:
            yield
        except _DAMAGE as error:
            raise self.error(f"cannot be read ({reason(error)})", name) from error

    def names(self) -> list[Name]:
        """The links of the group, in the order of their creation where the file keeps it, else by name."""
        with self._looking_at(""):
            return list(self.group)

    @property
    def ordered(self) -> bool:
        """True if the file keeps the order in which the group's links were created."""
        with self._looking_at(""):
            return bool(self.group.id.get_create_plist().get_link_creation_order())

    def has(self, name: Name) -> bool:
        """True if the group has a link of that name."""
        with self._looking_at(name):
            return name in self.group

    def _open(self, name: Name, kind: type) -> Any:
        with self._looking_at(name):
            link = self.group.get(name, getlink=True)
            if link is None:
                raise self.error("is missing", name)
            if isinstance(link, h5py.ExternalLink):
                raise self.error("points into another file, which is not followed", name)
            member = self.group[name]
            if not isinstance(member, kind):
                raise self.error(f"is a {type(member).__name__.lower()}, expected a {kind.__name__.lower()}", name)
            return member

    def branch(self, name: Name) -> Branch:
        """The group of that name."""
        return Branch(self.path, self._open(name, h5py.Group), self.file_size)

    def branches(self) -> Iterator[tuple[Name, Branch]]:
        """Yield all links with their groups. Raises ReadError for a link that is not to a group."""
        for name in self.names():
            yield name, self.branch(name)

    def has_attribute(self, name: str, *, of: Name = "") -> bool:
        """True if the group, or the dataset `of`, has an attribute of that name."""
        holder = self._holder(of)
        with self._looking_at(f"{text(of)}@{name}"):
            return name in holder.attrs

    def _holder(self, of: Name) -> Any:
        return self._open(of, h5py.Dataset) if of else self.group

    def _attribute(self, name: str, of: Name, default: Any) -> Any:
        holder = self._holder(of)
        with self._looking_at(f"{text(of)}@{name}"):
            if name in holder.attrs:
                return np.asarray(holder.attrs[name])
        if default is _MISSING:
            raise self.error(f"has no attribute {name}", of)
        return None

    def integer(self, name: str, default: Any = _MISSING, *, of: Name = "") -> int:
        """An integer attribute of the group, or of the dataset `of`."""
        value = self._one(name, of, default, "iu", "an integer")
        return default if value is None else int(value)

    def real(self, name: str, default: float) -> float:
        """A real attribute of the group."""
        value = self._one(name, "", default, "iuf", "a number")
        return default if value is None else float(value)

    def string(self, name: str, default: str = "") -> str:
        """A text attribute of the group, without the blanks that fill it up."""
        value = self._one(name, "", default, "SUO", "text")
        return default if value is None else text(value)

    def _one(self, name: str, of: Name, default: Any, kinds: str, what: str) -> Any:
        """The one value of an attribute, None where the default stands for it; `kinds`: of numpy's types."""
        value = self._attribute(name, of, default)
        if value is None:
            return None
        if value.size != 1 or value.dtype.kind not in kinds:
            raise self.error(f"attribute {name} is not {what}", of)
        return value.reshape(-1)[0]

    def check_room(self, n_bytes: int, name: Name = "", packed: bool = True) -> None:
        """Raise ReadError for an array that the file cannot hold: deflate packs 1032:1 at most, MED packs nothing."""
        if n_bytes > (1032 * self.file_size if packed else self.file_size):
            raise self.error(f"declares {n_bytes} bytes, in a file of {self.file_size}", name)

    def _dataset(self, name: Name) -> Any:
        dataset = self._open(name, h5py.Dataset)
        with self._looking_at(name):
            if dataset.external or dataset.is_virtual:
                raise self.error("is kept in another file, which is not followed", name)
            if dataset.shape is None:
                raise self.error("has no values", name)
            self.check_room(dataset.dtype.itemsize * int(dataset.size), name, dataset.chunks is not None)
        return dataset

    def _of_kind(self, name: Name, kinds: str) -> Any:
        dataset = self._dataset(name)
        if dataset.dtype.kind not in kinds:
            raise self.error(f"holds {dataset.dtype}, expected {'integers' if 'f' not in kinds else 'reals'}", name)
        return dataset

    def count(self, name: Name, kinds: str) -> int:
        """Number of values of a dataset of numbers; `kinds`: the letters that numpy has for their kinds."""
        return int(self._of_kind(name, kinds).size)

    def _numbers(self, name: Name, kinds: str, size: int | None, rows: RowRange | None) -> NDArray:
        dataset = self._of_kind(name, kinds)
        with self._looking_at(name):
            if size is not None and dataset.size != size:
                raise self.error(f"holds {dataset.size} values, expected {size}", name)
            if rows is None or rows.n == rows.size or dataset.ndim != 1:
                values = np.asarray(dataset[()]).reshape(-1)
            if rows is not None and rows.n < rows.size:
                flat = dataset if dataset.ndim == 1 else values
                starts = range(0, dataset.size, rows.size)
                values = np.concatenate([flat[start + rows.start : start + rows.stop] for start in starts])
            return values.astype(values.dtype.newbyteorder("="), copy=False)

    def integers(self, name: Name, size: int | None = None, rows: RowRange | None = None) -> Ints:
        """Values of a dataset of integers, (size,), or those in some `rows` of each of its columns."""
        return self._numbers(name, "iu", size, rows)

    def reals(self, name: Name, size: int | None = None, rows: RowRange | None = None) -> Floats:
        """Values of a dataset of reals, (size,), or those in some `rows`."""
        return self._numbers(name, "f", size, rows).astype(float, copy=False)

    def numbers(self, name: Name, size: int | None = None, rows: RowRange | None = None) -> NDArray:
        """Values of a dataset of integers or reals, (size,), or those in some `rows`."""
        return self._numbers(name, "iuf", size, rows)

    def rows(self, name: Name, start: int, stop: int) -> NDArray:
        """Rows `start` to `stop` of a dataset of numbers, (stop - start, ...); no others are read."""
        dataset = self._dataset(name)
        with self._looking_at(name):
            if dataset.dtype.kind not in "biufc":
                raise self.error(f"holds {dataset.dtype}, expected numbers", name)
            if not 0 <= start <= stop <= len(dataset):
                raise self.error(f"has {len(dataset)} rows, expected {max(start, stop)} or more", name)
            return np.asarray(dataset[start:stop])

    def raw(self, name: Name) -> bytes:
        """The bytes of a dataset of characters, however the characters are declared."""
        dataset = self._dataset(name)
        with self._looking_at(name):
            if dataset.dtype.hasobject:
                raise self.error(f"holds {dataset.dtype}, expected characters", name)
            return np.asarray(dataset[()]).tobytes()


@contextmanager
def created(path: Path) -> Iterator[h5py.Group]:
    """Create a file and yield its root. Raises WriteError if it cannot be written."""
    try:
        make = h5py.h5p.create(h5py.h5p.FILE_CREATE)
        make.set_link_creation_order(h5py.h5p.CRT_ORDER_TRACKED | h5py.h5p.CRT_ORDER_INDEXED)
        with journalled(path, make) as file:
            yield file
    except (OSError, RuntimeError) as error:
        raise WriteError(path, f"cannot be written ({reason(error)})") from error


@contextmanager
def changing(path: Path) -> Iterator[h5py.File]:
    """Open a file for changes, of which all or none are in the file at the end. Raises WriteError."""
    try:
        with journalled(path) as root:
            yield root
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise WriteError(path, f"cannot be written ({reason(error)})") from error


def add_group(parent: h5py.Group, name: str, **attributes: int | float | str) -> h5py.Group:
    """Create a group with attributes."""
    make = h5py.h5p.create(h5py.h5p.GROUP_CREATE)
    make.set_link_creation_order(h5py.h5p.CRT_ORDER_TRACKED | h5py.h5p.CRT_ORDER_INDEXED)
    group = h5py.Group(h5py.h5g.create(parent.id, encoded(name), gcpl=make))
    set_attributes(group, **attributes)
    return group


def add_array(parent: h5py.Group, name: str, values: NDArray, **attributes: int) -> None:
    """Create a dataset with attributes."""
    set_attributes(parent.create_dataset(name, data=values), **attributes)


def set_attributes(holder: Any, **attributes: int | float | str) -> None:
    """Set attributes in the types that MED requires: 32-bit integers, 64-bit reals, text of fixed length."""
    for name, value in attributes.items():
        if isinstance(value, str):
            holder.attrs.create(name, np.bytes_(encoded(value)))
        else:
            holder.attrs.create(name, np.int32(value) if isinstance(value, int) else np.float64(value))


def set_mask(group: h5py.Group, name: str, value: int) -> None:
    """Set a 32-bit mask as an attribute: MED requires HDF5's bit field, not an integer."""
    kind = h5py.h5t.STD_B32LE
    attribute = h5py.h5a.create(group.id, name.encode(), kind, h5py.h5s.create(h5py.h5s.SCALAR))
    attribute.write(np.array(value, "<u4"), mtype=kind)


def add_names(parent: h5py.Group, names: list[str], width: int = 80) -> None:
    """Write the dataset NOM of a family's GRO: each name as an array of `width` bytes, padded with NUL."""
    values = np.frombuffer(b"".join(encoded(n).ljust(width, b"\0") for n in names), np.int8).reshape(-1, width)
    kind = h5py.h5t.array_create(h5py.h5t.STD_I8LE, (width,))
    dataset = h5py.h5d.create(parent.id, b"NOM", kind, h5py.h5s.create_simple((len(names),)))
    dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, values.copy(), mtype=kind)


def compact(values: NDArray) -> Ints:
    """Integers in 32 bits where they fit, as most libmed expect, else in 64."""
    fits = not len(values) or (values.min() >= -(2**31) and values.max() < 2**31)
    return values.astype(np.int32 if fits else np.int64, copy=False)


def encoded(name: str) -> bytes:
    """A name as UTF-8."""
    return name.encode("utf-8", "surrogateescape")
