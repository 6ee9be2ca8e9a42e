"""Macro-elements of which the master covers little: an overlap is allowed that grows as the covered part vanishes."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from lacsolver.case import parse_case
from lacsolver.contact.sliver import allowed_overlap
from lacsolver.equilibrium.alternating import alternating
from lacsolver.equilibrium.search import Outcome
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.problem.problem import Problem
from lacsolver.saddle.contact_system import contact_system
from verification.families.punches import text
from verification.meshes.punches import FACE, Punch, punched

#: a punch from one node of the block to another, two faces wide
ALIGNED = Punch((3 * FACE,), 2 * FACE, 4, 0.2, 0.3)


def problem_of(punch, steps=1, more=""):
    return Problem.of(
        parse_case(text("top", punch, steps).replace("[[contact]]", f"[[contact]]\n{more}")), punched(punch)
    )


def answer(punch, steps, more=""):
    """(last state, iterations of all steps)."""
    states = list(march(problem_of(punch, steps, more)))
    return states[-1], sum(state.iterations for state in states)


def over(covered, dim=2):
    """The interface, and its problem, of a punch that covers such a part of the macro-element before it, undeformed."""
    punch = Punch((3 * FACE - covered * FACE,) * (dim - 1), 2 * FACE, 2, 0.2, 0.3)
    problem = Problem.of(parse_case(text("top", punch, 1)), punched(punch))
    (pair,) = problem.joints
    return problem, pair, pair.integrate(problem.space, np.zeros(problem.space.n_dof), 1.0)


@pytest.mark.parametrize("steps", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_a_corner_on_a_node_has_one_answer_in_any_number_of_steps(steps):
    (once, _), (again, iterations) = answer(ALIGNED, 1), answer(ALIGNED, steps)
    assert np.abs(again.u - once.u).max() < 1e-9 * np.abs(once.u).max()
    assert iterations <= 4 * steps


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("measure", ["reference", "current"])
def test_the_derivative_of_what_is_allowed(dim, measure):
    """Gaps of slivers, against central differences, with a punch that turns and a block that stretches."""
    punch = Punch((3 * FACE - 0.02 * FACE,) * (dim - 1), 2 * FACE, 2, 0.2, 0.3)
    given = text("top", punch, 1).replace("[[contact]]", f'[[contact]]\nmeasure = "{measure}"')
    problem = Problem.of(parse_case(given), punched(punch))
    rng, h = np.random.default_rng(0), 1e-7
    u, v = 2e-3 * rng.uniform(-1, 1, problem.space.n_dof), rng.uniform(-1, 1, problem.space.n_dof)

    def system(u):
        return contact_system(problem, [pair.integrate(problem.space, u, 1.0) for pair in problem.joints], u)

    here, before, after = system(u), system(u - h * v), system(u + h * v)
    few = here.above_threshold & (here.groups[0].face.coverage < 0.04)
    assert few.any() and allowed_overlap(here.groups[0].face, problem.joints[0].pairing)[0][few].min() > 0
    off = here.rows.D @ v + (after.G - before.G) / (2 * h)
    assert np.abs(off[few]).max() < 1e-6 * np.abs(here.rows.D[few] @ v).max()


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("covered", [0.01, 0.04, 0.06, 0.5])
def test_a_twentieth_is_covered_or_an_overlap_is_allowed(dim, covered):
    """0.1 h (1 - r)^2 / r where r, the covered part over a twentieth, is below 1, and nothing elsewhere."""
    _, pair, face = over(covered, dim)
    r = np.minimum(np.where(face.w > 0, face.coverage / 0.05, 1.0), 1.0)
    assert r.min() <= covered / 0.05 + 1e-9 and (r.min() < 1) == (covered < 0.05 or (dim == 3 and covered**2 < 0.05))
    expected = np.where(face.w > 0, 0.1 * face.length * (1 - r) ** 2 / r * face.w, 0.0)
    np.testing.assert_allclose(allowed_overlap(face, pair.pairing)[0], expected, rtol=1e-9, atol=1e-16)


def test_a_small_master_is_no_sliver():
    """All of a master that is less than a twentieth of a macro-element: its part that counts is its own."""
    _, pair, face = over(0.5)
    small = replace(face, zone=replace(face.zone, master=face.zone.master.at(0.02 * face.zone.master.x)))
    assert allowed_overlap(replace(small, w=np.full_like(face.w, 0.02)), pair.pairing)[0].max() == 0


def test_what_is_reported_is_the_true_gap():
    punch = replace(ALIGNED, corner=(3 * FACE - 0.02,))
    state, _ = answer(punch, 2)
    (zone,) = state.zones
    few = (zone.coverage > 0) & (zone.coverage < 0.05)
    assert np.nanmin(zone.gap[~few]) > -1e-9 and (not few.any() or np.isfinite(zone.gap[few]).all())


def test_a_search_that_goes_to_and_fro_ends_soon_and_says_where():
    """A block that is squeezed out sideways, until a few faces of it carry all of the punch."""
    told = []
    deep = replace(ALIGNED, depth=1.5)  # at which all processors end alike: other searches without an end are chaotic
    case = text("top", deep, 5) + "\nmax_halvings = 0"
    with pytest.raises(NotConvergedError) as error:
        list(march(Problem.of(parse_case(case), punched(deep)), progress=told.append))
    assert max(Counter(each.time for each in told).values()) < 40
    message = str(error.value)
    assert "of the macro-elements of contact 'top'" in message and "exchange slave and master" in message, message
    assert 'normals = "smoothed"' in message and 'geometry = "reference"' in message


@pytest.mark.parametrize(
    "covered, active, says, tries",
    [
        ([0, 1, 0, 1], [0, 1, 0, 1], "1 of the .* pair and unpair in turn, as the one at .* between 0 and 0.8", True),
        ([1, 0.5, 1, 1], [1, 1, 1, 1], "now more, now less, as the one at .* between 0.4 and 0.8", True),
        ([1, 1, 1, 1], [0, 1, 0, 1], "close and open in turn", False),
        ([0, 0.5, 1, 1], [0, 1, 1, 1], None, False),
    ],
)
def test_what_alternates_is_told(covered, active, says, tries):
    """One macro-element, covered by 0.8 times these parts in the last iterations."""
    problem, _, face = over(0.8)
    contact = contact_system(problem, [face], np.zeros(problem.space.n_dof))
    recent = [(own * face.w, np.full(len(face.w), bool(on))) for own, on in zip(covered, active, strict=True)]
    chosen = np.arange(len(face.w)) == np.flatnonzero((face.coverage > 0.5) & (face.coverage < 0.9))[0]
    recent = [(np.where(chosen, w, face.w), chosen & on) for w, on in recent]
    what, advice = alternating(Outcome(False, None, contact, (), 0, 0, tuple(recent)), problem.space)
    assert (re.search(says, what) is not None) if says else what == ""
    assert ("exchange slave and master" in advice) == tries
