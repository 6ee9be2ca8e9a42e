"""Linear solvers: every installed one gives the same, for every body; singular systems are errors; a solver in reserve.

SciPy's SuperLU serves in the place of rslab where that cannot be loaded or fails: it is said once, and runs go on."""

import doctest
import itertools
import re
import sys
import warnings
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import rslab
from scipy.sparse import csc_array, csr_array, eye_array

import lacsolver as ls
import lacsolver.saddle.stiffness
from lacmesh import Mesh
from lacmesh.errors import DataError, LacmeshError, LacmeshWarning, RequestError
from lacsolver.case import Solver
from lacsolver.case.rules import BACKENDS_OF
from lacsolver.linear import MULTIGRID_ABOVE, Backend, LinearError, SingularError, analyse, backends, choose
from lacsolver.linear.direct.reserve import warn_once
from lacsolver.linear.vectors import SharedVectors
from lacsolver.output import create_output
from lacsolver.running import run
from tests import REPOSITORY
from tests.answers import ANSWERS, Ran, check_tower
from tests.lacsolver.bodies import cube
from tests.lacsolver.systems import BODIES, beside, factorise, free, held, rigid_modes, stiffness
from tests.problems import PROBLEMS, stacked
from tests.samples import each_option

INSTALLED = [b.name for b in backends().values() if b.installed]
DIRECT = [name for name in INSTALLED if backends()[name].direct]


def block_of(modes):
    return 3 if modes.shape[1] == 6 else 2


def solver(K, modes, backend, **options):
    return analyse(K, backend=backend, modes=modes, block=block_of(modes), **options)


def sides(n, *columns):
    return np.random.default_rng(3).normal(size=(n, *columns))


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("backend", INSTALLED)
def test_all_backends_agree(backend, name):
    K, modes = held(name)
    b = sides(K.shape[0])
    x = solver(K, modes, backend).factor(K).solve(b, tolerance=1e-13)
    exact = np.linalg.solve(K.toarray(), b)
    assert np.abs(x - exact).max() <= 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("backend", INSTALLED)
@pytest.mark.parametrize("order", ["C", "F"])
def test_right_hand_sides_of_any_number_and_layout(backend, order):
    """Many are solved as one by one, and left alone; none have no solution."""
    K, modes = held("tetrahedra")
    B = np.array(sides(2 * K.shape[0], 14), order=order)[::2, ::2]
    B[:, 3] = 0
    before = B.copy()
    factor = solver(K, modes, backend).factor(K)
    X = factor.solve(B, tolerance=1e-13)
    one_by_one = np.stack([factor.solve(b, tolerance=1e-13) for b in B.T], axis=1)
    assert (before == B).all() and np.abs(X - one_by_one).max() <= 1e-11 * np.abs(X).max()
    assert np.abs(B - K @ X).max() <= 1e-11 * np.abs(B).max() and not X[:, 3].any()
    assert factor.n_solves == 14
    assert factor.solve(np.empty((K.shape[0], 0))).shape == (K.shape[0], 0)
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
    if backend in DIRECT:
        with pytest.raises(RequestError, match="replaced by a newer"):
            first.solve(b)


@pytest.mark.parametrize("backend", INSTALLED)
@pytest.mark.parametrize("form", ["bsr", "csc", "unsorted", "doubled"])
def test_any_storage(backend, form):
    K, modes = held("hexahedra")
    coo = K.tocoo()
    half = csr_array((np.tile(coo.data / 2, 2), (np.tile(coo.row, 2), np.tile(coo.col, 2))), shape=K.shape)
    made = {"bsr": K.tobsr((3, 3)), "csc": csc_array(K), "unsorted": K[:, ::-1][:, ::-1], "doubled": half}[form]
    kept = made.copy()
    b = sides(K.shape[0])
    x = solver(made, modes, backend).factor(made).solve(b)
    assert np.abs(b - K @ x).max() <= 1e-10 * np.abs(b).max()
    assert (made.indices == kept.indices).all() and (made.data == kept.data).all()


@pytest.mark.parametrize("backend", INSTALLED)
def test_wrong_calls_and_entries(backend):
    K, modes = held("plane")
    n = K.shape[0]
    analysis = solver(K, modes, backend)
    factor, spoilt, b = analysis.factor(K), K.copy(), np.ones(n)
    b[7] = np.nan
    spoilt.data[spoilt.indptr[9] :][:1] = np.inf
    other = csr_array(K + csr_array(([1e-3, 1e-3], ([0, n - 1], [n - 1, 0])), shape=K.shape))
    wrong = [
        (lambda: analysis.factor(held("plane mixture")[0]), RequestError, None),
        (lambda: factor.solve(np.ones(3)), RequestError, None),
        (lambda: factor.solve(np.ones((n, 1, 1))), RequestError, None),
        (lambda: analyse(K, backend=backend, threads=0), RequestError, None),
        (lambda: analyse(K.toarray(), backend=backend), RequestError, None),
        (lambda: analyse(K[:-1], backend=backend), RequestError, None),
        (lambda: factor.solve(b), DataError, "row 7"),
        (lambda: analysis.factor(spoilt), DataError, "row 9"),
    ]
    if backend in DIRECT:
        wrong.append((lambda: analyse(K, backend=backend).factor(other), RequestError, "pattern"))
    for call, error, words in wrong:
        with pytest.raises(error, match=words):
            call()


def test_the_choice_of_a_backend(monkeypatch):
    """`auto` takes multigrid for many unknowns where the modes of a solid are given."""
    assert {"rslab", "superlu"} <= set(INSTALLED) and choose("auto", 10).name in ("rslab", "pardiso")
    large = MULTIGRID_ABOVE + 1
    for n, modes in ((large, 6), (large, 3), (large, 0), (10, 6)):
        assert (choose("auto", n, modes).name == "multigrid") == (n == large and modes == 6)
    with pytest.raises(RequestError, match="did you mean rslab"):
        choose("rslap", 10)
    monkeypatch.setattr(sys.modules[Backend.__module__], "find_spec", lambda name: None)
    with pytest.raises(RequestError, match="multigrid is not installed") as caught:
        choose("multigrid", 10)
    assert caught.value.status == 2


def test_the_page_does_what_it_says():
    page = REPOSITORY / "docs" / "benchmarks.md"
    failed, tried = doctest.testfile(str(page), module_relative=False)
    assert tried > 8 and not failed
    assert {*backends()} <= set(re.findall(r"^\| `(\w+)`", page.read_text(), re.MULTILINE))


# ---- named by a case


@pytest.fixture
def solve(tmp_path, monkeypatch):
    """Run three blocks with these keys of [solver]; returns the backends and threads that it analysed with."""
    asked = []

    def recorded(K, *, backend, threads, **rest):
        made = analyse(K, backend=backend, threads=threads, **rest)
        asked.append((made.backend, threads))
        return made

    def ran(**keys):
        case = stacked(1.0, Solver(**keys)).case()
        run(case, create_output(tmp_path / "out", force=True))
        check_tower(Ran(case, case.mesh, tmp_path / "out"), 34 + 13 * 4)
        return asked

    monkeypatch.setattr(lacsolver.saddle.stiffness, "analyse", recorded)
    monkeypatch.setattr(lacsolver.problem.problem, "available_cores", lambda: 7)
    return ran


@pytest.mark.parametrize("backend", ["auto", *backends()])
def test_every_backend_solves_or_is_missing(solve, backend):
    if backend not in ("auto", *INSTALLED):
        with pytest.raises(LacmeshError, match=f"{backend} is not installed"):
            solve(backend=backend)
        return
    assert solve(backend=backend, threads=3) == [(backend if backend != "auto" else DIRECT[0], 3)]


def test_engines_and_cores(solve):
    """One process takes all cores where no number is given; engines of several are not taken for the serial one."""
    assert {*Solver.KEYS["backend"].kind.options} == {"auto", *backends(), *BACKENDS_OF["petsc"]}
    assert [threads for _, threads in solve()] == [7]
    for engine in ("auto", "serial"):
        solve(engine=engine)
    for keys in ({"engine": "petsc"}, {"backend": "gamg"}, {"backend": "hypre"}):
        with pytest.raises(LacmeshError, match="engine petsc"):
            solve(**keys)


# ---- singular systems


def spanned(mode, motions):
    """The distance of a mode, whose largest entry is 1, from the span of some motions (n, k)."""
    return np.abs(mode - motions @ np.linalg.lstsq(motions, mode, rcond=None)[0]).max()


def of_squares():
    """Two squares that share a corner: one is held, the other turns about it."""
    x = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]])
    _, K = stiffness(Mesh.create(x, [("QUAD4", [[0, 1, 2, 3], [2, 4, 5, 6]])]), "plane_strain")
    turned = np.where(np.arange(7)[:, None] > 3, (x - 1) @ [[0, 1], [-1, 0]], 0).reshape(-1, 1)
    return csr_array(K.tocsr()[4:][:, 4:]), None, turned[4:]


def floating(name):
    space, K = free(name)
    return K, rigid_modes(space), rigid_modes(space)


def one_of_two():
    one, modes = held("hexahedra")
    two, motions, _ = floating("tetrahedra")
    return beside(one, two.tocsr()), np.vstack([modes, motions]), np.vstack([0 * modes, motions])


def turning():
    """A body with one node held."""
    K, modes, _ = floating("hexahedra")
    about = (modes - modes[:, :3] @ modes[:3])[3:]
    return csr_array(K.tocsr()[3:][:, 3:]), about, about


def with_a_loose_node():
    K, _ = held("plane")
    return csr_array(beside(K, csr_array((2, 2))) + 0 * eye_array(K.shape[0] + 2)), None, None


#: name -> K, modes for the solver, and the motions (n, k) without energy
SINGULAR = {name: partial(floating, name) for name in BODIES} | {
    "one of two bodies": one_of_two, "a body that turns": turning, "a hinge": of_squares, "a node": with_a_loose_node
}  # fmt: skip


@pytest.mark.parametrize("name", SINGULAR)
@pytest.mark.parametrize("backend", INSTALLED)
def test_a_singular_system_is_an_error_that_names_the_motion(backend, name):
    """Multigrid, which does not see a hinge before, gives no quiet answer unless loads balance."""
    K, modes, motions = SINGULAR[name]()
    if name == "a hinge" and backend == "multigrid":
        with pytest.raises(LinearError):
            analyse(K, backend="multigrid", block=2).factor(K).solve(np.arange(K.shape[0], dtype=float))
        return
    block = {} if modes is None else {"modes": modes, "block": block_of(modes)}
    with pytest.raises(SingularError, match="singular") as caught:
        analyse(K, backend=backend, **block).factor(K)
    mode, dof = caught.value.mode, caught.value.dof
    if name == "a node":
        assert dof == K.shape[0] - 2 and mode is None
        return
    assert caught.value.status == 1 and np.abs(mode).max() == mode[dof] == 1
    assert spanned(mode, motions) < 1e-6


def negative(name, number):
    """A body with one negative eigenvalue that no diagonal entry shows."""
    K = held(name)[0].toarray()
    low, ways = np.linalg.eigh(K)
    return csr_array(K - 1.5 * low[number] * np.outer(ways[:, number], ways[:, number]))


@pytest.mark.parametrize("backend", DIRECT)
def test_a_negative_stiffness(backend):
    """One that no diagonal entry shows; a body of negative modulus beside a good one."""
    K, good = negative("hexahedra", 100), held("hexahedra")[0]
    assert (K.diagonal() > 0).all()
    with pytest.raises(SingularError, match="not positive definite") as caught:
        factorise(K, backend=backend)
    assert caught.value.mode is None
    with pytest.raises(SingularError, match="not positive definite") as caught:
        factorise(beside(good, -good), backend=backend)
    assert caught.value.dof >= good.shape[0]


@pytest.mark.rows("rslab-300", "superlu-30")
@pytest.mark.parametrize(("backend", "length"), each_option(itertools.product(DIRECT, (1000, 30, 300))))
def test_a_slender_beam_is_regular_where_it_is_held_and_singular_where_not(backend, length):
    space, K = stiffness(cube("HEXA20", 0, (0, 0, 0), (length, 1, 1), (length, 1, 1)), "3d")
    with pytest.raises(SingularError) as caught:
        factorise(K, backend=backend)
    assert spanned(caught.value.mode, rigid_modes(space)) < 0.05
    kept = np.repeat(space.mesh.points[:, 0] > 1e-9, 3)
    K = csr_array(K.tocsr()[kept][:, kept])
    b = np.zeros(len(kept))
    end = np.flatnonzero(space.mesh.points[:, 0] > length - 1e-9)
    b[3 * end + 1] = 1 / len(end)
    deflection = b[kept] @ factorise(K, backend=backend).solve(b[kept])
    assert abs(deflection / (length**3 / 50) - 1) < 0.01  # L^3 / 3 E I, E = 200, a section 1 x 1


@pytest.mark.parametrize("backend", DIRECT)
def test_a_matrix_that_is_not_symmetric_is_found_out(backend):
    K, _ = held("hexahedra")
    K.data *= 1 + 1e-3 * np.random.default_rng(0).normal(size=K.nnz) * (K.tocoo().row < K.tocoo().col)
    with warnings.catch_warnings(), pytest.raises(LinearError):
        warnings.simplefilter("error")  # nothing is said of a solver
        factorise(K, backend=backend).solve(np.ones(K.shape[0]))


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
    _, loose = stiffness(BODIES["hexahedra"][0](), "3d", young=1e-10)
    with pytest.raises(SingularError) as caught:
        factorise(beside(stiff, loose.tocsr()))
    assert caught.value.dof >= stiff.shape[0]


# ---- a solver in reserve


MODULE = sys.modules["lacsolver.linear.backends"]
SMALL = csr_array(np.diag([2.0, 3.0, 4.0]) + np.diag([-1.0, -1.0], 1) + np.diag([-1.0, -1.0], -1))
INDEFINITE = csr_array(np.array([[0.5, 2.0, 0.0], [2.0, 0.5, 1.0], [0.0, 1.0, -3.0]]))


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


class PanicException(BaseException):
    """A panic of Rust, which is no Exception."""


def panic(*arguments):
    raise PanicException("index out of bounds")


def _raising(error):
    def fail(*arguments):
        raise error

    return fail


def spoilt(factor, inertia=None, spoil=lambda x: x):
    """A factor of rslab with another inertia, or a function of its solutions in their place."""
    solve, many = (lambda b: spoil(factor.solve(b))), (lambda b: spoil(factor.solve_many(b)))
    return SimpleNamespace(n=factor.n, inertia=inertia or factor.inertia, solve=solve, solve_many=many)


#: name -> a function of rslab's analysis and values, in place of its factorisation
FAILURES = {
    "an error": _raising(RuntimeError("a front of 3 rows has no parent")),
    "a panic": panic,
    "called singular": _raising(RuntimeError("matrix is numerically rank-deficient")),
    "negative pivots": lambda factor, values: spoilt(factor(values), (2, 1, 0), np.zeros_like),
    "noise": lambda factor, values: spoilt(factor(values), spoil=lambda x: x[::-1] * 7),
    "no numbers": lambda factor, values: spoilt(factor(values), spoil=lambda x: x * np.nan),
    "an error while solving": lambda factor, values: spoilt(factor(values), spoil=_raising(ValueError("no factor"))),
    "off by little": lambda factor, values: spoilt(factor(values), spoil=lambda x: x * (1 + 1e-6 * sides(*x.shape))),
}


@pytest.fixture
def failing(monkeypatch, rslab_alone):
    """A function that makes rslab fail in one of these ways."""
    whole = rslab.analyze

    def spoil(name):
        def analyze(*given, **options):
            if name == "analysis":
                panic()
            analysis = whole(*given, **options)
            return SimpleNamespace(factor=lambda values: FAILURES[name](analysis.factor, values))

        monkeypatch.setattr(rslab, "analyze", analyze)

    return spoil


@pytest.mark.parametrize("name", [*[name for name in FAILURES if name != "off by little"], "analysis"])
def test_superlu_takes_the_place_of_rslab_that_fails_and_it_is_said_once(failing, name):
    failing(name)
    b = np.arange(3.0)
    with pytest.warns(LacmeshWarning, match="SuperLU serves") as told:
        analysis = analyse(SMALL)
        for scale in (1.0, 2.0):
            factor = analysis.factor(scale * SMALL)
            for _again in range(2):
                x = factor.solve(b)
                np.testing.assert_allclose(x, np.linalg.solve(scale * SMALL.toarray(), b), rtol=1e-13)
        if name not in ("called singular", "negative pivots", "no numbers"):
            warn_once.cache_clear()
            x = analyse(INDEFINITE, definite=False).factor(INDEFINITE).solve(b)
            np.testing.assert_allclose(x, np.linalg.solve(INDEFINITE.toarray(), b), rtol=1e-13)
    assert len(told) in (1, 2) and analysis.backend == "superlu" and analysis.note == str(told[0].message)
    assert factor.n_solves == 2


@pytest.mark.parametrize("size", [1, 2, 3])
def test_products_of_several_processes_are_those_of_one(size):
    """Each has its own of six unknowns, and all have the three pressures that follow them."""
    rng, each = np.random.default_rng(0), np.arange(6) % size
    A, x = rng.normal(size=(2, 9)), rng.normal(size=9)
    alone = (SimpleNamespace(rank=rank, total=lambda part: part) for rank in range(size))
    parts = [SharedVectors(each == comm.rank, lambda own: own, comm).dots(A, x) for comm in alone]
    np.testing.assert_allclose(np.sum(parts, axis=0), A @ x, rtol=1e-14)


def test_refinement_mends_a_factor_that_is_off_by_little(failing):
    """By 1e-6: the solution is exact to rounding, and nothing is said."""
    failing("off by little")
    K, b = held("hexahedra")[0], sides(held("hexahedra")[0].shape[0])
    x, exact = factorise(K, backend="rslab").solve(b), np.linalg.solve(K.toarray(), b)
    assert np.abs(x - exact).max() <= 1e-11 * np.abs(exact).max()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["", "an error", "called singular", "negative pivots"])
def test_a_singular_matrix_is_called_so_by_superlu_too(failing, name):
    if name:
        failing(name)
    with pytest.raises(SingularError, match="something can move"):
        factorise(free("plane")[1].tocsr(), backend="rslab")


@pytest.mark.filterwarnings("error")
def test_a_sound_claim_of_negative_pivots_asks_no_second_solver(monkeypatch):
    """A structure that buckles does so in many steps: each would cost a factorisation by SuperLU."""
    monkeypatch.setattr("lacsolver.linear.direct.superlu.analyse", panic)
    with pytest.raises(SingularError, match="not positive definite"):
        factorise(negative("plane", 5), backend="rslab")


def test_a_run_goes_on_and_its_results_say_so(failing, fresh):
    known = ls.solve("data/two_blocks.toml").contact["joint"].pressure
    failing("an error")
    with pytest.warns(LacmeshWarning, match="SuperLU serves") as told:
        results = run("data/two_blocks.toml", fresh / "results")
    assert results.status == "done" and len(told) == 1
    assert "failed (a front of 3 rows has no parent)" in results.message
    solution = ls.read_results(fresh / "results").solution(-1)
    np.testing.assert_allclose(solution.contact["joint"].pressure, known, rtol=1e-8, atol=1e-8)


def test_superlu_serves_where_rslab_cannot_be_loaded_and_it_is_said_once(without_rslab):
    b = np.arange(3.0)
    with pytest.warns(LacmeshWarning, match="pip install rslab") as told:
        factors = [factorise(SMALL), factorise(SMALL)]
        other = analyse(INDEFINITE, definite=False)
    assert len(told) == 1 and other.backend == "superlu"
    for K, factor in ((SMALL, factors[0]), (SMALL, factors[1]), (INDEFINITE, other.factor(INDEFINITE))):
        np.testing.assert_allclose(factor.solve(b), np.linalg.solve(K.toarray(), b), rtol=1e-13)
    with pytest.raises(RequestError, match="rslab is not installed"):
        factorise(SMALL, backend="rslab")


#: of every way in which the solver uses a factor
USES = (
    "linked", "fields", "glued", "rubbed", "slid", "measured", "neo-hookean", "yielding", "tightened",
    "massless none",
)  # fmt: skip


@pytest.mark.rows("linked", "fields", "glued", "yielding")
@pytest.mark.parametrize("name", USES)
@pytest.mark.filterwarnings("ignore::lacmesh.errors.LacmeshWarning")
def test_exact_solutions_are_found_without_rslab(name, without_rslab, tmp_path):
    case = PROBLEMS[name].case()
    run(case, create_output(tmp_path / "out"))
    ANSWERS[name](Ran(case, case.mesh, tmp_path / "out"))
