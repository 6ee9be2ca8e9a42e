"""**Cattaneo and Mindlin.** Half-planes of one material with the clearance x^2 / 2R, pressed together, then sheared by
Q < mu P; on the outer boundary the exact displacements in closed form, so that the mesh is the only error. The middle
sticks, t is the difference of two ellipses. Forth in one step or many, back and forth again (Mindlin and Deresiewicz),
and in space with nu = 0, where slip is along the load. Lengths are in half-widths of contact, stresses in E. The
error of t is held against that of the best constants on the finest mesh.

**Carter.** The same contact, sheared, moves along the half-planes as two like cylinders roll on one another: what
sticks moves to the leading edge, and the far bodies creep.

**Cost.** How many times K^-1 is applied to solve the linear system of the last set of these problems to rounding, from
nothing, over the same for contact that is pressed without friction. Tractions along tangents make the systems two and
three times as large.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from lacsolver.case import Value
from lacsolver.equilibrium.load_step import LoadStep
from lacsolver.equilibrium.reduced import ReducedProblem
from lacsolver.equilibrium.state import StepState
from lacsolver.saddle.saddle import SaddleProblem
from lacsolver.saddle.schur import solve_saddle
from lacsolver.saddle.tolerances import ConvergenceTolerance
from verification.exact import cattaneo
from verification.exact.cattaneo import Cylinders
from verification.exact.half_plane import Ellipse
from verification.exact.spheres import LikeSpheres
from verification.measures.edge import edge_of_contact
from verification.measures.norms import PressureErrors, pressure_errors
from verification.meshes.half_spaces import REACH, depth_lines, edge_lines, facing, half_planes, piece
from verification.records import Case, Result, at_most, equal, levels_of, problem, rate, row
from verification.solving import (
    LevelSolution,
    Motion,
    Solved,
    balanced,
    case_text,
    contact,
    convergence,
    entry,
    fixed,
    material,
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


def case_of(
    keys: Mapping[str, Any], bodies: tuple[float, float], motions: Mapping[str, Motion],
    times: tuple[float, ...], *more: str, model: str = "plane_strain",
) -> lacsolver.Case:  # fmt: skip
    """A case of two half-spaces in contact (its `keys`), of Young's modulus and Poisson's ratio; far_... are moved."""
    text = case_text(
        model, material(bodies[0], bodies[1]), contact(**keys), entry("steps", times=list(times)), *more,
    )  # fmt: skip
    return with_motions(text, {f"far_{body}": motion for body, motion in motions.items()})


def most_iterations(solutions: list[Solved]) -> int:
    """Largest number of iterations of a step of shear."""
    return max(state.iterations for one in solutions for state in one.states[1:])


# ---- cylinders


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


def solved(given: PressedCylinders, k: int, friction: float | None = None) -> Solved:
    """Solve with about k macro-elements to the half-width; `friction`: that of the exact solution by default."""
    exact = given.exact
    coefficient = exact.friction if friction is None else friction
    keys = {"clearance": f"x**2 / {2 * exact.radius!r}", "friction": coefficient, "macro": given.macro}
    motions = {"upper": given.motion(1), "lower": given.motion(-1)}
    case = case_of(keys, (exact.young, exact.poisson), motions, given.times)
    return solve(case, half_planes(given.cell, k, FRACTION))


def shear_errors(one: Solved, loads: tuple[Ellipse, ...]) -> PressureErrors:
    """Errors of t in L2, relative to the exact shear stress."""
    return pressure_errors(one.mesh, one.shear[:, 0], lambda x: cattaneo.shear(x[:, 0], loads)[:, None])


def solve_level(given: PressedCylinders, level: int) -> LevelSolution:
    """Solve on one level; relative errors of t (and of the `best` constants for it), of the stick zone, of the work."""
    one, loads, exact = solved(given, given.levels[level]), given.loads(given.times[-1]), given.exact
    t, turns = shear_errors(one, loads), 2 * len(given.turns) - 1  # a reversal takes twice what the first load does
    left = exact.friction * one.zone.pressure - np.linalg.norm(one.shear, axis=1)  # it falls as Hertz' pressure does
    c = exact.stick(LOAD)
    edge = edge_of_contact(np.abs(one.zone.centre[:, 0]), left, exact.friction * exact.peak * c, 0.5 * c)
    errors = {
        "t_m": t.exact,
        "best": t.best,
        "c": abs(edge / exact.stick(given.turns[0]) - 1),
        "work": abs(one.friction.energy[1] / exact.dissipation(given.turns[0]) / turns - 1),
    }
    return LevelSolution(one, 1 / (given.levels[level] + FRACTION), errors)


@problem
def solve_pressed(given: PressedCylinders, *, levels: int) -> Iterator[Result]:
    """Cylinders on so many levels."""
    solutions = [solve_level(given, level) for level in range(levels)]
    yield rate("t_m, L2", convergence(solutions, "t_m"), 0.8, source=_SOURCE,
               reason="two square-root edges and a kink: constants come to 0.85")  # fmt: skip
    finest, at_32 = solutions[-1].errors, solutions[min(2, levels - 1)].errors
    name, source = "error of t_m over that of the best constants, finest level", "measured on a prototype: 1.09 to 1.45"
    yield at_most(name, finest["t_m"] / finest["best"], BEST[given.cell], source=f"{source}, TRIA3 1.9")
    for name, error, most, source in (
        ("half-width of stick", "c", 0.02, _SOURCE),
        ("dissipation", "work", 0.01, "slip in closed form times mu p"),
    ):
        quantity, table = (
            f"{name}, relative error, k = {given.levels[min(2, levels - 1)]}",
            convergence(solutions, error),
        )
        yield at_most(quantity, at_32[error], most, source=source, levels=table)
    every = [one.solved for one in solutions]
    yield at_most("iterations of a step of shear", most_iterations(every), ITERATIONS, source="k = 8 ... 64")
    yield from balanced(every)


@problem
def solve_steps(given: PressedCylinders, counts: tuple[int, ...] = (1, 2, 4, 8, 16)) -> Iterator[Result]:
    """Cylinders sheared in several numbers of steps, 16 macro-elements to the half-width, against the first number."""
    each = [solved(replace(given, steps=n), 16) for n in counts]
    size = np.abs(each[0].shear[:, 0]).max()
    apart = max(float(np.abs(one.shear[:, 0] - each[0].shear[:, 0]).max() / size) for one in each)
    last = float(np.mean([state.iterations for state in each[-1].states[1:]]))
    name = f"largest difference of t_m between {counts} steps, of the largest t_m"
    yield at_most(name, apart, 1e-9, source="like bodies: t does not depend on the number of steps")
    name = f"iterations of a step of {counts[-1]}, mean"
    yield at_most(name, last, MANY_ITERATIONS, source="measured on a prototype: 1.8")
    yield from balanced(each)


# ---- spheres


def solved_balls(cell: str, k: int, friction: float | None, times: tuple[float, ...]) -> Solved:
    """Halves y >= 0 of spheres with nu = 0, k cells to the radius of contact, pressed until t = 1 and then sheared.

    The plane that the load is in is one of symmetry. `friction`: None without it.
    """
    aside, deep, even = edge_lines(k, FRACTION), depth_lines(k), np.linspace(0, REACH, 3 * k // 2 + 1)
    upper = piece(cell, [np.concatenate([-aside[:0:-1], aside]), aside, deep])
    lower = piece(cell, [np.concatenate([-even[:0:-1], even]), even, -deep[::-1]])
    keys = {"clearance": f"(x**2 + y**2) / {2 * SPHERES.radius!r}", "friction": friction}
    motions = {"upper": _motion_of_ball(1), "lower": _motion_of_ball(-1)}
    case = case_of(keys, (SPHERES.young, 0.0), motions, times, fixed("axis_y", "y"), model="3d")
    return solve(case, facing(upper, lower, y0="axis_y"))


def _motion_of_ball(side: int) -> Motion:
    """Displacement far from the contact; it is dear, and kept for the other components."""
    kept: dict[tuple[int, float], Floats] = {}

    def u(x: Floats, t: float) -> Floats:
        key = len(x), t
        if key not in kept:
            kept[key] = min(t, 1.0) * SPHERES.displacement(x, side, LOAD * (t - 1) if t > 1 else 0.0)
        return kept[key]

    return u


@problem
def solve_balls(cell: str, sizes: tuple[int, ...], *, levels: int) -> Iterator[Result]:
    """Spheres of cells of a type; `sizes`: cells to the radius of contact."""
    solutions = [solved_balls(cell, k, SPHERES.friction, (1.0, 2.0)) for k in sizes[:levels]]
    h, unknowns = [1 / (k + FRACTION) for k in sizes[:levels]], [one.unknowns for one in solutions]
    errors = [
        pressure_errors(
            one.mesh, one.shear[:, 0], lambda x: SPHERES.shear(np.linalg.norm(x[:, :2], axis=1), LOAD)[:, None]
        ).exact
        for one in solutions
    ]
    reason = "few and coarse levels"
    yield rate("t_m, L2", levels_of(h, unknowns, errors), None, source=_SOURCE, reason=reason)
    name = "iterations of the step of shear"
    yield at_most(name, most_iterations(solutions), ITERATIONS, source="as in the plane")
    yield from balanced(solutions)


# ---- rolling


def rolled(cell: str, k: int, way: float) -> Mesh:
    """Half-planes from -REACH to REACH + way, with k cells to the half-width where the contact moves."""
    near = np.linspace(-1.0, 1.0 + way, round((2 + way) * k) + 1)
    out = np.linspace(1.0, REACH, k // 2 + 1)[1:]
    aside = np.concatenate([-out[::-1], near, out + way])
    even = np.linspace(-REACH, REACH + way, round(1.5 * len(aside) * 0.9))
    deep = depth_lines(k)
    return facing(piece(cell, [aside, deep]), piece(cell, [even, -deep[::-1]]))


@problem
def solve_rolling(cell: str) -> Iterator[Result]:
    """Cylinders, pressed and sheared, that then roll by one of 20 macro-elements to the half-width in each step.

    What creeps is what the exact far displacements move. The force falls to that of steady rolling over some two widths
    of contact: after 1.5 of them it is still 1 % above.
    """
    exact, load, way, k = CYLINDERS, 0.5, 5.0, 20
    creep, n = exact.creep(load), round(way * k)

    def at(t: float) -> float:
        return way * max(t - 2, 0.0)

    def motion(side: int) -> Motion:
        def u(x: Floats, t: float) -> Floats:
            if t <= 2:
                loads = exact.sheared(load * (t - 1)) if t > 1 else exact.sheared()
                return np.asarray(min(t, 1.0) * exact.displacement(x[:, :2], side, loads))
            moved, stuck = x[:, :2] - [at(t), 0.0], exact.half_width - exact.stick(load)
            out = exact.displacement(moved, side, exact.rolling(load), stuck=stuck)
            return out + ([creep * at(t), 0.0] if side > 0 else [0.0, 0.0])

        return u

    gap = Value.of(lambda x, t: (x[:, 0] - at(t)) ** 2 / (2 * exact.radius))
    motions = {"upper": motion(1), "lower": motion(-1)}
    times = (1.0, 2.0, *(2 + (step + 1) / n for step in range(n)))
    rolling = case_of({"friction": exact.friction}, (exact.young, exact.poisson), motions, times)
    rolling = replace(rolling, contact=(replace(rolling.contact[0], clearance=gap),))
    one = solve(rolling, rolled(cell, k, way))
    zone = one.zone
    total = float((one.shear[:, 0] * zone.area).sum() / (exact.friction * exact.force))
    slides = (np.abs(one.slip[:, 0]) > 0.02 * creep * way / n) & (zone.pressure > 0)
    edge = float((zone.centre[:, 0] - way)[slides].max() + 0.5 / k)
    yield equal("creep over that of the tangential force it gives", creep / exact.creep(total), 1.0, 0.03,
                source="Carter 1926; Johnson, 8.3", reason=f"macro-elements of 1/{k} of the half-width")  # fmt: skip
    yield equal("where stick begins, from the middle", edge, 1 - 2 * exact.stick(load), 2 / k, source="Carter 1926",
                reason="two macro-elements")  # fmt: skip
    yield from balanced([one])


# ---- cost


def applications(one: Solved) -> int:
    """Applications of K^-1 for the linear system of the last set, from nothing."""
    model, states = ReducedProblem(one.problem), one.states
    step = LoadStep(model, states[-1].time, states[-2].step if len(states) > 1 else StepState())
    iterate = states[-1].step.iterate
    assert iterate is not None
    q, p, active = iterate
    contact = step.contact(q)
    linear = contact.linear(contact.first_rows(active, p), p)
    h, G = linear.load(step.f, contact.rows.B_T), linear.G + linear.rows.D @ q
    system = SaddleProblem(step.reference, linear.rows, linear.active, h, G, linear.S)
    moved = float(np.abs(step.u0).max())
    goal = ConvergenceTolerance(1e-10, 50, 0.0, moved, model.vectors).linear(0.0, moved)
    return solve_saddle(system, np.zeros_like(q), np.zeros_like(p), goal).applications


def _pressed(cell: str, dim: int, k: int, rubs: bool) -> Solved:
    """Cylinders or spheres that are pressed, and with friction sheared."""
    if dim == 3:
        return solved_balls(cell, k, *((SPHERES.friction, (1.0, 2.0)) if rubs else (None, (1.0,))))
    return solved(PressedCylinders(cell, (LOAD,) if rubs else ()), k, None if rubs else 0.0)


@problem
def solve_cost(cell: str, dim: int, sizes: tuple[int, ...], *, levels: int) -> Iterator[Result]:
    """Count for cells of a type, about so many (`sizes`) to the half-width on each level."""
    most, source = {2: (1.6, "1.25 to 1.45"), 3: (3.2, "2 to 3")}[dim]
    every = []
    for k in sizes[:levels]:
        pair = [_pressed(cell, dim, k, rubs) for rubs in (True, False)]
        ratio = applications(pair[0]) / applications(pair[1])
        name = f"applications of K^-1 over those without friction, k = {k}"
        yield at_most(name, ratio, most, source=f"measured on a prototype: {source}")
        every += pair
    yield from balanced(every)


def cases(family: str) -> Iterator[Case]:
    """Cylinders, spheres, rolling, cost."""
    for cell in BEST:
        what, quick = f"Cattaneo and Mindlin, {cell}: rates, stick, dissipation", 3 * (cell in ("TRIA3", "QUAD8"))
        name, given = f"cattaneo-{cell}", PressedCylinders(cell)
        yield row(family, name, what, solve_pressed, given, quick=quick, full=4, seconds=60.0)
    given = PressedCylinders("TRIA3", levels=tuple(2 * k for k in LEVELS), macro="stars")
    what = "Cattaneo and Mindlin, TRIA3, as many stars, of two faces each"
    yield row(family, "cattaneo-TRIA3-stars", what, solve_pressed, given, full=4, seconds=60.0)
    for name, turns in (("back", (LOAD, -LOAD)), ("loop", (LOAD, -LOAD, LOAD))):
        given, what = PressedCylinders("QUAD8", turns), "Mindlin and Deresiewicz, QUAD8"
        yield row(family, f"reversed-{name}", what, solve_pressed, given, full=3, seconds=40.0)
    for cell in ("QUAD4", "QUAD8"):
        given, what, quick = PressedCylinders(cell), "in 1, 2, ... 16 steps", int(cell == "QUAD4")
        yield row(family, f"steps-{cell}", what, solve_steps, given, quick=quick, full=1, seconds=15.0)
        given, what = PressedCylinders(cell, (LOAD, -LOAD)), "there and back in 1 and 16 steps"
        yield row(family, f"steps-reversed-{cell}", what, solve_steps, given, (1, 16), full=1, seconds=20.0)
        what = f"Carter's rolling, {cell}"
        yield row(family, f"rolling-{cell}", what, solve_rolling, cell, full=1, seconds=60.0)
    for cell, counts in (("HEXA8", (4, 6, 8)), ("HEXA20", (4, 6))):
        what = f"spheres with nu = 0, {cell}"
        yield row(family, f"spheres-{cell}", what, solve_balls, cell, counts, full=len(counts), seconds=120.0)
    costs: tuple[tuple[str, int, tuple[int, ...]], ...] = (
        *((cell, 2, (16, 32)) for cell in ("TRIA3", "QUAD4", "QUAD8")),
        ("TETRA4", 3, (4,)),
        ("HEXA8", 3, (4, 6)),
    )
    for cell, dim, sizes in costs:
        what, quick = f"applications of K^-1 with friction and without, {cell}", int(dim == 2)
        full, seconds = len(sizes), 10.0 if dim == 2 else 60.0
        yield row(family, f"cost-{cell}", what, solve_cost, cell, dim, sizes, quick=quick, full=full, seconds=seconds)
