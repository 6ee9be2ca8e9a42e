"""**Motion.** A block that is thrown along a plane slides v^2 / (2 mu g) far, and stays."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from verification.exact import impact
from verification.meshes import friction as meshes
from verification.meshes.balls import half_sphere_on_wall
from verification.meshes.blocks import nodes_of
from verification.records import Case, Outcome, at_least, at_most, equal, informative
from verification.solving import Solved, balanced, case_text, entry, solve

Floats = NDArray[np.floating]


def solve_thrown(
    cell: str, speed: float = 1.0, gravity: float = 10.0, friction: float = 0.4, steps: int = 320, *, levels: int
) -> Outcome:
    """A block that is thrown along a rigid plane. `speed`, `gravity`, `friction`; SI units. Slide until it stands."""
    stops = speed / (friction * gravity)
    text = case_text(
        "plane_strain",
        entry("material", young=2e6, poisson=0.3, density=1000.0),
        entry("contact", slave="slave", master="master", friction=friction),
        entry("rigid", group="master"),
        entry("gravity", gy=-gravity),
        entry("initial", groups=["pad"], vx=speed),
        entry("dynamics"),
        entry("steps", end=1.2 * stops, count=steps),
    )
    one = solve(text, meshes.pad(cell, 8))
    along = [float(state.u.reshape(-1, 2)[nodes_of(one.mesh, "pad"), 0].mean()) for state in one.states]
    right = speed**2 / (2 * friction * gravity)
    still = abs(along[-1] - along[-len(along) // 20]) / right
    return Outcome(
        (
            equal("distance", along[-1], right, 0.005 * right, source="v^2 / (2 mu g)", reason="it sways as it stops"),
            at_most("way in the last twentieth of the time, of the distance", still, 1e-3, source="it stands"),
            informative("iterations of a step, mean", one.iterations / len(one.states), reason="no bound"),
        )
    )


def solve_spinning(
    slip: float, friction: float, poisson: float, approach: float = 1e-3, steps: int = 40, *, levels: int
) -> Outcome:
    """An elastic sphere that hits a rigid plane with spin. `slip`: speed of its skin along the plane, over the normal
    one; `approach`: largest, over the radius. Half of the sphere; small strains, since it turns by a few thousandths
    during the impact. The normals are the sphere's own, which its small rotation does not move.
    """
    nu, mu = poisson, friction
    speed = impact.speed_for(approach, 1.0, 1.0, nu, 1.0)
    dt = impact.hertz(1.0, 1.0, nu, 1.0, speed).duration / steps
    count = round(1.15 * steps)
    text = case_text(
        "3d",
        entry("material", young=1.0, poisson=nu, density=1.0),
        entry("contact", slave="slave", master="wall", friction=mu, normals="slave"),
        entry("rigid", group="wall"),
        *(entry("displacement", group=plane, uy=0.0) for plane in ("x0", "y0")),
        entry("initial", groups=["ball"], vz=-speed, rotation=[0.0, -slip * speed, 0.0], centre=[0.0, 0.0, 1.0]),
        entry("dynamics"),
        entry("steps", end=count * dt, count=count),
    )
    mesh = half_sphere_on_wall(np.sqrt(approach), 2.5 * dt * speed, 3)
    one = solve(text, mesh)
    up, along, spin = (change / speed for change in _changes(one))
    _, right = impact.rebound(slip, mu, nu)
    slides = slip > 7 * mu
    source = "rigid bodies: mu (1 + e) v_n" if slides else "springs side by side, each sticks or slides"
    reason = "Hertz' contact is of half-spaces, and three cells wide"
    within = 0.02 if slides else 0.03
    rolls = informative("that of a rigid sphere that rolls", 2 / 7 * slip, reason="an elastic one swings")
    return Outcome(
        (
            equal("change of the normal velocity over v_n", up, 2.0, 0.02, source="Hertz 1882", reason=reason),
            equal("change of the velocity along the plane, of the exact one", along / right, 1.0, within,
                  source=source, reason=reason),
            equal("change of spin, of the exact one", spin / (2.5 * right), 1.0, within, source=source, reason=reason),
            *([] if slides else [rolls]),
            at_most("largest energy, of that at the start", _largest(one), 1.001, source="no energy is created"),
            *balanced([one]),
        )
    )  # fmt: skip


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


def solve_leaning(friction: float, angle: float = 60.0, gravity: float = 1.0, *, levels: int) -> Outcome:
    """A rod of length 1 that leans on a rigid plane and is pushed along it with its foot ahead, at a speed of 1.

    Painleve (1895): with 1 + 3 cos^2 a < 3 mu sin a cos a (a: its angle) a rigid rod has no force that lets it slide.
    An elastic rod slides where a rigid one can; where it cannot, its foot is stopped at once, and thrown up.
    """
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    denominator = float(1 + 3 * c**2 - 3 * friction * s * c)  # m g over the normal force of a rigid rod at the start
    text = case_text(
        "plane_strain",
        entry("material", law="neo_hookean", young=1e3, poisson=0.3, density=1.0),
        entry("contact", slave="slave", master="master", friction=friction),
        entry("rigid", group="master"),
        entry("gravity", gy=-gravity),
        entry("initial", groups=["rod"], vx=-1.0),
        entry("dynamics"),
        entry("steps", end=0.1, count=100),
        kinematics="finite",
    )
    one = solve(text, meshes.rod("QUAD4", 16, np.radians(angle)))
    zones, foot = [state.zones[0] for state in one.states], nodes_of(one.mesh, "slave")
    force = float(np.mean([zone.pressure @ zone.area for zone in zones])) / (0.1 * gravity)
    slid = -float(one.u[foot, 0].mean())
    if denominator > 0:
        results = [equal("normal force over m g, mean", force, 1 / denominator, 0.05 / denominator,
                         source="a rigid rod", reason="it turns, and its foot has a width")]  # fmt: skip
    else:
        early = np.array([state.u.reshape(-1, 2)[foot, 0].mean() for state in one.states[:50]])
        results = [
            at_most("way of the foot in half the time, of that without friction", float(np.abs(early).max()) / 0.05,
                    0.05, source="it jams: an impact without a collision"),
            at_least("normal force over m g, largest", max(float(zone.pressure @ zone.area) for zone in zones) / 0.1,
                     10.0, source="a rigid rod has none that is finite"),
        ]  # fmt: skip
    return Outcome(
        (
            *results,
            informative("way of the foot", slid, reason="0.1 without friction"),
            at_most("largest energy, of that at the start", _largest(one), 1.001, source="no energy is created"),
            *balanced([one]),
        )
    )


def cases(family: str) -> Iterator[Case]:
    """A block, a sphere, a rod."""
    yield Case(family, "thrown", "a block thrown along a plane", partial(solve_thrown, "QUAD4"), {"full": 1}, 20.0)
    slides, sticks = partial(solve_spinning, 4.0, 0.1, 0.3), partial(solve_spinning, 1.0, 0.3, 0.45)
    yield Case(family, "spinning-slides", "a sphere with much spin hits a plane", slides, {"full": 1}, 150.0)
    description = "a sphere with spin that hits a plane slides, then sticks"
    yield Case(family, "spinning-sticks", description, sticks, {"full": 1}, 150.0)
    for friction, word in ((0.5, "slides"), (2.0, "jams")):
        solve = partial(solve_leaning, friction)
        yield Case(family, f"rod-{word}", "a rod pushed along a plane, Painleve's", solve, {"full": 1}, 12.0)
