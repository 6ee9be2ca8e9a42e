"""Finite strains: twins, differences, turns, the linear limit, and stretches with known stress."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.optimize import brentq

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacsolver.bodies import finite
from lacsolver.bodies import small as assemble
from lacsolver.bodies.finite import InadmissibleError, NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.space.space import MODELS, Space
from tests.lacsolver import plain as plain_finite
from tests.lacsolver.bodies import (
    agree,
    cauchy_stress,
    first_piola,
    force_and_tangent,
    internal_force,
    stored_energy,
    tangent,
)
from tests.lacsolver.bodies import PAIRS, PLANE_MODELS, body, cube, distorted, mixture, one_cell, plane_mixture, rim
from tests.lacsolver.test_assemble import rigid, solved
from tests.quality_cells import rotation
from tests.samples import each_option

LAWS = {
    "kirchhoff": SaintVenantKirchhoff(200.0, 0.3, expansion=2e-3, reference_temperature=20.0),
    "neo-hookean": NeoHookean(200.0, 0.3, expansion=2e-3, reference_temperature=20.0),
}
RUBBER = {
    "nearly incompressible": NeoHookean(3.0, 0.49),
    "widens when pulled": NeoHookean(3.0, -0.4),
}
#: of each type of cell, model and law
CASES = each_option((*pair, law) for pair, law in product(PAIRS, LAWS))
MIXTURES = [(order, model) for order in ("1", "2", "2-full") for model in ("3d", *PLANE_MODELS)]


def made(mesh, model, law):
    thickness = 0.4 if model == "plane_stress" else None
    space = Space.of(mesh, model, thickness=thickness)
    return space, Materials.of(space, law)


def shaken(space, size, seed=0):
    """A displacement of all nodes at random, upon a stretch and a turn; in axisymmetry no turn."""
    rng = np.random.default_rng(seed)
    x = space.mesh.points[:, : space.dim]
    F = np.eye(space.dim) + rng.uniform(-0.15, 0.15, (space.dim, space.dim))
    if space.model.axisymmetric:
        F = np.diag([1.1, 0.8])
    elif space.dim == 3:
        F = rotation(rng) @ F
    else:
        F = np.array([[0.6, -0.8], [0.8, 0.6]]) @ F
    return (x @ F.T - x + rng.uniform(-size, size, x.shape)).ravel()


def two_laws(order, model):
    """A mixture of cells, of the two laws in turn."""
    mesh = mixture(order) if model == "3d" else plane_mixture(order)
    mesh = distorted(mesh, 0.06 if order == "1" else 0.03, seed=4)
    groups = {"a": np.arange(0, mesh.n_cells, 2), "b": np.arange(1, mesh.n_cells, 2)}
    mesh = Mesh.create(mesh.points, mesh.blocks, space_dim=mesh.space_dim, cell_groups=groups)
    space = Space.of(mesh, model)
    return space, Materials.of(space, [(LAWS["kirchhoff"], ("a",)), (LAWS["neo-hookean"], ("b",))])


def by_differences(f, u, h):
    """df/du at u, by differences of order 4."""
    columns = []
    for e in np.eye(len(u)):
        near, far = f(u + h * e) - f(u - h * e), f(u + 2 * h * e) - f(u - 2 * h * e)
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize(("name", "model", "law"), CASES)
def test_the_tangent_is_the_derivative_of_the_forces_which_are_that_of_the_energy(name, model, law):
    space, materials = made(one_cell(name, 0.1 if CELLS[name].order == 1 else 0.05), model, LAWS[law])
    u = shaken(space, 0.04)
    f, K = force_and_tangent(space, materials, u)
    expected = by_differences(lambda v: internal_force(space, materials, v), u, 1e-4)
    np.testing.assert_allclose(K.toarray(), expected, rtol=0, atol=1e-9 * abs(K).max())
    expected = by_differences(lambda v: np.array([stored_energy(space, materials, v)]), u, 1e-4)[0]
    np.testing.assert_allclose(f, expected, rtol=0, atol=1e-9 * np.abs(f).max())


@pytest.mark.parametrize("law", RUBBER)
@pytest.mark.parametrize("model", MODELS)
def test_the_tangent_of_extreme_rubber(model, law):
    space, materials = made(one_cell("HEXA8" if model == "3d" else "QUAD8", 0.05), model, RUBBER[law])
    u = shaken(space, 0.04)
    _, K = force_and_tangent(space, materials, u)
    expected = by_differences(lambda v: internal_force(space, materials, v), u, 1e-4)
    np.testing.assert_allclose(K.toarray(), expected, rtol=0, atol=1e-8 * abs(K).max())


@pytest.mark.parametrize(("name", "model", "law"), CASES)
def test_forces_and_tangent_equal_their_plain_twins(name, model, law):
    space, materials = made(distorted(body(name, 1), 0.04), model, LAWS[law])
    u = shaken(space, 0.03)
    f, K = force_and_tangent(space, materials, u)
    twin, K_twin = plain_finite.force_and_tangent(space, materials, u)
    np.testing.assert_allclose(f, twin, rtol=0, atol=1e-13 * np.abs(twin).max())
    assert abs(K - K_twin).max() < 1e-13 * abs(K_twin).max()


@pytest.mark.parametrize(("order", "model"), MIXTURES)
def test_two_laws_in_a_mixture_equal_their_twins(order, model):
    space, materials = two_laws(order, model)
    u = shaken(space, 0.02)
    f, K = force_and_tangent(space, materials, u)
    twin, K_twin = plain_finite.force_and_tangent(space, materials, u)
    np.testing.assert_allclose(f, twin, rtol=0, atol=1e-13 * np.abs(twin).max())
    assert abs(K - K_twin).max() < 1e-13 * abs(K_twin).max()
    P, sigma = first_piola(space, materials, u), cauchy_stress(space, materials, u)
    for got, cauchy, (_, _, there, _, F) in zip(P, sigma, plain_finite.fields(space, materials, u), strict=True):
        np.testing.assert_allclose(got, there, rtol=0, atol=1e-12 * np.abs(there).max())
        T = there @ F.swapaxes(2, 3) / np.linalg.det(F)[..., None, None]
        np.testing.assert_allclose(T, T.swapaxes(2, 3), rtol=0, atol=1e-12 * np.abs(T).max())
        pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)][: space.model.n_stress]
        for k, (s, t) in enumerate(pairs):
            np.testing.assert_allclose(cauchy[..., k], T[..., s, t], rtol=0, atol=1e-12 * np.abs(T).max())


@pytest.mark.parametrize(("order", "model"), MIXTURES)
@pytest.mark.usefixtures("every_thread")
def test_the_same_for_any_threads_and_symmetric(order, model):
    space, materials = two_laws(order, model)
    u = shaken(space, 0.02)
    f, K = force_and_tangent(space, materials, u)
    assert agree(K, K.T)
    assert agree(internal_force(space, materials, u), f)
    for threads in (2, 3, 7):
        again, M = force_and_tangent(space, materials, u, threads=threads)
        assert agree(again, f) and agree(M, K)
        assert agree(internal_force(space, materials, u, threads=threads), f)
        energy = stored_energy(space, materials, u, threads=threads)
        assert energy == pytest.approx(stored_energy(space, materials, u), rel=1e-14)


def linearised(materials):
    """The laws of small strains with the same constants."""
    names = [f.name for f in fields(Elastic)]
    return replace(materials, laws=tuple(Elastic(*(getattr(law, n) for n in names)) for law in materials.laws))


@pytest.mark.parametrize(("order", "model"), MIXTURES)
def test_at_rest_the_tangent_is_the_linear_stiffness(order, model):
    space, materials = two_laws(order, model)
    f, K = force_and_tangent(space, materials, np.zeros(space.n_dof))
    linear = assemble_stiffness(space, linearised(materials))
    assert not f.any()
    assert abs(K - linear).max() < 2e-15 * abs(linear).max()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("size", [1e-4, 1e-8])
def test_forces_of_small_strains_keep_their_digits(model, size):
    """f(u) = K u + O(u^2), with no round-off of 1 beside u."""
    space, materials = two_laws("2", model)
    u = size * np.random.default_rng(0).normal(size=space.n_dof)
    linear = assemble_stiffness(space, linearised(materials)) @ u
    f = internal_force(space, materials, u)
    assert np.abs(f - linear).max() < (30 * size + 1e-13) * np.abs(linear).max()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("order", ["1", "2"])
@pytest.mark.parametrize("model", ["3d", "plane_strain", "plane_stress"])
def test_a_turned_body_is_free_of_stress_and_a_turn_takes_the_forces_along(model, order, law):
    mesh = distorted(mixture(order) if model == "3d" else plane_mixture(order), 0.03)
    space, materials = made(mesh, model, LAWS[law])
    x = space.mesh.points[:, : space.dim]
    Q = rotation(np.random.default_rng(3)) if space.dim == 3 else np.array([[-0.28, -0.96], [0.96, -0.28]])
    f, K = force_and_tangent(space, materials, (x @ Q.T - x + 0.7).ravel())
    assert np.abs(f).max() < 1e-13 * abs(K).max()
    (modes,) = np.linalg.qr(rigid(space))[:1]
    turned = np.kron(np.eye(len(x)), Q)
    assert np.abs(K @ (turned @ modes)).max() < 1e-12 * abs(K).max()
    u = shaken(space, 0.02).reshape(x.shape)
    f, there = (internal_force(space, materials, v.ravel()) for v in (u, (x + u) @ Q.T - x))
    np.testing.assert_allclose(there, turned @ f, rtol=0, atol=1e-12 * np.abs(f).max())


def uniaxial(law, stretch, free):
    """P along x at a stretch; `free`: those of y and z that no force holds (the others stay 1). (P_xx, F)."""
    lam, mu = law.lame

    def stress(a):
        F = np.array([stretch, *(a if s in free else 1.0 for s in (1, 2))])
        if isinstance(law, NeoHookean):
            return F, mu * (F - 1 / F) + lam * np.log(F.prod()) / F
        E = (F**2 - 1) / 2
        return F, F * (lam * E.sum() + 2 * mu * E)

    a = brentq(lambda a: stress(a)[1][free[0]], 0.3, 3.0, xtol=1e-15, rtol=1e-15)
    F, P = stress(a)
    return F, P


@pytest.mark.parametrize(("law", "stretch"), [*product(LAWS, (0.6, 0.9, 1.5)), ("neo-hookean", 2.5)])
@pytest.mark.parametrize(("model", "free"), [("3d", (1, 2)), ("plane_strain", (1,)), ("plane_stress", (1, 2))])
def test_a_bar_pulled_along_x(model, free, law, stretch):
    """Distorted cells, free sides: the stress is uniform, and that of the closed form."""
    mesh = distorted(mixture("1") if model == "3d" else plane_mixture("2"), 0.03)
    space, materials = made(mesh, model, LAWS[law])
    F, P = uniaxial(LAWS[law], stretch, free)
    x = space.mesh.points[:, : space.dim]
    u = (x * (F[: space.dim] - 1)).ravel()
    for got in first_piola(space, materials, u):
        expected = np.zeros((3, 3))
        expected[0, 0] = P[0]
        expected[2, 2] = P[2] if model == "plane_strain" else 0.0
        np.testing.assert_allclose(got, np.broadcast_to(expected, got.shape), atol=1e-11 * np.abs(P).max())
    for sigma in cauchy_stress(space, materials, u):
        np.testing.assert_allclose(sigma[..., 0], P[0] / (F[1] * F[2]), rtol=1e-12)
    f = internal_force(space, materials, u).reshape(x.shape)
    inside = ~rim(plane_mixture("2") if space.dim == 2 else mixture("1"))
    assert np.abs(f[inside]).max() < 1e-12 * np.abs(f).max()


@pytest.mark.parametrize("law", LAWS)
def test_a_ring_widened_and_drawn_out(law):
    """F = diag(a, b, a): radial and hoop stress are equal, and it is in equilibrium."""
    space, materials = made(distorted(plane_mixture("2"), 0.03), "axisymmetric", LAWS[law])
    lam, mu = LAWS[law].lame
    F = np.array([1.3, 0.8, 1.3])
    if law == "neo-hookean":
        P = mu * (F - 1 / F) + lam * np.log(F.prod()) / F
    else:
        E = (F**2 - 1) / 2
        P = F * (lam * E.sum() + 2 * mu * E)
    u = (space.mesh.points[:, :2] * (F[:2] - 1)).ravel()
    for got, sigma in zip(first_piola(space, materials, u), cauchy_stress(space, materials, u), strict=True):
        np.testing.assert_allclose(got, np.broadcast_to(np.diag(P), got.shape), atol=1e-12 * np.abs(P).max())
        cauchy = [*(P * F / F.prod()), 0.0]
        np.testing.assert_allclose(sigma, np.broadcast_to(cauchy, sigma.shape), atol=1e-12 * np.abs(P).max())
    inside = ~rim(plane_mixture("2"))
    f = internal_force(space, materials, u).reshape(-1, 2)
    assert np.abs(f[inside]).max() < 1e-12 * np.abs(f).max()


@pytest.mark.parametrize(("name", "model", "law"), CASES)
def test_patch_newton_finds_a_uniform_finite_strain_and_its_last_steps_are_quadratic(name, model, law):
    """The exact u on the rim, the inside at random nearby: Newton brings it back."""
    mesh = distorted(body(name, 2), 0.05 if CELLS[name].order == 1 else 0.03, seed=2)
    space, materials = made(mesh, model, LAWS[law])
    x = space.mesh.points[:, : space.dim]
    F = np.diag([1.3, 0.8, 1.1][: space.dim])
    if model != "axisymmetric":
        F[0, 1] = 0.4
    exact = (x @ F.T - x).ravel()
    free = ~np.repeat(rim(body(name, 2)), space.dim)
    u = exact + np.where(free, np.random.default_rng(1).uniform(-0.02, 0.02, len(exact)), 0.0)
    sizes = []
    for _ in range(12):
        f, K = force_and_tangent(space, materials, u)
        sizes.append(np.abs(f[free]).max() / np.abs(f).max())
        if sizes[-1] < 1e-14:
            break
        u = u + solved(K.tocsc(), np.zeros_like(u), free, -f)
    assert np.abs(u - exact).max() < 1e-13
    assert len(sizes) < 9
    for before, after in pairwise(s for s in sizes if s < 0.01):
        assert after < max(50 * before**2, 1e-13)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("law", LAWS)
def test_a_body_that_is_warm_and_free_has_no_stress_and_a_held_one_pushes(model, law):
    mesh = mixture("2") if model == "3d" else plane_mixture("2")
    space, materials = made(mesh, model, LAWS[law])
    theta = finite.thermal_stretches(space, materials, 120.0)
    for part in theta:
        np.testing.assert_allclose(part, 1.2, rtol=1e-15)
    x = space.mesh.points[:, : space.dim]
    if model != "plane_strain":
        f, K = force_and_tangent(space, materials, (0.2 * x).ravel(), stretches=theta)
        assert np.abs(f).max() < 1e-12 * abs(K).max()
        for sigma in cauchy_stress(space, materials, (0.2 * x).ravel(), stretches=theta):
            assert np.abs(sigma).max() < 1e-12 * LAWS[law].young
    u = shaken(space, 0.02)
    f, K = force_and_tangent(space, materials, u, stretches=theta)
    twin, K_twin = plain_finite.force_and_tangent(space, materials, u, 1.2)
    np.testing.assert_allclose(f, twin, rtol=0, atol=1e-13 * np.abs(twin).max())
    assert abs(K - K_twin).max() < 1e-13 * abs(K_twin).max()
    v = np.random.default_rng(5).normal(size=len(u))

    def stored(size):
        return stored_energy(space, materials, u + size * v, stretches=theta)

    slope = (8 * (stored(1e-4) - stored(-1e-4)) - (stored(2e-4) - stored(-2e-4))) / 12e-4
    assert f @ v == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize("model", MODELS)
def test_a_little_warmth_is_that_of_small_strains(model):
    space, materials = two_laws("2", model)
    warm = [(lambda x, t: 20 + t * x[:, 0], space.cells(("a",)))]
    size = 1e-5
    f = internal_force(
        space, materials, np.zeros(space.n_dof), stretches=finite.thermal_stretches(space, materials, warm, size)
    )
    linear = assemble.internal_force(space, linearised(materials), np.zeros(space.n_dof), temperature=warm, t=size)
    np.testing.assert_allclose(f, linear, rtol=0, atol=1e-6 * np.abs(linear).max())
    assert finite.thermal_stretches(space, materials, None) is None
    with pytest.raises(DataError, match=r"at time 2 the temperature shrinks cells .* to nothing"):
        finite.thermal_stretches(space, materials, -600.0, 2.0)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.usefixtures("every_thread")
def test_an_inverted_cell_is_told_by_its_number(law, threads):
    mesh = cube("HEXA8", 2)
    mesh = Mesh.create(mesh.points, mesh.blocks, cell_number=np.arange(11, 11 + mesh.n_cells))
    space, materials = made(mesh, "3d", LAWS[law])
    x = space.mesh.points
    u = np.zeros_like(x)
    u[np.all(x == 1, axis=1)] = -1.6
    for run in (internal_force, tangent, cauchy_stress, stored_energy):
        with pytest.raises(InadmissibleError, match=r"cells 18 are inverted .*smaller steps") as told:
            run(space, materials, u.ravel(), threads=threads)
        assert told.value.cells == (18,)
        assert told.value.status == 4
    force_and_tangent(space, materials, 0.1 * u.ravel(), threads=threads)


def test_a_stretch_that_no_plane_stress_can_have():
    """Saint Venant-Kirchhoff with free z: 1 + 2 E_zz < 0 where the plane is stretched too far."""
    space, materials = made(one_cell("QUAD4"), "plane_stress", LAWS["kirchhoff"])
    x = space.mesh.points[:, :2]
    with pytest.raises(InadmissibleError):
        internal_force(space, materials, (1.0 * x).ravel())
    internal_force(space, materials, (0.3 * x).ravel())


def test_what_is_refused():
    space = Space.of(one_cell("QUAD4"), "plane_strain")
    with pytest.raises(RequestError, match=r"the law Elastic is for small strains; .*neo_hookean"):
        internal_force(space, Materials.of(space, Elastic(1.0, 0.3)), np.zeros(8))
    rubber = Materials.of(space, NeoHookean(1.0, 0.3))
    with pytest.raises(ValueError, match="threads is 1 or more"):
        internal_force(space, rubber, np.zeros(8), threads=0)
    with pytest.raises(ValueError, match=r"out must be \(16, 2, 2\)"):
        force_and_tangent(space, rubber, np.zeros(8), out=np.zeros((3, 2, 2)))
    with pytest.raises(ValueError, match=r"a displacement must be \(8,\)"):
        internal_force(space, rubber, np.zeros(7))
    out = np.ones((16, 2, 2))
    _, K = force_and_tangent(space, rubber, np.zeros(8), out=out)
    assert np.shares_memory(K.data, out)
    assert abs(K - assemble_stiffness(space, linearised(rubber))).max() < 1e-15


@pytest.mark.parametrize(
    "linear",
    [
        assemble_stiffness,
        lambda *given: assemble.stress(*given, np.zeros(8)),
        lambda *given: assemble.internal_force(*given, np.zeros(8)),
    ],
    ids=["stiffness", "stress", "force"],
)
@pytest.mark.parametrize("law", LAWS)
def test_linear_elasticity_takes_no_law_of_finite_strains(linear, law):
    space = Space.of(one_cell("QUAD4"), "plane_strain")
    name, instead = type(LAWS[law]).__name__, "lacsolver.bodies.pointwise.DisplacedBodies"
    said = f"the law {name} is for finite strains, and this is linear elasticity; take {instead}, or"
    with pytest.raises(RequestError, match=said):
        linear(space, Materials.of(space, LAWS[law]))
