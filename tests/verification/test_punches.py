"""Punches with sharp corners: a share of the bank, and the meshes."""

import numpy as np
import pytest

from verification.families import punches
from verification.meshes.punches import ABOVE, punched, random_punch

CASES = {case.name: case for case in punches.FAMILY.cases}


def skin(mesh, name):
    return np.concatenate([mesh.points[nodes].reshape(-1, 3) for _, _, nodes in mesh.select(mesh.cell_groups[name])])


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("number", range(6))
def test_the_punch_is_over_the_block(dim, number):
    """Its face is inside the block's top, so that all that ends on the block are edges of the punch."""
    mesh = punched(random_punch(dim, number))
    face, top = skin(mesh, "face"), skin(mesh, "top")
    assert np.allclose(face[:, dim - 1], ABOVE) and np.allclose(top[:, dim - 1], 0.0)
    assert (face.min(axis=0) > top.min(axis=0))[: dim - 1].all() and (face.max(axis=0) < top.max(axis=0))[
        : dim - 1
    ].all()


@pytest.mark.parametrize("name, number", [("plane_block_1", 1), ("plane_block_1", 3), ("space_block", 3)])
def test_a_punch_has_one_answer_in_any_number_of_steps(name, number):
    case = CASES[name]
    dim, slave, *_ = case.solve.args
    assert all(result.passed for result in punches.solve_case(dim, slave, number, levels=1).results)
