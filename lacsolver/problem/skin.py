"""The mesh of a case with its slaves cut: a cut in the mesh's file is used as it is, else all slaves are cut here."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

import lacmesh
from lacmesh.checks import solution_defects
from lacmesh.checks.findings import named
from lacmesh.cutting.records import Cut, is_cut
from lacmesh.errors import LacmeshError, LacmeshWarning, ReadError, RequestError, did_you_mean
from lacmesh.mesh import Mesh, MeshLike, as_mesh
from lacsolver.case import Case, CaseError, Issue, Pretension
from lacsolver.case.records import PairEntry
from lacsolver.constraints.pretension import coincide, sides_of
from lacsolver.problem.sections import with_sections

#: suffixes of files that are meshes, for a file name that is misspelt
_MESHES = (".msh", ".med", ".mail", ".inp", ".vtu", ".xdmf")


def mesh_of(case: Case, mesh: MeshLike | None = None) -> Mesh:
    """Return the mesh, or the one that a case names; a path is read. Raises ReadError, RequestError for none."""
    if mesh is None:
        check_mesh_file(case)
    mesh = case.mesh if mesh is None else mesh
    if mesh is None:
        raise RequestError("the case names no mesh: give one, as solve(case, mesh) or Case(mesh=...)")
    return as_mesh(mesh)


def check_mesh_file(case: Case) -> None:
    """Raise ReadError, with the line of the case, if the file that it names as its mesh does not exist."""
    if not isinstance(case.mesh, Path) or case.path is None or case.mesh.exists():
        return
    folder, name = case.mesh.parent, case.mesh.name
    if folder.is_dir():
        meshes = [file.name for file in folder.iterdir() if file.suffix.lower() in (case.mesh.suffix.lower(), *_MESHES)]
        advice = did_you_mean(name, meshes) if meshes else f"; {folder} has no mesh"
    else:
        advice = f"; the folder {folder} does not exist"
    issue = case.wrong(f"is {name!r}, a file that does not exist{advice}", "mesh")
    raise ReadError(case.path, issue.message, f"line {issue.line}")


def prepared(case: Case, mesh: Mesh | None = None) -> Mesh:
    """Return the mesh with the cut that a case's contacts and ties need. Raises ReadError, CaseError, CutError."""
    mesh = with_sections(case, mesh_of(case, mesh))
    slaves: dict[str, PairEntry | Pretension] = {record.slave: record for record in (*case.contact, *case.ties)}
    slaves |= {sides_of(mesh, record)[0]: record for record in case.pretension if not coincide(mesh, record)}
    if is_cut(mesh):
        zones = set(Cut(mesh).zones)
        whole = [name for name in slaves if name not in zones and not _carried(mesh, name)]
        if whole:
            record = slaves[whole[0]]
            message = f"the mesh carries a cut of {', '.join(sorted(zones))}, and none of slave {whole[0]!r}"
            raise CaseError([Issue(f"{_place(record)}{message}; cut all slaves at once, or give the uncut mesh")])
        _warn_of_stars(case, mesh)
        return mesh
    if not slaves:
        return mesh
    options = case.cut_options()
    try:
        return lacmesh.cut_skin(mesh, list(slaves), **options).mesh
    except LacmeshError as error:
        raise CaseError([Issue(f"{_place(next(iter(slaves.values())))}{error}")]) from None


def check_mesh(case: Case, mesh: Mesh) -> None:
    """Check a case's mesh for defects that would make the solution wrong without a sign: see `solution_defects`.

    Raises CaseError if the solution is certainly wrong, and warns if it may be.
    """
    records = {(record.slave, record.master): record for record in reversed(case.contact)}
    wrong = []
    for finding in solution_defects(mesh, [(record.slave, record.master) for record in case.contact]):
        place = _place(records[finding.where.pair]) if finding.where.pair else ""
        message = place + named(finding.message, finding.rule)
        if finding.severity == "error":
            wrong.append(Issue(message))
        else:
            warnings.warn(LacmeshWarning(message), stacklevel=3)
    if wrong:
        raise CaseError(wrong)


def _warn_of_stars(case: Case, mesh: Mesh) -> None:
    """Warn if a case asks for stars, and each slave face of its mesh has been cut."""
    record = next((record for record in (*case.contact, *case.ties) if record.macro == "stars"), None)
    parent = mesh.cell_data.get("lac_parent", np.full(mesh.n_cells, -1))
    if record is not None and (parent[mesh.cell_data["lac_macro"] >= 0] >= 0).all():
        message = 'macro = "stars" has no effect, as the mesh has been cut already; name the uncut mesh'
        warnings.warn(LacmeshWarning(_place(record) + message), stacklevel=4)


def _carried(mesh: Mesh, name: str) -> bool:
    """True if every face of a group is part of a macro-element, whatever the name of the zone."""
    cells = mesh.cells_of(name)
    return bool(len(cells)) and bool((Cut(mesh).macro_of_face[cells] >= 0).all())


def _place(record: object) -> str:
    place = getattr(record, "place", "")
    return f"{place}: " if place else ""
