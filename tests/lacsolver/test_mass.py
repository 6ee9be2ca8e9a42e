"""Mass matrices: whole masses, moments of inertia and polynomials exactly; a plain twin; lumped masses; the errors."""

from __future__ import annotations

import numpy as np
import pytest

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.errors import DataError
from lacmesh.reference.quadrature import rule
from lacmesh.reference.shapes import jacobian, shape
from lacsolver.bodies.mass import DEGREE, assemble_mass
from lacsolver.bodies.material import Elastic, Materials
from lacsolver.distributed.share import Share
from lacsolver.space.rules import SOLID_CELLS
from lacsolver.space.space import MODELS, Space
from tests.lacsolver.bodies import PAIRS, body, distorted, mixture, one_cell, plane_mixture, rim

RHO = 7.8
LAW = Elastic(young=200.0, poisson=0.3, density=RHO)


def made(mesh, model, law=LAW):
    """The space and the materials of a mesh; plane stress with a thickness."""
    space = Space.of(mesh, model, thickness=0.4 if model == "plane_stress" else None)
    return space, Materials.of(space, law)


def skewed(name, n=2, size=0.05):
    """The unit cube or square at x in [1, 2], its inner nodes moved at random: quadratic cells are curved inside."""
    mesh = body(name, n)
    moved = distorted(mesh, size * (0.5 if CELLS[name].order == 2 else 1.0), seed=3).points
    points = np.where(rim(mesh)[:, None], mesh.points, moved)
    return Mesh.create(points, [(b.type, b.nodes) for b in mesh.blocks], space_dim=mesh.space_dim)


def moment(space, i=0, j=0):
    """Integral of x^i y^j z^0 over `skewed`, with thickness or 2 pi r, in closed form."""
    if space.dim == 3:
        return 1 / ((i + 1) * (j + 1))  # x in [0, 1]
    i += space.model.axisymmetric
    depth = 2 * np.pi if space.model.axisymmetric else space.thickness
    return depth * (2 ** (i + 1) - 1) / (i + 1) / (j + 1)


def at_nodes(space, *components):
    """The vector (n_dof,) of a field given by its components at the nodes."""
    shape_of = (space.mesh.n_nodes,)
    return np.stack([np.broadcast_to(c, shape_of) for c in components], axis=1).ravel()


def test_every_cell_has_a_degree():
    assert set(DEGREE) == set(SOLID_CELLS)


@pytest.mark.parametrize("kind", ["consistent", "lumped"])
@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_whole_mass_along_each_axis(name, model, kind):
    space, materials = made(skewed(name), model)
    M = assemble_mass(space, materials, kind)
    axes = np.tile(np.eye(space.dim), (space.mesh.n_nodes, 1))
    whole = axes.T @ (M @ axes)
    assert np.abs(whole / (RHO * moment(space)) - np.eye(space.dim)).max() < 1e-13
    if kind == "lumped":
        assert M.nnz == space.n_dof and M.diagonal().min() > 0
    else:
        assert abs(M - M.T).max() <= 1e-15 * abs(M).max() and np.linalg.eigvalsh(M.toarray()).min() > 0


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_products_of_linear_fields_are_exact_on_distorted_cells(name, model):
    space, materials = made(skewed(name), model)
    M = assemble_mass(space, materials)
    x, y = space.mesh.points[:, 0], space.mesh.points[:, 1]
    rest = [0.0] * (space.dim - 1)
    fields = {(0, 0): 1.0, (1, 0): x, (0, 1): y}
    for (i, j), p in fields.items():
        for (k, m), q in fields.items():
            got = at_nodes(space, p, *rest) @ (M @ at_nodes(space, q, *rest))
            assert got == pytest.approx(RHO * moment(space, i + k, j + m), rel=1e-13)


@pytest.mark.parametrize(("name", "model"), [(name, model) for name, model in PAIRS if CELLS[name].order == 2])
def test_products_of_quadratic_fields_are_exact_on_straight_cells(name, model):
    space, materials = made(skewed(name, size=0.0), model)
    M = assemble_mass(space, materials)
    x, y = space.mesh.points[:, 0], space.mesh.points[:, 1]
    rest = [0.0] * (space.dim - 1)
    for p, i, q, k in ((x * x, (2, 0), x * y, (1, 1)), (y * y, (0, 2), x * x, (2, 0)), (x * y, (1, 1), y, (0, 1))):
        got = at_nodes(space, p, *rest) @ (M @ at_nodes(space, q, *rest))
        assert got == pytest.approx(RHO * moment(space, i[0] + k[0], i[1] + k[1]), rel=1e-13)


@pytest.mark.parametrize("name", [name for name, model in PAIRS if model == "3d"])
def test_energy_of_a_rotating_cube_is_that_of_its_inertia(name):
    space, materials = made(skewed(name), "3d")
    M = assemble_mass(space, materials)
    spin, centre = np.array([0.3, -1.1, 0.7]), np.array([0.2, 0.4, -0.5])
    v = np.cross(spin, space.mesh.points - centre).ravel()
    inertia = RHO / 6 * np.eye(3)  # of the unit cube about its own centre
    away = np.full(3, 0.5) - centre
    about = inertia + RHO * (away @ away * np.eye(3) - np.outer(away, away))
    assert v @ (M @ v) == pytest.approx(spin @ about @ spin, rel=1e-13)


@pytest.mark.parametrize("model", ["plane_strain", "plane_stress"])
@pytest.mark.parametrize("name", sorted({name for name, model in PAIRS if model != "3d"}))
def test_energy_of_a_rotating_square_is_that_of_its_inertia(name, model):
    space, materials = made(skewed(name), model)
    x = space.mesh.points - [1.5, 0.5, 0.0]
    v = at_nodes(space, -x[:, 1], x[:, 0])
    M = assemble_mass(space, materials)
    assert v @ (M @ v) == pytest.approx(RHO * space.thickness / 6, rel=1e-13)


def plain_mass(space, materials, more):
    """M (n_dof, n_dof) dense, by a rule of a degree higher by `more`, einsum and plain loops."""
    M = np.zeros((space.mesh.n_nodes, space.mesh.n_nodes))
    for number, (name, nodes, _) in enumerate(space.blocks):
        X, w = rule(CELLS[name].family, max(DEGREE[name]) + more)
        N, x = shape(name, X), space.mesh.points[nodes]
        det = np.abs(np.linalg.det(jacobian(name, x, X)[:, :, : space.dim]))
        W = materials.densities(number)[:, None] * det * w * space.depth(np.einsum("qn,cns->cqs", N, x))
        for rows, m in zip(nodes, np.einsum("cq,qa,qb->cab", W, N, N), strict=True):
            M[np.ix_(rows, rows)] += m
    return np.kron(M, np.eye(space.dim))


@pytest.mark.parametrize(("name", "model"), PAIRS)
def test_one_distorted_cell_equals_its_plain_twin_of_higher_degree(name, model):
    space, materials = made(one_cell(name, 0.12), model)
    M, twin = assemble_mass(space, materials).toarray(), plain_mass(space, materials, 4)
    assert np.abs(M - twin).max() < 2e-14 * np.abs(twin).max()


@pytest.mark.parametrize("model", MODELS)
def test_a_mixture_of_cells_and_densities(model):
    mesh = mixture("2") if model == "3d" else plane_mixture("2")
    cells, half = np.arange(mesh.n_cells), mesh.n_cells // 2
    groups = {"light": cells[:half], "heavy": cells[half:]}
    mesh = Mesh.create(
        mesh.points, [(b.type, b.nodes) for b in mesh.blocks], cell_groups=groups, space_dim=mesh.space_dim
    )
    laws = [(Elastic(1.0, 0.0, density=2.0), ("light",)), (Elastic(1.0, 0.0, density=5.0), ("heavy",))]
    space = Space.of(mesh, model)
    materials = Materials.of(space, laws)
    twin = plain_mass(space, materials, 2)
    assert np.abs(assemble_mass(space, materials).toarray() - twin).max() < 2e-14 * np.abs(twin).max()
    assert assemble_mass(space, materials, "lumped").sum() == pytest.approx(twin.sum(), rel=1e-13)


def test_lumped_mass_of_serendipity_cells_has_the_published_shares():
    """QUAD8 square: 3/76 at a corner, 16/76 at a mid-node (Zienkiewicz, Taylor and Zhu, The Finite Element Method)."""
    square = Mesh.create(np.array(CELLS["QUAD8"].reference, float), [("QUAD8", [np.arange(8)])])
    shares = assemble_mass(*made(square, "plane_strain"), kind="lumped").diagonal()[::2] / (4 * RHO)
    assert shares == pytest.approx(np.repeat([3 / 76, 16 / 76], 4), rel=1e-13)


@pytest.mark.parametrize("kind", ["consistent", "lumped"])
def test_the_rows_of_a_process_s_own_nodes_are_complete(kind):
    mesh = skewed("HEXA8", 3)

    class Half(Share):
        own = mesh.points[:, 0] < 0.4

    whole = assemble_mass(*made(mesh, "3d"), kind=kind)
    space = Space.of(mesh, "3d", share=Half())
    part = assemble_mass(space, Materials.of(space, LAW), kind)
    rows = space.dofs(np.flatnonzero(Half.own)).ravel()
    assert sum(len(b.nodes) for b in space.blocks) < mesh.n_cells
    # to rounding: a product of BLAS with fewer cells may round otherwise
    assert abs(part[rows] - whole[rows]).max() <= 1e-15 * abs(whole).max()


def test_nodes_of_no_cell_have_no_mass():
    mesh = body("TRIA3", 1)
    loose = Mesh.create(np.vstack([mesh.points, [[9.0, 9.0, 0.0]]]), [(b.type, b.nodes) for b in mesh.blocks])
    for kind in ("consistent", "lumped"):
        M = assemble_mass(*made(loose, "plane_strain"), kind=kind)
        assert M.shape == (10, 10) and abs(M[8:]).sum() == 0.0


def test_cells_without_density_are_named_by_their_groups():
    mesh = body("QUAD4", 2)
    groups = {"left": np.array([0, 1]), "right": np.array([2, 3]), "corner": np.array([2]), "mixed": np.array([1, 2])}
    mesh = Mesh.create(mesh.points, [(b.type, b.nodes) for b in mesh.blocks], cell_groups=groups)
    laws = [(LAW, ("left",)), (Elastic(1.0, 0.0), ("right",))]
    space = Space.of(mesh, "plane_strain")
    with pytest.raises(DataError, match=r"group 'right', 'corner': 2 cells have no density: 3, 4; .*\[\[material\]\]"):
        assemble_mass(space, Materials.of(space, laws))
    with pytest.raises(ValueError, match="consistent or lumped, not 'hrz'"):
        assemble_mass(space, Materials.of(space, LAW), "hrz")
