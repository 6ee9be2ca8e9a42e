"""Digest of everything that the solution of a case depends on, so that a restart can check that the case is the same.

A restart needs the same mesh, bodies, conditions and loads. [solver], [output], [[probe]] and the length of steps may
differ. A plain number of a load enters together with the time at which it is reached, a Python function by its name. A
mesh enters as it is in memory, whatever file it came from: its points, its cells, the records of its cut, and the
groups that the case names outside [[probe]]. Processes that have parts of a mesh make its digest together, which is the
one that a process with the whole mesh makes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from lacsolver.case.case import Case
from lacsolver.case.formula import Formula
from lacsolver.case.groups import named_groups
from lacsolver.case.value import Value

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh
    from lacsolver.distributed.share import Share

#: sections that a solution does not depend on
FREE = ("steps", "solver", "output", "probe")


def fingerprint(case: Case, mesh: Mesh, share: Share | None = None) -> dict[str, str]:
    """Return a digest of each part of a case, by the part's name (`model`, `pressure` ...), and one of its `mesh`.

    `share`: where the mesh is a part, which part of the whole it is; all processes call this, and get the same.
    """
    parts: dict[str, Any] = {name: value for name, value in case.told().items() if name != "mesh"}
    for path, record in case.records():
        if path[0] not in FREE:
            parts.setdefault(str(path[0]), []).append(record.told())
    digests = {name: _digest(json.dumps(_plain(part), sort_keys=True).encode()) for name, part in parts.items()}
    from lacsolver.distributed.mesh_digest import mesh_digest  # with numpy, which reading a case does not need

    mesh_print = mesh_digest(_groups(case), mesh) if share is None else mesh_digest(_groups(case), mesh, share)
    return {"mesh": mesh_print, **digests}


def digest(case: Case, mesh: Mesh) -> str:
    """Return one digest of a whole case and its mesh."""
    return _digest(json.dumps(fingerprint(case, mesh), sort_keys=True).encode())


def changed(before: Mapping[str, str], now: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of the parts in which two fingerprints differ, () if the case is the same."""
    return tuple(name for name in dict.fromkeys([*before, *now]) if before.get(name) != now.get(name))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def _groups(case: Case) -> list[str]:
    """Return the names of the groups that a solution depends on, in alphabetical order."""
    used = (case, *(record for path, record in case.records() if path[0] not in FREE))
    return sorted({group for record in used for _, group in named_groups(record)})


def _plain(part: Any) -> Any:
    """Return the part in types that JSON has."""
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
