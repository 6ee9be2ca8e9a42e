"""Laws against what their constants mean; models against the laws of solids; who has which law."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.errors import DataError, GroupNotFoundError
from lacsolver.bodies.hyperelastic import NeoHookean
from lacsolver.bodies.material import Elastic, Materials, Orthotropic, reduced
from lacsolver.space.space import MODELS, Space
from tests.lacsolver import plain
from tests.lacsolver.bodies import PLANE_MODELS, plane_mixture, square
from tests.quality_cells import rotation

WOOD = {"young": (11.0, 0.9, 0.5), "poisson": (0.4, 0.35, 0.3), "shear": (0.8, 0.7, 0.06)}
ISOTROPIC = Orthotropic((2.0, 2.0, 2.0), (0.3, 0.3, 0.3), (2 / 2.6, 2 / 2.6, 2 / 2.6))
ELASTIC = Elastic(young=2.0, poisson=0.3)


def turned(Q, **rest):
    """Wood whose axes are the rows of Q."""
    return Orthotropic(**WOOD, axes=(tuple(Q[0]), tuple(Q[1])), **rest)


def tensor(voigt, shear=1.0):
    xx, yy, zz, xy, yz, xz = np.asarray(voigt) / [1, 1, 1, shear, shear, shear]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_an_elastic_bar_stretches_and_narrows():
    strain = np.linalg.solve(ELASTIC.elasticity(), [1.0, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(strain, [0.5, -0.15, -0.15, 0, 0, 0], atol=1e-15)
    strain = np.linalg.solve(ELASTIC.elasticity(), [0, 0, 0, 1.0, 0, 0])
    np.testing.assert_allclose(strain, [0, 0, 0, 1.3, 0, 0], atol=1e-15)


def test_a_bar_of_wood_shows_its_constants():
    S = np.linalg.inv(Orthotropic(**WOOD).elasticity())
    E, (nu12, nu13, nu23), (G12, G13, G23) = (WOOD[k] for k in ("young", "poisson", "shear"))
    np.testing.assert_allclose(S[:, 0], [1 / E[0], -nu12 / E[0], -nu13 / E[0], 0, 0, 0], atol=1e-14)
    np.testing.assert_allclose(S[:, 1], [-nu12 / E[0], 1 / E[1], -nu23 / E[1], 0, 0, 0], atol=1e-14)
    np.testing.assert_allclose(np.diag(S)[2:], [1 / E[2], 1 / G12, 1 / G23, 1 / G13], rtol=1e-13)


def test_an_orthotropic_law_with_equal_constants_is_isotropic_however_it_turns():
    for seed in range(5):
        Q = rotation(np.random.default_rng(seed))
        law = Orthotropic(ISOTROPIC.young, ISOTROPIC.poisson, ISOTROPIC.shear, axes=(tuple(Q[0]), tuple(Q[1])))
        np.testing.assert_allclose(law.elasticity(), ELASTIC.elasticity(), atol=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_turned_wood_answers_a_turned_strain_with_the_turned_stress(seed):
    rng = np.random.default_rng(seed)
    Q = rotation(rng)
    e = rng.normal(size=6)
    straight = tensor(Orthotropic(**WOOD).elasticity() @ e)
    E = Q.T @ tensor(e, shear=2.0) @ Q
    there = np.array([E[0, 0], E[1, 1], E[2, 2], 2 * E[0, 1], 2 * E[1, 2], 2 * E[0, 2]])
    np.testing.assert_allclose(tensor(turned(Q).elasticity() @ there), Q.T @ straight @ Q, atol=1e-13)


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
    np.testing.assert_allclose(C, C.T, atol=1e-15)


def test_plane_stress_of_an_isotropic_law_in_closed_form():
    C, _ = reduced(ELASTIC, MODELS["plane_stress"])
    E, nu = 2.0, 0.3
    expected = E / (1 - nu**2) * np.array([[1, nu, 0, 0], [nu, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, (1 - nu) / 2]])
    np.testing.assert_allclose(C, expected, atol=1e-15)


@pytest.mark.parametrize("axes", [((0.0, 0.0, 1.0), (1.0, 1.0, 0.0)), ((1.0, 2.0, 0.0), (0.0, 0.0, -1.0))])
def test_any_axis_may_stand_along_z(axes):
    C, _ = reduced(Orthotropic(**WOOD, axes=axes), MODELS["plane_strain"])
    assert np.linalg.eigvalsh(C).min() > 0


def test_axes_out_of_the_plane_are_refused():
    law = turned(rotation(np.random.default_rng(2)))
    reduced(law, MODELS["3d"])
    with pytest.raises(DataError, match="couple the plane of the model plane_strain"):
        reduced(law, MODELS["plane_strain"])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Elastic(0.0, 0.3), "young is a stiffness above 0, not 0.0"),
        (lambda: Elastic(-1.0, 0.3), "young is a stiffness above 0, not -1.0"),
        (lambda: Elastic(np.nan, 0.3), "young is a stiffness above 0, not nan"),
        (lambda: Elastic(1.0, 0.5), "poisson lies between -1 and 0.5.*take 0.49"),
        (lambda: Elastic(1.0, -1.0), "poisson lies between -1 and 0.5"),
        (lambda: Elastic(1.0, 0.3, density=-1.0), "density is 0 or more, not -1.0"),
        (lambda: Elastic(1.0, 0.3, expansion=np.inf), "expansion is a number, not inf"),
        (lambda: Elastic(1.0, 0.3, reference_temperature=np.nan), "reference_temperature is a number, not nan"),
        (lambda: Orthotropic((1.0, 0.0, 1.0), (0, 0, 0), (1, 1, 1)), "young is a stiffness above 0"),
        (lambda: Orthotropic((1.0, 1.0), (0, 0, 0), (1, 1, 1)), "young of an orthotropic law is three numbers"),
        (lambda: Orthotropic((1.0, 1.0, 1.0), (0, 0, 0), (1, -1, 1)), "shear is a stiffness above 0"),
        (lambda: Orthotropic((1.0, 0.01, 1.0), (11.0, 0, 0), (1, 1, 1)), "negative energy"),
        (lambda: Orthotropic(**WOOD, axes=((1, 0, 0), (2, 0, 0))), "lie on one line"),
        (lambda: Orthotropic(**WOOD, axes=((1, 0, 0),)), "axes are two vectors"),
        (lambda: Orthotropic(**WOOD, expansion=(1.0, 2.0)), "expansion is one number, or one along each axis"),
    ],
)
def test_constants_that_make_no_material(make, says):
    with pytest.raises(DataError, match=says):
        make()


def test_a_poisson_above_a_half_is_allowed_where_the_energy_stays_positive():
    law = Orthotropic((1.0, 0.01, 1.0), (9.0, 0.0, 0.0), (1.0, 1.0, 1.0))  # nu12^2 < E1 / E2 = 100
    assert np.linalg.eigvalsh(law.elasticity()).min() > 0


def two_groups():
    mesh = plane_mixture()
    half = mesh.n_cells // 2
    groups = {"low": np.arange(half), "high": np.arange(half, mesh.n_cells), "both": np.arange(mesh.n_cells)}
    return Space.of(Mesh.create(mesh.points, mesh.blocks, cell_groups=groups), "plane_strain")


def test_laws_by_groups():
    space = two_groups()
    stiff = Elastic(100.0, 0.2, density=3.0)
    made = Materials.of(space, [(ELASTIC, ("low",)), (stiff, ("high",))])
    expected = np.arange(space.mesh.n_cells) >= space.mesh.n_cells // 2
    for number, block in enumerate(space.blocks):
        assert made.law[number].tolist() == expected[block.cell].astype(int).tolist()
        assert made.densities(number).tolist() == np.where(expected[block.cell], 3.0, 0.0).tolist()
    assert {int(k) for law in made.law for k in law} == {0, 1}
    assert made.terms.lame.tolist() == [list(ELASTIC.lame), list(stiff.lame)]


@pytest.mark.parametrize(
    ("given", "error", "says"),
    [
        ([(ELASTIC, ("low",))], DataError, "cells have no material: .*name a group"),
        ([(ELASTIC, ("low", "high")), (ISOTROPIC, ("both",))], DataError, "have two materials"),
        ([(ELASTIC, None), (ISOTROPIC, None)], DataError, "have two materials"),
        ([(ELASTIC, ("lo",))], GroupNotFoundError, "did you mean low"),
        ([], DataError, "cells have no material"),
    ],
)
def test_every_cell_has_one_law(given, error, says):
    with pytest.raises(error, match=says):
        Materials.of(two_groups(), given)


def test_a_law_the_model_cannot_have_is_refused_at_once():
    with pytest.raises(DataError, match="couple the plane"):
        Materials.of(Space.of(square("QUAD4", 1), "plane_stress"), turned(rotation(np.random.default_rng(2))))


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_the_terms_rebuild_the_tensor(model):
    law = Orthotropic(**WOOD, axes=((2.0, 1.0), (0.0, 1.0)))
    made = Materials(model, (ELASTIC, law), ())
    start, at, value, *_ = made.terms
    S = model.selector
    for k, one in enumerate((ELASTIC, law)):
        A = np.einsum("kis,km,mjt->sitj", S, plain.constitutive(one, model), S)
        got = np.zeros((model.dim, model.dim, model.rows, model.rows))
        pairs = np.transpose(np.triu_indices(model.dim))
        for (pair, ij), v in zip(at[start[k] : start[k + 1]], value[start[k] : start[k + 1]], strict=True):
            got[*pairs[pair], ij // model.rows, ij % model.rows] += v
        upper = np.triu(np.ones((model.dim, model.dim)))[..., None, None]
        np.testing.assert_allclose(got, A.transpose(0, 2, 1, 3) * upper, atol=1e-14)


def test_a_law_that_answers_at_points_has_no_stiffness_of_its_own_even_if_it_has_the_constants_of_another():
    class Yielding(Elastic):
        n_history = 1

        def respond(self, H, history):
            raise NotImplementedError

    space = Space.of(square("QUAD4", 1), "plane_strain")
    for law, by_points in ((Yielding(200.0, 0.3), True), (ELASTIC, False), (NeoHookean(200.0, 0.3), True)):
        materials = Materials.of(space, law)
        assert materials.pointwise == (by_points,)
        assert materials.tables[0].any() == (not isinstance(law, Yielding))
