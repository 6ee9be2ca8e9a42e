"""Direction of contact: that of a plane master, where faces of the slave are at an angle to it."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver.case import parse_case
from lacsolver.problem.problem import Problem
from lacsolver.results.dipping import dipped
from lacsolver.results.state import ZoneState
from verification.families.friction_moving import solve_in_groove, solve_on_table
from verification.meshes.sliding import in_groove

GROOVE = """
mesh = "groove.msh"
model = "plane_strain"
[[material]]
young = 1.0
poisson = 0.3
[[contact]]
slave = "{}"
master = "{}"
"""


def test_a_block_that_slides_on_a_table_is_held_back_by_mu():
    """Coulomb: where all slides the quotient of the forces is the coefficient, though the last face tilts."""
    (ratio, *_) = solve_on_table(0.5, 8, levels=1).results
    assert ratio.value == pytest.approx(0.5, rel=1e-6)


def test_an_edge_that_folds_under_keeps_its_friction():
    """The last face turns by more than a right angle under its friction, and the block does not lose its table."""
    (ratio, *_) = solve_on_table(0.9, 6, levels=1).results
    assert ratio.value == pytest.approx(0.9, rel=1e-6)


@pytest.mark.parametrize("slave", ["round", "flank"])
def test_a_round_body_presses_along_the_normal_of_a_groove(slave):
    (ratio, *_) = solve_in_groove(slave, "reference", 8, levels=1).results
    assert ratio.value == pytest.approx(1, rel=1e-9)


@pytest.mark.parametrize("slave, normals", [("round", "master"), ("flank", "facet")])
def test_the_plane_side_gives_the_direction(slave, normals):
    master = "flank" if slave == "round" else "round"
    problem = Problem.of(parse_case(GROOVE.format(slave, master)), in_groove(4))
    assert [pair.pairing.normals for pair in problem.joints] == [normals]


def test_an_edge_that_dips_into_its_master_is_warned_of():
    """Half of the skin is above, half below the master: the mean gap is zero."""
    problem = Problem.of(parse_case(GROOVE.format("round", "flank")), in_groove(4))
    n = problem.joints[0].zone.n_macros
    zeros, vectors = np.zeros(n), np.zeros((n, 2))

    class At:
        time = 1.0
        zones = (
            ZoneState(
                "round", False, zeros, vectors, zeros, np.ones(n, np.int8), zeros, zeros, vectors, vectors, vectors,
                dip=np.where(np.arange(n) == 1, 0.25, 0.05),
            ),
        )  # fmt: skip

    (message,) = dipped(problem, At)
    assert "is inside its master by" in message and "25 % of a macro-element" in message
