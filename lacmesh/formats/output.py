"""Where files go: each is made beside its place and renamed when it is whole, so that nothing is half-written or lost.

Meshes, reports, plots, pictures and pages all go this way.
"""

from __future__ import annotations

import os
import secrets
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import compress
from pathlib import Path

from lacmesh.errors import RequestError, WriteError
from lacmesh.formats.table import suffix_of

#: which permissions new files do without. It can only be asked for by setting it: once, before there are threads
_UMASK = os.umask(0)
os.umask(_UMASK)


def check_place(path: Path, *, force: bool) -> None:
    """Say at once what would stop the writing at the end.

    Raises RequestError where the file exists (and no `force`), WriteError where no file can be made there.
    """
    try:
        if path.exists() and not path.is_file():  # renaming would put a file in place of a device
            raise WriteError(path, "is no file; choose another name")
        if path.exists() and not force:
            raise RequestError(f"{path} exists already; --force replaces it, or choose another name")
        if not path.parent.is_dir():
            raise WriteError(path, f"the folder {path.parent} does not exist")
        folder = Path(os.path.realpath(path)).parent
        if not os.access(folder, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids):
            raise WriteError(path, f"no file may be made in the folder {path.parent}; choose another one")
    except OSError as error:
        raise WriteError(path, f"cannot be written ({error.strerror or error})") from error


@contextmanager
def replacing(*places: Path) -> Iterator[list[Path]]:
    """New files beside `places`, to be filled: at the end they are put on the disk and take their places.

    On any failure, and when the process is interrupted, they are removed, and what was there stays. The last place is
    taken first: the first file may then name the others. Where a new file was taken away again (unlinked), nothing
    shall be: what is at its place is removed. Raises WriteError, which names the first place.
    """
    real = [Path(os.path.realpath(place)) for place in places]  # a link stays one, what it points to is replaced
    # the names are known before the files are there: whenever a signal arrives, what is there can be removed
    token = secrets.token_hex(8)
    beside = [place.with_name(f".{place.stem[:40]}-{token}{suffix_of(place)}") for place in real]
    try:
        for name in beside:
            os.close(os.open(name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
        yield beside
        there = [name.exists() for name in beside]
        for name, place in zip(compress(beside, there), compress(real, there), strict=True):
            _finish(name, place)
        with signals_wait():  # one without the other would be half of it
            for name, place, stays in zip(beside[::-1], real[::-1], there[::-1], strict=True):
                if stays:
                    name.replace(place)
                else:
                    place.unlink(missing_ok=True)
    except WriteError as error:
        if error.path not in map(str, beside):
            raise
        raise WriteError(places[0], error.what) from error
    except OSError as error:
        raise WriteError(places[0], f"cannot be written ({error.strerror or error})") from error
    finally:
        for name in beside:
            with suppress(OSError):
                name.unlink()


def replace_file(path: Path, content: bytes) -> None:
    """Put some content into a file: what was there stays whole until the new is. Raises WriteError."""
    with replacing(path) as (beside,):
        beside.write_bytes(content)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A folder for what a child process is given and gives back. Raises WriteError where it takes no files."""
    try:
        with tempfile.TemporaryDirectory(prefix="lacmesh-") as name:
            yield Path(name)
    except OSError as error:
        raise WriteError(
            tempfile.gettempdir(), f"temporary files cannot be kept there ({error.strerror or error})"
        ) from error


def _finish(beside: Path, path: Path) -> None:
    """Force a new file to the disk, with the permissions that it will need in its place."""
    with beside.open("rb") as file:
        os.fsync(file.fileno())
    beside.chmod(path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_UMASK)


@contextmanager
def signals_wait() -> Iterator[None]:
    """Hold SIGINT and SIGTERM back until the end."""
    if threading.current_thread() is not threading.main_thread():  # signals come up in the main thread only
        yield
        return
    arrived: list[int] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, lambda signum, frame: arrived.append(signum))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for signum in arrived[:1]:
            signal.raise_signal(signum)
