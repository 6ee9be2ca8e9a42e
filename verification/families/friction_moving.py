"""**Large sliding.** A block is pulled over a longer one by 1.2 of its length in four steps, either body the slave: all
slides, t is mu p to rounding, no step is cut back. A ring on a turning hub that nothing else holds is carried round,
and ten cycles of shear that stick leave nothing behind: slip is counted from where sticking began, without drift.

**NAFEMS and code_aster.** A roller (ssnp154a), a punch with rounded edges (ssna122a) and ironing (ssnp153a) on
code_aster's meshes.

**Ledger.** A half-cylinder is dragged over a block of rubber: the work of the supports is what bodies store and what
friction takes.

**Motion.** A block that is thrown along a plane slides v^2 / (2 mu g) far, and stays.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lacmesh
from verification.meshes import friction as meshes
from verification.meshes.blocks import joined
from verification.meshes.sliding import ironing_2d
from verification.meshes.stacks import stack
from verification.records import Case, Outcome, Published, at_most, equal, informative
from verification.solving import Solved, balanced, case_text, entry, solve

Floats = NDArray[np.floating]
_MESHES = Path(os.environ.get("LACMESH_SHARED") or Path(__file__).parents[3] / "shared") / "reference" / "meshes"
#: iterations of a step, mean; of what slides, relative to mu p; of what should come back
ITERATIONS, ROUNDING, DRIFT = 8.0, 1e-10, 1e-12


def _table(pressed: float, end: float) -> list[list[float]]:
    """Values over time: from 0 to one at t = 1, then to another at t = 2."""
    return [[0.0, 0.0], [1.0, pressed], [2.0, end]]


def _nodes(one: Solved, group: str) -> NDArray[np.integer]:
    return np.unique(np.concatenate([n.ravel() for _, _, n in one.mesh.select(one.mesh.cell_groups[group])]))


@dataclass(frozen=True)
class PulledBlock:
    """A block that is pressed on another and pulled by 1.2 of its length. `below`: the lower one is the slave."""

    cell: str
    below: bool
    steps: int = 4
    friction: float = 0.3


def solve_dragged(case: Case, levels: int) -> Outcome:
    """Press in one step, pull in others."""
    given: PulledBlock = case.parameters
    times = [1.0, *(1 + (k + 1) / given.steps for k in range(given.steps))]
    text = case_text(
        "plane_strain",
        entry("material", law="neo_hookean", young=1000.0, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=given.friction),
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
    one = solve(text, meshes.slider(given.cell, 8, given.below))
    zone, t = one.zone, np.abs(one.friction.shear[:, 0])
    on = zone.pressure > 0
    off = float(np.abs(t[on] / (given.friction * zone.pressure[on]) - 1).max())
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


@dataclass(frozen=True)
class Carried:
    """A ring shrunk on a hub that turns once, in so many steps."""

    cell: str
    steps: int


def solve_carried(case: Case, levels: int) -> Outcome:
    """Shrink the ring on the hub, then turn the hub once."""
    given: Carried = case.parameters
    times = [1.0, *(1 + (k + 1) / given.steps for k in range(given.steps))]
    text = case_text(
        "plane_strain",
        entry("material", law="neo_hookean", young=1000.0, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=0.3, clearance=-0.01),
        entry("rigid", group="master", centre=[0.0, 0.0], rotation="2 * pi * max(t - 1, 0)"),
        entry("steps", times=times),
        kinematics="finite",
    )
    one = solve(text, meshes.ring_on_hub(given.cell, 24))
    first, last = one.states[0], one.states[-1]
    pressures = [state.zones[0].pressure for state in (first, last)]
    moved = (last.u - first.u).reshape(-1, 2)[_nodes(one, "ring")]
    slides = sum(int((state.zones[0].status == 2).sum()) for state in one.states[1:])
    change, each = np.abs(pressures[1] - pressures[0]).max(), [state.iterations for state in one.states[1:]]
    return Outcome(
        (
            at_most("drift after a turn, of the radius", float(np.abs(moved).max()), DRIFT, source="it only sticks"),
            at_most("largest change of p_m, of the largest", float(change / pressures[0].max()), 1e-10,
                    source="a rigid-body motion"),
            at_most("macro-elements that slid", slides, 0, source="it only sticks"),
            informative("iterations of a step, mean", float(np.mean(each)), reason="7 on a prototype"),
            *balanced([one]),
        )
    )  # fmt: skip


@dataclass(frozen=True)
class Cycled:
    """Two blocks that stick, sheared to and fro by a tenth of their height ten times in so many steps each."""

    pair: tuple[str, str]
    dim: int
    cycles: int = 10
    steps: int = 8


def solve_cycled(case: Case, levels: int) -> Outcome:
    """Press, then shear in cycles; the state after all of them is that after one."""
    given: Cycled = case.parameters
    n = given.cycles * given.steps
    times = [1.0, *(1 + (k + 1) / given.steps for k in range(n))]
    axes = "xyz"[: given.dim]
    top = {a: 0.0 for a in axes} | {
        axes[-1]: [[0.0, 0.0], [1.0, -0.05], [100.0, -0.05]],
        "x": "0.1 * sin(2 * pi * max(t - 1, 0))",
    }
    text = case_text(
        "plane_strain" if given.dim == 2 else "3d",
        entry("material", law="neo_hookean", young=1000.0, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=3.0),
        entry("displacement", group="bottom", **{f"u{a}": 0.0 for a in axes}),
        entry("displacement", group="top", **{f"u{a}": v for a, v in top.items()}),
        entry("steps", times=times),
        kinematics="finite",
    )
    one = solve(text, stack(*given.pair, given.dim, counts=(3, 2), bend=0.3))
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


# ---- code_aster's meshes


@dataclass(frozen=True)
class Roller:
    """NAFEMS's roller, ssnp154a. `expected`: u_y of the point B, with and without friction: code_aster's."""

    expected: tuple[float, float] = (-1.26898, -1.27031)


def solve_roller(case: Case, levels: int) -> Outcome:
    """With friction and without, small strains in the deformed geometry."""
    given: Roller = case.parameters
    results, solutions = [], []
    for friction, right in zip((0.1, 0.0), given.expected, strict=True):
        text = case_text(
            "plane_strain",
            entry("material", groups=["Cylinder"], young=210e3, poisson=0.3),
            entry("material", groups=["Block"], young=70e3, poisson=0.3),
            entry("contact", slave="Bottom_C", master="Top_B", friction=friction or None, geometry="current"),
            entry("displacement", group="Encast", ux=0.0, uy=0.0),
            entry("displacement", group="Axe", ux=0.0),
            entry("force", group="Force", fy=-17500.0),
            entry("steps", count=2),
        )
        one = solve(text, lacmesh.read(_MESHES / "ssnp154a.med"))
        (b,) = one.mesh.node_groups["B"]
        solutions.append(one)
        published = Published("Abaqus, Marc, quadratic", -1.3026 if friction else -1.3069, "NAFEMS, FENET")
        results.append(equal(
            f"u_y of B, mu = {friction:g}", float(one.u[b, 1]), right, 0.005 * abs(right),
            source="code_aster, ssnp154a", reason="two methods, one mesh", published=(published,),
        ))  # fmt: skip
    return Outcome((*results, *balanced(solutions)))


@dataclass(frozen=True)
class RoundedPunch:
    """NAFEMS's punch with rounded edges, ssna122a. `expected`: u_y of M with mu = 0 and 0.1: code_aster's."""

    expected: tuple[float, float] = (-0.130734, -0.128580)


def solve_rounded(case: Case, levels: int) -> Outcome:
    """With friction and without; what friction takes off."""
    given: RoundedPunch = case.parameters
    u, solutions = [], []
    for friction in (0.0, 0.1):
        text = case_text(
            "axisymmetric",
            entry("material", groups=["Poincon"], law="saint_venant_kirchhoff", young=210e3, poisson=0.3),
            entry("material", groups=["Massif"], law="saint_venant_kirchhoff", young=70e3, poisson=0.3),
            entry("contact", slave="P_cont", master="M_cont", friction=friction or None),
            entry("displacement", group="Encast", ux=0.0, uy=0.0),
            entry("displacement", group="Axe", ux=0.0),
            entry("pressure", group="Force", value=100.0),
            entry("steps", count=4),
            kinematics="finite",
        )
        one = solve(text, lacmesh.read(_MESHES / "ssna122a.med"))
        (m,) = one.mesh.node_groups["M"]
        solutions.append(one)
        u.append(float(one.u[m, 1]))
    part, right = 1 - u[1] / u[0], 1 - given.expected[1] / given.expected[0]
    source = "code_aster, ssna122a"
    return Outcome(
        (
            equal("part of u_y that friction takes off", part, right, 0.001, source=source,
                  reason="1.61 % on a prototype"),
            *(
                informative(f"u_y of M, mu = {mu:g}", own, reason="its moduli are taken to be the roller's",
                            published=(Published("code_aster", theirs, source),))
                for mu, own, theirs in zip((0.0, 0.1), u, given.expected, strict=True)
            ),
            *balanced(solutions),
        )
    )  # fmt: skip


@dataclass(frozen=True)
class Ironing:
    """Shallow ironing, ssnp153a: a die goes down by 1, then along by 10, in 10 and `steps` steps."""

    slave: str
    steps: int = 100
    iterations: int = 600


def solve_ironing(case: Case, levels: int) -> Outcome:
    """Iron, with the die or the slab as the slave."""
    given: Ironing = case.parameters
    times = [*(0.1 * (k + 1) for k in range(10)), *(1 + (k + 1) / given.steps for k in range(given.steps))]
    master = {"Master": "Slave", "Slave": "Master"}[given.slave]
    text = case_text(
        "plane_strain",
        entry("material", groups=["Soft"], law="neo_hookean", young=6.896e8, poisson=0.32),
        entry("material", groups=["Hard"], law="neo_hookean", young=68.96e8, poisson=0.32),
        entry("contact", slave=given.slave, master=master, friction=0.3),
        entry("displacement", group="Bloq", ux=0.0, uy=0.0),
        entry(
            "displacement",
            group="Depl",
            ux=[[0.0, 0.0], [1.0, 0.0], [2.0, 10.0]],
            uy=[[0.0, 0.0], [1.0, -1.0], [2.0, -1.0]],
        ),
        entry("steps", times=times),
        kinematics="finite",
    )
    mesh = lacmesh.read(_MESHES / "ssnp153a.med")
    one = solve(text, joined([(mesh, {})], keep=True) if mesh.space_dim == 2 else mesh)
    (end,) = one.figures.contact.values()
    return Outcome(
        (
            at_most(f"iterations of {len(times)} steps", one.iterations, given.iterations,
                    source="a prototype: 528 and 656"),
            at_most("cutbacks", one.halvings, 0, source="a prototype had none"),
            informative("F_x at the end", float(end.resultant[0]), reason="7.865e7 and 7.885e7 on a prototype"),
            informative("F_y at the end", float(end.resultant[1]), reason="-3.3313e8 and -3.3299e8 on a prototype"),
            *balanced([one]),
        )
    )  # fmt: skip


# ---- the ledger of work


@dataclass(frozen=True)
class RoundedDie:
    """A half-cylinder that is pressed into a block of rubber and dragged over it, in so many steps."""

    steps: int = 96
    friction: float = 0.3
    part: float = 0.01


def solve_ledger(case: Case, levels: int) -> Outcome:
    """Follow the ledger: its rest, and the work of pressures, over the dissipation."""
    given: RoundedDie = case.parameters
    text = case_text(
        "plane_strain",
        entry("material", groups=["block"], law="neo_hookean", young=10.0, poisson=0.4),
        entry("material", groups=["die"], law="neo_hookean", young=500.0, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=given.friction, normals="smoothed"),
        entry("displacement", group="bottom", ux=0.0, uy=0.0),
        entry("displacement", group="top", ux=[[1.0, 0.0], [4.0, 4.5]], uy=[[0.0, 0.0], [1.0, -0.65]]),
        entry("steps", end=4.0, count=given.steps),
        kinematics="finite",
    )
    one = solve(text, ironing_2d())
    work = one.state.step.work
    if work is None:
        raise ValueError("a static case with friction has a ledger")
    source = "external work = strain energy + dissipation"
    return Outcome(
        (
            at_most("left of the external work, over the dissipation", abs(work.left) / work.dissipation, given.part,
                    source=source, reason="it falls with the size of the steps"),
            at_most("work of pressures over the dissipation", abs(work.pressures) / work.dissipation, given.part,
                    source=source, reason="3 % at sharp corners"),
            informative("external work", work.external, reason="no bound"),
            informative("dissipation", work.dissipation, reason="no bound"),
            *balanced([one]),
        )
    )  # fmt: skip


# ---- motion


@dataclass(frozen=True)
class Thrown:
    """A block that is thrown along a rigid plane. `speed`, `gravity`, `friction`; SI units."""

    cell: str
    speed: float = 1.0
    gravity: float = 10.0
    friction: float = 0.4
    steps: int = 320


def solve_thrown(case: Case, levels: int) -> Outcome:
    """Slide until it stands."""
    given: Thrown = case.parameters
    stops = given.speed / (given.friction * given.gravity)
    text = case_text(
        "plane_strain",
        entry("material", young=2e6, poisson=0.3, density=1000.0),
        entry("contact", slave="slave", master="master", friction=given.friction),
        entry("rigid", group="master"),
        entry("gravity", gy=-given.gravity),
        entry("initial", groups=["pad"], vx=given.speed),
        entry("dynamics"),
        entry("steps", end=1.2 * stops, count=given.steps),
    )
    one = solve(text, meshes.pad(given.cell, 8))
    along = [float(state.u.reshape(-1, 2)[_nodes(one, "pad"), 0].mean()) for state in one.states]
    right = given.speed**2 / (2 * given.friction * given.gravity)
    still = abs(along[-1] - along[-len(along) // 20]) / right
    return Outcome(
        (
            equal("distance", along[-1], right, 0.005 * right, source="v^2 / (2 mu g)", reason="it sways as it stops"),
            at_most("way in the last twentieth of the time, of the distance", still, 1e-3, source="it stands"),
            informative("iterations of a step, mean", one.iterations / len(one.states), reason="no bound"),
        )
    )


def cases(family: str) -> Iterator[Case]:
    """Large sliding, code_aster's meshes, motion."""
    for cell in ("QUAD4", "QUAD8"):
        for below in (False, True):
            name = f"dragged-{cell}-{'lower' if below else 'upper'}"
            description = f"a block pulled over another, {'the lower' if below else 'it'} is the slave"
            suite = "quick" if cell == "QUAD4" else "full"
            yield Case(family, name, description, PulledBlock(cell, below), {suite: 1}, 5.0)
    for steps in (24, 48):
        description = f"a ring on a hub, a turn in {steps} steps"
        yield Case(family, f"carried-{steps}", description, Carried("QUAD4", steps), {"full": 1}, 20.0)
    for dim, pair in ((2, ("QUAD4", "TRIA6")), (3, ("HEXA8", "TETRA4"))):
        yield Case(family, f"cycled-{dim}d", "ten cycles of shear that sticks", Cycled(pair, dim), {"full": 1}, 30.0)
    description = "a half-cylinder dragged over rubber: where the work goes"
    yield Case(family, "ledger", description, RoundedDie(), {"full": 1}, 60.0)
    yield Case(family, "thrown", "a block thrown along a plane", Thrown("QUAD4"), {"full": 1}, 20.0)
    if _MESHES.is_dir():
        yield Case(family, "ssnp154a", "NAFEMS's roller, code_aster's mesh", Roller(), {"quick": 1}, 5.0)
        yield Case(family, "ssna122a", "NAFEMS's punch, code_aster's mesh", RoundedPunch(), {"full": 1}, 5.0)
        for slave, who in (("Master", "die"), ("Slave", "slab")):
            yield Case(family, f"ironing-{who}", f"ironing, the {who} is the slave", Ironing(slave), {"all": 1}, 300.0)
