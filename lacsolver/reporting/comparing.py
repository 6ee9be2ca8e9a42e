"""Two runs compared: every figure of results.json that both have, side by side."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from lacsolver.output.summary import read_summary

#: keys of results.json that say nothing of the solution
_LEFT_OUT = ("version", "steps", "timings", "memory")
#: differences that are smaller than this, relative to the larger value, are round-off
ROUND_OFF = 1e-9


class Compared(NamedTuple):
    """A figure of two runs: its name, both values, and their difference, relative to the larger one; NaN for words."""

    name: str
    first: Any
    second: Any
    difference: float

    @property
    def same(self) -> bool:
        """True if both are the same, but for round-off."""
        return self.first == self.second or self.difference <= ROUND_OFF


def compare_runs(first: str | Path, second: str | Path) -> list[Compared]:
    """Return every figure of two runs at their last step, and what only one of them has. Raises ReadError.

    A vector is compared by its components, relative to its largest one.

    >>> from tempfile import TemporaryDirectory
    >>> import lacsolver as ls
    >>> from lacmesh import example
    >>> with TemporaryDirectory() as folder:
    ...     done = ls.run(example("two_blocks.toml"), f"{folder}/results")
    ...     all(row.same for row in compare_runs(f"{folder}/results", f"{folder}/results"))
    True
    """
    one, other = (dict(_figures(read_summary(Path(folder)))) for folder in (first, second))
    return [
        Compared(name, one.get(name), other.get(name), _difference(one.get(name), other.get(name)))
        for name in dict.fromkeys([*one, *other])
    ]


def _figures(summary: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the figures of a run by name: those of the last step, and totals of the steps."""
    steps = summary["steps"]
    yield "steps", len(steps)
    for key in ("iterations", "halvings"):
        yield key, sum(step[key] for step in steps)
    if steps:
        yield "time", steps[-1]["time"]
        kept = {k: v for k, v in steps[-1].items() if k not in ("time", "iterations", "halvings", "residuals")}
        yield from _flat("", kept)
    yield from _flat("", {key: value for key, value in summary.items() if key not in _LEFT_OUT})


def _flat(start: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _flat(f"{start}.{key or 'all'}" if start else str(key), part)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for part in value:
            yield from _flat(f"{start}.{part.get('section', '')}.{part.get('where', '')}", part.get("force"))
    else:
        yield start, value


def _difference(one: Any, other: Any) -> float:
    """Return the largest difference of two numbers or vectors, relative to their largest component."""
    a, b = (value if isinstance(value, list) else [value] for value in (one, other))
    numbers = [*a, *b]
    if len(a) != len(b) or not all(isinstance(part, (int, float)) and not isinstance(part, bool) for part in numbers):
        return 0.0 if one == other else math.nan
    size = max(map(abs, numbers), default=0.0)
    return max((abs(x - y) for x, y in zip(a, b, strict=True)), default=0.0) / size if size > 0 else 0.0
