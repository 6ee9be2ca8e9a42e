"""A command of the project (`lacmesh`, `lacsolver`): its signals, errors and exit statuses.

A program has a module for each of its commands, with `add(commands)`, which declares its arguments, and `run(args)`; it
imports what it needs when it runs, so that `--help` loads no numpy. A command that is interrupted says what it leaves:
it puts a function that tells into `args.left` (`options.left_at`).
"""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from io import TextIOWrapper
from keyword import iskeyword
from pathlib import Path
from shlex import quote
from typing import Any, NoReturn, TextIO

from lacmesh import __version__
from lacmesh.errors import LacmeshError, LacmeshWarning


class Terminated(BaseException):
    """SIGTERM arrived: unwind, so that nothing half-written stays."""


#: errors that are no fault of ours
EXPECTED = (LacmeshError, OSError, MemoryError)
#: objects made and not yet freed, beyond which the collector of cycles looks at them; what a command imports is half
SELDOM = 200_000
#: colours of a terminal (ECMA-48)
RED, YELLOW = "31", "33"


@dataclass(frozen=True)
class Program:
    """A program called `name`; `commands`, in the order of the help, are modules of `package` (`import_` for
    `import`, which no module can be called).

    `error_lines`: gives the lines of an error message; `too_large`: message for lack of memory. `of_file`: the command
    to name where a file stands in the place of one. `collects`: whether the collector of cycles runs.
    """

    name: str
    package: str
    description: str
    epilog: str
    commands: tuple[str, ...]
    error_lines: Callable[[LacmeshError, argparse.Namespace], Sequence[str]]
    too_large: str
    of_file: str = ""
    collects: bool = True

    def main(self, argv: Sequence[str] | None = None) -> int:
        """Run the program and return its exit status; every failure ends in a message and a status."""
        before, often = gc.isenabled(), gc.get_threshold()
        gc.set_threshold(SELDOM)
        (gc.enable if self.collects else gc.disable)()
        try:
            return self._main(argv)
        finally:
            gc.set_threshold(*often)
            (gc.enable if before else gc.disable)()

    @property
    def parser(self) -> argparse.ArgumentParser:
        """Parser of the arguments of all commands."""
        return self._parser(self.commands)

    @cache  # noqa: B019 - programs are few and stay; a process that runs several commands builds a parser once
    def _parser(self, commands: tuple[str, ...]) -> argparse.ArgumentParser:
        """Parser of the arguments of some commands: to declare those of all takes a tenth of a start."""
        parser = _Parser(
            prog=self.name,
            description=self.description,
            epilog=self.epilog,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        parser.add_argument("--version", action="version", version=f"{self.name} {__version__}")
        subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
        for name in commands:
            module = f"{name}_" if iskeyword(name) else name
            import_module(f"{self.package}.{module}").add(subparsers)
        return parser

    def _main(self, argv: Sequence[str] | None) -> int:
        _open_streams()
        _keep_memory()
        args, argv = argparse.Namespace(), sys.argv[1:] if argv is None else argv
        named = tuple(argv[:1])  # a command comes first; else all are declared, for the help or the message
        with _signals():
            try:
                parser = self._parser(named if set(named) & set(self.commands) else self.commands)
                if not argv:
                    parser.print_help()
                    return 0
                if self.of_file and named[0] not in self.commands and Path(named[0]).is_file():
                    message = f"{named[0]} is a file, and a command comes first: {self.name} {self.of_file}"
                    return self.fail([f"{message} {' '.join(map(quote, argv))}"], 2)
                parser.parse_args(argv, args)
                return self._run(args)
            except (KeyboardInterrupt, Terminated) as error:
                return self.fail(*self.message(error, args))

    def _run(self, args: argparse.Namespace) -> int:
        """Run the command that was asked for, and turn every error into a message and an exit status."""
        with warnings.catch_warnings():
            warnings.simplefilter("always", LacmeshWarning)
            warnings.showwarning = self._show_warning
            try:
                with redirect_stdout(_Shown(sys.stdout)):
                    args.run(args)
                sys.stdout.flush()
            except BrokenPipeError:  # the reader of our output went away, as `head` does
                _drop_output()
                return 0
            except Exception as error:
                if isinstance(error, OSError) and not isinstance(error, LacmeshError):
                    _drop_output()
                if args.verbose and not isinstance(error, EXPECTED):
                    raise
                return self.fail(*self.message(error, args))
        return 0

    def message(self, error: BaseException, args: argparse.Namespace) -> tuple[Sequence[str], int]:
        """Return the lines of the message about an error that ends a command, and the exit status."""
        match error:
            case LacmeshError():
                return self.error_lines(error, args), error.status
            case KeyboardInterrupt():
                return [f"interrupted; {_left(args)}"], 130
            case Terminated():
                return [f"terminated; {_left(args)}"], 143
            case OSError():  # files of ours say so themselves: this is what we print to
                return [f"the terminal or file that is printed to fails ({error.strerror or error})"], 3
            case MemoryError():
                return [self.too_large], 1
        # a fault of ours: one line, and the traceback on request
        return [f"internal error ({type(error).__name__}: {error}); --verbose shows where; please report it"], 1

    def fail(self, messages: Sequence[str], status: int) -> int:
        """Print the lines of a message, and return the exit status."""
        return _fail(self.name, messages, status)

    def _show_warning(
        self,
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, LacmeshWarning):
            print(f"{self.name}: {coloured('warning', YELLOW)}: {on_one_line(str(message))}", file=sys.stderr)


def _drop_output() -> None:
    """Lead standard output nowhere: what is left in its buffer would fail again when Python ends, with status 120."""
    with suppress(OSError):  # a stream without a file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _left(args: argparse.Namespace) -> str:
    """Clause on the output of an interrupted command: by `args.left`, which a command sets once it has an output."""
    left: Callable[[], str] | None = getattr(args, "left", None)
    return "nothing was written" if left is None else left()


def on_one_line(message: str) -> str:
    r"""Escape what is not printable: names from files must not hold line ends or commands to the terminal.

    >>> on_one_line("group 'a" + chr(10) + chr(27) + "é'")
    "group 'a\\n\\x1bé'"
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in message)


def coloured(word: str, colour: str) -> str:
    """Return a word in bold and in a colour where standard error is a terminal that shows it, or else as it is.

    The environment variable NO_COLOR (no-color.org) and TERM=dumb leave it plain.
    """
    shown = sys.stderr.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return f"\x1b[1;{colour}m{word}\x1b[0m" if shown else word


class _Shown:
    """The output stream `out`, with escapes for what is not printable: names from files may hold terminal commands."""

    def __init__(self, out: TextIO) -> None:
        self.out = out

    def write(self, text: str) -> int:
        """Write a text with its lines kept and other unprintable characters escaped."""
        self.out.write("\n".join(map(on_one_line, text.split("\n"))))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.out, name)


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, as all errors are."""

    def error(self, message: str) -> NoReturn:
        self.exit(_fail(self.prog.split()[0], [f"{message}; see {self.prog} --help"], 2))


def _fail(program: str, messages: Sequence[str], status: int) -> int:
    with suppress(OSError):  # nobody listens
        for message in messages:
            print(f"{program}: {coloured('error', RED)}: {on_one_line(message)}", file=sys.stderr)
    return status


@contextmanager
def _signals() -> Iterator[None]:
    """Turn the first SIGINT or SIGTERM into an exception, and ignore those that follow until it has unwound."""
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


def _open_streams() -> None:
    """Replace an output or error stream that the caller closed (`2>&-`): else a file of ours would be number 2."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name may hold what the terminal cannot show


def _keep_memory() -> None:
    """Let glibc keep freed memory for the next array: new pages cost a tenth of the time on a mesh of 1e6 cells."""
    if sys.platform == "linux":
        import ctypes

        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
        if mallopt is not None:
            mallopt(-3, 1 << 30)  # M_MMAP_THRESHOLD
            mallopt(-1, (1 << 31) - 1)  # M_TRIM_THRESHOLD
            mallopt(-2, 1 << 26)  # M_TOP_PAD
