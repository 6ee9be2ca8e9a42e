"""Bodies that contact alone holds, and sets of contact that change on the way to the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lacmesh.errors import DataError
from lacsolver.case import Case, Contact, Displacement, Material, Pressure, Steps
from lacsolver.equilibrium.stepping import NotConvergedError, march
from lacsolver.problem.problem import Problem
from lacsolver.results.state import CONTACT, OPEN
from tests.checks.blocks import block as grid
from tests.checks.blocks import join, skin
from tests.lacsolver.contact_cases import (
    JOINT,
    POISSON,
    YOUNG,
    at,
    by_node,
    held,
    only,
    pressed,
    resultant,
    solve,
)
from tests.lacsolver.patch_meshes import placed, stack, three_blocks

FIXED = held("bottom", ux=0.0, uy=0.0, uz=0.0)
INITIAL = ("gap", "all", "none")


#: what keeps the upper block from sliding and turning about the height, and nothing more
UPRIGHT = at([0.0, 0.0, 2.0], ux=0.0, uy=0.0) + at([1.0, 0.0, 2.0], uy=0.0)
#: three squares of side 1/4 at heights of their own; the rest is far below
FEET = {(0.125, 0.125): 0.0, (0.875, 0.375): 1e-3, (0.375, 0.875): 2e-3}
CLEARANCE = (
    "0 if x < 0.25 and y < 0.25 else 1e-3 if x > 0.75 and 0.25 < y < 0.5 "
    "else 2e-3 if 0.25 < x < 0.5 and y > 0.75 else 0.1"
)


def on_three_feet(initial, load):
    mesh = stack("HEXA8", "TETRA4", 3, counts=(4, 3), even=True)
    joint = f'{JOINT}initial = "{initial}"\nclearance = "{CLEARANCE}"\n'
    return only(mesh, joint + FIXED + UPRIGHT + load)


def weight(fz, group="upper"):
    return f'[[body_force]]\ngroups = ["{group}"]\nfz = {fz}\n'


@pytest.mark.parametrize("initial", INITIAL)
@pytest.mark.parametrize("force", [1e-2, 1e-5])
def test_a_body_settles_on_three_feet(initial, force):
    """It falls, tilts, and comes to rest; each foot bears what statics says, and it stands as a rigid body does."""
    problem, state = on_three_feet(initial, weight(-force))
    (zone,) = state.zones
    on = zone.status == CONTACT
    feet = np.array(list(FEET))
    found = {
        tuple(np.round(c[:2], 9)): p for c, p in zip(zone.centre[on], (zone.pressure * zone.area)[on], strict=True)
    }
    share = np.linalg.solve(np.vstack([feet.T, np.ones(3)]), [0.5, 0.5, 1.0])
    assert found == pytest.approx({foot: force * s for foot, s in zip(FEET, share, strict=True)}, rel=1e-9)
    assert resultant(zone, problem)[2] == pytest.approx(-force, rel=1e-10)
    plane = np.linalg.solve(np.column_stack([feet, np.ones(3)]), [-g for g in FEET.values()])
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    for x, y in corners:
        node = np.abs(problem.space.mesh.points - [x, y, 2]).max(axis=1).argmin()
        assert by_node(problem, state)[node, 2] == pytest.approx(plane @ [x, y, 1], abs=1e-3 * force / 1e-2)


@pytest.mark.parametrize("initial", INITIAL)
def test_a_body_that_would_tip_over_is_said_to(initial):
    """Its load stands outside of its feet: there is no equilibrium, and no wrong answer."""
    with pytest.raises(NotConvergedError, match="no equilibrium"):
        on_three_feet(
            initial, weight(-1e-2) + "[[force]]\nat = [0.0, 1.0, 2.0]\nfz = -0.1\n[steps]\nmax_halvings = 1\n"
        )


def test_a_body_that_is_pulled_away_is_said_to():
    mesh = stack("HEXA8", "TETRA4", 3)
    with pytest.raises(NotConvergedError, match="'upper' moves along z, and no contact stops it"):
        only(mesh, JOINT + FIXED + UPRIGHT + pressed("top", -1.0) + "[steps]\nmax_halvings = 1\n")


def test_a_body_that_contact_cannot_hold_is_said_to():
    mesh = stack("HEXA8", "TETRA4", 3)
    with pytest.raises(DataError, match="'upper' moves along"):
        only(mesh, JOINT + FIXED + pressed("top", 1.0))


@pytest.mark.parametrize("initial", INITIAL)
def test_a_body_on_a_plane_with_its_load_off_the_middle(initial):
    """Free to tilt: the resultant of the pressures stands under the load, and the far edge has little of it."""
    mesh = stack("HEXA8", "HEXA20", 3, counts=(4, 3))
    load = pressed("top", "1 + 2 * x")
    problem, state = only(mesh, f'{JOINT}initial = "{initial}"\n' + FIXED + UPRIGHT + load)
    (zone,) = state.zones
    force = zone.pressure * zone.area
    assert force.sum() == pytest.approx(2.0, rel=1e-10)
    np.testing.assert_allclose(force @ zone.centre[:, :2] / 2.0, [(1 / 2 + 2 / 3) / 2, 0.5], rtol=1e-9)
    assert (zone.status == CONTACT).all()
    assert resultant(zone, problem)[2] == pytest.approx(-2.0, rel=1e-10)


@pytest.mark.parametrize("initial", INITIAL)
def test_three_blocks_stand_on_one_another_by_contact_alone(initial):
    """Two bodies that nothing else holds along the height, both free to tilt."""
    mesh = three_blocks()
    zones = "".join(
        f'[[contact]]\nname = "zone{k}"\nslave = "slave{k}"\nmaster = "master{k}"\ninitial = "{initial}"\n'
        for k in (1, 2)
    )
    inside = [[place for place in mesh.points.tolist() if place[:2] == [x, 0.0]] for x in (0.0, 1.0)]
    upright = "".join(
        at(left, ux=0.0, uy=0.0) + at(right, uy=0.0)
        for k in (1, 2)
        for left, right in [[next(p for p in side if k + 0.1 < p[2] < k + 0.9) for side in inside]]
    )
    upright += FIXED
    load = pressed("top", "1 + x - y / 2")
    _, state = only(mesh, zones + upright + load)
    for zone in state.zones:
        assert zone.pressure @ zone.area == pytest.approx(1.25, rel=1e-10)
        middle = (zone.pressure * zone.area) @ zone.centre[:, :2] / 1.25
        np.testing.assert_allclose(middle, [(1 / 2 + 1 / 3 - 1 / 8) / 1.25, (1 / 2 + 1 / 4 - 1 / 6) / 1.25], rtol=1e-9)


def beam(slave="QUAD4", master="QUAD8", counts=(20, 16)):
    """A beam 10 long and 1/2 high on a foundation as long and as high."""
    return placed(stack(slave, master, 2, counts=counts, even=True), size=(10.0, 0.5, 1.0))


HEAVY = f"[[material]]\nyoung = {YOUNG}\npoisson = {POISSON}\ndensity = 0.002\n"
LAID = held("bottom", ux=0.0, uy=0.0) + '[gravity]\ngy = "-9.81"\n'


@pytest.mark.parametrize("initial", INITIAL)
@pytest.mark.parametrize("slave, master", [("QUAD4", "QUAD8"), ("TRIA6", "QUAD4")])
def test_a_beam_on_a_foundation_lifts_its_ends(initial, slave, master):
    """Pressed in the middle by a hundred times its weight: contact shrinks to the middle, by several sets."""
    mesh = beam(slave, master)
    middle = at([5.0, 1.0], ux=0.0)
    load = "[[force]]\nat = [5.0, 1.0]\nfy = -5.0\n"
    joint = f'{JOINT}initial = "{initial}"\n'
    _, state = only(mesh, joint + LAID + middle + load, "plane_strain", HEAVY)
    (zone,) = state.zones
    order = np.argsort(zone.centre[:, 0])
    closed, p = zone.status[order] == CONTACT, zone.pressure[order]
    assert closed[len(closed) // 2] and (zone.status[order][~closed] == OPEN).all()
    assert 2 <= closed.sum() <= len(closed) / 3 and zone.gap.max() > 1e-3
    np.testing.assert_allclose(p, p[::-1], atol=1e-8 * p.max())
    assert zone.pressure @ zone.area == pytest.approx(5.0 + 10 * 0.5 * 0.002 * 9.81, rel=1e-10)
    assert state.iterations >= 4


def test_the_status_at_the_start_does_not_change_the_answer():
    load = at([5.0, 1.0], ux=0.0) + "[[force]]\nat = [5.0, 1.0]\nfy = -5.0\n"
    found = [
        only(beam(), f'{JOINT}initial = "{initial}"\n' + LAID + load, "plane_strain", HEAVY)[1] for initial in INITIAL
    ]
    for state in found[1:]:
        np.testing.assert_allclose(state.u, found[0].u, atol=1e-10 * np.abs(found[0].u).max())
        np.testing.assert_allclose(state.zones[0].pressure, found[0].zones[0].pressure, atol=1e-9)


def test_a_beam_is_lifted_at_one_end_and_laid_down_again():
    """Its own weight keeps the rest of it on the foundation: contact goes from one end, and comes back."""
    table = [[0, 0], [1, 0.1], [2, 0]]
    lifted = held("x1up", uy=table) + at([0.0, 1.0], ux=0.0)
    _, states = solve(
        _with_end(beam()), JOINT + LAID + lifted + "[steps]\nend = 2.0\ncount = 8\n", "plane_strain", HEAVY
    )
    counts = []
    for state in states:
        (zone,) = state.zones
        closed = zone.status[np.argsort(zone.centre[:, 0])] == CONTACT
        assert (np.diff(closed.astype(int)) == 1).sum() <= 1, "one stretch"
        counts.append(closed.sum())
    assert counts[:4] == sorted(counts[:4], reverse=True) and counts[3:] == sorted(counts[3:])
    assert counts[3] < counts[0] < counts[7] == len(closed)
    for up, down in ((0, 6), (1, 5), (2, 4)):
        np.testing.assert_allclose(states[up].u, states[down].u, atol=1e-11)


def _with_end(mesh):
    """The mesh with a group of the upper right corner's node."""
    node = np.flatnonzero(np.abs(mesh.points - [10.0, 1.0, 0.0]).max(axis=1) < 1e-9)
    return replace(mesh, node_groups={"x1up": node})


def test_a_load_goes_to_zero_and_comes_back():
    """A block that friction alone holds aside: without a load there is nothing that contact does not carry."""
    low, high = grid((2, 2, 1), (0, 0, 0), (2, 1, 1), "HEXA8"), grid((2, 2, 1), (0.2, 0.1, 1), (1.9, 0.9, 2), "HEXA8")

    def level(cells, z):
        return skin(*cells, lambda x: np.isclose(x[..., 2], z))

    mesh = join(
        [(*low, {"base": level(low, 0), "m": level(low, 1)}), (*high, {"s": level(high, 1), "top": level(high, 2)})]
    )
    case = Case(
        mesh=mesh, model="3d", material=Material(young=1000.0, poisson=0.3),
        contact=Contact(slave="s", master="m", geometry="reference", friction=0.3),
        displacement=Displacement(group="base", ux=0, uy=0, uz=0), steps=Steps(end=4.0, count=4),
        pressure=Pressure(group="top", value=[[0, 0], [1, 5], [2, 0], [3, 0], [4, 5]]),
    )  # fmt: skip
    forces = [state.zones[0].pressure @ state.zones[0].area for state in march(Problem.of(case))]
    np.testing.assert_allclose(forces, np.array([5, 0, 0, 5]) * 1.7 * 0.8, atol=1e-9)
