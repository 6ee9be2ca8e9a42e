"""Stiffness, strain, stress and internal force: twins, rigid motions, patch tests, a smooth solution's rate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacsolver.bodies import small as assemble
from lacsolver.bodies.assembly import matrix, owners
from lacsolver.bodies.material import Elastic, Materials, Orthotropic
from lacsolver.bodies.small import assemble_stiffness, internal_force, stiffness_values
from lacsolver.problem.loads import body_force
from lacsolver.space.space import Space
from tests.lacsolver import plain
from tests.lacsolver.assembled import agree
from tests.lacsolver.bodies import (
    PAIRS,
    PLANE_MODELS,
    PLANES,
    SOLIDS,
    body,
    cube,
    distorted,
    mixture,
    one_cell,
    plane_mixture,
    rim,
)
from tests.quality_cells import rotation
from tests.samples import each_option

LAW = Elastic(young=200.0, poisson=0.3)
WOOD = Orthotropic((11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06), axes=((2.0, 1.0), (0.0, 1.0)))
TURNED = Orthotropic((11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06), axes=((2.0, 1.0, 0.5), (0.0, 1.0, 1.0)))
MIXTURES = [(order, model) for order in ("1", "2", "2-full") for model in ("3d", *PLANE_MODELS)]


def made(mesh, model, law=LAW):
    thickness = 0.4 if model == "plane_stress" else None
    space = Space.of(mesh, model, thickness=thickness)
    return space, Materials.of(space, law)


def mixed(order, model, size=0.06):
    mesh = mixture(order) if model == "3d" else plane_mixture(order)
    return distorted(mesh, size * (0.5 if order != "1" else 1.0), seed=4)


def rigid(space):
    """(n_dof, modes): the rigid motions that a model has."""
    x = space.mesh.points
    if space.model.axisymmetric:
        return np.tile([[0.0], [1.0]], (len(x), 1))
    zero, one = np.zeros(len(x)), np.ones(len(x))
    if space.dim == 2:
        modes = [[one, zero], [zero, one], [-x[:, 1], x[:, 0]]]
    else:
        shifts = [[one if s == k else zero for s in range(3)] for k in range(3)]
        turns = [np.cross(np.eye(3)[k], x).T for k in range(3)]
        modes = [*shifts, *turns]
    return np.stack([np.stack(m, axis=1).ravel() for m in modes], axis=1)


def uniform(space, seed=0):
    """A displacement of uniform strain (n_dof,), and the strain."""
    rng = np.random.default_rng(seed)
    x = space.mesh.points[:, : space.dim]
    A = rng.uniform(-1, 1, (space.dim, space.dim)) * 1e-3
    shift = rng.uniform(-1, 1, space.dim) * 1e-3
    if space.model.axisymmetric:
        A[0, 1] = A[1, 0] = shift[0] = 0.0
    strain = [A[0, 0], A[1, 1], 0.0, A[0, 1] + A[1, 0]]
    if space.model.axisymmetric:
        strain[2] = A[0, 0]
    if space.dim == 3:
        strain = [*strain[:2], A[2, 2], strain[3], A[1, 2] + A[2, 1], A[0, 2] + A[2, 0]]
    return (x @ A.T + shift).ravel(), np.array(strain)


@pytest.mark.parametrize(("name", "model"), PAIRS)
@pytest.mark.parametrize("distortion", [0.0, 0.12])
def test_one_cell_has_no_mode_without_energy_but_the_rigid_ones(name, model, distortion):
    space, materials = made(one_cell(name, distortion), model)
    K = assemble_stiffness(space, materials).toarray()
    values, vectors = np.linalg.eigh(K)
    modes = rigid(space)
    still = values < 1e-10 * values[-1]
    assert still.sum() == modes.shape[1] == {"3d": 6, "axisymmetric": 1}.get(model, 3)
    assert values[~still].min() > 1e-6 * values[-1]
    left = modes - vectors[:, still] @ (vectors[:, still].T @ modes)
    assert np.abs(left).max() < 1e-7 * np.abs(modes).max()


@pytest.mark.parametrize(("name", "model"), PAIRS)
@pytest.mark.parametrize("law", ["isotropic", "orthotropic"])
def test_stiffness_equals_its_plain_twin(name, model, law):
    chosen = LAW if law == "isotropic" else TURNED if model == "3d" else WOOD
    space, materials = made(distorted(body(name, 2), 0.04), model, chosen)
    K, twin = assemble_stiffness(space, materials), plain.stiffness(space, materials)
    assert abs(K - twin).max() < 2e-14 * abs(twin).max()


@pytest.mark.parametrize(("order", "model"), MIXTURES)
def test_stiffness_of_two_materials_in_a_mixture(order, model):
    mesh = mixed(order, model)
    groups = {"a": np.arange(0, mesh.n_cells, 2), "b": np.arange(1, mesh.n_cells, 2)}
    mesh = Mesh.create(mesh.points, mesh.blocks, space_dim=mesh.space_dim, cell_groups=groups)
    space = Space.of(mesh, model)
    materials = Materials.of(space, [(LAW, ("a",)), (WOOD, ("b",))])
    K, twin = assemble_stiffness(space, materials), plain.stiffness(space, materials)
    assert abs(K - twin).max() < 2e-14 * abs(twin).max()


@pytest.mark.parametrize(("order", "model"), MIXTURES)
@pytest.mark.usefixtures("every_thread")
def test_stiffness_is_symmetric_and_the_same_for_any_threads(order, model):
    space, materials = made(mixed(order, model), model)
    K = assemble_stiffness(space, materials)
    assert agree(K, K.T)
    for threads in (2, 3, 7):
        assert agree(assemble_stiffness(space, materials, threads=threads), K)
    u = np.random.default_rng(0).normal(size=space.n_dof)
    f = internal_force(space, materials, u)
    assert agree(internal_force(space, materials, u, threads=3), f)
    for one, two in zip(*(assemble.stress(space, materials, u, threads=n) for n in (1, 3)), strict=True):
        assert agree(one, two)


def test_threads_share_the_nodes_evenly():
    space, _ = made(cube("HEXA8", 6), "3d")
    for threads in (1, 2, 3, 5, 8):
        count = np.bincount(owners(space, threads), minlength=threads)
        assert len(count) == threads
        assert count.max() - count.min() <= threads
    with pytest.raises(ValueError, match="threads is 1 or more"):
        stiffness_values(*made(cube("HEXA8", 1), "3d"), threads=0)
    with pytest.raises(ValueError, match="threads is 1 or more"):
        internal_force(*made(cube("HEXA8", 1), "3d"), np.zeros(24), threads=0)


def test_the_pattern_is_shared_and_refilled():
    space, soft = made(mixture(), "3d")
    hard = Materials.of(space, Elastic(400.0, 0.3))
    K = assemble_stiffness(space, soft)
    assert np.shares_memory(K.indices, space.pattern.indices)
    assert np.shares_memory(K.indptr, space.pattern.indptr)
    values = stiffness_values(space, soft)
    again = stiffness_values(space, hard, out=values)
    assert again is values
    assert agree(matrix(space, values), 2 * K)
    with pytest.raises(ValueError, match="out must be"):
        stiffness_values(space, soft, out=values[1:])


@pytest.mark.parametrize(("order", "model"), MIXTURES)
def test_rigid_motions_cost_nothing(order, model):
    space, materials = made(mixed(order, model), model)
    K, modes = assemble_stiffness(space, materials), rigid(space)
    assert np.abs(K @ modes).max() < 1e-12 * abs(K).max() * np.abs(modes).max()
    for mode in modes.T:
        assert max(np.abs(e).max() for e in assemble.strain(space, mode)) < 1e-12 * np.abs(mode).max()


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_patch(name, model):
    """Distorted, and curved where the cell can be: a uniform strain is exact everywhere."""
    size = 0.05 if CELLS[name].order == 1 else 0.03
    space, materials = made(distorted(body(name, 2), size, seed=2), model)
    fixed = rim(body(name, 2))
    check_patch(space, materials, fixed)


@pytest.mark.parametrize(("order", "model"), MIXTURES)
@pytest.mark.parametrize("law", ["isotropic", "orthotropic"])
def test_patch_of_mixtures(order, model, law):
    if law == "orthotropic" and model == "axisymmetric":
        law = "isotropic"  # a uniform strain is in equilibrium only where radial and hoop stress are equal
    chosen = LAW if law == "isotropic" else TURNED if model == "3d" else WOOD
    space, materials = made(mixed(order, model), model, chosen)
    fixed = rim(mixture(order) if model == "3d" else plane_mixture(order))
    check_patch(space, materials, fixed)


def check_patch(space, materials, fixed):
    """Given the displacement of uniform strain on the rim, the inside follows, and the stress is uniform."""
    u, strain = uniform(space)
    K = assemble_stiffness(space, materials).tocsc()
    free = ~np.repeat(fixed, space.dim)
    assert free.any()
    got = solved(K, u, free)
    assert np.abs(got - u).max() < 1e-12 * np.abs(u).max()
    exact = materials.tables[0][0] @ strain
    for sigma in assemble.stress(space, materials, got):
        assert np.abs(sigma - exact).max() < 1e-12 * np.abs(exact).max()
    f = internal_force(space, materials, u)
    assert np.abs(f[free]).max() < 1e-13 * np.abs(f).max()


def solved(K, u, free, f=None):
    """u where it is given (not free), and the rest in equilibrium with forces f."""
    f = np.zeros(len(u)) if f is None else f
    out = u.copy()
    out[free] = spsolve(K[free][:, free], (f - K[:, ~free] @ u[~free])[free])
    return out


@pytest.mark.parametrize(("order", "model"), MIXTURES)
def test_strain_equals_its_plain_twin_and_force_is_stiffness_times_displacement(order, model):
    space, materials = made(mixed(order, model), model)
    u = np.random.default_rng(1).normal(size=space.n_dof)
    for got, twin in zip(assemble.strain(space, u), plain.strain(space, u), strict=True):
        np.testing.assert_allclose(got, twin, rtol=0, atol=1e-13 * np.abs(twin).max())
    f, expected = internal_force(space, materials, u), assemble_stiffness(space, materials) @ u
    np.testing.assert_allclose(f, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("degree", [None, 6])
@pytest.mark.parametrize("model", ["3d", *PLANE_MODELS])
def test_fields_at_other_points(model, degree):
    """A quadratic displacement on straight quadratic cells is itself at any point."""
    space, materials = made(mixture("2-full") if model == "3d" else plane_mixture("2-full"), model)
    dim = space.dim

    def u(x):
        return np.stack([x[..., 0] * x[..., 1], x[..., 1] ** 2, x[..., 0] * x[..., 2]][:dim], axis=-1)

    def gradient(x):
        zero = np.zeros(x.shape[:-1])
        rows = [[x[..., 1], x[..., 0], zero], [zero, 2 * x[..., 1], zero], [x[..., 2], zero, x[..., 0]]]
        G = np.stack([np.stack(r, axis=-1) for r in rows], axis=-2)[..., :dim, : space.model.rows]
        if model == "axisymmetric":
            G[..., 0, 2] = x[..., 1]
        return G

    nodal = u(space.mesh.points).ravel()
    volume = 0.0
    for x, w, value, e, s in zip(
        assemble.points(space, degree),
        assemble.weights(space, degree),
        assemble.displacement(space, nodal, degree),
        assemble.strain(space, nodal, degree),
        assemble.stress(space, materials, nodal, degree=degree),
        strict=True,
    ):
        np.testing.assert_allclose(value, u(x), atol=1e-12)
        G = gradient(x)
        np.testing.assert_allclose(e[..., 3], G[..., 0, 1] + G[..., 1, 0], atol=1e-12)
        np.testing.assert_allclose(s, e @ materials.tables[0][0], atol=1e-9)
        volume += w.sum()
    exact = {"3d": 12.0, "plane_strain": 9.0, "plane_stress": 3.6, "axisymmetric": 2 * np.pi * 3 * (16 - 1) / 2}
    assert volume == pytest.approx(exact[model], rel=1e-13)


def test_a_displacement_of_the_wrong_size():
    space, materials = made(cube("HEXA8", 1), "3d")
    with pytest.raises(ValueError, match=r"a displacement must be \(24,\), not \(8, 3\)"):
        internal_force(space, materials, np.zeros((8, 3)))


@pytest.mark.parametrize("name", SOLIDS)
def test_a_turned_body_of_turned_wood_is_the_same_body(name):
    Q = rotation(np.random.default_rng(7))
    mesh = one_cell(name, 0.1)
    there = Mesh.create(mesh.points @ Q, mesh.blocks)  # x' = Q^T x
    frame = TURNED.directions
    law = Orthotropic(TURNED.young, TURNED.poisson, TURNED.shear, axes=tuple(map(tuple, (frame @ Q)[:2])))
    K, M = (assemble_stiffness(*made(m, "3d", a)).toarray() for m, a in ((mesh, TURNED), (there, law)))
    R = np.kron(np.eye(mesh.n_nodes), Q.T)
    np.testing.assert_allclose(M, R @ K @ R.T, rtol=0, atol=1e-13 * np.abs(K).max())


def test_plane_stress_is_proportional_to_its_thickness():
    mesh = plane_mixture()
    thin, thick = (Space.of(mesh, "plane_stress", thickness=h) for h in (1.0, 0.25))
    K, M = (assemble_stiffness(s, Materials.of(s, LAW)) for s in (thin, thick))
    assert abs(M - 0.25 * K).max() < 1e-14 * abs(K).max()


class Waves:
    """u_t = sin(k_t.x + phi_t): its Hessian is -k k^T u_t, so that the body force is A_sitj k_ti k_tj u_t."""

    def __init__(self, space, materials):
        self.dim = space.dim
        self.k = np.array([[1.0, 0.7, -0.4], [-0.5, 1.1, 0.8], [0.9, -0.6, 1.2]])[: self.dim, : self.dim]
        self.phase = np.array([0.3, 1.1, 2.0])[: self.dim]
        self.A = materials.tensors[0]

    def u(self, x):
        return np.sin(x[..., : self.dim] @ self.k.T + self.phase)

    def force(self, s):
        return lambda x, t: np.einsum("itj,ti,tj,nt->n", self.A[s], self.k, self.k, self.u(x))


class Rings:
    """Axisymmetric: u = (r sin y, r^2), whose stress has a divergence in closed form."""

    def __init__(self, space, materials):
        self.lam, self.mu = materials.laws[0].lame

    def u(self, x):
        return np.stack([x[..., 0] * np.sin(x[..., 1]), x[..., 0] ** 2], axis=-1)

    def force(self, s):
        lam, mu = self.lam, self.mu
        if s == 0:
            return lambda x, t: mu * x[:, 0] * np.sin(x[:, 1])
        return lambda x, t: -2 * mu * (np.cos(x[:, 1]) + 2) - 2 * lam * np.cos(x[:, 1])


def error(name, model, n):
    """The L2 norm of the error of a smooth solution given on the rim."""
    mesh = body(name, n)
    space, materials = made(mesh, model, LAW if model in ("axisymmetric", "3d") else WOOD)
    exact = (Rings if model == "axisymmetric" else Waves)(space, materials)
    f = body_force(space, [exact.force(s) for s in range(space.dim)])
    u = exact.u(mesh.points).ravel()
    free = ~np.repeat(rim(mesh), space.dim)
    u = solved(assemble_stiffness(space, materials).tocsc(), u, free, f)
    fields = zip(assemble.points(space, 8), assemble.weights(space, 8), assemble.displacement(space, u, 8), strict=True)
    return np.sqrt(sum((w * ((v - exact.u(x)) ** 2).sum(axis=-1)).sum() for x, w, v in fields))


#: meshes of each kind of cell between which the rate is measured
LEVELS = {(2, 1): (8, 16), (2, 2): (4, 8), (3, 1): (4, 8), (3, 2): (2, 4)}


@pytest.mark.parametrize(("name", "model"), each_option(PAIRS))
def test_a_smooth_solution_converges_at_its_order(name, model):
    cell = CELLS[name]
    coarse, fine = LEVELS[cell.dim, cell.order]
    rate = np.log2(error(name, model, coarse) / error(name, model, fine))
    assert rate > cell.order + 1 - 0.15


def test_the_cells_of_the_tests_are_all_there_are():
    assert sorted(SOLIDS + PLANES) == sorted(name for name, cell in CELLS.items() if cell.dim > 1)
