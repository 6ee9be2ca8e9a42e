"""Targets: what each takes, and what a cut would give it, said before it is made."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lacmesh.cells import CELLS
from lacmesh.cutting.cut import cut_skin
from lacmesh.cutting.order import raise_order
from lacmesh.errors import CutError, DataError, GroupNotFoundError, RequestError
from lacmesh.exchange.targets import TARGETS, check_cells, check_target_cells, element, refused
from lacmesh.formats import write
from lacmesh.formats.inp.writer_types import card
from lacmesh.mesh import Mesh
from lacsolver.space.rules import SOLID_CELLS
from tests.formats.feature_cases import one_cell
from tests.meshes import box, cell_with_faces

SUFFIX = {"gmsh": ".msh", "aster": ".med", "calculix": ".inp", "abaqus": ".inp", "fenics": ".xdmf", "lacsolver": ".msh"}


def slave_box(**rest):
    points, cells = box(2)
    return Mesh.create(points, [("HEXA8", cells), ("QUAD4", [[0, 1, 4, 3]])], cell_groups={"slave": [8]}, **rest)


def cases():
    """Every solid cell, with one facet of each type that it has."""
    facets = {kind: [f.type for f in cell.facets] for kind, cell in CELLS.items() if cell.dim == 3}
    return [(kind, types.index(facet)) for kind, types in facets.items() for facet in dict.fromkeys(types)]


@pytest.mark.parametrize("hexa", ["pyramid", "hexa"])
@pytest.mark.parametrize("case", cases(), ids=lambda c: f"{c[0]}-{c[1]}")
def test_the_word_before_the_cut_is_the_truth_after_it(case, hexa):
    """For every cell and facet: refused if, and only if, the mesh that is then cut has a cell the target lacks."""
    mesh = cell_with_faces(case[0], [case[1]])
    after = cut_skin(mesh, "slave", hexa=hexa).mesh.cells_by_type
    for target in TARGETS:
        dims = (3,) if target in ("calculix", "abaqus") else (2, 3)
        types = [name for name in after if CELLS[name].dim in dims]
        solids = [name for name in types if CELLS[name].dim == 3]
        fits = all(element(name, target) for name in types) and (target != "fenics" or len(solids) == 1)
        with nullcontext() if fits else pytest.raises(CutError, match=TARGETS[target]):
            check_target_cells(mesh, "slave", target, hexa=hexa)


PAGE = Path(__file__).resolve().parents[1] / "docs" / "targets.md"


def rows_of_the_page():
    """Cell, slave face, variant, and what the page says of each target."""
    text = PAGE.read_text(encoding="utf-8").split("<!-- patterns: begin -->")[1].split("<!-- patterns: end -->")[0]
    rows = [[word.strip() for word in line.strip("|\n").split("|")] for line in text.strip().splitlines()[2:]]
    return [(*row[:3], dict(zip(TARGETS, row[4:], strict=True))) for row in rows]


def mesh_of(kind, face, variant, alone):
    """A mesh with a cell whose slave face is the group 'slave'; where not `alone`, another such cell is left uncut."""
    cell = CELLS[kind]
    facet = next(f for f in cell.facets if f.type == face)
    points, blocks = np.array(cell.reference, float), [(kind, [range(cell.n_nodes)])]
    if not alone:
        points, blocks[0] = np.vstack([points, points + 5]), (kind, np.arange(2 * cell.n_nodes).reshape(2, -1))
    faces = [facet.nodes]
    if variant == "beside a TRIA3":
        a, b = facet.nodes
        blocks.append(("TRIA3", [[b, a, len(points)]]))
        points = np.vstack([points, 1.5 * points[[a, b]].sum(axis=0)])
    mesh = Mesh.create(points, [*blocks, (face, faces)])
    return replace(mesh, cell_groups={"slave": np.flatnonzero(mesh.cell_dim == mesh.dim - 1)})


@pytest.mark.parametrize("row", rows_of_the_page(), ids=lambda row: "-".join(row[:3]).replace(" ", "_"))
def test_the_page_says_what_the_check_finds(row):
    kind, face, variant, cells = row
    hexa = variant if variant in ("hexa", "pyramid") else "pyramid"
    for alone in (True, False):
        mesh = mesh_of(kind, face, variant, alone)
        for target, word in cells.items():
            if word == "yes" or (word == "alone" and alone):
                check_target_cells(mesh, "slave", target, hexa=hexa)
                continue
            assert word.startswith(("no ", "alone"))
            with pytest.raises(CutError) as caught:
                check_target_cells(mesh, "slave", target, hexa=hexa)
            lacking = set(word.removeprefix("no ").split(", ")) - {"alone"}
            assert all(name in str(caught.value) for name in lacking), target


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


@pytest.mark.parametrize(("kind", "facet"), [("PENTA6", 0), ("PENTA6", 2), ("PYRAM5", 1), ("PENTA15", 0)])
def test_prisms_have_no_way(kind, facet):
    mesh = cell_with_faces(kind, [facet])
    before = kind == "PYRAM5"
    for hexa in ("pyramid", "hexa"):
        with pytest.raises(CutError) as caught:
            check_target_cells(mesh, "slave", "calculix", hexa=hexa)
        way = f"no option changes that for the 1 {kind} behind the slave skin: mesh these with tetrahedra"
        assert ("it has 1 PYRAM5 before it is cut: mesh it anew" if before else way) in str(caught.value)


def test_only_what_has_no_way_is_to_be_meshed_anew():
    """A hexahedron and a prism side by side, both behind the skin: hexahedra would have a way, the prism has none."""
    x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], float)
    points = np.vstack([x, x + np.array([0, 0, 1])])
    blocks = [("HEXA8", [[0, 1, 2, 3, 5, 6, 7, 8]]), ("PENTA6", [[1, 4, 2, 6, 9, 7]])]
    skin = [("QUAD4", [[0, 3, 2, 1]]), ("TRIA3", [[1, 2, 4]])]
    mesh = Mesh.create(points, blocks + skin, cell_groups={"slave": [2, 3], "square": [2]})
    with pytest.raises(CutError, match="no option changes that for the 1 PENTA6 behind the slave skin"):
        check_target_cells(mesh, "slave", "calculix")
    with pytest.raises(CutError, match="--hexa hexa makes hexahedra instead"):
        check_target_cells(mesh, "square", "calculix")
    check_target_cells(mesh, "square", "calculix", hexa="hexa")


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
    mesh = cut_skin(slave_box(), "slave").mesh
    message = (
        "is cut already, has 5 PYRAM5, and CalculiX has no such cells; cut the mesh that it came from with --for c"
    )
    with pytest.raises(CutError, match=message):
        check_target_cells(mesh, "slave", "calculix")
    check_target_cells(mesh, "slave", "abaqus")
    with pytest.raises(DataError, match="the mesh has 5 PYRAM5, and CalculiX has no such cells"):
        check_cells(mesh, "calculix")
    check_cells(mesh, "abaqus")


def test_a_wrong_name_is_the_first_error():
    with pytest.raises(GroupNotFoundError, match="did you mean slave"):
        check_target_cells(slave_box(), "slav", "calculix")
    with pytest.raises(RequestError, match="no target 'calculx'; did you mean calculix"):
        check_target_cells(slave_box(), "slave", "calculx")


@pytest.mark.parametrize("target", ["gmsh", "aster", "calculix", "abaqus", "fenics"])
def test_what_a_target_takes_is_what_its_format_writes(target, tmp_path):
    """A cell with a name goes into the target's file; one without is refused there, or is not for that target."""
    options = {"target": target} if SUFFIX[target] == ".inp" else {}
    for name in CELLS:
        mesh = one_cell(name)
        try:
            write(tmp_path / f"{name}{SUFFIX[target]}", mesh, **options)
            written = True
        except Exception:
            written = False
        if target in ("aster", "calculix", "abaqus"):
            assert written == (element(name, target) is not None), name
        elif target == "fenics":
            assert written or element(name, target) is None, name
        else:
            assert element(name, target) is not None or name == "TRIA7"
        assert (name in refused(mesh, target)) == (element(name, target) is None), name


def test_elements_are_those_of_the_formats():
    assert element("TETRA10", "gmsh") == "11" and element("TRIA7", "gmsh") is None
    assert element("PYRAM14", "aster") is None and element("PENTA18", "aster") == "P18"
    assert element("QUAD9", "fenics") == "Quadrilateral_9" and element("PENTA6", "fenics") is None
    assert element("TRIA6", "abaqus", plane=True) == card("TRIA6", "abaqus", "CPS", False)
    assert np.array_equal([element("SEG4", t) is not None for t in TARGETS], [True, True, False, False, False, False])


def test_lacsolver_takes_the_cells_that_it_has_rules_for():
    """In a body those of SOLID_CELLS, and as a slave skin their faces: the page's column says the same."""
    assert {kind for kind in CELLS if CELLS[kind].dim > 1 and element(kind, "lacsolver")} == set(SOLID_CELLS)
    assert all(element(face.type, "lacsolver") for kind in SOLID_CELLS for face in CELLS[kind].facets)
    assert element("SEG4", "lacsolver") is None and element("POI1", "lacsolver") is None
    assert {told["lacsolver"] for *_, told in rows_of_the_page()} == {"yes"}
