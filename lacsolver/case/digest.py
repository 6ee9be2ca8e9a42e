"""What makes a case the case that it is: a digest of everything that its solution depends on.

A restart goes on with the same case: same mesh, bodies, conditions and loads. [solver], [output], [[probe]] and the
length of steps may differ. A number under a load counts with the time at which it is reached. A function of Python
counts by its name. A mesh counts as it is in memory, whatever file it came from: its points, its cells, the records of
its cut, and the groups that the case names outside [[probe]].
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
    """A digest of each part of a case, by the part's name (`model`, `pressure` ...), and of the `mesh` it is run on."""
    top = drafted(case, ()).values
    parts: dict[str, Any] = {name: value for name, value in top.items() if name != "mesh"}
    for path, record in case.records():
        if path[0] not in FREE:
            parts.setdefault(str(path[0]), []).append(drafted(record, path).values)
    told = {name: _digest(json.dumps(_plain(part), sort_keys=True).encode()) for name, part in parts.items()}
    return {"mesh": _mesh_digest(case, mesh), **told}


def digest(case: Case, mesh: Mesh) -> str:
    """One digest of a case as a whole, and of the mesh it is run on."""
    return _digest(json.dumps(fingerprint(case, mesh), sort_keys=True).encode())


def changed(before: Mapping[str, str], now: Mapping[str, str]) -> tuple[str, ...]:
    """The names of the parts in which two fingerprints differ; none if the case is the same."""
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
    """What of a mesh a solution depends on, each array with its name; integers as wide as one another."""
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
