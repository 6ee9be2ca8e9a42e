"""Macro-elements of whole faces: stars around nodes that own a dof, on every type of face, without a cut."""

from dataclasses import replace

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh.cutting.recognition import find_macros
from lacmesh.cutting.select import slave_skin
from lacmesh.errors import CutError, LacmeshWarning, RequestError
from lacmesh.exchange.multipliers import aster_multipliers
from lacmesh.generate import box, rectangle, stack
from lacsolver.doubts.neighbours import alternating
from lacsolver.doubts.run import Run
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests import REPOSITORY
from tests.meshes import renumbered

#: cells -> faces of a macro-element on average, at most, on the top of a box of 9 x 9 x 1 of them
KINDS = {
    "TETRA4": 7.5, "PENTA6": 7.5, "HEXA8": 5.1, "PYRAM5": 5.1, "TETRA10": 2.03, "PENTA15": 2.03, "PENTA18": 2.03,
    "HEXA27": 1.0, "PYRAM14": 1.0,
}  # fmt: skip


def parts(cut):
    """The macro-elements as sets of places of their faces, whatever their numbers."""
    mesh, middle = cut.mesh, {}
    for _, cells, nodes in mesh.select(np.flatnonzero(cut.macro_of_face >= 0)):
        middle |= dict(zip(cells.tolist(), map(tuple, (mesh.points[nodes].mean(axis=1) + 0.0).round(6)), strict=True))
    return {frozenset(middle[face] for face in faces.tolist()) for faces in cut.faces_of_macro}


@pytest.mark.rows(
    "TETRA4-0.12; PENTA6-0.0; HEXA8-0.12; PYRAM5-0.12; TETRA10-0.12; PENTA15-0.0; PENTA18-0.12; HEXA27-0.0; PYRAM14-0.0"
)
@pytest.mark.parametrize("distortion", [0.0, 0.12])
@pytest.mark.parametrize("kind", KINDS)
def test_every_macro_element_owns_a_dof_and_the_mesh_is_as_it_was(kind, distortion):
    mesh = box((9, 9, 1), (9, 9, 1), kind, distortion=distortion, seed=5)
    cut = lacmesh.cut_skin(mesh, "top", macro="stars")
    assert np.array_equal(cut.mesh.points, mesh.points) and cut.mesh.cells_by_type == mesh.cells_by_type
    assert "lac_parent" not in cut.mesh.cell_data and (cut.child_kind >= 1).sum() == len(mesh.cell_groups["top"])
    found = lacmesh.check(cut.mesh, "top")
    assert not found.errors and not found.warnings
    assert found.summary["with_internal_dof"] == cut.n_macros and found.summary["least_integral"] >= 0.1
    size = np.bincount(cut.macro_of_face[cut.macro_of_face >= 0])
    assert size.mean() <= KINDS[kind] and size.max() <= 12


@pytest.mark.parametrize("kind", ["TRIA3", "QUAD4"])
def test_segments_are_joined_in_pairs(kind):
    cut = lacmesh.cut_skin(rectangle((9, 2), kind=kind), "top", macro="stars")
    assert sorted(map(len, cut.faces_of_macro)) == [2, 2, 2, 3]


def test_many_faces_have_as_few_macro_elements_as_nodes_allow():
    for kind, most in (("TETRA4", 6.5), ("HEXA8", 4.3), ("TETRA10", 2.03)):
        cut = lacmesh.cut_skin(box((33, 33, 1), kind=kind), "top", macro="stars")
        assert len(cut.mesh.cell_groups["top"]) / cut.n_macros <= most


def test_numbering_and_the_order_of_faces_change_nothing():
    for mesh, group in (
        (box((7, 6, 1), kind="TETRA4", distortion=0.12, seed=1), "top"),
        (box((4, 4, 2), kind="TETRA4", distortion=0.1, seed=4), "bottom"),  # two stars take the place of one
    ):
        other, _ = renumbered(mesh, np.random.default_rng(3))
        assert parts(lacmesh.cut_skin(mesh, group, macro="stars")) == parts(
            lacmesh.cut_skin(other, group, macro="stars")
        )


def test_no_star_bends_around_a_crease_crosses_zones_or_stands_on_held_nodes():
    mesh = box((5, 6, 5), kind="HEXA8")
    cut = lacmesh.cut_skin(mesh, ["top", "right"], macro="stars")
    for faces in cut.faces_of_macro:
        assert len(set(cut.zone_of_face[faces])) == 1
    both = replace(mesh, cell_groups={"both": np.union1d(mesh.cell_groups["top"], mesh.cell_groups["right"])})
    assert parts(lacmesh.cut_skin(both, "both", macro="stars")) == parts(cut)
    assert parts(lacmesh.cut_skin(both, "both", macro="stars", crease_angle=170)) != parts(cut)
    held = cut.mesh.node_data["lac_internal"] >= 0
    again = lacmesh.cut_skin(
        replace(mesh, node_groups={"fixed": np.flatnonzero(held)}), "top", macro="stars", dirichlet=["fixed"]
    )
    assert not (held & (again.macro_of_node >= 0)).any()


def test_faces_without_a_star_are_cut_or_join_or_are_refused():
    mesh = box((6, 1, 1), kind="TETRA4")  # one face wide: every node is on the rim
    with pytest.warns(LacmeshWarning, match="no star reaches them"):
        cut = lacmesh.cut_skin(mesh, "top", macro="stars")
    assert parts(cut) == parts(lacmesh.cut_skin(mesh, "top"))
    with pytest.raises(CutError, match="no star beside them"):
        lacmesh.cut_skin(mesh, "top", macro="stars", rest="join")
    with pytest.raises(RequestError, match="macro is one of"):
        lacmesh.cut_skin(mesh, "top", macro="star")


def test_quad8_are_cut_unless_pairs_are_asked_for():
    mesh = box((4, 4, 1), kind="HEXA20")
    with pytest.warns(LacmeshWarning, match="QUAD8"):
        assert lacmesh.cut_skin(mesh, "top", macro="stars").n_macros == 16
    cut = lacmesh.cut_skin(mesh, "top", macro="stars", pairs=True)
    assert cut.n_macros == 8 and not lacmesh.check(cut.mesh, "top").errors


def test_code_aster_has_no_multipliers_for_stars_and_no_cut_is_recognised_in_them():
    cut = lacmesh.cut_skin(box((6, 6, 1), kind="TETRA4"), "top", macro="stars")
    with pytest.raises(CutError, match="macro = 'stars'"):
        aster_multipliers(cut)
    bare = replace(cut.mesh, cell_data={}, node_data={}, zones=())
    assert find_macros(bare, slave_skin(bare, ["top"])).n_cut == 0


@pytest.mark.parametrize("macro", ["cut", "stars"])
def test_the_press_fit_of_tetrahedra_is_even_and_the_warning_of_its_cut_names_stars(macro):
    case = ls.read_case(REPOSITORY / "data" / "press_fit.toml")
    problem = Problem.of(replace(case, contact=(replace(case.contact[0], macro=macro),)))
    *_, state = march(problem)
    doubts, off = list(alternating(Run(problem, problem.joints, last=state))), state.zones[0].pressure / 63.46 - 1
    if macro == "cut":
        assert 'macro = "stars"' in doubts[0].text
    else:
        assert doubts == [] and np.sqrt(np.mean(off**2)) <= 0.03 and off.min() > -0.05


def test_a_problem_has_new_stars_where_displacements_of_other_nodes_are_given():
    mesh = stack(box((5, 5, 1), kind="HEXA8"), box((4, 4, 1), kind="HEXA8"))
    carriers = lacmesh.cut_skin(mesh, "slave", macro="stars").mesh.node_data["lac_internal"] >= 0
    mesh = replace(mesh, node_groups={"some": np.flatnonzero(carriers)[:1]})
    fixed = (ls.Displacement(group="bottom", ux=0, uy=0, uz=0), ls.Displacement(group="top", ux=0, uy=0, uz=-1e-3))
    case = ls.Case(
        model="3d", material=[ls.Material(young=1.0, poisson=0.3)], displacement=fixed,
        contact=[ls.Contact(slave="slave", master="master", macro="stars")],
    )  # fmt: skip
    problem = Problem.of(case, mesh)
    other = Problem.of(replace(case, displacement=(*fixed, ls.Displacement(group="some", ux=0))), mesh, like=problem)
    own, others = (one.space.mesh.node_data["lac_internal"][mesh.node_groups["some"]] >= 0 for one in (problem, other))
    assert own.all() and not others.any()


def test_stars_are_not_named_a_cut_and_warn_on_a_mesh_that_has_been_cut():
    mesh = stack(box((5, 5, 1), kind="HEXA8"), box((4, 4, 1), kind="HEXA8"))
    case = ls.Case(
        model="3d", material=[ls.Material(young=1.0, poisson=0.3)],
        contact=[ls.Contact(slave="slave", master="master", macro="stars")],
    )  # fmt: skip
    for given, here in ((mesh, True), (lacmesh.cut_skin(mesh, "slave", macro="stars").mesh, False)):
        found = ls.validate(case, given)
        assert (found.stars_here, found.cut_here) == (here, False)
    with pytest.warns(lacmesh.LacmeshWarning, match='macro = "stars" has no effect, .* name the uncut mesh'):
        ls.validate(case, lacmesh.cut_skin(mesh, "slave").mesh)
