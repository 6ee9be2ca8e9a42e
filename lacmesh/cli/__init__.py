"""The command `lacmesh`: signals, errors and exit statuses here; a module for each command beside it.

A command's module has `add(commands)`, which declares its arguments, and `run(args)`; it imports what it needs when it
runs, so that `--help` loads no numpy.
"""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import NoReturn, TextIO

from lacmesh import __version__
from lacmesh.cli.options import EPILOG, written
from lacmesh.errors import GroupNotFoundError, LacmeshError, LacmeshWarning

#: in the order of the help
COMMANDS = ("cut", "check", "quality", "orient", "view", "mesh", "info", "convert", "types")


class Terminated(BaseException):
    """SIGTERM arrived: unwind, so that nothing half-written stays."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    collects = gc.isenabled()
    gc.disable()  # a short life of large arrays and no cycles: collecting would only cost time
    try:
        return _main(argv)
    finally:
        if collects:
            gc.enable()


def _main(argv: Sequence[str] | None) -> int:
    """Let nothing that happens leave the command without a word and a status."""
    if sys.stdout is None:  # closed by who called us
        sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115
    elif isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name may hold what the terminal cannot show
    keep_memory()
    args = argparse.Namespace()
    with signals_heard():
        try:
            _parser().parse_args(argv, args)
            return _run(args)
        except KeyboardInterrupt:
            return _fail(f"interrupted; {written(args)}", 130)
        except Terminated:
            return _fail(f"terminated; {written(args)}", 143)


def _run(args: argparse.Namespace) -> int:
    """Run what was asked for, whatever becomes of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", LacmeshWarning)
        warnings.showwarning = _show_warning
        try:
            args.run(args)
            sys.stdout.flush()
        except LacmeshError as error:
            return _fail(_with_file(error, args), error.status)
        except BrokenPipeError:  # the reader of our output went away, as `head` does
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except OSError as error:  # files of ours say so themselves: this is what we print to
            return _fail(f"the terminal or file that is printed to fails ({error.strerror or error})", 3)
        except MemoryError:
            return _fail("there is not enough memory for this mesh", 1)
        except Exception as error:  # a fault of ours: one line, and the traceback on request
            if args.verbose:
                raise
            message = f"internal error ({type(error).__name__}: {error}); --verbose shows where; please report it"
            return _fail(message, 1)
    return 0


@contextmanager
def signals_heard() -> Iterator[None]:
    """Let the first SIGINT or SIGTERM unwind, and those that follow wait for the end of that."""
    if threading.current_thread() is not threading.main_thread():  # only there may handlers be set
        yield
        return
    before = {number: signal.signal(number, _stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)  # None: set by something that is not Python


def _stop(signum: int, frame: object) -> NoReturn:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt if signum == signal.SIGINT else Terminated


def _with_file(error: LacmeshError, args: argparse.Namespace) -> str:
    """What an error says; where it is about the mesh and does not name the file, with the file before it."""
    message, source = str(error), getattr(args, "input", None)
    about_mesh = error.status == 1 or isinstance(error, GroupNotFoundError)
    return f"{source}: {message}" if about_mesh and source and source not in message else message


def keep_memory() -> None:
    """Let glibc keep what is freed for the next array: new pages cost a tenth of the time on a mesh of 1e6 cells."""
    if sys.platform == "linux":
        import ctypes

        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
        if mallopt is not None:
            mallopt(-3, 1 << 30)  # M_MMAP_THRESHOLD
            mallopt(-1, (1 << 31) - 1)  # M_TRIM_THRESHOLD
            mallopt(-2, 1 << 26)  # M_TOP_PAD


def _fail(message: str, status: int) -> int:
    with suppress(OSError):  # nobody listens
        print(f"lacmesh: error: {on_one_line(message)}", file=sys.stderr)
    return status


def on_one_line(message: str) -> str:
    r"""Names come from files: no line ends, no commands to the terminal.

    >>> on_one_line("group 'a" + chr(10) + chr(27) + "é'")
    "group 'a\\n\\x1bé'"
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in message)


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, as all errors are."""

    def error(self, message: str) -> NoReturn:
        self.exit(_fail(f"{message}; see {self.prog} --help", 2))


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    if issubclass(category, LacmeshWarning):
        print(f"lacmesh: warning: {on_one_line(str(message))}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="lacmesh",
        description="Cut meshes for Local Average Contact: each face of the slave skin becomes a macro-element that "
        "owns a displacement degree of freedom.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"lacmesh {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        import_module(f"lacmesh.cli.{name}").add(commands)
    return parser
