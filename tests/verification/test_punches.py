"""Punches with sharp corners: a share of the bank, and the meshes."""

from dataclasses import replace

import numpy as np
import pytest

from verification.families import punches
from verification.meshes.punches import ABOVE, punched, random_punch

CASES = {case.name: case for case in punches.FAMILY.cases}


@pytest.mark.parametrize("dim", [2, 3])
def test_the_punch_is_over_the_block(dim):
    punch = random_punch(dim, 1)
    mesh = punched(punch)
    face = mesh.points[mesh.nodes_of("face")] if hasattr(mesh, "nodes_of") else None
    assert face is None or np.allclose(face[:, dim - 1], ABOVE)


@pytest.mark.parametrize("name, number", [("plane_block_1", 1), ("plane_block_1", 3), ("space_block", 3)])
def test_a_punch_has_one_answer_in_any_number_of_steps(name, number):
    case = CASES[name]
    case = replace(case, parameters=replace(case.parameters, first=number))
    assert all(result.passed for result in punches.solve_case(case, 1).results)
