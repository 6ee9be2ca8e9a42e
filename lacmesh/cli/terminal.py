"""Output of the commands on a terminal: progress, tables, JSON, time and memory.

Names come from files and are escaped: in printed lines by the program (`program.py`), in cells of tables here, because
tables have colours, and in JSON in its own way.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from lacmesh.cli.program import on_one_line


class Stages:
    """Times the stages of a command, and shows a progress bar on a terminal."""

    def __init__(self, args: argparse.Namespace, names: Iterable[str]) -> None:
        self.names = tuple(names)
        self.seconds: dict[str, float] = {}
        self.bar: Any = None
        if sys.stderr.isatty() and not args.quiet:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            self.bar = Progress(
                TextColumn("{task.description:6}"),
                BarColumn(),
                TimeElapsedColumn(),
                console=Console(stderr=True),
                transient=True,
            )
            self.task = self.bar.add_task("", total=len(self.names))
            tell(self.bar.console.print)
        elif not args.quiet:
            tell(on_stderr)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time the block as stage `name`."""
        start = time.perf_counter()
        if self.bar:
            self.bar.start()
            self.bar.update(self.task, description=name, refresh=True)
        try:
            yield
            self.seconds[name] = time.perf_counter() - start
            if self.bar:
                self.bar.advance(self.task)
        finally:
            if self.bar and (name not in self.seconds or name == self.names[-1]):
                self.bar.stop()

    def spent(self) -> str:
        """Return the seconds of each stage, and the peak memory."""
        return ", ".join(f"{name} {seconds:.2f} s" for name, seconds in self.seconds.items()) + memory()


def on_stderr(message: str) -> None:
    """Print a message where no bar is shown, as in a pipe."""
    print(message, file=sys.stderr, flush=True)


def tell(say: Callable[[str], None]) -> None:
    """Pass the library's log messages to `say`: that kernels are compiled, which takes a while the first time."""

    class Telling(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            say(f"lacmesh: {record.getMessage()}")

    logger = logging.getLogger("lacmesh")
    logger.addHandler(Telling())
    logger.setLevel(logging.INFO)


def console() -> Any:
    """Console that tables are printed on: as wide as the terminal, or 160 columns in a file."""
    from rich.console import Console

    file = getattr(sys.stdout, "out", sys.stdout)  # past what escapes lines: tables are escaped cell by cell
    return Console(file=file, width=None if file.isatty() else 160, highlight=False, markup=False, emoji=False)


def table(*columns: str) -> Any:
    """Empty table; columns of numbers are aligned to the right: those with a + before their name, and some others."""
    from rich import box
    from rich.table import Table

    class Shown(Table):
        def add_row(self, *cells: Any, **style: Any) -> None:
            super().add_row(*(on_one_line(c) if isinstance(c, str) else c for c in cells), **style)

    table = Shown(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in columns:
        number = name.startswith("+") or name in ("before", "after", "added", "cells", "number", "nodes", "own nodes")
        table.add_column(on_one_line(name.removeprefix("+")), justify="right" if number else "left", no_wrap=number)
    return table


def as_json(data: Any) -> str:
    r"""Data as JSON for people and programs: printable characters as they are, others escaped as in JSON.

    >>> print(as_json(["é" + chr(27) + chr(155)]))
    [
      "é\u001b\u009b"
    ]
    """
    text = json.dumps(data, ensure_ascii=False, indent=2, allow_nan=False)
    return "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text)


def memory() -> str:
    """End of a sentence: the peak memory of this process; empty if the system does not tell."""
    from lacmesh.threads import peak_memory

    peak = peak_memory()
    return f"; peak memory {peak / 1e6:.0f} MB" if peak else ""
