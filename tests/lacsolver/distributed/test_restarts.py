"""States of a motion: written by some processes, and gone on from by others, as one process does."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from tests.lacsolver.distributed.mpi import in_ranks
from tests.lacsolver.distributed.restarts import solved

pytestmark = [pytest.mark.petsc, pytest.mark.filterwarnings("ignore:massless nodes change")]  # few cells
PROGRAM = "from tests.lacsolver.distributed.restarts import main; main()"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folders of the whole motion and of its second half: by one process, and by others after others."""
    place = tmp_path_factory.mktemp("motions")
    solved(place / "one")
    done = in_ranks(3, PROGRAM, place / "three", place / "two_after_three", place / "one", timeout=300)
    assert done.returncode == 0, done.stderr
    solved(place / "one_after_three", place / "three")
    return place


@pytest.mark.parametrize("name", ["three", "two_after_three", "one_after_three", "two_after_one"])
def test_a_motion_goes_on_with_any_number_of_processes(folder, name):
    found, expected = (rows(folder / other / "history.csv") for other in (name, "one"))
    assert list(found) == list(expected) and len(found["time"]) in (8, 16)
    for key, values in expected.items():
        alike = [v for k, v in expected.items() if k.rsplit(".", 1)[0] == key.rsplit(".", 1)[0]]
        size = max(np.abs(v).max() for v in alike)
        assert np.abs(found[key] - values[-len(found[key]) :]).max() <= 1e-9 * size, key


@pytest.mark.parametrize("name", ["three", "two_after_three", "one_after_three", "two_after_one"])
def test_its_state_is_that_of_one_process(folder, name):
    with np.load(folder / "one" / "state_0016.npz") as one, np.load(folder / name / "state_0016.npz") as other:
        assert set(one) == set(other) and "scheme_10" in other
        for key in set(one) - {"about"}:
            size = np.abs(one[key]).max(initial=0.0)
            np.testing.assert_allclose(other[key], one[key], rtol=0, atol=1e-9 * size, err_msg=key)


def rows(path):
    """The columns of a table; static steps have no values of a motion."""
    with path.open() as file:
        told = [{key: float(value or 0.0) for key, value in row.items()} for row in csv.DictReader(file)]
    return {key: np.array([row[key] for row in told]) for key in told[0] if key != "iterations"}
