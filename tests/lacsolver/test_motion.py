"""Motion with inertia: the bar on a rigid wall, the account of energy in every step, momentum, rest, fall, restarts."""

from dataclasses import replace

import numpy as np
import pytest

import lacsolver as ls
import lacsolver.equilibrium.active_set
import lacsolver.equilibrium.newton
import lacsolver.equilibrium.stepping
from benchmarks.common import blocks
from lacmesh.errors import LacmeshError
from lacsolver.cli.summary import print_summary
from lacsolver.doubts.motion import doubtful_energy
from lacsolver.equilibrium.motion import ENERGIES
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.running import run
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import LinearTolerance
from lacsolver.validation import validate
from tests.lacsolver.moving import DENSITY, SPEED, unbalanced
from tests.problems import case_of, contact, fix, move
from verification.meshes.bars import WIDTH, bar_on_wall, bars
from verification.meshes.thrown import on_wall, ring

#: largest error of the account of energy that is allowed, relative to the largest energy
CLOSED = 1e-10
V = 0.01
SMALL = ls.Material(young=1.0, poisson=0.3, density=DENSITY)
LARGE = replace(SMALL, law="neo_hookean")
SIDEWAYS = fix("x0", "x"), fix("x1", "x")
WALL = contact(master="wall"), ls.Rigid(group="wall")


def case_on_wall(mesh, *records, law=SMALL, **keys):
    """A case of bodies that hit a wall: with `WALL` unless there is another contact."""
    joint = () if any(type(one) is type(WALL[0]) for one in records) else WALL[:1]
    wall = () if any(isinstance(one, ls.Rigid) and one.group == "wall" for one in records) else WALL[1:]
    if "wall" not in mesh.cell_groups:
        wall = ()
    kinematics = "finite" if law.law == "neo_hookean" else "small"
    keys = {"model": "plane_strain" if mesh.space_dim == 2 else "3d", "kinematics": kinematics} | keys
    return case_of(mesh, law, *joint, *wall, *records, **keys)


def moved(*given, start=None, **keys):
    """(the problem, its states in motion, the motion of each)."""
    problem = Problem.of(case_on_wall(*given, **keys))
    states = [s for s in march(problem, start=start) if s.step.motion is not None]
    return problem, states, [s.step.motion for s in states]


def thrown(group, **motion):
    return ls.Initial(groups=[group], **motion)


BAR, HITS = bar_on_wall("QUAD4", 4, 0.05), thrown("bar", vy=-0.5)


def impact(kind, n, cfl=0.5, **dynamics):
    """(motions, errors of the pressures between 10 % and 90 % of the contact, states) of a bar on a wall."""
    dt = cfl / n / SPEED
    wait, last = 2.5 * dt, 2 / SPEED
    count = int(np.ceil((wait + 1.3 * last) / dt))
    mesh = bar_on_wall(kind, n, wait * V)
    up, sides = ("y", SIDEWAYS) if mesh.space_dim == 2 else ("z", (*SIDEWAYS, fix("y0", "y"), fix("y1", "y")))
    motion = thrown("bar", **{f"v{up}": -V}), ls.Dynamics(**dynamics), ls.Steps(end=count * dt, count=count)
    _, states, motions = moved(mesh, *sides, *motion)
    assert unbalanced(motions) < CLOSED
    inside = [s for s in states if 0.1 < (s.time - wait) / last < 0.9]
    return motions, np.array([s.zones[0].pressure / (DENSITY * SPEED * V) - 1 for s in inside]), states


@pytest.mark.slow
def test_a_bar_hits_a_rigid_wall():
    """The exact solution: p = rho c v for a time 2 L / c, then the bar flies back as it came."""
    energy = 0.5 * DENSITY * V**2 * WIDTH
    errors = []
    for n, allowed in ((16, 0.05), (32, 0.01)):
        motions, off, states = impact("QUAD4", n)
        whole = np.array([m.energies[:2].sum() for m in motions]) / energy
        errors.append(np.sqrt((off**2).mean()))
        assert errors[-1] < allowed and whole.max() <= 1.001 and whole[-1] >= 0.99
        assert motions[-1].impulse[0, 1] == pytest.approx(2 * DENSITY * V * WIDTH, rel=3e-3)
        assert not states[-1].zones[0].pressure.any()
    assert errors[1] < errors[0] / 3


@pytest.mark.slow
def test_the_energy_that_opening_makes_is_bounded():
    """At most a quarter of (c dt / h)^2 h / L, by chance of the time in the step at which the bar leaves the wall.

    Half of that is reached for two step sizes, so that it is of the second order; the warning keeps quiet.
    """
    n = 5
    for cfl, phases in ((0.5, (1.1, 1.5, 1.9)), (0.25, (1.5,))):
        bound, dt, made = cfl**2 / n / 4, cfl / n / SPEED, []
        for phase in phases:
            count = round(2.4 * n / cfl)
            motion = ls.Dynamics(), thrown("bar", vy=-V), ls.Steps(end=count * dt, count=count)
            _, states, motions = moved(bar_on_wall("QUAD4", n, phase * dt * V), *SIDEWAYS, *motion)
            table = np.array([m.energies for m in motions])
            made.append(-np.diff(table[:, 4]).min() / table[0, 2])
            assert table[:, :2].sum(axis=1).max() <= (1 + bound) * table[0, 2]
            assert doubtful_energy([s.time for s in states], table, True) is None
        assert bound / 2 < max(made) < bound


def test_a_falling_body_has_no_stress():
    """Exact: y = -g t^2 / 2, momentum -m g t; gravity acts on the mass that has moved from the skins."""
    fall = ls.Dynamics(), ls.Gravity(gy=-0.1), ls.Steps(end=0.5, count=10)
    problem, states, motions = moved(bar_on_wall("QUAD8", 4, 0.1), *fall)
    y = states[-1].u.reshape(-1, 2)[problem.space.attached]
    np.testing.assert_allclose(y, np.tile([0, -0.1 * 0.5**2 / 2], (len(y), 1)), atol=1e-8)
    assert abs(motions[-1].energies[1]) < 1e-12 * motions[-1].energies[0]
    assert motions[-1].linear[1] == pytest.approx(-0.1 * 0.5 * WIDTH * DENSITY, rel=1e-12)
    assert unbalanced(motions) < CLOSED


@pytest.mark.parametrize(("end", "count", "start"), [(2.0, 10, 1.0), (1.0, 4, 0.33)])
def test_a_preload_stays_at_rest(end, count, start):
    """Static steps until `start`, one of which ends there, with contact closed; the first accelerations fit it.

    A preload that the planned steps would miss acts whole at `start`.
    """
    records = *SIDEWAYS, ls.Force(group="top", fy=-0.01), ls.Dynamics(start=start), ls.Steps(end=end, count=count)
    states = list(march(Problem.of(case_on_wall(bar_on_wall("QUAD4", 4), *records))))
    times = sorted({*np.linspace(0, end, count + 1)[1:], start})
    assert [state.time for state in states] == pytest.approx(times)
    held = [state.zones[0].pressure.mean() * WIDTH for state in states]
    assert held == pytest.approx([0.02 * min(t / start, 1) for t in times], rel=1e-10)  # on each of two nodes
    moving = [state.step.motion for state in states if state.step.motion is not None]
    assert len(moving) == sum(t > start for t in times)
    assert max(np.abs(motion.velocity).max() for motion in moving) < 1e-12


def test_the_first_accelerations_fit_contact_that_is_closed():
    """A load that acts at once on a bar that stands on a wall: the wall's pressure at the start is that of no load."""
    falls = *SIDEWAYS, ls.Gravity(gy=-0.1), ls.Dynamics(), ls.Steps(end=0.1, count=4)
    _, _, motions = moved(bar_on_wall("QUAD4", 8), *falls)
    assert unbalanced(motions) < CLOSED
    assert -0.1 * WIDTH < motions[0].linear[1] / 0.025 < 0  # falls, but for its lowest part
    whole = -0.1 * WIDTH * 0.1 + motions[-1].impulse[0, 1]
    assert motions[-1].linear[1] == pytest.approx(whole, rel=1e-8)


def soft(**keys):
    return contact(master="wall", **keys)


STIFFENS = [[0, 5], [0.4, 50]]
TURNS = {"fx": 0.0, "fy": 0.0, "moment": 0.0, "mass": 0.5, "inertia": 0.01}
HOT = ls.Temperature(value="20 * t"), fix("top", "xy"), ls.Dynamics()
PUSHED = ls.Pressure(group="top", value=0.1, follower=True)
#: name -> law, records, and whether the bar's momentum is what contact gives (True), that of both bodies stays (None)
ACCOUNTS = {
    "damped": (SMALL, (ls.Dynamics(rayleigh=[0.1, 0.05]), HITS), False),
    "lumped": (SMALL, (ls.Dynamics(mass="lumped", scheme="newmark"), HITS), True),
    "soft": (SMALL, (soft(stiffness=5.0), ls.Dynamics(), HITS), True),
    "soft, then stiff": (SMALL, (soft(stiffness=STIFFENS), ls.Dynamics(), HITS), True),
    "damped contact, soft, then stiff": (SMALL, (soft(stiffness=STIFFENS, damping=1.0), ls.Dynamics(), HITS), True),
    "wall that moves": (SMALL, (ls.Rigid(group="wall", uy="0.3 * sin(3 * t)"), ls.Dynamics()), False),
    "free wall": (SMALL, (ls.Rigid(group="wall", fx=0.0, fy=0.0, mass=0.5), ls.Dynamics(), HITS), None),
    "heated": (replace(SMALL, expansion=0.01), HOT, False),
    "finite": (LARGE, (ls.Dynamics(), thrown("bar", vx=0.1, vy=-0.5, rotation=0.5)), True),
    "follower": (LARGE, (PUSHED, ls.Dynamics(), HITS), False),
    "wall that turns": (
        LARGE,
        (ls.Rigid(group="wall", **TURNS), ls.Gravity(gx=0.1), ls.Dynamics(), thrown("wall", rotation=2.0), HITS),
        False,
    ),
}


@pytest.mark.rows("free wall", "heated", "wall that turns")
@pytest.mark.parametrize("name", ACCOUNTS)
def test_the_account_of_energy_closes(name):
    """Kinetic + strain - external + damped + contact + numerical is 0 in every step, the impact among them."""
    law, records, pushed = ACCOUNTS[name]
    _, states, motions = moved(BAR, *records, ls.Steps(end=0.2, count=8), law=law)
    assert unbalanced(motions) < CLOSED
    assert any(s.zones[0].pressure.any() for s in states) or name == "heated"
    if pushed is not False:
        given = motions[-1].impulse[0] - motions[0].impulse[0] if pushed else np.zeros(2)
        change = motions[-1].linear - motions[0].linear
        np.testing.assert_allclose(change, given, atol=1e-9 * np.abs(motions[0].linear).max())


# ---- mistakes, and what is said

MISTAKES = [
    (lambda: [ls.Dynamics(alpha=0.5)], "dynamics.alpha is 0.5"),
    (lambda: [ls.Dynamics(scheme="newmark", alpha=0.1)], "dynamics.alpha has an effect only"),
    (lambda: [ls.Dynamics(scheme="newmark", gamma=0.4)], "dynamics.beta and gamma"),
    (lambda: [ls.Dynamics(scheme="newmark", beta=0.2)], "dynamics.beta and gamma are 0.2 and 0.5"),
    (lambda: [ls.Dynamics(start=1.0)], "dynamics.start is 1"),
    (lambda: [ls.Dynamics(rayleigh=[1.0])], "dynamics.rayleigh"),
    (lambda: [ls.Initial(vx=1.0)], r"only with \[dynamics\]"),
    (lambda: [ls.Dynamics(start=0.5), ls.Initial(ux=1.0)], "initial.ux has an effect only"),
    (lambda: [ls.Dynamics(), ls.Initial(vx=1.0, centre=[0.0, 0.0])], "initial.centre has an effect only"),
    (lambda: [ls.Dynamics(), ls.Initial()], "needs at least one of"),
    (lambda: [ls.Rigid(group="wall", fy=1.0), ls.Dynamics()], "'wall' .* has no mass"),
    (lambda: [ls.Rigid(group="wall", moment=1.0, mass=1.0), ls.Dynamics()], "'wall' .* has no inertia"),
    (lambda: [fix("top", "y"), ls.Dynamics(), thrown("bar", vy=-1.0)], "prescribed displacements exclude"),
]


@pytest.mark.parametrize(("records", "words"), MISTAKES, ids=[words for _, words in MISTAKES])
def test_mistakes_are_told(records, words):
    with pytest.raises(LacmeshError, match=words):
        moved(BAR, *records())


def test_a_density_is_needed_and_without_motion_there_is_no_inertia():
    with pytest.raises(ls.CaseError, match="needs a density"):
        case_on_wall(BAR, ls.Dynamics(), law=ls.Material(young=1.0, poisson=0.3, groups=["bar"]))
    assert Problem.of(ls.read_case("data/two_blocks.toml")).inertia is None


def test_a_preload_without_support_is_told_before_the_run():
    found = validate(case_on_wall(bar_on_wall("QUAD4", 4), ls.Dynamics(start=0.5), ls.Steps(end=1.0, count=4)))
    (problem,) = found.problems
    assert "'bar' moves along x, turns about the point (0.125, 0.375)" in problem.message
    assert found.motion is not None


@pytest.mark.rows("skins-1-take smaller steps")
@pytest.mark.parametrize(
    ("massless", "count", "said"),
    [("none", 50, 'take massless = "skins", or smaller steps'), ("skins", 1, "take smaller steps"), ("skins", 50, "")],
)
@pytest.mark.filterwarnings("ignore::lacmesh.LacmeshWarning")
def test_energy_that_is_made_is_warned_of(tmp_path, capsys, massless, count, said):
    """A plain mass makes energy at the impact, a long step loses it in contact; with massless skins nothing is told."""
    how = ls.Dynamics(scheme="newmark", massless=massless), ls.Steps(end=2.5, count=count), ls.Output(every=100)
    case = case_on_wall(bar_on_wall("QUAD4", 8, 0.01), *SIDEWAYS, thrown("bar", vy=-0.1), *how)
    done = run(case, tmp_path / "out")
    assert said in done.message and ("energy" in done.message) == bool(said), done.message
    print_summary(done, tmp_path, "vtu")
    assert "energy taken by" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("value", "more", "told"),
    [
        (-0.1, [ls.Dynamics()], True),
        ("-0.1 * t", [ls.Dynamics()], False),
        (-0.1, [ls.Dynamics(), ls.Initial(uy="-0.1 * y")], False),
        (-0.1, [ls.Dynamics(start=0.5)], False),
    ],
)
def test_a_displacement_that_jumps_at_the_start_is_told(value, more, told):
    """A plain number is a jump; not so a formula that begins at 0, an initial displacement that fits, or a preload."""
    mesh, end = bar_on_wall("QUAD4", 4), ls.Steps(end=1.0, count=4)
    motion = validate(case_on_wall(mesh, *SIDEWAYS, move("top", uy=value), *more, end)).motion
    assert any("by up to 0.1 at once" in said for said in motion.told) == told


def test_contact_between_rigid_bodies_needs_a_stiffness():
    """A bar that is rigid hits a rigid wall: its energy is kept by a stiffness; without one it is warned of."""
    free = ls.Rigid(group="bar", fx=0.0, fy=0.0, moment=0.0), ls.Dynamics(), thrown("bar", vy=-0.1)
    given = BAR, *free, ls.Steps(end=1.5, count=60)
    springs = *given, soft(stiffness=20.0)
    for records, warned in ((given, True), (springs, False)):
        told = validate(case_on_wall(*records)).motion.told
        assert any("have no nodes without mass" in said for said in told) == warned
    _, states, motions = moved(*springs)
    assert unbalanced(motions) < CLOSED
    assert any(state.zones[0].pressure.any() for state in states) and not states[-1].zones[0].pressure.any()
    assert motions[-1].linear[1] == pytest.approx(0.1 * WIDTH, rel=2e-3)


def test_a_step_of_large_contact_work_is_refined():
    """A ring that is thrown in large steps: without smaller ones where it hits, energy is created."""
    flight = ls.Dynamics(scheme="newmark"), thrown("body", vy=-1.0), ls.Steps(end=0.4, count=8)
    mesh = on_wall(ring(24, 2, (0.0, 1.05)))
    _, states, motions = moved(mesh, *flight, law=replace(LARGE, young=100.0))
    table = np.array([m.energies for m in motions])
    whole, work = table[:, :2].sum(axis=1) / table[0, 2], np.abs(np.diff(table[:, 4])) / table[0, 2]
    assert unbalanced(motions) < CLOSED and any(s.halvings for s in states)
    assert work.max() < 0.01 and whole.min() > 0.97 and whole.max() < 1.001


# ---- multigrid


def test_multigrid_takes_a_hierarchy_of_its_own_for_each_size_of_steps():
    """The tiny step of the start has a matrix many times as large as that of the steps, and of the preload."""
    held = fix("bottom", "xyz"), move("top", ux=0.0, uy=0.0, uz="-0.02 * t"), ls.Dynamics(start=0.5), ls.Steps(count=2)
    given = bars(("HEXA8", "HEXA8"), (4, 3), (3, 3)), contact(), *held
    names, law = ("multigrid", "superlu"), replace(SMALL, young=1000.0)
    u, right = (moved(*given, ls.Solver(backend=name), law=law)[1][-1].u for name in names)
    assert np.abs(u - right).max() < 1e-9 * np.abs(right).max()


def elastic_cycles(step, tolerance):
    """V-cycles of (K + c M) q = f from zero, to the tolerance of a solve with contact."""
    rows = step.contact(np.zeros(len(step.f)))
    problem = SaddleProblem(step.reference, rows.rows, np.empty(0, np.int64), step.f, rows.G)
    to = LinearTolerance(0.0, 1e-3 * tolerance, 0.0, 0.0)
    return solve_saddle(problem, np.zeros(len(step.f)), np.zeros(len(rows.G)), to).applications


@pytest.mark.slow
def test_a_step_in_contact_takes_at_most_one_and_a_half_elastic_solves(monkeypatch):
    """A block is thrown on a block; a step in contact is one at whose end macro-elements are closed."""
    n, count = 9, 20
    dt = float(1 / n / np.sqrt(1000.0 * 0.7 / (1.3 * 0.4)))  # a wave crosses a cell
    case = ls.Case(
        model="3d",
        material=[ls.Material(young=1000.0, poisson=0.3, density=1.0)],
        contact=[contact(clearance=f"0.03*((x-0.5)**2+(y-0.5)**2)+{2.5 * dt!r}")],
        displacement=[fix("bottom", "xyz")],
        initial=[thrown("upper", vz=-1.0)],
        dynamics=ls.Dynamics(),
        solver=ls.Solver(backend="multigrid"),
        steps=ls.Steps(end=count * dt, count=count),
    )
    cycles, steps, attempt = [], [], lacsolver.equilibrium.stepping.attempt

    def counted(*arguments):
        made = solve_saddle(*arguments)
        cycles.append(made.applications)
        return made

    for module in (lacsolver.equilibrium.active_set, lacsolver.equilibrium.newton):
        monkeypatch.setattr(module, "solve_saddle", counted)
    monkeypatch.setattr(
        lacsolver.equilibrium.stepping, "attempt", lambda step, *rest: steps.append(step) or attempt(step, *rest)
    )
    problem, spent, alone, energies, closed = Problem.of(case, blocks(n, n - 3, n // 2)), [], [], [], []
    for k, state in enumerate(march(problem)):
        closed.append(int((state.zones[0].status == 1).sum()))
        spent.append(sum(cycles))
        cycles.clear()
        energies.append(state.step.motion.energies)
        if k in (count // 4, count // 2, 3 * count // 4):
            alone.append(elastic_cycles(steps[-1], problem.case.solver.tolerance))
    on, table = np.array(closed) > 0, np.array(energies)
    signs = np.array([-1.0 if name == "external" else 1.0 for name in ENERGIES])
    assert problem.constraints.n_q > 2000 and on.sum() > 12 and max(closed) > 60
    assert np.mean(alone) < 30 and np.array(spent)[on].mean() <= 1.5 * np.mean(alone)
    assert (
        np.abs(table @ signs).max() < 1e-10 * np.abs(table).max() and 0.95 < table[-1, :2].sum() / table[0, 2] < 1.001
    )
