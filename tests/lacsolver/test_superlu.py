"""SciPy's SuperLU in the place of rslab, where that cannot be loaded or fails: it is said once, and the run goes on."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import rslab
from scipy.sparse import csr_array

import lacsolver as ls
from lacmesh.errors import LacmeshWarning, RequestError
from lacsolver.linear import LinearError, SingularError, analyse
from lacsolver.linear.direct.reserve import warn_once
from tests.lacsolver import (
    test_contact,
    test_contact_finite,
    test_friction,
    test_modes,
    test_motion,
    test_plastic,
    test_pretension,
)
from tests.lacsolver.stiffnesses import free, held
from tests.lacsolver.systems import factorise

MODULE = sys.modules["lacsolver.linear.backends"]
SMALL = csr_array(np.diag([2.0, 3.0, 4.0]) + np.diag([-1.0, -1.0], 1) + np.diag([-1.0, -1.0], -1))
INDEFINITE = csr_array(np.array([[0.5, 2.0, 0.0], [2.0, 0.5, 1.0], [0.0, 1.0, -3.0]]))
#: tests with exact solutions, of every way in which the solver uses a factor
CHECKS = (
    test_contact.test_unloading_goes_back_the_way_it_came,
    test_contact_finite.test_a_plate_in_space_that_is_loaded_finds_its_place,
    test_contact_finite.test_a_block_settles_in_a_groove,
    test_friction.test_a_pad_sticks_below_the_bound,
    test_modes.test_frequencies_of_a_free_bar,
    test_motion.test_a_preload_stays_at_rest,
    test_plastic.test_newtons_method_is_quadratic_at_the_end,
    test_pretension.test_a_bolt_in_axisymmetry,
)


@pytest.fixture(autouse=True)
def as_if_never_said():
    """Let every test hear what a process says only once."""
    warn_once.cache_clear()
    yield
    warn_once.cache_clear()


@pytest.fixture
def rslab_alone(monkeypatch):
    """No direct solver but rslab and SciPy's is installed."""
    others = {name: one for name, one in MODULE.BACKENDS.items() if name in ("rslab", "superlu", "multigrid")}
    monkeypatch.setattr(MODULE, "BACKENDS", others)


@pytest.fixture
def without_rslab(monkeypatch, rslab_alone):
    """rslab cannot be loaded, as where its wheel does not fit."""
    monkeypatch.setitem(sys.modules, "rslab", None)
    MODULE.why_no_rslab.cache_clear()
    yield
    monkeypatch.undo()
    MODULE.why_no_rslab.cache_clear()


class Numeric:
    """A factor of rslab that is spoilt: `inertia`, and a function of its solutions."""

    def __init__(self, factor, inertia=None, spoil=lambda x: x):
        self.n, self._factor, self._spoil = factor.n, factor, spoil
        self.inertia = inertia or factor.inertia

    def solve(self, b):
        return self._spoil(self._factor.solve(b))

    def solve_many(self, b):
        return self._spoil(self._factor.solve_many(b))


class PanicException(BaseException):
    """A panic of Rust, which is no Exception."""


def panic(*arguments):
    raise PanicException("index out of bounds")


def _raising(error):
    def fail(*arguments):
        raise error

    return fail


#: name -> a function of rslab's analysis and values, in place of its factorisation
FAILURES = {
    "an error": _raising(RuntimeError("a front of 3 rows has no parent")),
    "a panic": panic,
    "called singular": _raising(RuntimeError("matrix is numerically rank-deficient")),
    "negative pivots": lambda factor, values: Numeric(factor(values), (2, 1, 0), np.zeros_like),
    "noise": lambda factor, values: Numeric(factor(values), spoil=lambda x: x[::-1] * 7),
    "no numbers": lambda factor, values: Numeric(factor(values), spoil=lambda x: x * np.nan),
    "an error while solving": lambda factor, values: Numeric(factor(values), spoil=_raising(ValueError("no factor"))),
}


@pytest.fixture
def failing(monkeypatch, rslab_alone):
    """A function that makes rslab fail in one of these ways."""
    whole = rslab.analyze

    def spoil(name):
        class Spoilt:
            def __init__(self, analysis):
                self._analysis = analysis

            def factor(self, values):
                return FAILURES[name](self._analysis.factor, values)

        analyze = panic if name == "analysis" else lambda *a, **options: Spoilt(whole(*a, **options))
        monkeypatch.setattr(rslab, "analyze", analyze)

    return spoil


@pytest.mark.parametrize("name", [*FAILURES, "analysis"])
def test_superlu_takes_the_place_of_rslab_that_fails_and_it_is_said_once(failing, name):
    failing(name)
    b = np.arange(3.0)
    with pytest.warns(LacmeshWarning, match=r"rslab.*failed \(.+\): SciPy's SuperLU serves") as told:
        analysis = analyse(SMALL)
        for scale in (1.0, 2.0):
            factor = analysis.factor(scale * SMALL)
            for _again in range(2):
                x = factor.solve(b)
                np.testing.assert_allclose(x, np.linalg.solve(scale * SMALL.toarray(), b), rtol=1e-13)
    assert len(told) == 1 and analysis.backend == "superlu" and analysis.note == str(told[0].message)
    assert factor.n_solves == 2


@pytest.mark.parametrize("name", ["an error", "a panic", "noise", "an error while solving", "analysis"])
def test_an_indefinite_matrix_is_solved_by_superlu_where_rslab_fails(failing, name):
    failing(name)
    b = np.array([1.0, 2.0, 3.0])
    with pytest.warns(LacmeshWarning, match="SuperLU serves"):
        x = analyse(INDEFINITE, definite=False).factor(INDEFINITE).solve(b)
    np.testing.assert_allclose(x, np.linalg.solve(INDEFINITE.toarray(), b), rtol=1e-13)


@pytest.mark.filterwarnings("error")
def test_what_is_wrong_with_the_matrix_stays_its_error(failing):
    """A body that floats, a negative stiffness and a matrix that is not symmetric: nothing is said of a solver."""
    with pytest.raises(SingularError, match="singular: something can move"):
        factorise(free("hexahedra")[1].tocsr(), backend="rslab")
    K, _ = held("hexahedra")
    low, ways = np.linalg.eigh(K.toarray())
    negative = csr_array(K.toarray() - 1.5 * low[100] * np.outer(ways[:, 100], ways[:, 100]))
    with pytest.raises(SingularError, match="not positive definite"):
        factorise(negative, backend="rslab")
    K.data *= 1 + 1e-3 * np.random.default_rng(0).normal(size=K.nnz) * (K.tocoo().row < K.tocoo().col)
    with pytest.raises(LinearError, match="residual stays"):
        factorise(K, backend="rslab").solve(np.ones(K.shape[0]))


@pytest.mark.parametrize("name", ["an error", "called singular", "negative pivots"])
@pytest.mark.filterwarnings("error")
def test_a_singular_matrix_is_called_so_by_superlu_too(failing, name):
    failing(name)
    with pytest.raises(SingularError, match="singular: something can move"):
        factorise(free("plane")[1].tocsr(), backend="rslab")


def test_a_sound_claim_of_negative_pivots_asks_no_second_solver(monkeypatch):
    """A structure that buckles does so in many steps: each would cost a factorisation by SuperLU."""
    monkeypatch.setattr("lacsolver.linear.direct.superlu.analyse", panic)
    K, _ = held("plane")
    low, ways = np.linalg.eigh(K.toarray())
    K = csr_array(K.toarray() - 1.5 * low[5] * np.outer(ways[:, 5], ways[:, 5]))
    with pytest.raises(SingularError, match="not positive definite"):
        factorise(K, backend="rslab")


def test_a_run_goes_on_and_its_results_say_so(failing, fresh):
    from lacsolver.running import run

    known = ls.solve("data/two_blocks.toml").contact["joint"].pressure
    failing("an error")
    with pytest.warns(LacmeshWarning, match="SuperLU serves") as told:
        results = run("data/two_blocks.toml", fresh / "results")
    assert results.status == "done" and len(told) == 1
    assert "rslab, which comes with lacmesh, failed (a front of 3 rows has no parent)" in results.message
    solution = ls.read_results(fresh / "results").solution(-1)
    np.testing.assert_allclose(solution.contact["joint"].pressure, known, rtol=1e-8, atol=1e-8)


def test_superlu_serves_where_rslab_cannot_be_loaded_and_it_is_said_once(without_rslab):
    b = np.arange(3.0)
    with pytest.warns(LacmeshWarning, match="SciPy's SuperLU serves.*pip install rslab") as told:
        factors = [factorise(SMALL), factorise(SMALL)]
    assert len(told) == 1
    for factor in factors:
        np.testing.assert_allclose(factor.solve(b), np.linalg.solve(SMALL.toarray(), b), rtol=1e-14)
    with pytest.raises(RequestError, match="the linear solver rslab is not installed"):
        factorise(SMALL, backend="rslab")


def test_an_indefinite_matrix_is_solved_by_superlu_too(without_rslab):
    b = np.array([1.0, 2.0, 3.0])
    with pytest.warns(LacmeshWarning, match="SuperLU serves"):
        analysis = analyse(INDEFINITE, definite=False)
    assert analysis.backend == "superlu"
    np.testing.assert_allclose(
        analysis.factor(INDEFINITE).solve(b), np.linalg.solve(INDEFINITE.toarray(), b), rtol=1e-13
    )


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__.removeprefix("test_"))
@pytest.mark.filterwarnings("ignore:rslab, which comes with lacmesh, cannot be loaded")
def test_exact_solutions_are_found_without_rslab(check, without_rslab):
    check()
