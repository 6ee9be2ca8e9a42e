"""Targets: what each takes, and what a cut would give it, said before it is made."""

from contextlib import nullcontext

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacmesh.cutting.cut import cut_skin
from lacmesh.cutting.order import raise_order
from lacmesh.errors import CutError, DataError, GroupNotFoundError, RequestError
from lacmesh.exchange.targets import TARGETS, check_cells, check_target_cells, element, refused
from lacmesh.formats import write
from lacmesh.formats.inp.elements import element_name
from lacmesh.generate import box
from lacmesh.mesh import Mesh
from lacsolver.space.rules import SOLID_CELLS
from tests.formats.feature_cases import one_cell
from tests.meshes import cell_with_faces

#: every solid cell, with one facet of each type that it has
CASES = [
    (kind, [f.type for f in cell.facets].index(facet))
    for kind, cell in CELLS.items()
    for facet in dict.fromkeys(f.type for f in cell.facets if cell.dim == 3)
]


@pytest.mark.rows(
    "TETRA4-0-hexa; TETRA10-0-pyramid; HEXA8-0-pyramid; HEXA20-0-hexa; HEXA27-0-hexa; PENTA6-0-pyramid; "
    "PENTA15-2-hexa; PENTA18-2-pyramid; PYRAM5-1-hexa; PYRAM13-1-pyramid; PYRAM14-0-hexa"
)
@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize(("kind", "facet"), CASES)
def test_the_word_before_the_cut_is_the_truth_after_it(kind, facet, hexa):
    """For every cell and facet: refused if, and only if, the mesh that is then cut has a cell the target lacks."""
    mesh = cell_with_faces(kind, [facet])
    after = cut_skin(mesh, "slave", hexa=hexa).mesh.cells_by_type
    for target in TARGETS:
        dims = (3,) if target in ("calculix", "abaqus") else (2, 3)
        types = [name for name in after if CELLS[name].dim in dims]
        mixed = sum(CELLS[name].dim == 3 for name in types) > 1
        fits = all(element(name, target) for name in types) and not (target == "fenics" and mixed)
        with nullcontext() if fits else pytest.raises(CutError, match=TARGETS[target]):
            check_target_cells(mesh, "slave", target, hexa=hexa)


def slave_box():
    return box().with_groups(slave=lambda x: (x[0] == 0) & (x[1] <= 0.5) & (x[2] <= 0.5)).only("body", "slave")


def side_by_side(*slave):
    """A hexahedron and a prism, both behind the skin: hexahedra would have a way, the prism has none."""
    x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], float)
    blocks = [("HEXA8", [[0, 1, 2, 3, 5, 6, 7, 8]]), ("PENTA6", [[1, 4, 2, 6, 9, 7]])]
    blocks += [("QUAD4", [[0, 3, 2, 1]]), ("TRIA3", [[1, 2, 4]])]
    return Mesh.create(np.vstack([x, x + np.array([0, 0, 1])]), blocks, cell_groups={"slave": slave})


def mixed_plane():
    blocks = [("QUAD4", [[0, 1, 2, 3]]), ("TRIA3", [[1, 4, 2]]), ("SEG2", [[0, 1]])]
    return Mesh.create([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]], blocks, cell_groups={"slave": [2]})


#: mesh, target, hexa, words of the error: the cells that the target lacks, then the way
REFUSED = [
    (slave_box(), "calculix", "pyramid", ["5 PYRAM5 (5 of them new)", "--hexa hexa"]),
    (slave_box(), "fenics", "pyramid", ["5 PYRAM5 (5 of them new)", "--hexa hexa"]),
    (mixed_plane(), "fenics", "pyramid", ["mixture", "1 QUAD4, 1 TRIA3 before"]),
    (raise_order(slave_box(), "2"), "fenics", "hexa", ["8 HEXA20, 1 QUAD8 before", "mesh it anew"]),
    (side_by_side(2, 3), "calculix", "pyramid", ["no option changes", "the 1 PENTA6 behind"]),
    (side_by_side(2), "calculix", "pyramid", ["--hexa hexa"]),
    (cut_skin(slave_box(), "slave").mesh, "calculix", "pyramid", ["is cut already", "5 PYRAM5", "--for c"]),
    *(
        (cell_with_faces(kind, [facet]), "calculix", hexa, words)
        for kind, facet, words in (
            ("PENTA6", 0, ["no option changes", "the 1 PENTA6 behind"]),
            ("PENTA6", 2, ["no option changes", "the 1 PENTA6 behind"]),
            ("PENTA15", 0, ["no option changes", "the 1 PENTA15 behind"]),
            ("PYRAM5", 1, ["1 PYRAM5 before", "mesh it anew"]),
        )
        for hexa in ("pyramid", "hexa")
    ),
]


@pytest.mark.parametrize(("mesh", "target", "hexa", "words"), REFUSED)
def test_cells_that_a_target_lacks_are_named_with_the_way(mesh, target, hexa, words):
    with pytest.raises(CutError) as caught:
        check_target_cells(mesh, "slave", target, hexa=hexa)
    assert all(word in str(caught.value) for word in words) and caught.value.status == 1
    if "--hexa hexa" in words:
        check_target_cells(mesh, "slave", target, hexa="hexa")
    if mesh.cells_by_type.keys() <= {"HEXA8", "QUAD4", "PYRAM5", "TRIA3"} and mesh.dim == 3:
        check_target_cells(mesh, "slave", "abaqus", hexa=hexa)


def test_a_mesh_as_it_is_and_wrong_names():
    mesh = cut_skin(slave_box(), "slave").mesh
    check_cells(mesh, "abaqus")
    with pytest.raises(DataError, match="5 PYRAM5"):
        check_cells(mesh, "calculix")
    for slave, target, error in (("slav", "calculix", GroupNotFoundError), ("slave", "calculx", RequestError)):
        with pytest.raises(error, match="did you mean"):
            check_target_cells(slave_box(), slave, target)


@pytest.mark.parametrize(
    ("target", "end"), [("gmsh", "msh"), ("aster", "med"), ("calculix", "inp"), ("abaqus", "inp"), ("fenics", "xdmf")]
)
def test_what_a_target_takes_is_what_its_format_writes(target, end, tmp_path):
    """A cell with a name goes into the target's file; one without is refused there, or is not for that target."""
    for name in CELLS:
        taken, mesh = element(name, target) is not None, one_cell(name)
        try:
            written = (
                bool(write(tmp_path / f"{name}.{end}", mesh, **({"target": target} if end == "inp" else {}))) or True
            )
        except Exception:
            written = False
        assert {"fenics": written or not taken, "gmsh": taken or name == "TRIA7"}.get(target, written == taken), name
        assert (name in refused(mesh, target)) == (not taken), name


def test_elements_are_those_of_the_formats_and_of_lacsolvers_rules():
    assert element("TETRA10", "gmsh") == "11" and element("TRIA7", "gmsh") is None
    assert element("PYRAM14", "aster") is None and element("PENTA18", "aster") == "P18"
    assert element("QUAD9", "fenics") == "Quadrilateral_9" and element("PENTA6", "fenics") is None
    assert element("TRIA6", "abaqus", plane=True) == element_name("TRIA6", "abaqus", "CPS", False)
    assert [element("SEG4", t) is not None for t in TARGETS] == [True, True, False, False, False, False]
    assert {kind for kind in CELLS if CELLS[kind].dim > 1 and element(kind, "lacsolver")} == set(SOLID_CELLS)
    assert all(element(face.type, "lacsolver") for kind in SOLID_CELLS for face in CELLS[kind].facets)
    assert element("SEG4", "lacsolver") is None and element("POI1", "lacsolver") is None
