"""Numbering, models, patterns, rules, and the meshes that a model refuses."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, GroupNotFoundError, RequestError
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.points import table
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.space.rules import _PYRAMID, SOLID_CELLS, _pyramid, cell_rule
from lacsolver.space.space import MODELS, Space
from tests.lacsolver import plain
from tests.lacsolver.bodies import PLANES, SOLIDS, cube, distorted, mixture, one_cell, plane_mixture, square


def test_unknowns_go_node_by_node():
    space = Space.of(cube("HEXA8", 1), "3d")
    assert space.n_dof == 24
    assert space.dofs(np.array([0, 5])).tolist() == [[0, 1, 2], [15, 16, 17]]


def test_a_node_of_no_cell_has_unknowns_but_is_not_attached():
    mesh = Mesh.create([[0, 0], [1, 0], [0, 1], [7, 7]], [("TRIA3", [[0, 1, 2]]), ("POI1", [[3]])])
    space = Space.of(mesh, "plane_strain")
    assert space.n_dof == 8
    assert space.attached.tolist() == [True, True, True, False]
    assert np.diff(space.pattern.indptr).tolist() == [3, 3, 3, 0]


def test_only_cells_of_the_models_dimension_carry_displacements():
    mesh = cube("HEXA8", 1)
    skin = Mesh.create(mesh.points, [("QUAD4", [[0, 1, 2, 3]]), ("HEXA8", mesh.block("HEXA8")), ("SEG2", [[0, 1]])])
    space = Space.of(skin, "3d")
    assert [b.type for b in space.blocks] == ["HEXA8"]
    assert space.cells().tolist() == [1]


def test_cells_by_group():
    mesh = plane_mixture()
    half = Mesh.create(mesh.points, mesh.blocks, cell_groups={"a": [0, 3], "b": [3, mesh.n_cells - 1]})
    space = Space.of(half, "plane_strain")
    assert space.cells(("a",)).tolist() == [0, 3]
    assert space.cells(("a", "b")).tolist() == [0, 3, mesh.n_cells - 1]
    with pytest.raises(GroupNotFoundError, match="did you mean"):
        space.cells(("aa",))


def test_a_group_without_cells_of_the_body_is_an_error():
    mesh = Mesh.create([[0, 0], [1, 0], [0, 1]], [("TRIA3", [[0, 1, 2]]), ("SEG2", [[0, 1]])], cell_groups={"rim": [1]})
    with pytest.raises(DataError, match="'rim' has no cell of dimension 2"):
        Space.of(mesh, "plane_strain").cells(("rim",))


def test_depth_is_thickness_or_the_circle():
    x, cells = np.array([[2.0, 0, 0]]), np.array([0])
    for model in ("plane_stress", "plane_strain"):
        assert Space.of(square("QUAD4", 1), model, thickness=0.3).depth(x, cells) == pytest.approx(0.3)
    assert Space.of(square("QUAD4", 1), "axisymmetric").depth(x, cells) == pytest.approx(4 * np.pi)
    assert Space.of(square("QUAD4", 1), "plane_strain").depth(x, cells) == 1


def strip(**groups):
    """Two squares side by side, cells 0 and 1, edges 2 to 5: below each, between them, and beside the second one."""
    x = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]
    edges = [[0, 1], [1, 2], [1, 4], [2, 5], [5, 2]]
    cells = [("QUAD4", [[0, 1, 4, 3], [1, 2, 5, 4]]), ("SEG2", edges)]
    return Mesh.create(x, cells, cell_groups={"left": [0], "right": [1], "both": [0, 1], **groups})


def test_edges_have_the_thickness_of_their_cell():
    space = Space.of(strip(), "plane_stress", thickness={"left": 2.0, "right": 5.0})
    found = space.depth(np.zeros((5, 2, 3)), np.array([0, 1, 2, 3, 5]))
    assert found.tolist() == [[2, 2], [5, 5], [2, 2], [5, 5], [5, 5]]
    with pytest.raises(DataError, match="between two thicknesses"):
        space.thick(np.array([4]))
    same = Space.of(strip(), "plane_stress", thickness={"both": 3.0, "left": 3.0})
    assert same.thick(np.array([4])) == 3.0


@pytest.mark.parametrize(
    "given, words",
    [
        ({"left": 2.0}, "are in none of the groups"),
        ({"both": 1.0, "left": 2.0}, "have another thickness by another group"),
    ],
)
def test_cells_without_a_thickness_or_with_two(given, words):
    with pytest.raises(DataError, match=words):
        Space.of(strip(), "plane_stress", thickness=given)


def test_the_selector_of_every_model_takes_a_gradient_to_its_strain():
    for model in MODELS.values():
        L = np.arange(1.0, 1 + model.rows * model.dim).reshape(model.rows, model.dim)
        got = np.einsum("kis,is->k", model.selector, L)
        zz = {"3d": L[-1, -1], "axisymmetric": L[-1, 0]}.get(model.name, 0.0)
        expected = [L[0, 0], L[1, 1], zz, L[0, 1] + L[1, 0]]
        if model.dim == 3:
            expected += [L[1, 2] + L[2, 1], L[0, 2] + L[2, 0]]
        assert got.tolist() == expected


@pytest.mark.parametrize("mesh", [mixture(), mixture("2-full"), cube("TETRA10", 2), plane_mixture("2")])
def test_pattern_equals_its_plain_twin(mesh):
    space = Space.of(mesh, "3d" if mesh.space_dim == 3 else "plane_strain")
    indptr, indices = plain.pattern([b.nodes for b in space.blocks], mesh.n_nodes)
    assert np.array_equal(space.pattern.indptr, indptr)
    assert np.array_equal(space.pattern.indices, indices)


@pytest.mark.parametrize(
    ("model", "thickness", "says"),
    [
        ("plane_stres", None, "did you mean plane_stress"),
        ("3d", 2.0, "thickness belongs to the models plane_strain and plane_stress"),
        ("axisymmetric", 2.0, "thickness belongs to the models plane_strain and plane_stress"),
        ("plane_stress", 0.0, "above 0"),
        ("plane_stress", np.nan, "above 0"),
    ],
)
def test_a_wrong_request_says_so(model, thickness, says):
    with pytest.raises(RequestError, match=says):
        Space.of(square("QUAD4", 1), model, thickness=thickness)


def test_a_mesh_without_cells_of_the_dimension():
    with pytest.raises(DataError, match=r"3d needs volumes, and the mesh is plane; take model = .plane_strain"):
        Space.of(square("QUAD4", 1), "3d")


def test_cells_of_order_three_are_named():
    mesh = Mesh.create(np.random.default_rng(0).random((10, 2)), [("TRIA10", [np.arange(10)])], cell_number=[77])
    with pytest.raises(DataError, match="cells 77 are of type TRIA10") as caught:
        Space.of(mesh, "plane_strain")
    assert caught.value.cells == (77,)


def test_a_plane_mesh_out_of_its_plane():
    points = square("QUAD4", 1).points.copy()
    points[:, 2] = 1.0
    Space.of(Mesh.create(points, square("QUAD4", 1).blocks, space_dim=2), "plane_strain")
    points[0, 2] = 0.5
    with pytest.raises(DataError, match="plane z = constant"):
        Space.of(Mesh.create(points, square("QUAD4", 1).blocks, space_dim=2), "plane_strain")


def test_a_negative_radius_names_its_node():
    mesh = square("QUAD4", 1)
    moved = Mesh.create(mesh.points - [1.5, 0, 0], mesh.blocks)
    with pytest.raises(DataError, match=r"node 1 has radius x = -0.5"):
        Space.of(moved, "axisymmetric")
    Space.of(Mesh.create(mesh.points - [1, 0, 0], mesh.blocks), "axisymmetric")


AFFINE = ("TRIA3", "TETRA4")
FAULTS = [(n, f) for n in SOLIDS + PLANES for f in ("flat", "folded", "nan") if f != "folded" or n not in AFFINE]


@pytest.mark.parametrize(("name", "fault"), FAULTS)
def test_a_cell_without_volume_is_named(name, fault):
    mesh = one_cell(name)
    points = mesh.points.copy()
    if fault == "nan":
        points[0, 0] = np.nan
    elif fault == "flat":
        points[:, 1] = points[:, 0]
    elif CELLS[name].order == 2:  # a mid-node far through the others
        middle = CELLS[name].n_corners
        points[middle] += 4 * (points[:middle].mean(axis=0) - points[middle])
    else:  # two corners change places; in an affine cell that only turns it inside out
        points[[0, 1]] = points[[1, 0]]
    bad = Mesh.create(points, mesh.blocks, cell_number=[42], space_dim=mesh.space_dim)
    with pytest.raises(DataError, match="cells 42 are folded") as caught:
        Space.of(bad, "3d" if name in SOLIDS else "plane_strain")
    assert caught.value.cells == (42,)


@pytest.mark.parametrize("name", ["TETRA10", "HEXA8", "QUAD8", "TRIA6"])
def test_a_cell_numbered_inside_out_is_the_same_cell(name):
    mesh = distorted(one_cell(name), 0.05)
    mirrored = Mesh.create(mesh.points * [1, -1, 1], mesh.blocks)
    model = "3d" if name in SOLIDS else "plane_stress"
    K, M = (_stiffness(m, model) for m in (mesh, mirrored))
    flip = np.tile([1, -1, 1][: MODELS[model].dim], mesh.n_nodes)
    np.testing.assert_allclose(M, flip[:, None] * K * flip, rtol=0, atol=1e-13 * np.abs(K).max())


def _stiffness(mesh, model):
    space = Space.of(mesh, model)
    return assemble_stiffness(space, Materials.of(space, Elastic(1.0, 0.3))).toarray()


def test_every_cell_of_dimension_two_and_three_has_a_rule():
    assert sorted(SOLID_CELLS) == sorted(SOLIDS + PLANES)


def products(name, points, X, w):
    """int dN_a/dx_i dN_b/dx_j dV and int dN_a/dx_i dV of one cell, by a rule."""
    dN = gradient(name, X)
    dim = dN.shape[2]
    J = np.einsum("ns,qnd->qsd", points[:, :dim], dN)
    G = np.einsum("qnd,qds->qns", dN, np.linalg.inv(J))
    W = np.abs(np.linalg.det(J)) * w
    return np.einsum("qai,qbj,q->aibj", G, G, W), np.einsum("qai,q->ai", G, W)


@pytest.mark.parametrize("name", SOLID_CELLS)
def test_the_stiffness_of_an_affine_cell_is_exact(name):
    cell = CELLS[name]
    A = np.eye(3)[: cell.dim, : cell.dim] + np.random.default_rng(3).uniform(-0.4, 0.4, (cell.dim, cell.dim))
    points = np.array(cell.reference) @ A
    exact, _ = products(name, points, *rule(cell.family, 24))
    got, _ = products(name, points, *cell_rule(name))
    np.testing.assert_allclose(got, exact, rtol=0, atol=2e-14 * np.abs(exact).max())


@pytest.mark.parametrize("name", SOLID_CELLS)
def test_the_gradients_of_a_curved_cell_are_exact(name):
    """The cells' rules integrate the gradients exactly, as the patch test requires."""
    points = one_cell(name, 0.08, seed=5).points
    _, exact = products(name, points, *rule(CELLS[name].family, 24))
    _, got = products(name, points, *cell_rule(name))
    np.testing.assert_allclose(got, exact, rtol=0, atol=5e-14 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("name", "lower"), [("PYRAM5", (1, 1)), ("PYRAM13", (2, 2)), ("PYRAM13", (3, 1)), ("PYRAM14", (2, 2))]
)
def test_a_pyramids_rule_has_no_point_too_many(name, lower):
    assert all(a <= b for a, b in zip(lower, _PYRAMID[name], strict=True))
    points = np.array(CELLS[name].reference)
    exact, _ = products(name, points, *rule("PYRAM", 24))
    got, _ = products(name, points, *_pyramid(*lower))
    assert np.abs(got - exact).max() > 1e-3 * np.abs(exact).max()


def test_a_rule_of_polynomials_misses_a_pyramids_stiffness():
    """Why pyramids have rules of their own: Duffy's map of a polynomial rule on two tetrahedra, degree 16."""
    X, w = rule("TETRA", 16)
    corners = np.array(CELLS["PYRAM5"].reference)
    halves = [corners[[0, 1, 2, 4]], corners[[0, 2, 3, 4]]]
    X2 = np.concatenate([h[0] + X @ (h[1:] - h[0]) for h in halves])
    w2 = np.concatenate([w * abs(np.linalg.det(h[1:] - h[0])) for h in halves])
    exact, _ = products("PYRAM13", np.array(CELLS["PYRAM13"].reference), *rule("PYRAM", 24))
    poor, _ = products("PYRAM13", np.array(CELLS["PYRAM13"].reference), X2, w2)
    got, _ = products("PYRAM13", np.array(CELLS["PYRAM13"].reference), *cell_rule("PYRAM13"))
    assert np.abs(got - exact).max() < 1e-14
    assert np.abs(poor - exact).max() > 1e-8


def test_the_eight_points_of_a_tetrahedron_have_degree_three():
    X, w = cell_rule("TETRA10")
    Y, v = rule("TETRA", 3)
    for i, j, k in np.ndindex(4, 4, 4):
        if i + j + k <= 3:
            m, exact = (weight @ np.prod(p ** [i, j, k], axis=1) for p, weight in ((X, w), (Y, v)))
            assert m == pytest.approx(exact, abs=1e-16)
    assert abs(w @ X[:, 0] ** 4 - v @ Y[:, 0] ** 4) > 1e-6


def test_tables_are_padded_to_three_dimensions():
    N, dN, w = table("QUAD8")
    assert N.shape == (9, 8)
    assert dN.shape == (9, 3, 8)
    assert not dN[:, 2].any()
    assert w.sum() == pytest.approx(4)
