"""A folder held by one run: the system lets go of it when the run ends, however that ends.

What is locked is a file in the folder, on which locks work over NFS and on Windows too; it is there as long as the run,
and one that a killed run left holds nobody up. Where a file system has no locks, nothing is held.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from lacmesh.errors import RequestError

FILE = ".lacsolver.lock"


def check_free(folder: Path) -> None:
    """Raise RequestError where another run holds a folder, OSError where that cannot be known."""
    with suppress(FileNotFoundError):
        handle = os.open(folder / FILE, os.O_RDWR)
        try:
            _lock(handle, folder)
        finally:
            os.close(handle)


def hold(folder: Path) -> Callable[[], None]:
    """Hold a folder: what lets go of it. Raises RequestError where another run holds it, OSError."""
    path = folder / FILE
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(handle, folder)
            if _is(handle, path):  # else who held it has just removed the file
                return lambda: _let_go(handle, path)
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)


def _is(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False


def _lock(handle: int, folder: Path) -> None:
    try:
        _try(handle)
    except (BlockingIOError, PermissionError) as error:
        raise RequestError(f"another run is writing into {folder}; wait for its end, or name another folder") from error
    except OSError:  # a file system without locks
        return


def _try(handle: int) -> None:
    """Lock a file, or raise BlockingIOError (PermissionError on Windows) where another process has."""
    if os.name == "nt":
        import msvcrt

        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _let_go(handle: int, path: Path) -> None:
    """Remove the file, as long as it is ours, and close it; Windows removes no file that is open."""
    if os.name == "nt":
        os.close(handle)
    with suppress(OSError):
        path.unlink()
    if os.name != "nt":
        os.close(handle)
