"""Thin plates that part: strips, leaf springs, a share of the bank; and a plate that tips over."""

import numpy as np
import pytest

from lacsolver import NotConvergedError
from verification.families import peeling
from verification.meshes.plates import plates
from verification.solving import case_text, entry, solve


@pytest.mark.parametrize(("solve_case", "faces"), [(peeling.solve_strips, 30), (peeling.solve_lifted, 240)])
def test_a_strip_peels_in_few_systems(solve_case, faces):
    assert all(result.passed for result in solve_case(faces, levels=1).results)


def test_leaves_part_in_one_step():
    assert all(result.passed for result in peeling.solve_leaves(2, False, 40, levels=1).results)


@pytest.mark.slow
@pytest.mark.parametrize("count, most", [(2, 100), (3, 160)])
def test_leaves_part_in_one_step_with_finite_kinematics(count, most):
    assert all(result.passed for result in peeling.solve_leaves(count, True, most, levels=1).results)


@pytest.mark.filterwarnings("ignore::lacmesh.errors.LacmeshWarning")  # of stiff plates with fine faces
@pytest.mark.parametrize(
    "first, count",
    [
        (0, 3),
        (4, 3),
        (15, 1),  # tensions within the tolerance carry 1 %
        (138, 1),  # round-off of forces along a rigid motion, more than the tolerance if one unknown has all of it
        (242, 1),  # bodies that move by 1e-8 and by 0.1: the norm of gaps falls while the largest ratio does not
        pytest.param(150, 1, marks=pytest.mark.slow),
    ],
)
def test_random_stacks_have_an_equilibrium(first, count):
    lost, halved, *_ = peeling.solve_bank(first, levels=count).results
    assert lost.passed and halved.passed


def tipping(count):
    """A plate of 10 on a table, whose end is pulled up by more than its weight."""
    text = case_text(
        "plane_strain",
        entry("material", groups=["plate1"], young=1e5, poisson=0.3),
        entry("contact", slave="under1", master="table"),
        entry("rigid", group="table"),
        entry("body_force", groups=["plate1"], fy=-0.01),
        entry("displacement", at=[0.0, 0.0], ux=0.0),
        entry("force", at=[10.0, 0.5], fy=0.04),
    )
    return text, plates([(np.array([0.0, 0.0]), np.array([10.0, 0.5]))], [(count, 1)], table=True)


def test_a_plate_that_tips_over_is_not_told_to_take_more_steps():
    """Nor is its step halved: the problem is convex, and a part of the step is as hard."""
    with pytest.raises(NotConvergedError) as caught:
        solve(*tipping(10))
    assert "more steps" not in str(caught.value)
    assert caught.value.state.time == 1.0
