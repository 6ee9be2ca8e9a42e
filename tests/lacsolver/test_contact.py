"""Contact of blocks whose answer is known in closed form: pressed, parted, overlapping, warm, heavy, unloaded again."""

from __future__ import annotations

import numpy as np
import pytest

from lacsolver.case import CaseError
from lacsolver.results.state import CONTACT, OPEN, UNPAIRED
from tests.lacsolver.contact_cases import (
    JOINT,
    POISSON,
    SLIDING,
    YOUNG,
    by_node,
    held,
    nodes_of,
    only,
    pressed,
    resultant,
    solve,
    stresses,
)
from tests.lacsolver.patch_meshes import block, joined, placed, stack, three_blocks
from tests.samples import each_option

#: (slave, master, model): one of each model, and cells that differ
PAIRS = [
    ("HEXA8", "TETRA4", "3d"),
    ("TETRA10", "HEXA20", "3d"),
    ("TRIA3", "QUAD8", "plane_strain"),
    ("QUAD9", "TRIA6", "plane_stress"),
    ("QUAD8", "QUAD4", "axisymmetric"),
]
GROUND = held("bottom", uz=0.0)


def blocks(slave, master, model, **options):
    """A stack, and what lets it slide along its sides and holds its bottom; the height's axis."""
    dim = 3 if model == "3d" else 2
    up = "xyz"[dim - 1]
    sliding = SLIDING if dim == 3 else held("x0", ux=0.0)
    return stack(slave, master, dim, **options), sliding + held("bottom", **{f"u{up}": 0.0}), up


def modulus(model):
    """Stress along the height for a unit strain along it, free sideways."""
    return YOUNG / (1 - POISSON**2) if model == "plane_strain" else YOUNG


def check_uniform(problem, state, p):
    """Every pressure is p, and so is the stress along the height; nothing else but what plane strain asks for."""
    dim = problem.space.dim
    for zone in state.zones:
        np.testing.assert_allclose(zone.pressure, p, rtol=1e-10)
    sigma = stresses(problem, state)
    want = np.zeros(sigma.shape[1])
    want[dim - 1] = -p
    if problem.case.model == "plane_strain":
        want[2] = -POISSON * p
    np.testing.assert_allclose(sigma, np.tile(want, (len(sigma), 1)), atol=1e-10 * abs(p))


@pytest.mark.parametrize("slave, master, model", PAIRS)
def test_bilateral_contact_pulls(slave, master, model):
    mesh, fixed, _ = blocks(slave, master, model)
    problem, state = only(mesh, JOINT + 'type = "bilateral"\n' + fixed + pressed("top", -2.0), model)
    check_uniform(problem, state, -2.0)
    (zone,) = state.zones
    area = np.pi if model == "axisymmetric" else 1.0
    want = np.zeros(problem.space.dim)
    want[-1] = 2.0 * area
    if model != "axisymmetric":
        np.testing.assert_allclose(resultant(zone, problem), want, atol=1e-12)
    np.testing.assert_allclose(zone.area.sum(), area, rtol=1e-13)
    assert (zone.status == CONTACT).all()


@pytest.mark.parametrize(
    "slave, master, model, initial",
    each_option((*pair, initial) for pair in PAIRS for initial in ("gap", "all", "none")),
)
def test_unilateral_contact_lets_go(slave, master, model, initial):
    """The upper block is lifted as it is, the lower one does not follow."""
    mesh, fixed, up = blocks(slave, master, model)
    _, state = only(mesh, JOINT + f'initial = "{initial}"\n' + fixed + held("top", **{f"u{up}": 0.01}), model)
    (zone,) = state.zones
    assert (zone.pressure == 0).all() and (zone.status == OPEN).all() and (zone.force == 0).all()
    np.testing.assert_allclose(zone.gap, 0.01, rtol=1e-11)


@pytest.mark.parametrize("slave, master, model", PAIRS)
def test_interference_presses_blocks_together(slave, master, model):
    """Two blocks of height 1 between fixed ends overlap by 0.01, so that both are strained by half of it."""
    mesh, fixed, up = blocks(slave, master, model)
    sections = JOINT + "clearance = -0.01\n" + fixed + held("top", **{f"u{up}": 0.0})
    problem, state = only(mesh, sections, model)
    check_uniform(problem, state, modulus(model) * 0.01 / 2)


@pytest.mark.parametrize(
    "slave, master, model, gap, clearance",
    each_option((*pair, *opening) for pair in PAIRS for opening in ((0.1, -0.04), (0.0, 0.06), (0.06, 0.0))),
)
def test_a_clearance_is_closed_before_anything_presses(slave, master, model, gap, clearance):
    """0.06 in all, real or by `clearance`, closed by 0.05 and by 0.08."""
    mesh, fixed, up = blocks(slave, master, model, gap=gap)
    sections = JOINT + f"clearance = {clearance}\n" + fixed
    _, state = only(mesh, sections + held("top", **{f"u{up}": -0.05}), model)
    np.testing.assert_allclose(state.zones[0].gap, 0.01, rtol=1e-11)
    problem, state = only(mesh, sections + held("top", **{f"u{up}": -0.08}), model)
    check_uniform(problem, state, modulus(model) * 0.02 / 2)


def test_a_clearance_may_be_a_formula_of_place():
    """Mean gaps over squares of side 1/4, of a quadratic, which quadratic faces integrate exactly."""
    mesh, fixed, _ = blocks("HEXA20", "TETRA4", "3d", counts=(4, 3), even=True)
    _, state = only(mesh, JOINT + 'clearance = "0.1 + 0.2 * x**2 - 0.1 * y"\n' + fixed + held("top", uz=0.0))
    (zone,) = state.zones
    x, y = zone.centre[:, 0], zone.centre[:, 1]
    np.testing.assert_allclose(zone.gap, 0.1 + 0.2 * (x**2 + 0.25**2 / 12) - 0.1 * y, rtol=1e-12)


@pytest.mark.parametrize("clearance", ['"-0.01 * t"', "[[0, 0], [1, -0.01]]"])
def test_a_clearance_may_change_with_time(clearance):
    mesh, fixed, _ = blocks("HEXA8", "TETRA4", "3d")
    sections = JOINT + f"clearance = {clearance}\n" + fixed + held("top", uz=0.0) + "[steps]\ncount = 4\n"
    problem, states = solve(mesh, sections)
    assert [state.time for state in states] == [0.25, 0.5, 0.75, 1.0]
    for state in states:
        check_uniform(problem, state, YOUNG * 0.01 * state.time / 2)


@pytest.mark.parametrize("slave, master, model", PAIRS)
@pytest.mark.parametrize("groups, share", [("", 1.0), ('groups = ["upper"]\n', 0.5)])
def test_thermal_strain_presses_blocks_together(slave, master, model, groups, share):
    """Between fixed ends, with a clearance of a quarter of what both would grow by."""
    mesh, fixed, up = blocks(slave, master, model)
    material = f"[[material]]\nyoung = {YOUNG}\npoisson = {POISSON}\nexpansion = 1e-4\nreference_temperature = 20.0\n"
    sections = JOINT + "clearance = 0.005\n" + fixed + held("top", **{f"u{up}": 0.0})
    problem, state = only(mesh, sections + f"[[temperature]]\n{groups}value = 120.0\n", model, material)
    # in plane strain expansion across the plane is held, too, and adds its part of Poisson's
    grown = 0.01 * (1 + POISSON if model == "plane_strain" else 1) * 2 * share
    p = modulus(model) * (grown - 0.005) / 2
    np.testing.assert_allclose(state.zones[0].pressure, p, rtol=1e-10)
    np.testing.assert_allclose(stresses(problem, state)[:, problem.space.dim - 1], -p, rtol=1e-9)


def test_orthotropic_blocks():
    """Pressed along axis 3 of the material: u = S sigma x, with moduli of their own along each axis."""
    mesh, fixed, _ = blocks("HEXA20", "mixed 1", "3d")
    material = """[[material]]
law = "orthotropic"
young = [1000.0, 2000.0, 500.0]
poisson = [0.2, 0.3, 0.25]
shear = [400.0, 300.0, 200.0]
"""
    problem, state = only(mesh, JOINT + fixed + pressed("top", 1.5), "3d", material)
    check_uniform(problem, state, 1.5)
    x = problem.space.mesh.points
    strain = 1.5 * np.array([0.3 / 1000, 0.25 / 2000, -1 / 500])  # nu13 / E1, nu23 / E2, -1 / E3
    np.testing.assert_allclose(by_node(problem, state), x * strain, atol=1e-13)


@pytest.mark.parametrize("slave, master, model", PAIRS)
def test_contact_carries_the_weight(slave, master, model):
    """The upper block rests on the lower: resultant = weight, and the ground bears both."""
    mesh, fixed, up = blocks(slave, master, model)
    material = f"[[material]]\nyoung = {YOUNG}\npoisson = {POISSON}\ndensity = 0.02\n"
    problem, state = only(mesh, JOINT + fixed + f"[gravity]\ng{up} = -9.81\n", model, material)
    weight = 0.02 * 9.81 * (np.pi if model == "axisymmetric" else 1.0)
    (zone,) = state.zones
    assert resultant(zone, problem)[-1] == pytest.approx(-weight, rel=1e-12)
    np.testing.assert_allclose(zone.pressure @ zone.area, weight, rtol=1e-12)
    ground = state.reaction.reshape(-1, problem.space.dim)[nodes_of(problem, "bottom")]
    assert ground[:, -1].sum() == pytest.approx(2 * weight, rel=1e-12)


def zone(number, more=""):
    return f'[[contact]]\nname = "zone{number}"\nslave = "slave{number}"\nmaster = "master{number}"\n{more}'


def test_several_zones():
    mesh = three_blocks()
    problem, state = only(mesh, zone(1) + zone(2) + SLIDING + GROUND + pressed("top", 1.0))
    assert [z.name for z in state.zones] == ["zone1", "zone2"]
    check_uniform(problem, state, 1.0)


def test_zones_open_and_close_apart():
    """The middle block hangs on springs: lifted off, both zones open; pressed, the upper one closes alone."""
    mesh = three_blocks()
    spring = '[[spring]]\ngroup = "master2"\nkz = 10.0\n'
    sections = zone(1, "clearance = 0.4\n") + zone(2) + SLIDING + GROUND + spring
    _, state = only(mesh, sections + held("top", uz=0.01))
    below, above = state.zones
    np.testing.assert_allclose(below.gap, 0.4, rtol=1e-11)
    np.testing.assert_allclose(above.gap, 0.01, rtol=1e-11)
    problem, state = only(mesh, sections + held("top", uz=-0.1))
    below, above = state.zones
    assert (below.status == OPEN).all() and (above.status == CONTACT).any()
    springs = -10.0 * by_node(problem, state)[nodes_of(problem, "master2"), 2].sum()
    assert above.pressure @ above.area == pytest.approx(springs, rel=1e-10)
    problem, state = only(mesh, sections + held("top", uz=-0.6))
    assert all((z.status == CONTACT).any() for z in state.zones)


def test_a_body_on_springs_is_pressed_against_another():
    """Springs under the lower block give way by P / k."""
    mesh, _, _ = blocks("HEXA8", "TETRA4", "3d")
    spring = '[[spring]]\ngroup = "bottom"\nkz = 3.125\n'
    problem, state = only(mesh, JOINT + SLIDING + spring + pressed("top", 1.0))
    bottom = nodes_of(problem, "bottom")
    assert len(bottom) == 16
    assert by_node(problem, state)[bottom, 2].sum() == pytest.approx(-1.0 / 3.125, rel=1e-10)
    assert state.zones[0].pressure @ state.zones[0].area == pytest.approx(1.0, rel=1e-10)


def half_covered(part):
    """A block whose upper side, the slave, is covered by another one up to x = `part`."""
    low, high = block("HEXA8", 3, 4, "z1", even=True), block("HEXA8", 3, 3, "z0")
    names = {"x0": "x0", "y0": "y0"}
    return joined(
        [
            (low, np.zeros(3), {**names, "z0": "bottom", "z1": "slave"}),
            (placed(high, size=(part, 1, 1)), np.array([0.0, 0, 1]), {**names, "z0": "master", "z1": "top"}),
        ]
    )


def test_a_slave_beyond_its_master_is_unpaired():
    """The upper block covers half of the lower: what is left uncovered has no pressure and no gap."""
    mesh = half_covered(0.5)
    _, state = only(mesh, JOINT + SLIDING + GROUND + pressed("top", 1.0))
    (found,) = state.zones
    left = found.centre[:, 0] < 0.5
    assert ((found.status == UNPAIRED) == ~left).all() and left.sum() == 8
    np.testing.assert_allclose(found.coverage, left.astype(float), atol=1e-12)
    assert found.pressure @ found.area == pytest.approx(0.5, rel=1e-11)


def test_the_coverage_threshold_unpairs_what_is_covered_less():
    """The upper block covers 5/8 of a side: a column of four macro-elements by half."""
    mesh = half_covered(0.625)
    for threshold, count in ((0.45, 4), (0.55, 8)):
        _, state = only(mesh, JOINT + f"coverage_threshold = {threshold}\n" + SLIDING + GROUND + pressed("top", 1.0))
        (found,) = state.zones
        assert (found.status == UNPAIRED).sum() == count
        covered = np.where(found.status == UNPAIRED, 0.0, found.coverage)
        assert found.pressure @ (found.area * covered) == pytest.approx(0.625, rel=1e-11)


@pytest.mark.parametrize(("slave", "master", "model"), PAIRS)
def test_a_coverage_of_all_that_rounding_leaves_is_all(slave, master, model):
    mesh, fixed, up = blocks(slave, master, model)
    sections = fixed + held("top", **{f"u{up}": -0.01})
    _, state = only(mesh, JOINT + "coverage_threshold = 1.0\n" + sections, model)
    assert (state.zones[0].status == CONTACT).all()


def test_what_is_beyond_the_search_distance_is_not_looked_at():
    mesh, fixed, _ = blocks("HEXA8", "TETRA4", "3d", gap=0.2)
    sections = fixed + held("top", uz=0.0)
    _, state = only(mesh, JOINT + "search_distance = 0.3\n" + sections)
    assert (state.zones[0].status == OPEN).all()
    with pytest.raises(CaseError, match="raise search_distance"):
        only(mesh, JOINT + "search_distance = 0.1\n" + sections)


def test_unloading_goes_back_the_way_it_came():
    """Pressed, let go, lifted, pressed again: contact has no memory."""
    mesh, fixed, _ = blocks("HEXA8", "TETRA4", "3d")
    table = [[0, 0], [1, -0.01], [2, 0.01], [3, -0.01], [4, 0]]
    _, states = solve(mesh, JOINT + fixed + held("top", uz=table) + "[steps]\nend = 4.0\ncount = 8\n")
    assert len(states) == 8
    for state in states:
        top = np.interp(state.time, *np.array(table).T)
        (found,) = state.zones
        np.testing.assert_allclose(found.pressure, YOUNG * max(-top, 0) / 2, atol=1e-11 * YOUNG)
        np.testing.assert_allclose(found.gap, max(top, 0), atol=1e-13)
    for once, again in ((0.5, 3.5), (1.0, 3.0), (1.5, 2.5)):
        first, second = (next(s.u for s in states if s.time == time) for time in (once, again))
        np.testing.assert_allclose(first, second, atol=1e-14)


def test_a_load_history_with_unloading():
    """A pressure that grows, falls and grows: every state is the one of its own load."""
    mesh, fixed, _ = blocks("TETRA10", "HEXA8", "3d")
    table = [[0, 0], [1, 3.0], [2, 0.5], [3, 2.0]]
    problem, states = solve(mesh, JOINT + fixed + pressed("top", table) + "[steps]\nend = 3.0\ncount = 6\n")
    for state in states:
        check_uniform(problem, state, np.interp(state.time, *np.array(table).T))
