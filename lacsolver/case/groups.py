"""Look up the groups that a case names in a mesh; all missing groups are reported at once, each with its line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from lacmesh.errors import RequestError, did_you_mean
from lacsolver.case.case import Case
from lacsolver.case.entry import Entry
from lacsolver.case.errors import CaseError, Issue

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh


def check_groups(case: Case, mesh: Mesh) -> None:
    """Raise CaseError if the mesh lacks a group that the case names, as cells or, where allowed, as nodes."""
    records = (case, *(record for _, record in case.records()))
    problems = [problem for record in records for problem in _missing(record, mesh)]
    if problems:
        raise CaseError(problems, None)


def named_groups(record: Entry) -> Iterator[tuple[str, str]]:
    """Yield the groups of the mesh that a record names, each with its key: `("slave", "top")`."""
    for name, key in record.KEYS.items():
        groups = getattr(record, name)
        if key.kind.is_group and groups is not None and not isinstance(groups, float):
            several = [groups] if isinstance(groups, str) else groups
            named = [group.get("group") if isinstance(group, Mapping) else group for group in several]
            yield from ((name, group) for group in named if group is not None)


def _missing(record: Entry, mesh: Mesh) -> Iterator[Issue]:
    kind = getattr(record, "kind", None)
    nodes_too = "kind" in record.KEYS
    for key, group in named_groups(record):
        message = _lookup(group, mesh, cells=kind != "node", nodes=nodes_too and kind != "cell")
        if message:
            if isinstance(record, Case):
                yield Issue(f"{record.before(key)}: {message}")
                continue
            place = f"{record.place}: " if record.place else ""
            yield Issue(f"{place}{record.SECTION.name}.{key}: {message}")


def _lookup(group: str, mesh: Mesh, *, cells: bool, nodes: bool) -> str | None:
    """Return a message if the mesh has no such group, else None."""
    if nodes and group in mesh.node_groups:
        return None
    if not cells:
        return f"no node group named {group!r}{did_you_mean(group, mesh.node_groups)}"
    try:
        mesh.cells_of(group)
    except RequestError as error:
        if group in mesh.node_groups:
            return f"{group!r} is a group of nodes; a group of cells is needed, such as the faces of a surface"
        if not nodes:
            return str(error)
        return f"no group named {group!r}{did_you_mean(group, [*mesh.cell_groups, *mesh.node_groups])}"
    return None
