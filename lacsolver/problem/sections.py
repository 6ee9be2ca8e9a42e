"""Bodies divided at the sections of bolts: two skins for each [[pretension]], before slaves are cut."""

from __future__ import annotations

from collections.abc import Sequence

from lacmesh.errors import LacmeshError
from lacmesh.mesh import Mesh
from lacsolver.case import Case, Pretension
from lacsolver.constraints.pretension import sides_of
from lacsolver.space.places import wrong


def with_sections(case: Case, mesh: Mesh) -> Mesh:
    """Return the mesh, divided at each section of a case whose two skins it lacks. Raises CaseError."""
    records = [one for one in case.pretension if not set(sides_of(mesh, one)) <= mesh.cell_groups.keys()]
    if not records:
        return mesh
    from lacmesh.cutting.split import split_skins

    for record in records:
        try:
            mesh.cells_of(record.group)
        except LacmeshError as error:
            a, b = sides_of(mesh, record)
            raise wrong(record, f"{error}, and no two surfaces {a!r} and {b!r}") from None
    try:
        return split_skins(mesh, [record.group for record in records]).mesh
    except LacmeshError as error:
        raise wrong(_culprit(records, mesh), f"the body is not divided: {error}") from None


def _culprit(records: Sequence[Pretension], mesh: Mesh) -> Pretension:
    """Return the record whose faces cannot be divided by themselves, or the first."""
    from lacmesh.cutting.split import split_skins

    for record in records:
        try:
            split_skins(mesh, [record.group])
        except LacmeshError:
            return record
    return records[0]
