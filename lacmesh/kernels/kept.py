"""Disk cache of compiled kernels, as files that only `compiled` understands.

They are read from the package's own folder, where `lacmesh compile` puts them for all users of an installation, and
from the user's cache folder; they are written to the first of the two that is writable. `NUMBA_CACHE_DIR` names another
folder in place of both.
"""

from __future__ import annotations

import functools
import hashlib
import os
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

_SUFFIX = ".nbc"
_PACKAGE = Path(__file__).parent


@functools.cache
def folders() -> tuple[Path, ...]:
    """Return the folders to search, in order; the first writable one is written to."""
    mine = hashlib.sha256(str(_PACKAGE).encode()).hexdigest()[:16]  # beside those of other installations
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return (Path(given) / f"lacmesh-{mine}",)
    with suppress(RuntimeError):  # nobody knows where this user is at home
        return (_PACKAGE / "__pycache__", _user() / f"lacmesh-{mine}")
    return (_PACKAGE / "__pycache__",)


def writable() -> Path | None:
    """Return the first writable folder, created if necessary; None if there is none."""
    for folder in folders():
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            return folder
    return None


def has(key: str) -> bool:
    """True if there is a cached file with a name that starts with `key`."""
    return any(name.startswith(key + ".") for name in _names())


def read(name: str) -> bytes | None:
    """Read the cached bytes of a name; None if there are none."""
    for folder in folders():
        with suppress(OSError):
            return (folder / (name + _SUFFIX)).read_bytes()
    return None


def save(key: str, name: str, data: bytes) -> None:
    """Store bytes under a name that starts with `key`, and remove files of older sources, if a folder is writable."""
    for folder in folders():
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            _write(folder / (name + _SUFFIX), data)
            title = key.rpartition(".")[0] + "."
            for old in folder.iterdir():
                if old.name.startswith(title) and not old.name.startswith(key) and old.suffix == _SUFFIX:
                    old.unlink(missing_ok=True)
            return


def _write(path: Path, data: bytes) -> None:
    """Write a file atomically, also if other processes write it at the same time."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=_SUFFIX)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


@functools.cache
def _names() -> frozenset[str]:
    """Names of the cached files at the time of the first call in this process."""
    names: set[str] = set()
    for folder in folders():
        with suppress(OSError):
            names |= {path.name for path in folder.iterdir() if path.suffix == _SUFFIX}
    return frozenset(names)


def _user() -> Path:
    """Return the user's cache folder by the conventions of the system. Raises RuntimeError without a home folder."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local")
    if sys.platform == "darwin":
        return Path.home() / "Library/Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
