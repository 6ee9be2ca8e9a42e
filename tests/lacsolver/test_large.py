"""The benchmark of large models at a small size: it runs, and its figures are what their names say."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from tests import REPOSITORY

sys.path.append(str(REPOSITORY / "benchmarks"))

import large


@pytest.fixture(scope="module")
def found():
    return large.measured(2500, "multigrid")


def test_the_figures_of_a_size(found):
    assert 2250 < found["unknowns"] < 4500
    assert 0 < found["closed"] < found["macros"]
    assert found["cycles"] <= 4 * found["alone"] and found["balance"] <= 1e-12
    phases = found["wall"]
    parts = phases["search and integration"] + phases["set-up"] + phases["loops"]
    assert 0.3 * phases["contact"] < parts <= phases["contact"]
    assert 0.05 < found["memory"] < 2.0
    row = large.line(found)
    assert row.count("|") == 12 and f"{found['cycles']} V-cycles" in row


@pytest.mark.filterwarnings("ignore:contact 'slave'. slave 'slave' is stiffer than master")
@pytest.mark.parametrize("ratio", [100.0, pytest.param(0.01, marks=pytest.mark.slow)])
def test_the_ratio_of_stiffnesses_hardly_matters(found, ratio):
    other = large.measured(2500, "multigrid", ratio=ratio)
    assert other["cycles"] / other["iterations"] <= 1.3 * found["cycles"] / found["iterations"]
    assert 0 < other["closed"] < other["macros"]


def test_sizes_are_those_asked_for():
    for wanted in large.SIZES + large.QUICK:
        n = large.side(wanted)
        assert 0.95 * wanted < 3 * (n * n + (n - 3) ** 2) * (n // 2) < 1.35 * wanted


def test_an_exponent_is_a_slope():
    n = [10.0, 100.0, 1000.0]
    assert large.exponent(n, [3 * k**1.5 for k in n]) == pytest.approx(1.5)
    grown = [
        {
            "unknowns": k,
            "memory": 4 * k / 2**20,
            "cpu": dict.fromkeys(("assembly", "set-up", "loops", "contact"), k**1.1),
        }
        for k in n
    ]
    for one in grown:
        one["cpu"] |= {"set-up of K alone": one["unknowns"], "solution of K alone": one["unknowns"]}
    said = large.growth(grown)
    assert "contact 1.10" in said and "K alone 1.00" in said and "memory 4.0 kB" in said


def test_the_clock_counts_what_it_is_put_around():
    clock, kept = large.Clock(), []
    work = clock.around("sum", np.sum, kept)
    assert work([1, 2]) == 3 and work([3, 4]) == 7 and kept == [3, 7]
    assert set(clock.wall) == set(clock.cpu) == {"sum"} and clock.wall["sum"] > 0
