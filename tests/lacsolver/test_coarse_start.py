"""First active set from the first coarser level: how near it is, and what it saves."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import lacsolver.equilibrium.attempt
from lacsolver.equilibrium.attempt import first_iterate
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.stepping import march
from lacsolver.saddle.coarse_start import _CoarseLevel, _joined, coarse_start
from lacsolver.saddle.tolerances import ConvergenceTolerance
from tests import REPOSITORY
from tests.lacsolver.test_coupled import moment

sys.path.append(str(REPOSITORY / "benchmarks"))

from contact import pressed
from meshes import blocks

TOLERANCE = ConvergenceTolerance(1e-10, 50, 0.0)


@pytest.fixture(scope="module")
def hertz():
    """A block with a clearance of r^2 / 2R over another one, before its step: the problem, and the step."""
    problem = pressed(blocks(14, 11, 7), "multigrid")
    return problem, LoadStep(ReducedProblem(problem), 1.0)


def test_the_coarse_level_is_that_of_the_prolongation(hertz):
    """P^T, P, P^T K P and B P belong together, to single precision."""
    _, step = hertz
    K = step.reference
    coarse = _CoarseLevel.of(K)
    rng = np.random.default_rng(0)
    v, f = rng.normal(size=len(coarse.K.R)), rng.normal(size=len(K.R))
    q, B = coarse.prolonged(v), step.contact(np.zeros(len(K.R))).rows.B
    assert len(v) < len(q) / 4
    assert coarse.restricted(f) @ v == pytest.approx(f @ q, rel=1e-4)
    assert v @ coarse.K.apply(v) == pytest.approx(q @ K.apply(q), rel=1e-5)
    np.testing.assert_allclose(coarse.rows(B) @ v, B @ q, atol=1e-5 * np.abs(B @ q).max())


def test_joined_rows_are_sums_of_the_rows_of_one_pair(hertz):
    _, step = hertz
    coarse, contact = _CoarseLevel.of(step.reference), step.contact(np.zeros(len(step.f)))
    joined, group = _joined(contact, coarse)
    assert len(group) == len(contact.G) and len(joined.G) < len(contact.G) / 2
    np.testing.assert_allclose(np.bincount(group, contact.G), joined.G, rtol=1e-12)
    assert joined.rows.w.sum() == pytest.approx(contact.rows.w.sum(), rel=1e-12)
    v = np.random.default_rng(0).normal(size=len(coarse.K.R))
    sums = np.bincount(group, coarse.rows(contact.rows.B) @ v)
    np.testing.assert_allclose(joined.rows.B @ v, sums, atol=1e-12 * np.abs(sums).max())


def test_the_first_set_is_near_the_last_and_the_state_is_the_same(hertz, monkeypatch):
    problem, step = hertz
    start = first_iterate(step)
    assert not start.active.any()
    near = coarse_start(step.reference, step.f, step.contact(start.q), start, TOLERANCE)
    *_, state = march(problem)
    closed = state.zones[0].status == 1
    assert (near.active != closed).sum() < 0.35 * closed.sum()
    assert np.linalg.norm(near.q - state.step.iterate.q) < 0.2 * np.linalg.norm(state.step.iterate.q)
    monkeypatch.setattr(lacsolver.equilibrium.attempt, "coarse_start", lambda K, f, contact, start, tolerance: start)
    *_, other = march(problem)
    assert np.array_equal(other.zones[0].status, state.zones[0].status)
    size = state.zones[0].pressure.max()
    np.testing.assert_allclose(other.zones[0].pressure, state.zones[0].pressure, atol=1e-8 * size)
    assert state.iterations <= other.iterations


def test_bodies_on_contact_alone_and_laws_with_a_history_start_as_they_are(hertz):
    floating = moment(6, backend="multigrid", free=True)
    start = first_iterate(floating)
    given = floating.reference, floating.f, floating.contact(start.q)
    assert coarse_start(*given, start, TOLERANCE) is start
    _, step = hertz
    start, contact = first_iterate(step), step.contact(np.zeros(len(step.f)))
    law = replace_law(contact, n_history=1)
    assert coarse_start(step.reference, step.f, law, start, TOLERANCE) is start
    assert coarse_start(step.reference, step.f, replace_law(contact, exact=True), start, TOLERANCE) is start
    assert coarse_start(step.reference, step.f, contact, start, TOLERANCE) is not start


def replace_law(contact, **members):
    """The contact system with a law that has other members."""
    group = contact.groups[0]
    law = type("Other", (type(group.law),), members)()
    return replace(contact, groups=(replace(group, law=law),))
