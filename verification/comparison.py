"""Changes from one run to another, result by result."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lacmesh import LacmeshError

#: in the folder of a run: the results of all cases
RESULTS = "results.json"
#: a value has changed where it differs by more, relative to its size
CHANGED = 1e-6
#: a bound that only round-off reaches is at most `CHANGED`; below this share of it, values do not count
ROUNDING = 0.01


class FolderError(LacmeshError):
    """A folder that is not one of a run."""

    status = 3


Rows = dict[tuple[str, str], dict[str, Any]]


def changes(before: Path, after: Path) -> Iterator[str]:
    """The changes as lines: first their number, then each; one line for a case that one of the runs lacks.

    Raises FolderError.
    """
    old, new = read_rows(before), read_rows(after)
    both = {key: (old[key], row) for key, row in new.items() if key in old}
    kinds = {word: [key for key in both if changed(*both[key])] for word, changed in _KINDS.items()}
    gone, added = _without(old, new), _without(new, old)
    counts = ", ".join(f"{len(keys)} {word}" for word, keys in kinds.items())
    yield f"{len(both)} results in both: {counts}; gone: {len(gone)}, new: {len(added)}"
    for word, keys in kinds.items():
        yield from (f"{word}: {': '.join(key)}: {' -> '.join(map(_in_words, both[key]))}" for key in keys)
    yield from (f"gone: {line}" for line in gone)
    yield from (f"new: {line}" for line in added)


def read_rows(path: Path) -> Rows:
    """Results with a bound, by case and quantity, of a run's folder, its `results.json`, or figures that are kept.

    Where a case has a quantity twice, the second is numbered. Raises FolderError.
    """
    try:
        content = json.loads((path / RESULTS if path.is_dir() else path).read_text(encoding="utf-8"))
        found, seen = dict[tuple[str, str], dict[str, Any]](), Counter[tuple[str, str]]()
        for row in content["results"]:
            row = dict(zip(content["columns"], row, strict=True)) if "columns" in content else row
            if row["bound"] != "informative" or not row["passed"]:
                case = f"{row['family']}/{row['case']}" if "family" in row else row["case"]
                seen[case, row["quantity"]] += 1
                again = seen[case, row["quantity"]]
                found[case, f"{row['quantity']} ({again})" if again > 1 else row["quantity"]] = row
        return found
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise FolderError(f"{path} is not the folder of a run ({error}); name one that `run -o` made") from error


def _without(some: Rows, others: Rows) -> list[str]:
    """The results of some rows that others lack; the case alone where they lack it."""
    cases = {case for case, _ in others}
    return list(dict.fromkeys(f"{c}: {q}" if c in cases else c for c, q in some if (c, q) not in others))


def _differ(a: float | None, b: float | None, rounding: float = 0.0) -> bool:
    if a is None or b is None:
        return a is not b
    return abs(a - b) > max(CHANGED * max(abs(a), abs(b)), rounding)


def _another_value(old: dict[str, Any], new: dict[str, Any]) -> bool:
    limit = new["expected"] if new["bound"] == "at most" and new["expected"] <= CHANGED else 0.0
    return _differ(old["value"], new["value"], ROUNDING * limit)


def _another_bound(old: dict[str, Any], new: dict[str, Any]) -> bool:
    return old["bound"] != new["bound"] or any(_differ(old[name], new[name]) for name in ("expected", "tolerance"))


_KINDS = {
    "missed now": lambda old, new: old["passed"] and not new["passed"],
    "met now": lambda old, new: new["passed"] and not old["passed"],
    "with another bound": _another_bound,
    "with another value": _another_value,
}


def _in_words(row: dict[str, Any]) -> str:
    value = "no number" if row["value"] is None else f"{row['value']:.9g}"
    within = f" within {row['tolerance']}" if row["tolerance"] else ""
    return f"{value} ({row['bound']} {row['expected']}{within})"
