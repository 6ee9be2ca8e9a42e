"""**Large sliding.** A block is pulled over a longer one by 1.2 of its length in four steps, either body the slave: all
slides, t is mu p to rounding, no step is cut back. A ring on a turning hub that nothing else holds is carried round,
or to and fro ten times, and ten cycles of shear that stick leave nothing behind: slip is counted from where sticking
began, without drift. A wheel rolls freely on a plane, without a force of friction.

**Direction.** Faces of a slave are at an angle to a plane master: the last ones of a soft block that is dragged on a
table, and those of a round body in a groove. The forces have the direction of the master's normal. Sharp edges of the
block fold under from mu = 0.65 on; round ones do not.

**Ledger.** A half-cylinder is dragged over a block of rubber: the work of the supports is what bodies store and what
friction takes.

**Motion.** A block that is thrown along a plane slides v^2 / (2 mu g) far, and stays. An elastic sphere hits a plane
with spin. A rod that leans on a plane is pushed along it with its foot ahead. Painleve (1895): with
1 + 3 cos^2 a < 3 mu sin a cos a (a: its angle) a rigid rod has no force that lets it slide. An elastic rod slides where
a rigid one can; where it cannot, its foot is stopped at once, and thrown up.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from lacmesh import Mesh
from lacsolver.equilibrium.state import State
from verification.exact import impact
from verification.meshes import friction as meshes
from verification.meshes.balls import half_sphere_on_wall
from verification.meshes.blocks import nodes_of
from verification.meshes.sliding import in_groove, ironing_2d, on_table
from verification.meshes.stacks import stack
from verification.records import Case, Result, at_least, at_most, equal, problem, row
from verification.solving import Solved, balanced, case_text, contact, entry, fixed, material, model_of, solve, times

#: iterations of a step, mean; of what slides, relative to mu p; of what should come back
ITERATIONS, ROUNDING, DRIFT = 8.0, 1e-10, 1e-12
_STICKS, _ENERGY = "it only sticks", "no energy is created"


def finite(mesh: Mesh, *tables: str, model: str = "plane_strain", steps: list[float], **keys: Any) -> Solved:
    """Solve bodies of a neo-Hookean material in contact (its `keys`), with finite kinematics."""
    text = case_text(
        model, material(1000.0, 0.3, law="neo_hookean"), contact(**keys), *tables, entry("steps", times=steps),
        kinematics="finite",
    )  # fmt: skip
    return solve(text, mesh)


@problem
def solve_dragged(cell: str, below: bool) -> Iterator[Result]:
    """A block that is pressed on another and pulled by 1.2 of its length. `below`: the lower one is the slave."""
    friction = 0.3
    path = {"ux": [[0.0, 0.0], [1.0, 0.0], [2.0, 1.2]], "uy": [[0.0, 0.0], [1.0, -0.02], [2.0, -0.02]]}
    one = finite(
        meshes.slider(cell, 8, below), fixed("bottom", "xy"), entry("displacement", group="top", **path),
        friction=friction, steps=times(1, 4),
    )  # fmt: skip
    zone, t = one.zone, np.abs(one.friction.shear[:, 0])
    on = zone.pressure > 0
    off = float(np.abs(t[on] / (friction * zone.pressure[on]) - 1).max())
    mean = float(np.mean([state.iterations for state in one.states[1:]]))
    yield at_most("largest deviation of t_m / (mu p_m) from 1", off, ROUNDING, source="all slides")
    yield at_most("cutbacks", one.halvings, 0, source="a prototype had none")
    yield at_most("iterations of a step of sliding, mean", mean, ITERATIONS, source="a prototype: 5.75 and 8.5")
    yield from balanced([one])


def slid(states: Sequence[State]) -> int:
    """Number of macro-elements that slid, counted in every step."""
    return sum(int((state.zones[0].status == 2).sum()) for state in states)


@problem
def solve_carried(cell: str, steps: int, rotation: str = "2 * pi * max(t - 1, 0)", turns: int = 1) -> Iterator[Result]:
    """A ring shrunk on a hub that then turns by `rotation`, in so many steps of a time of 1, `turns` of them."""
    hub = entry("rigid", group="master", centre=[0.0, 0.0], rotation=rotation)
    ends = times(1, *[steps] * turns)
    one = finite(meshes.ring_on_hub(cell, 24), hub, friction=0.3, clearance=-0.01, steps=ends)
    first, last = one.states[0], one.states[-1]
    p, q = (state.zones[0].pressure for state in (first, last))
    moved = (last.u - first.u).reshape(-1, 2)[nodes_of(one.mesh, "ring")]
    change = float(np.abs(q - p).max() / p.max())
    yield at_most("drift once the hub is back, of the radius", np.abs(moved).max(), DRIFT, source=_STICKS)
    yield at_most("largest change of p_m, of the largest", change, 1e-10, source="a rigid-body motion")
    yield at_most("macro-elements that slid", slid(one.states[1:]), 0, source=_STICKS)
    yield from balanced([one])


@problem
def solve_cycled(pair: tuple[str, str], dim: int, cycles: int = 10, steps: int = 8) -> Iterator[Result]:
    """Two blocks that stick, sheared to and fro by a tenth of their height ten times in so many steps each.

    The state after all cycles is that after none.
    """
    axes = "xyz"[:dim]
    down = {f"u{axes[-1]}": [[0.0, 0.0], [1.0, -0.05], [100.0, -0.05]], "ux": "0.1 * sin(2 * pi * max(t - 1, 0))"}
    one = finite(
        stack(*pair, dim, counts=(3, 2), bend=0.3), fixed("bottom", axes),
        entry("displacement", group="top", **{f"u{a}": 0.0 for a in axes} | down),
        model=model_of(dim), friction=3.0, steps=times(1, *[steps] * cycles),
    )  # fmt: skip
    left = float(np.abs(one.states[-1].u - one.states[0].u).max())
    name = "displacement left by all cycles, of the height"
    yield at_most(name, left, DRIFT, source=_STICKS, reason="1e-14 on a prototype")
    yield at_most("macro-elements that slid", slid(one.states), 0, source="mu is 3")
    yield from balanced([one])


@problem
def solve_wheel(cell: str) -> Iterator[Result]:
    """A wheel of radius 1 that is pressed on a plane, and whose hub is moved along it without a moment.

    The wheel hardly changes its volume, so that its skin hardly stretches where it is pressed.
    """
    way, friction = 0.6, 0.3
    path = {"ux": [[0.0, 0.0], [1.0, 0.0], [2.0, way]], "uy": [[0.0, 0.0], [1.0, -0.01], [2.0, -0.01]]}
    text = case_text(
        "plane_strain", material(1.0, 0.45, law="neo_hookean"), contact(friction=friction),
        entry("rigid", group="master"), entry("rigid", group="hub", centre=[0.0, 0.0], moment=0.0, **path),
        entry("steps", times=times(1, 15)), kinematics="finite",
    )  # fmt: skip
    one = solve(text, meshes.wheel(cell, 60))
    zone, hub = one.zone, nodes_of(one.mesh, "hub")
    spoke = one.mesh.points[hub[-1], :2] - one.mesh.points[hub[0], :2]
    before, after = (np.arctan2(v[1], v[0]) for v in (spoke, spoke + one.u[hub[-1]] - one.u[hub[0]]))
    force = abs(one.shear[:, 0] @ zone.area) / (friction * (zone.pressure @ zone.area))
    name, reason = "way over the radius times the angle", "its skin is stretched by some (1 - 2 nu) p / E"
    yield equal(name, way / float(before - after), 1.0, 0.01, source="it rolls", reason=reason)
    yield at_most("force of friction over mu N", float(force), 0.02, source="no moment acts")
    yield at_most("cutbacks", one.halvings, 0, source="steps of two faces")
    yield from balanced([one])


@problem
def solve_ledger(steps: int = 96, part: float = 0.01) -> Iterator[Result]:
    """A half-cylinder that is pressed into a block of rubber and dragged over it, in so many steps."""
    text = case_text(
        "plane_strain", material(10.0, 0.4, groups=["block"], law="neo_hookean"),
        material(500.0, 0.3, groups=["die"], law="neo_hookean"), contact(friction=0.3, normals="smoothed"),
        fixed("bottom", "xy"),
        entry("displacement", group="top", ux=[[1.0, 0.0], [4.0, 4.5]], uy=[[0.0, 0.0], [1.0, -0.65]]),
        entry("steps", end=4.0, count=steps), kinematics="finite",
    )  # fmt: skip
    one = solve(text, ironing_2d())
    work = one.state.step.work
    if work is None:
        raise ValueError("a static case with friction has a ledger")
    for name, value, reason in (
        ("left of the external work, over the dissipation", work.left, "it falls with the size of the steps"),
        ("work of pressures over the dissipation", work.pressures, "3 % at sharp corners"),
    ):
        source = "external work = strain energy + dissipation"
        yield at_most(name, abs(value) / work.dissipation, part, source=source, reason=reason)
    yield from balanced([one])


# ---- the direction of contact


@problem
def solve_on_table(friction: float, n: int = 20, radius: float = 0.0) -> Iterator[Result]:
    """A soft block that is pressed on a rigid table in two steps and dragged by its length in ten.

    `radius`: of its lower edges, 0 for sharp ones.
    """
    text = case_text(
        "plane_strain", material(100.0, 0.3, groups=["block"], law="neo_hookean"),
        contact("underside", "table", friction=friction), entry("rigid", group="table"),
        entry("displacement", group="top", ux=[[1.0, 0.0], [2.0, 1.0]], uy=[[0.0, 0.0], [1.0, -0.03], [2.0, -0.03]]),
        entry("steps", times=times(2, 10)), kinematics="finite",
    )  # fmt: skip
    one = solve(text, on_table(n, radius))
    fx, fy = one.zone.force[nodes_of(one.mesh, "underside")].sum(axis=0)
    source, reason = "Coulomb's law: all slides", "the last faces are at an angle to the table"
    name = "horizontal over vertical force"
    yield equal(name, abs(fx / fy), friction, 0.01 * friction, source=source, reason=reason)
    yield from balanced([one])


@problem
def solve_in_groove(slave: str, geometry: str) -> Iterator[Result]:
    """A round body in a groove of 90 degrees, without friction, under its weight."""
    text = case_text(
        "plane_strain", material(210e3, 0.3),
        contact(slave, "flank" if slave == "round" else "round", geometry=geometry), fixed("base", "xy"),
        fixed("axis", "x"), entry("body_force", groups=["ball"], fy=-1.0),
    )  # fmt: skip
    one = solve(text, in_groove(16))
    fx, fy = one.zone.force[nodes_of(one.mesh, "round")].sum(axis=0)
    source, reason = "the flank is at 45 degrees", "faces of the round body are at an angle to the flank"
    yield equal("sideways over downward force", abs(fx / fy), 1.0, 0.015, source=source, reason=reason)
    yield from balanced([one])


# ---- motion


@problem
def solve_thrown(cell: str) -> Iterator[Result]:
    """A block that is thrown along a rigid plane, and slides until it stands; SI units."""
    speed, gravity, friction = 1.0, 10.0, 0.4
    text = case_text(
        "plane_strain", material(2e6, 0.3, density=1000.0), contact(friction=friction), entry("rigid", group="master"),
        entry("gravity", gy=-gravity), entry("initial", groups=["pad"], vx=speed), entry("dynamics"),
        entry("steps", end=1.2 * speed / (friction * gravity), count=320),
    )  # fmt: skip
    one = solve(text, meshes.pad(cell, 8))
    along = [float(state.u.reshape(-1, 2)[nodes_of(one.mesh, "pad"), 0].mean()) for state in one.states]
    right = speed**2 / (2 * friction * gravity)
    still = abs(along[-1] - along[-len(along) // 20]) / right
    yield equal("distance", along[-1], right, 0.005 * right, source="v^2 / (2 mu g)", reason="it sways as it stops")
    yield at_most("way in the last twentieth of the time, of the distance", still, 1e-3, source="it stands")


@problem
def solve_spinning(slip: float, mu: float, nu: float) -> Iterator[Result]:
    """Half of an elastic sphere that hits a rigid plane with spin: it turns by a few thousandths during the impact.

    `slip`: speed of its skin along the plane, over the normal one. The normals are the sphere's own, which its small
    rotation does not move.
    """
    approach, steps = 1e-3, 40  # the largest approach, over the radius
    speed = impact.speed_for(approach, 1.0, 1.0, nu, 1.0)
    dt, count = impact.hertz(1.0, 1.0, nu, 1.0, speed).duration / steps, round(1.15 * steps)
    text = case_text(
        "3d", material(1.0, nu, density=1.0), contact(master="wall", friction=mu, normals="slave"),
        entry("rigid", group="wall"), *(fixed(plane, "y") for plane in ("x0", "y0")),
        entry("initial", groups=["ball"], vz=-speed, rotation=[0.0, -slip * speed, 0.0], centre=[0.0, 0.0, 1.0]),
        entry("dynamics"), entry("steps", end=count * dt, count=count),
    )  # fmt: skip
    one = solve(text, half_sphere_on_wall(np.sqrt(approach), 2.5 * dt * speed, 3))
    up, along, spin = (change / speed for change in _changes(one))
    _, right = impact.rebound(slip, mu, nu)
    slides, reason = slip > 7 * mu, "Hertz' contact is of half-spaces, and three cells wide"
    source = "rigid bodies: mu (1 + e) v_n" if slides else "springs side by side, each sticks or slides"
    yield equal("change of the normal velocity over v_n", up, 2.0, 0.02, source="Hertz 1882", reason=reason)
    for name, ratio in (("the velocity along the plane", along / right), ("spin", spin / (2.5 * right))):
        within = 0.02 if slides else 0.03
        yield equal(f"change of {name}, of the exact one", ratio, 1.0, within, source=source, reason=reason)
    yield at_most("largest energy, of that at the start", _largest(one), 1.001, source=_ENERGY)
    yield from balanced([one])


def _changes(one: Solved) -> tuple[float, float, float]:
    """Changes of the velocity up, against the slip, and of the spin against it, from the momenta at the end."""
    inertia, space = one.problem.inertia, one.problem.space
    first, last = (state.step.motion for state in (one.states[0], one.states[-1]))
    assert inertia is not None and first is not None and last is not None
    whole = inertia.M.sum() / 3
    x = space.mesh.points - [0.0, 0.0, 1.0]
    mv = (inertia.M @ (last.velocity - first.velocity)).reshape(-1, 3)
    spin = (x[:, 2] * mv[:, 0] - x[:, 0] * mv[:, 2]).sum() / (0.4 * whole)
    return mv[:, 2].sum() / whole, -mv[:, 0].sum() / whole, spin


def _largest(one: Solved) -> float:
    """Largest kinetic and strain energy less the work of loads so far, of that at the start."""
    table = np.array([motion.energies for state in one.states if (motion := state.step.motion) is not None])
    whole = table[:, 0] + table[:, 1] - table[:, 2]
    return float(1 + (whole.max() - whole[0]) / table[0, :2].sum())


@problem
def solve_leaning(friction: float) -> Iterator[Result]:
    """A rod of length 1 that leans on a rigid plane by 60 degrees and is pushed along it at a speed of 1."""
    gravity, angle = 1.0, np.radians(60.0)
    c, s = np.cos(angle), np.sin(angle)
    denominator = float(1 + 3 * c**2 - 3 * friction * s * c)  # m g over the normal force of a rigid rod at the start
    text = case_text(
        "plane_strain", material(1e3, 0.3, law="neo_hookean", density=1.0), contact(friction=friction),
        entry("rigid", group="master"), entry("gravity", gy=-gravity), entry("initial", groups=["rod"], vx=-1.0),
        entry("dynamics"), entry("steps", end=0.1, count=100), kinematics="finite",
    )  # fmt: skip
    one = solve(text, meshes.rod("QUAD4", 16, angle))
    forces = [float(state.zones[0].pressure @ state.zones[0].area) / (0.1 * gravity) for state in one.states]
    if denominator > 0:
        name, reason = "normal force over m g, mean", "it turns, and its foot has a width"
        within = 0.05 / denominator
        yield equal(name, float(np.mean(forces)), 1 / denominator, within, source="a rigid rod", reason=reason)
    else:
        foot = nodes_of(one.mesh, "slave")
        early = np.abs([state.u.reshape(-1, 2)[foot, 0].mean() for state in one.states[:50]]).max() / 0.05
        name = "way of the foot in half the time, of that without friction"
        yield at_most(name, early, 0.05, source="it jams: an impact without a collision")
        source = "a rigid rod has none that is finite"
        yield at_least("normal force over m g, largest", max(forces), 10.0, source=source)
    yield at_most("largest energy, of that at the start", _largest(one), 1.001, source=_ENERGY)
    yield from balanced([one])


def cases(family: str) -> Iterator[Case]:
    """Bodies that slide, stick, roll, and are thrown."""
    for cell, below in itertools.product(("QUAD4", "QUAD8"), (False, True)):
        name, quick = f"dragged-{cell}-{'lower' if below else 'upper'}", int(cell == "QUAD4")
        what = f"a block pulled over another, {'the lower' if below else 'it'} is the slave"
        yield row(family, name, what, solve_dragged, cell, below, quick=quick, full=1)
    for steps in (24, 48):
        what = f"a ring on a hub, a turn in {steps} steps"
        yield row(family, f"carried-{steps}", what, solve_carried, "QUAD4", steps, full=1, seconds=20.0)
    what, rotation = "a ring on a hub that turns to and fro", "0.5 * sin(2 * pi * max(t - 1, 0))"
    yield row(family, "carried-cycles", what, solve_carried, "QUAD4", 8, rotation, 10, full=1, seconds=40.0)
    for dim, pair in ((2, ("QUAD4", "TRIA6")), (3, ("HEXA8", "TETRA4"))):
        what = "ten cycles of shear that sticks"
        yield row(family, f"cycled-{dim}d", what, solve_cycled, pair, dim, full=1, seconds=30.0)
    for cell in ("QUAD4", "QUAD8"):
        what = f"a wheel of {cell} that rolls on a plane"
        yield row(family, f"rolls-{cell}", what, solve_wheel, cell, full=1, seconds=15.0)
    for mu in (0.1, 0.3, 0.5, 0.7, 0.9):
        name, what, quick = f"on-table-{mu}", "a block dragged on a rigid table", int(mu == 0.5)
        yield row(family, name, what, solve_on_table, mu, quick=quick, full=1, seconds=20.0)
        name, what, quick = f"on-table-round-{mu}", "a block with round edges dragged on a rigid table", int(mu == 0.9)
        yield row(family, name, what, solve_on_table, mu, radius=0.2, quick=quick, full=1, seconds=10.0)
    for slave, geometry in itertools.product(("round", "flank"), ("reference", "current")):
        what = f"a round body in a groove, {'it' if slave == 'round' else 'the flank'} is the slave"
        yield row(family, f"in-groove-{slave}-{geometry}", what, solve_in_groove, slave, geometry, quick=1)
    what = "a half-cylinder dragged over rubber: where the work goes"
    yield row(family, "ledger", what, solve_ledger, full=1, seconds=60.0)
    yield row(family, "thrown", "a block thrown along a plane", solve_thrown, "QUAD4", full=1, seconds=20.0)
    what = "a sphere with much spin hits a plane"
    yield row(family, "spinning-slides", what, solve_spinning, 4.0, 0.1, 0.3, full=1, seconds=150.0)
    what = "a sphere with spin that hits a plane slides, then sticks"
    yield row(family, "spinning-sticks", what, solve_spinning, 1.0, 0.3, 0.45, full=1, seconds=150.0)
    for mu, word in ((0.5, "slides"), (2.0, "jams")):
        what = "a rod pushed along a plane, Painleve's"
        yield row(family, f"rod-{word}", what, solve_leaning, mu, full=1, seconds=12.0)
