"""Every backend raises an error for a system without a unique solution, and names the free motion."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from lacmesh import Mesh, raise_order
from lacsolver.linear import LinearError, SingularError, analyse
from lacsolver.linear.regular import is_free, least_motion
from tests.lacsolver.stiffnesses import BODIES, above, beam, beside, free, held, rigid_modes, stiffness
from tests.lacsolver.systems import factorise
from tests.lacsolver.test_linear import DIRECT, INSTALLED, block_of, solver
from tests.samples import each_option


def rounding(K, mode):
    """Energy of a motion, against that of its largest entry alone at the stiffest diagonal."""
    return abs(mode @ (K @ mode)) / (K.diagonal().max() * (mode @ mode))


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("backend", INSTALLED)
def test_a_body_that_floats(backend, name):
    space, K = free(name)
    with pytest.raises(SingularError, match="singular") as caught:
        solver(K, rigid_modes(space), backend).factor(K)
    error = caught.value
    assert error.status == 1 and np.abs(error.mode).max() == error.mode[error.dof] == 1
    assert rounding(K, error.mode) < 1e-14


@pytest.mark.parametrize("backend", INSTALLED)
def test_the_free_one_of_two_bodies_is_told(backend):
    one, modes = held("hexahedra")
    space, two = free("tetrahedra")
    K = beside(one, two.tocsr())
    modes = np.vstack([modes, rigid_modes(space)])
    with pytest.raises(SingularError) as caught:
        solver(K, modes, backend).factor(K)
    n = one.shape[0]
    assert caught.value.dof >= n
    assert np.abs(caught.value.mode[:n]).max() < 1e-6
    K = beside(one, one)
    x = solver(K, np.tile(held("hexahedra")[1], (2, 1)), backend).factor(K).solve(np.ones(2 * n))
    assert np.abs(x[:n] - x[n:]).max() <= 1e-9 * np.abs(x).max()


@pytest.mark.parametrize("backend", INSTALLED)
def test_a_body_that_can_only_turn(backend):
    """One node is held: three rotations about it remain."""
    space, K = free("hexahedra")
    modes = rigid_modes(space)
    K = csr_array(K.tocsr()[3:][:, 3:])
    about = modes - modes[:, :3] @ modes[:3]
    with pytest.raises(SingularError) as caught:
        solver(K, about[3:], backend).factor(K)
    rest = caught.value.mode - about[3:] @ np.linalg.lstsq(about[3:], caught.value.mode, rcond=None)[0]
    assert np.abs(rest).max() < 1e-6


@pytest.mark.parametrize("backend", DIRECT)
def test_a_hinge(backend):
    """Two squares that share a corner: one is held, the other turns about the corner."""
    one = stiffness_of_squares()
    with pytest.raises(SingularError) as caught:
        factorise(one, backend=backend)
    assert caught.value.dof >= 4


def test_multigrid_never_gives_a_hinge_a_quiet_answer():
    """A hinge is no rigid motion of what is connected, and not seen before; its loads are, unless they balance."""
    K = stiffness_of_squares()
    with pytest.raises(LinearError):
        analyse(K, backend="multigrid", block=2).factor(K).solve(np.arange(K.shape[0], dtype=float))


def stiffness_of_squares():
    x = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]]
    space, K = stiffness(Mesh.create(x, [("QUAD4", [[0, 1, 2, 3], [2, 4, 5, 6]])]), "plane_strain")
    kept = np.arange(4, space.n_dof)
    return csr_array(K.tocsr()[kept][:, kept])


@pytest.mark.parametrize("backend", INSTALLED)
def test_a_node_without_stiffness(backend):
    K, _ = held("plane")
    K = beside(K, csr_array((2, 2)))
    K = csr_array(K + 0 * eye_array(K.shape[0]))
    with pytest.raises(SingularError) as caught:
        analyse(K, backend=backend).factor(K)
    assert caught.value.dof == K.shape[0] - 2


@pytest.mark.parametrize("backend", DIRECT)
def test_a_negative_stiffness(backend):
    """One negative eigenvalue that no diagonal entry shows; a body of negative modulus beside a good one."""
    K, _ = held("hexahedra")
    low, ways = np.linalg.eigh(K.toarray())
    across = ways[:, 100]
    K = csr_array(K.toarray() - 1.5 * low[100] * np.outer(across, across))
    assert (K.diagonal() > 0).all()
    with pytest.raises(SingularError, match="not positive definite") as caught:
        factorise(K, backend=backend)
    assert caught.value.mode is None
    K, _ = held("hexahedra")
    K = beside(K, -K)
    with pytest.raises(SingularError, match="not positive definite") as caught:
        factorise(K, backend=backend)
    assert caught.value.dof >= K.shape[0] // 2


@pytest.mark.parametrize(("backend", "length"), each_option(itertools.product(DIRECT, (1000, 30, 300))))
def test_a_slender_beam_is_regular_where_it_is_held_and_singular_where_not(backend, length):
    space, K = stiffness(raise_order(beam(length), "2"), "3d")
    with pytest.raises(SingularError) as caught:
        factorise(K, backend=backend)
    modes = rigid_modes(space)
    rest = caught.value.mode - modes @ np.linalg.lstsq(modes, caught.value.mode, rcond=None)[0]
    assert np.abs(rest).max() < 0.05
    kept = np.repeat(space.mesh.points[:, 0] > 1e-9, 3)
    K = csr_array(K.tocsr()[kept][:, kept])
    b = np.zeros(len(kept))
    end = np.flatnonzero(space.mesh.points[:, 0] > length - 1e-9)
    b[3 * end + 1] = 1 / len(end)
    deflection = b[kept] @ factorise(K, backend=backend).solve(b[kept])
    assert abs(deflection / (length**3 / 50) - 1) < 0.01  # L^3 / 3 E I, E = 200, a section 1 x 1


@pytest.mark.parametrize("backend", DIRECT)
@pytest.mark.parametrize("size", [1e-7, 1.0, 1e7])
def test_a_weak_spring_holds_a_body_whatever_the_units(backend, size):
    """Springs of 1e-6 of the stiffness at three corners: the body moves by load over spring."""
    space, K = free("hexahedra")
    K = K.tocsr() * size
    x = space.mesh.points
    corners = [int(np.abs(x - p).sum(axis=1).argmin()) for p in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1))]
    k = np.zeros(space.n_dof)
    k[space.dofs(np.array(corners)).ravel()] = 1e-6 * K.diagonal().max()
    K = csr_array(K + csr_array((k, (np.arange(len(k)),) * 2), shape=K.shape))
    b = np.tile([0.0, 0.0, size], space.mesh.n_nodes)
    u = factorise(K, backend=backend).solve(b)
    assert abs(k @ u - b.sum()) < 1e-7 * b.sum()


def test_a_stiff_inclusion_is_no_singularity():
    """1e10 times as stiff, beside a soft one that is held: units and contrasts do not matter; free, it is seen."""
    soft, _ = held("hexahedra", young=1e-10)
    stiff, _ = held("tetrahedra", young=1.0)
    assert np.isfinite(factorise(beside(stiff, soft)).solve(np.ones(soft.shape[0] + stiff.shape[0]))).all()
    _, floating = stiffness(BODIES["hexahedra"][0](), "3d", young=1e-10)
    with pytest.raises(SingularError) as caught:
        factorise(beside(stiff, floating.tocsr()))
    assert caught.value.dof >= stiff.shape[0]


def test_the_least_motion_is_that_of_the_least_eigenvalue():
    K, _ = held("plane")
    d = K.diagonal()
    values, ways = np.linalg.eigh(K.toarray() / np.sqrt(np.outer(d, d)))
    v = least_motion(K, d, factorise(K, backend="superlu")._solve, clear=np.inf)
    assert abs(v @ (d * v) - 1) < 1e-12
    assert values[0] <= v @ (K @ v) < 1.01 * values[0]
    assert abs(ways[:, 0] @ (np.sqrt(d) * v)) > 0.99
    assert not is_free(K, v)


def test_above_leaves_a_layer_out():
    space, _ = free("hexahedra")
    assert np.count_nonzero(~above(space)) == 3 * 36
    assert block_of(rigid_modes(space)) == 3
