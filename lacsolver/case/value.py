"""A value of a case: a number, a formula of x, y, z, t, a table of times, or, from Python, a function."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from lacsolver.case.errors import EvaluationError, Mistake
from lacsolver.case.formula import Formula, evaluate, parse_formula

if TYPE_CHECKING:
    from lacmesh.mesh import Floats

TimeTable = tuple[tuple[float, float], ...]
Source = float | Formula | TimeTable | Callable[..., Any]


@dataclass(frozen=True)
class Value:
    """Value of a load, a clearance or a prescribed displacement, as a function of place and time.

    `source`: a number, a Formula, a table ((t, v), ...) with increasing times, linear in between and constant beyond
    its ends, or a function f(x (n, dim), t) -> (n,) (with `takes_normals`, for a traction: f(x, n (n, dim), t)).
    `ramp_end`: time at which a number that is ramped from `start` at t = `ramp_start` is reached; None: not ramped.
    `placeless`: one value for a whole body, so that a function's points do not matter. `name`: its name in messages.
    """

    source: Source
    ramp_end: float | None = None
    ramp_start: float = 0.0
    takes_normals: bool = False
    placeless: bool = False
    name: str = field(default="value", compare=False)

    @classmethod
    def of(cls, given: Any) -> Value:
        """Make a value from a number, a formula as text, a table of times or a function. Raises ValueError."""
        try:
            return cls(value_from(given))
        except Mistake as mistake:
            raise ValueError(f"the value {mistake.message}") from None

    @cached_property
    def depends_on_place(self) -> bool:
        """True if the value may vary in space; always for a Python function, unless `placeless`."""
        if isinstance(self.source, Formula):
            return bool(self.source.variables & {"x", "y", "z"})
        return callable(self.source) and not self.placeless

    @cached_property
    def depends_on_time(self) -> bool:
        """True if the value may vary in time, as a ramped number does; always for a Python function."""
        if isinstance(self.source, Formula):
            return "t" in self.source.variables
        if isinstance(self.source, tuple):
            return len({v for _, v in self.source}) > 1
        return callable(self.source) or (self.ramp_end is not None and self.source != 0)

    def __call__(
        self, points: Floats, t: float, *, start: float | Floats = 0.0, normals: Floats | None = None
    ) -> Floats:
        """Return the value (n,) at `points` (n, 2 or 3; z is 0 in a plane) and time t.

        `start`: initial value of a ramped number (for a temperature, the material's reference). `normals` (n, dim): for
        a function of a traction. Raises EvaluationError, with place and time, where the value is not finite.
        """
        import numpy as np

        if isinstance(self.source, (float, int)):
            value = float(self.source)
            first, end = self.ramp_start, self.ramp_end
            part = 1.0 if end is None or t >= end else max(t - first, 0.0) / (end - first)
            result = np.asarray(start + (value - start) * part if part < 1 else value, dtype=float)
        elif isinstance(self.source, tuple):
            result = np.asarray(interpolate(self.source, t))
        else:
            result = self._at_points(np.asarray(points, dtype=float), t, normals)
        return self._checked(result, points, t)

    def at(self, t: float) -> float:
        """Return the value at time t of a value that is uniform in space, such as a rigid body's displacement.

        Raises ValueError if it depends on place.
        """
        import numpy as np

        if self.depends_on_place:
            raise ValueError(f"{self.name} depends on the place: call it with points")
        return float(self(np.zeros((1, 3)), t)[0])

    def _at_points(self, points: Floats, t: float, normals: Floats | None) -> Any:
        import numpy as np

        if isinstance(self.source, Formula):
            place = dict(zip("xyz", points.T, strict=False))
            return evaluate(self.source, {"z": 0.0, **place, "t": t})
        assert callable(self.source)
        if not self.takes_normals:
            return np.asarray(self.source(points, t), dtype=float)
        if normals is None:
            raise ValueError(f"{self.name} is a function of the normal: call it with normals")
        return np.asarray(self.source(points, normals, t), dtype=float)

    def _checked(self, result: Any, points: Floats, t: float) -> Floats:
        import numpy as np

        shape = (len(points),)
        if result.shape not in ((), (1,), shape):
            raise EvaluationError(f"{self.name} gives {result.shape} for {shape[0]} points; give one value for each")
        wrong = np.flatnonzero(~np.isfinite(np.broadcast_to(result, shape)))
        if len(wrong):
            at = ", ".join(f"{c:g}" for c in points[wrong[0]])
            value = np.broadcast_to(result, shape)[wrong[0]]
            what = f" = {self.source.text!r}" if isinstance(self.source, Formula) else ""
            more = f" (and {len(wrong) - 1} more places)" if len(wrong) > 1 else ""
            place = f"at ({at}){more}, t = {t:g}"
            raise EvaluationError(f"{self.name}{what} is {value} {place}; keep it finite, with where() if need be")
        return np.broadcast_to(result, shape).copy()


#: a value as it may be given: a number, a formula, a table of times, a function f(x, t)
ValueLike = Value | Source | str | Sequence[Sequence[float]]


def interpolate(table: TimeTable, t: float) -> float:
    """Return the table's value at time t: linear in between, constant before the first time and after the last."""
    k = bisect_right(table, t, key=lambda row: row[0])
    if k == 0 or k == len(table):
        return table[max(k - 1, 0)][1]
    (t0, v0), (t1, v1) = table[k - 1], table[k]
    return v0 + (v1 - v0) * (t - t0) / (t1 - t0)


def value_from(given: Any) -> Source:
    """Return the source of a value that a file or a program gives. Raises Mistake."""
    if isinstance(given, Value):
        source: Source = given.source
        return source
    if callable(given):
        function: Callable[..., Any] = given
        return function
    if isinstance(given, str):
        return parse_formula(given)
    given = plain(given)
    if isinstance(given, (list, tuple)):
        return _table(given)
    return number_from(given, "a number, a formula of x, y, z, t, or a table [[t, value], ...]")


def number_from(given: Any, wanted: str = "a number") -> float:
    """Return a finite number from a Python or numpy one. Raises Mistake."""
    given = plain(given)
    if isinstance(given, bool) or not isinstance(given, (int, float)):
        raise Mistake(f"is {described(given)}; it takes {wanted}")
    try:
        number = float(given)
    except OverflowError:
        number = inf
    if not isfinite(number):
        raise Mistake(f"is {number}; it takes {wanted}, and a finite one")
    return number


def _table(given: Sequence[Any]) -> TimeTable:
    if not given:
        raise Mistake("is an empty table of times; write [[t, value], ...]")
    rows: list[tuple[float, float]] = []
    for k, row in enumerate(given):
        if not isinstance(row, (list, tuple)) or len(row) != 2:
            raise Mistake(f"has {described(row)} in its table of times; each row is [t, value]", (k,))
        try:
            t, v = (number_from(entry) for entry in row)
        except Mistake as mistake:
            raise Mistake(f"has an entry in its table of times that {mistake.message}", (k,)) from None
        if rows and t <= rows[-1][0]:
            raise Mistake(f"has time {t:g} after {rows[-1][0]:g} in its table; times must increase", (k,))
        rows.append((t, v))
    return tuple(rows)


def plain(given: Any) -> Any:
    """Return an array of numpy as lists, anything else as it is."""
    return given.tolist() if hasattr(given, "tolist") else given


def described(given: Any) -> str:
    """Describe something for a message, in the words of a TOML file."""
    if isinstance(given, bool):
        return "true" if given else "false"
    if isinstance(given, str):
        return f'the text "{given}"' if len(given) <= 40 else f'the text "{given[:37]}..."'
    if isinstance(given, dict):
        return "a table"
    if isinstance(given, (list, tuple)):
        return f"a list of {len(given)}"
    if isinstance(given, (int, float)):
        return f"{given:g}" if abs(given) < 1e300 else "a number too large"
    return f"a {type(given).__name__}"


def values_in(stored: Any) -> tuple[Value, ...]:
    """Return the Values in a stored entry."""
    if isinstance(stored, Value):
        return (stored,)
    return tuple(v for v in stored if isinstance(v, Value)) if isinstance(stored, tuple) else ()


def with_values(stored: Any, change: Callable[[Value], Value]) -> Any:
    """Return the stored entry with `change` applied to every Value in it."""
    if isinstance(stored, Value):
        return change(stored)
    if isinstance(stored, tuple) and any(isinstance(v, Value) for v in stored):
        return tuple(change(v) if isinstance(v, Value) else v for v in stored)
    return stored
