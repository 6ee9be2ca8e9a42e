"""Impacts: bars on a rigid wall and on one another, a rod that bounces for ever, spheres, against exact solutions.

Mass is taken off the skins (`massless = "skins"`), so that pressures follow from displacements, without impulses: they
neither alternate nor grow as steps get smaller, and no energy is created. The first case with a plain mass shows what
is meant: there pressures are wrong by their own size and energy grows; it passes because it fails.

Bars cannot move sideways, so that waves are those of one dimension, and run from impact to release in 2 L / c. Errors
of pressures are root mean squares over all macro-elements and over the time from 10 % to 90 % of the contact, relative
to the exact pressure; at its front any method of the second order overshoots. Energies are relative to those at the
start. In every step of every case the account of energy closes to 1e-10, or to round-off where a case says so.

Spheres are axisymmetric, or a quarter in space between its planes of symmetry. Hertz' solution is that of half-spaces
and of bodies that are at rest within, so that errors go as the radius of contact over that of the sphere. Beside the
impacts there are free motions: a bar that spins and flies under finite kinematics, which keeps its linear momentum to
round-off, its angular momentum and energy to the second order of the step; natural frequencies of a bar; and a bar that
stays in contact, for the order of the time schemes. Rings, a disc and a ball are thrown in finite kinematics: no exact
solution is known, and energy is compared with that at the start, and the number of Newton iterations is counted.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, sqrt

import numpy as np

from lacsolver.results.figures import step_figures
from verification.exact import impact as exact
from verification.families.impact_bodies import solve_order, solve_sphere, solve_spin, solve_thrown, solve_vibration
from verification.families.impact_runs import Bar, account, energies, on_wall, run
from verification.meshes import published
from verification.meshes.bars import WIDTH, bar_on_wall, bars
from verification.records import Case, Family, Published, Result, at_least, at_most, equal, problem, row
from verification.solving import contact, entry, fixed

_RMS = "rms error of pressures"


@problem
def solve_wall(given: Bar, allowed: float = 0.02, *, levels: int) -> Iterator[Result]:
    """A bar thrown on a rigid wall; `allowed`: of the error of pressures on the finest mesh."""
    runs = [on_wall(given, given.n << level) for level in range(levels)]
    errors = [error for _, error in runs]
    yield at_most(_RMS, errors[-1], allowed, source="p = rho c v")
    if levels > 1:
        yield at_most("error on the finest mesh over that before", errors[-1] / errors[-2], 0.75, source="convergence")
    yield from energies(runs[-1][0], 0.99)


@problem
def solve_small_steps(given: Bar) -> Iterator[Result]:
    """The same in small steps: the energy that is left in the end is all."""
    rebound, error = on_wall(given, given.n)
    yield equal("energy at the end", rebound.whole[-1], 1.0, 1e-3, source="conserved as dt -> 0", reason="index 1")
    yield at_most(_RMS, error, 0.1, source="p = rho c v")
    yield account(rebound)


@problem
def solve_plain_mass(given: Bar) -> Iterator[Result]:
    """The same with mass on the skin: it must fail."""
    rebound, error = on_wall(given, given.n)
    yield at_least(_RMS, error, 0.2, source="a plain mass must fail")
    yield at_least("largest energy", rebound.whole.max(), 1.01, source="a plain mass must fail")
    yield account(rebound)


@problem
def solve_bars(given: Bar, *, levels: int) -> Iterator[Result]:
    """A bar that hits another of triangles, or of quadrangles, at rest: they exchange their velocities."""
    n = given.n << (levels - 1)
    dt, wait, last, count = given.timing(n)
    linear = {"QUAD4": "TRIA3", "TRIA3": "QUAD4", "QUAD8": "TRIA6", "TRIA6": "QUAD8"}
    start = entry("initial", groups=["upper"], vy=-given.speed)
    text = given.text(count * dt, count, contact(), start)
    across = max(1, n // 4), max(1, n // 4 - 1)
    impact = run(text, bars((given.cell, linear[given.cell]), (n, n - n // 8), across, wait * given.speed))
    yield at_most(_RMS, impact.error(given.c * given.speed / 2, wait, last), 0.03, source="rho c v / 2")
    space, inertia = impact.solved.problem.space, impact.solved.problem.inertia
    assert inertia is not None
    mv = (inertia.M @ impact.motions[-1].velocity).reshape(-1, 2)[:, 1] / (WIDTH * given.speed)
    for body, right in (("upper", 0.0), ("lower", -1.0)):
        cells = space.mesh.cells_of(body)
        nodes = np.unique(np.concatenate([b.nodes[np.isin(b.cell, cells)].ravel() for b in space.blocks]))
        yield equal(f"velocity of the {body} bar afterwards", mv[nodes].sum(), right, 0.01,
                    source="velocities are exchanged",
                    reason="relative to v; part of the energy stays in vibrations")  # fmt: skip
    yield from energies(impact, 0.98)


@problem
def solve_rod(given: Bar, *, levels: int) -> Iterator[Result]:
    """GetFEM's rod, held at its top and pulled down on a wall: a motion of period 3, over four periods."""
    n, periods = given.n << (levels - 1), 4
    text = given.text(
        3.0 * periods, ceil(3 * periods * n / given.cfl), contact(master="wall"),
        entry("rigid", group="wall"), fixed("top", "y"),
        entry("initial", groups=["bar"], uy="0.5 - y / 2"),
    )  # fmt: skip
    impact = run(text, bar_on_wall(given.cell, n))
    part = np.mod(impact.time, 3)
    off = impact.pressure[(part > 1.1) & (part < 1.9)] / 0.5 - 1
    source = "Dabaghi et al. 2016: a solution of period 3, p = 1/2"
    yield at_most(f"{_RMS}, 4 periods", float(np.sqrt(np.mean(off**2))), 0.15, source=source)
    yield from energies(impact, 0.95)


@problem
def solve_bounce(given: Bar, *, levels: int) -> Iterator[Result]:
    """Five rebounds of a bar under gravity; in flight it has no stress, and contact lasts 2 L / c the first time."""
    n, height, gravity, end = given.n << (levels - 1), 0.5, 1.0, 14.3
    text = given.text(
        end, ceil(end * n * given.c / given.cfl), entry("rigid", group="wall"), entry("gravity", gy=-gravity),
        contact(master="wall", search_distance=1.0),
    )  # fmt: skip
    impact = run(text, bar_on_wall(given.cell, n, height))
    begin, last = sqrt(2 * height / gravity), 2 / given.c
    inside = (impact.time > begin + 0.1 * last) & (impact.time < begin + 0.9 * last)
    force, right = impact.pressure[inside].mean(axis=1), given.c * gravity * impact.time[inside]
    off = float(np.sqrt(np.mean((force / right - 1) ** 2)))
    yield at_most("rms error of the first contact's force", off, 0.01, source="characteristics: rho c g t")
    left, name = 1 - impact.energies[-1, 3:].sum() / (WIDTH * gravity * height), "energy after five rebounds"
    yield at_least(name, left, 0.94, source="Doyen, Ern and Piperno 2011: their bar")
    yield at_most(name, left, 1.002, source="no energy is created")
    yield account(impact)


@problem
def solve_sdnl111(given: Bar) -> Iterator[Result]:
    """A free bar on a clamped one, code_aster's sdnl111, on its mesh if it is there, else on the same bars made here.

    The width of our own bars is another, which does not matter; their slave is above.
    """
    there = published.there("sdnl111")
    if there:
        mesh, up, supports = published.code_aster("sdnl111"), -1.0, [fixed("POU1", "xy"), fixed("POU2", "xy")]
        slave, master, free, foot = "M103", "M101", "POU1", "CL_POU2"
    else:
        mesh, up, supports = bars((given.cell, given.cell), (50, 50), (1, 1), 1e-5), 1.0, []
        slave, master, free, foot = "slave", "master", "lower", "top"
    text = given.text(
        1e-3, 500, contact(slave, master), *supports, fixed(foot, "z"),
        entry("initial", groups=[free], vz=up), entry("probe", name="face", group=master), density=7800.0, free=there,
    )  # fmt: skip
    impact = run(text, mesh)
    figures = [step_figures(impact.solved.problem, state) for state in impact.solved.states[99::100]]
    rows = zip(exact.SDNL111_TIMES, figures, exact.SDNL111, exact.SDNL111_CODE_ASTER, strict=True)
    for t, step, right, theirs in rows:
        beside = (Published("code_aster, continuous contact", right * (1 + theirs / 100), "sdnl111e"),)
        value = float(step.probes["face"][2]) * -up
        yield equal(f"displacement at {t:g} s", value, right, 5e-3 * abs(right), source="characteristics",
                    reason="half a per cent, on 50 cells", published=beside)  # fmt: skip
    yield account(impact)


_PLANE = ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9")
_SOLID = (
    "TETRA4", "TETRA10", "HEXA8", "HEXA20", "HEXA27", "PENTA6", "PENTA15", "PENTA18", "PYRAM5", "PYRAM13", "PYRAM14",
)  # fmt: skip


def _cases() -> Iterator[Case]:
    plain = Bar(cfl=0.25, scheme="newmark", massless="none")
    what = "A bar on a wall, mass on its skin: it must fail"
    yield row("impact", "plain-mass", what, solve_plain_mass, plain, quick=1, seconds=4.0)
    small, what = Bar(cfl=0.1, scheme="newmark"), "A bar on a wall, a tenth of a cell a step"
    yield row("impact", "small-steps", what, solve_small_steps, small, full=1, seconds=6.0)
    for cell in _PLANE:
        quick, what = 2 * (cell in ("TRIA3", "QUAD8")), f"A bar of {cell} on a rigid wall"
        given = Bar(cell, scheme="newmark")
        yield row("impact", f"wall-{cell}", what, solve_wall, given, quick=quick, full=2, seconds=6.0)
        yield row(
            "impact", f"wall-hht-{cell}", f"{what}, HHT as by default", solve_wall, Bar(cell), full=2, seconds=6.0
        )
    for cell in _SOLID:
        given, what = Bar(cell, n=8, scheme="newmark"), f"A bar of {cell} on a rigid wall"
        yield row("impact", f"wall-{cell}", what, solve_wall, given, 0.07, full=2, seconds=30.0)
    for cell in ("QUAD4", "QUAD8"):
        what = f"A bar of {cell} on a bar of triangles"
        yield row("impact", f"bars-{cell}", what, solve_bars, Bar(cell), full=2, seconds=8.0)
    rod, what = Bar(n=64, poisson=0.0), "GetFEM's rod of period 3, over four periods"
    yield row("impact", "rod", what, solve_rod, rod, full=1, seconds=60.0)
    falls, what = Bar(n=40, young=9.0, poisson=0.0), "A bar that falls on a wall and bounces five times"
    yield row("impact", "bounce", what, solve_bounce, falls, full=1, seconds=90.0)
    free, what = Bar("HEXA8", young=2e11), "A free bar on a clamped one: code_aster's sdnl111"
    yield row("impact", "sdnl111", what, solve_sdnl111, free, quick=1, seconds=10.0)
    for approach, allowed in ((1e-3, 0.012), (1e-4, 0.004)):
        for cell, name, seconds in (("QUAD8", "sphere", 4.0), ("HEXA20", "sphere-in-space", 40.0)):
            what = f"Hertz' impact of a sphere of {cell}, approach / radius {approach:g}"
            name = f"{name}-{approach:g}"
            yield row("impact", name, what, solve_sphere, cell, approach, allowed, full=1, seconds=seconds)
    for kind, what in (
        ("ring", "A neo-Hookean ring thrown on a wall"),
        ("disc", "A neo-Hookean disc thrown on a wall"),
        ("ball", "A neo-Hookean ball thrown on a wall, axisymmetric"),
        ("rings", "Two neo-Hookean rings that hit each other"),
    ):
        what = f"{what}, large deformations"
        yield row("impact", f"thrown-{kind}", what, solve_thrown, kind, full=1, seconds=30.0)
    for scheme in ("newmark", "hht"):
        given, what = Bar(n=2, scheme=scheme, start=1.0), f"A bar that stays in contact, {scheme}, against small steps"
        yield row("impact", f"order-{scheme}", what, solve_order, given, full=3, seconds=8.0)
    for cell, scheme, quick in (("QUAD4", "newmark", 3), ("QUAD8", "hht", 0), ("HEXA8", "hht", 0)):
        what = f"A bar of {cell} that spins freely, {scheme}"
        yield row("impact", f"spin-{cell}", what, solve_spin, cell, scheme, quick=quick, full=3, seconds=8.0)
    for cell in ("TRIA3", "TRIA6", "QUAD4", "QUAD8", "HEXA8", "HEXA20"):
        given = Bar(cell, n=16 if cell.startswith("TRIA") else 4)
        quick, what = 3 * (cell in ("QUAD4", "QUAD8")), f"Natural frequencies of a bar of {cell}"
        yield row("impact", f"frequencies-{cell}", what, solve_vibration, given, quick=quick, full=3, seconds=3.0)


FAMILY = Family("impact", "Impacts", __doc__, tuple(_cases()))
