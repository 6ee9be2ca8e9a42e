"""Short descriptions of records: a name and a few facts, as text for a prompt and as HTML for a notebook."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sized
from dataclasses import fields
from html import escape
from math import isfinite
from typing import Any, NoReturn

#: most lines of a description, its title included, and their width
_LINES, _WIDTH = 10, 110
#: longest collection whose members are shown
_SHORT = 6


class Described:
    """Base of records that a user sees: a description of ten lines at most, as text and as a table in notebooks.

    A record of arrays would otherwise be printed with all their values.
    """

    def _title(self) -> str:
        """Return the name of the record."""
        return type(self).__name__

    def _facts(self) -> dict[str, str]:
        """Return facts by name: the fields, arrays by their shape; a class may have others."""
        shown: Any = self
        return {one.name: brief(getattr(self, one.name)) for one in fields(shown) if one.repr}

    def __repr__(self) -> str:
        facts = self._facts()
        wide = max(map(len, facts), default=0)
        rows = [f"  {name:<{wide}}  {fact}" for name, fact in facts.items()]
        if len(rows) >= _LINES:
            rows = [*rows[: _LINES - 2], f"  and {len(rows) - _LINES + 2} more"]
        return "\n".join([self._title(), *(r if len(r) <= _WIDTH else r[: _WIDTH - 3] + "..." for r in rows)])

    def _repr_html_(self, picture: str = "") -> str:
        """Return a small table of the facts; `picture`: HTML that is put below it."""
        cells = ('<th style="text-align:left">', '<td style="text-align:left">')
        rows = (f"{cells[0]}{escape(k)}</th>{cells[1]}{escape(v)}</td>" for k, v in self._facts().items())
        table = "".join(f"<tr>{row}</tr>" for row in rows)
        return f"<div><b>{escape(self._title())}</b><table>{table}</table>{picture}</div>"


def without_nan(value: Any) -> Any:
    """Return plain data, such as JSON holds, with None in place of numbers that are not finite.

    >>> without_nan({"mean": float("nan"), "of": (1, 2.5)})
    {'mean': None, 'of': [1, 2.5]}
    """
    if isinstance(value, dict):
        return {key: without_nan(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [without_nan(part) for part in value]
    return None if isinstance(value, float) and not isfinite(value) else value


class ByName(dict[str, Any]):
    """Records by name; a name that does not exist is a KeyError that lists those that do.

    >>> ByName(bore=1.0)["bolt"]
    Traceback (most recent call last):
    KeyError: "no 'bolt' here; there are: bore"
    """

    def __missing__(self, name: str) -> NoReturn:
        raise KeyError(f"no {name!r} here; there are: {listed(map(str, self)) or 'none'}")


def brief(value: Any) -> str:
    """Return a few words for a value: an array by its shape, a long collection by its length.

    >>> brief(2.5), brief([1, 2]), brief(range(1000)), brief({"a": [1]})
    ('2.5', '[1, 2]', 'range of 1,000', 'a')
    """
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        if value.shape:
            return f"{value.dtype} {value.shape}"
        value = value.item()
    if isinstance(value, (str, float)):
        return value if isinstance(value, str) else f"{value:.6g}"
    if isinstance(value, Mapping):
        return listed(map(str, value)) or "none"
    if isinstance(value, Described):
        return value._title()
    size = len(value) if isinstance(value, Sized) else None
    words = repr(value) if size is None or size <= _SHORT else ""
    if 0 < len(words) <= _WIDTH // 2 and "\n" not in words:
        return words
    return type(value).__name__ + ("" if size is None else f" of {size:,}")


def listed(names: Iterable[str], most: int = 6) -> str:
    """Return names in a row, the first ones of many.

    >>> listed(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    names = list(names)
    left = len(names) - most
    return ", ".join(names) if left <= 0 else f"{', '.join(names[:most])} and {left} more"
