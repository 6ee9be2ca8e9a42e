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
import warnings
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import NoReturn, TextIO

from lacmesh import __version__
from lacmesh.cli.options import EPILOG
from lacmesh.errors import LacmeshError, LacmeshWarning

#: in the order of the help
COMMANDS = ("cut", "check", "quality", "orient", "view", "mesh", "info", "convert", "types")


class Terminated(BaseException):
    """SIGTERM arrived: unwind, so that nothing half-written stays."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    gc.disable()  # a short life of large arrays and no cycles: collecting would only cost time
    if sys.stdout is None:  # closed by who called us
        sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115
    args = _parser().parse_args(argv)
    signal.signal(signal.SIGTERM, _terminate)
    _keep_memory()
    with warnings.catch_warnings():
        warnings.simplefilter("always", LacmeshWarning)
        warnings.showwarning = _show_warning
        try:
            args.run(args)
            sys.stdout.flush()
        except LacmeshError as error:
            return _fail(str(error), error.status)
        except BrokenPipeError:  # the reader of our output went away, as `head` does
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 0
        except OSError as error:  # files of ours say so themselves: this is what we print to
            return _fail(f"the terminal or file that is printed to fails ({error.strerror or error})", 3)
        except KeyboardInterrupt:
            return _fail("interrupted; nothing was written", 130)
        except Terminated:
            return _fail("terminated; nothing was written", 143)
        except MemoryError:
            return _fail("there is not enough memory for this mesh", 1)
        except Exception as error:  # a fault of ours: one line, and the traceback on request
            if args.verbose:
                raise
            message = f"internal error ({type(error).__name__}: {error}); --verbose shows where; please report it"
            return _fail(message, 1)
    return 0


def _keep_memory() -> None:
    """Let glibc keep what is freed for the next array: new pages cost a tenth of the time on a mesh of 1e6 cells."""
    if sys.platform == "linux":
        import ctypes

        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
        if mallopt is not None:
            mallopt(-3, 1 << 30)  # M_MMAP_THRESHOLD
            mallopt(-1, (1 << 31) - 1)  # M_TRIM_THRESHOLD
            mallopt(-2, 1 << 26)  # M_TOP_PAD


def _terminate(signum: int, frame: object) -> NoReturn:
    raise Terminated


def _fail(message: str, status: int) -> int:
    print(f"lacmesh: error: {message}", file=sys.stderr)
    return status


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    if issubclass(category, LacmeshWarning):
        print(f"lacmesh: warning: {message}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lacmesh",
        description="Cut meshes for Local Average Contact: each face of the slave skin becomes a macro-element that "
        "owns a displacement degree of freedom.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"lacmesh {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        try:
            import_module(f"lacmesh.cli.{name}").add(commands)
        except ModuleNotFoundError:
            continue
    return parser
