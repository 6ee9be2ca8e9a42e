"""What HDF5 writes to: a file of ours, since a disk that is full would leave HDF5 in pieces.

Where a write fails HDF5 cannot close its file; objects that are freed later fail again, each with a word on stderr, and
the process ends in a segmentation fault (HDF5 1.14). The sink takes all that comes, and says at the end that it could
not keep it.
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
    """A file for h5py's driver of Python objects; `failed` is the first error of the disk."""

    def __init__(self, path: Path) -> None:
        self.file = path.open("w+b", buffering=0)
        self.failed: OSError | None = None
        self._place = self._end = 0

    def seek(self, offset: int, whence: int = 0) -> int:
        """Go to a place in the file; HDF5 asks for the end with 2."""
        self._place = offset + (0, self._place, self._end)[whence]
        return self._place

    def tell(self) -> int:
        """The place reached."""
        return self._place

    def write(self, data: Any) -> int:
        """Keep bytes at the place reached, as long as the disk takes them."""
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
        """Give back what was written; zeros where it could not be kept."""
        room = memoryview(data).cast("B")
        self.file.seek(self._place)
        n = self.file.readinto(room) or 0
        room[n:] = bytes(len(room) - n)
        self._place += len(room)
        return len(room)

    def truncate(self, size: int | None = None) -> int:
        """Make the file end at a place."""
        self._end = self._place if size is None else size
        try:
            self.file.truncate(self._end)
        except OSError as error:
            self._fail(error)
        return self._end

    def _fail(self, error: OSError) -> None:
        """Note an error, and not its traceback: that would keep HDF5's memory in use beyond its time."""
        self.failed = self.failed or OSError(error.errno, error.strerror)

    def flush(self) -> None:
        """Nothing is held back."""


@contextmanager
def written(path: Path, access: h5py.h5p.PropFAID, make: h5py.h5p.PropFCID) -> Iterator[h5py.File]:
    """A new file with these property lists. Raises OSError once it is closed, where the disk did not take all."""
    sink = Sink(path)
    access.set_fileobj_driver(h5py.h5fd.fileobj_driver, sink)
    # an exception must not come up inside a write that HDF5 asked for
    with sink.file, signals_wait():
        made = h5py.h5f.create(os.fsencode(path), h5py.h5f.ACC_TRUNC, make, access)
        access.set_fapl_sec2()  # a list that outlives Python must not name an object of Python
        with h5py.File(made) as file:
            yield file
        if sink.failed is not None:
            raise sink.failed
