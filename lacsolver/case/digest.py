"""Digest of everything that the solution of a case depends on, so that a restart can check that the case is the same.

A restart needs the same mesh, bodies, conditions and loads. [solver], [output], [[probe]] and the length of steps may
differ. A plain number of a load enters together with the time at which it is reached, a Python function by its name. A
mesh enters as it is in memory, whatever file it came from: its points, its cells, the records of its cut, and the
groups that the case names outside [[probe]].
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from lacmesh.errors import GroupNotFoundError
from lacsolver.case.case import Case, drafted
from lacsolver.case.formula import Formula
from lacsolver.case.groups import named_groups
from lacsolver.case.value import Value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lacmesh.mesh import Mesh

#: sections that a solution does not depend on
FREE = ("steps", "solver", "output", "probe")


def fingerprint(case: Case, mesh: Mesh) -> dict[str, str]:
    """Return a digest of each part of a case, by the part's name (`model`, `pressure` ...), and one of its `mesh`."""
    top = drafted(case, ()).values
    parts: dict[str, Any] = {name: value for name, value in top.items() if name != "mesh"}
    for path, record in case.records():
        if path[0] not in FREE:
            parts.setdefault(str(path[0]), []).append(drafted(record, path).values)
    told = {name: _digest(json.dumps(_plain(part), sort_keys=True).encode()) for name, part in parts.items()}
    return {"mesh": _mesh_digest(case, mesh), **told}


def digest(case: Case, mesh: Mesh) -> str:
    """Return one digest of a whole case and its mesh."""
    return _digest(json.dumps(fingerprint(case, mesh), sort_keys=True).encode())


def changed(before: Mapping[str, str], now: Mapping[str, str]) -> tuple[str, ...]:
    """Return the names of the parts in which two fingerprints differ, () if the case is the same."""
    return tuple(name for name in dict.fromkeys([*before, *now]) if before.get(name) != now.get(name))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def _mesh_digest(case: Case, mesh: Mesh) -> str:
    made = hashlib.sha256(f"zones {mesh.zones}".encode())
    for name, values in _arrays(case, mesh):
        made.update(f"{name} {values.shape}".encode())
        made.update(values.tobytes())
    return made.hexdigest()[:32]


def _arrays(case: Case, mesh: Mesh) -> Iterator[tuple[str, NDArray]]:
    """Yield the arrays of a mesh that a solution depends on, with their names; all integers are 64 bits wide."""
    yield "points", mesh.points + 0.0  # -0.0 is 0.0
    for block in mesh.blocks:
        yield f"cells {block.type}", block.nodes.astype("int64")
    for name in ("lac_macro", "lac_zone"):
        if name in mesh.cell_data:
            yield f"record {name}", mesh.cell_data[name].astype("int64")
    used = (record for path, record in case.records() if path[0] not in FREE)
    for name in sorted({group for record in used for _, group in named_groups(record)}):
        with suppress(GroupNotFoundError):  # then it is one of nodes
            yield f"cell group {name}", mesh.cells_of(name).astype("int64")
        if name in mesh.node_groups:
            yield f"node group {name}", mesh.node_groups[name].astype("int64")


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
