"""HDF5 for MED and XDMF: checked reading of files that may be damaged, and files built in memory.

What is missing, of the wrong kind or size is a ReadError that names the place inside the file; what HDF5 cannot read is
one with HDF5's words. A file is built as an image in memory and written at once, so that a full disk is an ordinary
error. libmed accepts our files: every group tracks the order in which its links were created, or libmed fails in
MEDfamilyCr; attributes are not tracked, or libmed fails on a group with more than 8; the format is that of HDF5 1.10.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from lacmesh.errors import ReadError, WriteError
from lacmesh.mesh import Ints

#: name of a link; h5py gives bytes for what is not UTF-8
Name = str | bytes
#: what h5py raises on a damaged file
_DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, IndexError, OverflowError, MemoryError)
_KINDS = {int: ("iu", "an integer"), float: ("iuf", "a number"), str: ("SUO", "text")}


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
    message = " ".join(str(error).strip("'").split()) or type(error).__name__  # a KeyError comes with quotes
    short = re.search(r"truncated file: eof = (\d+).* stored_eof = (\d+)", message)
    if short:
        return f"it is cut short: {short[1]} of its {short[2]} bytes are there"
    if "on disk image buffer" in message:  # HDF5 refuses to allocate it
        return "HDF5: an object of absurd size"
    bracketed = re.fullmatch(r"[^()]*\((.*)\)", message)
    return f"HDF5: {(bracketed and bracketed[1]) or message}"


# ---- reading


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Open a file for reading. Raises ReadError, also for what HDF5 finds wrong inside the block."""
    try:
        path.stat()  # its error has the system's words
        with h5py.File(path, "r") as file:
            yield file
    except _DAMAGE as error:
        raise ReadError(path, f"cannot be read ({reason(error)})") from error


def error_at(holder: Any, message: str, name: Name = "") -> ReadError:
    """Return a ReadError about a group or dataset, or about what has that name in it."""
    place = text(holder.name or "") + ("/" + text(name) if name else "")
    return ReadError(holder.file.filename, message, place.replace("//", "/"))


def member(group: h5py.Group, name: Name, kind: type = h5py.Group) -> Any:
    """Return the group, or dataset, of that name in a group. Raises ReadError."""
    link = group.get(name, getlink=True)
    if link is None:
        raise error_at(group, "is missing", name)
    if isinstance(link, h5py.ExternalLink):
        raise error_at(group, "points into another file, which is not followed", name)
    one = group[name]
    if not isinstance(one, kind):
        raise error_at(group, f"is a {type(one).__name__.lower()}, expected a {kind.__name__.lower()}", name)
    return one


def groups_in(group: h5py.Group) -> list[tuple[Name, h5py.Group]]:
    """Return the groups in a group with their names, in the order of the file. Raises ReadError."""
    return [(name, member(group, name)) for name in group]


def values(group: h5py.Group, name: Name, kinds: str = "iuf", size: int | None = None) -> NDArray:
    """Return the values of a dataset, (size,) if that is given; `kinds`: as of `dataset`. Raises ReadError."""
    data = dataset(group, name, kinds)
    if size is not None and data.size != size:
        raise error_at(group, f"holds {data.size} values, expected {size}", name)
    read = np.asarray(data[()])
    return read.astype(read.dtype.newbyteorder("="), copy=False).reshape(-1)


def dataset(group: h5py.Group, name: Name, kinds: str) -> h5py.Dataset:
    """Return a dataset whose values can be read; `kinds`: the letters of numpy's types that they may have.

    Raises ReadError, also for an array that the file cannot hold: deflate packs 1032:1 at most.
    """
    data = member(group, name, h5py.Dataset)
    if data.external or data.is_virtual:
        raise error_at(group, "is kept in another file, which is not followed", name)
    if data.shape is None:
        raise error_at(group, "has no values", name)
    if data.dtype.kind not in kinds:
        expected = "integers" if kinds == "iu" else "reals" if kinds == "f" else "numbers"
        raise error_at(group, f"holds {data.dtype}, expected {expected}", name)
    check_room(group, data.dtype.itemsize * int(data.size), name, packed=data.chunks is not None)
    return data


def check_room(group: h5py.Group, n_bytes: int, name: Name = "", packed: bool = True) -> None:
    """Raise ReadError for an array of more bytes than the file can hold, `packed` or as they are."""
    size = group.file.id.get_filesize()
    if n_bytes > (1032 * size if packed else size):
        raise error_at(group, f"declares {n_bytes} bytes, in a file of {size}", name)


def raw(group: h5py.Group, name: Name) -> bytes:
    """Return the bytes of a dataset of characters, in whatever way the characters are declared. Raises ReadError."""
    return values(group, name, "biufcSV").tobytes()


def attribute(holder: Any, name: str, kind: type, default: Any = ...) -> Any:
    """Return an attribute as an int, float or str, or the default where there is none. Raises ReadError."""
    if name not in holder.attrs:
        if default is ...:
            raise error_at(holder, f"has no attribute {name}")
        return default
    value, (letters, what) = np.asarray(holder.attrs[name]), _KINDS[kind]
    if value.size != 1 or value.dtype.kind not in letters:
        raise error_at(holder, f"attribute {name} is not {what}")
    one = value.reshape(-1)[0]
    return text(one) if kind is str else kind(one)


# ---- writing


@contextmanager
def image(path: Path, old: Path | None = None) -> Iterator[h5py.File]:
    """Yield a file in memory, new or with the content of an `old` one; at the end it is written to a path at once.

    Raises OSError of the system where the disk refuses it, WriteError for what HDF5 refuses.
    """
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_libver_bounds(h5py.h5f.LIBVER_EARLIEST, h5py.h5f.LIBVER_V110)
    try:
        memory = io.BytesIO(b"" if old is None else old.read_bytes())
        access.set_fileobj_driver(h5py.h5fd.fileobj_driver, memory)
        if old is None:
            handle = h5py.h5f.create(os.fsencode(path), h5py.h5f.ACC_TRUNC, _tracked(h5py.h5p.FILE_CREATE), access)
        else:
            handle = h5py.h5f.open(os.fsencode(old), h5py.h5f.ACC_RDWR, access)
        access.set_fapl_sec2()  # a list that outlives Python must not name an object of Python
        with h5py.File(handle) as file:
            yield file
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise WriteError(path, f"cannot be written ({reason(error)})") from error
    path.write_bytes(memory.getbuffer())


def _tracked(kind: Any) -> Any:
    """Properties of a new group or file that tracks the order in which its links are created."""
    properties = h5py.h5p.create(kind)
    properties.set_link_creation_order(h5py.h5p.CRT_ORDER_TRACKED | h5py.h5p.CRT_ORDER_INDEXED)
    return properties


def add_group(parent: h5py.Group, name: str, **attributes: int | float | str) -> h5py.Group:
    """Create a group with attributes."""
    group = h5py.Group(h5py.h5g.create(parent.id, encoded(name), gcpl=_tracked(h5py.h5p.GROUP_CREATE)))
    set_attributes(group, **attributes)
    return group


def make_room(group: h5py.Group, n_bytes: int = 2048) -> None:
    """Make the header of a group larger: HDF5 else moves links in it, and libmed reads the first eight out of order."""
    group.attrs.create("ROOM", np.bytes_(b" " * n_bytes))
    del group.attrs["ROOM"]


def add_array(parent: h5py.Group, name: str, array: NDArray, **attributes: int) -> None:
    """Create a dataset with attributes."""
    set_attributes(parent.create_dataset(name, data=array), **attributes)


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
    attribute_of = h5py.h5a.create(group.id, name.encode(), kind, h5py.h5s.create(h5py.h5s.SCALAR))
    attribute_of.write(np.array(value, "<u4"), mtype=kind)


def compact(array: NDArray) -> Ints:
    """Integers in 32 bits where they fit, as most libmed expect, else in 64."""
    fits = not len(array) or (array.min() >= -(2**31) and array.max() < 2**31)
    return array.astype(np.int32 if fits else np.int64, copy=False)


def encoded(name: str) -> bytes:
    """A name as UTF-8."""
    return name.encode("utf-8", "surrogateescape")
