"""Output of the commands on a terminal: progress, JSON, time and memory.

Names come from files and are escaped: in printed lines by the program (`program.py`), in cells of tables there
(`tables.py`), because tables have colours, and in JSON in its own way.
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


def tell(say: Callable[[str], None]) -> None:
    """Pass the library's log messages to `say`: that kernels are compiled, which takes a while the first time."""

    class Telling(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            say(f"lacmesh: {record.getMessage()}")

    logger = logging.getLogger("lacmesh")
    logger.addHandler(Telling())
    logger.setLevel(logging.INFO)


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
    from lacmesh.kernels.threads import peak_memory

    peak = peak_memory()
    return f"; peak memory {peak / 1e6:.0f} MB" if peak else ""
