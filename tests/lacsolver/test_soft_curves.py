"""Soft contact by a curve, `[[contact]] law = "exponential"` and `"table"`, against springs in series."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq

from lacsolver.case import Case, CaseError, Contact, Displacement, Material, Pressure, Steps, parse_case
from lacsolver.contact.curves import Exponential, Table
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.checks.blocks import block as grid
from tests.checks.blocks import join, skin
from tests.lacsolver.contact_cases import HEAD, JOINT, SLIDING, held
from tests.lacsolver.patch_meshes import stack
from tests.samples import each_option

#: pressures from far softer than the bodies to far stiffer; a gasket that hardens, one that gives way
TABLES = {
    "soft": ((0.0, 0.0), (0.5, 0.01), (2.0, 0.02)),
    "stiff": ((0.0, -1e-3), (10.0, -5e-4), (1e4, 0.0)),
    "hardens": ((0.0, 0.0), (0.05, 0.002), (1.0, 0.0025), (1e3, 0.003)),
    "gives way": ((0.0, 0.0), (1.0, 1e-5), (1.5, 0.004), (100.0, 0.005)),
}
LAWS = {name: Table(rows=rows) for name, rows in TABLES.items()}
LAWS |= {f"exponential {c:g}": Exponential(at_contact=1.0, clearance=c) for c in (1e-2, 1e-4, 1e-6)}


@pytest.mark.parametrize("name", LAWS)
def test_gap_and_slope_belong_to_the_pressure(name):
    law = LAWS[name]
    p = np.geomspace(1e-6, 50.0, 40)
    g = law.gap_of(p)
    assert (g < law.reach).all()
    np.testing.assert_allclose(law.pressure(g), p, rtol=1e-7)
    h = 1e-7 * abs(g[-1] - law.reach)
    np.testing.assert_allclose(
        np.median((law.pressure(g - h) - law.pressure(g + h)) / (2 * h) / law.slope(g)), 1, rtol=1e-5
    )
    assert law.pressure(np.array([law.reach + 1e-9, 1e3])).tolist() == [0.0, 0.0]
    for stiffness in (1e-3, 1.0, 1e3, 1e6):
        k = np.full(len(p), stiffness)
        np.testing.assert_allclose(law.meeting(p - k * g, k), g, rtol=1e-9, atol=1e-15)
        assert (law.meeting(-k * (law.reach + 1e-9), k) >= law.reach - 1e-15).all()


def text_of(law):
    """The keys of a law."""
    if isinstance(law, Table):
        return f'law = "table"\npressures = {[list(row) for row in law.rows]}\n'
    return f'law = "exponential"\npressure_at_contact = {law.at_contact}\nclearance_at_zero = {law.clearance}\n'


#: of a tolerance, the relative error and the iterations
ALLOWED = {1e-10: (2e-9, 8), 1e-12: (1e-10, 12)}


@pytest.mark.parametrize(
    "name, geometry, tolerance", each_option(itertools.product(LAWS, ("reference", "current"), ALLOWED))
)
def test_columns(name, geometry, tolerance):
    press_columns(LAWS[name], geometry, tolerance, *ALLOWED[tolerance])


@pytest.mark.parametrize("geometry", ["reference", "current"])
def test_columns_on_a_plateau(geometry):
    """Pressures within one in three hundred of each other, between two parts of a table 15,000 times as stiff."""
    plateau = Table(rows=((0.0, 0.0), (3.0, 2e-5), (3.01, 1e-3), (100.0, 0.002)))
    press_columns(plateau, geometry, 1e-10, digits=2e-9, most=15)


def press_columns(law, geometry, tolerance, digits, most):
    """Pressed by d, 2 p / E - g(p) = d; then apart or nearly so, pressed again, and far apart."""
    exact = HEAD.replace("[solver]", f"[solver]\ntolerance = {tolerance}")
    text = exact.format(model="3d") + "[steps]\ncount = 4\nend = 4.0\nmax_halvings = 0\n[[material]]\nyoung = 1e3\n"
    text += f'poisson = 0.0\n{JOINT}{text_of(law)}geometry = "{geometry}"\n' + SLIDING + held("bottom", uz=0.0)
    text += held("top", uz=[[0, 0], [1, -0.01], [2, 0.002], [3, -0.005], [4, 0.02]])
    states = march(Problem.of(parse_case(text), stack("HEXA8", "TETRA4", 3)))
    for state, d in zip(states, (0.01, -0.002, 0.005, -0.02), strict=True):
        p = 0.0
        if -d < law.reach:
            p = brentq(lambda p, d=d: float(2e-3 * p - law.gap_of(np.array([p]))[0] - d), 1e-12, 1e4, xtol=1e-15)
        np.testing.assert_allclose(state.zones[0].pressure, p, rtol=digits, atol=digits)
        np.testing.assert_allclose(state.zones[0].gap, 2e-3 * p - d, rtol=1e-8, atol=1e-12)
        assert state.iterations <= most and state.halvings == 0


@pytest.mark.parametrize("load", [1e-9, 1e-6, 1e-3])
def test_a_load_near_nothing_finds_the_beginning_of_an_exponential(load):
    """A curve that begins without a slope, and a block that hangs on it alone along the normal."""
    exact = HEAD.replace("[solver]", "[solver]\ntolerance = 1e-12")  # 1e-10 of the gap are 5e-6 of the least load
    text = exact.format(model="3d") + "[steps]\nmax_halvings = 0\n[[material]]\nyoung = 1e2\npoisson = 0.0\n"
    text += JOINT + text_of(Exponential(at_contact=0.2, clearance=0.05)) + held("bottom", ux=0.0, uy=0.0, uz=0.0)
    text += held("top", ux=0.0, uy=0.0) + f'[[pressure]]\ngroup = "top"\nvalue = {load}\n'
    (state,) = march(Problem.of(parse_case(text), stack("HEXA8", "HEXA8", 3, counts=(2, 3))))
    np.testing.assert_allclose(state.zones[0].pressure, load, rtol=1e-6)
    assert state.iterations <= 16


def test_friction_goes_with_a_table():
    """A block on a gasket is pushed aside: friction carries mu times the pressure of the table, and no more."""
    text = HEAD.format(model="3d") + "[[material]]\nyoung = 1e3\npoisson = 0.0\n" + JOINT + text_of(LAWS["soft"])
    text += "friction = 0.3\n" + held("bottom", ux=0.0, uy=0.0, uz=0.0)
    text += held("top", ux=[[0, 0], [1, 0.05]], uy=0.0, uz=[[0, 0], [1, -0.01]])
    text = text.replace("[solver]", "[steps]\ncount = 3\n[solver]") if "[steps]" not in text else text
    *_, state = march(Problem.of(parse_case(text), stack("HEXA8", "HEXA8", 3, counts=(2, 2))))
    (zone,) = state.zones
    assert zone.pressure.min() > 0
    shear = np.linalg.norm(zone.friction.shear, axis=1)
    np.testing.assert_allclose(zone.pressure, LAWS["soft"].pressure(zone.gap), rtol=1e-7)
    assert (shear <= 0.3 * zone.pressure * (1 + 1e-8)).all() and (zone.status == 2).any()


CHANGING = """mesh = "a.msh"
model = "plane_strain"
kinematics = "{kinematics}"
[[material]]
law = "{law}"
young = 1000.0
poisson = 0.0
[[contact]]
slave = "slave"
master = "master"
type = "{kind}"
stiffness = {stiffness}
[[displacement]]
group = "bottom"
ux = 0.0
uy = 0.0
[[displacement]]
group = "top"
ux = 0.0
[[traction]]
group = "top"
ty = [[0.0, -0.5], [9.0, -0.5]]
[steps]
end = 3.0
count = 6
"""


@pytest.mark.parametrize(
    "kind, kinematics", each_option(itertools.product(("unilateral", "bilateral"), ("small", "finite")))
)
def test_a_stiffness_that_changes_with_time(kind, kinematics):
    """Under a constant pressure the overlap is p / k(t) in every step, as k rises and falls."""
    law = {"small": "elastic", "finite": "neo_hookean"}[kinematics]
    rows = [[0.0, 50.0], [1.0, 50.0], [2.0, 400.0], [3.0, 20.0]]
    text = CHANGING.format(kinematics=kinematics, law=law, kind=kind, stiffness=rows)
    problem = Problem.of(parse_case(text), stack("QUAD4", "QUAD4", 2, counts=(3, 3), even=True))
    states = list(march(problem))
    assert len(states) == 6
    for state in states:
        k = np.interp(state.time, *np.transpose(rows))
        np.testing.assert_allclose(state.zones[0].pressure, 0.5, rtol=1e-7)
        np.testing.assert_allclose(state.zones[0].gap, -0.5 / k, rtol=1e-7)


def test_a_stiffness_that_falls_to_nothing_is_refused():
    text = CHANGING.format(kinematics="small", law="elastic", kind="unilateral", stiffness='"1 - t"')
    problem = Problem.of(parse_case(text), stack("QUAD4", "QUAD4", 2, counts=(3, 3), even=True))
    with pytest.raises(CaseError, match="contact: stiffness is 0 at t = 1; it must be > 0"):
        list(march(problem))


#: a table with a soft toe, which falls on it once
GAP_LAWS = {
    "exponential": ({"law": "exponential", "pressure_at_contact": 2.0, "clearance_at_zero": 0.01}, [5, 0, 0, 5]),
    "table": ({"law": "table", "pressures": ((0.0, 0.0), (1e-3, 0.01), (50.0, 0.02))}, [5]),
}


@pytest.mark.parametrize("name", GAP_LAWS)
@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_block_comes_down_over_a_gap_and_again_after_it_was_let_go(name, kinematics):
    """Nothing but contact holds it down, and where the curve begins it has no slope."""
    low, high = grid((2, 2), (0, 0), (1, 1), "QUAD4"), grid((3, 2), (0, 1.05), (1, 2.05), "QUAD4")

    def at(cells, y):
        return skin(*cells, lambda x: np.isclose(x[..., 1], y))

    left = skin(*high, lambda x: np.isclose(x[..., 0], 0))
    mesh = join([
        (*low, {"base": at(low, 0), "m": at(low, 1)}),
        (*high, {"s": at(high, 1.05), "top": at(high, 2.05), "left": left}),
    ])  # fmt: skip
    law, loads = GAP_LAWS[name]
    times = [float(t) for t in range(1, len(loads) + 1)]
    case = Case(
        mesh=mesh, model="plane_strain", kinematics=kinematics, steps=Steps(times=times),
        material=Material(young=1000.0, poisson=0.0, law="elastic" if kinematics == "small" else "neo_hookean"),
        contact=Contact(slave="s", master="m", geometry="current", **law),
        displacement=[Displacement(group="base", ux=0, uy=0), Displacement(group="left", ux=0)],
        pressure=Pressure(group="top", value=[[0, 0], *zip(times, loads, strict=True)]),
    )  # fmt: skip
    problem = Problem.of(case)
    states = list(march(problem))
    for state, p in zip(states, loads, strict=True):
        np.testing.assert_allclose(state.zones[0].pressure, p, atol=1e-7)
        if p:
            np.testing.assert_allclose(state.zones[0].gap, problem.joints[0].law.gap_of(np.array([p]))[0], rtol=1e-6)
