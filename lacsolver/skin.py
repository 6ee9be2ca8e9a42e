"""The mesh of a case, its slaves cut: the cut that a file carries is taken as it is, other slaves are cut here."""

from __future__ import annotations

from collections import defaultdict

import lacmesh
from lacmesh.errors import LacmeshError, RequestError
from lacmesh.mesh import Mesh
from lacmesh.records import Cut, is_cut
from lacsolver.case import Case, CaseError, Problem


def prepared(case: Case, mesh: Mesh | None = None) -> Mesh:
    """The mesh that a case's contacts and ties can be solved on. Raises ReadError, CaseError, CutError."""
    mesh = lacmesh.read(case.mesh) if mesh is None else mesh
    slaves = {record.slave: record for record in (*case.contact, *case.tie)}
    if is_cut(mesh):
        zones = set(Cut(mesh).zones)
        whole = [name for name in slaves if name not in zones and not _carried(mesh, name)]
        if whole:
            record = slaves[whole[0]]
            message = f"the mesh carries a cut of {', '.join(sorted(zones))}, and none of slave {whole[0]!r}"
            raise CaseError([Problem(f"{_place(record)}{message}; cut all slaves at once, or give the uncut mesh")])
        return mesh
    by_hexa: defaultdict[str, list[str]] = defaultdict(list)
    for name, record in slaves.items():
        by_hexa[record.hexa].append(name)
    if len(by_hexa) > 1:
        raise RequestError("slaves of one mesh are cut at once, so hexa must be the same for all of them")
    for hexa, names in by_hexa.items():
        try:
            return lacmesh.cut_skin(mesh, names, hexa=hexa).mesh
        except LacmeshError as error:
            raise CaseError([Problem(f"{_place(slaves[names[0]])}{error}")]) from None
    return mesh


def _carried(mesh: Mesh, name: str) -> bool:
    """Whether every face of a group is part of a macro-element, whatever the zone is called."""
    cells = mesh.cells_of(name)
    return bool(len(cells)) and bool((Cut(mesh).macro_of_face[cells] >= 0).all())


def _place(record: object) -> str:
    place = getattr(record, "place", "")
    return f"{place}: " if place else ""
