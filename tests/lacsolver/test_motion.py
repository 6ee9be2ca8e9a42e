"""Motion with inertia: the bar on a rigid wall, the account of energy in every step, momentum, rest, fall, restarts."""

import warnings
from unittest.mock import patch

import numpy as np
import pytest

from lacsolver.case import parse_case, read_case
from lacsolver.cli.summary import print_summary
from lacsolver.equilibrium.stepping import march
from lacsolver.problem.problem import Problem
from lacsolver.results.motion import MotionState, doubtful_energy
from lacsolver.results.results import Restart
from lacsolver.running import run
from lacsolver.validation import validate
from tests.lacsolver.moving import (
    DENSITY,
    FINITE,
    PLANE,
    SMALL,
    SPACE,
    SPEED,
    WALL,
    held_sideways,
    moved,
    steps,
    thrown,
    unbalanced,
)
from verification.meshes.bars import WIDTH, bar_on_wall, bars
from verification.meshes.thrown import on_wall, ring

#: largest error of the account of energy that is allowed, relative to the largest energy
CLOSED = 1e-10
V = 0.01


def impact(kind, n, more="", cfl=0.5, dim=2):
    """(motions, errors of the pressures between 10 % and 90 % of the contact, states) of a bar on a wall."""
    dt = cfl / n / SPEED
    wait, last = 2.5 * dt, 2 / SPEED
    count = int(np.ceil((wait + 1.3 * last) / dt))
    text = (PLANE if dim == 2 else SPACE) + SMALL + WALL + held_sideways(dim) + f"[dynamics]\n{more}"
    text += thrown("bar", **{f"v{'xyz'[dim - 1]}": -V}) + steps(count * dt, count)
    _, states, motions = moved(text, bar_on_wall(kind, n, wait * V))
    inside = [s for s in states if 0.1 < (s.time - wait) / last < 0.9]
    return motions, np.array([s.zones[0].pressure / (DENSITY * SPEED * V) - 1 for s in inside]), states


def test_a_bar_hits_a_rigid_wall():
    """The exact solution: p = rho c v for a time 2 L / c, then the bar flies back as it came."""
    energy = 0.5 * DENSITY * V**2 * WIDTH
    errors = []
    for n, allowed in ((16, 0.05), (32, 0.01)):
        motions, off, states = impact("QUAD4", n)
        whole = np.array([m.energies[:2].sum() for m in motions]) / energy
        errors.append(np.sqrt((off**2).mean()))
        assert errors[-1] < allowed
        assert whole.max() <= 1.001
        assert whole[-1] >= 0.99
        assert unbalanced(motions) < CLOSED
        assert motions[-1].impulse[0, 1] == pytest.approx(2 * DENSITY * V * WIDTH, rel=3e-3)
        assert not states[-1].zones[0].pressure.any()
    assert errors[1] < errors[0] / 3


def test_the_energy_that_opening_makes_is_bounded():
    """At most a quarter of (c dt / h)^2 h / L, by chance of the time in the step at which the bar leaves the wall.

    Half of that is reached for two step sizes, so that it is of the second order; the warning keeps quiet.
    """
    n = 5
    for cfl, phases in ((0.5, (1.1, 1.5, 1.9)), (0.25, (1.5,))):
        bound, dt, made = cfl**2 / n / 4, cfl / n / SPEED, []
        for phase in phases:
            count = round(2.4 * n / cfl)
            text = PLANE + SMALL + WALL + held_sideways() + "[dynamics]\n" + thrown("bar", vy=-V)
            _, states, motions = moved(text + steps(count * dt, count), bar_on_wall("QUAD4", n, phase * dt * V))
            table = np.array([m.energies for m in motions])
            made.append(-np.diff(table[:, 4]).min() / table[0, 2])
            assert table[:, :2].sum(axis=1).max() <= (1 + bound) * table[0, 2]
            assert doubtful_energy([s.time for s in states], table, True) is None
        assert bound / 2 < max(made) < bound


@pytest.mark.slow
def test_with_a_plain_mass_the_same_impact_fails():
    """Mutation: with mass on the skins pressures alternate, and Newmark's method creates energy."""
    motions, off, _ = impact("QUAD4", 16, 'scheme = "newmark"\nmassless = "none"\n', cfl=0.25)
    assert np.sqrt((off**2).mean()) > 0.5
    assert max(m.energies[:2].sum() for m in motions) > 1.02 * motions[0].energies[:2].sum()
    assert unbalanced(motions) < CLOSED


def test_in_space_too():
    motions, off, _ = impact("HEXA8", 8, dim=3)
    assert np.sqrt((off**2).mean()) < 0.15
    assert 0.98 < motions[-1].energies[:2].sum() / motions[0].energies[:2].sum() < 1.001
    assert unbalanced(motions) < CLOSED


def test_a_falling_body_has_no_stress():
    """Exact: y = -g t^2 / 2, momentum -m g t; gravity acts on the mass that has moved from the skins."""
    text = PLANE + SMALL + WALL + "[dynamics]\n[gravity]\ngy = -0.1\n" + steps(0.5, 10)
    problem, states, motions = moved(text, bar_on_wall("QUAD8", 4, 0.1))
    y = states[-1].u.reshape(-1, 2)[problem.space.attached]
    np.testing.assert_allclose(y, np.tile([0, -0.1 * 0.5**2 / 2], (len(y), 1)), atol=1e-8)
    assert abs(motions[-1].energies[1]) < 1e-12 * motions[-1].energies[0]
    assert motions[-1].linear[1] == pytest.approx(-0.1 * 0.5 * WIDTH * DENSITY, rel=1e-12)
    assert unbalanced(motions) < CLOSED


def test_a_preload_stays_at_rest():
    """Static steps until `start`, with contact closed; then the first accelerations and pressures are consistent."""
    text = PLANE + SMALL + WALL + held_sideways() + '[[force]]\ngroup = "top"\nfy = -0.01\n[dynamics]\nstart = 1.0\n'
    _, states, motions = moved(text + steps(2.0, 10), bar_on_wall("QUAD4", 4))
    held = [s.zones[0].pressure for s in states]
    assert (held[0] > 0).all()
    np.testing.assert_allclose(held[-1], held[0], rtol=1e-10)
    assert max(np.abs(m.velocity).max() for m in motions) < 1e-12


def test_the_first_accelerations_fit_contact_that_is_closed():
    """A load that acts at once on a bar that stands on a wall: the wall's pressure at the start is that of no load."""
    text = PLANE + SMALL + WALL + held_sideways() + "[gravity]\ngy = -0.1\n[dynamics]\n" + steps(0.1, 4)
    _, _, motions = moved(text, bar_on_wall("QUAD4", 8))
    assert unbalanced(motions) < CLOSED
    assert -0.1 * WIDTH < motions[0].linear[1] / 0.025 + 0.0 < 0  # falls, but for its lowest part
    whole = -0.1 * WIDTH * 0.1 + motions[-1].impulse[0, 1]
    assert motions[-1].linear[1] == pytest.approx(whole, rel=1e-8)


ACCOUNTS = {
    "damped": (SMALL, WALL + "[dynamics]\nrayleigh = [0.1, 0.05]\n" + thrown("bar", vy=-0.5)),
    "lumped": (SMALL, WALL + '[dynamics]\nmass = "lumped"\nscheme = "newmark"\n' + thrown("bar", vy=-0.5)),
    "soft": (SMALL, WALL.replace("[[rigid]]", "stiffness = 5.0\n[[rigid]]") + "[dynamics]\n" + thrown("bar", vy=-0.5)),
    "soft, then stiff": (
        SMALL,
        WALL.replace("[[rigid]]", "stiffness = [[0, 5], [0.4, 50]]\n[[rigid]]") + "[dynamics]\n"
        + thrown("bar", vy=-0.5),
    ),
    "damped contact, soft, then stiff": (
        SMALL,
        WALL.replace("[[rigid]]", "stiffness = [[0, 5], [0.4, 50]]\ndamping = 1.0\n[[rigid]]") + "[dynamics]\n"
        + thrown("bar", vy=-0.5),
    ),
    "wall that moves": (SMALL, WALL + 'uy = "0.3 * sin(3 * t)"\n[dynamics]\n'),
    "free wall": (SMALL, WALL + "fx = 0.0\nfy = 0.0\nmass = 0.5\n[dynamics]\n" + thrown("bar", vy=-0.5)),
    "heated": (
        SMALL + "expansion = 0.01\n",
        WALL + '[[temperature]]\nvalue = "20 * t"\n[[displacement]]\ngroup = "top"\nux = 0.0\nuy = 0.0\n[dynamics]\n',
    ),
    "finite": (FINITE, WALL + "[dynamics]\n" + thrown("bar", vx=0.1, vy=-0.5, rotation=0.5)),
    "follower": (
        FINITE,
        WALL + '[[pressure]]\ngroup = "top"\nvalue = 0.1\nfollower = true\n[dynamics]\n' + thrown("bar", vy=-0.5),
    ),
    "wall that turns": (
        FINITE,
        WALL + "fx = 0.0\nfy = 0.0\nmoment = 0.0\nmass = 0.5\ninertia = 0.01\n[gravity]\ngx = 0.1\n[dynamics]\n"
        + thrown("wall", rotation=2.0) + thrown("bar", vy=-0.5),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ACCOUNTS)
def test_the_account_of_energy_closes(name):
    """Kinetic + strain - external + damped + contact + numerical is 0 in every step, the impact among them."""
    law, rest = ACCOUNTS[name]
    text = PLANE + law + rest + steps(0.2, 8)
    problem, states, motions = moved(text, bar_on_wall("QUAD4", 4, 0.05))
    assert unbalanced(motions) < CLOSED
    assert any(s.zones[0].pressure.any() for s in states) or name == "heated"
    if not (problem.case.gravity or name in ("wall that moves", "heated", "follower")):
        pushed = motions[-1].linear - motions[0].linear
        free = name == "free wall"  # its momentum is counted too
        wanted = np.zeros(2) if free else motions[-1].impulse[0] - motions[0].impulse[0]
        if name != "damped":
            np.testing.assert_allclose(pushed, wanted, atol=1e-9 * np.abs(motions[0].linear).max())


def test_free_rigid_body_turns_as_it_should():
    """A free rigid body alone: constant momentum, angular momentum and energy of the second order in dt."""
    errors = []
    for count in (10, 20):
        text = PLANE + FINITE + '[[rigid]]\ngroup = "wall"\nfx = 0.0\nfy = 0.0\nmoment = 0.0\nmass = 0.5\n'
        text += "inertia = 0.01\n[dynamics]\nalpha = 0.0\n" + thrown("wall", vx=1.0, rotation=5.0) + steps(0.5, count)
        _, states, motions = moved(text, bar_on_wall("QUAD4", 4, 0.05))
        assert unbalanced(motions) < CLOSED
        assert motions[-1].linear == pytest.approx([0.5, 0.0], abs=1e-12)
        errors.append(abs(states[-1].rigid["wall"][2] - 2.5))
    assert errors[0] < 0.05 * 2.5
    assert errors[1] < errors[0] / 3.5


def test_two_bars_exchange_their_velocities():
    """Bars that do not match: the upper one stays at rest after the impact, the lower one flies on."""
    n = 16
    dt = 0.5 / n / SPEED
    count = int(np.ceil((2.5 * dt + 2.6 / SPEED) / dt))
    text = PLANE + SMALL + '[[contact]]\nslave = "slave"\nmaster = "master"\n[dynamics]\n' + held_sideways()
    text += thrown("upper", vy=-V) + steps(count * dt, count)
    problem, states, motions = moved(text, bars(("QUAD4", "TRIA6"), (n, n - 2), (4, 3), 2.5 * dt * V))
    assert unbalanced(motions) < CLOSED
    assert not states[-1].zones[0].pressure.any()
    v = problem.inertia.M @ motions[-1].velocity
    upper = np.unique(np.concatenate([b.nodes[np.isin(b.cell, problem.space.mesh.cells_of("upper"))].ravel()
                                      for b in problem.space.blocks]))  # fmt: skip
    along = v.reshape(-1, 2)[:, 1]
    assert along[upper].sum() / (DENSITY * WIDTH) == pytest.approx(0.0, abs=0.02 * V)
    assert along.sum() / (DENSITY * WIDTH) == pytest.approx(-V, rel=1e-10)


@pytest.mark.parametrize("law", [SMALL, FINITE], ids=["small", "finite"])
def test_a_run_goes_on_to_the_last_bit(law):
    text = PLANE + law + WALL + "[dynamics]\nrayleigh = [0.1, 0.0]\n" + thrown("bar", vy=-0.5) + steps(0.24, 12)
    mesh = bar_on_wall("QUAD4", 4, 0.05)
    _, states, motions = moved(text, mesh)
    restart = Restart.of(states[6], states[6].step.step_size, 7)
    _, again, more = moved(text, mesh, start=restart)
    assert [s.time for s in again] == [s.time for s in states[7:]]
    np.testing.assert_array_equal(again[-1].u, states[-1].u)
    for name, value in motions[-1]._asdict().items():
        np.testing.assert_array_equal(getattr(more[-1], name), value, err_msg=name)


def test_a_static_case_is_as_before():
    problem = Problem.of(read_case("data/two_blocks.toml"))
    assert problem.inertia is None


MISTAKES = {
    "[dynamics]\nalpha = 0.5\n": "dynamics.alpha is 0.5; it must be >= 0 and <= 0.333333",
    '[dynamics]\nscheme = "newmark"\nalpha = 0.1\n': 'dynamics.alpha means something only with scheme = "hht"',
    '[dynamics]\nscheme = "newmark"\ngamma = 0.4\n': "dynamics.beta and gamma are 0.25 and 0.4, which is not stable",
    "[dynamics]\nstart = 1.0\n": "dynamics.start is 1, and the steps end at 1",
    "[dynamics]\nrayleigh = [1.0]\n": "dynamics.rayleigh is a list of 1; it takes two numbers >= 0",
    "[[initial]]\nvx = 1.0\n": r"\[\[initial\]\] means something only with \[dynamics\]",
    "[dynamics]\nstart = 0.5\n[[initial]]\nux = 1.0\n": "initial.ux means something only with start = 0",
    "[dynamics]\n[[initial]]\nvx = 1.0\ncentre = [0.0, 0.0]\n": "initial.centre means something only with rotation",
    "[dynamics]\n[[initial]]\n": r"\[\[initial\]\] needs at least one of vx, vy",
}


@pytest.mark.parametrize("rest", MISTAKES)
def test_mistakes_are_told(rest):
    with pytest.raises(Exception, match=MISTAKES[rest]):
        parse_case(PLANE + SMALL + WALL + rest)


def test_a_density_is_needed():
    with pytest.raises(Exception, match=r"\[\[material\]\] needs a density, for the cells of 'bar' have a mass"):
        parse_case(PLANE + '[[material]]\ngroups = ["bar"]\nyoung = 1.0\npoisson = 0.3\n[dynamics]\n')


@pytest.mark.parametrize(
    ("rest", "said"),
    [
        (WALL + "fy = 1.0\n[dynamics]\n", "'wall' moves freely under its loads and has no mass"),
        (WALL + "moment = 1.0\nmass = 1.0\n[dynamics]\n", "'wall' moves freely under its loads and has no inertia"),
        (
            WALL + '[[displacement]]\ngroup = "top"\nuy = 0.0\n[dynamics]\n' + thrown("bar", vy=-1.0),
            "gives nodes .* a velocity that prescribed displacements exclude",
        ),
    ],
)
def test_what_does_not_fit_the_mesh_is_told(rest, said):
    with pytest.raises(Exception, match=said):
        moved(PLANE + SMALL + rest + steps(1.0, 2), bar_on_wall("QUAD4", 4, 0.05))


def test_motion_is_kept_in_the_state():
    text = PLANE + SMALL + WALL + "[dynamics]\n" + thrown("bar", vy=-0.5) + steps(0.02, 1)
    _, states, motions = moved(text, bar_on_wall("QUAD4", 4, 0.05))
    assert set(states[-1].step.histories.scheme) == set(MotionState._fields)
    assert motions[-1].linear == pytest.approx([0.0, -0.5 * WIDTH], abs=1e-12)


def test_a_step_ends_at_the_start_of_motion():
    """A preload that the planned steps would miss: all of it acts at `start`, and the motion is at rest then."""
    text = PLANE + SMALL + WALL + held_sideways() + '[[force]]\ngroup = "top"\nfy = -0.01\n[dynamics]\nstart = 0.33\n'
    problem = Problem.of(parse_case(text + steps(1.0, 4)), bar_on_wall("QUAD4", 4))
    states = list(march(problem))
    assert [state.time for state in states] == pytest.approx([0.25, 0.33, 0.5, 0.75, 1.0])
    held = [state.zones[0].pressure.mean() * WIDTH for state in states]
    assert held == pytest.approx([0.02 * 0.25 / 0.33, *[0.02] * 4], rel=1e-9)  # on each of two nodes
    moving = [state.step.motion for state in states if state.step.motion is not None]
    assert len(moving) == 3 and max(np.abs(m.velocity).max() for m in moving) < 1e-12


def test_a_preload_without_support_is_told_before_the_run():
    found = validate(
        parse_case(PLANE + SMALL + WALL + "[dynamics]\nstart = 0.5\n" + steps(1.0, 4)), bar_on_wall("QUAD4", 4)
    )
    assert [problem.message.partition(";")[0] for problem in found.problems] == [
        "nothing holds a part of the model: 'bar' moves along x, turns about the point (0.125, 0.375)"
    ]
    assert found.motion is not None


def test_energy_that_is_made_is_warned_of(tmp_path, capsys):
    """A plain mass makes energy at the impact, a long step loses it in contact; with massless skins nothing is told."""
    for massless, count, said in (
        ("none", 50, 'take massless = "skins", or smaller steps'),
        ("skins", 1, "as steps do not resolve the impact; take smaller steps"),
        ("skins", 50, ""),
    ):
        text = PLANE + SMALL + WALL + held_sideways() + thrown("bar", vy=-0.1) + steps(2.5, count)
        text += f'[output]\nevery = 100\n[dynamics]\nscheme = "newmark"\nmassless = "{massless}"\n'
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            done = run(parse_case(text), tmp_path / f"{massless}{count}", mesh=bar_on_wall("QUAD4", 8, 0.01))
        assert said in done.message and ("energy" in done.message) == bool(said), done.message
    print_summary(done, tmp_path, "vtu")
    assert "energy taken by" in capsys.readouterr().out


def test_a_displacement_that_jumps_at_the_start_is_told():
    """A plain number is a jump; not so a formula that begins at 0, an initial displacement that fits, or a preload."""
    mesh, end = bar_on_wall("QUAD4", 4), steps(1.0, 4)
    for value, more, told in (
        ("-0.1", "[dynamics]\n", True),
        ('"-0.1 * t"', "[dynamics]\n", False),
        ("-0.1", '[dynamics]\n[[initial]]\nuy = "-0.1 * y"\n', False),
        ("-0.1", "[dynamics]\nstart = 0.5\n", False),
    ):
        text = PLANE + SMALL + WALL + held_sideways() + f'[[displacement]]\ngroup = "top"\nuy = {value}\n' + more + end
        motion = validate(parse_case(text), mesh).motion
        assert any("by up to 0.1 at once when motion starts" in said for said in motion.told) == told


@pytest.mark.parametrize("allowed", [0.01, pytest.param(np.inf, marks=pytest.mark.slow)])
def test_a_step_of_large_contact_work_is_refined(allowed):
    """A ring that is thrown in large steps: without smaller ones where it hits, energy is created."""
    text = PLANE + FINITE.replace("young = 1.0", "young = 100.0") + WALL + '[dynamics]\nscheme = "newmark"\n'
    text += thrown("body", vy=-1.0) + steps(0.4, 8)
    with patch("lacsolver.equilibrium.newmark._COARSE", allowed):
        _, states, motions = moved(text, on_wall(ring(24, 2, (0.0, 1.05), "slave")))
    table = np.array([m.energies for m in motions])
    whole, work = table[:, :2].sum(axis=1) / table[0, 2], np.abs(np.diff(table[:, 4])) / table[0, 2]
    assert unbalanced(motions) < CLOSED
    assert any(s.halvings for s in states) == np.isfinite(allowed)
    if np.isfinite(allowed):
        assert work.max() < 0.01 and whole.min() > 0.97 and whole.max() < 1.001
    else:
        assert work.max() > 0.1 and whole.max() > 1.05


def test_contact_between_rigid_bodies_needs_a_stiffness():
    """A bar that is rigid hits a rigid wall: its energy is kept by a stiffness; without one it is warned of."""
    free = '[[rigid]]\ngroup = "bar"\nfx = 0.0\nfy = 0.0\nmoment = 0.0\n[dynamics]\n'
    mesh, rest = bar_on_wall("QUAD4", 4, 0.05), free + thrown("bar", vy=-0.1) + steps(1.5, 60)
    told = validate(parse_case(PLANE + SMALL + WALL + rest), mesh).motion.told
    assert any(said.startswith("the skins of contact 'slave' have no nodes without mass") for said in told)
    text = PLANE + SMALL + WALL.replace("[[rigid]]", "stiffness = 20.0\n[[rigid]]") + rest
    assert not any("no nodes without mass" in said for said in validate(parse_case(text), mesh).motion.told)
    _, states, motions = moved(text, mesh)
    assert unbalanced(motions) < CLOSED
    assert any(state.zones[0].pressure.any() for state in states) and not states[-1].zones[0].pressure.any()
    assert motions[-1].linear[1] == pytest.approx(0.1 * WIDTH, rel=2e-3)


def test_multigrid_takes_a_hierarchy_of_its_own_for_each_size_of_steps():
    """The tiny step of the start has a matrix many times as large as that of the steps, and of the preload."""
    rest = '[[contact]]\nslave = "slave"\nmaster = "master"\n[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\n'
    rest += 'uz = 0.0\n[[displacement]]\ngroup = "top"\nux = 0.0\nuy = 0.0\nuz = "-0.02 * t"\n[dynamics]\nstart = 0.5\n'
    text, mesh = (
        SPACE + SMALL.replace("young = 1.0", "young = 1000.0") + rest + steps(1.0, 2),
        bars(("HEXA8", "HEXA8"), (4, 3), (3, 3)),
    )
    found = {name: moved(f'{text}[solver]\nbackend = "{name}"\n', mesh)[1][-1] for name in ("multigrid", "superlu")}
    u, right = (found[name].u for name in ("multigrid", "superlu"))
    assert np.abs(u - right).max() < 1e-9 * np.abs(right).max()
