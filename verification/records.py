"""Records of the harness: a case is a function with its data, its outcome results that are compared with known values.

    family (its cases, each with what solves it) -> outcome (results, pictures) -> folder of a run -> report

A result is kept as `results.json` has it, with `bound`, which says how value, expected and tolerance are compared, and
`published`, what others obtained; `pictures` are the report's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from functools import partial, wraps
from inspect import signature
from typing import Any, Literal

from verification.measures.rates import fitted, pairwise

#: each has the cases of those before it
SUITES = ("quick", "full", "all")
#: error of a rate from round-off of the errors
_ROUNDING = 1e-9
#: how a value is held against `expected`: within `tolerance` of it, at least or at most that, or for information
Bound = Literal["equal", "at least", "at most", "informative"]


@dataclass(frozen=True)
class Case:
    """One problem of a family. `solve`: the function that solves it on so many meshes (`levels`), bound to data.

    `description`: a line. `levels`: suite -> how many meshes, from the coarsest on; a suite that is not named does
    without the case. `seconds`: what it takes in `full` (or the first suite that has it), roughly. `exclusive`: it
    measures time, so that nothing else may run beside it.
    """

    family: str
    name: str
    description: str
    solve: partial[Outcome]
    levels: Mapping[str, int]
    seconds: float = 5.0
    exclusive: bool = False

    @property
    def id(self) -> str:
        """Identifier of the case: `family/name`."""
        return f"{self.family}/{self.name}"

    @property
    def parameters(self) -> dict[str, Any]:
        """All that it is made of, by name: the arguments of `solve`; of a record that is the first, its fields."""
        bound = signature(self.solve.func).bind_partial(*self.solve.args, **self.solve.keywords)
        bound.apply_defaults()
        parameters: dict[str, Any] = {}
        for k, (name, value) in enumerate(bound.arguments.items()):
            parameters |= vars(value) if k == 0 and is_dataclass(value) else {name: value}
        return parameters


@dataclass(frozen=True)
class Family:
    """Cases of one kind. `text`: what is solved and why, paragraphs of Markdown.

    `missing`: returns a sentence about what is not installed that the family needs, and how to get it; '' if all is.
    """

    name: str
    title: str
    text: str
    cases: tuple[Case, ...]
    missing: Callable[[], str] = lambda: ""


@dataclass(frozen=True)
class Level:
    """One mesh: `h` its size, `unknowns`, `error`, `rate` from the level before (None on the first)."""

    h: float
    unknowns: int
    error: float
    rate: float | None = None


@dataclass(frozen=True)
class Published:
    """Value that others obtained: `who` (code and method), `value`, `source` (where it was published)."""

    who: str
    value: float
    source: str = ""


@dataclass(frozen=True)
class Result:
    """A quantity of a case, and what must come out. Made by `equal`, `at_least`, `at_most`, `informative`, `rate`.

    `source`: where `expected` comes from; `reason`: why the tolerance is what it is, or why there is no bound.
    """

    quantity: str
    value: float
    expected: float | None
    tolerance: float | None
    passed: bool
    source: str
    reason: str
    bound: Bound
    levels: tuple[Level, ...] = ()
    published: tuple[Published, ...] = ()


@dataclass(frozen=True)
class Picture:
    """A picture. `png`: its bytes; `alt`: what is seen, in words."""

    title: str
    alt: str
    png: bytes
    __pydantic_config__ = {"val_json_bytes": "base64"}  # how the folder of a run keeps the bytes


@dataclass(frozen=True)
class Outcome:
    """All that a case yields. `failure`: the reason, in a sentence, why there is nothing."""

    results: tuple[Result, ...] = ()
    pictures: tuple[Picture, ...] = field(default=(), repr=False)
    failure: str = ""


#: a generator of the rows of an outcome
Rows = Iterator[Result | Picture]


def problem(rows: Callable[..., Rows]) -> Callable[..., Outcome]:
    """Turn a generator of results and pictures into a function that returns them as an outcome.

    The number of meshes, `levels`, is passed on to generators that ask for it.
    """
    asked = "levels" in signature(rows).parameters

    @wraps(rows)
    def solve(*given: Any, levels: int, **more: Any) -> Outcome:
        yielded = tuple(rows(*given, **more, **({"levels": levels} if asked else {})))
        return Outcome(
            tuple(one for one in yielded if isinstance(one, Result)),
            tuple(one for one in yielded if isinstance(one, Picture)),
        )

    return solve


def row(
    family: str, name: str, description: str, solve: Callable[..., Outcome], *given: Any, quick: int = 0, full: int = 0,
    every: int = 0, seconds: float = 5.0, **more: Any,
) -> Case:  # fmt: skip
    """A row of the table of a family: the case that solves a `problem` with these arguments.

    `quick`, `full`, `every`: number of meshes in the suites quick, full and all; 0 where that of the suite before
    stands.
    """
    levels = {suite: n for suite, n in zip(SUITES, (quick, full, every), strict=True) if n}
    return Case(family, name, description, partial(solve, *given, **more), levels, seconds)


def equal(
    quantity: str, value: float, expected: float, tolerance: float, *, source: str, reason: str, **more: Any
) -> Result:
    """A value that must be within a tolerance of another."""
    passed = bool(abs(value - expected) <= tolerance)
    return Result(quantity, float(value), expected, tolerance, passed, source, reason, "equal", **more)


def at_most(quantity: str, value: float, expected: float, *, source: str, reason: str = "", **more: Any) -> Result:
    """A value that must not exceed a bound; NaN does."""
    return Result(quantity, float(value), expected, 0.0, bool(value <= expected), source, reason, "at most", **more)


def at_least(quantity: str, value: float, expected: float, *, source: str, reason: str = "", **more: Any) -> Result:
    """A value that must reach a bound; NaN does not."""
    return Result(quantity, float(value), expected, 0.0, bool(value >= expected), source, reason, "at least", **more)


def informative(quantity: str, value: float, *, reason: str, source: str = "", **more: Any) -> Result:
    """A value without a bound; `reason` says why."""
    return Result(quantity, float(value), None, None, not math.isnan(value), source, reason, "informative", **more)


def levels_of(h: Sequence[float], unknowns: Sequence[int], error: Sequence[float]) -> tuple[Level, ...]:
    """The rows of a table of convergence, with the rate from each level to the next.

    >>> round(levels_of([1, 0.5], [10, 40], [4.0, 1.0])[1].rate, 12)
    2.0
    """
    rates = [None, *(float(r) for r in pairwise(h, error))] if len(h) > 1 else [None]
    return tuple(Level(float(a), int(n), float(e), r) for a, n, e, r in zip(h, unknowns, error, rates, strict=True))


def rate(
    quantity: str, levels: Sequence[Level], wanted: float | None, *, source: str, reason: str = "",
    last: int | None = None, published: Sequence[Published] = (),
) -> Result:  # fmt: skip
    """The fitted rate of an error, over the `last` few levels or all; it falls short below the one that is wanted, and
    where a step between these levels is below half of it. With one or two levels, or none wanted, it is
    informative. Last levels whose error has fallen to 0 are faster than any rate, and judged by those before, of which
    there are two at least.
    """
    table, levels = levels, _until_zero(levels)
    value = fitted([v.h for v in levels], [v.error for v in levels], last) if len(levels) > 1 else math.nan
    more: dict[str, Any] = {"levels": tuple(table), "published": tuple(published)}
    if wanted is None or len(table) < 3:
        why = reason if wanted is None else f"a rate is judged on three levels or more; {reason}"
        passed = all(math.isfinite(v.error) for v in levels)
        return Result(quantity, value, wanted, None, passed, source, why, "informative", **more)
    steps = [v.rate for v in levels[1 - last if last else 1 :] if v.rate is not None]  # between the fitted levels
    passed = value >= wanted - _ROUNDING and all(step >= wanted / 2 - _ROUNDING for step in steps)
    return Result(quantity, value, wanted, 0.0, bool(passed), source, reason, "at least", **more)


def _until_zero(levels: Sequence[Level]) -> Sequence[Level]:
    """The levels up to the last one with an error that is not 0."""
    return levels[: max((k + 1 for k, level in enumerate(levels) if level.error != 0), default=0)]
