"""Targets: what each takes, and what a cut would give it, said before it is made."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacmesh.cut import cut_skin
from lacmesh.errors import CutError, GroupNotFoundError, RequestError
from lacmesh.formats import write
from lacmesh.formats.inp_write_types import card
from lacmesh.mesh import Mesh
from lacmesh.order import raise_order
from lacmesh.targets import TARGETS, check_target_cells, element, refused
from tests.formats.feature_cases import one_cell
from tests.meshes import box, cell_with_faces

SUFFIX = {"gmsh": ".msh", "aster": ".med", "calculix": ".inp", "abaqus": ".inp", "fenics": ".xdmf"}


def slave_box(**rest):
    points, cells = box(2)
    return Mesh.create(points, [("HEXA8", cells), ("QUAD4", [[0, 1, 4, 3]])], cell_groups={"slave": [8]}, **rest)


def cases():
    for kind, cell in CELLS.items():
        for number, facet in enumerate(cell.facets if cell.dim == 3 else ()):
            if [f.type for f in cell.facets].index(facet.type) == number:
                yield kind, number


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize("case", cases(), ids=lambda c: f"{c[0]}-{c[1]}")
def test_the_word_before_the_cut_is_the_truth_after_it(case, hexa, target):
    """For every cell and facet: refused if, and only if, the mesh that is then cut has a cell the target lacks."""
    mesh = cell_with_faces(case[0], [case[1]])
    after = cut_skin(mesh, "slave", hexa=hexa).mesh
    dims = (3,) if target in ("calculix", "abaqus") else (2, 3)
    kinds = [k for k in after.cells_by_type if CELLS[k].dim in dims]
    solids = [k for k in kinds if CELLS[k].dim == 3]
    fits = all(element(k, target) for k in kinds) and (target != "fenics" or len(solids) == 1)
    if fits:
        check_target_cells(mesh, "slave", target, hexa=hexa)
    else:
        with pytest.raises(CutError, match=TARGETS[target]):
            check_target_cells(mesh, "slave", target, hexa=hexa)


def test_calculix_has_no_pyramids():
    mesh = slave_box()
    with pytest.raises(CutError) as caught:
        check_target_cells(mesh, "slave", "calculix")
    assert str(caught.value) == (
        "the mesh that is cut would have 5 PYRAM5 (5 of them new), and CalculiX has no such cells; "
        "--hexa hexa makes hexahedra instead"
    )
    assert caught.value.status == 1
    check_target_cells(mesh, "slave", "calculix", hexa="hexa")
    check_target_cells(mesh, "slave", "abaqus")


def test_prisms_have_no_way():
    mesh = cell_with_faces("PENTA6", [0])
    for hexa in ("pyramid", "hexa"):
        with pytest.raises(CutError, match="no option changes that for prisms and pyramids"):
            check_target_cells(mesh, "slave", "calculix", hexa=hexa)


def test_dolfinx_takes_no_mixture():
    mesh = slave_box()
    with pytest.raises(CutError, match=r"5 PYRAM5 \(5 of them new\), and dolfinx has no such cells; --hexa hexa makes"):
        check_target_cells(mesh, "slave", "fenics")
    check_target_cells(mesh, "slave", "fenics", hexa="hexa")
    plane = Mesh.create(
        [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]],
        [("QUAD4", [[0, 1, 2, 3]]), ("TRIA3", [[1, 4, 2]]), ("SEG2", [[0, 1]])],
        cell_groups={"slave": [2]},
    )
    with pytest.raises(CutError, match="dolfinx takes no mixture of cells; it has 1 QUAD4, 1 TRIA3 before it is cut"):
        check_target_cells(plane, "slave", "fenics")


def test_serendipity_is_not_dolfinx():
    with pytest.raises(CutError, match="it has 8 HEXA20, 1 QUAD8 before it is cut: mesh it anew"):
        check_target_cells(raise_order(slave_box(), "2"), "slave", "fenics", hexa="hexa")


def test_a_mesh_that_is_cut_already():
    with pytest.raises(CutError, match="it is cut already: cut the mesh it came from with --hexa hexa"):
        check_target_cells(cut_skin(slave_box(), "slave").mesh, "slave", "calculix")


def test_a_wrong_name_is_the_first_error():
    with pytest.raises(GroupNotFoundError, match="did you mean slave"):
        check_target_cells(slave_box(), "slav", "calculix")
    with pytest.raises(RequestError, match="no target 'calculx'; did you mean calculix"):
        check_target_cells(slave_box(), "slave", "calculx")


@pytest.mark.parametrize("target", ["gmsh", "aster", "calculix", "abaqus", "fenics"])
@pytest.mark.parametrize("kind", CELLS)
def test_what_a_target_takes_is_what_its_format_writes(kind, target, tmp_path):
    """A cell with a name goes into the target's file; one without is refused there, or is not for that target."""
    mesh = one_cell(kind)
    options = {"target": target} if SUFFIX[target] == ".inp" else {}
    try:
        write(tmp_path / f"a{SUFFIX[target]}", mesh, **options)
        written = True
    except Exception:
        written = False
    if target in ("aster", "calculix", "abaqus"):
        assert written == (element(kind, target) is not None)
    elif target == "fenics":
        assert written or element(kind, target) is None
    else:
        assert element(kind, target) is not None or kind == "TRIA7"
    assert (kind in refused(mesh, target)) == (element(kind, target) is None)


def test_elements_are_those_of_the_formats():
    assert element("TETRA10", "gmsh") == "11" and element("TRIA7", "gmsh") is None
    assert element("PYRAM14", "aster") is None and element("PENTA18", "aster") == "P18"
    assert element("QUAD9", "fenics") == "Quadrilateral_9" and element("PENTA6", "fenics") is None
    assert element("TRIA6", "abaqus", plane=True) == card("TRIA6", "abaqus", "CPS", False)
    assert np.array_equal([element("SEG4", t) is not None for t in TARGETS], [True, True, False, False, False])
