"""Stiffness as blocks of whole nodes: against what it stands for entry by entry, and the memory that it takes."""

from __future__ import annotations

import sys
import tracemalloc

import numpy as np
import pytest
from scipy.sparse import csr_array, diags_array

from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.saddle.node_blocks import add_to_diagonal, submatrix, with_held
from lacsolver.saddle.stiffness import FactorCache, Stiffness, embed
from tests import REPOSITORY
from tests.lacsolver.systems import BODIES, free
from tests.lacsolver.test_coupled import moment

sys.path.append(str(REPOSITORY / "benchmarks"))

from contact import pressed
from meshes import blocks


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


@pytest.mark.parametrize("part", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("name", BODIES)
def test_held_unknowns_have_rows_of_the_identity(name, part):
    _, K = free(name)
    kept = some_unknowns(K, part)
    small = csr_array(K.tocsr()[kept][:, kept])
    made = with_held(K, kept)
    assert made.blocksize == K.blocksize and made.nnz <= K.nnz
    assert np.array_equal(made.toarray(), embed(small, kept, K.shape[0]).toarray())
    assert np.array_equal(submatrix(made, kept).toarray(), small.toarray())
    other = kept[::3]
    assert np.array_equal(submatrix(made, other).toarray(), K.tocsr()[other][:, other].toarray())


def test_nothing_is_left_of_a_matrix_whose_unknowns_are_all_held():
    _, K = free("hexahedra")
    made = with_held(K, np.empty(0, np.int64))
    assert np.array_equal(made.toarray(), np.eye(K.shape[0]))


def test_values_are_added_to_the_diagonal():
    _, K = free("plane")
    values = np.random.default_rng(0).normal(size=K.shape[0])
    made = K.copy()
    add_to_diagonal(made, values)
    np.testing.assert_allclose(made.toarray(), (K + diags_array(values)).toarray(), atol=1e-13)


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


def test_memory_of_a_stiffness_and_its_hierarchy():
    """Beside K as blocks: its copy for the free unknowns, and a hierarchy in single precision."""
    model = moment(20, backend="multigrid").model
    blocks = model.K.data.nbytes
    _ = model.factors, model._whole
    tracemalloc.start()
    held = model.reference()
    kept, most = (size / blocks for size in tracemalloc.get_traced_memory())
    tracemalloc.stop()
    assert held.iterative and kept < 2.3 and most < 3.0, (kept, most)


@pytest.mark.parametrize("floating", [False, True])
def test_a_run_makes_no_entries_of_the_whole_stiffness(floating, monkeypatch):
    problem, asked = problem_of(floating), []

    def submatrix(stiffness, unknowns):
        asked.append(len(unknowns) / len(stiffness.R))
        return some(stiffness, unknowns)

    some = Stiffness._submatrix
    monkeypatch.setattr(Stiffness, "_submatrix", submatrix)
    *_, state = march(problem)
    assert state.zones[0].pressure.max() > 0 and asked and max(asked) < 0.6
