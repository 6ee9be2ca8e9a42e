"""Linear solvers: every installed backend gives the same, for every body, again and for many right-hand sides."""

from __future__ import annotations

import doctest
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csc_array, csr_array

from lacmesh.errors import DataError, LacmeshError, RequestError
from lacsolver.case.case import Solver
from lacsolver.case.rules import BACKENDS_OF
from lacsolver.linear import Backend, LinearError, analyse, backends, choose
from tests.lacsolver.stiffnesses import BODIES, free, held
from tests.lacsolver.systems import factorise

INSTALLED = [b.name for b in backends().values() if b.installed]
DIRECT = [name for name in INSTALLED if backends()[name].direct]


def block_of(modes):
    return 3 if modes.shape[1] == 6 else 2


def solver(K, modes, backend, **options):
    return analyse(K, backend=backend, modes=modes, block=block_of(modes), **options)


def sides(n, *columns):
    return np.random.default_rng(3).normal(size=(n, *columns))


def test_a_plain_install_has_a_good_direct_solver():
    assert {"rslab", "superlu"} <= set(INSTALLED)
    assert choose("auto", 10).name in ("rslab", "pardiso")


def test_the_backends_are_those_of_the_case_file():
    (entry,) = [k for k in Solver.__dataclass_fields__.values() if k.name == "backend"]
    named = {*entry.metadata["key"].kind.options}
    assert named == {"auto", *backends(), *BACKENDS_OF["petsc"]} and {*BACKENDS_OF["serial"]} == {*backends()}


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("backend", INSTALLED)
def test_all_backends_agree(backend, name):
    K, modes = held(name)
    b = sides(K.shape[0])
    x = solver(K, modes, backend).factor(K).solve(b, tolerance=1e-13)
    exact = np.linalg.solve(K.toarray(), b)
    assert np.abs(x - exact).max() <= 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("backend", INSTALLED)
def test_many_right_hand_sides_are_solved_as_one_by_one(backend):
    K, modes = held("tetrahedra")
    B = sides(K.shape[0], 7)
    B[:, 3] = 0
    factor = solver(K, modes, backend).factor(K)
    X = factor.solve(B, tolerance=1e-13)
    one_by_one = np.stack([factor.solve(b, tolerance=1e-13) for b in B.T], axis=1)
    assert np.abs(X - one_by_one).max() <= 1e-11 * np.abs(X).max()
    assert np.abs(B - K @ X).max() <= 1e-11 * np.abs(B).max() and not X[:, 3].any()
    assert factor.n_solves == 14


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("backend", INSTALLED)
def test_right_hand_sides_in_any_layout_are_left_alone(backend, order):
    K, modes = held("plane")
    B = np.array(sides(2 * K.shape[0], 6), order=order)[::2, ::2]
    before = B.copy()
    X = solver(K, modes, backend).factor(K).solve(B)
    assert (before == B).all() and X.shape == B.shape
    assert np.abs(B - K @ X).max() <= 1e-10 * np.abs(B).max()


@pytest.mark.parametrize("backend", INSTALLED)
def test_no_columns_and_no_unknowns(backend):
    K, modes = held("plane")
    assert solver(K, modes, backend).factor(K).solve(np.empty((K.shape[0], 0))).shape == (K.shape[0], 0)
    nothing = csr_array((0, 0))
    assert analyse(nothing, backend=backend).factor(nothing).solve(np.empty(0)).shape == (0,)


@pytest.mark.parametrize("backend", INSTALLED)
def test_new_values_in_the_same_pattern(backend):
    """A second factor of the analysis is that of a new analysis, and takes the first one's place."""
    K, modes = held("mixture")
    softer = held("mixture", young=3.0)[0]
    softer.data *= np.sqrt(np.outer(*(2 * [np.linspace(1, 2, K.shape[0])])))[K.tocoo().coords]
    analysis = solver(K, modes, backend)
    b = sides(K.shape[0])
    first = analysis.factor(K)
    before = first.solve(b, tolerance=1e-13)
    second = analysis.factor(softer)
    fresh = solver(softer, modes, backend).factor(softer).solve(b, tolerance=1e-13)
    assert np.abs(second.solve(b, tolerance=1e-13) - fresh).max() <= 1e-11 * np.abs(fresh).max()
    again = analysis.factor(K).solve(b, tolerance=1e-13)
    assert np.abs(again - before).max() <= 1e-11 * np.abs(before).max() < 0.1 * np.abs(again - fresh).max()


@pytest.mark.parametrize("backend", DIRECT)
def test_a_factor_that_was_replaced_says_so(backend):
    K, _ = held("plane")
    analysis = analyse(K, backend=backend)
    old = analysis.factor(K)
    new = analysis.factor(K)
    with pytest.raises(RequestError, match="replaced by a newer one"):
        old.solve(np.ones(K.shape[0]))
    assert np.isfinite(new.solve(np.ones(K.shape[0]))).all()


@pytest.mark.parametrize("backend", DIRECT)
def test_two_threads_give_the_same(backend):
    K, _ = held("hexahedra")
    b = sides(K.shape[0])
    one, two = (factorise(K, backend=backend, threads=k).solve(b) for k in (1, 2))
    assert np.abs(one - two).max() <= 1e-12 * np.abs(one).max()


@pytest.mark.parametrize("backend", INSTALLED)
@pytest.mark.parametrize("form", ["bsr", "csc", "unsorted", "doubled"])
def test_any_storage(backend, form):
    K, modes = held("hexahedra")
    coo = K.tocoo()
    half = csr_array((np.tile(coo.data / 2, 2), (np.tile(coo.row, 2), np.tile(coo.col, 2))), shape=K.shape)
    made = {
        "bsr": K.tobsr((3, 3)),
        "csc": csc_array(K),
        "unsorted": K[:, ::-1][:, ::-1],
        "doubled": half,
    }[form]
    kept = made.copy()
    b = sides(K.shape[0])
    x = solver(made, modes, backend).factor(made).solve(b)
    assert np.abs(b - K @ x).max() <= 1e-10 * np.abs(b).max()
    assert (made.indices == kept.indices).all() and (made.data == kept.data).all()


def test_refinement_mends_a_poor_backend(monkeypatch):
    """A solver that is off by 1e-6 still gives a solution exact to rounding; one that is off by 1 is found out."""
    K, _ = held("hexahedra")
    b = sides(K.shape[0])
    factor = factorise(K, backend="superlu")
    exact = factor.solve(b)
    good = factor._solve
    noise = np.random.default_rng(0)
    monkeypatch.setattr(factor, "_solve", lambda r: good(r) * (1 + 1e-6 * noise.normal(size=r.shape)))
    assert np.abs(factor.solve(b) - exact).max() <= 1e-11 * np.abs(exact).max()
    assert np.abs(factor._solve(b) - exact).max() > 1e-8 * np.abs(exact).max()
    monkeypatch.setattr(factor, "_solve", lambda r: np.random.default_rng(0).normal(size=r.shape))
    with pytest.raises(LinearError, match="try another backend"):
        factor.solve(b)


@pytest.mark.parametrize("backend", DIRECT)
def test_a_matrix_that_is_not_symmetric_is_found_out(backend):
    K, _ = held("hexahedra")
    K = K.copy()
    K.data *= 1 + 0.1 * np.random.default_rng(0).normal(size=K.nnz) * (K.tocoo().row < K.tocoo().col)
    with pytest.raises(LinearError):
        factorise(K, backend=backend).solve(np.ones(K.shape[0]))


def test_auto_takes_multigrid_above_a_size_where_the_modes_of_a_solid_are_given(monkeypatch):
    K, modes = held("hexahedra")
    assert analyse(K, modes=modes, block=3).backend in DIRECT
    monkeypatch.setitem(choose.__globals__, "MULTIGRID_ABOVE", 10)
    assert analyse(K, modes=modes, block=3).backend == "multigrid"
    assert analyse(K).backend in DIRECT
    K, modes = held("plane")
    assert analyse(K, modes=modes, block=2).backend in DIRECT


def test_a_backend_that_is_not_there(monkeypatch):
    K, _ = held("plane")
    with pytest.raises(RequestError, match=r"no linear solver named 'rslap'; did you mean rslab"):
        analyse(K, backend="rslap")
    monkeypatch.setattr(sys.modules[Backend.__module__], "find_spec", lambda name: None)
    with pytest.raises(RequestError, match=r"mumps is not installed; pip install 'lacmesh\[mumps\]'") as caught:
        analyse(K, backend="mumps")
    assert caught.value.status == 2


@pytest.mark.parametrize("backend", INSTALLED)
def test_wrong_calls(backend):
    K, modes = held("plane")
    other, _ = held("plane mixture")
    analysis = solver(K, modes, backend)
    factor = analysis.factor(K)
    wrong = [
        lambda: analysis.factor(other),
        lambda: factor.solve(np.ones(3)),
        lambda: factor.solve(np.ones((K.shape[0], 1, 1))),
        lambda: analyse(K, backend=backend, threads=0),
        lambda: analyse(K.toarray(), backend=backend),
        lambda: analyse(K[:-1], backend=backend),
    ]
    for call in wrong:
        with pytest.raises(RequestError):
            call()


@pytest.mark.parametrize("backend", INSTALLED)
def test_entries_that_are_no_numbers(backend):
    K, modes = held("plane")
    b = np.ones(K.shape[0])
    b[7] = np.nan
    with pytest.raises(DataError, match="row 7; look at the loads"):
        solver(K, modes, backend).factor(K).solve(b)
    wrong = K.copy()
    wrong.data[wrong.indptr[9] :][:1] = np.inf
    with pytest.raises(DataError, match="row 9; look at the material"):
        solver(K, modes, backend).factor(wrong)


@pytest.mark.parametrize("backend", DIRECT)
def test_another_pattern_of_the_same_size_is_refused(backend):
    K, _ = held("plane")
    far = ([0, K.shape[0] - 1], [K.shape[0] - 1, 0])
    other = csr_array(K + csr_array(([1e-3, 1e-3], far), shape=K.shape))
    with pytest.raises(RequestError, match="pattern"):
        analyse(K, backend=backend).factor(other)


def test_every_error_is_one_of_lacmesh():
    assert issubclass(LinearError, LacmeshError) and LinearError("no").status == 4
    assert free("plane")[1].shape[0] > 0


def test_the_page_does_what_it_says():
    page = Path(__file__).parents[2] / "docs" / "solver_backends.md"
    failed, tried = doctest.testfile(str(page), module_relative=False)
    assert tried > 8 and not failed
    assert {b.name for b in backends().values()} <= set(re.findall(r"^\| `(\w+)`", page.read_text(), re.MULTILINE))
