"""Large sliding: a block on a plate, whose exact pressure is uniform; a ring on a block; ironing, in plane and space.

The exact solution of the block: its top carries a dead load p, its walls may move, the plate is flat, rigid and without
friction; so the nominal contact pressure is p wherever it slides (equilibrium alone, for any law). The others have no
exact solution: steps that converge as they are given, Newton's last iterations, balance and the evenness of the
pressure are what is asked of them. The ring is after code_aster's ssnp165c, whose law and mesh are others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacsolver.equilibrium.state import State
from lacsolver.results.figures import step_figures
from verification.meshes.sliding import ironing_2d, ironing_3d, ring, slider
from verification.records import Case, Family, Published, Result, at_least, at_most, informative, problem, row
from verification.solving import Solved, balanced, case_text, contact, entry, fixed, material, model_of, solve

Floats = NDArray[np.floating]

#: Newton's method is near where a residual, relative to the forces, is below this
NEAR = 1e-2
#: the last so many iterations of a step with its last set are quadratic where each makes of e at most e to this power,
#: or the tolerance
LAST, ORDER = 2, 1.8
#: how much of the peak a pressure may go up and down from face to face
EVEN = 0.01
_EXACT = "equilibrium alone: a dead load on a flat plate without friction"
_DESIGN = "design table: converges at the given steps; last iterations quadratic; no spurious oscillation"
_NEWTON = (
    "of iterations with the last set of closed rows: one that changes it starts anew; below its tolerance a step ends. "
    "Where it falls short: the ring snaps, and near a limit point the tangent is nearly singular, so that a residual "
    "of 1e-3 is not near yet (e' is up to 3000 e^2 there, though the tangent is exact); or a rule of few points "
    "leaves derivatives off by 1e-4 of themselves on warped faces, which shows where e' is just above the tolerance"
)
_EVEN = (
    "a smooth profile has none, however few faces carry it. It takes a stiff slave whose faces are clearly larger than "
    "the soft master's: of 0.2 over faces of 0.25 they swing by 31 % of the peak, over 0.17 by 1.5 %, over 0.15 by 0"
)
#: the meshes that a body is dragged on
MESHES: Mapping[str, Callable[[int], Mesh]] = {"ring": ring, "ironing_2d": ironing_2d, "ironing_3d": ironing_3d}


@dataclass(frozen=True)
class Slider:
    """A unit block of `cell`, `n` a side, on a rigid plate of `faces`; pressed in the first step, then dragged.

    `wave` 0: a dead load `pressure` on top of a flat plate. Else the plate has waves (see `slider`), and the top is
    moved down by `push`.
    """

    cell: str
    normals: str
    wave: float = 0.0
    n: int = 3
    faces: int = 17
    young: float = 1000.0
    poisson: float = 0.3
    pressure: float = 50.0
    push: float = 0.05
    way: float = 1.5
    steps: int = 6
    tolerance: float = 1e-10
    macro: str = "cut"

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return int(CELLS[self.cell].dim)


@dataclass(frozen=True)
class Dragged:
    """A body that is pushed into another and maybe along it. `path`: component -> (time, value) of the group `moved`.

    `mesh`: one of `MESHES`; `sizes`, `steps`: of each level. `materials`: group, modulus, Poisson's ratio, all
    neo-Hookean. `held`: group -> axes. `published`: Newton iterations of code_aster. `surface`: what the gap is
    measured between, of which code_aster knows the faces alone.
    """

    mesh: str
    sizes: tuple[int, ...]
    steps: tuple[int, ...]
    normals: str
    materials: tuple[tuple[str, float, float], ...]
    moved: str
    path: tuple[tuple[str, tuple[tuple[float, float], ...]], ...]
    held: tuple[tuple[str, str], ...]
    end: float = 4.0
    model: str = "plane_strain"
    measure: str = "reference"
    tolerance: float = 1e-10
    published: int | None = None
    surface: str = "smooth"


# ---- a block on a plate


@problem
def slide(given: Slider, *, levels: int) -> Iterator[Result]:
    """The block on meshes each twice as fine; the plate stays as it is."""
    solutions = [slid(given, given.n << level) for level in range(levels)]
    yield from newton([state for own in solutions for state in own.states], given.tolerance)
    if not given.wave:
        each = [(own, state) for own in solutions for state in own.states]
        error = np.abs(np.concatenate([state.zones[0].pressure for _, state in each]) / given.pressure - 1).max()
        forces = np.array([step_figures(own.problem, state).contact["slave"].resultant for own, state in each])
        off = np.abs(forces - given.pressure * np.eye(given.dim)[-1]).max()
        yield at_most("error of p_m, worst of all steps", error, 1e-12, source=_EXACT, reason="rounding")
        yield at_most("error of the contact force over the load, worst of all steps", off / given.pressure, 1e-10,
                      source=_EXACT,
                      reason="the same; its part along the plate is the drag, which is zero")  # fmt: skip
    yield from balanced(solutions)


def slid(given: Slider, n: int) -> Solved:
    """The block, n cells a side, over all steps."""
    return solve(slider_text(given), slider(given.cell, n, given.faces, given.wave))


def slider_text(given: Slider) -> str:
    """The case of the block, as TOML."""
    up, whole = "xyz"[given.dim - 1], 1.0 + given.steps
    along = [[1.0, 0.0], [whole, given.way]]
    if given.wave:
        aside = {"uy": 0.0} if given.dim == 3 else {}
        down = {f"u{up}": [[0.0, 0.0], [1.0, -given.push]]}
        loads = [entry("displacement", group="top", ux=along, **down, **aside)]
    else:
        loads = [entry("displacement", group="x0", ux=along)]
        loads += [fixed("y0", "y")] * (given.dim - 2)
        loads.append(entry("pressure", group="top", value=[[0.0, 0.0], [1.0, given.pressure]]))
    return case_text(
        model_of(given.dim), material(given.young, given.poisson, law="neo_hookean"),
        contact(master="plate", normals=given.normals, macro=given.macro), entry("rigid", group="plate"), *loads,
        entry("steps", end=whole, count=1 + given.steps), entry("solver", tolerance=given.tolerance),
        kinematics="finite",
    )  # fmt: skip


# ---- a ring, and ironing


@problem
def drag(given: Dragged, *, levels: int) -> Iterator[Result]:
    """The body that is dragged, on its meshes."""
    solutions = []
    for size, steps in list(zip(given.sizes, given.steps, strict=True))[:levels]:
        solutions.append(dragged(given, size, steps))
        named = f", {size} segments" if len(given.sizes) > 1 else ""
        yield from newton(solutions[-1].states, given.tolerance, named)
        swing = max(alternation(row) for row in pressed_rows(solutions[-1].states))
        name = f"pressure that alternates from face to face, over its peak{named}"
        yield at_most(name, swing, EVEN, source=_DESIGN, reason=_EVEN)
    if given.published is not None:
        theirs = Published("code_aster, ssnp165c", given.published, "reference/peers.md")
        name, last = f"Newton iterations, {len(solutions[-1].states)} steps", solutions[-1].iterations
        yield at_most(name, last, given.published, source="reference/peers.md: code_aster's LAC, 20 steps",
                      reason="alike and not the same: another law and another mesh", published=(theirs,))  # fmt: skip
    if given.surface == "smooth":  # beside the gap between faces, on the same mesh and steps
        faces = dragged(replace(given, surface="faces"), given.sizes[0], given.steps[0])
        for name, own in (("between faces", faces), ("smooth", solutions[0])):
            swing = max(alternation(row) for row in pressed_rows(own.states))
            what = f"pressure that alternates, over its peak, coarsest mesh, {name}"
            yield informative(what, swing, reason="the same mesh and steps with either gap")
    yield from balanced(solutions)


def dragged(given: Dragged, size: int, steps: int) -> Solved:
    """A mesh, over all steps."""
    return solve(dragged_text(given, steps), MESHES[given.mesh](size))


def dragged_text(given: Dragged, steps: int) -> str:
    """The case of the body that is dragged in so many steps, as TOML."""
    return case_text(
        given.model,
        *(material(young, poisson, groups=[group], law="neo_hookean") for group, young, poisson in given.materials),
        contact(normals=given.normals, measure=given.measure, surface=given.surface),
        *(fixed(group, axes) for group, axes in given.held),
        entry("displacement", group=given.moved, **dict(given.path)), entry("steps", end=given.end, count=steps),
        entry("solver", tolerance=given.tolerance), kinematics="finite",
    )  # fmt: skip


# ---- what is measured


def newton(states: Sequence[State], tolerance: float, named: str = "") -> Iterator[Result]:
    """Criteria for Newton's method: halved steps, and quadratic last iterations of the steps that have any."""
    yield at_most(f"halved steps{named}", sum(state.halvings for state in states), 0, source=_DESIGN)
    settled = [state.residuals[len(state.residuals) - state.n_unchanged_sets :] for state in states]
    pairs = [own for residuals in settled if (own := last_pairs(residuals, tolerance))]
    if pairs:
        share = float(np.mean([quadratic(own, tolerance) for own in pairs]))
        name = f"share of steps whose last {LAST} iterations are quadratic{named}"
        yield at_least(name, share, 1.0, source=_DESIGN, reason=f"{len(pairs)} of {len(states)} steps; {_NEWTON}")


def quadratic(pairs: Sequence[tuple[float, float]], tolerance: float) -> bool:
    """True if each residual is at most the previous one to the power `ORDER`, or below the tolerance.

    >>> quadratic([(1e-3, 2e-6), (2e-6, 1e-11)], 1e-10), quadratic([(1e-3, 1e-4)], 1e-10)
    (True, False)
    """
    return all(then <= max(e**ORDER, tolerance) for e, then in pairs)


def last_pairs(residuals: Sequence[float], tolerance: float) -> list[tuple[float, float]]:
    """The last (residual, next one) of a step, of those that are near and above the tolerance.

    >>> last_pairs([1.0, 1e-3, 1e-6, 1e-12, 1e-13], 1e-10)
    [(0.001, 1e-06), (1e-06, 1e-12)]
    """
    return [(e, then) for e, then in pairwise(residuals) if tolerance < e < NEAR][-LAST:]


def pressed_rows(states: Sequence[State]) -> list[Floats]:
    """Pressures p_m along the contact (`along`), an array for each state in which some macro-element is pressed."""
    return [row for state in states if (row := along(state)[1]).max() > 0]


def along(state: State) -> tuple[Floats, Floats]:
    """x and p_m of the macro-elements in their order along x; in space, of the row at the plane of symmetry."""
    zone = state.zones[0]
    own = np.arange(len(zone.pressure))
    if zone.centre.shape[1] == 3:
        y = zone.centre[:, 1]
        own = np.flatnonzero(y < y.min() + 0.01 * np.ptp(y))
    own = own[np.argsort(zone.centre[own, 0])]
    return zone.centre[own, 0], zone.pressure[own]


def alternation(p: Floats) -> float:
    """Checkerboard amplitude over the peak: the largest min(|d1|, |d2|, |d3|) / 2 of three alternating differences.

    >>> alternation(np.array([0.0, 1.0, 2.0, 1.0, 0.0])), alternation(np.array([0.0, 1.0, 0.8, 1.0, 0.0]))
    (0.0, 0.09999999999999998)
    """
    step = np.lib.stride_tricks.sliding_window_view(np.diff(p), 3)
    turns = (step[:, 0] * step[:, 1] < 0) & (step[:, 1] * step[:, 2] < 0)
    return float(np.abs(step[turns]).min(axis=1).max(initial=0.0) / 2 / p.max())


# ---- the cases

_RING = Dragged(
    "ring", (30,), (20,), "smoothed",
    materials=(("inner", 1e5, 0.3), ("outer", 1e3, 0.3), ("block", 300.0, 0.3)),
    moved="ends", path=(("ux", ((0.0, 0.0), (1.0, 0.0))), ("uy", ((0.0, 0.0), (1.0, -90.0)))),
    held=(("bottom", "xy"),), end=1.0, measure="current", tolerance=1e-8, published=144,
    surface="faces",
)  # fmt: skip
_RUBBER = (("block", 10.0, 0.4), ("die", 500.0, 0.3))


def _plane(normals: str) -> Dragged:
    return Dragged(
        "ironing_2d", (32, 60), (32, 48), normals, _RUBBER, moved="top",
        path=(("ux", ((1.0, 0.0), (4.0, 4.5))), ("uy", ((0.0, 0.0), (1.0, -0.65)))), held=(("bottom", "xy"),),
    )  # fmt: skip


def _space(normals: str) -> Dragged:
    return Dragged(
        "ironing_3d", (24, 40), (36, 36), normals, _RUBBER, moved="top", model="3d",
        path=(("ux", ((1.0, 0.0), (4.0, 3.0))), ("uz", ((0.0, 0.0), (1.0, -0.4)))),
        held=(("bottom", "xyz"), ("symmetry", "y")),
    )  # fmt: skip


TEXT = f"""
Bodies that slide over many faces of one another, with finite kinematics and contact that follows the deformed skins.
Steps are given, and none may be halved.

*A block on a plate* is a large patch test: under a dead load the nominal pressure is uniform at every step, to 1e-12,
while the block crosses six faces of a plate that does not match it. Over a plate with waves it shows Newton's method.
*The ring*, of two layers, the inner one a hundred times as stiff, lies down on a soft block, buckles, and slides apart
in two contacts, after code_aster's ssnp165c. *Ironing*: a half-cylinder pressed into rubber and dragged over it by one
and a half times its width, in the plane and in space.

**Newton.** Of each step the last {LAST} iterations that begin above the tolerance, among those that solve with the set
of closed rows that the step ends with: the method is semi-smooth, and no iteration that changes the set says how good
the tangent is. Each must leave at most the residual before it to the power of {ORDER}, or less than the tolerance (the
last of all always does; the one before it tells).

**Oscillation.** Along the contact, in any four macro-elements running whose pressures go up, down and up again (or the
other way), half of the least of these three differences over the peak: zero for a smooth profile, whether it has one
hill or two, and at most {EVEN:g} is asked for.
"""


def _cases() -> Iterator[Case]:
    for cell, seconds in (("QUAD4", 4.0), ("QUAD8", 4.0), ("HEXA8", 8.0)):
        for normals in ("facet", "smoothed"):
            what = f"a block of {cell} on a flat plate, {normals} normals"
            given = Slider(cell, normals)
            yield row("sliding", f"block_{cell}_{normals}", what, slide, given, quick=1, full=2, seconds=seconds)
    for cell in ("QUAD4", "HEXA8"):
        given, what = Slider(cell, "facet", macro="stars"), f"a block of {cell} on a flat plate, stars of its faces"
        yield row("sliding", f"block_{cell}_stars", what, slide, given, quick=1, full=2, seconds=8.0)
        for normals in ("facet", "smoothed"):
            given, what = Slider(cell, normals, wave=0.02), f"a block of {cell} over waves, {normals} normals"
            yield row("sliding", f"waves_{cell}_{normals}", what, slide, given, full=1)
    yield row("sliding", "ring", "a ring on a block", drag, _RING, full=1, seconds=10.0)
    for name, where, body, normals, quick, seconds in (
        ("ironing_2d_facet", "the plane", _plane, "facet", 1, 25.0),
        ("ironing_2d_smoothed", "the plane", _plane, "smoothed", 0, 30.0),
        ("ironing_3d_facet", "space", _space, "facet", 0, 110.0),
        ("ironing_3d_smoothed", "space", _space, "smoothed", 0, 150.0),
    ):
        what = f"ironing in {where}, {normals} normals"
        yield row("sliding", name, what, drag, body(normals), quick=quick, full=2, seconds=seconds)


FAMILY = Family("sliding", "Large sliding and ironing", TEXT, tuple(_cases()))
