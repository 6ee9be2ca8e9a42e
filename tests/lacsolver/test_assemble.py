"""Linear bodies: stiffness, strain, stress, forces, and masses, massless nodes: twins, rigid motions, patch tests."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.generate import rectangle
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacsolver.bodies import small as assemble
from lacsolver.bodies.assembly import matrix, owners
from lacsolver.bodies.mass import DEGREE, assemble_mass
from lacsolver.bodies.material import Elastic, Materials, Orthotropic
from lacsolver.bodies.points import points, weights
from lacsolver.bodies.small import assemble_stiffness, internal_force, stiffness_values
from lacsolver.case import parse_case
from lacsolver.distributed.share import Share
from lacsolver.problem.problem import Problem
from lacsolver.space.cut_nodes import inside_children
from lacsolver.space.space import MODELS, Space
from tests.lacsolver import plain
from tests.lacsolver.bodies import (
    MIXTURES,
    PAIRS,
    PLANE_MODELS,
    agree,
    body,
    cube,
    displacement,
    distorted,
    in_two,
    made,
    mixed,
    mixture,
    one_cell,
    rigid,
    rim,
    solved,
    strain,
    uniform,
    unturned,
)
from tests.lacsolver.moving import PLANE, SMALL, SPACE, WALL
from verification.meshes.bars import bar, bar_on_wall
from verification.meshes.blocks import BLOCK_TYPES, joined

LAW = Elastic(young=200.0, poisson=0.3)
WOOD = Orthotropic((11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06), axes=((2.0, 1.0), (0.0, 1.0)))
TURNED = Orthotropic((11.0, 0.9, 0.5), (0.4, 0.35, 0.3), (0.8, 0.7, 0.06), axes=((2.0, 1.0, 0.5), (0.0, 1.0, 1.0)))
RHO = 7.8
HEAVY = Elastic(young=200.0, poisson=0.3, density=RHO)


@pytest.mark.parametrize(("name", "model"), PAIRS)
@pytest.mark.parametrize("distortion", [0.0, 0.12])
def test_one_cell_has_no_mode_without_energy_but_the_rigid_ones(name, model, distortion):
    space, materials = made(one_cell(name, distortion), model, LAW)
    K = assemble_stiffness(space, materials).toarray()
    values, vectors = np.linalg.eigh(K)
    modes = rigid(space)
    still = values < 1e-10 * values[-1]
    assert still.sum() == modes.shape[1] == {"3d": 6, "axisymmetric": 1}.get(model, 3)
    assert values[~still].min() > 1e-6 * values[-1]
    left = modes - vectors[:, still] @ (vectors[:, still].T @ modes)
    assert np.abs(left).max() < 1e-7 * np.abs(modes).max()


def law_for(kind, model):
    """An isotropic law, or wood whose axes are turned as the model allows."""
    return LAW if kind == "isotropic" else TURNED if model == "3d" else WOOD


@pytest.mark.parametrize(("name", "model"), PAIRS)
@pytest.mark.parametrize("law", ["isotropic", "orthotropic"])
def test_stiffness_equals_its_plain_twin(name, model, law):
    space, materials = made(distorted(body(name, 2), 0.04), model, law_for(law, model))
    K, twin = assemble_stiffness(space, materials), plain.stiffness(space, materials)
    assert abs(K - twin).max() < 2e-14 * abs(twin).max()


@pytest.mark.rows("1-plane_strain", "2-full-plane_stress")
@pytest.mark.parametrize(("order", "model"), MIXTURES)
@pytest.mark.usefixtures("every_thread")
def test_two_materials_in_a_mixture(order, model):
    """Twins of stiffness and strain, forces, rigid motions without energy, the same for any number of threads."""
    space = Space.of(in_two(mixed(order, model)), model)
    materials = Materials.of(space, [(LAW, ("a",)), (WOOD, ("b",))])
    K, twin = assemble_stiffness(space, materials), plain.stiffness(space, materials)
    assert abs(K - twin).max() < 2e-14 * abs(twin).max()
    assert agree(K, K.T)
    modes = rigid(space)
    assert np.abs(K @ modes).max() < 1e-12 * abs(K).max() * np.abs(modes).max()
    for mode in modes.T:
        assert max(np.abs(e).max() for e in strain(space, mode)) < 1e-12 * np.abs(mode).max()
    u = np.random.default_rng(1).normal(size=space.n_dof)
    for got, wanted in zip(strain(space, u), plain.strain(space, u), strict=True):
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-13 * np.abs(wanted).max())
    f = internal_force(space, materials, u)
    np.testing.assert_allclose(f, K @ u, rtol=0, atol=1e-13 * np.abs(f).max())
    assert agree(internal_force(space, materials, u, threads=3), f)
    for threads in (2, 3, 7):
        assert agree(assemble_stiffness(space, materials, threads=threads), K)
    for one, two in zip(*(assemble.stress(space, materials, u, threads=n) for n in (1, 3)), strict=True):
        assert agree(one, two)


def test_each_thread_has_as_many_rows():
    assert np.bincount(owners(Space.of(rectangle((5, 4)), "plane_strain"), 3)).tolist() == [10, 10, 10]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda *given: stiffness_values(*given, threads=0), "threads is 1 or more"),
        (lambda *given: stiffness_values(*given, out=np.zeros((3, 3))), "out must be"),
        (lambda *given: internal_force(*given, np.zeros(24), threads=0), "threads is 1 or more"),
        (lambda *given: internal_force(*given, np.zeros((8, 3))), "displacement must be"),
        (lambda *given: assemble_mass(*given, "hrz"), "consistent or lumped"),
    ],
)
def test_wrong_calls(wrong, words):
    with pytest.raises(ValueError, match=words):
        wrong(*made(cube("HEXA8", 1), "3d", LAW))


def test_the_pattern_is_shared_and_refilled():
    space, soft = made(mixture(), "3d", LAW)
    K, values = assemble_stiffness(space, soft), stiffness_values(space, soft)
    assert np.shares_memory(K.indices, space.pattern.indices) and np.shares_memory(K.indptr, space.pattern.indptr)
    assert stiffness_values(space, Materials.of(space, Elastic(400.0, 0.3)), out=values) is values
    assert agree(matrix(space, values), 2 * K)


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_patch(name, model):
    """Distorted, and curved where the cell can be: a uniform strain is exact everywhere."""
    mesh = distorted(body(name, 2), 0.05 if CELLS[name].order == 1 else 0.03, seed=2)
    check_patch(*made(mesh, model, LAW), rim(body(name, 2)))


@pytest.mark.parametrize(("order", "model"), MIXTURES)
def test_patch_of_mixtures(order, model):
    """Of wood, but about an axis, where a uniform strain is in equilibrium only if radial and hoop stress are equal."""
    law = law_for("isotropic" if model == "axisymmetric" else "orthotropic", model)
    check_patch(*made(mixed(order, model), model, law), rim(unturned(order, model)))


def check_patch(space, materials, fixed):
    """Given the displacement of uniform strain on the rim, the inside follows, and the stress is uniform."""
    u, strain = uniform(space)
    K = assemble_stiffness(space, materials).tocsc()
    free = ~np.repeat(fixed, space.dim)
    assert free.any()
    got = solved(K, u, free)
    assert np.abs(got - u).max() < 1e-12 * np.abs(u).max()
    exact = plain.constitutive(materials.laws[0], space.model) @ strain
    for sigma in assemble.stress(space, materials, got):
        assert np.abs(sigma - exact).max() < 1e-12 * np.abs(exact).max()
    f = internal_force(space, materials, u)
    assert np.abs(f[free]).max() < 1e-13 * np.abs(f).max()


@pytest.mark.parametrize("degree", [None, 6])
@pytest.mark.parametrize("model", ["3d", *PLANE_MODELS])
def test_fields_at_other_points(model, degree):
    """A quadratic displacement on straight quadratic cells is itself at any point."""
    space, materials = made(unturned("2-full", model), model, LAW)
    dim = space.dim

    def u(x):
        return np.stack([x[..., 0] * x[..., 1], x[..., 1] ** 2, x[..., 0] * x[..., 2]][:dim], axis=-1)

    nodal = u(space.mesh.points).ravel()
    volume = 0.0
    for x, w, value, e in zip(
        points(space, degree),
        weights(space, degree),
        displacement(space, nodal, degree),
        strain(space, nodal, degree),
        strict=True,
    ):
        np.testing.assert_allclose(value, u(x), atol=1e-12)
        np.testing.assert_allclose(e[..., 3], x[..., 0], atol=1e-12)  # the shear strain
        volume += w.sum()
    if degree is None:
        C = plain.constitutive(LAW, space.model)
        for s, e in zip(assemble.stress(space, materials, nodal), strain(space, nodal), strict=True):
            np.testing.assert_allclose(s, e @ C, atol=1e-9)
    exact = {"3d": 12.0, "plane_strain": 9.0, "plane_stress": 3.6, "axisymmetric": 2 * np.pi * 3 * (16 - 1) / 2}
    assert volume == pytest.approx(exact[model], rel=1e-13)


# ---- masses


def skewed(name, n=2, size=0.05):
    """The unit cube or square at x in [1, 2], its inner nodes moved at random: quadratic cells are curved inside."""
    mesh = body(name, n)
    moved = distorted(mesh, size * (0.5 if CELLS[name].order == 2 else 1.0), seed=3).points
    points = np.where(rim(mesh)[:, None], mesh.points, moved)
    return Mesh.create(points, mesh.blocks, space_dim=mesh.space_dim)


def moment(space, i=0, j=0):
    """Integral of x^i y^j z^0 over `skewed`, with thickness or 2 pi r, in closed form."""
    if space.dim == 3:
        return 1 / ((i + 1) * (j + 1))  # x in [0, 1]
    i += space.model.axisymmetric
    depth = 2 * np.pi if space.model.axisymmetric else space.thickness
    return depth * (2 ** (i + 1) - 1) / (i + 1) / (j + 1)


@pytest.mark.parametrize("kind", ["consistent", "lumped"])
@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_whole_mass_along_each_axis(name, model, kind):
    space, materials = made(skewed(name), model, HEAVY)
    M = assemble_mass(space, materials, kind)
    axes = np.tile(np.eye(space.dim), (space.mesh.n_nodes, 1))
    whole = axes.T @ (M @ axes)
    assert np.abs(whole / (RHO * moment(space)) - np.eye(space.dim)).max() < 1e-13
    if kind == "lumped":
        assert M.nnz == space.n_dof and M.diagonal().min() > 0
    else:
        assert abs(M - M.T).max() <= 1e-15 * abs(M).max() and np.linalg.eigvalsh(M.toarray()).min() > 0


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_products_of_fields_are_exact(name, model):
    """Linear ones on distorted cells, and so energies of rotating bodies; quadratic ones on straight cells."""
    for order, size in ((1, 0.05), (2, 0.0))[: CELLS[name].order]:
        space, materials = made(skewed(name, size=size), model, HEAVY)
        M = assemble_mass(space, materials)
        x, y = space.mesh.points[:, 0], space.mesh.points[:, 1]
        powers = [(i, j) for i in range(order + 1) for j in range(order + 1 - i)]
        for (i, j), (k, m) in itertools.product(powers, powers):
            v, w = np.zeros((2, space.mesh.n_nodes, space.dim))
            axis = (i + k) % space.dim
            v[:, axis], w[:, axis] = x**i * y**j, x**k * y**m
            assert v.ravel() @ (M @ w.ravel()) == pytest.approx(RHO * moment(space, i + k, j + m), rel=1e-13)


def plain_mass(space, materials, more):
    """M (n_dof, n_dof) dense, by a rule of a degree higher by `more`, einsum and plain loops."""
    M = np.zeros((space.mesh.n_nodes, space.mesh.n_nodes))
    for number, (name, nodes, cells) in enumerate(space.blocks):
        X, w = rule(CELLS[name].family, max(DEGREE[name]) + more)
        N, x = shape(name, X), space.mesh.points[nodes]
        det = np.abs(np.linalg.det(jacobian(name, x, X)[:, :, : space.dim]))
        W = materials.densities(number)[:, None] * det * w * space.depth(np.einsum("qn,cns->cqs", N, x), cells)
        for rows, m in zip(nodes, np.einsum("cq,qa,qb->cab", W, N, N), strict=True):
            M[np.ix_(rows, rows)] += m
    return np.kron(M, np.eye(space.dim))


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_mass_of_a_distorted_cell_equals_its_plain_twin_of_higher_degree(name, model):
    space, materials = made(one_cell(name, 0.12), model, HEAVY)
    M, twin = assemble_mass(space, materials).toarray(), plain_mass(space, materials, 4)
    assert np.abs(M - twin).max() < 2e-14 * np.abs(twin).max()


@pytest.mark.parametrize("model", MODELS)
def test_a_mixture_of_cells_and_densities(model):
    space = Space.of(in_two(unturned("2", model)), model)
    materials = Materials.of(space, [(replace(LAW, density=2.0), ("a",)), (replace(LAW, density=5.0), ("b",))])
    twin = plain_mass(space, materials, 2)
    assert np.abs(assemble_mass(space, materials).toarray() - twin).max() < 2e-14 * np.abs(twin).max()
    assert assemble_mass(space, materials, "lumped").sum() == pytest.approx(twin.sum(), rel=1e-13)


def test_lumped_mass_of_serendipity_cells_has_the_published_shares():
    """QUAD8 square: 3/76 at a corner, 16/76 at a mid-node (Zienkiewicz, Taylor and Zhu, The Finite Element Method)."""
    square = Mesh.create(np.array(CELLS["QUAD8"].reference, float), [("QUAD8", [np.arange(8)])])
    shares = assemble_mass(*made(square, "plane_strain", HEAVY), kind="lumped").diagonal()[::2] / (4 * RHO)
    assert shares == pytest.approx(np.repeat([3 / 76, 16 / 76], 4), rel=1e-13)


@pytest.mark.parametrize("kind", ["consistent", "lumped"])
def test_rows_of_a_process_and_of_nodes_of_no_cell(kind):
    """Rows of a process's own nodes are complete, to rounding: BLAS rounds fewer cells in another way."""
    mesh = skewed("HEXA8", 3)

    class Half(Share):
        own = mesh.points[:, 0] < 0.4

    whole = assemble_mass(*made(mesh, "3d", HEAVY), kind=kind)
    space = Space.of(mesh, "3d", share=Half())
    part = assemble_mass(space, Materials.of(space, HEAVY), kind)
    rows = space.dofs(np.flatnonzero(Half.own)).ravel()
    assert sum(len(b.nodes) for b in space.blocks) < mesh.n_cells
    assert abs(part[rows] - whole[rows]).max() <= 1e-15 * abs(whole).max()
    mesh = body("TRIA3", 1)
    loose = Mesh.create(np.vstack([mesh.points, [[9.0, 9.0, 0.0]]]), mesh.blocks)
    M = assemble_mass(*made(loose, "plane_strain", HEAVY), kind=kind)
    assert M.shape == (10, 10) and abs(M[8:]).sum() == 0.0


def test_cells_without_density_are_named_by_their_groups():
    groups = {"left": np.array([0, 1]), "right": np.array([2, 3]), "corner": np.array([2]), "mixed": np.array([1, 2])}
    space = Space.of(replace(body("QUAD4", 2), cell_groups=groups), "plane_strain")
    with pytest.raises(DataError, match="group 'right', 'corner'"):
        assemble_mass(space, Materials.of(space, [(HEAVY, ("left",)), (LAW, ("right",))]))


# ---- massless nodes


PLANE_TYPES = [kind for kind in BLOCK_TYPES if kind.startswith(("TRIA", "QUAD"))]


def inertia(kind, massless, n=4, how=""):
    dim = 2 if kind in PLANE_TYPES else 3
    text = (PLANE if dim == 2 else SPACE) + SMALL + WALL.replace("[[rigid]]", how + "[[rigid]]")
    return Problem.of(parse_case(text + f'[dynamics]\nmassless = "{massless}"\n'), bar_on_wall(kind, n, 0.01)).inertia


def rows(kind):
    """Options of the cut of a type of cell."""
    return ['hexa = "pyramid"\n', 'hexa = "hexa"\n'] if kind in ("HEXA8", "HEXA20") else [""]


CUTS = [(kind, how) for kind in BLOCK_TYPES for how in rows(kind)]


@pytest.mark.rows("TRIA3-", "HEXA8-hexa = hexa")
@pytest.mark.parametrize(("kind", "how"), CUTS, ids=lambda v: v.strip().replace('"', ""))
def test_mass_moves_and_stays_as_much(kind, how):
    """Total mass to round-off, none at massless nodes, positive definite at others. Nodes that the cut made are found.

    New nodes that are not on the slave skin are those inside the children of one parent.
    """
    made = inertia(kind, "skins", how=how)
    mesh, dim, nodes, attached = made.space.mesh, made.space.dim, made.massless.nodes, made.space.attached
    for s in range(dim):
        one = np.tile(np.eye(dim)[s], mesh.n_nodes)
        assert one @ made.M @ one == pytest.approx(one @ made.plain @ one, rel=1e-13)
    slave = mesh.points[:, dim - 1] < 0.01 + 1e-9
    assert nodes[slave & attached].all()
    M = made.M.toarray()
    assert not M[made.massless_dofs].any() and abs(M - M.T).max() <= 1e-15 * M.max()
    kept = made.space.dofs(np.flatnonzero(attached & ~nodes)).ravel()
    assert np.linalg.eigvalsh(M[np.ix_(kept, kept)])[0] > 1e-3 * np.diag(M)[kept].min()
    before = bar_on_wall(kind, 4, 0.01).points
    new = np.array([np.linalg.norm(before - x, axis=1).min() > 1e-9 for x in mesh.points])
    np.testing.assert_array_equal(inside_children(mesh, dim), new & ~slave)


def test_a_body_too_thin_keeps_the_mass_of_its_skins():
    """A plate one cell thick between two others, slave above and master below; then slave on both sides."""
    parts = [(bar("QUAD4", 4, 0.0, 4), {"y0": "low", "y1": "master", "": "foot", "x0": "x0"})]
    low = bar("QUAD4", 1, 1.01, 4)
    parts.append((low, {"y0": "slave", "y1": "above", "": "plate"}))
    parts.append((bar("QUAD4", 4, 2.02, 4), {"y0": "top_slave", "": "lid"}))
    text = PLANE + SMALL + '[[contact]]\nslave = "slave"\nmaster = "master"\n'
    text += '[[contact]]\nslave = "top_slave"\nmaster = "above"\n[dynamics]\n'
    made = Problem.of(parse_case(text), joined(parts)).inertia
    (said,) = made.massless.told
    assert said.startswith("'plate' is too thin")
    y = made.space.mesh.points[:, 1]
    assert made.massless.nodes[np.abs(y - 1.01) < 1e-9].all()
    assert not made.massless.nodes[np.abs(y - 2.01) < 1e-9].any()
