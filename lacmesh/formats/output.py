"""Writing of files: each is made beside its place and renamed when complete, so that none is half-written or lost.

Meshes, reports, plots, pictures and pages are all written this way.
"""

from __future__ import annotations

import os
import platform
import re
import secrets
import signal
import tempfile
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lacmesh.errors import RequestError, WriteError, writing
from lacmesh.formats.registry import suffix_of

#: which permissions new files do without. It can only be asked for by setting it: once, before there are threads
_UMASK = os.umask(0)
os.umask(_UMASK)
#: this machine, in the names of new files
_HOST = f"{zlib.crc32(platform.node().encode(errors='replace')):08x}"


def check_place(path: Path, *, force: bool) -> None:
    """Check early that a file can be written, and remove what killed processes left of the same file.

    Raises RequestError where the file exists (and no `force`), WriteError where no file can be made there.
    """
    with writing(path):
        if path.exists() and not path.is_file():  # renaming would put a file in place of a device
            raise WriteError(path, "is no file; choose another name")
        if path.exists() and not force:
            raise RequestError(f"{path} exists already; --force replaces it, or choose another name")
        if not path.parent.is_dir():
            raise WriteError(path, f"the folder {path.parent} does not exist")
        folder = Path(os.path.realpath(path)).parent
        if not os.access(folder, os.W_OK | os.X_OK, effective_ids=os.access in os.supports_effective_ids):
            raise WriteError(path, f"no file may be made in the folder {path.parent}; choose another one")
        place = Path(os.path.realpath(path))
        new = re.compile(re.escape(_hidden(place)) + "[0-9a-f]{24}" + re.escape(suffix_of(place)))
        with suppress(OSError):  # a folder that may not be listed
            there = [beside for beside in place.parent.iterdir() if new.fullmatch(beside.name)]
            for beside in filter(is_abandoned, there):
                beside.unlink()


@contextmanager
def replacing(*places: Path) -> Iterator[list[Path]]:
    """Yield new files beside `places`, to be filled; at the end they are forced to the disk and take their places.

    On any failure, and when the process is interrupted, they are removed, and the old files stay. The last place is
    replaced first, so that the first file may name the others. Raises WriteError, which names the first place.
    """
    real = [Path(os.path.realpath(place)) for place in places]  # a link stays one, what it points to is replaced
    # the names are known before the files are there: whenever a signal arrives, what is there can be removed
    token = f"{_HOST}{os.getpid():08x}{secrets.token_hex(4)}"
    beside = [place.with_name(f"{_hidden(place)}{token}{suffix_of(place)}") for place in real]
    try:
        for name in beside:
            os.close(os.open(name, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
        yield beside
        for name, place in zip(beside, real, strict=True):
            with name.open("rb") as file:
                os.fsync(file.fileno())
            name.chmod(place.stat().st_mode & 0o777 if place.exists() else 0o666 & ~_UMASK)
        with signals_wait():  # one without the other would be half of it
            for name, place in zip(beside[::-1], real[::-1], strict=True):
                name.replace(place)
    except WriteError as error:
        if error.path not in map(str, beside):
            raise
        raise WriteError(places[0], error.reason) from error
    except OSError as error:
        raise WriteError(places[0], f"cannot be written ({error.strerror or error})") from error
    finally:
        for name in beside:
            with suppress(OSError):
                name.unlink()


def is_abandoned(beside: Path) -> bool:
    """True if the process that was filling a new file beside its place is gone, judged by the file's name.

    Files of processes on other machines, of an older lacmesh, or with this process's own number count as in use.
    """
    marks = re.search(r"-([0-9a-f]{8})([0-9a-f]{8})[0-9a-f]{8}\.[^-]*$", beside.name)
    if marks is None or marks[1] != _HOST or os.name != "posix":
        return False
    number = int(marks[2], 16)
    if number == os.getpid():
        return False
    try:
        os.kill(number, 0)
    except (ProcessLookupError, OverflowError):
        return True
    except OSError:  # it is another user's
        return False
    return False


def _hidden(place: Path) -> str:
    """Beginning of the name of the new file beside a place; a token with the machine and the process follows."""
    return f".{place.stem[:40]}-"


def replace_file(path: Path, content: bytes) -> None:
    """Write content to a file; the old file stays whole until the new one is complete. Raises WriteError."""
    with replacing(path) as (beside,):
        beside.write_bytes(content)


def readable(name: str) -> str:
    r"""Name of a file as text that pages and pictures can hold: bytes that are not UTF-8 become escapes.

    >>> readable("bad\udcff.msh")
    'bad\\udcff.msh'
    """
    return name.encode(errors="backslashreplace").decode()


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a folder to exchange files with gmsh. Raises WriteError if it takes no files."""
    try:
        with tempfile.TemporaryDirectory(prefix="lacmesh-") as name:
            yield Path(name)
    except OSError as error:
        raise WriteError(
            tempfile.gettempdir(), f"temporary files cannot be kept there ({error.strerror or error})"
        ) from error


@contextmanager
def signals_wait() -> Iterator[None]:
    """Defer SIGINT and SIGTERM to the end of the block."""
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
