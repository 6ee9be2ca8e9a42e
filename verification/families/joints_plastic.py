"""*Metals that yield.* A thick sphere under pressure, of which a part yields, against Hill's solution, with rates; a
tube that is opened by half its radius against a quadrature; the mean pressure under a flat punch against Prandtl's; the
first yield of Hertz's contact; a ball that is pressed in far beyond it; a plate whose cyclic load closes its loop.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacsolver.case import Material, Value
from lacsolver.results.figures import step_figures
from verification.exact.plastic import FIRST_YIELD, INDENTATION, PRANDTL, Sphere, Tube
from verification.families import hertz
from verification.grids import lines
from verification.meshes.blocks import block, joined, nodes_of, with_master
from verification.meshes.half_spaces import half_spaces, piece
from verification.meshes.rings import ring
from verification.records import Case, Rows, at_least, at_most, equal, problem, rate, row
from verification.solving import LevelSolution, Solved, balanced, case_text, convergence, entry, fixed, solve

Floats = NDArray[np.floating]

HILL = "Hill, The mathematical theory of plasticity, 1950, chapter V.2"
JOHNSON = "Johnson, Contact mechanics, 1985, section 6"
#: residual from which on Newton's method is expected to be quadratic; round-off of a residual on the finest mesh
_NEAR, _ROUNDING = 0.05, 1e-12


def metal(young: float = 500.0, poisson: float = 0.3, limit: float = 1.0, **more: object) -> str:
    """Table of a metal of perfect plasticity, unless `hardening` is among `more`."""
    return entry("material", law="plastic", young=young, poisson=poisson, **({"hardening": [[limit, 0.0]]} | more))


@problem
def solve_sphere(cell: str, bound: float, front: float = 1.5, *, levels: int) -> Rows:
    """A thick sphere (axisymmetric) of a cell, that yields as far as `front`; `bound`: rate of u in L2. Load a sphere
    in three steps on finer and finer meshes.
    """
    sphere, solutions = Sphere(1.0, 2.0, front, 500.0, 0.3, 1.0), []
    for n in (4 * 2**k for k in range(levels)):
        text = case_text(
            "axisymmetric", metal(), fixed("y0", "y"),
            entry("pressure", group="low", value=sphere.pressure), entry("steps", count=3),
        )  # fmt: skip
        solved = solve(text, ring(cell, (n, 2 * n), (1.0, 2.0)))
        x = solved.mesh.points[:, :2]
        r = np.hypot(*x.T)
        u, exact = (solved.u * x).sum(axis=1) / r, sphere.displacement(r)
        solutions.append(
            LevelSolution(solved, 1 / n, {"u": float(np.sqrt(((u - exact) ** 2).sum() / (exact**2).sum()))})
        )
    source = f"{HILL}; the front of the plastic zone is on a line of nodes, so that u is smooth in each cell"
    yield rate("u at the nodes", convergence(solutions, "u"), bound, source=source)
    yield at_most("iterations of a step", max(s.iterations for s in solutions[-1].solved.states), 7, source="Newton")
    name = "residual after an iteration, less round-off, over the square of that before, where this is below 0.05"
    source = "the consistent tangent: Newton's method is quadratic"
    yield at_most(name, max(map(_quadratic, solutions)), 100.0, source=source)


def _quadratic(solution: LevelSolution) -> float:
    """Largest (r_k+1 - round-off) / r_k^2 of residuals r_k that are small enough for the points that yield to be found.

    Round-off grows with the mesh, so that a residual of 1e-10, whose square is far below it, tells nothing.
    """
    ratios = [0.0]
    for state in solution.solved.states:
        pairs = [pair for pair in pairwise(state.residuals) if pair[0] < _NEAR]
        ratios += [max(after - _ROUNDING, 0.0) / before**2 for before, after in pairs]
    return max(ratios)


@problem
def solve_tube(cell: str, bound: float, *, levels: int) -> Rows:
    """A tube (plane strain, finite) of a cell whose inner radius grows by a half; `bound`: relative error. Open a tube
    by half its radius; the pressure is that of the reactions on its inner side.
    """
    young, poisson, errors = 500.0, 0.4999, []
    exact = Tube(1.0, 2.0, young / 2 / (1 + poisson), 1.0, 2.0, 1.0).pressure(0.5)
    for n in (4 * 2**k for k in range(levels)):
        out = [f"0.5 * t * {axis} / sqrt(x**2 + y**2)" for axis in "xy"]
        text = case_text(
            "plane_strain", metal(young, poisson, hardening=[[1.0, 0.0], [21.0, 10.0]], kinematic=1.0),
            fixed("x0", "x"), fixed("y0", "y"),
            entry("displacement", group="low", ux=out[0], uy=out[1]), entry("steps", count=10), kinematics="finite",
        )  # fmt: skip
        solved = solve(text, ring(cell, (n, n), (1.0, 2.0)))
        errors.append(abs(_pressure_inside(solved) / (exact * 1.5) - 1))
    source = "quadrature of the balance of forces of an incompressible tube; poisson is 0.4999 here"
    yield at_most("relative error of the pressure", errors[-1], bound, source=source)


def _pressure_inside(solved: Solved) -> float:
    """Force out of the inner side of a quarter of a tube, per angle."""
    low = nodes_of(solved.mesh, "low")
    x, force = solved.mesh.points[low, :2], solved.state.reaction.reshape(-1, 2)[low]
    return float((force * x).sum() / np.hypot(*x[0]) / (np.pi / 2))


@problem
def solve_punch(faces: int = 32, *, levels: int) -> Rows:
    """A flat rigid punch on a half-plane, `faces` to half of it, on the finest level. Press a flat punch into a
    half-plane until the pressure stays, on finer and finer meshes.
    """
    solutions = [_punched(faces // 2**k) for k in reversed(range(levels))]
    over = [s.errors["over"] for s in solutions]
    source = "Prandtl 1920: (2 + pi) k"
    name, reason = "mean pressure over (2 + pi) k, less 1", "the goal is 3 %"
    yield equal(name, over[-1], 0.0, 0.03, source=source, reason=reason)
    if levels > 1:
        yield at_most("largest growth of the error to a finer mesh", max(np.diff(over)), 0.0, source=source)
    yield from balanced([s.solved for s in solutions])


def _punched(faces: int) -> LevelSolution:
    """A punch of half-width 1 with so many faces under half of it."""
    h, reach = 1 / faces, 5.0
    aside = np.concatenate([np.linspace(0, 1, faces + 1), 1 + lines(reach - 1, h, 4 * h, 1.15)[1:]])
    text = case_text(
        "plane_strain", metal(1000.0), entry("contact", slave="top", master="master"),
        fixed("axis", "x"), fixed("side", "x"),
        fixed("bottom", "xy"),
        entry("rigid", group="master", ux=0.0, uy=-0.024), entry("steps", count=6),
    )  # fmt: skip
    solved = solve(text, _on_rigid(aside, -lines(reach - 1, h, 1.0, 1.15)[::-1], 1.0))
    zone = solved.zone
    return LevelSolution(solved, h, {"over": float(zone.pressure @ zone.area) * np.sqrt(3) / PRANDTL - 1})


def _on_rigid(aside: Floats, deep: Floats, width: float) -> Mesh:
    """A box of QUAD4 between grid lines, its top the slave, under a rigid face from the axis to a width."""
    roles = {"": "body", "x0": "axis", "x1": "side", "y0": "bottom", "y1": "top"}
    return with_master(joined([(piece("QUAD4", [aside, deep]), roles)]), "SEG2", np.array([[0.0, 0.0], [width, 0.0]]))


@problem
def solve_yield(model: str, cell: str = "QUAD4", across: int = 16, *, levels: int) -> Rows:
    """Hertz's contact of a body with a rigid plane, just below and just above its first yield. Solve with a yield
    stress 2 % above and 2 % below the one at which the contact begins to yield.
    """
    exact = hertz.Given(model, cell, "pyramid", True, (across,))
    whole, limit = hertz.case_of(exact), exact.p0 / FIRST_YIELD[model]
    far = [
        one.altered(**{name: _ramped(getattr(one, name)) for name in ("ux", "uy")})
        if (one.group or "").startswith("far")
        else one
        for one in whole.displacement
    ]
    flown = []
    for factor in (1.02, 0.98):
        steel = Material(law="plastic", young=exact.young[0], poisson=0.3, hardening=[[factor * limit, 0.0]])
        problem = replace(whole, material=(steel,), displacement=tuple(far))
        solved = solve(problem, half_spaces(cell, across, exact.fraction, rigid=True))
        flown.append(solved)
    low, high = (step_figures(one.problem, one.state).plastic for one in flown)
    assert low is not None and high is not None
    source = f"{JOHNSON}: p0 = {FIRST_YIELD[model]:.2f} Y"
    name, reason = "largest equivalent stress over p0 / c, less 1", "the goal is 2 %"
    yield equal(name, low.von_mises_max / limit - 1, 0.0, 0.02, source=source, reason=reason)
    yield at_most("plastic strain with a yield stress 2 % higher", low.strain_max, 0.0, source=source)
    yield at_least("plastic strain with a yield stress 2 % lower", high.strain_max, 1e-5, source=source)
    yield from balanced(flown)


def _ramped(value: Value) -> Value:
    """The value times t, so that loads grow from nothing."""
    return Value.of(lambda x, t: t * value(x, 1.0))


@problem
def solve_ball(faces: int = 24, young: float = 2000.0, *, levels: int) -> Rows:
    """A rigid ball of radius 10 on a metal, `faces` to a length of 1; `young` over the yield stress. Press a ball in;
    mean pressure of the last half of the steps, over the area of closed macro-elements.
    """
    h, reach = 1 / faces, 20.0
    text = case_text(
        "axisymmetric", metal(young),
        entry("contact", slave="top", master="master", clearance="x**2 / 20"),
        fixed("bottom", "y"), entry("rigid", group="master", uy=-0.05),
        entry("steps", count=6),
    )  # fmt: skip
    solved = solve(text, _on_rigid(lines(reach, h, 1.4, 1.2), -lines(reach, h, 1.5, 1.2)[::-1], 3.0))
    means, reach_of = [], []
    for state in solved.states[len(solved.states) // 2 :]:
        (zone,) = state.zones
        area = float(zone.area[zone.status == 1].sum())
        means.append(float(zone.pressure @ zone.area) / area)
        reach_of.append(np.sqrt(area / np.pi))
    mean, (low, high) = float(np.mean(means)), INDENTATION
    source = f"{JOHNSON}.3, Tabor 1951: 2.7 to 3.0"
    reason = "contact ends somewhere in its last face, which is counted whole: 4 % of a value"
    yield at_least("mean pressure over Y", mean, low, source=source, reason=reason)
    yield at_most("mean pressure over Y, at most", mean, high, source=source, reason=reason)
    yield at_least("E a / (Y R) at the end: fully plastic", young * reach_of[-1] / 10, 100.0, source=source)
    yield from balanced([solved])


@problem
def solve_cycles(cell: str = "QUAD8", *, levels: int) -> Rows:
    """A plate of kinematic hardening that is pulled and pushed by 1 % three times. Pull and push a plate; stress and
    dissipation of the last cycle against the one before.
    """
    young, limit, modulus = 1000.0, 2.0, 50.0
    table = [[0.0, 0.0]] + [[float(k + 1), 0.01 * (-1) ** k] for k in range(6)]
    text = case_text(
        "plane_stress", metal(young, 0.3, limit, kinematic=modulus), fixed("x0", "x"),
        fixed("y0", "y"), entry("displacement", group="y1", uy=table),
        entry("steps", end=6.0, count=6),
    )  # fmt: skip
    solved = solve(text, block(cell, 3, (0.0, 0.0), (1.0, 1.0)))
    figures = [step_figures(solved.problem, state) for state in solved.states]
    force = [one.reactions["y1"][1] for one in figures]
    plastic = (0.02 - 2 * limit / young) / (1 + modulus / young)
    taken = [one.plastic.dissipation[0] for one in figures if one.plastic is not None]
    source = "the loop of linear kinematic hardening: a parallelogram 2 Y high"
    for name, value in (
        ("stress at the end of two cycles, over one another, less 1", force[4] / force[2] - 1),
        ("dissipation of half a cycle over Y times its plastic range, less 1", taken[-1] / (limit * plastic) - 1),
    ):
        yield equal(name, value, 0.0, 1e-9, source=source, reason="Newton's tolerance")


def cases(family: str) -> Iterator[Case]:
    """The cases."""
    for cell, bound in (("QUAD4", 1.9), ("QUAD8", 2.9), ("TRIA6", 2.9)):
        name, words = f"yielding_sphere_{cell.lower()}", f"thick sphere that yields in part, {cell}"
        yield row(family, name, words, solve_sphere, cell, bound, quick=3 * (cell == "QUAD4"), full=4, seconds=10.0)
    for cell, levels in (("QUAD4", 3), ("TRIA6", 2)):
        name, words = f"opened_tube_{cell.lower()}", f"tube opened by half its radius, finite strains, {cell}"
        yield row(family, name, words, solve_tube, cell, 1e-3, full=levels, seconds=12.0)
    yield row(family, "flat_punch", "flat punch on perfect plasticity", solve_punch, full=3, seconds=60.0)
    for model in FIRST_YIELD:
        words = f"first yield below Hertz's contact, {model}"
        yield row(family, f"first_yield_{model}", words, solve_yield, model, full=1, seconds=10.0)
    yield row(family, "pressed_ball", "rigid ball pressed into a metal", solve_ball, full=1, seconds=60.0)
    yield row(family, "cyclic_plate", "plate under a cyclic load", solve_cycles, quick=1, seconds=3.0)
