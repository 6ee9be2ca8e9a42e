"""**Cattaneo and Mindlin.** Half-planes of one material with the clearance x^2 / 2R, pressed together, then sheared by
Q < mu P; on the outer boundary the exact displacements in closed form, so that the mesh is the only error. The middle
sticks, t is the difference of two ellipses. Forth in one step or many, back and forth again (Mindlin and Deresiewicz),
and in space with nu = 0, where slip is along the load. Lengths are in half-widths of contact, stresses in E. The
error of t is held against that of the best constants on the finest mesh.

**Carter.** The same contact, sheared, moves along the half-planes as two like cylinders roll on one another: what
sticks moves to the leading edge, and the far bodies creep.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from lacsolver.case import Value
from verification.exact import cattaneo
from verification.exact.cattaneo import Cylinders
from verification.exact.half_plane import Ellipse
from verification.exact.spheres import LikeSpheres
from verification.measures.edge import edge_of_contact
from verification.measures.norms import PressureErrors, pressure_errors
from verification.meshes.half_spaces import REACH, depth_lines, edge_lines, facing, half_planes, piece
from verification.pages.charts import Plot
from verification.profiles import line
from verification.records import Case, Outcome, at_most, equal, informative, rate
from verification.solving import (
    LevelSolution,
    Motion,
    Solved,
    balanced,
    case_text,
    convergence,
    entry,
    solve,
    with_motions,
)

Floats = NDArray[np.floating]
#: Q / (mu P) of the shear; macro-elements to the half-width, by level
LOAD, LEVELS = 0.6, (8, 16, 32, 64)
FRACTION = 0.6
CYLINDERS, SPHERES = Cylinders(), LikeSpheres()
#: error of t over that of the best constants, at most, by cell
BEST = {"TRIA3": 2.0, "QUAD4": 1.5, "TRIA6": 1.2, "QUAD8": 1.2}
#: iterations of the step of shear, and of a step of 16
ITERATIONS, MANY_ITERATIONS = 16, 3
_SOURCE = "Cattaneo 1938, Mindlin 1949; Johnson, Contact Mechanics, 7.2"
_RATE = "two square-root edges and a kink: constants come to 0.85"
_STEPS = "like bodies: t does not depend on the number of steps"


@dataclass(frozen=True)
class PressedCylinders:
    """Cylinders of cells of a type, pressed in one step, then sheared to each of `turns` in `steps` steps."""

    cell: str
    turns: tuple[float, ...] = (LOAD,)
    steps: int = 1
    exact: Cylinders = CYLINDERS
    levels: tuple[int, ...] = LEVELS
    macro: str = "cut"

    def loads(self, t: float) -> tuple[Ellipse, ...]:
        """Tractions at a time t >= 1: pressed at 1, the first turn at 2, and so on."""
        done = int(t - 1 + 1e-9)
        before = (0.0, *self.turns)
        part = t - 1 - done
        now = () if done >= len(self.turns) else (before[done] + part * (before[done + 1] - before[done]),)
        return self.exact.sheared(*self.turns[:done], *(now if part > 1e-9 else ()))

    def motion(self, side: int) -> Motion:
        """Displacement of a body; up to the time 1, that under pressure alone grows in proportion."""

        def u(x: Floats, t: float) -> Floats:
            return np.asarray(min(t, 1.0) * self.exact.displacement(x[:, :2], side, self.loads(max(t, 1.0))))

        return u

    @property
    def times(self) -> tuple[float, ...]:
        """Ends of the steps."""
        n = self.steps * len(self.turns)
        return (1.0, *(1 + len(self.turns) * (k + 1) / n for k in range(n)))


def case_of(
    contact: Mapping[str, object], bodies: Mapping[str, tuple[float, float]], motions: Mapping[str, Motion],
    times: tuple[float, ...], *more: str,
) -> lacsolver.Case:  # fmt: skip
    """A case of two half-spaces with these elastic constants, whose groups far_... are moved by functions."""
    dim = next(iter(motions.values()))(np.ones((1, 3)), 1.0).shape[1]
    text = case_text(
        "3d" if dim == 3 else "plane_strain",
        *(entry("material", groups=[group], young=young, poisson=nu) for group, (young, nu) in bodies.items()),
        entry("contact", slave="slave", master="master", **contact),
        entry("steps", times=list(times)),
        *more,
    )
    return with_motions(text, {f"far_{body}": motion for body, motion in motions.items()})


def solved(given: PressedCylinders, k: int, friction: float | None = None) -> Solved:
    """Solve with about k macro-elements to the half-width; `friction`: that of the exact solution by default."""
    exact = given.exact
    coefficient = exact.friction if friction is None else friction
    contact = {"clearance": f"x**2 / {2 * exact.radius!r}", "friction": coefficient, "macro": given.macro}
    bodies = dict.fromkeys(("upper", "lower"), (exact.young, exact.poisson))
    motions = {"upper": given.motion(1), "lower": given.motion(-1)}
    return solve(case_of(contact, bodies, motions, given.times), half_planes(given.cell, k, FRACTION))


def shear_errors(one: Solved, loads: tuple[Ellipse, ...]) -> PressureErrors:
    """Errors of t in L2, relative to the exact shear stress."""
    return pressure_errors(one.mesh, one.shear[:, 0], lambda x: cattaneo.shear(x[:, 0], loads)[:, None])


def solve_level(given: PressedCylinders, level: int) -> LevelSolution:
    """Solve on one level; errors relative to the exact values."""
    k = given.levels[level]
    one, loads, exact = solved(given, k), given.loads(given.times[-1]), given.exact
    zone = one.fields.zones["slave"]
    p = pressure_errors(one.mesh, zone.pressure, lambda x: cattaneo.pressure(x[:, 0], loads)[:, None])
    t, c = shear_errors(one, loads), exact.stick(given.turns[0])
    total = one.friction.energy[1] / exact.dissipation(given.turns[0])
    turns = 2 * len(given.turns) - 1  # every reversal takes twice what the first load does
    errors = {
        "p_m": p.exact,
        "t_m": t.exact,
        "best": t.best,
        "c": abs(stick_of(one, exact) / c - 1),
        "work": abs(total / turns - 1),
    }
    return LevelSolution(one, 1 / (k + FRACTION), errors)


def stick_of(one: Solved, exact: Cylinders | LikeSpheres) -> float:
    """Half-width of what sticks: mu p - |t| falls there as a Hertzian pressure does."""
    zone = one.fields.zones["slave"]
    left = exact.friction * zone.pressure - np.linalg.norm(one.shear, axis=1)
    c = exact.stick(LOAD)
    return edge_of_contact(np.linalg.norm(zone.centre[:, :-1], axis=1), left, exact.friction * exact.peak * c, 0.5 * c)


def solve_pressed(given: PressedCylinders, *, levels: int) -> Outcome:
    """Cylinders on so many levels."""
    solutions = [solve_level(given, level) for level in range(levels)]
    at_32 = solutions[min(2, levels - 1)]
    most = max(state.iterations for one in solutions for state in one.solved.states[1:])
    ratios = [one.errors["t_m"] / one.errors["best"] for one in solutions]
    return Outcome(
        (
            rate("t_m, L2", convergence(solutions, "t_m"), 0.8, source=_SOURCE, reason=_RATE),
            rate("p_m, L2", convergence(solutions, "p_m"), None, source="", reason="asked for in the family hertz"),
            at_most("error of t_m over that of the best constants, finest level", ratios[-1], BEST[given.cell],
                    source="measured on a prototype: 1.09 to 1.45, TRIA3 1.9"),
            informative("error of t_m over that of the best constants, worst level", max(ratios),
                        reason="a kink in a macro-element of a coarse mesh weighs more"),
            at_most(f"half-width of stick, relative error, k = {given.levels[min(2, levels - 1)]}", at_32.errors["c"],
                    0.02, source=_SOURCE, levels=convergence(solutions, "c")),
            at_most(f"dissipation, relative error, k = {given.levels[min(2, levels - 1)]}", at_32.errors["work"], 0.01,
                    source="slip in closed form times mu p", levels=convergence(solutions, "work")),
            at_most("iterations of a step of shear", most, ITERATIONS, source="k = 8 ... 64"),
            informative("halved steps", sum(one.solved.halvings for one in solutions), reason="no bound"),
            *balanced([one.solved for one in solutions]),
        ),
        (profile(given, at_32),),
    )  # fmt: skip


def profile(given: PressedCylinders, one: LevelSolution) -> Plot:
    """Exact and computed shear stress along the contact."""
    x = np.linspace(-1.2, 1.2, 241)
    loads, zone = given.loads(given.times[-1]), one.solved.fields.zones["slave"]
    near = np.flatnonzero(np.abs(zone.centre[:, 0]) < 1.2)
    near = near[np.argsort(zone.centre[near, 0])]
    lines = (
        line("exact", x, cattaneo.shear(x, loads)),
        line("bound mu p, exact", x, given.exact.friction * cattaneo.pressure(x, loads)),
        line("t_m", zone.centre[near, 0], one.solved.shear[:, 0][near], "points"),
    )
    return Plot("shear", f"shear stress, h = {one.h:.3g} a", "x / a", "t / E", lines)


# ---- numbers of steps


def solve_steps(
    given: PressedCylinders, counts: tuple[int, ...] = (1, 2, 4, 8, 16), k: int = 16, *, levels: int
) -> Outcome:
    """Cylinders sheared in several numbers of steps, k macro-elements to the half-width. All numbers of steps, against
    one step.
    """
    each = [solved(replace(given, steps=n), k) for n in counts]
    size = np.abs(each[0].shear[:, 0]).max()
    apart = max(float(np.abs(one.shear[:, 0] - each[0].shear[:, 0]).max() / size) for one in each)
    errors = [shear_errors(one, given.loads(given.times[-1])).exact for one in each]
    work = [one.friction.energy[1] for one in each]
    last = float(np.mean([state.iterations for state in each[-1].states[1:]]))
    return Outcome(
        (
            at_most(f"largest difference of t_m between {counts} steps, of the largest t_m", apart, 1e-9,
                    source=_STEPS),
            informative("t_m in L2, relative error", max(errors), reason="judged with the rates"),
            informative("dissipation, largest relative difference", max(np.abs(np.array(work) / work[-1] - 1)),
                        reason="work of t over the slip of a step"),
            at_most(f"iterations of a step of {counts[-1]}, mean", last, MANY_ITERATIONS,
                    source="measured on a prototype: 1.8"),
            *balanced(each),
        )
    )  # fmt: skip


# ---- space


def balls(cell: str, k: int) -> Mesh:
    """Halves of two half-spaces, y >= 0: the plane that the load is in is one of symmetry."""
    aside, deep = edge_lines(k, FRACTION), depth_lines(k)
    whole, even = np.concatenate([-aside[:0:-1], aside]), np.linspace(0, REACH, 3 * k // 2 + 1)
    upper = piece(cell, [whole, aside, deep])
    lower = piece(cell, [np.concatenate([-even[:0:-1], even]), even, -deep[::-1]])
    return facing(upper, lower, y0="axis_y")


def solve_balls(cell: str, sizes: tuple[int, ...], exact: LikeSpheres = SPHERES, *, levels: int) -> Outcome:
    """Like spheres with nu = 0, of cells of a type; `sizes`: cells to the radius of contact."""
    solutions = [_ball(cell, exact, k) for k in sizes[:levels]]
    most = max(state.iterations for one in solutions for state in one.solved.states[1:])
    return Outcome(
        (
            rate("t_m, L2", convergence(solutions, "t_m"), None, source=_SOURCE, reason="few and coarse levels"),
            informative("error of t_m over that of the best constants, finest level",
                        solutions[-1].errors["t_m"] / solutions[-1].errors["best"], reason="2 and 0.8 on a prototype"),
            informative("t_m across the load, of its largest", solutions[-1].errors["across"], reason="0: nu is 0"),
            informative("radius of stick, relative error, finest level", solutions[-1].errors["c"],
                        reason="5 % with k = 12 on a prototype of linear cells, 0.9 % with k = 6 of quadratic ones",
                        levels=convergence(solutions, "c")),
            informative("dissipation, relative error, finest level", solutions[-1].errors["work"], reason="no bound",
                        levels=convergence(solutions, "work")),
            at_most("iterations of the step of shear", most, ITERATIONS, source="as in the plane"),
            *balanced([one.solved for one in solutions]),
        )
    )  # fmt: skip


def motion_of_ball(exact: LikeSpheres, side: int) -> Motion:
    """Displacement far from the contact: pressed until t = 1, then sheared."""
    kept: dict[tuple[int, float], Floats] = {}

    def u(x: Floats, t: float) -> Floats:
        if x.shape[0] == 1:
            return np.zeros((1, 3))
        key = len(x), t
        if key not in kept:
            kept[key] = min(t, 1.0) * exact.displacement(x, side, LOAD * (t - 1) if t > 1 else 0.0)
        return kept[key]

    return u


def solved_balls(exact: LikeSpheres, cell: str, k: int, friction: float | None, times: tuple[float, ...]) -> Solved:
    """Solve spheres, pressed until t = 1 and then sheared; `friction`: None without it."""
    contact = {"clearance": f"(x**2 + y**2) / {2 * exact.radius!r}", "friction": friction}
    bodies = dict.fromkeys(("upper", "lower"), (exact.young, 0.0))
    motions = {"upper": motion_of_ball(exact, 1), "lower": motion_of_ball(exact, -1)}
    more = entry("displacement", group="axis_y", uy=0.0)
    return solve(case_of(contact, bodies, motions, times, more), balls(cell, k))


def _ball(cell: str, exact: LikeSpheres, k: int) -> LevelSolution:
    one = solved_balls(exact, cell, k, exact.friction, (1.0, 2.0))
    zone = one.fields.zones["slave"]
    t = pressure_errors(
        one.mesh, one.shear[:, 0], lambda x: exact.shear(np.linalg.norm(x[:, :2], axis=1), LOAD)[:, None]
    )
    p = pressure_errors(one.mesh, zone.pressure, lambda x: exact.pressure(np.linalg.norm(x[:, :2], axis=1))[:, None])
    errors = {
        "p_m": p.exact,
        "t_m": t.exact,
        "best": t.best,
        "c": abs(stick_of(one, exact) / exact.stick(LOAD) - 1),
        "work": abs(2 * one.friction.energy[1] / exact.dissipation(LOAD) - 1),
        "across": float(np.abs(one.shear[:, 1]).max() / np.abs(one.shear[:, 0]).max()),
    }
    return LevelSolution(one, 1 / (k + FRACTION), errors)


# ---- rolling


def rolled(cell: str, k: int, way: float) -> Mesh:
    """Half-planes from -REACH to REACH + way, with k cells to the half-width where the contact moves."""
    n = round((2 + way) * k)
    near = np.linspace(-1.0, 1.0 + way, n + 1)
    out = np.linspace(1.0, REACH, k // 2 + 1)[1:]
    aside = np.concatenate([-out[::-1], near, out + way])
    even = np.linspace(-REACH, REACH + way, round(1.5 * len(aside) * 0.9))
    deep = depth_lines(k)
    upper, lower = piece(cell, [aside, deep]), piece(cell, [even, -deep[::-1]])
    return facing(upper, lower)


def solve_rolling(
    cell: str, k: int = 20, load: float = 0.5, way: float = 5.0, exact: Cylinders = CYLINDERS, *, levels: int
) -> Outcome:
    """Cylinders that roll by `way` under a tangential load; `k` macro-elements to the half-width, a step for each.
    Press, shear, roll by one macro-element a step; what creeps is what the exact far displacements move.

    The force falls to that of steady rolling over some two widths of contact: after 1.5 of them it is still 1 % above.
    """
    creep = exact.creep(load)
    n = round(way * k)
    times = (1.0, 2.0, *(2 + (step + 1) / n for step in range(n)))

    def at(t: float) -> float:
        return way * max(t - 2, 0.0)

    def motion(side: int) -> Motion:
        def u(x: Floats, t: float) -> Floats:
            if t <= 1:
                return np.asarray(t * exact.displacement(x[:, :2], side, exact.sheared()))
            if t <= 2:
                return exact.displacement(x[:, :2], side, exact.sheared(load * (t - 1)))
            moved = x[:, :2] - [at(t), 0.0]
            out = exact.displacement(moved, side, exact.rolling(load), stuck=exact.half_width - exact.stick(load))
            return out + ([creep * at(t), 0.0] if side > 0 else [0.0, 0.0])

        return u

    gap = Value.of(lambda x, t: (x[:, 0] - at(t)) ** 2 / (2 * exact.radius))
    bodies = dict.fromkeys(("upper", "lower"), (exact.young, exact.poisson))
    rolling = case_of({"friction": exact.friction}, bodies, {"upper": motion(1), "lower": motion(-1)}, times)
    rolling = replace(rolling, contact=(replace(rolling.contact[0], clearance=gap),))
    one = solve(rolling, rolled(cell, k, way))
    loads = exact.rolling(load, way)
    zone = one.fields.zones["slave"]
    t = shear_errors(one, loads)
    total = float((one.shear[:, 0] * zone.area).sum() / (exact.friction * exact.force))
    x = zone.centre[:, 0] - way
    slides = np.abs(one.slip[:, 0]) > 0.02 * creep * way / n
    slides &= zone.pressure > 0
    edge = float(x[slides].max() + 0.5 / k)
    return Outcome(
        (
            equal("creep over that of the tangential force it gives", creep / exact.creep(total), 1.0, 0.03,
                  source="Carter 1926; Johnson, 8.3", reason=f"macro-elements of 1/{k} of the half-width"),
            informative("tangential force over mu P", total, reason=f"{load:g} of the exact creep"),
            equal("where stick begins, from the middle", edge, 1 - 2 * exact.stick(load), 2 / k,
                  source="Carter 1926", reason="two macro-elements"),
            informative("t_m in L2, relative error", t.exact, reason="beside the best constants'"),
            informative("best constants, relative error", t.best, reason="beside t_m's"),
            informative("iterations of a step, mean", one.iterations / len(one.states), reason="no bound"),
            *balanced([one]),
        )
    )  # fmt: skip


def cases(family: str) -> Iterator[Case]:
    """Cylinders, spheres, rolling."""
    for cell in BEST:
        quick = {"quick": 3} if cell in ("TRIA3", "QUAD8") else {}
        description = f"Cattaneo and Mindlin, {cell}: rates, stick, dissipation"
        solve = partial(solve_pressed, PressedCylinders(cell))
        yield Case(family, f"cattaneo-{cell}", description, solve, {**quick, "full": 4}, 60.0)
    given = PressedCylinders("TRIA3", levels=tuple(2 * k for k in LEVELS), macro="stars")
    description = "Cattaneo and Mindlin, TRIA3, as many stars, of two faces each"
    yield Case(family, "cattaneo-TRIA3-stars", description, partial(solve_pressed, given), {"full": 4}, 60.0)
    for name, turns in (("back", (LOAD, -LOAD)), ("loop", (LOAD, -LOAD, LOAD))):
        reversed_ = partial(solve_pressed, PressedCylinders("QUAD8", turns))
        yield Case(family, f"reversed-{name}", "Mindlin and Deresiewicz, QUAD8", reversed_, {"full": 3}, 40.0)
    for cell in ("QUAD4", "QUAD8"):
        given = PressedCylinders(cell)
        solve = partial(solve_steps, given)
        yield Case(
            family, f"steps-{cell}", "in 1, 2, ... 16 steps", solve, {"quick" if cell == "QUAD4" else "full": 1}, 15.0
        )
        loop = partial(solve_steps, PressedCylinders(cell, (LOAD, -LOAD)), (1, 16))
        yield Case(family, f"steps-reversed-{cell}", "there and back in 1 and 16 steps", loop, {"full": 1}, 20.0)
    for cell, counts in (("HEXA8", (4, 6, 8)), ("HEXA20", (4, 6))):
        solve = partial(solve_balls, cell, counts)
        yield Case(family, f"spheres-{cell}", f"spheres with nu = 0, {cell}", solve, {"full": len(counts)}, 120.0)
    for cell in ("QUAD4", "QUAD8"):
        yield Case(
            family, f"rolling-{cell}", f"Carter's rolling, {cell}", partial(solve_rolling, cell), {"full": 1}, 60.0
        )
