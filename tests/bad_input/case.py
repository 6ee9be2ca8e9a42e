"""One bad input: how it is made, what the command must say of it; and the run that sees what it does say.

A case runs the real command in a folder of its own, with an output that exists already and `--force`: when the command
fails, the old output must be whole and nothing else may lie in the folder. Time and address space are limited.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from lacmesh.cli import main

#: of the processor's time, for one command: ten on a machine of today, and five times that on a slow one, or on one
#: that has to compile kernels, which `make test` has done
SECONDS = 50
#: seconds of the clock for one of the processor: other processes have their turns, and a command may wait in vain
WAITS = 20
BYTES = 1 << 30
PRECIOUS = b"an older result"
CUT = ("cut", "{in}", "--slave", "SLAVE", "-o", "{out}", "--force")
INFO = ("info", "{in}")
CONVERT = ("convert", "{in}", "{out}", "--force")
#: Suffixes of files, by the first word of what formats are called, where they are not that word.
SUFFIXES = {"IGES": ".igs", "any": ".msh"}


@dataclass(frozen=True)
class Case:
    """`make`: the content of the input, or what makes it or puts files into a folder.

    `{in}`, `{out}` in the command stand for the input and the output. `says`: a pattern of words in the sentence, as
    the line of a file. Status 0: the sentence is a warning, and `then` looks at the folder. `nobody`: run as a
    user who owns nothing; `file_size`: no file may grow beyond; `needs`: a package that may be missing, by its marker.
    """

    kind: str
    format: str
    what: str
    make: bytes | Callable[[Path], object]
    status: int = 3
    command: tuple[str, ...] = CUT
    says: str = ""
    file: str = ""
    out: str = "out.msh"
    then: Callable[[Path], object] | None = None
    nobody: bool = False
    file_size: int | None = None
    needs: str = ""

    @property
    def input(self):
        """The name of the input file."""
        word = self.format.split()[0]
        return self.file or "bad" + SUFFIXES.get(word, f".{word.lower()}")

    @property
    def key(self):
        """A name for the case."""
        return f"{self.kind}: {self.format}: {self.what}"


class Outcome(NamedTuple):
    """Outcome of a command: exit status, lines printed on stderr, and processor time (s)."""

    status: int
    lines: list[str]
    seconds: float = 0.0

    @property
    def sentence(self):
        """The error, or the warnings where there is none, without the prefix."""
        said = [line for line in self.lines if line.startswith("lacmesh: error: ")] or self.lines
        return " / ".join(re.sub(r"^lacmesh: (error|warning): ", "", line) for line in said)


class TooSlow(BaseException):
    """The command did not end in time; nothing in it catches this."""


def run(case, folder):
    """Make the input of a case in an empty folder, run the command there, and test all but its words.

    Raises AssertionError where more than one sentence is said, anything in the folder changes on failure, or anything
    stays where temporary files go.
    """
    if case.nobody:  # Python itself may be out of reach for others: what the command imports is there beforehand
        with tempfile.TemporaryDirectory() as first:
            command(made(case, Path(first)), Path(first))
    args = made(case, folder)
    before = listing(folder)
    with tempfile.TemporaryDirectory() as other, temporary_files_in(other):
        outcome = command(args, folder, case.nobody, case.file_size)
        assert not listing(Path(other)), "the command left temporary files"
    assert not re.search("Traceback|internal error", "".join(outcome.lines)), outcome.lines
    assert outcome.seconds < SECONDS
    errors, warned = (
        [line for line in outcome.lines if line.startswith(f"lacmesh: {k}: ")] for k in ("error", "warning")
    )
    assert len(errors) + len(warned) == len(outcome.lines), outcome.lines
    if outcome.status:
        assert len(errors) == 1, outcome.lines
        assert listing(folder) == before, "the command failed and left something, or changed what was there"
    elif case.then is not None:
        case.then(folder)
    return outcome


def made(case, folder):
    """Put the files of a case, and an older output, into an empty folder; return the command."""
    folder.chmod(0o777)  # `nobody` may work here, unless the case says otherwise
    content = case.make(folder) if callable(case.make) else case.make
    if isinstance(content, bytes):
        (folder / case.input).write_bytes(content)
    out = folder / case.out
    if "{out}" in case.command and len(Path(case.out).parts) == 1 and not os.path.lexists(out):
        with contextlib.suppress(OSError):  # a name that is too long, a folder that takes no files
            out.write_bytes(PRECIOUS)
    return [word.replace("{in}", case.input).replace("{out}", case.out) for word in case.command]


@contextlib.contextmanager
def temporary_files_in(folder):
    """Let `tempfile` use this folder."""
    before, tempfile.tempdir = tempfile.tempdir, folder
    try:
        yield
    finally:
        tempfile.tempdir = before


def command(args, folder, as_nobody=False, file_size=None):
    """Run the command in this process, in a folder, with limits of time and memory."""
    said, start = io.StringIO(), time.process_time()
    user = nobody() if as_nobody else contextlib.nullcontext()
    outputs = contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO())
    with contextlib.ExitStack() as stack:
        limits = small_files(file_size), alarm(SECONDS), room(BYTES), warnings.catch_warnings()
        for context in (contextlib.chdir(folder), *outputs, user, *limits):
            stack.enter_context(context)
        warnings.simplefilter("default")  # as in a process of its own: pytest makes errors of numpy's warnings
        status = main(args)
    return Outcome(status, said.getvalue().splitlines(), time.process_time() - start)


@contextlib.contextmanager
def alarm(seconds):
    """Raise TooSlow inside where it takes more of the processor's time, or `WAITS` times as long by the clock."""

    def ring(signum, frame):
        raise TooSlow(f"more than {seconds} s")

    timers = {signal.SIGPROF: (signal.ITIMER_PROF, seconds), signal.SIGALRM: (signal.ITIMER_REAL, WAITS * seconds)}
    before = {number: signal.signal(number, ring) for number in timers}
    for timer, after in timers.values():
        signal.setitimer(timer, after)
    try:
        yield
    finally:
        for timer, _ in timers.values():
            signal.setitimer(timer, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


def room(n_bytes):
    """Limit the memory that this process may still take, in bytes, where the system can (Linux)."""
    taken = Path("/proc/self/statm")
    now = int(taken.read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE") if taken.exists() else 0
    return _limit("RLIMIT_AS", now + n_bytes if now else None)


@contextlib.contextmanager
def small_files(n_bytes):
    """Limit the size of every file in bytes, as if the disk were full; None for no limit.

    Meanwhile this process and those that it starts keep no module that they compile: a part would pass for the whole.
    """
    if n_bytes is None:
        yield
        return
    limit, here = _limit("RLIMIT_FSIZE", n_bytes), patch.object(sys, "dont_write_bytecode", True)
    with limit, here, patch.dict(os.environ, PYTHONDONTWRITEBYTECODE="1"):
        yield


@contextlib.contextmanager
def _limit(what, n_bytes):
    if n_bytes is None:
        yield
        return
    import resource

    kind = getattr(resource, what)
    before = resource.getrlimit(kind)
    resource.setrlimit(kind, (n_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(kind, before)


@contextlib.contextmanager
def nobody():
    """Context in which root acts as a user who owns nothing; other users stay what they are."""
    root = os.geteuid() == 0
    try:
        os.seteuid(65534 if root else os.geteuid())
        yield
    finally:
        os.seteuid(0 if root else os.geteuid())


def listing(folder):
    """Contents of a folder: contents of files, targets of links."""
    found = {}
    for path in sorted(folder.rglob("*")):
        place = f"-> {path.readlink()}" if path.is_symlink() else path.read_bytes() if path.is_file() else "folder"
        found[str(path.relative_to(folder))] = place
    return found
