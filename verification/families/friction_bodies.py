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
from functools import partial
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
from verification.records import Case, Outcome, Result, at_most, equal, informative, rate
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
#: T = mu N, to rounding
ROUNDING = 1e-10


# ---- a pad on an incline


def solve_incline(cell: str, part: float, friction: float = 0.3, weight: float = 2.0, *, levels: int) -> Outcome:
    """A pad on a plane whose slope is `part` of mu, held by a soft spring; the spring takes what friction does not."""
    slope = np.arctan(part * friction)
    force = weight / 0.2
    text = case_text(
        "plane_strain",
        entry("material", young=1e4, poisson=0.3),
        entry("contact", slave="slave", master="master", friction=friction),
        entry("rigid", group="master"),
        entry("spring", group="right", kx=1e-4),
        entry("body_force", fx=float(force * np.sin(slope)), fy=float(-force * np.cos(slope))),
    )
    one = solve(text, meshes.pad(cell, 16))
    zone = one.zone
    N, T = float(zone.pressure @ zone.area), float(one.shear[:, 0] @ zone.area)
    pull = weight * np.sin(slope)
    sliding, closed = int((zone.status == 2).sum()), int((zone.pressure > 0).sum())
    if part < 1:
        results = [
            equal(
                "force of friction over the pull",
                T / pull,
                1.0,
                1e-3,
                source="balance; tan theta = 0.99 mu",
                reason="the soft spring takes some of it",
            ),
            at_most("macro-elements that slide, part of those in contact", sliding / closed, 0.99, source="it sticks"),
            at_most(
                "displacement, of what it takes the spring to hold it",
                np.abs(one.u).max() * 1e-4 / pull,
                1e-3,
                source="it sticks",
            ),
        ]
    else:
        results = [
            equal(
                "force of friction over mu N",
                T / (friction * N),
                1.0,
                ROUNDING,
                source="Coulomb's law",
                reason="rounding",
            ),
            at_most("macro-elements that stick", closed - sliding, 0, source="it slides: tan theta = 1.01 mu"),
        ]
    return Outcome((*results, *balanced([one])))  # fmt: skip


# ---- a shaft in a hub


def solve_fit(cell: str, way: Literal["pulled", "turned"], part: float, fit: SlidingFit, *, levels: int) -> Outcome:
    """A shaft in a hub, pulled along the axis or turned, to `part` of what friction carries. Press, then pull or turn
    by the exact displacement of the far sides, above the bound with a slip.
    """
    exact, sliding = fit, part > 1
    slip = 0.5 * exact.fit.interference if sliding else 0.0
    stress = min(part, 1.0) * exact.bound
    c = exact.fit.within.outer

    def motion(body: Literal["within", "around"]) -> Motion:
        def u(x: Floats, t: float) -> Floats:
            x = x[:, :2]
            r = x[:, 0] if way == "pulled" else np.linalg.norm(x, axis=1)
            place = np.minimum(r, c * (1 - 1e-12)) if body == "within" else np.maximum(r, c)
            radial = exact.fit.displacement(place[:, None], body)[:, 0] * min(t, 1.0)
            aside = getattr(exact, way)(place, stress, slip) * max(t - 1.0, 0.0)
            if way == "pulled":
                return np.stack([radial, aside], axis=1)
            return (
                np.stack([radial * x[:, 0] - aside * x[:, 1], radial * x[:, 1] + aside * x[:, 0]], axis=1) / r[:, None]
            )

        return u

    text = case_text(
        "axisymmetric" if way == "pulled" else "plane_strain",
        *(entry("material", groups=[name], young=shell.young, poisson=shell.poisson)
          for name, shell in (("within", exact.fit.within), ("around", exact.fit.around))),
        entry("contact", slave="slave", master="master", friction=exact.friction, clearance=-exact.fit.interference),
        entry("steps", times=[1.0, 2.0]),
    )  # fmt: skip
    mesh = (meshes.pulled_fit if way == "pulled" else meshes.turned_fit)(cell, 16)
    one = solve(with_motions(text, {f"far_{b}": motion(b) for b in ("within", "around")}), mesh)
    zone = one.zone
    if way == "pulled":
        total, whole = float(one.shear[:, 1] @ zone.area), exact.pull_out
    else:
        around = np.stack([-zone.centre[:, 1], zone.centre[:, 0]], axis=1)
        total, whole = float(4 * zone.area @ (one.shear * around).sum(axis=1)), exact.torque
    asked = equal(
        "force over the pull-out force of Lame's pressure" if way == "pulled" else "moment over the torque",
        total / whole, min(part, 1.0), 2e-3, source="mu p 2 pi r L; Lame", reason="that of p_m in a press fit",
    )  # fmt: skip
    slides = zone.status == 2
    state = at_most(
        f"macro-elements that {'stick' if sliding else 'slide'}", int((~slides if sliding else slides).sum()), 0,
        source="just above the bound" if sliding else "just below the bound",
    )  # fmt: skip
    law = at_most(
        "largest deviation of t_m from mu p_m, of mu p", float(np.abs(np.abs(one.friction.shear[:, 0])
        - exact.friction * zone.pressure).max() / exact.bound), ROUNDING, source="Coulomb's law", reason="rounding",
    )  # fmt: skip
    return Outcome((asked, state, *([law] if sliding else []), *balanced([one])))


# ---- a belt


def solve_belt(
    degrees: float, friction: float = 0.3, thickness: tuple[float, ...] = (0.04, 0.02), *, levels: int
) -> Outcome:
    """A belt of QUAD8 around a cylinder. `degrees`: of its angle; `thickness`: over the radius, of each level. Belts of
    several thicknesses; their exponents are extrapolated to none.
    """
    angle = np.radians(degrees)
    solutions = [_belt(angle, friction, h) for h in thickness]
    exponents = [np.log(ratio) / (friction * angle) for _, ratio in solutions]
    (h, thin), (thick, last) = thickness, exponents
    extrapolated = last + (last - thick) * thin / (h - thin)
    ratio = float(np.exp(friction * angle * extrapolated)) / capstan(friction, angle)
    return Outcome(
        (
            equal("T2 / T1, extrapolated to no thickness, over e^(mu theta)", ratio, 1.0, 0.005, source="Euler",
                  reason="what extrapolation from two thicknesses leaves"),
            *(informative(f"exponent over mu theta, h / R = {t}", e,
                          reason=f"about 1 - h / 2R (1 + mu^2) = {1 - t / 2 * (1 + friction**2):.4f}")
              for t, e in zip(thickness, exponents, strict=True)),
            at_most("iterations", max(one.iterations for one, _ in solutions), 6,
                    source="design: the first solve tells that all slides"),
            *balanced([solved for solved, _ in solutions]),
        )
    )  # fmt: skip


def _belt(angle: float, friction: float, h: float) -> tuple[Solved, float]:
    """Solution, and T2 / T1: T1 is a dead load, the other end is turned until all slides."""
    young, tension = 1e4, 1.0
    most = tension * capstan(friction, angle) / (young * h) * angle
    text = case_text(
        "plane_stress",
        entry("material", young=young, poisson=0.0),
        entry("contact", slave="slave", master="master", friction=friction),
        entry("rigid", group="master"),
        entry("traction", group="first", ty=-tension / h),
    )
    end = np.array([-np.sin(angle), np.cos(angle)]) * 2 * most

    def motion(x: Floats, t: float) -> Floats:
        return t * np.linalg.norm(x[:, :2], axis=1)[:, None] * end

    one = solve(with_motions(text, {"last": motion}), meshes.belt("QUAD8", h, angle, round(2 * angle / h / 3)))
    last = nodes_of(one.mesh, "last")
    pull = one.state.reaction.reshape(-1, 2)[last].sum(axis=0) @ np.array([-np.sin(angle), np.cos(angle)])
    return one, float(pull / tension)


def solve_laid_belt(kinematics: str, n: int, *, levels: int) -> Outcome:
    """A belt on a quarter of a drum, n cells along it: tightened by a dead load in ten steps, pulled in ten more."""
    law = {"law": "saint_venant_kirchhoff"} if kinematics == "finite" else {}
    text = case_text(
        "plane_strain",
        entry("material", groups=["belt"], young=1e4, poisson=0.0, **law),
        entry("material", groups=["drum"], young=1e6, poisson=0.0, **law),
        entry("contact", slave="slave", master="master", friction=0.3, geometry="current"),
        entry("rigid", group="drum"),
        entry("displacement", group="last", ux=[[0.0, 0.0], [1.0, -0.002], [2.0, -0.05]]),
        entry("traction", group="first", ty=[[0.0, 0.0], [1.0, -10.0], [2.0, -10.0]]),
        entry("steps", end=2.0, count=20, max_halvings=0),
        kinematics=kinematics,
    )
    one = solve(text, meshes.laid_belt(n))
    pull = -one.state.reaction.reshape(-1, 2)[nodes_of(one.mesh, "last"), 0].sum()
    exact = capstan(0.3, np.pi / 2)
    return Outcome(
        (
            equal("T2 / T1", float(pull), exact, 0.01 * exact, source="Euler", reason="a belt 0.01 R thick, on chords"),
            *balanced([one]),
        )
    )


# ---- a crack


def solve_crack(cell: str, exact: Crack, sizes: tuple[int, ...] = (4, 8, 16, 32), *, levels: int) -> Outcome:
    """A closed crack in a plane of cells of a type, as many to its half as `sizes` say."""
    solutions = [_crack(cell, exact, n) for n in sizes[:levels]]
    finest = solutions[-1].errors
    results: list[Result] = [
        rate(
            "slip, L2",
            convergence(solutions, "slip"),
            0.85,
            source="square-root tips",
            reason="of open macro-elements at the tips too, of which linear triangles have one to three",
        )
    ]
    for name in ("p", "t"):
        quantity = f"largest relative error of {name}_m"
        if cell == "QUAD8":
            results.append(at_most(quantity, max(one.errors[name] for one in solutions), 1e-10, source="uniform"))
        else:
            results.append(informative(quantity, finest[name], reason="tips: linear cells have 36 % there"))
    results.append(informative("iterations", solutions[-1].solved.iterations, reason="2 to 4 on a prototype"))
    return Outcome((*results, *balanced([one.solved for one in solutions])))


def _crack(cell: str, exact: Crack, n: int) -> LevelSolution:
    text = case_text(
        "plane_strain",
        entry("material", young=exact.young, poisson=exact.poisson),
        entry("contact", slave="slave", master="master", friction=exact.friction),
    )
    case = with_motions(text, {"far": lambda x, t: exact.displacement(x[:, :2])})
    one = solve(case, meshes.cracked(cell, n))
    zone = one.fields.zones["slave"]
    slip = pressure_errors(one.mesh, one.passed[:, 0], lambda x: exact.slip(x[:, 0])[:, None])
    errors = {
        "slip": slip.exact,
        "p": float(np.abs(zone.pressure / exact.pressure - 1).max()),
        "t": float(np.abs(one.shear[:, 0] / exact.shear - 1).max()),
    }
    return LevelSolution(one, 1 / n, errors)


# ---- a punch


def solve_punch(poisson: float, friction: float, n: int = 64, *, levels: int) -> Outcome:
    """A flat punch on a half-plane of QUAD8, n cells to the half-width. Press by a force; far off, the displacements of
    the half-plane under the tractions of the integral equations.
    """
    nu = poisson
    edge = spence.stick_edge(nu, friction)
    count = 400
    x, p, q = spence.tractions(
        (1 - 2 * nu) / (2 * (1 - nu)), friction, round(count * np.arcsin(edge) / (np.pi / 2)), True, count
    )
    width = np.diff(np.sin(np.linspace(0, np.pi / 2, count + 1)))
    place = np.concatenate([-x[::-1], x])
    aside, down = np.concatenate([-(q * width)[::-1], q * width]), np.concatenate([(p * width)[::-1], p * width])
    force, below = np.stack([aside, -down], axis=1), HalfPlane(-1, 1.0, nu)
    still = below.under_forces(np.array([[0.0, -meshes.REACH]]), place, force)
    text = case_text(
        "plane_strain",
        entry("material", young=1.0, poisson=nu),
        entry("contact", slave="slave", master="master", friction=friction),
        entry("displacement", group="axis", ux=0.0),
        entry("rigid", group="master", fy=-0.5),
    )
    far = {"far": lambda x, t: below.under_forces(x[:, :2], place, force) - still}
    one = solve(with_motions(text, far), meshes.punched_half("QUAD8", n))
    zone = one.zone
    on = zone.status == 1
    left = 1 - np.abs(one.shear[on, 0]) / (friction * zone.pressure[on])
    stick_edge = edge_of_contact(zone.centre[on, 0], left, float(left.min()), 0.75 * edge)
    sticks = int((zone.status == 1).sum()) / n
    return Outcome(
        (
            equal("edge of stick over the half-width", stick_edge, edge, 0.03 * edge,
                  source="Spence's integral equations",
                  reason="3 %: elements of 1/64 of the half-width"),
            informative("part of the half-width that sticks", sticks, reason="a whole number of macro-elements"),
            informative("closed form that leaves out the coupling", spence.uncoupled_edge(nu, friction),
                        reason="of textbooks; not exact"),
            *balanced([one]),
        )
    )  # fmt: skip


_FIT = SlidingFit(
    Fit(Shell("plane_strain", 0.5, 1.0, 3.0, 0.2), Shell("plane_strain", 1.0, 2.0, 1.0, 0.3), interference=0.01), 0.3
)
_PUNCHES = ((0.3, 0.2), (0.3, 0.4), (0.0, 0.4), (0.45, 0.1))


def cases(family: str) -> Iterator[Case]:
    """Incline, fits, belts, crack, punches."""
    for part in (0.99, 1.01):
        word = "below" if part < 1 else "above"
        for cell in ("TRIA3", "QUAD8"):
            description = f"a pad on a slope of {part} mu, {cell}"
            yield Case(
                family, f"incline-{word}-{cell}", description, partial(solve_incline, cell, part), {"quick": 1}, 2.0
            )
        pulled, turned = (
            partial(solve_fit, "QUAD8", "pulled", part, _FIT),
            partial(solve_fit, "QUAD8", "turned", part, _FIT),
        )
        description = f"a shaft in a hub, {part} of what friction carries"
        yield Case(family, f"pull-out-{word}", f"{description}, along the axis", pulled, {"quick": 1}, 3.0)
        yield Case(family, f"torque-{word}", f"{description}, by a moment", turned, {"quick": 1}, 3.0)
    for angle in (90.0, 180.0, 270.0):
        suite = "quick" if angle == 90 else "full"
        yield Case(
            family, f"belt-{angle:g}", f"a belt around {angle:g} degrees", partial(solve_belt, angle), {suite: 1}, 20.0
        )
    for kinematics, n in (("small", 24), ("finite", 48)):
        laid = partial(solve_laid_belt, kinematics, n)
        yield Case(
            family, f"belt-laid-{kinematics}", "a belt that is laid on a drum and pulled", laid, {"full": 1}, 20.0
        )
    for cell in ("TRIA3", "QUAD4", "TRIA6", "QUAD8"):
        description = f"a closed crack that slides, {cell}"
        yield Case(
            family, f"crack-{cell}", description, partial(solve_crack, cell, Crack()), {"quick": 3, "full": 4}, 10.0
        )
    for poisson, friction in _PUNCHES:
        name, description = f"punch-{poisson:g}-{friction:g}", f"Spence's punch, nu {poisson:g}, mu {friction:g}"
        yield Case(family, name, description, partial(solve_punch, poisson, friction), {"full": 1}, 30.0)
