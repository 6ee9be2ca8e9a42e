"""What makes a case the case that it is: a digest of everything that its solution depends on.

A restart goes on with the same case: same mesh (by what the file holds, not where it lies), bodies, conditions and
loads. [solver], [output], [[probe]] and the length of steps may differ. A number under a load counts with the time at
which it is reached. A function of Python counts by its name.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lacmesh.errors import ReadError
from lacsolver.case.case import Case, drafted
from lacsolver.case.formula import Formula
from lacsolver.case.value import Value

#: sections that a solution does not depend on
FREE = ("steps", "solver", "output", "probe")


def fingerprint(case: Case) -> dict[str, str]:
    """A digest of each part of a case, by the part's name (`mesh`, `model`, `pressure` ...). Raises ReadError."""
    top = drafted(case, ()).values
    parts: dict[str, Any] = {name: value for name, value in top.items() if name != "mesh"}
    for path, record in case.records():
        if path[0] not in FREE:
            parts.setdefault(str(path[0]), []).append(drafted(record, path).values)
    told = {name: _digest(json.dumps(_plain(part), sort_keys=True).encode()) for name, part in parts.items()}
    return {"mesh": _file_digest(case.mesh), **told}


def digest(case: Case) -> str:
    """One digest of a case as a whole. Raises ReadError where the mesh's file cannot be read."""
    return _digest(json.dumps(fingerprint(case), sort_keys=True).encode())


def changed(before: Mapping[str, str], case: Case) -> tuple[str, ...]:
    """The names of the parts in which a case differs from one whose fingerprint was kept; none if it is the same."""
    now = fingerprint(case)
    return tuple(name for name in dict.fromkeys([*before, *now]) if before.get(name) != now.get(name))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def _file_digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:32]
    except OSError as error:
        raise ReadError(path, f"cannot be read ({error.strerror or error})") from None


def _plain(part: Any) -> Any:
    """The part in what JSON has."""
    if isinstance(part, Value):
        ramp = part.ramp_end if part.source != 0 else None
        return [_plain(part.source), ramp]
    if isinstance(part, Formula):
        return part.text
    if isinstance(part, Mapping):
        return {name: _plain(item) for name, item in part.items()}
    if isinstance(part, (list, tuple)):
        return [_plain(item) for item in part]
    if callable(part):
        return f"function {getattr(part, '__module__', '')}.{getattr(part, '__qualname__', type(part).__name__)}"
    return part
