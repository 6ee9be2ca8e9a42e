"""Laws with a history in several processes: what one process finds, and states that any number of them goes on from."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.lacsolver.distributed.histories import solved
from tests.lacsolver.distributed.mpi import in_ranks

pytestmark = pytest.mark.petsc
PROGRAM = "from tests.lacsolver.distributed.histories import main; main()"


def in_several(n, *folders):
    """Run the program."""
    done = in_ranks(n, PROGRAM, *folders, timeout=300)
    assert done.returncode == 0, done.stderr


def energies(folder):
    """Energy at the end, and the histories in the last state."""
    told = json.loads((folder / "results.json").read_text())
    with np.load(folder / "state_0003.npz") as file:
        return told["energy"], [file[name] for name in sorted(file) if name.startswith("materials_")]


def test_histories_are_those_of_one_process_and_go_on(tmp_path):
    one, three = tmp_path / "one", tmp_path / "three"
    solved(one)
    in_several(3, three)
    in_several(2, tmp_path / "two_after_one", one)
    solved(tmp_path / "one_after_three", three)
    energy, histories = energies(one)
    assert len(histories) > 1 and all(values.max() > 1e-6 for values in histories)
    for name in ("three", "two_after_one", "one_after_three"):
        other, found = energies(tmp_path / name)
        assert other == pytest.approx(energy, rel=1e-9)
        for values, expected in zip(found, histories, strict=True):
            np.testing.assert_allclose(values, expected, rtol=0, atol=1e-9 * expected.max())
