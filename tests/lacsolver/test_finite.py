"""Finite strains: differences, twins, turns, the linear limit, stretches with known stress."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.sparse import bsr_array, csr_array

from lacmesh.cells import CELLS
from lacmesh.errors import DataError, RequestError
from lacsolver.bodies import small as assemble
from lacsolver.bodies.errors import InadmissibleError
from lacsolver.bodies.hyperelastic import NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.kinematics import kinematics_of
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.bodies.temperature import warming
from lacsolver.problem.loads import thermal_force
from lacsolver.problem.springs import to_ground
from lacsolver.space.space import MODELS, Space
from tests.lacsolver import plain
from tests.lacsolver.bodies import (
    MIXTURES,
    PAIRS,
    agree,
    cauchy_stress,
    cube,
    distorted,
    first_piola,
    force_and_tangent,
    in_two,
    internal_force,
    made,
    mixed,
    one_cell,
    rigid,
    rim,
    stored_energy,
    tangent,
    unturned,
)
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
EVERY_LAW = pytest.mark.parametrize("law", LAWS)
#: of each type of cell, model and law
CASES = each_option((*pair, law) for pair, law in product(PAIRS, LAWS))
EXTREME = [("HEXA8" if model == "3d" else "QUAD8", model, law) for model in MODELS for law in RUBBER]
WARM = [(lambda x, t: 20 + 5 * t * x[:, 0], None)]


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


def by_differences(f, u, h):
    """df/du at u, by differences of order 4."""
    columns = []
    for e in np.eye(len(u)):
        near, far = f(u + h * e) - f(u - h * e), f(u + 2 * h * e) - f(u - 2 * h * e)
        columns.append((8 * near - far) / (12 * h))
    return np.stack(columns, axis=1)


def two_laws(order, model):
    """A mixture of cells, of the two laws in turn."""
    space = Space.of(in_two(mixed(order, model)), model)
    return space, Materials.of(space, [(LAWS["kirchhoff"], ("a",)), (LAWS["neo-hookean"], ("b",))])


def linearised(materials):
    """The laws of small strains with the same constants."""
    names = [f.name for f in fields(Elastic)]
    return replace(materials, laws=tuple(Elastic(*(getattr(law, n) for n in names)) for law in materials.laws))


@pytest.mark.rows("TETRA4-3d-kirchhoff", "TRIA3-plane_strain-neo-hookean", "QUAD8-plane_stress-widens when pulled")
@pytest.mark.parametrize(("name", "model", "law"), [*CASES, *EXTREME])
def test_the_tangent_is_the_derivative_of_the_forces_which_are_that_of_the_energy(name, model, law):
    mesh = one_cell(name, 0.1 if CELLS[name].order == 1 else 0.05)
    space, materials = made(mesh, model, (LAWS | RUBBER)[law])
    u, within = shaken(space, 0.04), 1e-9 if law in LAWS else 1e-8
    f, K = force_and_tangent(space, materials, u)
    expected = by_differences(lambda v: internal_force(space, materials, v), u, 1e-4)
    np.testing.assert_allclose(K.toarray(), expected, rtol=0, atol=within * abs(K).max())
    expected = by_differences(lambda v: np.array([stored_energy(space, materials, v)]), u, 1e-4)[0]
    np.testing.assert_allclose(f, expected, rtol=0, atol=within * np.abs(f).max())


@pytest.mark.rows("1-plane_stress", "1-axisymmetric")
@pytest.mark.parametrize(("order", "model"), MIXTURES)
@pytest.mark.usefixtures("every_thread")
def test_two_laws_in_a_mixture(order, model):
    """Symmetric, and the same for any number of threads; the Cauchy stress is P F^T / J."""
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
    if model == "plane_stress":
        return  # with a stretch across that is found point by point
    P, sigma = first_piola(space, materials, u), cauchy_stress(space, materials, u)
    for got, cauchy, (name, nodes, _) in zip(P, sigma, space.blocks, strict=True):
        D, _ = plain.variations(space, name, nodes)
        F = np.eye(3) + np.einsum("cqsiat,cat->cqsi", D, u.reshape(-1, space.dim)[nodes])
        T = got @ F.swapaxes(2, 3) / np.linalg.det(F)[..., None, None]
        for k, (s, t) in enumerate(plain.PAIRS[: space.model.n_stress]):
            np.testing.assert_allclose(cauchy[..., k], T[..., s, t], rtol=0, atol=1e-12 * np.abs(T).max())


@pytest.mark.parametrize(("order", "model"), MIXTURES)
def test_small_strains_are_linear_and_keep_their_digits(order, model):
    """f(u) = K u + O(u^2), with no round-off of 1 beside u, and K that of linear elasticity."""
    space, materials = two_laws(order, model)
    f, K = force_and_tangent(space, materials, np.zeros(space.n_dof))
    linear = assemble_stiffness(space, linearised(materials))
    assert not f.any() and abs(K - linear).max() < 2e-15 * abs(linear).max()
    for size in (1e-4, 1e-8):
        u = size * np.random.default_rng(0).normal(size=space.n_dof)
        f = internal_force(space, materials, u)
        assert np.abs(f - linear @ u).max() < (30 * size + 1e-13) * np.abs(linear @ u).max()


@EVERY_LAW
@pytest.mark.parametrize("order", ["1", "2"])
@pytest.mark.parametrize("model", ["3d", "plane_strain", "plane_stress"])
def test_a_turned_body_is_free_of_stress_and_a_turn_takes_the_forces_along(model, order, law):
    mesh = distorted(unturned(order, model), 0.03)
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


def nominal(law, stretch):
    """(3,): first Piola-Kirchhoff stress P = dW/d(stretch)."""
    lam, mu = law.lame
    if isinstance(law, NeoHookean):
        return mu * (stretch - 1 / stretch) + lam * np.log(stretch.prod()) / stretch
    E = (stretch**2 - 1) / 2
    return stretch * (lam * E.sum() + 2 * mu * E)


def stretches(law, along, stretch, free, held=1.0):
    """(3,): stretches with one given along an axis; along those that are free no force acts, others are `held`."""

    def with_sides_at(wide):
        out = np.full(3, held)
        out[along], out[list(free)] = stretch, wide
        return out

    return with_sides_at(brentq(lambda w: nominal(law, with_sides_at(w))[free[0]], 0.3, 3.0, xtol=1e-15, rtol=1e-15))


BARS = [
    (model, free, law, stretch)
    for model, free in (("3d", (1, 2)), ("plane_strain", (1,)), ("plane_stress", (1, 2)))
    for law, stretch in [*product(LAWS, (0.6, 0.9, 1.5)), ("neo-hookean", 2.5)]
]


@pytest.mark.rows("plane_strain-free13-neo-hookean-2.5-1.2", "axisymmetric-None-kirchhoff-1.3-1.0")
@pytest.mark.parametrize("theta", [1.0, 1.2])
@pytest.mark.parametrize("model, free, law, stretch", [*BARS, *(("axisymmetric", None, law, 1.3) for law in LAWS)])
def test_a_bar_pulled_along_x_and_a_ring_widened(model, free, law, stretch, theta):
    """Distorted cells, cold or warm: the stress is uniform, that of the closed form. A ring has F = diag(a, b, a).

    Heat stretches by theta first: P = theta^2 P(F / theta), and no force acts if F is that alone.
    """
    order = "1" if model == "3d" else "2"
    space, materials = made(distorted(unturned(order, model), 0.03), model, LAWS[law])
    how = {} if theta == 1 else {"warmer": warming(space, materials, 120.0)}
    elastic = np.array([stretch, 0.8, stretch]) if free is None else stretches(LAWS[law], 0, stretch, free, 1 / theta)
    F, P, dim = theta * elastic, theta**2 * nominal(LAWS[law], elastic), space.dim
    u = (space.mesh.points[:, :dim] * (F[:dim] - 1)).ravel()
    cauchy = np.pad(P * F / F.prod(), (0, space.model.n_stress - 3))
    pairs = zip(first_piola(space, materials, u, **how), cauchy_stress(space, materials, u, **how), strict=True)
    for got, sigma in pairs:
        np.testing.assert_allclose(got, np.broadcast_to(np.diag(P), got.shape), atol=1e-11 * np.abs(P).max())
        np.testing.assert_allclose(sigma, np.broadcast_to(cauchy, sigma.shape), atol=1e-11 * np.abs(P).max())
    f = internal_force(space, materials, u, **how).reshape(-1, dim)
    assert np.abs(f[~rim(unturned(order, model))]).max() < 1e-12 * np.abs(f).max()
    v = np.random.default_rng(5).normal(size=len(u))
    ahead, behind = (stored_energy(space, materials, u + h * v, **how) for h in (1e-5, -1e-5))
    assert f.ravel() @ v == pytest.approx((ahead - behind) / 2e-5, rel=1e-6)
    if theta > 1 and model != "plane_strain":
        swollen = (space.mesh.points[:, :dim] * (theta - 1)).ravel()
        assert np.abs(internal_force(space, materials, swollen, **how)).max() < 1e-12 * np.abs(f).max()


@pytest.mark.parametrize("model", MODELS)
def test_a_little_warmth_is_that_of_small_strains(model):
    space, materials = two_laws("2", model)
    warm = [(lambda x, t: 20 + t * x[:, 0], space.cells(("a",)))]
    size = 1e-5
    f = internal_force(space, materials, np.zeros(space.n_dof), warmer=warming(space, materials, warm, size))
    linear = assemble.internal_force(space, linearised(materials), np.zeros(space.n_dof), temperature=warm, t=size)
    np.testing.assert_allclose(f, linear, rtol=0, atol=1e-6 * np.abs(linear).max())
    assert warming(space, materials, None) is None
    with pytest.raises(DataError, match=r"at time 2 the temperature shrinks cells .* to nothing"):
        warming(space, materials, -600.0, 2.0)


@EVERY_LAW
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.usefixtures("every_thread")
def test_an_inverted_cell_is_told_by_its_number(law, threads):
    mesh = cube("HEXA8", 2)
    mesh = replace(mesh, cell_number=np.arange(11, 11 + mesh.n_cells))
    space, materials = made(mesh, "3d", LAWS[law])
    x = space.mesh.points
    u = np.zeros_like(x)
    u[np.all(x == 1, axis=1)] = -1.6
    for run in (internal_force, tangent, cauchy_stress, stored_energy):
        with pytest.raises(InadmissibleError, match="cells 18") as told:
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


ELASTIC, NEO_HOOKEAN = Elastic(1.0, 0.3), LAWS["neo-hookean"]


@pytest.mark.parametrize(
    ("law", "call", "error", "words"),
    [
        (ELASTIC, lambda *of: internal_force(*of, np.zeros(8)), RequestError, "for small strains"),
        (NEO_HOOKEAN, lambda *of: internal_force(*of, np.zeros(8), threads=0), ValueError, "threads is 1 or more"),
        (NEO_HOOKEAN, lambda *of: tangent(*of, np.zeros(8), out=np.zeros((3, 2, 2))), ValueError, "out must be"),
        (NEO_HOOKEAN, lambda *of: internal_force(*of, np.zeros(7)), ValueError, "displacement must be"),
        *((law, call, RequestError, "for finite strains") for law in LAWS.values() for call in (
            assemble_stiffness,
            lambda *of: assemble.stress(*of, np.zeros(8)),
            lambda *of: assemble.internal_force(*of, np.zeros(8)),
        )),
        (ELASTIC, lambda space, of: kinematics_of("large", space, of), ValueError, "small or finite"),
    ],
)  # fmt: skip
def test_what_is_refused(law, call, error, words):
    space = Space.of(one_cell("QUAD4"), "plane_strain")
    with pytest.raises(error, match=words):
        call(space, Materials.of(space, law))


# ---- small and finite kinematics behind one signature


def sprung(model, law):
    """The space of a mixture, a law, and springs at four nodes."""
    space, materials = made(unturned("2", model), model, law)
    return (
        space,
        materials,
        to_ground(space, np.arange(3, 7), np.full(space.dim, 30.0), np.tile(np.eye(space.dim), (4, 1, 1))),
    )


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", ["small", "finite"])
def test_tangent_force_and_energy_belong_together(name, model):
    space, materials, springs = sprung(model, NEO_HOOKEAN)
    materials = linearised(materials) if name == "small" else materials
    body = kinematics_of(name, space, materials, springs=springs, temperature=WARM, threads=2)
    assert (body.linear, body.finite) == ((True, False) if name == "small" else (False, True))
    u, v = shaken(space, 0.02), np.random.default_rng(1).normal(size=space.n_dof)
    f, K = body.internal_force(u, 1.0), body.tangent(u, 1.0)
    assert isinstance(K, bsr_array if name == "small" else csr_array)

    def along(of):
        h = 1e-4
        return (8 * (of(u + h * v) - of(u - h * v)) - (of(u + 2 * h * v) - of(u - 2 * h * v))) / (12 * h)

    slope = along(lambda w: body.internal_force(w, 1.0))
    np.testing.assert_allclose(K @ v, slope, rtol=0, atol=1e-8 * np.abs(slope).max())
    if name == "small":
        f = f - thermal_force(space, materials, WARM, 1.0)
    assert f @ v == pytest.approx(along(lambda w: body.energy(w, 1.0)), rel=1e-7)


def test_a_tangent_is_not_written_over_by_the_next_and_stretches_follow_the_time():
    space, materials, springs = sprung("plane_strain", NEO_HOOKEAN)
    body = kinematics_of("finite", space, materials, springs=springs, temperature=WARM)
    u = shaken(space, 0.02)
    K = body.tangent(u, 1.0)
    kept = K.copy()
    assert abs(body.tangent(0.5 * u, 2.0) - K).max() > 1e-3 * abs(K).max()
    assert abs(K - kept).max() == 0
    for t in (2.0, 1.0):
        warmer = warming(space, materials, WARM, t)
        assert np.array_equal(
            internal_force(space, materials, u, warmer=warmer) + springs @ u, body.internal_force(u, t)
        )
        for one, other in zip(cauchy_stress(space, materials, u, warmer=warmer), body.stress(u, t), strict=True):
            assert np.array_equal(one, other)
    inward = -2 * space.mesh.points[:, :2].ravel() * np.tile([1.0, 0.0], space.mesh.n_nodes)
    for ask in (body.internal_force, body.tangent, body.stress, body.energy):
        with pytest.raises(InadmissibleError):
            ask(inward, 0.0)
