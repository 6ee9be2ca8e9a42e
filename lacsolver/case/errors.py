"""Errors of cases: every mistake has its line, and all mistakes are reported at once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from lacmesh.errors import LacmeshError, ReadError

__all__ = ["CaseError", "EvaluationError", "Issue", "Mistake", "ReadError"]


class Issue(NamedTuple):
    """One mistake of a case: a message with a remedy, and the line of the file (None for cases from Python)."""

    message: str
    line: int | None = None


class CaseError(LacmeshError):
    """An invalid case. `problems`: all mistakes, in the order of their lines; `path`: the file.

    The message has one line for each: `press.toml, line 12: pressure.value is missing`.

    >>> from lacsolver.case import Material
    >>> Material(young=-1.0, poisson=0.3)
    Traceback (most recent call last):
    lacsolver.case.errors.CaseError: ...
    """

    def __init__(self, problems: Iterable[Issue], path: Any = None) -> None:
        self.path = None if path is None else str(path)
        self.problems = tuple(sorted(problems, key=lambda p: p.line or 0))
        super().__init__("\n".join(self._told(p) for p in self.problems))

    def _told(self, problem: Issue) -> str:
        place = [self.path] if self.path else []
        place += [f"line {problem.line}"] if problem.line else []
        return ": ".join([*([", ".join(place)] if place else []), problem.message])


class EvaluationError(LacmeshError):
    """A value of a case is not finite at some place and time; the message says which value, where and when.

    >>> from lacsolver.case import Value
    >>> Value.of("1 / t").at(0.0)
    Traceback (most recent call last):
    lacsolver.case.errors.EvaluationError: ...
    """


class Mistake(ValueError):  # noqa: N818 (never leaves this package: it becomes an Issue)
    """A value that its key does not take: the end of a sentence, and the position of the fault inside the value.

    It is a ValueError, which pydantic collects.
    """

    def __init__(self, message: str, inside: tuple[int | str, ...] = ()) -> None:
        super().__init__(message)
        self.message = message
        self.inside = inside
