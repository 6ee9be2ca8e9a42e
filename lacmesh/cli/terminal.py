"""Output of the commands on a terminal: progress, tables, JSON, time and memory.

Names come from files and are escaped: in printed lines by the program (`program.py`), in cells of tables here, because
tables have colours, and in JSON in its own way.
"""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from lacmesh.cli.program import Run, on_one_line


class Stages:
    """Times the stages of a command, and shows on a terminal which one it is in."""

    def __init__(self, run: Run) -> None:
        self.seconds: dict[str, float] = {}
        self.console: Any = None
        if sys.stderr.isatty() and not run.quiet:
            from rich.console import Console

            self.console = Console(stderr=True)
        if not run.quiet:
            show_log(self.console.print if self.console else on_stderr)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time the block as stage `name`."""
        start = time.perf_counter()
        if self.console:
            with self.console.status(name):
                yield
        else:
            yield
        self.seconds[name] = time.perf_counter() - start

    def spent(self) -> str:
        """Return the seconds of each stage, and the peak memory if the system knows it."""
        from lacmesh.threads import peak_memory

        peak = peak_memory()
        seconds = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in self.seconds.items())
        return seconds + (f"; peak memory {peak / 1e6:.0f} MB" if peak else "")


def on_stderr(message: str) -> None:
    """Print a message where there is no terminal, as in a pipe."""
    print(message, file=sys.stderr, flush=True)


def show_log(show: Callable[[str], None]) -> None:
    """Show the library's log messages: that kernels are compiled, which takes a while the first time."""
    handler = logging.Handler()
    handler.emit = lambda record: show(f"lacmesh: {record.getMessage()}")  # type: ignore[method-assign]
    logger = logging.getLogger("lacmesh")
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)


def print_table(columns: Iterable[str], rows: Iterable[Sequence[Any]]) -> None:
    """Print a table as wide as the terminal, or 160 columns in a file.

    Columns of numbers, with a + before their name, are aligned to the right. Those and columns with a | before theirs
    are not wrapped. An empty row begins a section.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in columns:
        mark, title = (name[:1], name[1:]) if name.startswith(("+", "|")) else ("", name)
        table.add_column(on_one_line(title), justify="right" if mark == "+" else "left", no_wrap=bool(mark))
    for row in rows:
        if row:
            table.add_row(*(on_one_line(cell) if isinstance(cell, str) else cell for cell in row))
        else:
            table.add_section()
    file = getattr(sys.stdout, "table_stream", sys.stdout)
    width = None if file.isatty() else 160
    Console(file=file, width=width, highlight=False, markup=False, emoji=False).print(table)


def print_json(data: Any) -> None:
    r"""Print data as JSON, even of a quiet command: printable characters as they are, others escaped as in JSON.

    >>> print_json(["é" + chr(27) + chr(155)])
    [
      "é\u001b\u009b"
    ]
    """
    text = json.dumps(data, ensure_ascii=False, indent=2, allow_nan=False)
    text = "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text)
    getattr(sys.stdout, "out", sys.stdout).write(f"{text}\n")
