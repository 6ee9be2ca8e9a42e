"""Changing an HDF5 file so that it is whole before and after, whatever the disk says.

What HDF5 appends goes to the file at once: as long as its beginning says nothing of it, nobody looks there. What it
changes of that beginning is kept aside, page by page, until all that is new is on the disk; then it is written over the
old, where there is room for it. A disk that is full is met in the first part, and the file is cut back to what it was.
HDF5 is told of no error: it could not close the file (HDF5 1.14).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import h5py

from lacmesh.errors import WriteError
from lacmesh.formats.med.hdf5 import reason
from lacmesh.formats.output import signals_wait

_PAGE = 4096


class Journal:
    """A file for h5py's driver of Python objects. `failed`: the first error of the disk."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._old = self._end = file.seek(0, os.SEEK_END)
        self._pages: dict[int, bytearray] = {}
        self._place = 0
        self.failed: OSError | None = None

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place in the file; HDF5 asks for the end with 2."""
        self._place = offset + (0, self._place, self._end)[whence]
        return self._place

    def tell(self) -> int:
        """The place reached."""
        return self._place

    def write(self, data: Any) -> int:
        """Take bytes at the place reached: aside where the file has others, else into the file."""
        rest = memoryview(data).cast("B")
        while len(rest) and self._place < self._old:
            page, at = divmod(self._place, _PAGE)
            kept = self._page(page)
            n = min(len(rest), len(kept) - at)
            kept[at : at + n] = rest[:n]
            rest = rest[n:]
            self._place += n
        self._append(rest)
        self._place += len(rest)
        self._end = max(self._end, self._place)
        return len(data)

    def readinto(self, data: Any) -> int:
        """Give back what is there, or was written; zeros where it could not be kept."""
        room = memoryview(data).cast("B")
        start, stop = self._place, self._place + len(room)
        self._file.seek(start)
        n = self._file.readinto(room) or 0  # type: ignore[attr-defined]
        room[n:] = bytes(len(room) - n)
        for page in range(start // _PAGE, -(-min(stop, self._old) // _PAGE)):
            if page in self._pages:
                lo, hi = max(start, page * _PAGE), min(stop, page * _PAGE + len(self._pages[page]))
                if lo < hi:
                    room[lo - start : hi - start] = self._pages[page][lo - page * _PAGE : hi - page * _PAGE]
        self._place = stop
        return len(room)

    def truncate(self, size: int | None = None) -> int:
        """Make the file end at a place, once all is done."""
        self._end = self._place if size is None else size
        return self._end

    def flush(self) -> None:
        """Nothing is put in its place before `finish`."""

    def finish(self) -> None:
        """Put everything in its place. Raises OSError where the disk did not take all; the file is then as it was."""
        try:
            if self.failed is not None:
                raise self.failed
            self._file.truncate(max(self._old, self._end))
            os.fsync(self._file.fileno())
        except OSError:
            self._file.truncate(self._old)
            raise
        for page in sorted(self._pages):
            self._file.seek(page * _PAGE)
            self._file.write(self._pages[page])
        self._file.truncate(self._end)
        os.fsync(self._file.fileno())

    def _page(self, page: int) -> bytearray:
        """A page of what the file held, as it is to be; it ends where that does."""
        if page not in self._pages:
            self._file.seek(page * _PAGE)
            self._pages[page] = bytearray(self._file.read(min(_PAGE, self._old - page * _PAGE)))
        return self._pages[page]

    def _append(self, rest: memoryview) -> None:
        if self.failed is not None:
            return
        try:
            self._file.seek(self._place)
            while len(rest):
                rest = rest[self._file.write(rest) :]
        except OSError as error:  # without its traceback, which would keep HDF5's memory in use
            self.failed = OSError(error.errno, error.strerror)


@contextmanager
def changing(path: Path) -> Iterator[h5py.File]:
    """An HDF5 file, to be changed: all that is done inside, or nothing, is in it at the end. Raises WriteError."""
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_libver_bounds(h5py.h5f.LIBVER_EARLIEST, h5py.h5f.LIBVER_V110)
    try:
        # an exception must not come up inside a write that HDF5 asked for
        with path.open("r+b", buffering=0) as file, signals_wait():
            journal = Journal(file)
            access.set_fileobj_driver(h5py.h5fd.fileobj_driver, journal)
            opened = h5py.h5f.open(os.fsencode(path), h5py.h5f.ACC_RDWR, access)
            access.set_fapl_sec2()  # a list that outlives Python must not name an object of Python
            with h5py.File(opened) as root:
                yield root
            journal.finish()
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        raise WriteError(path, f"cannot be written ({reason(error)})") from error
