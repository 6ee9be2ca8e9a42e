"""The command `lacsolver`: errors and exit statuses here; a module for each command beside it.

A command's module has `add(commands)`, which declares its arguments, and `run(args)`; it imports what it needs when it
runs, so that `--help` loads no numpy. Signals, and how a message becomes one line, are those of the command `lacmesh`.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import NoReturn, TextIO

from lacmesh import __version__
from lacmesh.cli import Terminated, keep_memory, on_one_line, signals_heard
from lacmesh.cli.options import written
from lacmesh.errors import LacmeshError, LacmeshWarning
from lacsolver.cli.options import EPILOG

#: in the order of the help
COMMANDS = ("run", "validate", "matrices", "schema")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit status. Nothing that happens leaves it without a word and a status."""
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
            return _fail([f"interrupted; {_left(args)}"], 130)
        except Terminated:
            return _fail([f"terminated; {_left(args)}"], 143)


def _run(args: argparse.Namespace) -> int:
    """Run what was asked for, whatever becomes of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", LacmeshWarning)
        warnings.showwarning = _show_warning
        try:
            args.run(args)
            sys.stdout.flush()
        except LacmeshError as error:
            return _fail(_told(error, args), error.status)
        except BrokenPipeError:  # the reader of our output went away, as `head` does
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except OSError as error:  # files of ours say so themselves: this is what we print to
            return _fail([f"the terminal or file that is printed to fails ({error.strerror or error})"], 3)
        except MemoryError:
            message = "there is not enough memory for this model; a coarser mesh needs less"
            return _fail([f'{message}, and so does [solver] backend = "multigrid"'], 1)
        except Exception as error:  # a fault of ours: one line, and the traceback on request
            if args.verbose:
                raise
            message = f"internal error ({type(error).__name__}: {error}); --verbose shows where; please report it"
            return _fail([message], 1)
    return 0


def _left(args: argparse.Namespace) -> str:
    """For a command that is stopped: what there is of its output."""
    left = getattr(args, "left", None)
    return str(left()) if left else written(args)


def _told(error: LacmeshError, args: argparse.Namespace) -> list[str]:
    """What an error says, a line each mistake of a case; where it is about the case and names no file, the case's."""
    from lacsolver.case.errors import CaseError

    lines = str(error).splitlines() if isinstance(error, CaseError) else [str(error)]
    case, about = getattr(args, "case", None), error.status in (1, 4)
    return [f"{case}: {line}" if about and case and case not in line else line for line in lines]


def _fail(messages: Sequence[str], status: int) -> int:
    with suppress(OSError):  # nobody listens
        for message in messages:
            print(f"lacsolver: error: {on_one_line(message)}", file=sys.stderr)
    return status


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, as all errors are."""

    def error(self, message: str) -> NoReturn:
        self.exit(_fail([f"{message}; see {self.prog} --help"], 2))


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    if issubclass(category, LacmeshWarning):
        print(f"lacsolver: warning: {on_one_line(str(message))}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="lacsolver",
        description="Solve contact problems with the Local Average Contact method: a case file says what, lacmesh cuts "
        "the mesh.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"lacsolver {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        import_module(f"lacsolver.cli.{name}").add(commands)
    return parser
