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
stays in contact, for the order of the time schemes. Rings, a disc and a ball are thrown in finite kinematics: their
energy is looked at, and the number of Newton iterations.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from math import ceil, sqrt

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacsolver.results.figures import step_figures
from verification.exact import impact as exact
from verification.families.impact_finite import THROWN, thrown
from verification.families.impact_free import order, spin, vibration
from verification.families.impact_runs import ACCOUNT, CLOSED, Impact, bars_text, energies, on_wall, run
from verification.families.impact_sphere import sphere
from verification.meshes import published
from verification.meshes.bars import WIDTH, bar_on_wall, bars
from verification.records import Case, Family, Outcome, Published, Result, at_least, at_most, equal, informative
from verification.solving import entry

FAMILY_NAME = "impact"


def solve_case(given: Impact, *, levels: int) -> Outcome:
    """An impact, on so many meshes."""
    return Outcome(tuple(_SOLVED[given.kind](given, levels)))


def _wall(given: Impact, levels: int) -> Iterator[Result]:
    runs = [on_wall(given, given.n << level) for level in range(levels)]
    errors = [error for _, error in runs]
    yield at_most("rms error of pressures", errors[-1], given.allowed, source="p = rho c v")
    if levels > 1:
        yield at_most("error on the finest mesh over that before", errors[-1] / errors[-2], 0.75, source="convergence")
    yield from energies(runs[-1][0], 0.99)
    push = runs[-1][0].last.impulse[0, -1] / (2 * given.speed * WIDTH ** (given.dim - 1))
    yield informative("impulse over 2 m v", push, reason="1 is exact; part of the energy stays in vibrations")


def _limit(given: Impact, levels: int) -> Iterator[Result]:
    rebound, error = on_wall(given, given.n)
    yield equal("energy at the end", rebound.whole[-1], 1.0, 1e-3, source="conserved as dt -> 0", reason="index 1")
    yield at_most("rms error of pressures", error, given.allowed, source="p = rho c v")
    yield at_most("account of energy", rebound.unbalanced, CLOSED, source=ACCOUNT)


def _plain(given: Impact, levels: int) -> Iterator[Result]:
    rebound, error = on_wall(given, given.n)
    yield at_least("rms error of pressures", error, 0.2, source="a plain mass must fail")
    yield at_least("largest energy", rebound.whole.max(), 1.01, source="a plain mass must fail")
    yield at_most("account of energy", rebound.unbalanced, CLOSED, source=ACCOUNT)


def _bars(given: Impact, levels: int) -> Iterator[Result]:
    n = given.n << (levels - 1)
    dt, last = given.cfl / n / given.c, 2 / given.c
    wait = 2.5 * dt
    count = ceil((wait + 1.3 * last) / dt)
    other = "QUAD4" if given.cell.startswith("TRIA") else "TRIA3"
    other = other if CELLS[given.cell].order == 1 else {"QUAD4": "QUAD8", "TRIA3": "TRIA6"}[other]
    impact = run(
        bars_text(
            given, count * dt, count, entry("contact", slave="slave", master="master"),
            entry("initial", groups=["upper"], vy=-given.speed),
        ),
        bars((given.cell, other), (n, n - n // 8), (max(1, n // 4), max(1, n // 4 - 1)), wait * given.speed),
    )  # fmt: skip
    yield at_most(
        "rms error of pressures", impact.error(given.c * given.speed / 2, wait, last), given.allowed,
        source="rho c v / 2",
    )  # fmt: skip
    space, inertia = impact.solved.problem.space, impact.solved.problem.inertia
    assert inertia is not None
    mv = (inertia.M @ impact.last.velocity).reshape(-1, 2)[:, 1] / (WIDTH * given.speed)
    for body, right in (("upper", 0.0), ("lower", -1.0)):
        cells = space.mesh.cells_of(body)
        nodes = np.unique(np.concatenate([b.nodes[np.isin(b.cell, cells)].ravel() for b in space.blocks]))
        yield equal(
            f"velocity of the {body} bar afterwards", mv[nodes].sum(), right, 0.01, source="velocities are exchanged",
            reason="relative to v; part of the energy stays in vibrations",
        )  # fmt: skip
    yield from energies(impact, 0.98)


def _rod(given: Impact, levels: int) -> Iterator[Result]:
    n, periods = given.n << (levels - 1), 4
    count = ceil(3 * periods * n / given.cfl)
    given = replace(given, young=1.0, poisson=0.0)
    impact = run(
        bars_text(
            given, 3.0 * periods, count, entry("contact", slave="slave", master="wall"), entry("rigid", group="wall"),
            entry("displacement", group="top", uy=0.0), entry("initial", groups=["bar"], uy="0.5 - y / 2"),
        ),
        bar_on_wall(given.cell, n),
    )  # fmt: skip
    part = np.mod(impact.time, 3)
    inside = (part > 1.1) & (part < 1.9)
    off = impact.pressure[inside] / 0.5 - 1
    yield at_most("rms error of pressures, 4 periods", float(np.sqrt(np.mean(off**2))), given.allowed,
                  source="Dabaghi et al. 2016: a solution of period 3, p = 1/2")  # fmt: skip
    yield from energies(impact, 0.95)


def _bounce(given: Impact, levels: int) -> Iterator[Result]:
    """Five rebounds of a bar under gravity; in flight it has no stress, and contact lasts 2 L / c the first time."""
    n, given = given.n << (levels - 1), replace(given, young=9.0, poisson=0.0)
    height, gravity = 0.5, 1.0
    count = ceil(14.3 * n * given.c / given.cfl)
    impact = run(
        bars_text(
            given, 14.3, count, entry("contact", slave="slave", master="wall", search_distance=1.0),
            entry("rigid", group="wall"), entry("gravity", gy=-gravity),
        ),
        bar_on_wall(given.cell, n, height),
    )  # fmt: skip
    begin, last = sqrt(2 * height / gravity), 2 / given.c
    inside = (impact.time > begin + 0.1 * last) & (impact.time < begin + 0.9 * last)
    force = impact.pressure[inside].mean(axis=1)
    right = given.c * gravity * impact.time[inside]
    off = float(np.sqrt(np.mean((force / right - 1) ** 2)))
    yield at_most("rms error of the first contact's force", off, 0.01, source="characteristics: rho c g t")
    lost = impact.energies[-1, 3:].sum() / (WIDTH * gravity * height)
    yield at_least("energy after five rebounds", 1 - lost, 0.94, source="Doyen, Ern and Piperno 2011: their bar")
    yield at_most("energy after five rebounds", 1 - lost, 1.002, source="no energy is created")
    yield at_most("account of energy", impact.unbalanced, CLOSED, source=ACCOUNT)


def _aster(given: Impact, levels: int) -> Iterator[Result]:
    """sdnl111 on code_aster's mesh if it is there, else on the same bars made here."""
    there = published.there("sdnl111") and given.cell == "HEXA8"
    if there:
        mesh, names = published.code_aster("sdnl111"), ("M103", "M101", "POU1", "CL_POU2")
        supports = [entry("displacement", group=name, ux=0.0, uy=0.0) for name in ("POU1", "POU2")]
    else:
        mesh, names = _twin(), ("slave", "master", "lower", "top")
        supports = []
    slave, master, free, foot = names
    up = -1.0 if there else 1.0  # in the twin the slave is above
    tables = [
        entry("contact", slave=slave, master=master), *supports,
        entry("displacement", group=foot, uz=0.0), entry("initial", groups=[free], vz=up),
        entry("probe", name="face", group=master),
    ]  # fmt: skip
    text = bars_text(given, 1e-3, 500, *tables, density=7800.0)
    if there:
        text = "\n\n".join(t for t in text.split("\n\n") if not any(f'"{a}{e}"' in t for a in "xy" for e in "01"))
    impact = run(text, mesh)
    figures = [step_figures(impact.solved.problem, state) for state in impact.solved.states[99::100]]
    for t, step, right, theirs in zip(
        exact.SDNL111_TIMES, figures, exact.SDNL111, exact.SDNL111_CODE_ASTER, strict=True
    ):
        value = float(step.probes["face"][2]) * -up
        yield equal(
            f"displacement at {t:g} s", value, right, 5e-3 * abs(right), source="characteristics",
            reason="half a per cent, on 50 cells",
            published=(Published("code_aster, continuous contact", right * (1 + theirs / 100), "sdnl111e"),),
        )  # fmt: skip
    yield informative("code_aster's own mesh", float(there), reason="1 if it was there; else a twin made here")
    yield at_most("account of energy", impact.unbalanced, CLOSED, source=ACCOUNT)


def _twin() -> Mesh:
    """The two bars of sdnl111, of the width that they have here, which does not matter."""
    return bars(("HEXA8", "HEXA8"), (50, 50), (1, 1), 1e-5)


_SOLVED = {
    **{"wall": _wall, "limit": _limit, "plain": _plain, "bars": _bars},
    **{"rod": _rod, "bounce": _bounce, "aster": _aster, "sphere": sphere},
    **{"spin": spin, "vibration": vibration, "order": order},
    **{given.kind: thrown for *_, given in THROWN},
}


def _case(name: str, description: str, given: Impact, levels: Mapping[str, int], seconds: float) -> Case:
    return Case(FAMILY_NAME, name, description, partial(solve_case, given), levels, seconds)


def _cases() -> Iterator[Case]:
    newmark = (("scheme", "newmark"),)
    plain = Impact("plain", cfl=0.25, dynamics=(*newmark, ("massless", "none")))
    yield _case("plain-mass", "A bar on a wall, mass on its skin: it must fail", plain, {"quick": 1}, 4.0)
    small = Impact("limit", n=16, cfl=0.1, dynamics=newmark, allowed=0.1)
    yield _case("small-steps", "A bar on a wall, a tenth of a cell a step", small, {"full": 1}, 6.0)
    for cell in ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9"):
        suite = {"quick": 2} if cell in ("TRIA3", "QUAD8") else {"full": 2}
        given = Impact("wall", cell, dynamics=newmark)
        yield _case(f"wall-{cell}", f"A bar of {cell} on a rigid wall", given, suite, 6.0)
    for cell in ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9"):
        description = f"A bar of {cell} on a rigid wall, HHT as by default"
        yield _case(f"wall-hht-{cell}", description, Impact("wall", cell), {"full": 2}, 6.0)
    for cell in (
        "TETRA4",
        "TETRA10",
        "HEXA8",
        "HEXA20",
        "HEXA27",
        "PENTA6",
        "PENTA15",
        "PENTA18",
        "PYRAM5",
        "PYRAM13",
        "PYRAM14",
    ):
        given = Impact("wall", cell, n=8, dynamics=newmark, allowed=0.07)
        yield _case(f"wall-{cell}", f"A bar of {cell} on a rigid wall", given, {"full": 2}, 30.0)
    for cell in ("QUAD4", "QUAD8"):
        given = Impact("bars", cell, allowed=0.03)
        yield _case(f"bars-{cell}", f"A bar of {cell} on a bar of triangles", given, {"full": 2}, 8.0)
    rod = Impact("rod", n=64, allowed=0.15)
    yield _case("rod", "GetFEM's rod of period 3, over four periods", rod, {"full": 1}, 60.0)
    bounce = Impact("bounce", n=40)
    yield _case("bounce", "A bar that falls on a wall and bounces five times", bounce, {"full": 1}, 90.0)
    aster = Impact("aster", "HEXA8", young=2e11)
    yield _case("sdnl111", "A free bar on a clamped one: code_aster's sdnl111", aster, {"quick": 1}, 10.0)
    for approach, allowed in ((1e-3, 0.012), (1e-4, 0.004)):
        for cell, name, seconds in (("QUAD8", "sphere", 4.0), ("HEXA20", "sphere-in-space", 40.0)):
            given = Impact("sphere", cell, approach=approach, allowed=allowed)
            description = f"Hertz' impact of a sphere of {cell}, approach / radius {approach:g}"
            yield _case(f"{name}-{approach:g}", description, given, {"full": 1}, seconds)
    for name, description, given in THROWN:
        yield _case(name, description, given, {"full": 1}, 30.0)
    yield from _free()


def _free() -> Iterator[Case]:
    """Smooth motions: contact that stays closed, and none."""
    for scheme in ("newmark", "hht"):
        given = Impact("order", n=2, dynamics=(("scheme", scheme), ("start", 1.0)))
        description = f"A bar that stays in contact, {scheme}, against small steps"
        yield _case(f"order-{scheme}", description, given, {"full": 3}, 8.0)
    for cell, scheme, suite in (("QUAD4", "newmark", "quick"), ("QUAD8", "hht", "full"), ("HEXA8", "hht", "full")):
        given = Impact("spin", cell, n=4, young=1e3, dynamics=(("scheme", scheme),))
        description = f"A bar of {cell} that spins freely, {scheme}"
        yield _case(f"spin-{cell}", description, given, {suite: 3}, 8.0)
    for cell in ("TRIA3", "TRIA6", "QUAD4", "QUAD8", "HEXA8", "HEXA20"):
        first = "quick" if cell in ("QUAD4", "QUAD8") else "full"
        given = Impact("vibration", cell, n=16 if cell.startswith("TRIA") else 4)
        description = f"Natural frequencies of a bar of {cell}"
        yield _case(f"frequencies-{cell}", description, given, {first: 3}, 3.0)


FAMILY = Family(name=FAMILY_NAME, title="Impacts", text=__doc__, cases=tuple(_cases()))
