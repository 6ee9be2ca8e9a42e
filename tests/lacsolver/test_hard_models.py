"""Models that are hard to solve though they have an answer: bodies that hardly anything but contact holds, tiny loads.

The cases in `hard/` are small: a chain of blocks and blocks on soft springs, which contact stacks on one another, and a
block that stands on the top of a hump, on one macro-element.
"""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from lacmesh.errors import LacmeshWarning
from lacsolver.case import parse_case
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.state import CONTACT
from tests.lacsolver import finite_cases
from tests.lacsolver.contact_cases import HEAD, JOINT, by_node, check, held, nodes_of, pressed
from tests.lacsolver.patch_meshes import placed, stack
from tests.samples import each_option
from verification.meshes.stacks import tilt

HARD = Path(__file__).parent / "hard"


def states_of(name, change=lambda text: text):
    """(problem, states) of a case in `hard/`, each state checked: balance, conditions of contact to rounding.

    The gap is that between faces, as the cases were found with: where it is linear it is closed to rounding at once.
    """
    path = HARD / f"{name}.toml"
    text = path.read_text(encoding="utf-8").replace("[[contact]]", '[[contact]]\nsurface = "faces"')
    problem = Problem.of(parse_case(change(text), path))
    states, moved = list(march(problem)), 0.0
    for state in states:
        moved = max(moved, float(np.abs(state.u).max()))
        if problem.kinematics.linear:
            check(problem, state, moved)
        else:  # Newton's method ends at its tolerance, not at rounding
            finite_cases.check(problem, state)
    return problem, states


@pytest.mark.parametrize("stiffness", ["1e-3", "1e-6", "1e-9"])
def test_a_chain_of_blocks_on_soft_springs(stiffness):
    """The step that leaves blocks loose is not taken: all is closed within a few sets, however soft the springs are."""
    _, (state,) = states_of("chain", lambda text: text.replace("= 1e-3", f"= {stiffness}"))
    assert state.iterations <= 5 and state.halvings == 0
    for zone in state.zones:
        assert (zone.status == CONTACT).all()
        force = zone.pressure * zone.area * zone.coverage
        assert force.sum() == pytest.approx(1.7072, rel=1e-9)


@pytest.mark.parametrize(("number", "tolerance"), each_option(itertools.product((1, 2, 3), ("1e-6", "1e-10", "1e-14"))))
def test_blocks_on_soft_springs(number, tolerance):
    """Gaps close to rounding, whatever the tolerance: the noise of forces in balance does not move soft bodies."""
    _, states = states_of(f"soft_springs_{number}", lambda text: f"{text}\n[solver]\ntolerance = {tolerance}\n")
    assert sum(state.halvings for state in states) == 0
    assert max(state.iterations for state in states) <= 12


ROCKING = ("small_all", "small_v0.0005", "finite_all", "finite_count")


@pytest.mark.parametrize(("case", "normals"), [*((case, "slave") for case in ROCKING), ("finite_count", "facet")])
def test_a_block_that_rocks_on_one_macro_element(case, normals):
    """The contact force, which turns with its skin, rights the block: no second macro-element has to hold it.

    The master's direction keeps a block upright that starts so.
    """
    _, states = states_of(
        f"rocking_{case}", lambda text: text.replace("[[contact]]", f'[[contact]]\nnormals = "{normals}"')
    )
    assert all(state.halvings == 0 and state.iterations <= 20 for state in states)
    assert all((state.zones[0].status == CONTACT).sum() == 1 for state in states)


#: of the hump's facets: their length, and the difference of the mean gaps of the middle one and the next
FACET, NEXT_GAP = 1.3 / 7, 0.00086217 - 0.00017245


@pytest.mark.parametrize(
    ("case", "eccentricity", "young"),
    [
        *itertools.product(("small_all", "small_v0.0005", "finite_all"), (0.0, 0.02, -0.02), ("2000.0",)),
        ("finite_all", 0.02, "2e4"),
    ],
)
def test_a_block_that_tilts_until_the_next_macro_element_holds_it(case, eccentricity, young):
    """A force in the master's direction does not right the block: it tilts onto the next facet, which takes the moment.

    Statics: the force on that facet, of all, is the arm of the load over the length of a facet: its eccentricity, and
    with finite rotations the motion of the foot under the head.
    """

    def change(text):
        load = re.search(r"value = (.*)", text)[1]
        pressed = f'"{load} * (1 + {eccentricity} / 0.65 ** 2 * 3 * (x - 0.95))"'
        text = text.replace(f"value = {load}", f"value = {pressed}").replace("2000.0", young)
        return text + "\n[solver]\ntolerance = 1e-12\n"

    problem, states = states_of(f"rocking_{case}", change)
    assert all(state.halvings == 0 and state.iterations <= 20 for state in states)
    zone = states[-1].zones[0]
    other = set(np.flatnonzero(zone.status == CONTACT)) ^ {3}
    assert other in ({2}, {4})
    u, x = by_node(problem, states[-1])[:, 0], problem.space.mesh.points
    slave = problem.joints[0].zone.slave.faces.distinct_nodes
    tilt = np.polyfit(x[slave, 0], by_node(problem, states[-1])[slave, 1], 1)[0]
    assert abs(tilt) == pytest.approx(NEXT_GAP / FACET, rel=0.01)
    arm = eccentricity - (u[slave].mean() - u[nodes_of(problem, "up.y1")].mean()) * ("finite" in case)
    force = zone.pressure * zone.area * (np.arange(7) - 3)
    assert force.sum() / (zone.pressure * zone.area).sum() == pytest.approx(arm / FACET, rel=0.02, abs=1e-4)


# ---- tiny loads

UPRIGHT = '[[spring]]\ngroup = "upper"\nkx = 1.0\nky = 1.0\nkz = 1.0\n'


def pressures(mesh, load, geometry="reference"):
    """The pressures under a load that is not uniform, of it."""
    material = "[[material]]\nyoung = 1000.0\npoisson = 0.3\n"
    text = HEAD.format(model="3d") + material + JOINT + f'geometry = "{geometry}"\n'
    text += held("bottom", ux=0.0, uy=0.0, uz=0.0) + UPRIGHT + pressed("top", f"{load} * (1 + x ** 2)")
    (state,) = march(Problem.of(parse_case(text), mesh))
    return state.zones[0].pressure / load


@pytest.mark.parametrize("load", [1e-9, 1e-15, 1e-20, 1e-60])
def test_pressures_go_with_the_load(load):
    mesh = stack("HEXA8", "TETRA4", 3)
    usual = pressures(mesh, 1.0)
    assert usual.max() > 1
    np.testing.assert_allclose(pressures(mesh, load), usual, rtol=1e-9)


@pytest.mark.parametrize("geometry, turn", [("current", None), ("reference", tilt(3))])
def test_displacements_below_the_rounding_of_gaps_are_warned_of(geometry, turn):
    mesh = placed(stack("HEXA8", "TETRA4", 3), turn)
    with pytest.warns(LacmeshWarning, match="nothing moves by more than .* pressures may be wrong by [0-9]+%") as told:
        pressures(mesh, 1e-13, geometry)
    assert ("reference" in str(told[0].message)) == (geometry == "current")
