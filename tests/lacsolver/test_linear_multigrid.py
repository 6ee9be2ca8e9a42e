"""Multigrid: tolerances, starts, few iterations, prescribed unknowns as rows of the identity, cycles with rows.

Stiffness as blocks of whole nodes: against what it stands for entry by entry."""

import numpy as np
import pytest
from scipy.sparse import block_diag, bsr_array, csr_array, diags_array, random_array

from benchmarks import large
from benchmarks.common import blocks, exponent
from benchmarks.contact import pressed
from lacmesh.communicator import SERIAL
from lacmesh.errors import RequestError
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.linear import SingularError, analyse
from lacsolver.linear.multigrid.cycle import Blocks, Team, jacobi
from lacsolver.linear.multigrid.row_term import RowTerm, bounded
from lacsolver.saddle.node_blocks import add_to_diagonal, submatrix, with_held
from lacsolver.saddle.stiffness import FactorCache, embed
from tests.lacsolver.bodies import cube
from tests.lacsolver.systems import BODIES, above, factorise, free, held, rigid_modes, stiffness
from tests.lacsolver.test_coupled import moment


def multigrid(K, modes, block=3):
    return analyse(K, backend="multigrid", modes=modes, block=block).factor(K)


def fitting(space, K):
    """K of a body whose lowest nodes are held, and its modes there."""
    kept = above(space)
    return csr_array(K.tocsr()[kept][:, kept]), rigid_modes(space)[kept]


@pytest.fixture(scope="module")
def brick():
    """A cube of 12^3 cells, held below: several levels."""
    K, modes = fitting(*stiffness(cube("HEXA8", 12), "3d"))
    return K, modes, multigrid(K, modes)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-8, 1e-12, 0.0])
def test_the_tolerance_is_met_and_not_overdone(brick, tolerance):
    """One of nothing cannot be met; the answer is as good as a direct one."""
    K, _, factor = brick
    b = np.random.default_rng(0).normal(size=K.shape[0])
    x = factor.solve(b, tolerance=tolerance)
    if tolerance == 0.0:
        direct = factorise(K).solve(b)
        assert np.abs(x - direct).max() < 1e-11 * np.abs(direct).max()
        return
    assert 1e-2 * tolerance < np.linalg.norm(b - K @ x) / np.linalg.norm(b) <= tolerance
    assert 1 <= factor.n_iterations <= 25


def test_a_good_start_saves_iterations(brick):
    K, _, factor = brick
    b = np.random.default_rng(0).normal(size=K.shape[0])
    x = factor.solve(b)
    from_nothing = factor.n_iterations
    near = factor.solve(b, x0=x * (1 + 1e-8))
    assert factor.n_iterations < 0.6 * from_nothing
    assert np.abs(near - x).max() < 1e-9 * np.abs(x).max()
    assert (factor.solve(b, x0=x) == x).all() and factor.n_iterations == 0
    assert not factor.solve(0 * b).any() and not factor.solve(0 * b, x0=x).any()
    with pytest.raises(RequestError, match="x0"):
        factor.solve(b, x0=np.zeros((len(b), 2)))


def test_few_iterations_whatever_the_size():
    counts = []
    for n in (6, 12, 18):
        K, modes = fitting(*stiffness(cube("HEXA8", n), "3d"))
        factor = multigrid(K, modes)
        factor.solve(np.ones(len(modes)), tolerance=1e-8)
        counts.append(factor.n_iterations)
    assert max(counts) <= 16, counts


def test_prescribed_components_stay_as_rows_of_the_identity():
    """Rollers on three faces hold single components; their rows and columns become the diagonal's."""
    space, K = free("hexahedra")
    x = space.mesh.points
    rolls = (np.abs(x) < 1e-9).ravel()
    d = np.where(rolls, 0.0, 1.0)
    K = csr_array(diags_array(d) @ K.tocsr() @ diags_array(d) + diags_array(np.where(rolls, K.diagonal(), 0.0)))
    b = np.where(rolls, 0.0, 1.0)
    u = multigrid(K, rigid_modes(space)).solve(b, tolerance=1e-13)
    exact = factorise(K).solve(b)
    assert np.abs(u - exact).max() < 1e-10 * np.abs(exact).max() and np.abs(u[rolls]).max() < 1e-13 * np.abs(u).max()
    kept = np.arange(K.shape[0]) != 0
    with pytest.raises(RequestError, match="rows of the identity"):
        multigrid(K[kept][:, kept], rigid_modes(space)[kept])


def test_blocks_of_zeros_are_kept_and_change_nothing():
    """A matrix is not written into, also where blocks of zeros are stored that join no bodies."""
    one, modes = held("hexahedra")
    K = csr_array(block_diag([one, one])).tobsr((3, 3))
    rows = np.repeat(np.arange(len(K.indptr) - 1), np.diff(K.indptr))
    row, at = np.r_[rows, 0, rows[-1]], np.r_[K.indices, rows[-1], 0]  # two more blocks, in opposite corners
    order = np.argsort(row, kind="stable")
    data = np.concatenate([K.data, np.zeros((2, 3, 3))])[order]
    stored = bsr_array((data, at[order], np.r_[0, np.cumsum(np.bincount(row))]), shape=K.shape)
    before = stored.toarray()
    b = np.random.default_rng(0).normal(size=K.shape[0])
    x = multigrid(stored, np.concatenate([modes, modes])).solve(b)
    assert np.array_equal(stored.toarray(), before)
    np.testing.assert_allclose(K @ x, b, atol=1e-11 * np.linalg.norm(b))


def test_a_matrix_without_blocks_has_one_unknown_at_each_node():
    """A rod of springs, held at both ends, under an even load."""
    n = 99
    K = csr_array(diags_array([np.full(n, 2.0), np.full(n - 1, -1.0), np.full(n - 1, -1.0)], offsets=[0, 1, -1]))
    k = np.arange(1, n + 1)
    x = factorise(K, backend="multigrid").solve(np.ones(n))
    np.testing.assert_allclose(x, k * (n + 1 - k) / 2, rtol=1e-9)


def test_many_bodies_of_two_nodes_each_take_no_dense_matrix():
    """Pairs of nodes have as many rigid motions together as unknowns: the level below is as large, with half the nodes.

    Springs join the nodes of a pair, and softer ones hold each node.
    """
    rng, n_pairs = np.random.default_rng(0), 100
    springs = rng.normal(size=(n_pairs, 3, 3))
    joint = springs @ springs.transpose(0, 2, 1) + np.eye(3)
    soft = [np.diag(held) for held in rng.uniform(1e-3, 1e-2, (n_pairs, 6))]
    K = csr_array(block_diag([np.kron([[1, -1], [-1, 1]], A) + held for A, held in zip(joint, soft, strict=True)]))
    x = rng.normal(size=(2 * n_pairs, 3))
    modes = np.stack([m.ravel() for a in np.eye(3) for m in (np.broadcast_to(a, x.shape), np.cross(a, x))], axis=1)
    factor, b = multigrid(K, modes), rng.normal(size=K.shape[0])
    np.testing.assert_allclose(K @ factor.solve(b), b, atol=1e-10)
    assert factor.n_iterations <= 10 and factor.coarse() is not None


@pytest.mark.parametrize("free", [0, 1, 3])
@pytest.mark.parametrize(("nodes", "block"), [(1, 3), (2, 2), (2, 3), (3, 2), (8, 3)])
def test_the_largest_eigenvalue_of_small_bodies_free_to_move(nodes, block, free):
    """Steps of Lanczos run out of directions with energy, and what round-off leaves is none."""
    n = nodes * block
    for seed in range(20):
        rng = np.random.default_rng(seed)
        still = np.linalg.qr(rng.normal(size=(n, min(free, n - 1))))[0]
        moved = np.eye(n) - still @ still.T
        half = moved @ rng.normal(size=(n, n))
        K = bsr_array(csr_array(half @ half.T).tobsr((block, block)))
        inverse, bound = jacobi(K, Team(1))
        largest = np.linalg.eigvals(block_diag(inverse).toarray() @ K.toarray()).real.max()
        assert 0.8 * largest <= bound <= 1.06 * largest


def test_without_modes_translations_serve():
    K, _ = held("hexahedra")
    b = np.ones(K.shape[0])
    x = factorise(K.tobsr((3, 3)), backend="multigrid").solve(b)
    assert np.linalg.norm(b - K @ x) <= 1e-12 * np.linalg.norm(b)
    _, K = free("hexahedra")
    with pytest.raises(SingularError):
        factorise(K, backend="multigrid")


def test_the_same_every_time_and_numpys_random_numbers_are_left_alone(brick):
    K, modes, factor = brick
    b = np.ones(K.shape[0])
    np.random.seed(5)  # noqa: NPY002
    drawn = np.random.random()  # noqa: NPY002
    np.random.seed(5)  # noqa: NPY002
    again = multigrid(K, modes)
    assert np.random.random() == drawn  # noqa: NPY002
    assert (again.solve(b) == factor.solve(b)).all()


@pytest.mark.parametrize("modes", [np.ones((4, 1)), np.full((375, 6), np.nan), np.ones(375)])
def test_wrong_modes(modes):
    K, _ = held("hexahedra")
    with pytest.raises(RequestError, match="modes are"):
        analyse(K, backend="multigrid", modes=modes, block=3)


# ---- the V-cycle


def rows_on(K, seed=0, count=40):
    """Rows (count, n) of three neighbouring blocks each, as B of contact has them, and weights like K's diagonal."""
    rng, n = np.random.default_rng(seed), K.shape[0] // 3
    first = rng.permutation(n - 3)[:count]
    columns = (3 * (first[:, None] + np.arange(3))[:, :, None] + np.arange(3)).reshape(count, -1)
    B = csr_array((rng.normal(size=columns.size), (np.repeat(np.arange(count), 9), columns.ravel())), (count, 3 * n))
    return B.tobsr((1, 3)), K.diagonal().mean() * 10.0 ** rng.uniform(-2, 2, count)


def error(K, cycle, x, steps=5):
    """Return the factor by which a step x - V K x reduces the energy norm, the mean of some steps."""
    start = x @ (K @ x)
    for _ in range(steps):
        x = x - cycle(K @ x)
    return (x @ (K @ x) / start) ** (0.5 / steps)


@pytest.mark.parametrize("rows", [False, True])
def test_a_cycle_is_symmetric_and_positive_and_near_the_inverse_in_any_units(brick, rows):
    K, modes, factor = brick
    B, weights = rows_on(K)
    cycle = factor.cycle_with_rows(B, weights) if rows else factor.hierarchy.cycle
    whole = csr_array(K + B.T @ diags_array(weights) @ B) if rows else K
    x, y = np.random.default_rng(1).normal(size=(2, K.shape[0]))
    assert x @ cycle(y) == pytest.approx(y @ cycle(x), rel=1e-5) and x @ cycle(x) > 0
    assert error(whole, cycle, x) < (0.4 if rows else 0.3)
    for unit in (1e-12, 1e9) if rows else (1e-25, 1e25):
        other = multigrid(csr_array(unit * K), modes)
        scaled = other.cycle_with_rows(1e3 * B, 1e-6 * unit * weights) if rows else other.hierarchy.cycle
        size = 1.0 if rows else 1e20  # a right-hand side that is large in single precision
        np.testing.assert_allclose(scaled(size * y) * unit / size, cycle(y), atol=2e-6 * np.abs(cycle(y)).max())
    if rows:
        assert error(whole, factor.cycle, x) > 1
        np.testing.assert_array_equal(factor.cycle(x), multigrid(K, modes).cycle(x))  # K's own is as it was
    else:
        assert not cycle(0 * y).any()


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_products_of_blocks_and_sums_over_long_rows(threads, monkeypatch):
    monkeypatch.setattr("lacsolver.linear.multigrid.cycle._WORTH", 5)
    monkeypatch.setattr("lacsolver.linear.multigrid.cycle._WORTH_PARTS", 1)
    rng, team = np.random.default_rng(0), Team(threads)
    for block in ((3, 3), (3, 6), (6, 3), (2, 2)):
        A = random_array((block[0] * 20, block[1] * 30), density=0.1, rng=rng, format="bsr").tobsr(block)
        x = rng.normal(size=A.shape[1])
        np.testing.assert_allclose(team.product(Blocks.of(A), x), A @ x, atol=1e-13)
    A, x, c = rng.normal(size=(3, 10_000)), rng.normal(size=10_000), rng.normal(size=3)
    np.testing.assert_allclose(team.dots(A, x), A @ x, atol=1e-10)
    left = x.copy()
    team.subtract(c, A, left)
    np.testing.assert_allclose(left, x - c @ A, atol=1e-13)


def test_the_smoother_with_rows_by_dense_algebra():
    """(M + N^T N)^-1 by Woodbury's formula, and a bound L of N^T N that turns with the axes."""
    rng, n_nodes, b = np.random.default_rng(0), 7, 3
    root = rng.normal(size=(n_nodes, b, b))
    M = root @ root.transpose(0, 2, 1) + np.eye(b)
    N = np.where(rng.uniform(size=(4, n_nodes)) < 0.5, 1.0, 0.0).repeat(b, axis=1) * rng.normal(size=(4, 21))
    N[0, ::b] = 0.0  # a row along an axis, whose zeros are not kept
    N = csr_array(N)
    N, dense = bsr_array(N.astype(np.float32).tobsr((1, b))), N.toarray()
    inverse = np.linalg.inv(M).astype(np.float32)
    r = rng.normal(size=n_nodes * b).astype(np.float32)
    x = block_diag(inverse) @ r
    RowTerm.smoothed(N, inverse, SERIAL).correct(1.0, r, SERIAL, x)
    exact = np.linalg.solve(block_diag(M).toarray() + dense.T @ dense, r)
    np.testing.assert_allclose(x, exact, atol=1e-5 * np.abs(exact).max())
    L = np.linalg.inv(bounded(inverse, N, SERIAL)) - M
    least = np.linalg.eigvalsh(block_diag(L).toarray() - dense.T @ dense)[0]
    assert -1e-4 < least < 1e-2  # a bound, and one that is reached
    soft = np.linalg.inv(bounded((100 * inverse).astype(np.float32), N, SERIAL)) - M / 100
    np.testing.assert_allclose(soft, L, atol=1e-3 * np.abs(L).max())  # which part a body has depends on no unit
    Q = np.linalg.qr(rng.normal(size=(b, b)))[0].astype(np.float32)
    other = bounded(Q @ inverse @ Q.T, bsr_array((N.data @ Q.T, N.indices, N.indptr), shape=N.shape), SERIAL)
    np.testing.assert_allclose(other, Q @ bounded(inverse, N, SERIAL) @ Q.T, atol=1e-5)


# ---- blocks of whole nodes


def problem_of(floating):
    """Two blocks, the upper one held, or on contact alone along z."""
    return moment(6, backend="multigrid").model.problem if floating else pressed(blocks(9, 6, 4), "multigrid")


def some_unknowns(K, part):
    """Unknowns left free: all of some nodes, none of others, and a part of the rest."""
    rng, b = np.random.default_rng(3), K.blocksize[0]
    nodes = rng.uniform(size=K.shape[0] // b)
    on = rng.uniform(size=(len(nodes), b)) < 0.5
    on[nodes < part] = True
    on[nodes > 1 - part / 2] = False
    return np.flatnonzero(on)


@pytest.mark.parametrize("part", [0.0, 0.3, 2.0, None])
@pytest.mark.parametrize("name", BODIES)
def test_held_unknowns_have_rows_of_the_identity(name, part):
    """Also where all are held (None)."""
    _, K = free(name)
    kept = np.empty(0, np.int64) if part is None else some_unknowns(K, part)
    small = csr_array(K.tocsr()[kept][:, kept])
    made = with_held(K, kept)
    assert made.blocksize == K.blocksize and made.nnz <= K.nnz
    assert np.array_equal(made.toarray(), embed(small, kept, K.shape[0]).toarray())
    assert np.array_equal(submatrix(made, kept).toarray(), small.toarray())
    other = kept[::3]
    assert np.array_equal(submatrix(made, other).toarray(), K.tocsr()[other][:, other].toarray())
    values, more = np.random.default_rng(0).normal(size=K.shape[0]), K.copy()
    add_to_diagonal(more, values)
    np.testing.assert_allclose(more.toarray(), (K + diags_array(values)).toarray(), atol=1e-13)


@pytest.mark.parametrize("floating", [False, True])
def test_blocks_and_entries_are_one_stiffness(floating):
    """Blocks alone, from which entries are made once they are asked for, against entries that are embedded."""
    model = ReducedProblem(problem_of(floating))
    made = model.reference()
    given = FactorCache(made.R, "multigrid", 1, model._whole).factorise(model.K_q)
    assert made.R.shape[1] == (1 if floating else 0)
    size, q = abs(model.K_q).max(), np.random.default_rng(2).normal(size=len(made.R))
    at = np.arange(0, len(q), 7)
    np.testing.assert_allclose(made.apply(q), model.K_q @ q, atol=1e-13 * size * np.abs(q).max())
    np.testing.assert_allclose(made.scaling, given.scaling, rtol=1e-14)
    np.testing.assert_allclose(made.restricted(at).toarray(), given.restricted(at).toarray(), atol=1e-14 * size)
    assert "K" not in vars(made) and not isinstance(made.matrix, csr_array)
    assert abs(made.K - model.K_q).max() <= 1e-14 * size
    f = model.K_q @ q
    np.testing.assert_allclose(made.apply(made.solve(f)), f, atol=1e-11 * np.linalg.norm(f))


@pytest.mark.slow
def test_the_benchmark_of_large_models_at_a_small_size():
    """It runs, its figures are what their names say."""
    (found,) = large.measured("", 2500, large.SERIAL, 1.0, "reference", True)
    assert 2250 < found["unknowns"] < 4500
    assert 0 < found["closed"] < found["macros"]
    assert found["cycles"] <= 4 * found["alone"] and found["balance"] <= 1e-12
    phases = found["wall"]
    parts = phases["pairing"] + phases["set-up"] + phases["loops"]
    assert 0.3 * phases["contact"] < parts <= phases["contact"]
    assert 0.05 < found["memory"] / 2**30 < 2.0 and f", {found['cycles']} V-cycles" in large.model_row(found)[5]
    assert exponent([10.0, 100.0], [3 * k**1.5 for k in (10.0, 100.0)]) == pytest.approx(1.5)
