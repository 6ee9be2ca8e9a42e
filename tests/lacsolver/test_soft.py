"""Soft contact (springs, exponentials, tables) against springs in series; the energy that it stores; its damping."""

from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from lacmesh import join
from lacmesh.generate import rectangle
from lacmesh.generate import stack as stacked
from lacsolver.case import CaseError, Dynamics, Initial, Material, Pressure, Rigid, Solver, Steps, Traction
from lacsolver.contact.curves import Exponential, Linear, Table
from lacsolver.contact.damping import Damped
from lacsolver.contact.laws import Bilateral, RowState
from lacsolver.doubts.motion import doubtful_energy
from lacsolver.equilibrium.motion import CONTACT, ENERGIES, STORED
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from tests.lacsolver.contact_cases import checked
from tests.lacsolver.moving import unbalanced
from tests.lacsolver.patch_meshes import stack
from tests.problems import ELASTIC, case_of, contact, fix, move
from tests.samples import each_option
from verification.meshes.bars import bar_on_wall, bars

E = 1000.0
COLUMN = Material(young=E, poisson=0.0)
LARGE = "saint_venant_kirchhoff"


def problem_of(mesh, *records, model="3d", **keys):
    return Problem.of(case_of(mesh, *records, model=model, **keys))


def solve(mesh, *records, **keys):
    return list(march(problem_of(mesh, *records, **keys)))


def exponential(pressure, clearance):
    return {"law": "exponential", "pressure_at_contact": pressure, "clearance_at_zero": clearance}


def table(*rows):
    return {"law": "table", "pressures": rows}


#: from far softer than the bodies to far stiffer; gaskets that harden and that give way
SPRINGS = {f"spring {k:g}": {"stiffness": k} for k in (1.0, 500.0, 1e9)}
CURVES = {f"exponential {c:g}": exponential(1.0, c) for c in (1e-2, 1e-4, 1e-6)} | {
    "soft": table((0.0, 0.0), (0.5, 0.01), (2.0, 0.02)),
    "stiff": table((0.0, -1e-3), (10.0, -5e-4), (1e4, 0.0)),
    "hardens": table((0.0, 0.0), (0.05, 0.002), (1.0, 0.0025), (1e3, 0.003)),
    "gives way": table((0.0, 0.0), (1.0, 1e-5), (1.5, 0.004), (100.0, 0.005)),
}
PLATEAU = table((0.0, 0.0), (3.0, 2e-5), (3.01, 1e-3), (100.0, 0.002))


def law_of(keys):
    """The curve p(g) that the keys of a contact describe."""
    if "stiffness" in keys:
        return Linear(stiffness=keys["stiffness"])
    if keys["law"] == "table":
        return Table(rows=keys["pressures"])
    return Exponential(at_contact=keys["pressure_at_contact"], clearance=keys["clearance_at_zero"])


# ---- the laws


@pytest.mark.parametrize("name", CURVES)
def test_gap_and_slope_belong_to_the_pressure(name):
    law, p = law_of(CURVES[name]), np.geomspace(1e-6, 50.0, 40)
    g = law.gap_of(p)
    assert (g < law.reach).all()
    np.testing.assert_allclose(law.pressure(g), p, rtol=1e-7)
    h = 1e-7 * abs(g[-1] - law.reach)
    slope = (law.pressure(g - h) - law.pressure(g + h)) / (2 * h)
    np.testing.assert_allclose(np.median(slope / law.slope(g)), 1, rtol=1e-5)
    assert law.pressure(np.array([law.reach + 1e-9, 1e3])).tolist() == [0.0, 0.0]
    for stiffness in (1e-3, 1.0, 1e3, 1e6):
        k = np.full(len(p), stiffness)
        np.testing.assert_allclose(law.meeting(p - k * g, k), g, rtol=1e-9, atol=1e-15)
        assert (law.meeting(-k * (law.reach + 1e-9), k) >= law.reach - 1e-15).all()


HARDENING = table((0.0, -0.05), (1.0, 0.0), (9.0, 0.1), (30.0, 0.2))
EACH_LAW = pytest.mark.parametrize("keys", [{"stiffness": 4.0}, exponential(1.0, 0.1), HARDENING])


@EACH_LAW
def test_energy_is_the_area_under_the_curve(keys):
    law = law_of(keys)
    gap = np.linspace(law.reach + 0.05, -0.3, 20001)
    p = law.pressure(gap)
    area = np.append(0.0, np.cumsum(0.5 * (p[1:] + p[:-1]) * -np.diff(gap)))
    np.testing.assert_allclose(law.energy(gap), area, atol=1e-6 * area[-1])


def test_springs_store_energy_in_tension_too_and_rigid_contact_none():
    p, none = np.array([3.0, -3.0]), np.zeros(2)
    rows = RowState(none, p, none > 1, none + 1, np.empty((2, 0)))
    assert Bilateral(compliance=0.5).stored(rows).tolist() == [2.25, 2.25]
    assert not Bilateral().stored(rows).any()


@EACH_LAW
def test_a_damped_law_is_continuous_and_its_equation_its_tangent(keys):
    """The pressure falls with the gap, from 0 at the reach on; the equation has its value and slope."""
    base = law_of(keys)
    law = Damped(base=base, damping=2.0, dt=0.05)
    for history in ([1.0, 0.03, 0.4, 0.05, 0], [1.0, 0.001, -1.0, 0.05, 0], [1.0, 0.0, 0.0, 0.0, 0], [0.0] * 5):
        gap = base.reach - np.linspace(-0.02, 0.2, 4001)
        one = np.ones(len(gap))
        rows = RowState(gap, 0 * one, one > 0, 1e-3 * one, np.tile(history, (len(gap), 1)))
        p = law.total(rows)
        steepest = (base.slope(gap).max() + 2.0 * 1.5 / 0.05) * 0.22 / 4000
        assert (np.diff(p) >= 0).all() and np.diff(p).max() <= 1.01 * steepest
        assert not p[gap >= base.reach].any()
        offset, compliance = law.linearise(rows._replace(pressure=p))
        on = p > 1e-9
        np.testing.assert_allclose((gap + compliance * p - offset)[on], 0.0, atol=1e-9)
        slope = np.diff(p) / -np.diff(gap)
        smooth = on[1:] & on[:-1] & (np.abs(slope * compliance[1:] - 1) < 0.02)
        assert smooth[on[1:]].mean() > 0.98


# ---- statics: two columns of height 1 and the contact in series

GEOMETRIES = "reference", "current"
#: of a tolerance, the iterations
ITERATIONS = {1e-10: 8, 1e-12: 12}
#: nominal stress of a column by its stretch
STRESS = {"elastic": lambda s: E * (1 - s), LARGE: lambda s: E * s * (1 - s**2) / 2}


def in_series(curve, stress, d, pulls):
    """(gap, pressure) of a contact between columns that are together g + d shorter."""
    if not pulls and -d >= curve.reach:
        return -d, 0.0

    def pressure(g):
        return -curve.stiffness * g if pulls else float(curve.pressure(np.array([g]))[0])

    def shortened(g):
        return stress(1 - (g + d) / 2)

    gap = brentq(lambda g: pressure(g) - shortened(g), *sorted((-d, curve.reach)), xtol=1e-16)
    return gap, shortened(gap)


def press_columns(keys, d=0.01, dim=3, law="elastic", tolerance=1e-10, backend="superlu", most=None):
    """Press by d, release, press by half, pull far apart."""
    distances = d * np.array([1.0, -0.2, 0.5, -2.0])
    up, curve, pulls = "xyz"[dim - 1], law_of(keys), keys.get("type") == "bilateral"
    top = move("top", **{f"u{up}": [[0, 0], *([t, -d] for t, d in enumerate(distances.tolist(), 1))]})
    states = solve(
        stack(*(("QUAD4", "TRIA3") if dim == 2 else ("HEXA8", "TETRA4")), dim),
        *(Material(young=E, poisson=0.0, law=law), contact(**keys), top, fix("bottom", up)),
        *(fix(f"{a}0", a) for a in "xy"[: dim - 1]),
        *(Steps(count=4, end=4.0, max_halvings=0), Solver(threads=1, tolerance=tolerance, backend=backend)),
        kinematics="small" if law == "elastic" else "finite",
        model="3d" if dim == 3 else "plane_strain",
    )
    for state, d in zip(states, distances, strict=True):
        (zone,), (gap, p) = state.zones, in_series(curve, STRESS[law], d, pulls)
        np.testing.assert_allclose(zone.gap, gap, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(zone.pressure, p, rtol=20 * tolerance, atol=20 * tolerance)
        assert (zone.status == (p != 0)).all() and not state.halvings
        assert state.iterations <= (most or ITERATIONS[tolerance])


@pytest.mark.rows("soft-current-1e-12", "stiff-reference-1e-10")
@pytest.mark.parametrize("name, geometry, tolerance", each_option(product(CURVES, GEOMETRIES, ITERATIONS)))
def test_columns_with_a_curve(name, geometry, tolerance):
    press_columns(CURVES[name] | {"geometry": geometry}, tolerance=tolerance)


@pytest.mark.rows("spring 1e+09-reference-superlu")
@pytest.mark.parametrize("name, geometry, backend", each_option(product(SPRINGS, GEOMETRIES, ["superlu", "multigrid"])))
def test_columns_with_a_spring(name, geometry, backend):
    press_columns(SPRINGS[name] | {"geometry": geometry}, backend=backend)


@pytest.mark.rows("more0-options0", "more2-options2")
@pytest.mark.parametrize(
    "more, options", [({}, {"dim": 2}), ({}, {"law": LARGE, "d": 0.3, "most": 20}), ({"type": "bilateral"}, {})]
)
def test_columns_in_a_plane_with_large_strains_and_with_a_spring_that_pulls(more, options):
    press_columns(SPRINGS["spring 500"] | more, **options)


@pytest.mark.rows("reference")
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_columns_on_a_plateau(geometry):
    """Pressures within 1/300 of each other, between two parts of a table that are 15,000 times as stiff."""
    press_columns(PLATEAU | {"geometry": geometry}, most=15)


def test_skins_without_unknowns_overlap_in_soft_contact():
    blocks = stack("HEXA8", "HEXA8", 3, counts=(2, 2))
    held = *(fix(g, "xyz") for g in ("slave", "bottom", "top")), fix("master", "xy"), move("master", uz=-0.002)
    (state,) = solve(blocks, COLUMN, contact(stiffness=300.0), *held)
    np.testing.assert_allclose(state.zones[0].pressure, 0.6, rtol=1e-12)


@pytest.mark.parametrize("load", [1e-9, 1e-6, 1e-3])
def test_a_load_near_nothing_finds_the_beginning_of_an_exponential(load):
    """A curve that begins without a slope, and a block that hangs on it alone along the normal."""
    held = fix("bottom", "xyz"), fix("top", "xy"), Pressure(group="top", value=load), Steps(max_halvings=0)
    exact = Solver(threads=1, tolerance=1e-12)  # 1e-10 of the gap are 5e-6 of the least load
    block, joint = Material(young=1e2, poisson=0.0), contact(**exponential(0.2, 0.05))
    (state,) = solve(stack("HEXA8", "HEXA8", 3, counts=(2, 3)), block, joint, *held, exact)
    np.testing.assert_allclose(state.zones[0].pressure, load, rtol=1e-6)
    assert state.iterations <= 16


def under_load(stiffness, kinematics="small", kind="unilateral"):
    """Two blocks under a constant pressure of 0.5."""
    load = Traction(group="top", ty=[[0.0, -0.5], [9.0, -0.5]])
    material = Material(young=E, poisson=0.0, law={"small": "elastic", "finite": "neo_hookean"}[kinematics])
    records = material, contact(stiffness=stiffness, type=kind), fix("bottom", "xy"), fix("top", "x"), load
    blocks = stack("QUAD4", "QUAD4", 2, counts=(3, 3), even=True)
    return solve(blocks, *records, Steps(end=3.0, count=6), kinematics=kinematics, model="plane_strain")


@pytest.mark.parametrize("kind, kinematics", each_option(product(("unilateral", "bilateral"), ("small", "finite"))))
def test_overlap_follows_a_stiffness_that_changes_with_time(kind, kinematics):
    """Under a constant pressure the overlap is p / k(t) in every step, as k rises and falls."""
    rows = [[0.0, 50.0], [1.0, 50.0], [2.0, 400.0], [3.0, 20.0]]
    states = under_load(rows, kinematics, kind)
    assert len(states) == 6
    for state in states:
        np.testing.assert_allclose(state.zones[0].pressure, 0.5, rtol=1e-7)
        np.testing.assert_allclose(state.zones[0].gap, -0.5 / np.interp(state.time, *np.transpose(rows)), rtol=1e-7)


def test_a_stiffness_that_falls_to_0_is_refused():
    with pytest.raises(CaseError, match="stiffness is 0 at t = 1"):
        under_load("1 - t")


#: curves without a slope where they begin, or with hardly one
TOES = {
    "exponential": exponential(2.0, 0.01),
    "stiff exponential": exponential(200.0, 0.01),
    "thin exponential": exponential(10.0, 0.001),
    "soft toe": table((0.0, 0.0), (1e-3, 0.01), (50.0, 0.02)),
    "toe without a slope": table((0.0, 0.0), (1e-11, 0.01), (50.0, 0.02)),
    "straight": table((0.0, 0.0), (50.0, 0.02)),
}


@pytest.mark.rows("toe without a slope-small")
@pytest.mark.parametrize("name, kinematics", each_option(product(TOES, ("small", "finite"))))
def test_a_block_comes_down_over_a_gap_and_again_after_it_was_let_go(name, kinematics):
    """Nothing but contact holds it down, and where the curve begins it has no slope."""
    mesh = stacked(rectangle(2), rectangle((3, 2)).renamed(left="side"), gap=0.05)
    loads = [5, 0, 0, 5, 0, 20]
    times = [float(t) for t in range(1, len(loads) + 1)]
    problem = problem_of(
        mesh, Material(young=E, poisson=0.0, law="elastic" if kinematics == "small" else "neo_hookean"),
        contact(geometry="current", **TOES[name]), fix("bottom", "xy"), fix("side", "x"), Steps(times=times),
        Pressure(group="top", value=[[0, 0], *zip(times, loads, strict=True)]), model="plane_strain",
        kinematics=kinematics,
    )  # fmt: skip
    for state, p in zip(march(problem), loads, strict=True):
        np.testing.assert_allclose(state.zones[0].pressure, p, atol=1e-7)
        if p:
            np.testing.assert_allclose(state.zones[0].gap, problem.joints[0].law.gap_of(np.array([p]))[0], rtol=1e-6)


# ---- motion: a bar, as good as rigid, on a soft foundation

#: mass, stiffness and damping of the contact, per area; the bar's width
M, K, C, WIDTH = 1.0, 4.0, 0.6, 0.25
FOUNDATIONS = [{"stiffness": K}, exponential(0.4, 0.1), table((0.0, -0.02), (0.1, 0.0), (0.9, 0.1))]
SOFT, DAMPED = ENERGIES.index("soft_contact"), ENERGIES.index("damped")


def motion_of(mesh, keys, kinematics, *records):
    """(states in motion of a bar, their energies); the account of energies closes."""
    bar = Material(young=1e5, poisson=0.0, density=1.0, law={"small": "elastic"}.get(kinematics, LARGE))
    wall = contact(**keys, master="wall"), Rigid(group="wall"), fix("x0", "x"), fix("x1", "x")
    states = solve(mesh, bar, *wall, *records, kinematics=kinematics, model="plane_strain")
    states = [state for state in states if state.step.motion is not None]
    assert unbalanced([state.step.motion for state in states]) < 1e-8
    return states, np.array([state.step.motion.energies for state in states])


@pytest.mark.rows("keys0-small")
@pytest.mark.parametrize("keys, kinematics", each_option(product(FOUNDATIONS, ("small", "finite"))))
def test_a_bar_bounces_and_contact_gives_back_what_it_stored(keys, kinematics):
    """No step is halved for it, and the account of energy raises no doubt."""
    thrown = Initial(groups=["bar"], vy=-0.1), Dynamics(), Steps(end=3.0, count=40)
    states, energies = motion_of(bar_on_wall("QUAD4", 2, 0.05), keys, kinematics, *thrown)
    start = energies[0, STORED].sum()
    assert len(states) == 40 and doubtful_energy([s.time for s in states], energies, True) is None
    assert energies[:, SOFT].max() > 0.9 * start and not energies[-1, SOFT]
    assert np.abs(energies[:, CONTACT]).max() < 0.01 * start


@pytest.mark.rows("small")
@pytest.mark.parametrize("kinematics", ["small", "finite"])
def test_a_foundation_that_was_pressed_throws_the_bar(kinematics):
    """Energy stored by static steps is there when the motion starts, and becomes kinetic, with nothing added."""
    released = Pressure(group="top", value="0.4 if t < 1.001 else 0"), Dynamics(start=1.0)
    times = Steps(times=[1.0, *np.linspace(1.002, 3, 41).tolist()])
    states, energies = motion_of(bar_on_wall("QUAD4", 2), FOUNDATIONS[0], kinematics, *released, times)
    start = WIDTH * 0.4**2 / (2 * K)
    assert energies[0, SOFT] == pytest.approx(start, rel=1e-4)
    assert energies[-1, 0] == pytest.approx(start, rel=0.02)
    assert not energies[-1, SOFT] and doubtful_energy([s.time for s in states], energies, True) is None


# ---- damping of soft contact, against the damped oscillator


def oscillator(t):
    """Overlaps and their rates, (2, n), of M y'' + C y' + K y = 0.3 + 0.1 cos 3 t from rest at the first load on."""

    def rate(t, y):
        return [y[1], (0.3 + 0.1 * np.cos(3 * t) - K * y[0] - C * y[1]) / M]

    return solve_ivp(rate, (0, 10), [0.1, 0.0], rtol=1e-11, atol=1e-13, dense_output=True).sol(t)


def swung(times, kinematics="small", **dynamics):
    """A bar on its soft foundation, pressed and then shaken: times, overlaps, energies."""
    load = Pressure(group="top", value="0.4 * t if t <= 1 else 0.3 + 0.1 * cos(3 * (t - 1))")
    steps = Steps(times=[1.0, *(1 + np.asarray(times)).tolist()]), Dynamics(start=1.0, **dynamics)
    joint = {"stiffness": K, "damping": C}
    states, energies = motion_of(bar_on_wall("QUAD4", 2), joint, kinematics, load, *steps)
    return np.array([s.time - 1 for s in states]), -np.array([s.zones[0].gap.mean() for s in states]), energies


@pytest.mark.slow
@pytest.mark.parametrize("dynamics", [{}, pytest.param({"scheme": "newmark"}, marks=pytest.mark.slow)])
def test_the_damped_oscillator(dynamics):
    """Overlaps are those of the exact damped oscillation, with errors that fall with the square of the step."""
    errors = []
    for count in (40, 80):
        t, overlap, _ = swung(4.0 * np.arange(1, count + 1) / count, **dynamics)
        errors.append(np.abs(overlap - oscillator(t)[0]).max() / 0.05)
    assert errors[1] < 0.006 and errors[1] < errors[0] / 3.3


@pytest.mark.slow
def test_steps_of_unlike_sizes_keep_the_order():
    """Every third step is shorter: the rate of the overlap knows the steps' sizes."""
    t, overlap, _ = swung(np.cumsum([0.08 if k % 3 else 0.03 for k in range(60)]), scheme="newmark")
    assert np.abs(overlap - oscillator(t)[0]).max() / 0.05 < 0.02


def test_each_of_two_zones_has_its_own_history():
    """Two pairs of bodies side by side, each with damped contact, move as one pair does."""
    one, joint = bars(("QUAD4", "TRIA3"), (2, 2), (2, 1)), {"stiffness": 50.0, "damping": 5.0}
    two = join(one, one.moved((5, 0)).renamed(slave="second", master="below"))
    records = Material(young=1000.0, poisson=0.3, density=2.0), contact(**joint), fix("bottom", "xy"), Dynamics()
    thrown = Initial(groups=["upper"], vy=-0.1), Steps(end=0.2, count=4)
    other = contact(slave="second", master="below", **joint)
    alone, both = (
        solve(mesh, *records, *thrown, *more, model="plane_strain")[-1].zones
        for mesh, more in ((one, ()), (two, (other,)))
    )
    assert alone[0].pressure.max() > 0.1
    for zone in both:
        np.testing.assert_allclose(zone.pressure, alone[0].pressure, rtol=1e-9, atol=1e-9)


def test_bodies_on_a_gasket_in_space():
    """Friction, a table, and two bodies that do not match: the account of energy closes, and damping takes."""
    gasket = contact(**table((0.0, 0.0), (0.1, 0.02), (1.0, 0.05)), friction=0.2, damping=0.3)
    records = Material(young=1.0, poisson=0.3, density=1.0), gasket, fix("bottom", "xyz"), Dynamics()
    thrown = Initial(groups=["upper"], vz=-0.1, vx=0.02), Steps(end=1.0, count=20)
    _, states = checked(problem_of(bars(("HEXA8", "TETRA4"), (3, 2), (2, 1), 0.01), *records, *thrown))
    motions = [state.step.motion for state in states if state.step.motion is not None]
    assert motions[-1].energies[DAMPED] > 1e-6 and unbalanced(motions) < 1e-8
    assert max(s.zones[0].pressure.max() for s in states) > 0.01


@pytest.mark.parametrize(("keys", "more", "words"), [
    ({"stiffness": 4.0, "damping": 1.0}, (), "has no effect without"),
    ({"damping": 1.0}, (Dynamics(),), "rigid contact has no overlap"),
    ({"stiffness": 4.0, "damping": -1.0}, (Dynamics(),), "damping"),
    ({"type": "bilateral", "stiffness": 4.0, "damping": 1.0}, (Dynamics(),), "damping"),
    ({"stiffness": 0.0}, (), "stiffness"),
])  # fmt: skip
def test_what_is_refused(keys, more, words):
    with pytest.raises(CaseError, match=words):
        case_of("none.msh", ELASTIC, contact(**keys), *more, model="plane_strain")
