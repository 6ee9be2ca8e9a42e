"""Lock of a folder by one run; the operating system releases it when the run ends, however it ends.

The lock is on a file in the folder, since locks of files work over NFS and on Windows too. The file exists as long as
the run; one that is left by a killed run blocks nobody. On a file system without locks, nothing is locked.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from lacmesh.errors import RequestError

FILE = ".lacsolver.lock"


def check_free(folder: Path) -> None:
    """Raise RequestError if another run has locked a folder, OSError if that cannot be found out."""
    with suppress(FileNotFoundError):
        handle = os.open(folder / FILE, os.O_RDWR)
        try:
            _lock(handle, folder)
        finally:
            os.close(handle)


def hold(folder: Path) -> Callable[[], None]:
    """Lock a folder; return the function that unlocks it. Raises RequestError if another run has locked it; OSError."""
    path = folder / FILE
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(handle, folder)
            if _is(handle, path):  # else the former owner has just removed the file
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
    """Lock a file; raise BlockingIOError (PermissionError on Windows) if another process has locked it."""
    if os.name == "nt":
        import msvcrt

        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _let_go(handle: int, path: Path) -> None:
    """Remove the file while it is still locked, and close it; Windows cannot remove an open file."""
    if os.name == "nt":
        os.close(handle)
    with suppress(OSError):
        path.unlink()
    if os.name != "nt":
        os.close(handle)
