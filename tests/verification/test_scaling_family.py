"""Exponents of stages: of seconds that are known, and that every stage can be timed."""

from __future__ import annotations

import time

import numpy as np
import pytest

from verification.families import scaling
from verification.families.scaling import FAMILY, BenchmarkStages, seconds_of, timed
from verification.records import levels_of


class Sized:
    def __init__(self, n):
        self.cells, self.faces, self.unknowns = 10 * n, 4 * n, 30 * n


@pytest.mark.parametrize("power, passed", [(1.0, True), (1.04, True), (1.06, False), (2.0, False)])
def test_an_exponent_is_judged(power, passed):
    problems = [Sized(n) for n in (1, 4, 16)]
    for stage in scaling._STAGES:
        result = scaling._judged(stage, problems, [3 * one.cells**power for one in problems])
        assert result.value == pytest.approx(power) and result.passed is passed
        assert [level.rate for level in result.levels[1:]] == pytest.approx([power] * 2)


def test_sizes_grow_sixteenfold_and_nothing_runs_beside():
    for case in FAMILY.cases:
        assert case.exclusive
        for count in case.levels.values():
            sides = case.parameters["sides"][:count]
            assert len(sides) == count and (sides[-1] / sides[0]) ** 2 >= 16


def test_seconds_are_those_that_the_process_works():
    def work():
        end = time.process_time() + 0.05
        while time.process_time() < end:
            pass
        time.sleep(0.05)

    whole, own = seconds_of(work, 0.0)
    assert 0.03 < whole < 0.09 and own <= whole


def test_every_stage_is_timed(monkeypatch):
    kept = {"ROUNDS": 1, "_SOLVED": (2, 4), "_clock": lambda: (time.process_time(), 0.0)}
    for name, value in kept.items():
        monkeypatch.setattr(scaling, name, value)
    monkeypatch.setattr(scaling.seconds_of, "__defaults__", (0.0,))
    monkeypatch.setattr(scaling.gc, "collect", lambda: None)
    outcome = scaling.run("HEXA8", (4, 6), levels=2)
    names = [result.quantity for result in outcome.results]
    assert names[::2] == [f"exponent of {stage}" for stage in (*scaling._STAGES, "the solve")]
    assert [line.label for line in outcome.plots[0].lines] == [*scaling._STAGES, "solve"]
    one = BenchmarkStages.of("HEXA8", 4)
    seconds = timed([one])
    assert seconds.shape == (2, 4, 1) and (seconds >= 0).all() and np.isfinite(seconds).all()
    assert one.faces == 4 * 4 * 4 + 3 * 3 and levels_of([1, 2], [1, 2], [1.0, 2.0])[1].rate == 1
