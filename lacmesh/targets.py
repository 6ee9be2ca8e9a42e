"""What the programs that a mesh is meant for can take: which cells, and which children a cut would give them.

    gmsh        the cells of msh
    aster       code_aster, by MED; a name for the cells is no promise that its models take them
    calculix    CalculiX, by .inp
    abaqus      Abaqus, by .inp
    fenics      dolfinx, by XDMF: one type of cells in a mesh, as its `read_mesh` asks

The names of the cells come from the tables of the formats; dolfinx's types are those that its reader of XDMF knows
(`xdmf_utils.cpp`), and it takes no mixture of types.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lacmesh.cells import ALL_CELLS, CELLS
from lacmesh.cut import cut_skin, is_cut
from lacmesh.errors import CutError, DataError, LacmeshWarning, RequestError, did_you_mean
from lacmesh.formats.inp_write_types import card
from lacmesh.formats.med_types import MED_TYPES
from lacmesh.formats.xdmf_types import OF_TYPE as XDMF_OF_TYPE
from lacmesh.mesh import Mesh

TARGETS: Mapping[str, str] = {
    "gmsh": "gmsh",
    "aster": "code_aster",
    "calculix": "CalculiX",
    "abaqus": "Abaqus",
    "fenics": "dolfinx",
}
_MED_NAMES = {kind.type: kind.name for kind in MED_TYPES}
#: Cells that dolfinx reads as cells of a mesh.
_FENICS = ("SEG2", "SEG3", "TRIA3", "TRIA6", "QUAD4", "QUAD9", "TETRA4", "TETRA10", "HEXA8", "HEXA27")


def element(kind: str, target: str, plane: bool = False) -> str | None:
    """What a target calls a cell of type `kind`, None where it has none; `plane`: in a plane mesh.

    >>> element("HEXA8", "calculix"), element("PYRAM5", "calculix"), element("TRIA3", "calculix", plane=True)
    ('C3D8', None, 'CPS3')
    """
    if target == "gmsh":
        number = ALL_CELLS[kind].msh
        return None if number is None else str(number)
    if target == "aster":
        return _MED_NAMES.get(kind)
    if target == "fenics":
        return XDMF_OF_TYPE[kind].name if kind in _FENICS else None
    if kind not in CELLS:
        return None
    return card(kind, target, "CPS" if plane else None, skin=False)


def refused(mesh: Mesh, target: str) -> dict[str, int]:
    """type -> number of the cells that a target cannot take; for dolfinx, all of them where types are mixed.

    Cells below the mesh's dimension matter to gmsh and code_aster, and faces to dolfinx; .inp files hold them as
    surfaces or sets of nodes.
    """
    _check_target(target)
    solid = {kind: n for kind, n in mesh.cells_by_type.items() if ALL_CELLS[kind].dim == mesh.dim}
    if target in ("calculix", "abaqus"):
        asked = solid
    else:
        asked = {k: n for k, n in mesh.cells_by_type.items() if target != "fenics" or ALL_CELLS[k].dim >= mesh.dim - 1}
    wrong = {kind: n for kind, n in asked.items() if element(kind, target, mesh.space_dim == 2) is None}
    if target == "fenics" and len(solid) > 1 and not wrong:
        return solid
    return wrong


def check_cells(mesh: Mesh, target: str) -> None:
    """Raise DataError where a mesh as it is has cells that a target cannot take (RequestError: it is no target)."""
    wrong = refused(mesh, target)
    if wrong:
        listed = ", ".join(f"{n} {kind}" for kind, n in sorted(wrong.items()))
        raise DataError(f"the mesh has {listed}, and {TARGETS[target]} {_reason(mesh, wrong, target)}; mesh it anew")


def check_target_cells(
    mesh: Mesh,
    slave: str | int | Sequence[str | int],
    target: str,
    *,
    hexa: str = "pyramid",
    interface: str = "both",
    skin_only: bool = False,
) -> None:
    """Raise CutError where a mesh, cut so, would have cells that a target cannot take; the error says what to try.

    The options are those of `cut_skin`, whose errors come first (GroupNotFoundError, CutError). Costs a cut of the mesh
    without its data. Raises RequestError for a target that is none.
    """
    _check_target(target)
    before = mesh.cells_by_type
    after = _cut(mesh, slave, hexa, interface, skin_only)
    wrong = refused(after, target)
    if not wrong:
        return
    new = {kind: max(0, n - before.get(kind, 0)) for kind, n in wrong.items()}
    listed = ", ".join(f"{n} {kind} ({new[kind]} of them new)" for kind, n in sorted(wrong.items()))
    message = f"the mesh that is cut would have {listed}, and {TARGETS[target]} {_reason(mesh, wrong, target)}; "
    bad = [c for kind, cells, _ in mesh.select(np.arange(mesh.n_cells)) if kind in wrong for c in cells[:1000]]
    raise CutError(message + _advice(mesh, slave, target, hexa, interface, skin_only), mesh.cell_number[bad])


def _reason(mesh: Mesh, wrong: Mapping[str, int], target: str) -> str:
    mixture = all(element(kind, target, mesh.space_dim == 2) for kind in wrong)
    return "takes no mixture of cells" if mixture else "has no such cells"


def _check_target(target: str) -> None:
    if target not in TARGETS:
        raise RequestError(f"no target {target!r}{did_you_mean(target, TARGETS)}")


def _cut(mesh: Mesh, slave: str | int | Sequence[str | int], hexa: str, interface: str, skin_only: bool) -> Mesh:
    """The mesh cut, without what does not matter to its types."""
    if is_cut(mesh):
        return mesh
    data = {"entity": mesh.cell_data["entity"]} if "entity" in mesh.cell_data else {}
    bare = replace(mesh, cell_data=data, node_data={}, node_groups={}, steps={}, model=None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        return cut_skin(bare, slave, hexa=hexa, interface=interface, skin_only=skin_only).mesh


def _advice(
    mesh: Mesh,
    slave: str | int | Sequence[str | int],
    target: str,
    hexa: str,
    interface: str,
    skin_only: bool,
) -> str:
    """What to try: another variant where that serves, else other cells behind the skin."""
    there = refused(mesh, target)
    if there and not is_cut(mesh):
        return f"it has {', '.join(f'{n} {kind}' for kind, n in sorted(there.items()))} before it is cut: mesh it anew"
    if not is_cut(mesh) and hexa != "hexa" and not refused(_cut(mesh, slave, "hexa", interface, skin_only), target):
        return "--hexa hexa makes hexahedra instead"
    behind = sorted(kind for kind in mesh.cells_by_type if ALL_CELLS[kind].dim == mesh.dim)
    if any(kind.startswith(("PENTA", "PYRAM")) for kind in behind):
        return "no option changes that for prisms and pyramids: mesh what is behind the slave skin with other cells"
    if is_cut(mesh):
        return "it is cut already: cut the mesh it came from with --hexa hexa"
    return "mesh what is behind the slave skin with tetrahedra (or triangles), or hexahedra and --hexa hexa"
