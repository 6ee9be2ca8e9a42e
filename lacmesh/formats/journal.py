"""Write HDF5 files so that they stay valid, even if the disk is full or fails.

Data that HDF5 appends are written to the file at once: nothing in the old part of the file refers to them yet. Changes
of the old part are kept in memory, page by page, until all appended data are on the disk; then they overwrite the old
pages, which needs no new space. A full disk is thus noticed while appending, and the file is truncated to its old
size; of a new file that is nothing. Errors are not passed on to HDF5, which could not close the file then: objects that
are freed later fail again, each with a message on stderr, and the process ends in a segmentation fault (HDF5 1.14).
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import h5py

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
        """Move to a position in the file, as in `io`; HDF5 asks for the end with `whence` 2."""
        self._place = offset + (0, self._place, self._end)[whence]
        return self._place

    def tell(self) -> int:
        """Return the position in the file."""
        return self._place

    def write(self, data: Any) -> int:
        """Write bytes at the position: into memory for the old part of the file, else into the file."""
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
        """Read bytes at the position, changes included; zeros where data could not be written."""
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
        """Set the size that `finish` gives the file."""
        self._end = self._place if size is None else size
        return self._end

    def flush(self) -> None:
        """Do nothing: changes are written by `finish`."""

    def finish(self) -> None:
        """Write all changes into the file. Raises OSError if the disk failed; the file then has its old content."""
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
        """Return a page of the old part of the file, with its changes; the last page ends where that part ends."""
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
def journalled(path: Path, new: h5py.h5p.PropFCID | None = None) -> Iterator[h5py.File]:
    """Open an HDF5 file for changes, of which all or none are in the file at the end; `new`: properties of a new file.

    The file format is held at HDF5 1.10. Raises OSError, after closing the file, if the disk refused data.
    """
    access = h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_libver_bounds(h5py.h5f.LIBVER_EARLIEST, h5py.h5f.LIBVER_V110)
    # an exception must not come up inside a write that HDF5 asked for
    with path.open("r+b" if new is None else "w+b", buffering=0) as file, signals_wait():
        journal = Journal(file)
        access.set_fileobj_driver(h5py.h5fd.fileobj_driver, journal)
        name = os.fsencode(path)
        if new is None:
            opened = h5py.h5f.open(name, h5py.h5f.ACC_RDWR, access)
        else:
            opened = h5py.h5f.create(name, h5py.h5f.ACC_TRUNC, new, access)
        access.set_fapl_sec2()  # a list that outlives Python must not name an object of Python
        with h5py.File(opened) as root:
            yield root
        journal.finish()
