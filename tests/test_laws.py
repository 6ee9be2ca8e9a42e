"""Laws that hold for every problem of the corpus: its answer, and that the answer is the same however it is asked for.

A law is a test over `PROBLEMS`; a problem for which it has no meaning is left out by what it is, not by its name.
"""

from __future__ import annotations

import warnings
from dataclasses import MISSING, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import lacsolver as ls
from lacmesh.errors import LacmeshError, LacmeshWarning
from lacsolver.case import Case, Solver, read_case
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.newmark import Newmark
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.schemes import QuasiStatic
from lacsolver.equilibrium.state import StepState
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from tests.answers import ANSWERS, Ran
from tests.lacsolver.contact_cases import checked
from tests.problems import PROBLEMS, case_of
from tests.worlds import CannotTurnError, World, assert_same, case_in, permuted, turned_world

pytestmark = [
    pytest.mark.filterwarnings(f"ignore:{words}:lacmesh.errors.LacmeshWarning")
    for words in (
        ".* small kinematics assumes small displacements",
        "tie .* across a gap of up to",
        "steps are too long for the energy that friction takes",
        "massless nodes change the inertia",
    )
]
#: problems that take the way of another through the code: `make test` asks for their answers, `make verify` every law
ALIKE = {
    "halved", "press 1", "press 2", "press 4", "dragged, smooth", "massless none", "massless slave",
    "massless internal", "saint venant", "sector auto", "sector pyramid", "auto", "pyramid",
}  # fmt: skip
#: problems whose run finds an equilibrium
SOLVABLE = [name for name in PROBLEMS if name != "given up"]
EVERY = pytest.mark.parametrize("name", PROBLEMS)


def slow(it_is):
    """The marks of a row that is slow, or of one that is not."""
    return [pytest.mark.slow] * it_is


def each(names):
    """Parameters of problems; those that are like another are slow."""
    return pytest.mark.parametrize("name", [pytest.param(name, marks=slow(name in ALIKE)) for name in names])


SOLVED = each(SOLVABLE)


def ran(case, folder, mesh=None):
    """Run a case; an equilibrium that is not found is kept."""
    done = Ran(case, case.mesh if mesh is None else mesh, folder)
    try:
        run(case, create_output(folder), mesh=mesh, progress=done.told.append)
    except NotConvergedError as error:
        done.error = error
    return done


@pytest.fixture(scope="module")
def ran_once(tmp_path_factory):
    """Function of a problem's name: the problem as it stands, run once for all tests, and what its folder holds."""
    return cache(lambda name: ran(PROBLEMS[name].case(), tmp_path_factory.mktemp("run") / "out"))


@cache
def states_of(name):
    """The converged states of a problem as it stands."""
    return tuple(march(Problem.of(PROBLEMS[name].case(), PROBLEMS[name].mesh())))


# ---- the answer


@EVERY
def test_the_answer(name, ran_once):
    ANSWERS[name](ran_once(name))


@SOLVED
def test_solve_and_march_and_run_are_one(name, ran_once):
    """What is solved in memory is what a run writes, to the last bit: displacements, pressures, states."""
    done, states = ran_once(name), states_of(name)
    case, folder = done.case, done.folder
    assert done.error is None and done.results["status"] == "done"
    assert done.times == [state.time for state in states]
    written, last = read_state(folder, case, mesh=case.mesh), states[-1]
    np.testing.assert_array_equal(written.u, last.u)
    np.testing.assert_array_equal(written.step.iterate.p, last.step.iterate.p)
    solution = ls.solve(case)
    np.testing.assert_array_equal(solution.u.ravel(), last.u)
    assert list(solution.contact) == [zone.name for zone in last.zones]
    assert_read(folder, solution)


def assert_read(folder, solution):
    """The fields and tables of a folder hold a solution, to the last bit."""
    read, number = ls.read_results(folder).solution(), solution.mesh.node_number
    place = np.argsort(number)[np.searchsorted(np.sort(number), read.mesh.node_number)]
    np.testing.assert_array_equal(number[place], read.mesh.node_number)
    assert read.mesh.n_nodes == len(number)
    np.testing.assert_array_equal(read.u, solution.u[place])
    np.testing.assert_array_equal(read.stress(), solution.stress()[place])
    for name, zone in solution.contact.items():
        order = np.argsort(read.contact[name].number)
        for own in ("pressure", "gap", "status", "coverage", "area", "recovered", "centre", "normal"):
            np.testing.assert_array_equal(getattr(read.contact[name], own)[order], getattr(zone, own))


@each([*(name for name in PROBLEMS if len(PROBLEMS[name].case().steps.planned) > 1), "halved"])
def test_a_run_that_goes_on_is_one_that_did_not_stop(name, ran_once):
    """From the state after the first step, to the last bit."""
    done, states = ran_once(name), states_of(name)
    case, first = done.case, done.stored[0]
    start = read_state(done.folder, case, done.times[first - 1], mesh=case.mesh)
    for again, state in zip(march(Problem.of(case, case.mesh), start=start.step), states[first:], strict=True):
        np.testing.assert_array_equal(again.u, state.u)
        np.testing.assert_array_equal(again.step.iterate.p, state.step.iterate.p)


@SOLVED
def test_equilibrium_and_the_conditions_of_contact(name):
    """What is free is in balance, and so are contact's forces and moments; p >= 0, G >= 0, p G = 0; energies close."""
    problem = Problem.of(PROBLEMS[name].case(), PROBLEMS[name].mesh())
    checked(problem, states_of(name), exact=not any(joint.moving for joint in problem.joints))


# ---- derivatives

#: one has no unknowns, one leaves a part of its tangent out, and skins of two end at the same place, where they kink
NO_TANGENT = ("given up", "fields", "symmetric", "press 1", "press 2")


@each(name for name in PROBLEMS if name not in NO_TANGENT)
def test_the_tangent_is_the_difference_of_forces_and_of_gaps(name):
    """At the last state, along a motion of all unknowns: a smooth one where skins are paired anew, without a kink."""
    problem, states = Problem.of(PROBLEMS[name].case(), PROBLEMS[name].mesh()), states_of(name)
    before = states[-2].step if len(states) > 1 else StepState()
    scheme = QuasiStatic() if problem.case.dynamics is None else Newmark(problem)
    step = LoadStep(ReducedProblem(problem, scheme), states[-1].time, before)
    (q, p, _), random, dim = states[-1].step.iterate, np.random.default_rng(0), problem.space.dim
    moving = any(joint.moving for joint in problem.joints)
    waves = np.sin(problem.space.mesh.points @ random.uniform(-2, 2, (3, dim)) + random.uniform(0, 3, dim)).ravel()
    v = 1e-6 * (problem.constraints.unknowns(waves) if moving else random.uniform(-1, 1, len(q)))
    now, D = step.linearize(q), step.contact(q).rows.D
    bent = now.geometric_stiffness(p)
    wanted = now.stiffness(0.0, False).K @ v + (0.0 if bent is None else bent @ v)

    def at(q):
        one = step.linearize(q)
        return one.r - one.contact.rows.B_T @ p, step.contact(q).G

    (less, gaps), (more, wide) = at(q + v), at(q - v)
    assert np.abs((more - less) / 2 - wanted).max() <= 1e-5 * np.abs(wanted).max()
    assert np.abs((wide - gaps) / 2 - D @ v).max(initial=0.0) <= 1e-5 * np.abs(D @ v).max(initial=0.0)


# ---- a case and its file


@EVERY
def test_a_file_and_back(name, tmp_path):
    """A case that is written is read as it was, and written the same again."""
    case = replace(PROBLEMS[name].case(), mesh=tmp_path / "blocks.msh")
    case.write(tmp_path / "case.toml")
    again = read_case(tmp_path / "case.toml")
    again.write(tmp_path / "again.toml")
    assert again == case
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "case.toml").read_text()


@SOLVED
def test_validate_finds_nothing_wrong(name):
    ls.validate(PROBLEMS[name].case())


# ---- every key has an effect


#: keys that change no answer of a static run, or belong to laws that a program adds: they have tests of their own
ELSEWHERE = {
    ("", "mesh"), ("solver", "engine"), ("solver", "backend"), ("solver", "threads"), ("cyclic", "harmonic"),
    ("contact", "constants"), ("material", "constants"),
}  # fmt: skip
#: options that are taken where a small problem does not name one
SETTLED = {"kind": "cell", "geometry": "reference", "normals": "master"}


def keys():
    """(section, key) of every key of a case, and (section, key, option) of every option that is no default."""
    for section, record in {"": Case, **Case.SECTIONS}.items():
        defaults = record.DEFAULTS
        for key, row in record.KEYS.items():
            if (section, key) not in ELSEWHERE:
                yield section, key
                settled = {defaults[key], SETTLED.get(key)}
                yield from ((section, key, option) for option in row.kind.options if option not in settled)


def without(name, section, key, option=None):
    """Yield each way to leave a key of a problem: the number of a record, None for the case; the key, None for all.

    A record has the default of the key in place of its own value; where there is no default, the record is left out.
    """
    problem = PROBLEMS[name]
    if not section and key in problem.keys and option in (None, problem.keys[key]):
        yield None, key
    for k, record in enumerate(problem.records):
        if record.SECTION.name == section:
            default = record.DEFAULTS[key]
            if default is MISSING:
                yield k, None
            elif getattr(record, key) != default and option in (None, getattr(record, key)):
                yield k, key


def left(name, k, key):
    """The case of a problem in which one key, or one record, is left."""
    problem = PROBLEMS[name]
    if k is None:
        return case_of(problem.mesh(), *problem.records, **{own: v for own, v in problem.keys.items() if own != key})
    one = problem.records[k]
    instead = [] if key is None else [replace(one, **{key: one.DEFAULTS[key]})]
    return problem.case([*problem.records[:k], *instead, *problem.records[k + 1 :]])


@cache
def is_right(name, k, key):
    """True if a problem has its answer without a key; a case that is refused has not. Options of a key share it."""
    with warnings.catch_warnings(), TemporaryDirectory() as folder:
        warnings.simplefilter("ignore", LacmeshWarning)
        try:
            ANSWERS[name](ran(left(name, k, key), Path(folder) / "out"))
        except (LacmeshError, AssertionError, LookupError, FileNotFoundError, TypeError):
            return False
    return True


@pytest.mark.parametrize("place", list(keys()), ids=".".join)
def test_every_key_has_an_effect(place):
    """Some problem has the key, and another answer, or none, without it."""
    tried = [(name, *way) for name in PROBLEMS for way in without(name, *place)]
    assert not all(is_right(*one) for one in tried), f"{len(tried)} problems have it, and none needs it"


# ---- the same in other units, turned, elsewhere, in another order

UNITS = {
    "small, stiff and slow": World(1e-3, 1e9, 1e4), "large, soft and fast": World(1e6, 1e-12, 1e-4),
    "mm in m": World(1e-3), "m in μm": World(1e6, 1e-12), "forces": World(stress=1e9), "slow": World(time=1e4),
}  # fmt: skip


def check_in(name, case, world, place=slice(None), iterations=True):
    """The states of a case are those of a problem in a world, with its nodes in other places."""
    others = tuple(march(Problem.of(case, case.mesh)))
    assert_same(states_of(name), others, world, PROBLEMS[name].mesh(), place, iterations=iterations)


def in_units():
    """Each problem in all other units at once, up or down by turns; `make verify` has the other way, and one by one."""
    for k, name in enumerate(SOLVABLE):
        for j, units in enumerate(UNITS):
            yield pytest.param(name, units, marks=slow(j != k % 2 or name in ALIKE))


@pytest.mark.parametrize(("name", "units"), [*in_units()])
def test_in_other_units(name, units):
    """Lengths, forces and times in other units: the same answer in the same iterations."""
    check_in(name, case_in(PROBLEMS[name], UNITS[units]), UNITS[units])


def turns(name):
    """True if a problem is exact, and can be written in a turned world: it has no component of its mesh alone."""
    problem = PROBLEMS[name]
    if any(isinstance(one, Solver) and one.tolerance > 1e-8 for one in problem.records):
        return False
    try:
        case_in(problem, turned_world(problem))
    except CannotTurnError:
        return False
    return problem.keys["model"] != "axisymmetric"


#: tangents of friction in space depend on the axes of the mesh, by which faces of a macro-element bend
APART = ("given up", "dragged in space")


@each(name for name in PROBLEMS if name not in APART and turns(name))
def test_turned(name):
    problem = PROBLEMS[name]
    check_in(name, case_in(problem, turned_world(problem)), turned_world(problem), iterations=False)


@SOLVED
def test_in_another_order(name):
    """Nodes, cells, blocks, groups and records in another order."""
    problem = PROBLEMS[name]
    mesh, place = permuted(problem.mesh(), seed=1)
    check_in(name, case_in(problem, World(), mesh, reverse=True), World(), place, iterations=False)
