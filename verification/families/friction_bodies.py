"""**Sticks or slides.** A pad under its weight on an incline, whose slope is just below and just above mu; a shaft in a
hub, pulled or turned by a load just below and just above what friction carries (Lame's pressure).

**Belt.** A belt of thickness h around a rigid cylinder: T2 / T1 tends to e^(mu theta) as h falls. A belt that
is laid on a drum of cells, tightened at one end and pulled at the other: it slides back, sticks, and slides on.

**Crack.** A closed crack under inclined compression that slides: p and t are uniform, slip is an ellipse (Phan and
others). **Punch.** A flat rigid punch pressed into a half-plane: how far it sticks, against Spence's integral
equations.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from verification.exact import spence
from verification.exact.crack import Crack
from verification.exact.fits import SlidingFit, capstan
from verification.exact.half_plane import HalfPlane
from verification.exact.lame import Fit, Shell
from verification.measures.edge import edge_of_contact
from verification.measures.norms import pressure_errors
from verification.meshes import friction as meshes
from verification.meshes.blocks import nodes_of
from verification.records import Case, Result, at_most, equal, problem, rate, row
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
#: T = mu N, to rounding
ROUNDING = 1e-10


@problem
def solve_incline(cell: str, part: float) -> Iterator[Result]:
    """A pad on a plane whose slope is `part` of mu, held by a soft spring; the spring takes what friction does not."""
    friction, weight, spring = 0.3, 2.0, 1e-4
    slope = np.arctan(part * friction)
    text = case_text(
        "plane_strain", material(1e4, 0.3), contact(friction=friction), entry("rigid", group="master"),
        entry("spring", group="right", kx=spring),
        entry("body_force", fx=float(weight / 0.2 * np.sin(slope)), fy=float(-weight / 0.2 * np.cos(slope))),
    )  # fmt: skip
    one = solve(text, meshes.pad(cell, 16))
    zone, pull = one.zone, weight * np.sin(slope)
    N, T = float(zone.pressure @ zone.area), float(one.shear[:, 0] @ zone.area)
    sliding, closed = int((zone.status == 2).sum()), int((zone.pressure > 0).sum())
    if part < 1:
        source, reason = "balance; tan theta = 0.99 mu", "the soft spring takes some of it"
        yield equal("force of friction over the pull", T / pull, 1.0, 1e-3, source=source, reason=reason)
        name = "macro-elements that slide, part of those in contact"
        yield at_most(name, sliding / closed, 0.99, source="it sticks")
        name, moved = "displacement, of what it takes the spring to hold it", np.abs(one.u).max()
        yield at_most(name, moved * spring / pull, 1e-3, source="it sticks")
    else:
        name, ratio = "force of friction over mu N", T / (friction * N)
        yield equal(name, ratio, 1.0, ROUNDING, source="Coulomb's law", reason="rounding")
        yield at_most("macro-elements that stick", closed - sliding, 0, source="it slides: tan theta = 1.01 mu")
    yield from balanced([one])


# ---- a shaft in a hub

FIT = SlidingFit(
    Fit(Shell("plane_strain", 0.5, 1.0, 3.0, 0.2), Shell("plane_strain", 1.0, 2.0, 1.0, 0.3), interference=0.01), 0.3
)


@problem
def solve_fit(way: Literal["pulled", "turned"], part: float, exact: SlidingFit) -> Iterator[Result]:
    """A shaft in a hub of QUAD8, pressed, then pulled along the axis or turned, to `part` of what friction carries.

    The far sides have their exact displacements, above the bound with a slip.
    """
    sliding, pulled, c = part > 1, way == "pulled", exact.fit.within.outer
    slip = 0.5 * exact.fit.interference if sliding else 0.0
    stress = min(part, 1.0) * exact.bound

    def motion(body: Literal["within", "around"]) -> Motion:
        def u(x: Floats, t: float) -> Floats:
            x = x[:, :2]
            r = x[:, 0] if pulled else np.linalg.norm(x, axis=1)
            place = np.minimum(r, c * (1 - 1e-12)) if body == "within" else np.maximum(r, c)
            radial = exact.fit.displacement(place[:, None], body)[:, 0] * min(t, 1.0)
            aside = getattr(exact, way)(place, stress, slip) * max(t - 1.0, 0.0)
            if pulled:
                return np.stack([radial, aside], axis=1)
            along, across = x / r[:, None], np.stack([-x[:, 1], x[:, 0]], axis=1) / r[:, None]
            return np.asarray(radial[:, None] * along + aside[:, None] * across)

        return u

    shells = (("within", exact.fit.within), ("around", exact.fit.around))
    text = case_text(
        "axisymmetric" if pulled else "plane_strain",
        *(material(shell.young, shell.poisson, groups=[name]) for name, shell in shells),
        contact(friction=exact.friction, clearance=-exact.fit.interference), entry("steps", times=[1.0, 2.0]),
    )  # fmt: skip
    mesh = (meshes.pulled_fit if pulled else meshes.turned_fit)("QUAD8", 16)
    one = solve(with_motions(text, {"far_within": motion("within"), "far_around": motion("around")}), mesh)
    zone = one.zone
    if pulled:
        name = "force over the pull-out force of Lame's pressure"
        ratio = float(one.shear[:, 1] @ zone.area) / exact.pull_out
    else:
        name, around = "moment over the torque", np.stack([-zone.centre[:, 1], zone.centre[:, 0]], axis=1)
        ratio = float(4 * zone.area @ (one.shear * around).sum(axis=1)) / exact.torque
    reason = "that of p_m in a press fit"
    yield equal(name, ratio, min(part, 1.0), 2e-3, source="mu p 2 pi r L; Lame", reason=reason)
    slides = zone.status == 2
    if sliding:
        yield at_most("macro-elements that stick", int((~slides).sum()), 0, source="just above the bound")
        off = float(np.abs(np.abs(one.friction.shear[:, 0]) - exact.friction * zone.pressure).max() / exact.bound)
        name = "largest deviation of t_m from mu p_m, of mu p"
        yield at_most(name, off, ROUNDING, source="Coulomb's law", reason="rounding")
    else:
        yield at_most("macro-elements that slide", int(slides.sum()), 0, source="just below the bound")
    yield from balanced([one])


# ---- belts


@problem
def solve_belt(degrees: float) -> Iterator[Result]:
    """Belts of QUAD8 around a cylinder by an angle, of two thicknesses; their exponents are extrapolated to none."""
    angle, friction, (thick, thin) = np.radians(degrees), 0.3, (0.04, 0.02)
    solutions = [_belt(angle, friction, h) for h in (thick, thin)]
    first, last = (np.log(ratio) / (friction * angle) for _, ratio in solutions)
    extrapolated = last + (last - first) * thin / (thick - thin)
    yield equal("T2 / T1, extrapolated to no thickness, over e^(mu theta)",
                float(np.exp(friction * angle * extrapolated)) / capstan(friction, angle), 1.0, 0.005, source="Euler",
                reason="what extrapolation from two thicknesses leaves")  # fmt: skip
    most, source = max(one.iterations for one, _ in solutions), "design: the first solve tells that all slides"
    yield at_most("iterations", most, 6, source=source)
    yield from balanced([one for one, _ in solutions])


def _belt(angle: float, friction: float, h: float) -> tuple[Solved, float]:
    """Solution, and T2 / T1: T1 is a dead load, the other end is turned until all slides."""
    young, tension = 1e4, 1.0
    most = tension * capstan(friction, angle) / (young * h) * angle
    along = np.array([-np.sin(angle), np.cos(angle)])
    text = case_text(
        "plane_stress", material(young, 0.0), contact(friction=friction), entry("rigid", group="master"),
        entry("traction", group="first", ty=-tension / h),
    )  # fmt: skip
    turned = {"last": lambda x, t: t * np.linalg.norm(x[:, :2], axis=1)[:, None] * along * 2 * most}
    one = solve(with_motions(text, turned), meshes.belt("QUAD8", h, angle, round(2 * angle / h / 3)))
    return one, float(one.state.reaction.reshape(-1, 2)[nodes_of(one.mesh, "last")].sum(axis=0) @ along / tension)


@problem
def solve_laid_belt(kinematics: str, n: int) -> Iterator[Result]:
    """A belt on a quarter of a drum, n cells along it: tightened by a dead load in ten steps, pulled in ten more."""
    law = {"law": "saint_venant_kirchhoff"} if kinematics == "finite" else {}
    text = case_text(
        "plane_strain", material(1e4, 0.0, groups=["belt"], **law), material(1e6, 0.0, groups=["drum"], **law),
        contact(friction=0.3, geometry="current"), entry("rigid", group="drum"),
        entry("displacement", group="last", ux=[[0.0, 0.0], [1.0, -0.002], [2.0, -0.05]]),
        entry("traction", group="first", ty=[[0.0, 0.0], [1.0, -10.0], [2.0, -10.0]]),
        entry("steps", end=2.0, count=20, max_halvings=0), kinematics=kinematics,
    )  # fmt: skip
    one = solve(text, meshes.laid_belt(n))
    pull = -one.state.reaction.reshape(-1, 2)[nodes_of(one.mesh, "last"), 0].sum()
    exact = capstan(0.3, np.pi / 2)
    yield equal("T2 / T1", pull, exact, 0.01 * exact, source="Euler", reason="a belt 0.01 R thick, on chords")
    yield from balanced([one])


# ---- a crack


@problem
def solve_crack(cell: str, exact: Crack, *, levels: int) -> Iterator[Result]:
    """A closed crack in a plane of cells of a type, 4, 8, 16, 32 to its half."""
    solutions = [crack_solution(cell, exact, 4 << level) for level in range(levels)]
    reason = "of open macro-elements at the tips too, of which linear triangles have one to three"
    yield rate("slip, L2", convergence(solutions, "slip"), 0.85, source="square-root tips", reason=reason)
    for name in ("p", "t") if cell == "QUAD8" else ():  # at the tips linear cells are off by 36 %
        off = max(one.errors[name] for one in solutions)
        yield at_most(f"largest relative error of {name}_m", off, 1e-10, source="uniform")
    yield from balanced([one.solved for one in solutions])


def crack_solution(cell: str, exact: Crack, n: int) -> LevelSolution:
    """Solve with n cells to the half of the crack; relative errors of slip, p_m and t_m."""
    text = case_text(
        "plane_strain", material(exact.young, exact.poisson), contact(friction=exact.friction),
    )  # fmt: skip
    one = solve(with_motions(text, {"far": lambda x, t: exact.displacement(x[:, :2])}), meshes.cracked(cell, n))
    slip = pressure_errors(one.mesh, one.passed[:, 0], lambda x: exact.slip(x[:, 0])[:, None])
    errors = {
        "slip": slip.exact,
        "p": float(np.abs(one.fields.zones["slave"].pressure / exact.pressure - 1).max()),
        "t": float(np.abs(one.shear[:, 0] / exact.shear - 1).max()),
    }
    return LevelSolution(one, 1 / n, errors)


# ---- a punch


@problem
def solve_punch(nu: float, friction: float) -> Iterator[Result]:
    """A flat punch on a half-plane of QUAD8, 64 cells to the half-width, pressed by a force.

    Far off, the displacements are those of the half-plane under the tractions of the integral equations.
    """
    n, count, edge = 64, 400, spence.stick_edge(nu, friction)
    sticking = round(count * np.arcsin(edge) / (np.pi / 2))
    x, p, q = spence.tractions((1 - 2 * nu) / (2 * (1 - nu)), friction, sticking, True, count)
    width = np.diff(np.sin(np.linspace(0, np.pi / 2, count + 1)))
    place = np.concatenate([-x[::-1], x])
    aside, down = np.concatenate([-(q * width)[::-1], q * width]), np.concatenate([(p * width)[::-1], p * width])
    force = np.stack([aside, -down], axis=1)
    below = HalfPlane(-1, 1.0, nu)
    still = below.under_forces(np.array([[0.0, -meshes.REACH]]), place, force)
    text = case_text(
        "plane_strain", material(1.0, nu), contact(friction=friction), fixed("axis", "x"),
        entry("rigid", group="master", fy=-0.5),
    )  # fmt: skip
    far = {"far": lambda x, t: below.under_forces(x[:, :2], place, force) - still}
    one = solve(with_motions(text, far), meshes.punched_half("QUAD8", n))
    zone = one.zone
    on = zone.status == 1
    left = 1 - np.abs(one.shear[on, 0]) / (friction * zone.pressure[on])
    stick_edge = edge_of_contact(zone.centre[on, 0], left, float(left.min()), 0.75 * edge)
    yield equal("edge of stick over the half-width", stick_edge, edge, 0.03 * edge,
                source="Spence's integral equations", reason="3 %: elements of 1/64 of the half-width")  # fmt: skip
    yield from balanced([one])


def cases(family: str) -> Iterator[Case]:
    """Incline, fits, belts, crack, punches."""
    for part, word in ((0.99, "below"), (1.01, "above")):
        for cell in ("TRIA3", "QUAD8"):
            what = f"a pad on a slope of {part} mu, {cell}"
            yield row(family, f"incline-{word}-{cell}", what, solve_incline, cell, part, quick=1, seconds=2.0)
        what = f"a shaft in a hub, {part} of what friction carries"
        for name, way, how in (("pull-out", "pulled", "along the axis"), ("torque", "turned", "by a moment")):
            yield row(family, f"{name}-{word}", f"{what}, {how}", solve_fit, way, part, FIT, quick=1, seconds=3.0)
    for angle in (90.0, 180.0, 270.0):
        what = f"a belt around {angle:g} degrees"
        yield row(family, f"belt-{angle:g}", what, solve_belt, angle, quick=int(angle == 90), full=1, seconds=20.0)
    for kinematics, n in (("small", 24), ("finite", 48)):
        what = "a belt that is laid on a drum and pulled"
        yield row(family, f"belt-laid-{kinematics}", what, solve_laid_belt, kinematics, n, full=1, seconds=20.0)
    for cell in ("TRIA3", "QUAD4", "TRIA6", "QUAD8"):
        what = f"a closed crack that slides, {cell}"
        yield row(family, f"crack-{cell}", what, solve_crack, cell, Crack(), quick=3, full=4, seconds=10.0)
    for nu, friction in ((0.3, 0.2), (0.3, 0.4), (0.0, 0.4), (0.45, 0.1)):
        name, what = f"punch-{nu:g}-{friction:g}", f"Spence's punch, nu {nu:g}, mu {friction:g}"
        yield row(family, name, what, solve_punch, nu, friction, full=1, seconds=30.0)
