"""**Large sliding.** A block is pulled over a longer one by 1.2 of its length in four steps, either body the slave: all
slides, t is mu p to rounding, no step is cut back. A ring on a turning hub that nothing else holds is carried round,
or to and fro ten times, and ten cycles of shear that stick leave nothing behind: slip is counted from where sticking
began, without drift. A wheel rolls freely on a plane, without a force of friction.

**Direction.** Faces of a slave are at an angle to a plane master: the last ones of a soft block that is dragged on a
table, and those of a round body in a groove. The forces have the direction of the master's normal. Sharp edges of the
block fold under from mu = 0.65 on; round ones do not.

**Ledger.** A half-cylinder is dragged over a block of rubber: the work of the supports is what bodies store and what
friction takes.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from verification.meshes import friction as meshes
from verification.meshes.blocks import nodes_of
from verification.meshes.sliding import in_groove, ironing_2d, on_table
from verification.meshes.stacks import stack
from verification.records import Case, Outcome, at_most, equal, informative
from verification.solving import balanced, case_text, entry, solve

Floats = NDArray[np.floating]
#: iterations of a step, mean; of what slides, relative to mu p; of what should come back
ITERATIONS, ROUNDING, DRIFT = 8.0, 1e-10, 1e-12


def solve_dragged(cell: str, below: bool, steps: int = 4, friction: float = 0.3, *, levels: int) -> Outcome:
    """A block that is pressed on another and pulled by 1.2 of its length. `below`: the lower one is the slave. Press in
    one step, pull in others.
    """
    times = [1.0, *(1 + (k + 1) / steps for k in range(steps))]
    text = case_text(
        "plane_strain",
        entry("material", law="neo_hookean", young=1000.0, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=friction),
        entry("displacement", group="bottom", ux=0.0, uy=0.0),
        entry(
            "displacement",
            group="top",
            ux=[[0.0, 0.0], [1.0, 0.0], [2.0, 1.2]],
            uy=[[0.0, 0.0], [1.0, -0.02], [2.0, -0.02]],
        ),
        entry("steps", times=times),
        kinematics="finite",
    )
    one = solve(text, meshes.slider(cell, 8, below))
    zone, t = one.zone, np.abs(one.friction.shear[:, 0])
    on = zone.pressure > 0
    off = float(np.abs(t[on] / (friction * zone.pressure[on]) - 1).max())
    each = [state.iterations for state in one.states]
    mean = float(np.mean(each[1:]))
    return Outcome(
        (
            at_most("largest deviation of t_m / (mu p_m) from 1", off, ROUNDING, source="all slides"),
            at_most("cutbacks", one.halvings, 0, source="a prototype had none"),
            at_most("iterations of a step of sliding, mean", mean, ITERATIONS, source="a prototype: 5.75 and 8.5"),
            informative("iterations of a step, largest", max(each), reason="no bound"),
            *balanced([one]),
        )
    )  # fmt: skip


def solve_carried(
    cell: str, steps: int, rotation: str = "2 * pi * max(t - 1, 0)", turns: int = 1, *, levels: int
) -> Outcome:
    """A ring shrunk on a hub that then turns by `rotation`, in so many steps of a time of 1, `turns` of them. Shrink
    the ring on the hub, then turn the hub until it is back.
    """
    times = [1.0, *(1 + (k + 1) / steps for k in range(turns * steps))]
    text = case_text(
        "plane_strain",
        entry("material", law="neo_hookean", young=1000.0, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=0.3, clearance=-0.01),
        entry("rigid", group="master", centre=[0.0, 0.0], rotation=rotation),
        entry("steps", times=times),
        kinematics="finite",
    )
    one = solve(text, meshes.ring_on_hub(cell, 24))
    first, last = one.states[0], one.states[-1]
    pressures = [state.zones[0].pressure for state in (first, last)]
    moved = (last.u - first.u).reshape(-1, 2)[nodes_of(one.mesh, "ring")]
    slides = sum(int((state.zones[0].status == 2).sum()) for state in one.states[1:])
    change, each = np.abs(pressures[1] - pressures[0]).max(), [state.iterations for state in one.states[1:]]
    return Outcome(
        (
            at_most("drift once the hub is back, of the radius", float(np.abs(moved).max()), DRIFT,
                    source="it only sticks"),
            at_most("largest change of p_m, of the largest", float(change / pressures[0].max()), 1e-10,
                    source="a rigid-body motion"),
            at_most("macro-elements that slid", slides, 0, source="it only sticks"),
            informative("iterations of a step, mean", float(np.mean(each)), reason="7 on a prototype"),
            *balanced([one]),
        )
    )  # fmt: skip


def solve_cycled(pair: tuple[str, str], dim: int, cycles: int = 10, steps: int = 8, *, levels: int) -> Outcome:
    """Two blocks that stick, sheared to and fro by a tenth of their height ten times in so many steps each. Press, then
    shear in cycles; the state after all of them is that after one.
    """
    n = cycles * steps
    times = [1.0, *(1 + (k + 1) / steps for k in range(n))]
    axes = "xyz"[:dim]
    top = {a: 0.0 for a in axes} | {
        axes[-1]: [[0.0, 0.0], [1.0, -0.05], [100.0, -0.05]],
        "x": "0.1 * sin(2 * pi * max(t - 1, 0))",
    }
    text = case_text(
        "plane_strain" if dim == 2 else "3d",
        entry("material", law="neo_hookean", young=1000.0, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=3.0),
        entry("displacement", group="bottom", **{f"u{a}": 0.0 for a in axes}),
        entry("displacement", group="top", **{f"u{a}": v for a, v in top.items()}),
        entry("steps", times=times),
        kinematics="finite",
    )
    one = solve(text, stack(*pair, dim, counts=(3, 2), bend=0.3))
    start, last = one.states[0].zones[0], one.states[-1].zones[0]
    change, left = np.abs(last.pressure - start.pressure).max(), np.abs(one.states[-1].u - one.states[0].u).max()
    slides = sum(int((state.zones[0].status == 2).sum()) for state in one.states)
    return Outcome(
        (
            at_most("displacement left by all cycles, of the height", float(left), DRIFT, source="it only sticks",
                    reason="1e-14 on a prototype"),
            informative("change of p_m over all cycles, of the largest", float(change / start.pressure.max()),
                        reason="as far as Newton's method goes: forces to 1e-10"),
            at_most("macro-elements that slid", slides, 0, source="mu is 3"),
            *balanced([one]),
        )
    )  # fmt: skip


def solve_wheel(cell: str, way: float = 0.6, steps: int = 15, friction: float = 0.3, *, levels: int) -> Outcome:
    """A wheel of radius 1 that is pressed on a plane, and whose hub is moved along by `way` without a moment. Press,
    then roll. The wheel hardly changes its volume, so that its skin hardly stretches where it is pressed.
    """
    text = case_text(
        "plane_strain",
        entry("material", law="neo_hookean", young=1.0, poisson=0.45),
        entry("contact", slave="slave", master="master", friction=friction),
        entry("rigid", group="master"),
        entry("rigid", group="hub", centre=[0.0, 0.0], moment=0.0,
              ux=[[0.0, 0.0], [1.0, 0.0], [2.0, way]], uy=[[0.0, 0.0], [1.0, -0.01], [2.0, -0.01]]),
        entry("steps", times=[1.0, *(1 + (k + 1) / steps for k in range(steps))]),
        kinematics="finite",
    )  # fmt: skip
    one = solve(text, meshes.wheel(cell, 60))
    zone, hub = one.zone, nodes_of(one.mesh, "hub")
    spoke = one.mesh.points[hub[-1], :2] - one.mesh.points[hub[0], :2]
    before, after = (np.arctan2(v[1], v[0]) for v in (spoke, spoke + one.u[hub[-1]] - one.u[hub[0]]))
    force = abs(one.shear[:, 0] @ zone.area) / (friction * (zone.pressure @ zone.area))
    return Outcome(
        (
            equal("way over the radius times the angle", way / float(before - after), 1.0, 0.01,
                  source="it rolls", reason="its skin is stretched by some (1 - 2 nu) p / E"),
            at_most("force of friction over mu N", float(force), 0.02, source="no moment acts"),
            at_most("cutbacks", one.halvings, 0, source="steps of two faces"),
            informative("iterations of a step, mean", one.iterations / len(one.states), reason="no bound"),
            *balanced([one]),
        )
    )  # fmt: skip


# ---- the ledger of work


def solve_ledger(steps: int = 96, friction: float = 0.3, part: float = 0.01, *, levels: int) -> Outcome:
    """A half-cylinder that is pressed into a block of rubber and dragged over it, in so many steps. Follow the ledger:
    its rest, and the work of pressures, over the dissipation.
    """
    text = case_text(
        "plane_strain",
        entry("material", groups=["block"], law="neo_hookean", young=10.0, poisson=0.4),
        entry("material", groups=["die"], law="neo_hookean", young=500.0, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=friction, normals="smoothed"),
        entry("displacement", group="bottom", ux=0.0, uy=0.0),
        entry("displacement", group="top", ux=[[1.0, 0.0], [4.0, 4.5]], uy=[[0.0, 0.0], [1.0, -0.65]]),
        entry("steps", end=4.0, count=steps),
        kinematics="finite",
    )
    one = solve(text, ironing_2d())
    work = one.state.step.work
    if work is None:
        raise ValueError("a static case with friction has a ledger")
    source = "external work = strain energy + dissipation"
    return Outcome(
        (
            at_most("left of the external work, over the dissipation", abs(work.left) / work.dissipation, part,
                    source=source, reason="it falls with the size of the steps"),
            at_most("work of pressures over the dissipation", abs(work.pressures) / work.dissipation, part,
                    source=source, reason="3 % at sharp corners"),
            informative("external work", work.external, reason="no bound"),
            informative("dissipation", work.dissipation, reason="no bound"),
            *balanced([one]),
        )
    )  # fmt: skip


# ---- the direction of contact


def solve_on_table(friction: float, n: int = 20, radius: float = 0.0, *, levels: int) -> Outcome:
    """A soft block that is pressed on a rigid table and dragged by its length. Press in two steps, drag in ten.

    `radius`: of its lower edges, 0 for sharp ones.
    """
    text = case_text(
        "plane_strain",
        entry("material", groups=["block"], law="neo_hookean", young=100.0, poisson=0.3),
        entry("contact", slave="underside", master="table", friction=friction),
        entry("rigid", group="table"),
        entry("displacement", group="top", ux=[[1.0, 0.0], [2.0, 1.0]], uy=[[0.0, 0.0], [1.0, -0.03], [2.0, -0.03]]),
        entry("steps", times=[0.5, 1.0, *(1 + (k + 1) / 10 for k in range(10))]),
        kinematics="finite",
    )
    one = solve(text, on_table(n, radius))
    fx, fy = one.zone.force[nodes_of(one.problem.space.mesh, "underside")].sum(axis=0)
    source = "Coulomb's law: all slides"
    return Outcome(
        (
            equal("horizontal over vertical force", abs(fx / fy), friction, 0.01 * friction, source=source,
                  reason="the last faces are at an angle to the table"),
            *balanced([one]),
        )
    )  # fmt: skip


def solve_in_groove(slave: str, geometry: str, n: int = 16, *, levels: int) -> Outcome:
    """A round body in a groove of 90 degrees, without friction, under its weight."""
    text = case_text(
        "plane_strain",
        entry("material", young=210e3, poisson=0.3),
        entry("contact", slave=slave, master="flank" if slave == "round" else "round", geometry=geometry),
        entry("displacement", group="base", ux=0.0, uy=0.0),
        entry("displacement", group="axis", ux=0.0),
        entry("body_force", groups=["ball"], fy=-1.0),
    )
    one = solve(text, in_groove(n))
    fx, fy = one.zone.force[nodes_of(one.problem.space.mesh, "round")].sum(axis=0)
    source, reason = "the flank is at 45 degrees", "faces of the round body are at an angle to the flank"
    ratio = equal("sideways over downward force", abs(fx / fy), 1.0, 0.015, source=source, reason=reason)
    return Outcome((ratio, *balanced([one])))


def cases(family: str) -> Iterator[Case]:
    """A block that is pulled, a ring that is carried, blocks that stick."""
    for cell in ("QUAD4", "QUAD8"):
        for below in (False, True):
            name = f"dragged-{cell}-{'lower' if below else 'upper'}"
            description = f"a block pulled over another, {'the lower' if below else 'it'} is the slave"
            suite = "quick" if cell == "QUAD4" else "full"
            yield Case(family, name, description, partial(solve_dragged, cell, below), {suite: 1}, 5.0)
    for steps in (24, 48):
        description = f"a ring on a hub, a turn in {steps} steps"
        yield Case(family, f"carried-{steps}", description, partial(solve_carried, "QUAD4", steps), {"full": 1}, 20.0)
    to_and_fro = partial(solve_carried, "QUAD4", 8, "0.5 * sin(2 * pi * max(t - 1, 0))", 10)
    yield Case(family, "carried-cycles", "a ring on a hub that turns to and fro", to_and_fro, {"full": 1}, 40.0)
    for dim, pair in ((2, ("QUAD4", "TRIA6")), (3, ("HEXA8", "TETRA4"))):
        solve = partial(solve_cycled, pair, dim)
        yield Case(family, f"cycled-{dim}d", "ten cycles of shear that sticks", solve, {"full": 1}, 30.0)
    for cell in ("QUAD4", "QUAD8"):
        solve = partial(solve_wheel, cell)
        yield Case(family, f"rolls-{cell}", f"a wheel of {cell} that rolls on a plane", solve, {"full": 1}, 15.0)
    for friction in (0.1, 0.3, 0.5, 0.7, 0.9):
        solve = partial(solve_on_table, friction)
        suite = "quick" if friction == 0.5 else "full"
        yield Case(family, f"on-table-{friction}", "a block dragged on a rigid table", solve, {suite: 1}, 20.0)
        solve = partial(solve_on_table, friction, radius=0.2)
        suite, description = "quick" if friction == 0.9 else "full", "a block with round edges dragged on a rigid table"
        yield Case(family, f"on-table-round-{friction}", description, solve, {suite: 1}, 10.0)
    for slave, geometry in itertools.product(("round", "flank"), ("reference", "current")):
        description = f"a round body in a groove, {'it' if slave == 'round' else 'the flank'} is the slave"
        solve = partial(solve_in_groove, slave, geometry)
        yield Case(family, f"in-groove-{slave}-{geometry}", description, solve, {"quick": 1}, 5.0)
    description = "a half-cylinder dragged over rubber: where the work goes"
    yield Case(family, "ledger", description, partial(solve_ledger), {"full": 1}, 60.0)
