"""Small and finite kinematics behind one signature; loads that follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import bsr_array, csr_array

from lacsolver.bodies import finite
from lacsolver.bodies.finite import InadmissibleError, NeoHookean
from lacsolver.bodies.kinematics import kinematics_of
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.case import Material, parse_case
from lacsolver.problem import acting, loads
from lacsolver.problem.laws import law_of
from lacsolver.space.space import MODELS, Space
from tests.lacsolver.bodies import cauchy_stress, internal_force
from tests.lacsolver.bodies import cube, mixture, plane_mixture, square
from tests.lacsolver.held import with_sides
from tests.lacsolver.test_finite import by_differences, linearised, shaken

WARM = [(lambda x, t: 20 + 5 * t * x[:, 0], None)]


def body(model, law=None):
    mesh = mixture("2") if model == "3d" else plane_mixture("2")
    space = Space.of(mesh, model, thickness=0.4 if model == "plane_stress" else None)
    materials = Materials.of(space, law or NeoHookean(200.0, 0.3, expansion=1e-3, reference_temperature=20.0))
    k = np.zeros((space.mesh.n_nodes, space.dim))
    k[3:7] = 30.0
    springs = loads.springs(space, np.arange(3, 7), [30.0] * space.dim)
    assert np.array_equal(springs.diagonal(), k.ravel())
    return space, materials, springs


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", ["small", "finite"])
def test_tangent_force_and_energy_belong_together(name, model):
    space, materials, springs = body(model)
    materials = linearised(materials) if name == "small" else materials
    made = kinematics_of(name, space, materials, springs=springs, temperature=WARM, threads=2)
    u, v = shaken(space, 0.02), np.random.default_rng(1).normal(size=space.n_dof)
    f, K = made.internal_force(u, 1.0), made.tangent(u, 1.0)
    assert isinstance(K, bsr_array if name == "small" else csr_array)

    def along(of):
        h = 1e-4
        return (8 * (of(u + h * v) - of(u - h * v)) - (of(u + 2 * h * v) - of(u - 2 * h * v))) / (12 * h)

    slope = along(lambda w: made.internal_force(w, 1.0))
    np.testing.assert_allclose(K @ v, slope, rtol=0, atol=1e-8 * np.abs(slope).max())
    if name == "small":
        f = f - loads.thermal_force(space, materials, WARM, 1.0)
    assert f @ v == pytest.approx(along(lambda w: made.energy(w, 1.0)), rel=1e-7)


@pytest.mark.parametrize("model", MODELS)
def test_small_strains_are_the_same_in_both(model):
    space, materials, springs = body(model)
    laws = {"small": linearised(materials), "finite": materials}
    one, two = (kinematics_of(name, space, of, springs=springs) for name, of in laws.items())
    u = 1e-6 * np.random.default_rng(0).normal(size=space.n_dof)
    assert one.linear and not one.finite
    assert two.finite and not two.linear
    size = np.abs(one.internal_force(u, 0.0)).max()
    np.testing.assert_allclose(two.internal_force(u, 0.0), one.internal_force(u, 0.0), rtol=0, atol=1e-4 * size)
    assert two.energy(u, 0.0) == pytest.approx(one.energy(u, 0.0), rel=1e-4)
    for a, b in zip(one.stress(u, 0.0), two.stress(u, 0.0), strict=True):
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-4 * np.abs(a).max())
    rest = np.zeros(space.n_dof)
    assert abs(two.tangent(rest, 0.0) - one.tangent(rest, 0.0)).max() < 1e-14 * abs(one.tangent(rest, 0.0)).max()


def test_a_tangent_is_not_written_over_by_the_next_and_stretches_follow_the_time():
    space, materials, springs = body("plane_strain")
    made = kinematics_of("finite", space, materials, springs=springs, temperature=WARM)
    u = shaken(space, 0.02)
    K = made.tangent(u, 1.0)
    kept = K.copy()
    assert abs(made.tangent(0.5 * u, 2.0) - K).max() > 1e-3 * abs(K).max()
    assert abs(K - kept).max() == 0
    for t in (2.0, 1.0):
        theta = finite.thermal_stretches(space, materials, WARM, t)
        f = internal_force(space, materials, u, stretches=theta) + springs @ u
        assert np.array_equal(f, made.internal_force(u, t))
        sigma = cauchy_stress(space, materials, u, stretches=theta)
        assert all(np.array_equal(a, b) for a, b in zip(sigma, made.stress(u, t), strict=True))


def test_what_is_refused():
    space, _, _ = body("plane_strain")
    with pytest.raises(ValueError, match="kinematics are small or finite, not 'large'"):
        kinematics_of("large", space, Materials.of(space, Elastic(1.0, 0.3)))
    made = kinematics_of("finite", space, Materials.of(space, NeoHookean(1.0, 0.3)))
    inward = -2 * space.mesh.points[:, :2].ravel() * np.tile([1.0, 0.0], space.mesh.n_nodes)
    for ask in (made.internal_force, made.tangent, made.stress, made.energy):
        with pytest.raises(InadmissibleError):
            ask(inward, 0.0)


@pytest.mark.parametrize("law", ["saint_venant_kirchhoff", "neo_hookean"])
def test_the_law_of_a_record(law):
    made = law_of(Material(law=law, young=10.0, poisson=0.2, density=3.0, expansion=1e-5, reference_temperature=7.0))
    expected = {"saint_venant_kirchhoff": finite.SaintVenantKirchhoff, "neo_hookean": NeoHookean}[law]
    assert made == expected(10.0, 0.2, 3.0, 1e-5, 7.0)


FOLLOWED = """mesh = "a.msh"
model = "{model}"
kinematics = "finite"
[[material]]
law = "neo_hookean"
young = 10.0
poisson = 0.3
expansion = 1e-3
[[pressure]]
group = "x1"
value = "2 + t * y"
follower = true
[[pressure]]
group = "y1"
value = 3.0
[[pressure]]
group = "y0"
value = 1.0
follower = true
[[temperature]]
value = 50.0
"""


@pytest.mark.parametrize("model", MODELS)
def test_the_loads_of_a_case_follow_where_they_are_told_to(model):
    case = parse_case(FOLLOWED.format(model=model), "press.toml")
    mesh = with_sides(cube("HEXA8", 1) if model == "3d" else square("QUAD8", 1))
    space = Space.of(mesh, model)
    materials = Materials.of(space, [(law_of(m), m.groups) for m in case.material])
    u = 0.3 * shaken(space, 0.02)
    x = mesh.points.copy()
    x[:, : space.dim] += u.reshape(-1, space.dim)
    f = acting.load(space, materials, case, 0.5, u=u)
    parts = [
        loads.pressure(space, mesh.cells_of("x1"), lambda p, t: 2 + t * p[:, 1], 0.5, x=x),
        loads.pressure(space, mesh.cells_of("y1"), 1.5),
        loads.pressure(space, mesh.cells_of("y0"), 0.5, x=x),
    ]
    np.testing.assert_allclose(f, sum(parts), atol=1e-14)
    expected = by_differences(lambda v: acting.load(space, materials, case, 0.5, u=v), u, 1e-3)
    K = acting.load_tangent(space, case, u, 0.5).toarray()
    np.testing.assert_allclose(K, expected, rtol=0, atol=1e-11 * np.abs(K).max())
    still = replace(case, pressure=case.pressure[1:2])
    assert acting.load_tangent(space, still, u, 0.5) is None
    np.testing.assert_allclose(acting.load(space, materials, still, 0.5, u=u), parts[1], atol=1e-14)
