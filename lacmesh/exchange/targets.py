"""Cells that target programs can take: those of a mesh as it is, and those that a cut would give.

    gmsh        the cells of msh
    aster       code_aster, by MED; that MED has a name for cells does not mean that its models accept them
    calculix    CalculiX, by .inp
    abaqus      Abaqus, by .inp
    fenics      dolfinx, by XDMF: one type of cells in a mesh, as its `read_mesh` asks
    lacsolver   lacsolver, by any format: all cells of order 1 and 2, mixed

The names of the cells come from the tables of the formats; dolfinx's types are those that its reader of XDMF knows
(`xdmf_utils.cpp`), and it takes no mixture of types.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.cutting.cut import cut_skin, is_cut
from lacmesh.errors import CutError, DataError, LacmeshWarning, RequestError, did_you_mean
from lacmesh.formats.inp.elements import element_name
from lacmesh.formats.orders import MED_CELLS, XDMF_CELLS
from lacmesh.mesh import Mesh

TARGETS: Mapping[str, str] = {
    "gmsh": "gmsh",
    "aster": "code_aster",
    "calculix": "CalculiX",
    "abaqus": "Abaqus",
    "fenics": "dolfinx",
    "lacsolver": "lacsolver",
}
#: Cells that dolfinx reads as cells of a mesh.
_FENICS = ("SEG2", "SEG3", "TRIA3", "TRIA6", "QUAD4", "QUAD9", "TETRA4", "TETRA10", "HEXA8", "HEXA27")


def element(kind: str, target: str, plane: bool = False) -> str | None:
    """Name that a target has for a cell of type `kind`, None if it has none; `plane`: in a plane mesh.

    >>> element("HEXA8", "calculix"), element("PYRAM5", "calculix"), element("TRIA3", "calculix", plane=True)
    ('C3D8', None, 'CPS3')
    """
    if target == "gmsh":
        number = ALL_CELLS[kind].msh
        return None if number is None else str(number)
    if target == "aster":
        return MED_CELLS[kind].name if kind in MED_CELLS else None
    if target == "fenics":
        return XDMF_CELLS[kind].name if kind in _FENICS else None
    if kind not in CELLS:
        return None
    if target == "lacsolver":
        return kind if CELLS[kind].dim else None
    return element_name(kind, target, "CPS" if plane else None, skin=False)


def refused(mesh: Mesh, target: str) -> dict[str, int]:
    """Number of the cells that a target cannot take, by type; for dolfinx, also several types in one dimension.

    Cells below the mesh's dimension matter to gmsh and code_aster, and facets to dolfinx; .inp files hold them as
    surfaces or sets of nodes. Raises RequestError for a target that is none.
    """
    if target not in TARGETS:
        raise RequestError(f"no target {target!r}{did_you_mean(target, TARGETS)}")
    lowest = {"gmsh": 0, "aster": 0, "fenics": mesh.dim - 1}.get(target, mesh.dim)
    cells = {kind: n for kind, n in mesh.cells_by_type.items() if ALL_CELLS[kind].dim >= lowest}
    wrong = {kind: n for kind, n in cells.items() if element(kind, target, mesh.space_dim == 2) is None}
    if target == "fenics" and not wrong:
        for dim in (mesh.dim, mesh.dim - 1):
            mixed = {kind: n for kind, n in cells.items() if ALL_CELLS[kind].dim == dim}
            if len(mixed) > 1:
                return mixed
    return wrong


def check_cells(mesh: Mesh, target: str) -> None:
    """Raise DataError if a mesh as it is has cells that a target cannot take, RequestError for an unknown target."""
    wrong = refused(mesh, target)
    if wrong:
        raise DataError(f"the mesh has {_listed(wrong)}, and {_reason(mesh, wrong, target)}; mesh it anew")


def check_target_cells(
    mesh: Mesh,
    slave: str | int | Sequence[str | int],
    target: str,
    *,
    hexa: str = "pyramid",
    interface: str = "both",
    skin_only: bool = False,
    recognise: bool | None = None,
) -> None:
    """Raise CutError if the cut mesh would have cells that a target cannot take; the error says what to try.

    The options are those of `cut_skin`, whose errors come first (GroupNotFoundError, CutError). Costs a cut of the mesh
    without its data. Raises RequestError for a target that is none.
    """
    there, done = refused(mesh, target), is_cut(mesh) and recognise is not False
    options: dict[str, Any] = {"interface": interface, "skin_only": skin_only, "recognise": recognise}
    after = mesh if done else _cut(mesh, slave, hexa=hexa, **options)
    wrong = refused(after, target)
    if not wrong:
        return
    if done:
        reason = f"the mesh is cut already, has {_listed(wrong)}, and {_reason(after, wrong, target)}"
        advice = f"cut the mesh that it came from with --for {target}, which says what to try"
    else:
        counts = [f"{n} {kind} ({max(0, n - there.get(kind, 0))} of them new)" for kind, n in sorted(wrong.items())]
        reason = f"the mesh that is cut would have {', '.join(counts)}, and {_reason(after, wrong, target)}"
        if there:
            advice = f"it has {_listed(there)} before it is cut: mesh it anew"
        else:
            advice = _advice(mesh, _cut(mesh, slave, hexa="hexa", **options), target)
    bad = [cell for kind, cells, _ in after.select(np.arange(after.n_cells)) if kind in wrong for cell in cells[:1000]]
    raise CutError(f"{reason}; {advice}", after.cell_number[bad])


def _listed(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{n} {kind}" for kind, n in sorted(counts.items()))


def _reason(mesh: Mesh, wrong: Mapping[str, int], target: str) -> str:
    mixture = all(element(kind, target, mesh.space_dim == 2) for kind in wrong)
    return f"{TARGETS[target]} {'takes no mixture of cells' if mixture else 'has no such cells'}"


def _cut(mesh: Mesh, slave: str | int | Sequence[str | int], **options: Any) -> Mesh:
    """Cut the mesh without its data, node groups and model, which do not matter to the types of its cells."""
    data = {"entity": mesh.cell_data["entity"]} if "entity" in mesh.cell_data else {}
    bare = replace(mesh, cell_data=data, node_data={}, node_groups={}, steps={}, model=None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        return cut_skin(bare, slave, **options).mesh


def _advice(mesh: Mesh, with_hexa: Mesh, target: str) -> str:
    """Advice on refused cells that the cut makes; `with_hexa`: the mesh cut by the variant hexa."""
    wrong = refused(with_hexa, target)
    if not wrong:
        return "--hexa hexa makes hexahedra instead"
    children = [cells for kind, cells, _ in with_hexa.select(np.arange(with_hexa.n_cells)) if kind in wrong]
    number = with_hexa.cell_data["lac_parent"][np.concatenate(children)]
    parents = np.flatnonzero(np.isin(mesh.cell_number, number))
    behind = _listed({kind: len(cells) for kind, cells, _ in mesh.select(parents)})
    anew = "tetrahedra, or with hexahedra and --hexa hexa"
    return f"no option changes that for the {behind} behind the slave surface: mesh these with {anew}"
