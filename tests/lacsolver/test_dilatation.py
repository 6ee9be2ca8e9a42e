"""Mean dilatation: twins, differences, no locking, and who takes it; warnings for those who cannot."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacsolver.bodies import finite
from lacsolver.bodies.finite import NeoHookean, SaintVenantKirchhoff
from lacsolver.bodies.locking import locking
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.case import Material
from lacsolver.problem.laws import law_of
from lacsolver.space.space import Space
from tests.lacsolver import plain as plain_finite
from tests.lacsolver.bodies import (
    agree,
    cauchy_stress,
    first_piola,
    force_and_tangent,
    internal_force,
    stored_energy,
)
from tests.lacsolver.bodies import body, distorted, mixture, one_cell, plane_mixture, rim
from tests.lacsolver.test_assemble import rigid, solved
from tests.lacsolver.test_finite import by_differences, shaken
from tests.quality_cells import rotation

RUBBER = NeoHookean(3.0, 0.49, mean_dilatation=True)
SOFT = NeoHookean(3.0, 0.2, expansion=2e-3, reference_temperature=20.0, mean_dilatation=True)
PAIRS = [(name, "3d") for name in ("HEXA8", "PENTA6", "PYRAM5")]
PAIRS += [("QUAD4", "plane_strain"), ("QUAD4", "axisymmetric")]


@pytest.mark.parametrize(("name", "model"), PAIRS)
@pytest.mark.parametrize("law", [RUBBER, SOFT], ids=["rubber", "soft"])
def test_forces_equal_their_twin_and_the_tangent_is_their_derivative(name, model, law):
    space = Space.of(one_cell(name, 0.1), model)
    materials = Materials.of(space, law)
    u = shaken(space, 0.05)
    f, K = force_and_tangent(space, materials, u)
    twin, energy = plain_finite.mean_force(space, materials, u)
    np.testing.assert_allclose(f, twin, rtol=0, atol=1e-12 * np.abs(twin).max())
    assert stored_energy(space, materials, u) == pytest.approx(energy, rel=1e-12)
    expected = by_differences(lambda v: internal_force(space, materials, v), u, 1e-4)
    np.testing.assert_allclose(K.toarray(), expected, rtol=0, atol=1e-9 * abs(K).max())
    assert agree(K, K.T)
    assert np.abs(f - internal_force(space, plain(space, law), u)).max() > 1e-3 * np.abs(f).max()
    by_stress = np.zeros_like(f)
    for P, (name, nodes, _) in zip(first_piola(space, materials, u), space.blocks, strict=True):
        D, W = plain_finite.variations(space, name, nodes)
        np.add.at(by_stress.reshape(-1, space.dim), nodes, np.einsum("cqsi,cqsiat,cq->cat", P, D, W))
    np.testing.assert_allclose(by_stress, f, rtol=0, atol=1e-12 * np.abs(f).max())


def plain(space, law):
    return Materials.of(space, NeoHookean(law.young, law.poisson))


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_warm(name, model):
    space = Space.of(one_cell(name, 0.1), model)
    materials = Materials.of(space, SOFT)
    theta = finite.thermal_stretches(space, materials, 120.0)
    u = shaken(space, 0.05)
    f, K = force_and_tangent(space, materials, u, stretches=theta)
    twin, energy = plain_finite.mean_force(space, materials, u, 1.2)
    np.testing.assert_allclose(f, twin, rtol=0, atol=1e-12 * np.abs(twin).max())
    assert stored_energy(space, materials, u, stretches=theta) == pytest.approx(energy, rel=1e-12)
    expected = by_differences(lambda v: internal_force(space, materials, v, stretches=theta), u, 1e-4)
    np.testing.assert_allclose(K.toarray(), expected, rtol=0, atol=1e-9 * abs(K).max())
    if model != "plane_strain":
        free = (0.2 * space.mesh.points[:, : space.dim]).ravel()
        assert np.abs(internal_force(space, materials, free, stretches=theta)).max() < 1e-13
        for sigma in cauchy_stress(space, materials, free, stretches=theta):
            assert np.abs(sigma).max() < 1e-13


@pytest.mark.parametrize("model", ["3d", "plane_strain", "axisymmetric"])
@pytest.mark.usefixtures("every_thread")
def test_a_mixture_is_the_same_for_any_threads_and_passes_the_patch_test(model):
    plane = model != "3d"
    mesh = distorted(plane_mixture("1") if plane else mixture("1"), 0.05)
    space = Space.of(mesh, model)
    materials = Materials.of(space, RUBBER)
    u = shaken(space, 0.02)
    f, K = force_and_tangent(space, materials, u)
    for threads in (2, 5):
        again, M = force_and_tangent(space, materials, u, threads=threads)
        assert agree(again, f) and agree(M, K)
    x = mesh.points[:, : space.dim]
    F = np.diag([1.1, 0.95, 1.05][: space.dim])
    exact = (x @ F.T - x).ravel()
    free = ~np.repeat(rim(plane_mixture("1") if plane else mixture("1")), space.dim)
    assert np.abs(internal_force(space, materials, exact)[free]).max() < 1e-12
    uniform = cauchy_stress(space, materials, exact)
    same = cauchy_stress(space, plain(space, RUBBER), exact)
    for a, b in zip(uniform, same, strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-11)
    u = exact + np.where(free, 1e-3 * np.random.default_rng(0).normal(size=len(exact)), 0)
    for _ in range(6):
        f, K = force_and_tangent(space, materials, u)
        u = u + solved(K.tocsc(), np.zeros_like(u), free, -f)
    assert np.abs(u - exact).max() < 1e-12


def test_a_turned_body_is_free_of_stress():
    space = Space.of(distorted(mixture("1"), 0.05), "3d")
    materials = Materials.of(space, RUBBER)
    x = space.mesh.points
    Q = rotation(np.random.default_rng(3))
    f, K = force_and_tangent(space, materials, (x @ Q.T - x).ravel())
    assert np.abs(f).max() < 1e-12 * abs(K).max()
    assert np.abs(K @ (np.kron(np.eye(len(x)), Q) @ rigid(space))).max() < 1e-11 * abs(K).max()


def test_small_strains_keep_their_digits():
    space = Space.of(body("HEXA8", 2), "3d")
    materials = Materials.of(space, RUBBER)
    u = np.random.default_rng(0).normal(size=space.n_dof)
    K = force_and_tangent(space, materials, np.zeros(space.n_dof))[1]
    for size in (1e-5, 1e-8):
        f = internal_force(space, materials, size * u)
        assert np.abs(f - size * (K @ u)).max() < (100 * size + 1e-13) * size * np.abs(K @ u).max()


def cook(name, n, law):
    """The rise of the corner of Cook's membrane (1974), nearly incompressible in plane strain, in small strains."""
    mesh = body(name, n)
    s, t = mesh.points[:, 0] - 1, mesh.points[:, 1]
    points = np.stack([48 * s, 44 * s + t * (44 - 28 * s)], axis=1)
    mesh = Mesh.create(points, [(b.type, b.nodes) for b in mesh.blocks])
    space = Space.of(mesh, "plane_strain")
    K = force_and_tangent(space, Materials.of(space, law), np.zeros(space.n_dof))[1]
    right = np.flatnonzero(np.abs(s - 1) < 1e-9)
    right = right[np.argsort(t[right])]
    f = np.zeros((len(s), 2))
    if name == "QUAD8":
        f[right, 1] = (
            np.bincount((2 * np.arange(n)[:, None] + np.arange(3)).ravel(), np.tile([1 / 6, 4 / 6, 1 / 6], n)) / n
        )
    else:
        f[right, 1] = np.r_[0.5, np.ones(n - 1), 0.5] / n
    u = solved(K.tocsc(), np.zeros(space.n_dof), np.repeat(np.abs(s) > 1e-9, 2), f.ravel())
    return u[2 * right[-1] + 1]


def test_linear_quadrangles_do_not_lock():
    stiff, free = NeoHookean(1.0, 0.4999), NeoHookean(1.0, 0.4999, mean_dilatation=True)
    exact = cook("QUAD8", 32, stiff)
    assert cook("QUAD4", 32, free) == pytest.approx(exact, rel=0.01)
    assert cook("QUAD4", 32, stiff) < 0.6 * exact


def test_bending_of_nearly_incompressible_hexahedra():
    """A cantilever: with mean dilatation poisson = 0.4999 answers as 0.3 does, but for the shear modulus."""
    mesh = body("HEXA8", 4)
    mesh = Mesh.create((mesh.points - mesh.points.min(axis=0)) * [4, 1, 1], mesh.blocks)
    space = Space.of(mesh, "3d")
    free, tip = np.repeat(mesh.points[:, 0] > 0, 3), mesh.points[:, 0] == 4
    f = np.zeros((mesh.n_nodes, 3))
    f[tip, 2] = 1.0

    def sag(law):
        K = force_and_tangent(space, Materials.of(space, law), np.zeros(space.n_dof))[1]
        return solved(K.tocsc(), np.zeros(space.n_dof), free, f.ravel()).reshape(-1, 3)[tip, 2].mean()

    usual = sag(NeoHookean(1.0, 0.3))
    assert sag(NeoHookean(1.0, 0.4999, mean_dilatation=True)) == pytest.approx(usual, rel=0.15)
    assert sag(NeoHookean(1.0, 0.4999)) < 0.5 * usual


def test_who_takes_it():
    """TRIA3, TETRA4, quadratic cells and plane stress are as they are."""
    for name, model in (
        ("TRIA3", "plane_strain"),
        ("TETRA4", "3d"),
        ("QUAD8", "plane_strain"),
        ("QUAD4", "plane_stress"),
    ):
        space = Space.of(one_cell(name), model)
        u = shaken(space, 0.05)
        f = internal_force(space, Materials.of(space, RUBBER), u)
        assert agree(f, internal_force(space, plain(space, RUBBER), u))
    at_rest = np.zeros(24)
    space = Space.of(one_cell("HEXA8", 0.1), "3d")
    K = force_and_tangent(space, Materials.of(space, RUBBER), at_rest)[1]
    linear = assemble_stiffness(space, Materials.of(space, Elastic(RUBBER.young, RUBBER.poisson)))
    assert abs(K - linear).max() > 0.1 * abs(K).max()


def test_what_is_warned_of():
    space = Space.of(mixture("1"), "3d")
    told = locking(space, Materials.of(space, NeoHookean(1.0, 0.49)))
    assert len(told) == 1
    assert told[0].startswith("poisson = 0.49 makes TETRA4, HEXA8, PENTA6, PYRAM5 far too stiff")
    assert " makes TETRA4, PENTA6, PYRAM5 far" in locking(space, Materials.of(space, RUBBER))[0]
    assert " HEXA8, " in locking(space, Materials.of(space, SaintVenantKirchhoff(1.0, 0.46)))[0]
    assert not locking(space, Materials.of(space, NeoHookean(1.0, 0.45)))
    quadratic = Space.of(mixture("2"), "3d")
    assert not locking(quadratic, Materials.of(quadratic, RUBBER))
    plane = Space.of(plane_mixture("1"), "plane_stress")
    assert not locking(plane, Materials.of(plane, Elastic(1.0, 0.49)))


def test_a_case_takes_it_where_the_law_is_nearly_incompressible():
    assert law_of(Material(law="neo_hookean", young=1.0, poisson=0.49)).mean_dilatation
    assert not law_of(Material(law="neo_hookean", young=1.0, poisson=0.4)).mean_dilatation
