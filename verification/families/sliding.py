"""Large sliding: a block on a plate, whose exact pressure is uniform; a ring on a block; ironing, in plane and space.

The exact solution of the block: its top carries a dead load p, its walls may move, the plate is flat, rigid and without
friction; so the nominal contact pressure is p wherever it slides (equilibrium alone, for any law). The others have no
exact solution: steps that converge as they are given, Newton's last iterations, balance and the evenness of the
pressure are what is asked of them. The ring is after code_aster's ssnp165c, whose law and mesh are others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacsolver.results.figures import step_figures
from lacsolver.results.state import State
from verification.meshes.sliding import ironing_2d, ironing_3d, ring, slider
from verification.pages.charts import Line, Plot
from verification.records import Case, Family, Outcome, Published, Result, at_least, at_most, informative
from verification.solving import Solved, balanced, case_text, entry, model_of, solve

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
    "four faces running over which pressures go up and down in turn; a smooth profile has none, however few carry it. "
    "It takes a stiff slave whose faces are clearly larger than the soft master's: of 0.2 over faces of 0.25 they "
    "swing by 31 % of the peak, over 0.17 by 1.5 %, over 0.15 by nothing"
)
_BESIDE = "the same mesh and steps with either gap"
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
    neo-Hookean. `held`: group -> components. `published`: Newton iterations of code_aster. `surface`: what the gap is
    measured between, of which code_aster knows the faces alone.
    """

    mesh: str
    sizes: tuple[int, ...]
    steps: tuple[int, ...]
    normals: str
    materials: tuple[tuple[str, float, float], ...]
    moved: str
    path: tuple[tuple[str, tuple[tuple[float, float], ...]], ...]
    held: tuple[tuple[str, tuple[str, ...]], ...]
    end: float = 4.0
    model: str = "plane_strain"
    measure: str = "reference"
    tolerance: float = 1e-10
    published: int | None = None
    surface: str = "smooth"

    @property
    def up(self) -> int:
        """The axis that it is pushed along."""
        return 2 if self.model == "3d" else 1


# ---- a block on a plate


def slide(given: Slider, title: str, *, levels: int) -> Outcome:
    """The block on meshes each twice as fine; the plate stays as it is."""
    solutions = [slid(given, given.n << level) for level in range(levels)]
    states = [state for own in solutions for state in own.states]
    results = list(newton(states, given.tolerance))
    if not given.wave:
        pressures = np.concatenate([state.zones[0].pressure for state in states])
        forces = np.array(
            [step_figures(own.problem, state).contact["slave"].resultant for own in solutions for state in own.states]
        )
        off = np.abs(forces - given.pressure * np.eye(given.dim)[-1]).max()
        results += [
            at_most("error of p_m, worst of all steps", np.abs(pressures / given.pressure - 1).max(), 1e-12,
                    source=_EXACT, reason="rounding"),
            at_most("error of the contact force over the load, worst of all steps", off / given.pressure, 1e-10,
                    source=_EXACT, reason="the same; its part along the plate is the drag, which is nothing"),
        ]  # fmt: skip
    return Outcome((*results, *balanced(solutions)), (histories(title, solutions[-1].states),))


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
        loads += [entry("displacement", group="y0", uy=0.0)] * (given.dim - 2)
        loads.append(entry("pressure", group="top", value=[[0.0, 0.0], [1.0, given.pressure]]))
    return case_text(
        model_of(given.dim),
        entry("material", law="neo_hookean", young=given.young, poisson=given.poisson),
        entry("contact", slave="slave", master="plate", normals=given.normals, macro=given.macro),
        entry("rigid", group="plate"),
        *loads,
        entry("steps", end=whole, count=1 + given.steps),
        entry("solver", tolerance=given.tolerance),
        kinematics="finite",
    )


# ---- a ring, and ironing


def drag(given: Dragged, title: str, *, levels: int) -> Outcome:
    """The body that is dragged, on its meshes."""
    solutions = [dragged(given, *each) for each in list(zip(given.sizes, given.steps, strict=True))[:levels]]
    results: list[Result] = []
    for size, own in zip(given.sizes, solutions, strict=False):
        named = f", {size} segments" if len(given.sizes) > 1 else ""
        results += [*newton(own.states, given.tolerance, named), *evenness(own.states, named)]
    results.append(_iterations(given, solutions[-1]))
    if given.surface == "smooth":
        results += between_faces(given, solutions[0])
    force, last = forces(title, given, solutions[-1]), solutions[-1]
    plots = histories(title, last.states), force, profiles(title, last.states)
    return Outcome((*results, *balanced(solutions)), plots, (last.picture(title),))


def between_faces(given: Dragged, smooth: Solved) -> Iterator[Result]:
    """Alternation and iterations on the coarsest mesh, with the gap between faces and between smooth surfaces."""
    faces = dragged(replace(given, surface="faces"), given.sizes[0], given.steps[0])
    for name, own in (("between faces", faces), ("smooth", smooth)):
        swings = [alternation(row) for row in pressed_rows(own.states)]
        yield informative(
            f"pressure that alternates, over its peak, coarsest mesh, {name}", max(swings), reason=_BESIDE
        )
        yield informative(f"Newton iterations, coarsest mesh, {name}", own.iterations, reason=_BESIDE)


def dragged(given: Dragged, size: int, steps: int) -> Solved:
    """A mesh, over all steps."""
    return solve(dragged_text(given, steps), MESHES[given.mesh](size))


def dragged_text(given: Dragged, steps: int) -> str:
    """The case of the body that is dragged in so many steps, as TOML."""
    contact = {"normals": given.normals, "measure": given.measure, "surface": given.surface}
    return case_text(
        given.model,
        *(
            entry("material", groups=[group], law="neo_hookean", young=young, poisson=poisson)
            for group, young, poisson in given.materials
        ),
        entry("contact", slave="slave", master="master", **contact),
        *(entry("displacement", group=group, **dict.fromkeys(components, 0.0)) for group, components in given.held),
        entry("displacement", group=given.moved, **dict(given.path)),
        entry("probe", group=given.moved),
        entry("steps", end=given.end, count=steps),
        entry("solver", tolerance=given.tolerance),
        kinematics="finite",
    )


def _iterations(given: Dragged, own: Solved) -> Result:
    name = f"Newton iterations, {len(own.states)} steps"
    if given.published is None:
        return informative(name, own.iterations, reason="nobody published it")
    theirs = (Published("code_aster, ssnp165c", given.published, "reference/peers.md"),)
    return at_most(name, own.iterations, given.published, source="reference/peers.md: code_aster's LAC, 20 steps",
                   reason="alike and not the same: another law and another mesh", published=theirs)  # fmt: skip


# ---- what is measured


def newton(states: Sequence[State], tolerance: float, named: str = "") -> tuple[Result, ...]:
    """Criteria for Newton's method: halved steps, quadratic last iterations, and their order."""
    settled = [state.residuals[len(state.residuals) - state.n_unchanged_sets :] for state in states]
    pairs = [own for residuals in settled if (own := last_pairs(residuals, tolerance))]
    halved = sum(state.halvings for state in states)
    results: tuple[Result, ...] = (at_most(f"halved steps{named}", halved, 0, source=_DESIGN),)
    if not pairs:
        return results
    share = float(np.mean([quadratic(own, tolerance) for own in pairs]))
    orders = [np.log(then) / np.log(e) for own in pairs for e, then in own if then > tolerance]
    order = "log of a residual over log of the one before, both above the tolerance"
    results += (
        informative(f"steps whose last {LAST} iterations tell{named}", len(pairs), reason=f"of {len(states)}"),
        at_least(f"share of steps whose last {LAST} iterations are quadratic{named}", share, 1.0,
                 source=_DESIGN, reason=_NEWTON),
    )  # fmt: skip
    if not orders:
        return results
    return *results, informative(
        f"order of the last {LAST} iterations, median{named}", float(np.median(orders)), reason=order
    )


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


def evenness(states: Sequence[State], named: str = "") -> tuple[Result, ...]:
    """Criteria for even pressures: alternation from face to face, worst and mean of the steps, and total variation."""
    rows = pressed_rows(states)
    swings = [alternation(row) for row in rows]
    mean = "the mean of the steps, beside the worst"
    return (
        at_most(f"pressure that alternates from face to face, over its peak{named}", max(swings), EVEN,
                source=_DESIGN, reason=_EVEN),
        informative(f"the same, mean of the steps{named}", float(np.mean(swings)), reason=mean),
        informative(f"total variation over twice the peak, less 1{named}", max(map(variation, rows)),
                 reason="0 for a pressure with one hill, 1 for two of one height that part"),
    )  # fmt: skip


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


def variation(p: Floats) -> float:
    """Total variation of a pressure that is 0 at both ends, over twice its peak, less 1.

    >>> variation(np.array([1.0, 2.0, 1.0])), variation(np.array([2.0, 0.0, 2.0]))
    (0.0, 1.0)
    """
    return float(np.abs(np.diff(p, prepend=0.0, append=0.0)).sum() / (2 * p.max()) - 1)


# ---- what is drawn


def histories(title: str, states: Sequence[State], count: int = 5) -> Plot:
    """Residuals of the iterations of some steps, evenly chosen among those that took several."""
    took = [state for state in states if len(state.residuals) > 2] or list(states)
    some = [took[round(k)] for k in np.linspace(0, len(took) - 1, min(count, len(took)))]
    lines = [Line(f"t = {s.time:.3g}", tuple(range(1, len(s.residuals) + 1)), s.residuals) for s in some]
    return Plot("Newton", title, "iteration", "residual over forces", tuple(lines), log_y=True)


def forces(title: str, given: Dragged, own: Solved) -> Plot:
    """Plot of vertical and horizontal force over the path: over the motion along x, or downward if there is none."""
    figures = [step_figures(own.problem, state) for state in own.states]
    way = np.array([f.probes[given.moved] for f in figures])
    force = np.array([f.reactions[given.moved] for f in figures])
    axis = 0 if np.ptp(way[:, 0]) > 0 else given.up
    x = tuple(map(float, np.abs(way[:, axis])))
    named = (("push", -force[:, given.up]), ("drag", force[:, 0]))
    lines = tuple(Line(label, x, tuple(map(float, y))) for label, y in named)
    return Plot("force", title, "way along x" if axis == 0 else "way down", "force", lines)


def profiles(title: str, states: Sequence[State], count: int = 4) -> Plot:
    """p_m along x at some times."""
    touching = [state for state in states if along(state)[1].max() > 0]
    some = [touching[round(k)] for k in np.linspace(0, len(touching) - 1, min(count, len(touching)))]
    lines = [Line(f"t = {s.time:.3g}", tuple(x.tolist()), tuple(p.tolist())) for s in some for x, p in [along(s)]]
    return Plot("pressure", title, "x", "p_m", tuple(lines))


# ---- the cases

_RING = Dragged(
    "ring", (30,), (20,), "smoothed",
    materials=(("inner", 1e5, 0.3), ("outer", 1e3, 0.3), ("block", 300.0, 0.3)),
    moved="ends", path=(("ux", ((0.0, 0.0), (1.0, 0.0))), ("uy", ((0.0, 0.0), (1.0, -90.0)))),
    held=(("bottom", ("ux", "uy")),), end=1.0, measure="current", tolerance=1e-8, published=144,
    surface="faces",
)  # fmt: skip
_RUBBER = (("block", 10.0, 0.4), ("die", 500.0, 0.3))


def _plane(normals: str) -> Dragged:
    return Dragged(
        "ironing_2d", (32, 60), (32, 48), normals, _RUBBER, moved="top",
        path=(("ux", ((1.0, 0.0), (4.0, 4.5))), ("uy", ((0.0, 0.0), (1.0, -0.65)))), held=(("bottom", ("ux", "uy")),),
    )  # fmt: skip


def _space(normals: str) -> Dragged:
    return Dragged(
        "ironing_3d", (24, 40), (36, 36), normals, _RUBBER, moved="top", model="3d",
        path=(("ux", ((1.0, 0.0), (4.0, 3.0))), ("uz", ((0.0, 0.0), (1.0, -0.4)))),
        held=(("bottom", ("ux", "uy", "uz")), ("symmetry", ("uy",))),
    )  # fmt: skip


def _case(name: str, description: str, given: Slider | Dragged, levels: Mapping[str, int], seconds: float) -> Case:
    solve = partial(slide, given, description) if isinstance(given, Slider) else partial(drag, given, description)
    return Case("sliding", name, description, solve, levels, seconds)


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
last of all always does; the one before it tells). Beside it how many steps have such iterations.

**Oscillation.** Along the contact, in any four macro-elements running whose pressures go up, down and up again (or the
other way), half of the least of these three differences over the peak: nothing for a smooth profile, whether it has one
hill or two, and what is asked is at most {EVEN:g}. Beside it the total variation.
"""

FAMILY = Family(
    "sliding",
    "Large sliding and ironing",
    TEXT,
    (
        *(
            _case(f"block_{cell}_{normals}", f"a block of {cell} on a flat plate, {normals} normals",
                  Slider(cell, normals), {"quick": 1, "full": 2}, 8.0 if cell == "HEXA8" else 4.0)
            for cell in ("QUAD4", "QUAD8", "HEXA8") for normals in ("facet", "smoothed")
        ),
        *(
            _case(f"block_{cell}_stars", f"a block of {cell} on a flat plate, stars of its faces",
                  Slider(cell, "facet", macro="stars"), {"quick": 1, "full": 2}, 8.0)
            for cell in ("QUAD4", "HEXA8")
        ),
        *(
            _case(f"waves_{cell}_{normals}", f"a block of {cell} over waves, {normals} normals",
                  Slider(cell, normals, wave=0.02), {"full": 1}, 5.0)
            for cell in ("QUAD4", "HEXA8") for normals in ("facet", "smoothed")
        ),
        _case("ring", "a ring on a block", _RING, {"full": 1}, 10.0),
        _case("ironing_2d_facet", "ironing in the plane, facet normals", _plane("facet"),
              {"quick": 1, "full": 2}, 25.0),
        _case("ironing_2d_smoothed", "ironing in the plane, smoothed normals", _plane("smoothed"), {"full": 2}, 30.0),
        _case("ironing_3d_facet", "ironing in space, facet normals", _space("facet"), {"full": 2}, 110.0),
        _case("ironing_3d_smoothed", "ironing in space, smoothed normals", _space("smoothed"), {"full": 2}, 150.0),
    ),
)  # fmt: skip
