"""Spaces and laws: numbering, patterns, rules, what a model refuses; what constants mean; who has which law."""

import itertools
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import lacmesh
import lacsolver as ls
from lacmesh import Mesh, generate
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, GroupNotFoundError, RequestError
from lacmesh.generate import rectangle
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import gradient
from lacsolver.bodies.hyperelastic import NeoHookean
from lacsolver.bodies.material import Elastic, Materials, Orthotropic, reduced
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.case import BodyForce, CaseError, Force, Material, Pressure, Tie
from lacsolver.cli import main
from lacsolver.space.rules import SOLID_CELLS, cell_rule
from lacsolver.space.space import MODELS, Space
from tests.lacsolver import plain
from tests.lacsolver.bodies import PLANE_MODELS, PLANES, SOLIDS, distorted, made, one_cell, plane_mixture, square
from tests.problems import case_of, contact, fix, move
from tests.quality_cells import rotation
from tests.samples import each_option


def strip(**groups):
    """Two squares side by side, cells 0 and 1, edges 2 to 5: below each, between them, and beside the second one."""
    x = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]
    edges = [[0, 1], [1, 2], [1, 4], [2, 5], [5, 2]]
    cells = [("QUAD4", [[0, 1, 4, 3], [1, 2, 5, 4]]), ("SEG2", edges)]
    return Mesh.create(x, cells, cell_groups={"left": [0], "right": [1], "both": [0, 1], **groups})


def test_extent_is_the_largest_side_of_the_box():
    space = Space.of(rectangle(2, (1.5, 4.0)), "plane_strain")
    top = np.flatnonzero(space.mesh.points[:, 1] == 4.0)
    assert (space.extent, space.extent_of(top)) == (4.0, 1.5)


def test_cells_by_group():
    mesh = plane_mixture()
    space = Space.of(
        replace(mesh, cell_groups={"a": np.array([0, 3]), "b": np.array([3, mesh.n_cells - 1])}), "plane_strain"
    )
    assert space.cells(("a",)).tolist() == [0, 3]
    assert space.cells(("a", "b")).tolist() == [0, 3, mesh.n_cells - 1]
    with pytest.raises(GroupNotFoundError, match="did you mean"):
        space.cells(("aa",))
    with pytest.raises(DataError, match="no cell of dimension"):
        Space.of(strip(rim=[2]), "plane_strain").cells(("rim",))


def test_edges_have_the_thickness_of_their_cell():
    space = Space.of(strip(), "plane_stress", thickness={"left": 2.0, "right": 5.0})
    found = space.depth(np.zeros((5, 2, 3)), np.array([0, 1, 2, 3, 5]))
    assert found.tolist() == [[2, 2], [5, 5], [2, 2], [5, 5], [5, 5]]
    with pytest.raises(DataError, match="between two thicknesses"):
        space.thick(np.array([4]))
    same = Space.of(strip(), "plane_stress", thickness={"both": 3.0, "left": 3.0})
    assert same.thick(np.array([4])) == 3.0


BOX = square("QUAD4", 1)
BENT = replace(BOX, points=BOX.points + [[0, 0, 0.5]] * (np.arange(BOX.n_nodes) == 0)[:, None])
CUBIC = Mesh.create(np.random.default_rng(0).random((10, 2)), [("TRIA10", [np.arange(10)])], cell_number=[77])


@pytest.mark.parametrize(
    ("mesh", "model", "thickness", "error", "words"),
    [
        (BOX, "plane_stres", None, RequestError, "did you mean plane_stress"),
        (BOX, "3d", 2.0, RequestError, "thickness belongs to"),
        (BOX, "axisymmetric", 2.0, RequestError, "thickness belongs to"),
        (BOX, "plane_stress", 0.0, RequestError, "above 0"),
        (BOX, "plane_stress", np.nan, RequestError, "above 0"),
        (strip(), "plane_stress", {"left": 2.0}, DataError, "none of the groups"),
        (strip(), "plane_stress", {"both": 1.0, "left": 2.0}, DataError, "have another thickness"),
        (BOX, "3d", None, DataError, "needs volumes"),
        (CUBIC, "plane_strain", None, DataError, "cells 77"),
        (BENT, "plane_strain", None, DataError, "plane z = constant"),
        (replace(BOX, points=BOX.points - [1.5, 0, 0]), "axisymmetric", None, DataError, "node 1 has radius"),
    ],
)
def test_what_a_model_refuses(mesh, model, thickness, error, words):
    with pytest.raises(error, match=words):
        Space.of(mesh, model, thickness=thickness)
    Space.of(replace(BOX, points=np.add(BOX.points, [0, 0, 1.0])), "plane_strain")
    Space.of(replace(BOX, points=BOX.points - [1, 0, 0]), "axisymmetric")


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
    K, M = (assemble_stiffness(*made(m, model, Elastic(1.0, 0.3))).toarray() for m in (mesh, mirrored))
    flip = np.tile([1, -1, 1][: MODELS[model].dim], mesh.n_nodes)
    np.testing.assert_allclose(M, flip[:, None] * K * flip, rtol=0, atol=1e-13 * np.abs(K).max())


def products(name, points, X, w):
    """int dN_a/dx_i dN_b/dx_j dV and int dN_a/dx_i dV of one cell, by a rule."""
    dN = gradient(name, X)
    dim = dN.shape[2]
    J = np.einsum("ns,qnd->qsd", points[:, :dim], dN)
    G = np.einsum("qnd,qds->qns", dN, np.linalg.inv(J))
    W = np.abs(np.linalg.det(J)) * w
    return np.einsum("qai,qbj,q->aibj", G, G, W), np.einsum("qai,q->ai", G, W)


@pytest.mark.parametrize("name", SOLID_CELLS)
def test_rules_are_exact(name):
    """For the stiffness of an affine cell, and the gradients of a curved one, as the patch test requires."""
    cell = CELLS[name]
    A = np.eye(3)[: cell.dim, : cell.dim] + np.random.default_rng(3).uniform(-0.4, 0.4, (cell.dim, cell.dim))
    for k, points, within in (
        (0, np.array(cell.reference) @ A, 2e-14), (1, one_cell(name, 0.08, seed=5).points, 5e-14)
    ):  # fmt: skip
        exact, got = products(name, points, *rule(cell.family, 24))[k], products(name, points, *cell_rule(name))[k]
        np.testing.assert_allclose(got, exact, rtol=0, atol=within * np.abs(exact).max())


# ---- laws


WOOD = {"young": (11.0, 0.9, 0.5), "poisson": (0.4, 0.35, 0.3), "shear": (0.8, 0.7, 0.06)}
ISOTROPIC = Orthotropic((2.0, 2.0, 2.0), (0.3, 0.3, 0.3), (2 / 2.6, 2 / 2.6, 2 / 2.6))
ELASTIC = Elastic(young=2.0, poisson=0.3)


def turned(Q, **rest):
    """Wood whose axes are the rows of Q."""
    return Orthotropic(**WOOD, axes=(tuple(Q[0]), tuple(Q[1])), **rest)


def tensor(voigt, shear=1.0):
    xx, yy, zz, xy, yz, xz = np.asarray(voigt) / [1, 1, 1, shear, shear, shear]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.mark.parametrize("seed", range(5))
def test_turned_wood_answers_a_turned_strain_with_the_turned_stress(seed):
    """And wood of equal constants is isotropic however it turns."""
    rng = np.random.default_rng(seed)
    Q = rotation(rng)
    e = rng.normal(size=6)
    straight = tensor(Orthotropic(**WOOD).elasticity() @ e)
    E = Q.T @ tensor(e, shear=2.0) @ Q
    there = np.array([E[0, 0], E[1, 1], E[2, 2], 2 * E[0, 1], 2 * E[1, 2], 2 * E[0, 2]])
    np.testing.assert_allclose(tensor(turned(Q).elasticity() @ there), Q.T @ straight @ Q, atol=1e-13)
    above = Orthotropic((1.0, 0.01, 1.0), (9.0, 0.0, 0.0), (1.0, 1.0, 1.0))  # nu12^2 < E1 / E2 = 100
    assert np.linalg.eigvalsh(above.elasticity()).min() > 0, "a Poisson's ratio above 1/2"
    same = replace(ISOTROPIC, axes=(tuple(Q[0]), tuple(Q[1])))
    np.testing.assert_allclose(same.elasticity(), ELASTIC.elasticity(), atol=1e-14)


def test_axes_need_be_neither_unit_nor_square():
    a = Orthotropic(**WOOD, axes=((3.0, 3.0), (0.0, 0.1)))
    b = Orthotropic(**WOOD, axes=((1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)))
    np.testing.assert_allclose(a.elasticity(), b.elasticity(), atol=1e-14)
    np.testing.assert_allclose(a.directions @ a.directions.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(a.directions) == pytest.approx(1)


def test_wood_swells_along_its_axes():
    Q = rotation(np.random.default_rng(1))
    alpha = turned(Q, expansion=(1.0, 2.0, 5.0)).thermal_strain()
    np.testing.assert_allclose(Q @ tensor(alpha, shear=2.0) @ Q.T, np.diag([1.0, 2, 5]), atol=1e-14)
    assert Elastic(1.0, 0.0, expansion=3.0).thermal_strain().tolist() == [3, 3, 3, 0, 0, 0]
    assert Orthotropic(**WOOD, expansion=3.0).thermal_strain()[:3].tolist() == [3, 3, 3]


@pytest.mark.parametrize("model", PLANE_MODELS)
@pytest.mark.parametrize("law", [ELASTIC, Orthotropic(**WOOD, axes=((2.0, 1.0), (0.0, 1.0)))])
def test_a_plane_model_is_the_solid_with_its_condition(law, model):
    C, alpha = reduced(law, MODELS[model])
    assert alpha.shape == (4,)
    np.testing.assert_allclose(C, plain.constitutive(law, MODELS[model]), atol=1e-14)


def test_axes_out_of_the_plane_are_refused():
    for axes in (((0.0, 0.0, 1.0), (1.0, 1.0, 0.0)), ((1.0, 2.0, 0.0), (0.0, 0.0, -1.0))):
        C, _ = reduced(Orthotropic(**WOOD, axes=axes), MODELS["plane_strain"])
        assert np.linalg.eigvalsh(C).min() > 0
    law = turned(rotation(np.random.default_rng(2)))
    reduced(law, MODELS["3d"])
    for refused in (lambda: reduced(law, MODELS["plane_strain"]), lambda: made(BOX, "plane_stress", law)):
        with pytest.raises(DataError, match="couple the plane"):
            refused()


@pytest.mark.parametrize(
    ("law", "constants", "words"),
    [
        *((Elastic, (young, 0.3), "young is a stiffness") for young in (0.0, -1.0, np.nan)),
        (Elastic, (1.0, 0.5), "take 0.49"),
        (Elastic, (1.0, -1.0), "between -1 and"),
        (Elastic, (1.0, 0.3, -1.0), "density is"),
        (Elastic, (1.0, 0.3, 0.0, np.inf), "expansion is"),
        (Elastic, (1.0, 0.3, 0.0, 0.0, np.nan), "reference_temperature is"),
        (Orthotropic, ((1.0, 0.0, 1.0), (0, 0, 0), (1, 1, 1)), "young is a stiffness"),
        (Orthotropic, ((1.0, 1.0), (0, 0, 0), (1, 1, 1)), "three numbers"),
        (Orthotropic, ((1.0, 1.0, 1.0), (0, 0, 0), (1, -1, 1)), "shear is a stiffness"),
        (Orthotropic, ((1.0, 0.01, 1.0), (11.0, 0, 0), (1, 1, 1)), "negative energy"),
        (partial(Orthotropic, axes=((1, 0, 0), (2, 0, 0))), WOOD.values(), "on one line"),
        (partial(Orthotropic, axes=((1, 0, 0),)), WOOD.values(), "are two vectors"),
        (partial(Orthotropic, expansion=(1.0, 2.0)), WOOD.values(), "along each axis"),
    ],
)
def test_constants_that_make_no_material(law, constants, words):
    with pytest.raises(DataError, match=words):
        law(*constants)


def two_groups():
    mesh = plane_mixture()
    half = mesh.n_cells // 2
    groups = {"low": np.arange(half), "high": np.arange(half, mesh.n_cells), "both": np.arange(mesh.n_cells)}
    return Space.of(replace(mesh, cell_groups=groups), "plane_strain")


@pytest.mark.parametrize(
    ("given", "error", "says"),
    [
        ([(ELASTIC, ("low",))], DataError, "name a group"),
        ([(ELASTIC, ("low", "high")), (ISOTROPIC, ("both",))], DataError, "have two materials"),
        ([(ELASTIC, None), (ISOTROPIC, None)], DataError, "have two materials"),
        ([(ELASTIC, ("lo",))], GroupNotFoundError, "did you mean low"),
        ([], DataError, "no material"),
    ],
)
def test_every_cell_has_one_law(given, error, says):
    with pytest.raises(error, match=says):
        Materials.of(two_groups(), given)


def test_a_law_that_answers_at_points_has_no_stiffness_of_its_own_even_if_it_has_the_constants_of_another():
    class Yielding(Elastic):
        n_history = 1

        def respond(self, H, history):
            raise NotImplementedError

    space = Space.of(square("QUAD4", 1), "plane_strain")
    for law, by_points in ((Yielding(200.0, 0.3), True), (ELASTIC, False), (NeoHookean(200.0, 0.3), True)):
        materials = Materials.of(space, law)
        assert materials.pointwise == (by_points,)
        assert materials.terms.value.any() == (not by_points)


# ---- several thicknesses

E, LOW, UP = 1000.0, 2.0, 5.0
STIFF = Material(young=E, poisson=0.0)
PRESSURE = Pressure(group="top", value=6.0)
FOOT, HEAD = fix("bottom", "xy"), fix("top", "x")


def thick(*records, kind="QUAD4", slave="lower", mesh=None, thickness=None, model="plane_stress", **keys):
    """Solve a column 1 wide and 1 high of thickness LOW, and one of height 2 and thickness UP on it."""
    if mesh is None:
        mesh = generate.stack(rectangle(2, kind=kind), rectangle((3, 6), (1, 2), kind=kind), slave=slave)
    keys |= {"model": model, "thickness": thickness or {"lower": LOW, "upper": UP}}
    return ls.solve(case_of(mesh, *records, **keys))


@pytest.mark.parametrize(
    ("kind", "model", "slave", "joint"),
    each_option(itertools.product(
        ("QUAD4", "TRIA3"), ("plane_stress", "plane_strain"), ("lower", "upper"),
        (contact(), Tie(slave="slave", master="master")),
    )),
)  # fmt: skip
def test_columns_under_a_force(kind, model, slave, joint):
    """The force 6 UP goes through both; the contact's area is that of the slave, and so is its pressure."""
    solution = thick(STIFF, joint, FOOT, HEAD, PRESSURE, kind=kind, model=model, slave=slave)
    force, area = 6.0 * UP, {"lower": LOW, "upper": UP}[slave]
    y = solution.mesh.points[:, 1]
    above = np.isin(np.arange(len(y)), solution.mesh.nodes_on(solution.mesh.cells_of("upper")))
    u = np.where(above, -force / (E * LOW) - 6.0 * (y - 1) / E, -force / (E * LOW) * y)
    np.testing.assert_allclose(solution.u, np.stack([0 * u, u], axis=1), atol=1e-12)
    (zone,) = solution.contact.values()
    np.testing.assert_allclose(zone.pressure, force / area, rtol=1e-9)
    assert zone.area.sum() == pytest.approx(area, rel=1e-12)
    figures = solution.figures
    assert figures.reactions["bottom"][1] == pytest.approx(force, rel=1e-12)
    assert abs(figures.contact["slave"].resultant[1]) == pytest.approx(force, rel=1e-12)
    assert max(figures.balance) < 1e-12
    assert figures.energy == pytest.approx(0.5 * force**2 / (E * LOW) + 0.5 * 6.0**2 / E * 2 * UP, rel=1e-9)


def test_a_slave_of_two_thicknesses():
    """Each macro-element has the thickness of its own cell; one body has both, left and right."""
    mesh = generate.stack(rectangle(2), rectangle((3, 6), (1, 2)), slave="lower")
    cells = mesh.cells_of("lower")
    x = next(mesh.select(cells))[2]
    one = mesh.points[x, 0].mean(axis=1) < 0.5
    mesh = replace(mesh, cell_groups={**mesh.cell_groups, "one": cells[one], "other": cells[~one]})
    given = {"one": 1.0, "other": 3.0, "upper": UP}
    solution = thick(STIFF, contact(), FOOT, move("top", ux=0.0, uy=-0.01), mesh=mesh, thickness=given)
    (zone,) = solution.contact.values()
    np.testing.assert_allclose(sorted(zone.area), [0.5, 1.5], rtol=1e-12)
    assert max(solution.figures.balance) < 1e-12
    total = -(zone.pressure * zone.area).sum()
    assert solution.figures.reactions["top"][1] == pytest.approx(total, rel=1e-9)


def test_loads_and_mass_have_the_thickness_of_their_cells():
    """Weight is rho V; a total force is spread by area, and an edge between two thicknesses has none."""
    solution = thick(STIFF, contact(), FOOT, HEAD, BodyForce(fy=-2.0), Force(group="top", fy=-3.0, total=True))
    weight = 2.0 * (1 * LOW + 2 * UP)
    assert solution.figures.reactions["bottom"][1] == pytest.approx(weight + 3.0, rel=1e-12)
    assert abs(solution.figures.contact["slave"].resultant[1]) == pytest.approx(2.0 * 2 * UP + 3.0, rel=1e-12)
    mesh = generate.stack(rectangle(2), rectangle((3, 6), (1, 2)))
    thickness = {"lower": LOW, "upper": UP}
    case = case_of(mesh, replace(STIFF, density=1.5), contact(), FOOT, model="plane_stress", thickness=thickness)
    assert ls.natural_modes(case, mesh, count=1).mass == pytest.approx(1.5 * (LOW + 2 * UP), rel=1e-12)


def test_the_line_of_a_thickness_that_cells_lack(tmp_path, capsys):
    mesh = generate.stack(rectangle(2), rectangle((3, 6), (1, 2)))
    lacmesh.write(tmp_path / "columns.msh", mesh)
    tied = STIFF, Tie(slave="slave", master="master"), FOOT
    for given, words in (
        ({"lower": 1.0}, "in none of the groups"),
        ({"lower": 1.0, "upper": 2.0, "top": 1.0}, ""),
        ({"lower": 1.0, "uper": 2.0}, "no cell group named 'uper'"),
    ):
        case = case_of(tmp_path / "columns.msh", *tied, model="plane_stress", thickness=given)
        case.write(tmp_path / "case.toml")
        assert main(["validate", str(tmp_path / "case.toml")]) == (1 if words else 0)
        err = capsys.readouterr().err
        assert words in err and (not words or ": thickness: " in err)
    with pytest.raises(CaseError, match="in none of the groups"):
        thick(*tied, thickness={"lower": 1.0})
