"""Laws that hold for every problem of the corpus: its answer, and that the answer is the same however it is asked for.

A law is a test over `PROBLEMS`; a problem for which it has no meaning is left out by what it is, not by its name.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import MISSING, replace
from functools import cache

import numpy as np
import pytest

import lacsolver as ls
from lacmesh.errors import LacmeshError, LacmeshWarning
from lacsolver.case import Case, read_case
from lacsolver.case.formula import Formula
from lacsolver.case.keys import defaults_of, keys_of, sections_of
from lacsolver.case.kinds import Choice
from lacsolver.case.value import Value
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.output import create_output, read_state
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from tests.answers import ANSWERS, Ran
from tests.lacsolver.invariant_cases import permuted
from tests.problems import PROBLEMS, case_of

pytestmark = [
    pytest.mark.filterwarnings(f"ignore:{words}:lacmesh.errors.LacmeshWarning")
    for words in (
        ".* small kinematics takes displacements for small",
        "tie .* across a gap of up to",
        "steps are too long for the energy that friction takes",
        "massless nodes change the inertia",
    )
]
EVERY = pytest.mark.parametrize("name", PROBLEMS)
#: problems whose run finds an equilibrium
SOLVED = pytest.mark.parametrize("name", [name for name in PROBLEMS if name != "given up"])


def ran(case, folder, mesh=None):
    """Run a case; an equilibrium that is not found is kept."""
    done = Ran(case, case.mesh if mesh is None else mesh, folder)
    try:
        run(case, create_output(folder), mesh=mesh, progress=done.told.append)
    except NotConvergedError as error:
        done.error = error
    return done


@cache
def states_of(name):
    """The converged states of a problem as it stands."""
    return tuple(march(Problem.of(PROBLEMS[name].case(), PROBLEMS[name].mesh())))


# ---- the answer


@EVERY
def test_the_answer(name, tmp_path):
    ANSWERS[name](ran(PROBLEMS[name].case(), tmp_path / "out"))


@SOLVED
def test_solve_and_march_and_run_are_one(name, tmp_path):
    """What is solved in memory is what a run writes, to the last bit: displacements, pressures, states."""
    case, states = PROBLEMS[name].case(), states_of(name)
    done = run(case, create_output(tmp_path / "out"))
    assert done.status == "done" and [step.time for step in done.steps] == [state.time for state in states]
    written, last = read_state(tmp_path / "out", case, mesh=case.mesh), states[-1]
    np.testing.assert_array_equal(written.u, last.u)
    np.testing.assert_array_equal(written.step.iterate.p, last.step.iterate.p)
    solution = ls.solve(case)
    np.testing.assert_array_equal(solution.u.ravel(), last.u)
    assert list(solution.contact) == [zone.name for zone in last.zones]
    assert_read(tmp_path / "out", solution)


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


@pytest.mark.parametrize("name", [name for name in PROBLEMS if len(PROBLEMS[name].case().steps.planned) > 1])
def test_a_run_that_goes_on_is_one_that_did_not_stop(name, tmp_path):
    """From the state after the first step, to the last bit."""
    case, states = PROBLEMS[name].case(), states_of(name)
    done = run(case, create_output(tmp_path / "whole"))
    first = min(int(path.stem.removeprefix("state_")) for path in (tmp_path / "whole").glob("state_*.npz"))
    start = read_state(tmp_path / "whole", case, done.steps[first - 1].time, mesh=case.mesh)
    for again, state in zip(march(Problem.of(case, case.mesh), start=start), states[first:], strict=True):
        np.testing.assert_array_equal(again.u, state.u)
        np.testing.assert_array_equal(again.step.iterate.p, state.step.iterate.p)


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
    for section, record in {"": Case, **sections_of(Case)}.items():
        defaults = defaults_of(record)
        for key, row in keys_of(record).items():
            if (section, key) not in ELSEWHERE:
                yield section, key
                options = row.kind.options if isinstance(row.kind, Choice) else ()
                settled = {defaults[key], SETTLED.get(key)}
                yield from ((section, key, option) for option in options if option not in settled)


def without(name, section, key, option=None):
    """Yield the cases of a problem in each of which one record has the default of a key in place of its own value."""
    problem = PROBLEMS[name]
    if not section:
        if key in problem.keys and option in (None, problem.keys[key]):
            rest = {k: v for k, v in problem.keys.items() if k != key}
            yield lambda: case_of(problem.mesh(), *problem.records, **rest)
        return
    for k, record in enumerate(problem.records):
        default, own = defaults_of(record)[key] if record.SECTION.name == section else MISSING, None
        if default is MISSING:
            if record.SECTION.name == section:
                yield lambda k=k: problem.case([r for j, r in enumerate(problem.records) if j != k])
            continue
        own = getattr(record, key)
        if own != default and option in (None, own):
            records = list(problem.records)
            yield lambda records=records, k=k, record=record, default=default: problem.case(
                [replace(record, **{key: default}) if j == k else one for j, one in enumerate(records)]
            )


def is_right(name, make, folder):
    """True if a case has the answer of a problem; one that is refused has not."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LacmeshWarning)
        try:
            ANSWERS[name](ran(make(), folder))
        except (LacmeshError, AssertionError, LookupError, FileNotFoundError, TypeError):
            return False
    return True


@pytest.mark.parametrize("place", list(keys()), ids=".".join)
def test_every_key_has_an_effect(place, tmp_path):
    """Some problem has the key, and another answer, or none, without it."""
    tried = 0
    for name in PROBLEMS:
        for make in without(name, *place):
            tried += 1
            if not is_right(name, make, tmp_path / f"{tried}"):
                return
    pytest.fail(f"{tried} problems have it, and none needs it")


# ---- the same in other units, elsewhere, in another order

#: exponents of length, stress and time in each dimension; a mass is stress × length × time²
DIMENSIONS = {
    "": (0, 0, 0), "1": (0, 0, 0), "length": (1, 0, 0), "stress": (0, 1, 0), "time": (0, 0, 1), "force": (2, 1, 0),
    "mass": (1, 1, 2), "temperature": (0, 0, 0), "degree": (0, 0, 0), "radian": (0, 0, 0),
}  # fmt: skip
POWERS = {"": 1, "²": 2, "³": 3}


def factor(unit, scales):
    """Factor of a value whose unit is a product such as `mass / length³` where length, stress, time have factors."""
    total = np.zeros(3)
    above, *below = unit.split(" / ")
    for sign, words in ((1, above), *((-1, part) for part in below)):
        for word in words.split(" × "):
            name, power = re.fullmatch(r"(.*?)([²³]?)", word).groups()
            total += sign * POWERS[power] * np.array(DIMENSIONS[name])
    return float(np.prod(np.asarray(scales) ** total))


def scaled(value, size, scales):
    """A value of a key in other units: numbers, tables of time, and formulas of x, y, z and t."""
    length, _, time = scales
    if isinstance(value, Value):
        return scaled(value.source, size, scales)
    if isinstance(value, (str, Formula)):
        text = value if isinstance(value, str) else value.text
        own = {**dict.fromkeys("xyz", length), "t": time}
        moved = re.sub(r"\b[xyzt]\b", lambda m: f"({m[0]} / {own[m[0]]!r})", text)
        return f"{size!r} * ({moved})"
    if isinstance(value, (tuple, list)):
        if value and isinstance(value[0], (tuple, list)):  # a table of time
            return [[t * time, scaled(v, size, scales)] for t, v in value]
        return [scaled(v, size, scales) for v in value]
    return None if value is None else value * size


#: keys of rows with two units, and of axes, whose origin is a place
PAIRS = {"hardening", "pressures"}


def record_in(record, scales):
    """A record in other units."""
    changes = {}
    for name, key in keys_of(record).items():
        value, units = getattr(record, name), key.unit.split(", ")
        if value is None or (not key.unit and name not in ("axes", "terms", "weights")):
            continue
        if name == "end" and record.times:
            continue
        if name in PAIRS:
            changes[name] = [[v * factor(u, scales) for v, u in zip(row, units, strict=True)] for row in value]
        elif name == "rayleigh":
            changes[name] = [v * factor(u, scales) for v, u in zip(value, units, strict=True)]
        elif name == "axes":
            if isinstance(value, dict) and "origin" in value:
                changes[name] = {**value, "origin": [c * scales[0] for c in value["origin"]]}
        elif name == "terms":
            changes[name] = [
                {**term, "at": [c * scales[0] for c in term["at"]]} if term.get("at") else dict(term) for term in value
            ]
        else:
            changes[name] = scaled(value, factor(units[0], scales), scales)
    return replace(record, **changes)


def case_in(problem, scales):
    """The case of a problem whose lengths, stresses and times are so many times larger."""
    case, mesh = problem.case(), problem.mesh()
    records = [record_in(one, scales) for one in problem.records]
    if not any(one.SECTION.name == "steps" for one in problem.records):
        records.append(record_in(case.steps, scales))
    keys = dict(problem.keys)
    if case.model in ("plane_strain", "plane_stress"):
        keys["thickness"] = keys.get("thickness", 1.0) * scales[0]
    return case_of(replace(mesh, points=mesh.points * scales[0]), *records, **keys)


UNITS = {"mm in m": (1e-3, 1.0, 1.0), "m in μm": (1e6, 1e-12, 1.0), "forces": (1.0, 1e9, 1.0), "slow": (1.0, 1.0, 1e4)}


def assert_same(name, states, scales=(1.0, 1.0, 1.0), place=slice(None), iterations=True):
    """States are those of a problem, in units that are `scales` times as large, with its nodes in other places."""
    mesh = PROBLEMS[name].mesh()
    for one, other in zip(states_of(name), states, strict=True):
        u, v = (state.u.reshape(-1, mesh.space_dim)[: mesh.n_nodes] for state in (one, other))
        assert np.abs(v[place] / scales[0] - u).max() <= 1e-8 * max(np.abs(u).max(), 1e-300)
        assert one.iterations == other.iterations or not iterations
        zones = {zone.name: zone for zone in other.zones}
        for own in one.zones:
            p, q = np.sort(own.pressure), np.sort(zones[own.name].pressure) / scales[1]
            assert sorted(own.status) == sorted(zones[own.name].status)
            assert np.abs(p - q).max() <= 1e-8 * max(np.abs(p).max(), 1e-300)


@pytest.mark.parametrize("units", UNITS)
@SOLVED
def test_in_other_units(name, units):
    """Lengths, forces and times in other units: the same answer in the same iterations."""
    case = case_in(PROBLEMS[name], UNITS[units])
    assert_same(name, march(Problem.of(case, case.mesh)), UNITS[units])


@SOLVED
def test_in_another_order(name):
    """Nodes, cells, blocks, groups and records in another order."""
    problem = PROBLEMS[name]
    mesh, place = permuted(problem.mesh(), seed=1)
    case = problem.case(problem.records[::-1], mesh)
    assert_same(name, march(Problem.of(case, mesh)), place=place, iterations=False)
