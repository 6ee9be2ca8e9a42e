"""File object that HDF5 writes to, and which hides disk errors from it: HDF5 does not survive a full disk.

After a failed write HDF5 cannot close its file; objects that are freed later fail again, each with a message on stderr,
and the process ends in a segmentation fault (HDF5 1.14). The sink accepts all data, and reports at the end that it
could not keep them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from lacmesh.formats.output import signals_wait


class Sink:
    """File for h5py's driver of Python file objects; `failed` is the first error of the disk."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("w+b", buffering=0)
        self.failed: OSError | None = None
        self._place = self._end = 0

    def seek(self, offset: int, whence: int = 0) -> int:
        """Set the position in the file and return it; HDF5 asks for the end with `whence` 2."""
        self._place = offset + (0, self._place, self._end)[whence]
        return self._place

    def tell(self) -> int:
        """Return the position in the file."""
        return self._place

    def write(self, data: Any) -> int:
        """Write bytes at the current position, unless the disk has failed; return their number in any case."""
        rest = memoryview(data).cast("B")
        self._place += len(rest)
        self._end = max(self._end, self._place)
        if self.failed is None:
            try:
                self.file.seek(self._place - len(rest))
                while len(rest):
                    rest = rest[self.file.write(rest) :]
            except OSError as error:
                self._fail(error)
        return len(data)

    def readinto(self, data: Any) -> int:
        """Read bytes back from the current position; those that could not be kept are zeros."""
        room = memoryview(data).cast("B")
        self.file.seek(self._place)
        n = self.file.readinto(room) or 0
        room[n:] = bytes(len(room) - n)
        self._place += len(room)
        return len(room)

    def truncate(self, size: int | None = None) -> int:
        """Set the end of the file, by default to the current position."""
        self._end = self._place if size is None else size
        try:
            self.file.truncate(self._end)
        except OSError as error:
            self._fail(error)
        return self._end

    def _fail(self, error: OSError) -> None:
        """Keep the first error without its traceback, which would keep HDF5's memory in use too long."""
        self.failed = self.failed or OSError(error.errno, error.strerror)

    def flush(self) -> None:
        """Do nothing: the file is not buffered."""


@contextmanager
def written(path: Path, access: h5py.h5p.PropFAID, make: h5py.h5p.PropFCID) -> Iterator[h5py.File]:
    """Open a new HDF5 file with these property lists. Raises OSError after closing it if the disk refused data."""
    sink = Sink(path)
    access.set_fileobj_driver(h5py.h5fd.fileobj_driver, sink)
    # an exception must not come up inside a write that HDF5 asked for
    with sink.file, signals_wait():
        opened = h5py.h5f.create(os.fsencode(path), h5py.h5f.ACC_TRUNC, make, access)
        access.set_fapl_sec2()  # a list that outlives Python must not name an object of Python
        with h5py.File(opened) as file:
            yield file
        if sink.failed is not None:
            raise sink.failed
