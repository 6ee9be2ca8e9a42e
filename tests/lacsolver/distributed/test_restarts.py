"""States of a motion: written by some processes, and gone on from by others, as one process does."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from tests.lacsolver.distributed.mpi import in_ranks
from tests.lacsolver.distributed.restarts import MIDDLE, solved

pytestmark = [pytest.mark.petsc, pytest.mark.filterwarnings("ignore:massless nodes change")]  # few cells
PROGRAM = "from tests.lacsolver.distributed.restarts import main; main()"


FOLDERS = ("three", "two_after_three", "one_after_three")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """For each case, folders of the motion and of its second half: by one process, and by others after others."""
    place = tmp_path_factory.mktemp("motions")
    for name in MIDDLE:
        (place / name).mkdir()
        solved(name, place / name / "one")
    done = in_ranks(3, PROGRAM, place, timeout=300)
    assert done.returncode == 0, done.stderr
    for name in MIDDLE:
        solved(name, place / name / "one_after_three", place / name / "three")
    return place


@pytest.mark.parametrize("other", FOLDERS)
@pytest.mark.parametrize("name", MIDDLE)
def test_a_motion_goes_on_with_any_number_of_processes(folder, name, other):
    found, expected = (rows(folder / name / one / "history.csv") for one in (other, "one"))
    kept = expected["time"] > (MIDDLE[name] if "after" in other else 0.0) + 1e-9
    assert list(found) == list(expected) and 0 < len(found["time"]) == kept.sum()
    for key, values in expected.items():
        alike = [v for k, v in expected.items() if k.split(".")[0] == key.split(".")[0]]
        size = max(np.abs(v).max() for v in alike)
        assert np.abs(found[key] - values[kept]).max() <= 1e-9 * size, key


@pytest.mark.parametrize("other", FOLDERS)
@pytest.mark.parametrize("name", MIDDLE)
def test_its_state_is_that_of_one_process(folder, name, other):
    last = max(path.name for path in (folder / name / "one").glob("state_*.npz"))
    with np.load(folder / name / "one" / last) as one, np.load(folder / name / other / last) as found:
        assert set(one) == set(found) and "scheme_10" in found
        for key in set(one) - {"about"}:
            size = np.abs(one[key]).max(initial=0.0)
            if key == "scheme_2":  # reactions, which are noise where nothing is held, beside forces
                size = max(size, np.abs(one["scheme_5"]).max())
            np.testing.assert_allclose(found[key], one[key], rtol=0, atol=1e-9 * size, err_msg=key)


def rows(path):
    """The columns of a table; static steps have no values of a motion."""
    with path.open() as file:
        told = [{key: float(value or 0.0) for key, value in row.items()} for row in csv.DictReader(file)]
    return {key: np.array([row[key] for row in told]) for key in told[0] if key != "iterations"}
