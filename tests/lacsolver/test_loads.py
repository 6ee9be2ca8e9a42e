"""Loads: their work against exact integrals, their resultants against volumes and areas, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.reference.quadrature import measure
from lacsolver.bodies import small as assemble
from lacsolver.bodies.material import Elastic, Materials, Orthotropic
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.problem import loads
from lacsolver.space.space import Space
from lacsolver.space.values import evaluate, evaluate_vector
from tests.lacsolver.bodies import PAIRS, PLANE_MODELS, mixture, one_cell, plane_mixture, with_skin
from tests.lacsolver.test_assemble import mixed, solved
from tests.quality_cells import rotation

LAW = Elastic(young=200.0, poisson=0.3, density=7.0, expansion=2e-3, reference_temperature=20.0)


def curved(name, model, distortion=0.1):
    thickness = 0.4 if model == "plane_stress" else None
    mesh = with_skin(one_cell(name, distortion if CELLS[name].order == 2 else 2 * distortion, seed=3))
    return Space.of(mesh, model, thickness=thickness), mesh.cell_groups["skin"]


def square_with_skin(**rest):
    """[1, 2] x [0, 1] as one QUAD4 with its four sides."""
    return with_skin(Mesh.create([[1, 0], [2, 0], [2, 1], [1, 1]], [("QUAD4", [[0, 1, 2, 3]])], **rest))


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_the_work_of_a_pressure_is_the_change_of_volume(name, model):
    """int p n.v dS = p int div v dV for any v, exactly, on curved faces too."""
    space, skin = curved(name, model)
    v = np.random.default_rng(0).normal(size=space.n_dof)
    degree = 24 if CELLS[name].dim == 2 else 16
    zz = (2,) if model == "axisymmetric" or space.dim == 3 else ()
    (w,), (e,) = assemble.weights(space, degree), assemble.strain(space, v, degree)
    exact = (w * e[..., [0, 1, *zz]].sum(axis=-1)).sum()
    assert loads.pressure(space, skin, 3.0) @ v == pytest.approx(-3 * exact, rel=1e-12)


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_a_pressure_that_rises_with_depth_lifts_the_displaced_weight(name, model):
    """Archimedes: p = c y on a closed surface has the resultant -c V along y."""
    space, skin = curved(name, model)
    (w,) = assemble.weights(space, 16)
    f = loads.pressure(space, skin, lambda x, t: t * x[:, 1], t=2.0).reshape(-1, space.dim).sum(axis=0)
    expected = np.zeros(space.dim)
    expected[1] = -2 * w.sum()
    if model != "axisymmetric":
        np.testing.assert_allclose(f, expected, atol=1e-12 * w.sum())
    assert f[1] == pytest.approx(expected[1], rel=1e-12)


def test_a_pressure_on_one_side_pushes_into_the_body_however_the_side_is_listed():
    mesh = square_with_skin()
    for nodes in ([[2, 3]], [[3, 2]]):
        top = Mesh.create(mesh.points, [("QUAD4", mesh.block("QUAD4")), ("SEG2", nodes)])
        space = Space.of(top, "plane_strain")
        np.testing.assert_allclose(loads.pressure(space, np.array([1]), 3.0), [0, 0, 0, 0, 0, -1.5, 0, -1.5])


def test_a_pressure_on_a_circle_in_axisymmetry():
    space = Space.of(square_with_skin(), "axisymmetric")
    f = loads.pressure(space, np.array([2]), 5.0).reshape(-1, 2)  # the side x = 2
    np.testing.assert_allclose(f.sum(axis=0), [-5 * 2 * np.pi * 2, 0], atol=1e-12)


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_a_follower_is_the_pressure_on_the_deformed_mesh(name, model):
    space, skin = curved(name, model)
    move = np.random.default_rng(2).uniform(-0.05, 0.05, space.mesh.points.shape) * [1, 1, space.dim == 3]
    there = space.mesh.points + move
    deformed = Mesh.create(there, space.mesh.blocks, space_dim=space.mesh.space_dim)
    thickness = space.thickness if model == "plane_stress" else None
    expected = loads.pressure(Space.of(deformed, model, thickness=thickness), skin, 2.0)
    np.testing.assert_allclose(loads.pressure(space, skin, 2.0, x=there), expected, atol=1e-14)


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_a_traction_along_the_normal_is_a_pressure(name, model):
    space, skin = curved(name, model)
    got = loads.traction(space, skin, lambda x, n, t: -3 * t * n[:, : space.dim], t=0.5)
    np.testing.assert_allclose(got, loads.pressure(space, skin, 1.5), atol=1e-13)


@pytest.mark.parametrize("model", ["3d", *PLANE_MODELS])
def test_the_work_of_a_linear_traction_on_flat_faces(model):
    """v quadratic, traction linear, so that the work on straight quadratic sides is exact."""
    mesh = one_cell("HEXA20" if model == "3d" else "QUAD8")
    space = Space.of(with_skin(mesh), model)
    x = space.mesh.points
    v = np.stack([x[:, 0] ** 2, x[:, 0] * x[:, 1], x[:, 2] ** 2][: space.dim], axis=1).ravel()
    force = [lambda x, t: 2 * x[:, 1], 1.5, lambda x, t: t * x[:, 0]][: space.dim]
    got = loads.traction(space, space.mesh.cell_groups["skin"], force, t=3.0) @ v
    u, w = np.polynomial.legendre.leggauss(6)
    total = 0.0
    for axis in range(space.dim):
        for side in (-1.0, 1.0):
            grids = [[side] if s == axis else u for s in range(space.dim)]
            weights = [[1.0] if s == axis else w for s in range(space.dim)]
            p = np.stack([g.ravel() for g in np.meshgrid(*grids)], axis=1)
            q = np.prod([g.ravel() for g in np.meshgrid(*weights)], axis=0)
            X, y, z = p[:, 0] + 3, p[:, 1], p[:, 2] if space.dim == 3 else 0 * p[:, 0]
            work = 2 * y * X**2 + 1.5 * X * y + (3 * X * z**2 if space.dim == 3 else 0)
            total += (q * work * (2 * np.pi * X if model == "axisymmetric" else 1)).sum()
    assert got == pytest.approx(total, rel=1e-13)


def test_a_traction_on_a_parabola_converges_to_its_length(monkeypatch):
    points = np.array([[1, 0], [2, 0], [1, 1], [1.5, 0], [1.6, 0.7], [1, 0.5]])
    mesh = Mesh.create(points, [("TRIA6", [np.arange(6)]), ("SEG3", [[1, 2, 4]])])
    space = Space.of(mesh, "plane_strain")
    exact = measure("SEG3", mesh.points[[[1, 2, 4]]], degree=60)[0]

    def error():
        return abs(loads.traction(space, np.array([1]), (1.0, 0.0)).sum() - exact)

    default, errors = error(), []
    for degree in (2, 10, 40):
        monkeypatch.setitem(loads._FACE_DEGREE, 2, degree)
        errors.append(error())
    assert errors[0] > 10 * errors[1] > 100 * errors[2]
    assert errors[2] < 1e-13
    assert default == errors[1] < 1e-5


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_gravity_weighs_the_body(name, model):
    space, _ = curved(name, model)
    nodes = space.blocks[0].nodes
    f = loads.gravity(space, Materials.of(space, LAW), (0.0, -9.81, 0.0)[: space.dim]).reshape(-1, space.dim)
    if model == "axisymmetric":
        (w,) = assemble.weights(space, 24)
        volume = w.sum()
    else:
        volume = abs(_volume(name, space.mesh.points[nodes])[0]) * space.thickness
    np.testing.assert_allclose(f[:, 1].sum(), -9.81 * 7 * volume, rtol=1e-13)
    assert not f[:, 0].any()


def _volume(name, x):
    return measure(name, x, degree=16)


@pytest.mark.parametrize("model", ["3d", *PLANE_MODELS])
def test_gravity_of_two_densities_and_its_moment(model):
    mesh = mixture("2") if model == "3d" else plane_mixture("2")
    groups = {"a": np.arange(0, mesh.n_cells, 2), "b": np.arange(1, mesh.n_cells, 2)}
    space = Space.of(Mesh.create(mesh.points, mesh.blocks, cell_groups=groups, space_dim=mesh.space_dim), model)
    materials = Materials.of(space, [(LAW, ("a",)), (Elastic(1.0, 0.0), ("b",))])
    f = loads.gravity(space, materials, (0.0, lambda x, t: t + 0 * x[:, 0], 0.0)[: space.dim], t=2.0)
    weight = moment = 0.0
    for block, x, w in zip(space.blocks, assemble.points(space, 8), assemble.weights(space, 8), strict=True):
        heavy = (block.cell % 2 == 0)[:, None] * w
        weight, moment = weight + heavy.sum(), moment + (heavy * x[..., 0]).sum()
    fy = f.reshape(-1, space.dim)[:, 1]
    assert fy.sum() == pytest.approx(14 * weight, rel=1e-12)
    assert fy @ space.mesh.points[:, 0] == pytest.approx(14 * moment, rel=1e-12)
    with pytest.raises(DataError, match="gravity needs a density"):
        loads.gravity(space, Materials.of(space, Elastic(1.0, 0.0)), (0.0,) * space.dim)


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_the_work_of_a_body_force(name, model):
    space, _ = curved(name, model)
    v = np.random.default_rng(0).normal(size=space.n_dof)
    (w,), (u,) = assemble.weights(space, 20), assemble.displacement(space, v, 20)
    got = loads.body_force(space, [lambda x, t: np.exp(t) + 0 * x[:, 0], 2.0, -1.0][: space.dim], t=1.0) @ v
    exact = (w * (u @ np.array([np.e, 2.0, -1.0])[: space.dim])).sum()
    # r N det J of TRIA7 has degree 10 with the bubble in all three; the rule of plane quadratic cells has it
    assert got == pytest.approx(exact, rel=1e-12)


def test_a_body_force_on_some_cells():
    mesh = mixture()
    space = Space.of(mesh, "3d")
    some = space.cells()[::3]
    f = loads.body_force(space, (1.0, 0.0, 0.0), cells=some).reshape(-1, 3)
    volume = sum(w[np.isin(b.cell, some)].sum() for b, w in zip(space.blocks, assemble.weights(space), strict=True))
    assert f[:, 0].sum() == pytest.approx(volume, rel=1e-13)
    assert 0 < volume < 11


def test_nodal_forces_stand_at_their_nodes():
    space = Space.of(square_with_skin(), "plane_strain")
    f = loads.nodal_force(space, np.array([2, 0, 2]), (lambda x, t: t * x[:, 0], 5.0), t=2.0)
    assert f.tolist() == [2, 5, 0, 0, 4, 5, 0, 0]


def supported(space):
    """Unknowns that are free when the body is held against rigid motion and nothing else, at x = 0 ideally."""
    x = space.mesh.points[space.attached]
    nodes = np.flatnonzero(space.attached)
    free = np.ones(space.n_dof, bool)
    first = nodes[0]
    far = nodes[np.argmax(np.abs(x[:, 0] - x[0, 0]))]
    if space.model.axisymmetric:
        free[space.dofs([first])[0, 1]] = False
    elif space.dim == 2:
        free[space.dofs([first])[0]] = False
        free[space.dofs([far])[0, 1]] = False
    else:
        free[space.dofs([first])[0]] = False
        free[space.dofs([far])[0, 1:]] = False
        other = nodes[np.argmax(np.linalg.norm(np.cross(x - x[0], space.mesh.points[far] - x[0]), axis=1))]
        across = np.cross(space.mesh.points[far] - x[0], space.mesh.points[other] - x[0])
        free[space.dofs([other])[0, np.abs(across).argmax()]] = False
    return free


WOOD = Orthotropic(
    (11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06), axes=((2.0, 1.0), (0.0, 1.0)), expansion=(1e-3, 4e-3, 2e-3)
)
Q = rotation(np.random.default_rng(1))
TURNED = Orthotropic(*(WOOD.young, WOOD.poisson, WOOD.shear), axes=(tuple(Q[0]), tuple(Q[1])), expansion=WOOD.expansion)


@pytest.mark.parametrize("order", ["1", "2", "2-full"])
@pytest.mark.parametrize(("model", "law"), [("3d", LAW), ("plane_stress", LAW), ("axisymmetric", LAW), ("3d", TURNED),
                                            ("plane_stress", WOOD)])  # fmt: skip
def test_a_free_body_expands_without_stress(order, model, law):
    space = Space.of(mixed(order, model), model)
    materials = Materials.of(space, law)
    warmer = 50.0
    temperature = law.reference_temperature + warmer
    f = loads.thermal_force(space, materials, temperature)
    free = supported(space)
    u = solved(assemble_stiffness(space, materials).tocsc(), np.zeros(space.n_dof), free, f)
    alpha = warmer * materials.tables[1][0]
    scale = np.abs(materials.tables[0][0] @ alpha).max()
    for s in assemble.stress(space, materials, u, temperature=temperature):
        assert np.abs(s).max() < 1e-10 * scale
    for e in assemble.strain(space, u):
        known = [k for k in range(e.shape[-1]) if not (model == "plane_stress" and k == 2)]
        np.testing.assert_allclose(e[..., known], np.broadcast_to(alpha[known], e[..., known].shape), atol=1e-13)


def test_plane_strain_keeps_the_stress_across_it():
    space = Space.of(mixed("1", "plane_strain"), "plane_strain")
    materials = Materials.of(space, LAW)
    f = loads.thermal_force(space, materials, lambda x, t: 20 + 50 * t + 0 * x[:, 0], t=2.0)
    u = solved(assemble_stiffness(space, materials).tocsc(), np.zeros(space.n_dof), supported(space), f)
    for s in assemble.stress(space, materials, u, temperature=120.0):
        expected = [0, 0, -LAW.young * LAW.expansion * 100, 0]
        np.testing.assert_allclose(s, np.broadcast_to(expected, s.shape), atol=1e-10)


def test_a_linear_temperature_leaves_quadratic_cells_without_stress():
    space = Space.of(mixture("2"), "3d")
    materials = Materials.of(space, LAW)

    def temperature(x, t):
        return 20 + 3 * x[:, 0] - 2 * x[:, 2]

    f = loads.thermal_force(space, materials, temperature)
    u = solved(assemble_stiffness(space, materials).tocsc(), np.zeros(space.n_dof), supported(space), f)
    for s in assemble.stress(space, materials, u, temperature=temperature):
        assert np.abs(s).max() < 1e-11 * LAW.young


def test_a_temperature_of_some_cells_the_later_over_the_earlier():
    space = Space.of(plane_mixture(), "plane_stress")
    materials = Materials.of(space, LAW)
    given = [(30.0, None), (70.0, np.array([1, 5])), (120.0, np.array([5]))]
    still = np.zeros(space.n_dof)
    expected = np.where(np.arange(space.mesh.n_cells) == 1, 50.0, 10.0)
    expected[5] = 100.0
    factor = LAW.young / (1 - LAW.poisson) * LAW.expansion
    stresses = assemble.stress(space, materials, still, temperature=given)
    for block, s in zip(space.blocks, stresses, strict=True):
        np.testing.assert_allclose(s[..., 0], -factor * expected[block.cell][:, None] + 0 * s[..., 0], rtol=1e-13)
    only = [(70.0, np.array([1, 5]))]
    for block, s in zip(space.blocks, assemble.stress(space, materials, still, temperature=only), strict=True):
        np.testing.assert_array_equal(s[..., 0] != 0, np.isin(block.cell, [1, 5])[:, None] & (s[..., 3] == 0))


def test_springs_are_diagonal_and_at_their_nodes():
    space = Space.of(square_with_skin(), "plane_strain")
    S = loads.springs(space, np.array([1, 3]), (4.0, lambda x, t: t * x[:, 0]), t=3.0)
    np.testing.assert_array_equal(S.toarray(), np.diag([0, 0, 4, 6, 0, 0, 4, 3]))
    with pytest.raises(DataError, match="stiffness is 0 or more, and is -1"):
        loads.springs(space, np.array([0]), (-1.0, 0.0))


@pytest.mark.parametrize(
    ("load", "error", "says"),
    [
        (lambda s: loads.pressure(s, np.array([0]), 1.0), DataError, "cells of dimension 1, and cells 1 are none"),
        (lambda s: loads.pressure(s, np.array([], int), 1.0), DataError, "the group is empty"),
        (lambda s: loads.pressure(s, np.array([1]), np.nan), DataError, "pressure is nan at"),
        (lambda s: loads.pressure(s, np.array([1]), lambda x, t: x), DataError, r"return \(3,\)"),
        (lambda s: loads.pressure(s, np.array([1]), lambda x, t: np.log(x[:, 0] - 1.55)), DataError, "pressure is nan"),
        (lambda s: loads.traction(s, np.array([1]), (1.0,)), ValueError, "traction has 1 components; the model has 2"),
        (lambda s: loads.traction(s, np.array([1]), lambda x, n, t: n), DataError, r"finite numbers \(3, 2\)"),
        (lambda s: loads.springs(s, np.array([1]), (1.0, -2.0)), DataError, "0 or more, and is -2"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_a_wrong_load_says_so(load, error, says):
    with pytest.raises(error, match=says):
        load(Space.of(square_with_skin(), "plane_strain"))


def test_a_pressure_between_two_cells_has_no_side():
    mesh = Mesh.create(
        [[0, 0], [1, 0], [1, 1], [0, 1]], [("TRIA3", [[0, 1, 2], [0, 2, 3]]), ("SEG2", [[0, 2]])], cell_number=[4, 5, 6]
    )
    space = Space.of(mesh, "plane_strain")
    with pytest.raises(DataError, match="cells 6 do not have just one cell of the body behind them"):
        loads.pressure(space, np.array([2]), 1.0)
    np.testing.assert_allclose(loads.traction(space, np.array([2]), (1.0, 0.0)).sum(), np.sqrt(2))


def test_a_load_on_a_bare_skin_is_refused():
    points = [[0, 0], [1, 0], [0, 1], [5, 0], [6, 0]]
    mesh = Mesh.create(points, [("TRIA3", [[0, 1, 2]]), ("SEG2", [[3, 4]])], node_number=[1, 2, 3, 40, 50])
    space = Space.of(mesh, "plane_strain")
    with pytest.raises(DataError, match="cells 2 have nodes that no cell of the body holds"):
        loads.traction(space, np.array([1]), (1.0, 0.0))
    with pytest.raises(DataError, match="force at nodes 40, which no cell of the body holds"):
        loads.nodal_force(space, np.array([0, 3]), (1.0, 0.0))


def test_a_value_is_a_number_or_a_function():
    x = np.arange(12.0).reshape(2, 2, 3)
    assert evaluate(2, x, 0.0, "it").tolist() == [[2, 2], [2, 2]]
    assert evaluate(lambda p, t: p[:, 1] + t, x, 1.0, "it").tolist() == [[2, 5], [8, 11]]
    assert evaluate(lambda p, t: 3.0, x, 1.0, "it").tolist() == [[3, 3], [3, 3]]
    assert evaluate_vector((1.0, lambda p, t: p[:, 0]), x, 0.0, 2, "it")[..., 1].tolist() == [[0, 3], [6, 9]]
    with pytest.raises(DataError, match=r"it, component 1 is inf at \(0, 1, 2\), t = 0"):
        evaluate_vector((1.0, np.inf), x, 0.0, 2, "it")


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_a_cell_numbered_inside_out_has_the_loads_of_its_mirror(name, model):
    space, skin = curved(name, model)
    mesh = Mesh.create(space.mesh.points * [1, -1, 1], space.mesh.blocks, space_dim=space.mesh.space_dim)
    mirror = Space.of(mesh, model, thickness=space.thickness if model == "plane_stress" else None)
    flip = np.tile([1.0, -1.0, 1.0][: space.dim], mesh.n_nodes)
    for load in (
        lambda s: loads.pressure(s, skin, 3.0),
        lambda s: loads.gravity(s, Materials.of(s, LAW), (2.0,) + (0.0,) * (s.dim - 1)),
        lambda s: loads.thermal_force(s, Materials.of(s, LAW), 50.0),
    ):
        f = load(space)
        np.testing.assert_allclose(load(mirror), flip * f, rtol=0, atol=1e-13 * np.abs(f).max())
