"""A program (`lacmesh`, `lacsolver`) and its commands: from typed functions to an exit status.

A command is a function whose signature declares its arguments; a parameter of the type of a dataclass stands for all
fields of it. A command imports what it needs when it runs, so that `--help` loads no numpy. Errors become messages and
exit statuses here and nowhere else.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property, partial
from inspect import Parameter, Signature, cleandoc, signature
from io import StringIO, TextIOWrapper
from pathlib import Path
from shlex import join
from types import UnionType
from typing import Annotated, Any, NoReturn, TextIO, get_args, get_origin, get_type_hints

import typer
from typer.core import TyperCommand
from typer.main import get_command

from lacmesh import __version__
from lacmesh.errors import LacmeshError, LacmeshWarning, RequestError, did_you_mean

#: errors that are no fault of ours
EXPECTED = (LacmeshError, OSError, MemoryError)
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_SETTINGS = {"help_option_names": ["-h", "--help"]}


def number(text: str, kind: type = float, what: str = "number", low: float = -math.inf, high: float = math.inf) -> Any:
    """Return a number that is given as a word; NaN is none."""
    try:
        value = kind(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise typer.BadParameter(f"{text!r} is no {what}")
    return value


#: how words of the system, which may be no UTF-8, are read
_PARSERS = {str: str, float: number, int: partial(number, kind=int, what="whole number")}


class Terminated(BaseException):
    """SIGTERM arrived: unwind, so that nothing half-written stays."""


@dataclass
class Run:
    """One run of a command: the options that all commands have, and what its messages need.

    `source`: file in front of an error about the data. `left`: clause on what an interrupted command leaves.
    """

    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="print nothing but warnings and errors")] = False
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="show where an internal error comes from")] = False
    program: Program = field(init=False, repr=False)
    source: str = field(default="", init=False)
    left: Callable[[], str] = field(default_factory=lambda: lambda: "nothing was written", init=False)

    def will_write(self, target: Path, *, force: bool) -> None:
        """Check early that a file can be written, and name it if the command is interrupted after that.

        Raises RequestError, WriteError.
        """
        from lacmesh.formats.output import check_place

        check_place(target, force=force)
        self.leaves(target)

    def leaves(self, target: Path) -> None:
        """Let an interrupted command say, by what is on the disk, whether this output was written."""

        def state() -> tuple[int, int] | None:  # it tells a file from one that took its place
            with suppress(OSError):
                return target.stat().st_ino, target.stat().st_mtime_ns
            return None

        before, written = state(), f"{target} was written before that"
        self.left = lambda: "nothing was written" if state() == before else written


@dataclass
class Program:
    """A program called `name`; `commands` are in the order of the help.

    `error_lines`: gives the lines of an error message. `too_large`: message for lack of memory. `of_file`: command to
    name where a file stands in the place of one. `source`: argument with the file that errors about the data name.
    """

    name: str
    about: str
    epilog: str
    commands: Sequence[Callable[..., None]]
    too_large: str
    error_lines: Callable[[LacmeshError, Run], Sequence[str]] = lambda error, run: [str(error)]
    of_file: str = ""
    source: str = "source"
    run: Run = field(default_factory=Run, init=False)

    @cached_property
    def group(self) -> Any:
        """The commands as typer has them."""
        # \b: the line ends that follow are kept
        more: dict[str, Any] = {"epilog": f"\b\n{self.epilog}", "context_settings": _SETTINGS}
        app = typer.Typer(name=self.name, help=self.about, rich_markup_mode=None, **more)
        app.callback()(_options_of_all)
        for command in self.commands:
            name, text = command.__name__.removesuffix("_command").rstrip("_"), cleandoc(command.__doc__ or "")
            summary, text = text.partition("\n\n")[0].rstrip("."), text.replace("\n\n$ ", "\n\n\b\n$ ")
            app.command(name, cls=_Command, short_help=summary, help=text, **more)(self._of_plain_parameters(command))
        return get_command(app)

    def main(self, argv: Sequence[str] | None = None) -> int:
        """Run a command and return its exit status; every failure ends in a message and a status."""
        words = list(sys.argv[1:] if argv is None else argv)
        if f"_{self.name.upper()}_COMPLETE" in os.environ:  # a shell completes a command
            self.group.main(words, self.name)
        _open_streams()
        self.run = Run()
        self.run.program = self
        with _signals(), warnings.catch_warnings():
            warnings.simplefilter("always", LacmeshWarning)
            warnings.showwarning = self._show_warning  # type: ignore[assignment]
            try:
                with redirect_stdout(_Shown(sys.stdout, self)):
                    self._call(words)
                sys.stdout.flush()
            except typer.Exit as end:  # --help, --version
                return end.exit_code
            except BrokenPipeError:  # the reader of our output went away, as `head` does
                _drop_output()
            except (Exception, KeyboardInterrupt, Terminated) as error:
                if isinstance(error, OSError):
                    _drop_output()
                if self.run.verbose and isinstance(error, Exception) and not isinstance(error, EXPECTED):
                    raise
                return self.fail(*self.message(error))
        return 0

    def message(self, error: BaseException) -> tuple[Sequence[str], int]:
        """Return the lines of the message about an error that ends a command, and the exit status."""
        match error:
            case LacmeshError():
                return self.error_lines(error, self.run), error.status
            case typer.TyperException():  # a sentence of the parser
                text = error.format_message().replace("Value error, ", "").rstrip(".")
                return [f"{text[:1].lower()}{text[1:]}; see {self._path} --help"], 2
            case KeyboardInterrupt():
                return [f"interrupted; {self.run.left()}"], 130
            case Terminated():
                return [f"terminated; {self.run.left()}"], 143
            case OSError():  # files of ours say so themselves: this is what we print to
                return [f"the terminal or file that is printed to fails ({error.strerror or error})"], 3
            case MemoryError():
                return [self.too_large], 1
        # a fault of ours: one line, and the traceback on request
        return [f"internal error ({type(error).__name__}: {error}); --verbose shows where; please report it"], 1

    def fail(self, messages: Sequence[str], status: int) -> int:
        """Print the lines of a message, and return the exit status."""
        with suppress(OSError):  # nobody listens
            for message in messages:
                self._print("error", "31", message)
        return status

    def _show_warning(self, message: Warning | str, category: type[Warning], *place: Any) -> None:
        if issubclass(category, LacmeshWarning):
            self._print("warning", "33", str(message))

    def _print(self, word: str, colour: str, message: str) -> None:
        """Print a line on standard error, with a word in colour on a terminal (no-color.org; ECMA-48)."""
        if sys.stderr.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb":
            word = f"\x1b[1;{colour}m{word}\x1b[0m"
        print(f"{self.name}: {word}: {on_one_line(message)}", file=sys.stderr)

    def _call(self, words: list[str]) -> None:
        """Parse the words of a command, and run it."""
        first, known = words[0] if words else "--help", self.group.commands
        self._path = f"{self.name} {first}" if first in known else self.name
        if first == "--version":
            print(f"{self.name} {__version__}")
            raise typer.Exit
        if not first.startswith("-") and first not in known:
            if self.of_file and Path(first).is_file():
                command = join([self.name, self.of_file, *words])
                raise RequestError(f"{first} is a file, and a command comes first: {command}")
            raise typer.TyperException(f"there is no command {first!r}{did_you_mean(first, known)}")
        with self.group.make_context(self.name, words or [first]) as context:
            self.group.invoke(context)

    def _of_plain_parameters(self, command: Callable[..., None]) -> Callable[..., None]:
        """Return a command as a function for typer: in place of a dataclass it has the fields as parameters."""
        records: dict[str, tuple[Any, list[str]]] = {}
        parameters: list[Parameter] = []
        for parameter in signature(command, eval_str=True).parameters.values():
            if not is_dataclass(record := parameter.annotation):
                parameters.append(parameter.replace(kind=Parameter.KEYWORD_ONLY))
                continue
            hints = get_type_hints(record, include_extras=True)
            options = {one.name: one.default for one in fields(record) if one.init}
            records[parameter.name] = record, [*options]
            parameters += [
                Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=hints[name])
                for name, default in options.items()
            ]
        for parameter in parameters:
            kind, argument = parameter.annotation.__origin__, parameter.annotation.__metadata__[0]
            while get_origin(kind) in (list, UnionType):
                kind = get_args(kind)[0]
            argument.parser = argument.parser or _PARSERS.get(kind)

        def call(**values: Any) -> None:
            self.run.source = values.get(self.source) or ""
            for name, (record, names) in records.items():
                chosen = {one: values.pop(one) for one in names}
                if record is Run:
                    self.run.quiet, self.run.verbose = chosen["quiet"], chosen["verbose"]
                values[name] = self.run if record is Run else record(**chosen)
            command(**values)

        call.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        call.__annotations__.clear()
        return call


def _options_of_all(version: Annotated[bool, typer.Option("--version", help="print the version")] = False) -> None:
    """Declare the options before a command."""


class _Command(TyperCommand):
    """A command whose help groups the options, and whose options with a metavar in brackets need no value."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        for option in self.params:
            if (option.metavar or "").startswith("["):
                args = _with_values(args, option.opts, many="..." in (option.metavar or ""))
        return super().parse_args(ctx, args)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        panels: dict[str, list[tuple[str, str]]] = {}
        for param in self.get_params(ctx):
            if (record := param.get_help_record(ctx)) is not None:
                argument = param.param_type_name == "argument"
                panel = "Arguments" if argument else getattr(param, "rich_help_panel", None) or "Options"
                panels.setdefault(panel, []).append((param.metavar or "", record[1]) if argument else record)
        for panel, rows in panels.items():
            with formatter.section(panel):
                formatter.write_dl(rows)


def _with_values(words: list[str], names: Sequence[str], *, many: bool) -> list[str]:
    """Join an option that may have no value, one, or many, with its values.

    >>> _with_values(["run", "--history", "a", "b", "-q"], ["--history"], many=True)
    ['run', '--history=a', '--history=b', '-q']
    """
    for k, word in enumerate(words):
        if word in names:
            rest = words[k + 1 :]
            count = next((n for n, value in enumerate(rest) if value.startswith("-")), len(rest))
            count = count if many else min(count, 1)
            values = [f"{word}={value}" for value in rest[:count] or [""]]
            return [*words[:k], *values, *_with_values(rest[count:], names, many=many)]
    return words


class _Shown:
    """The output stream `out` of a program, with escapes for what is not printable; a quiet run drops what is printed.

    Names from files may hold commands to the terminal.
    """

    def __init__(self, out: TextIO, program: Program) -> None:
        self.out, self.program = out, program

    @property
    def table_stream(self) -> TextIO:
        """The stream for tables, whose cells are escaped and whose colours are not."""
        return StringIO() if self.program.run.quiet else self.out

    def write(self, text: str) -> int:
        """Write a text with its lines kept and other unprintable characters escaped."""
        if not self.program.run.quiet:
            self.out.write("\n".join(map(on_one_line, text.split("\n"))))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.out, name)


def on_one_line(message: str) -> str:
    r"""Escape what is not printable: names from files must not hold line ends or commands to the terminal.

    >>> on_one_line("group 'a" + chr(10) + chr(27) + "é'")
    "group 'a\\n\\x1bé'"
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in message)


def _drop_output() -> None:
    """Lead standard output nowhere: what is left in its buffer would fail again when Python ends, with status 120."""
    with suppress(OSError):  # a stream without a file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _signals() -> Iterator[None]:
    """Turn the first SIGINT or SIGTERM into an exception, and ignore those that follow until it has unwound."""
    if threading.current_thread() is not threading.main_thread():  # only there may handlers be set
        yield
        return
    before = {number: signal.signal(number, _stop) for number in _SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)  # None: set by something that is not Python


def _stop(signum: int, frame: object) -> NoReturn:
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt if signum == signal.SIGINT else Terminated


def _open_streams() -> None:
    """Replace an output or error stream that the caller closed (`2>&-`): else a file of ours would be number 2."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a name may hold what the terminal cannot show
