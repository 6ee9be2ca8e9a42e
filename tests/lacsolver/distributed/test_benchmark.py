"""The benchmark of several processes at a small size: it runs, and its figures are what their names say."""

from __future__ import annotations

import sys

import pytest

from tests import REPOSITORY

sys.path.append(str(REPOSITORY / "benchmarks"))

import distributed

#: for `make verify`: a benchmark is no part of the packages
pytestmark = [pytest.mark.petsc, pytest.mark.slow]


def test_the_figures_of_two_processes(tmp_path):
    launcher = distributed.Launcher(sys.executable, tmp_path)
    serial = launcher.of(2000, 0, distributed.SERIAL)
    single, found = (launcher.of(2000, n, "multigrid") for n in (1, 2))
    assert len(single) == 1 and len(found) == 2
    assert sum(one["unknowns"] for one in found) == single[0]["unknowns"]
    for one in found:
        assert one["closed"] == single[0]["closed"] and 0 < one["cycles"] < 1.5 * serial[0]["cycles"]
        assert 0 < one["solve"] < one["cpu"]["contact"] and one["grown"] < one["memory"]
        messages, size, reductions = one["traffic"]
        assert messages > 0 and size > messages and reductions > 0
    assert single[0]["traffic"][:2] == [0, 0]
    line = distributed.strong_line("multigrid", 2, found, single, single)
    assert line.count("|") == len(distributed.HEADS) + 1
    assert distributed.weak_line("multigrid", 2, found).count("|") == len(distributed.WEAK_HEADS) + 1


@pytest.mark.parametrize("kind", distributed.MOVING)
def test_contact_that_moves_takes_the_same_iterations_and_each_process_has_its_points(tmp_path, kind):
    launcher = distributed.Launcher(sys.executable, tmp_path)
    serial, found = (
        launcher.of(2000, n, backend, moving=kind) for n, backend in ((0, distributed.SERIAL), (2, "multigrid"))
    )
    assert {one["sets"] for one in found} == {serial[0]["sets"]}
    assert sum(one["points"] for one in found) == pytest.approx(serial[0]["points"], rel=0.05)
    assert max(one["points"] for one in found) < 0.7 * serial[0]["points"]
    assert all(one["cpu"]["derivative"] > 0 for one in found)
    assert distributed.moving_line(kind, 2, found, serial).count("|") == len(distributed.MOVING_HEADS) + 1
