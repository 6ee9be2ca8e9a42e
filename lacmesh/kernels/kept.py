"""Where compiled kernels are kept on the disk, as files that only `compiled` understands.

They are read from the package's own folder, where `lacmesh compile` puts them for all users of an installation, and
from the user's cache folder; written to the first of both that can be written. `NUMBA_CACHE_DIR` names another folder
in place of both.
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
    """Where to look, the first to write to as well, if it can be written."""
    mine = hashlib.sha256(str(_PACKAGE).encode()).hexdigest()[:16]  # beside those of other installations
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return (Path(given) / f"lacmesh-{mine}",)
    with suppress(RuntimeError):  # nobody knows where this user is at home
        return (_PACKAGE / "__pycache__", _user() / f"lacmesh-{mine}")
    return (_PACKAGE / "__pycache__",)


def writable() -> Path | None:
    """The first folder that can be written, made if it is not there; None where there is none."""
    for folder in folders():
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            return folder
    return None


def has(key: str) -> bool:
    """Whether something is kept under a name that starts with `key`."""
    return any(name.startswith(key + ".") for name in _names())


def read(name: str) -> bytes | None:
    """What is kept under a name."""
    for folder in folders():
        with suppress(OSError):
            return (folder / (name + _SUFFIX)).read_bytes()
    return None


def save(key: str, name: str, data: bytes) -> None:
    """Keep some bytes under a name that starts with `key`, and nothing that an older source left; if it can be."""
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
    """All of a file or nothing, whoever else writes it at the same time."""
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
    """All that was kept when this process first asked."""
    found: set[str] = set()
    for folder in folders():
        with suppress(OSError):
            found |= {path.name for path in folder.iterdir() if path.suffix == _SUFFIX}
    return frozenset(found)


def _user() -> Path:
    """The user's cache folder, as the system has it. Raises RuntimeError where the user has no home."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local")
    if sys.platform == "darwin":
        return Path.home() / "Library/Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
