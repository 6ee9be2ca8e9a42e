"""Hertz's contact against its own solution: half-spaces, of which the mesh is a piece.

Two elastic half-spaces, or one on a rigid plane, flat, with the clearance `r^2 / 2R`: Hertz's own problem, small
strains, geometry of the undeformed surfaces. On the outer sides of the mesh the displacements of the half-spaces are
imposed, in closed form (Muskhelishvili's solution in the plane, Green and Collins' potential about an axis), so that
the mesh is the only error and rates are clean. The edge of contact lies at the same fraction of its macro-element on
every level; slave and master lines do not match. Lengths are in contact half-widths a = 1, stresses in the slave's
modulus.

In the plane the displacement of half-planes is known up to a constant; the datum is that both surfaces' points on the
axis stand still.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh.cells import CELLS
from verification.exact import half_space
from verification.exact.half_space import Strains, contact_modulus, peak_pressure
from verification.measures import norms
from verification.measures.edge import edge_of_contact
from verification.measures.norms import nodal_pressure_error, pressure_errors
from verification.meshes.half_spaces import half_spaces
from verification.records import Case, Family, Rows, at_most, informative, problem, rate, row
from verification.solving import LevelSolution, Solved, balanced, case_text, convergence, entry, solve, with_motions

Floats = NDArray[np.floating]

THEOREM = (
    "Abbas, Drouet and Hild 2018, Theorem 1: h for linear cells, h^(3/2) for quadratic ones as u is of H^s, s < 5/2"
)
EDGE = "the square-root edge of p: means over macro-elements come to no more than h sqrt(log 1/h)"
_EDGES = "it rises to 1 as h falls; that of the exact pressure's own means, the best that constants do, stands below"
_SHAPE = (
    "L2 over the slave, finest level; near the edge of contact the recovered pressure is the root of a parabola fitted "
    "to p_m; the best that the nodes could hold is 0.1 to 0.16 of the error of p_m"
)
RECOVERED = "a recovered pressure is worth its name where it halves the error"
#: of the rules that errors of u are integrated with, by the order of the cells
DEGREE = {1: 4, 2: 6}


@dataclass(frozen=True)
class Given:
    """A slave on a master, elastic or rigid. `models`: `plane_strain`, `axisymmetric`, `3d`; `cell`: of both bodies.

    `levels`: slave cells to the half-width; `fraction`: where the edge of contact lies inside its macro-element (along
    the axes, in space) on every level. `radius`: R / a.
    """

    model: str
    cell: str
    hexa: str
    rigid: bool
    levels: tuple[int, ...]
    fraction: float = 0.6
    radius: float = 5.0
    young: tuple[float, float] = (1.0, 3.0)
    poisson: tuple[float, float] = (0.3, 0.2)
    macro: str = "cut"

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return 3 if self.model == "3d" else 2

    @property
    def order(self) -> int:
        """Polynomial order of the cells."""
        return int(CELLS[self.cell].order)

    @property
    def bodies(self) -> list[tuple[float, float]]:
        """Elastic constants (E, nu) of the slave, and of the master unless it is rigid."""
        return list(zip(self.young, self.poisson, strict=True))[: 1 if self.rigid else 2]

    @property
    def p0(self) -> float:
        """The peak of the pressure."""
        return peak_pressure(1.0, self.radius, contact_modulus(self.bodies), plane=self.model == "plane_strain")


@dataclass(frozen=True)
class HalfSpace:
    """A half-space: `side` is 1 above the contact, -1 below; `lift`: what it is moved up by as a whole."""

    given: Given
    side: int
    young: float
    poisson: float
    lift: float = 0.0

    def at(self, x: Floats) -> tuple[Strains, Floats, Floats]:
        """The solution at x (n, dim) in the body's own frame, and cosine and sine (n,) of the angle about the axis."""
        depth = np.maximum(self.side * x[:, -1], 0.0)
        r = np.hypot(x[:, 0], x[:, 1]) if self.given.dim == 3 else x[:, 0]
        potential = half_space.plane if self.given.model == "plane_strain" else half_space.about_axis
        strains = half_space.strains(potential(r, depth, 1.0, self.given.p0), depth, self.young, self.poisson)
        if self.given.dim == 2:
            return strains, np.ones_like(r), np.zeros_like(r)
        safe = np.where(r > 0, r, 1.0)
        return strains, np.where(r > 0, x[:, 0] / safe, 1.0), x[:, 1] / safe

    def displacement(self, at: tuple[Strains, Floats, Floats]) -> Floats:
        """Displacement (n, dim), from the result of `at`."""
        strains, c, s = at
        up = self.side * strains.u_z + self.lift
        columns = [strains.u_r * c, strains.u_r * s, up] if self.given.dim == 3 else [strains.u_r, up]
        return np.stack(columns, axis=1)

    def motion(self, x: Floats, t: float) -> Floats:
        """Displacement (n, dim) at points (n, 3)."""
        return self.displacement(self.at(x[:, : self.given.dim]))

    def strain(self, at: tuple[Strains, Floats, Floats]) -> Floats:
        """Strain (n, 6): xx, yy, zz, xy, yz, xz, from the result of `at`."""
        strains, c, s = at
        rz, zero = self.side * strains.rz, np.zeros_like(strains.rr)
        if self.given.dim == 3:
            xx, yy = strains.rr * c**2 + strains.tt * s**2, strains.rr * s**2 + strains.tt * c**2
            columns = [xx, yy, strains.zz, (strains.rr - strains.tt) * c * s, rz * s, rz * c]
        else:
            hoop = strains.tt if self.given.model == "axisymmetric" else zero
            columns = [strains.rr, strains.zz, hoop, rz, zero, zero]
        return np.stack(columns, axis=1)


def bodies(given: Given) -> dict[str, HalfSpace]:
    """The bodies by their group, the slave `upper`, moved as a whole so that the surfaces meet at the pole."""
    halves = [HalfSpace(given, side, *own) for side, own in zip((1, -1), given.bodies, strict=False)]
    pole = np.zeros((1, given.dim))
    closed = sum(float(body.at(pole)[0].u_z[0]) for body in halves)
    return {"upper": replace(halves[0], lift=-closed), **({} if given.rigid else {"lower": halves[1]})}


def pressure(given: Given, x: Floats) -> Floats:
    """Hertz's pressure (n, 1) at points of the surface (n, dim)."""
    square = (x[:, :-1] ** 2).sum(axis=1)
    return given.p0 * np.sqrt(np.maximum(1 - square, 0.0))[:, None]


def case_of(given: Given) -> lacsolver.Case:
    """The case; the displacements of the outer sides are functions."""
    axes = "xyz"[: given.dim - 1]
    squares = " + ".join(f"{axis}**2" for axis in axes)
    bodies_of = zip(("upper", "lower"), given.bodies, strict=False)
    clearance = f"({squares}) / {2 * given.radius!r}"
    still = {f"u{axis}": 0.0 for axis in ("y" if given.model == "axisymmetric" else "xyz"[: given.dim])}
    text = case_text(
        given.model,
        *(entry("material", groups=[group], young=young, poisson=poisson) for group, (young, poisson) in bodies_of),
        entry("contact", slave="slave", master="master", hexa=given.hexa, macro=given.macro, clearance=clearance),
        *(entry("displacement", group=f"axis_{axis}", **{f"u{axis}": 0.0}) for axis in axes),
        *([entry("rigid", group="master", **still)] if given.rigid else []),
        *([entry("solver", backend="multigrid")] if given.dim == 3 else []),
    )
    return with_motions(text, {f"far_{group}": body.motion for group, body in bodies(given).items()})


def solve_level(given: Given, level: int) -> LevelSolution:
    """Solve on one level; errors relative to the exact values, of p_m beside those of the best constants."""
    k = given.levels[level]
    solved = solve(case_of(given), half_spaces(given.cell, k, given.fraction, rigid=given.rigid))
    mesh, zone = solved.mesh, solved.fields.zones["slave"]
    exact = partial(pressure, given)
    round_ = given.model == "axisymmetric"
    nodal = zone.pressure_recovered
    pole = np.flatnonzero(np.isfinite(nodal) & (np.abs(mesh.points).max(axis=1) < 1e-12))
    p = pressure_errors(mesh, zone.pressure, exact, axisymmetric=round_)
    energy, u = displacement_errors(given, solved)
    errors = {
        "energy": energy,
        "u": u,
        "p_m": p.exact,
        "best": p.best,
        "recovered": nodal_pressure_error(mesh, nodal, exact, axisymmetric=round_),
        "peak": abs(float(nodal[pole].max()) / given.p0 - 1),
    }
    return LevelSolution(solved, 1 / (k + given.fraction), errors)


def displacement_errors(given: Given, solved: Solved) -> tuple[float, float]:
    """Relative errors of u over both bodies: energy norm (sqrt of the integral of sigma : epsilon) and L2 norm.

    By rules of degree `DEGREE` of the cells' order.
    """
    mesh, round_ = solved.mesh, given.model == "axisymmetric"
    off, whole = np.zeros(2), np.zeros(2)
    for group, body in bodies(given).items():
        for at in norms.points_of(
            mesh, np.sort(mesh.cell_groups[group]), degree=DEGREE[given.order], axisymmetric=round_
        ):
            x = at.x.reshape(-1, 3)[:, : given.dim]
            strains = body.at(x)
            strain, u = body.strain(strains).reshape(*at.x.shape[:2], 6), body.displacement(strains)
            u = u.reshape(*at.x.shape[:2], given.dim)
            more = (
                norms.strains(solved.u, at, axisymmetric=round_) - strain,
                np.einsum("pn,kns->kps", at.N, solved.u[at.nodes]) - u,
            )
            for total, (e, v) in ((off, more), (whole, (strain, u))):
                total += norms.energy(e, at.w, body.young, body.poisson), norms.squared(v, at.w)
    energy, norm = np.sqrt(off / whole).tolist()
    return energy, norm


def half_width(centre: Floats, p: Floats, p0: float) -> float:
    """Half-width of contact, from the means p_m (n,) in its outer half."""
    return edge_of_contact(np.linalg.norm(centre[:, :-1], axis=1), p, p0, 0.5)


@problem
def outcome(given: Given, title: str, *, levels: int) -> Rows:
    """Solve a case on its levels: rates and figures of the errors."""
    solutions = [solve_level(given, level) for level in range(levels)]
    of, finest = partial(convergence, solutions), solutions[-1].errors
    beside = "beside the rates that theory gives: no bound"
    yield rate("u, energy norm", of("energy"), (0.95, 1.4)[given.order - 1], source=THEOREM)
    yield rate("u, L2", of("u"), None, source="", reason=beside)
    yield rate("p_m, L2", of("p_m"), 0.9, source=EDGE, reason=_EDGES)
    yield rate("exact means of p, L2", of("best"), None, source="", reason="the best that constants do")
    yield rate("recovered pressure, L2", of("recovered"), None, source="", reason=beside)
    over = finest["recovered"] / finest["p_m"]
    name = "error of the recovered pressure over that of p_m"
    yield at_most(name, over, 0.5, source=RECOVERED, reason=_SHAPE)
    name, reason = "p0 (recovered, at the pole), relative error", "on the finest level"
    yield informative(name, finest["peak"], reason=reason, levels=of("peak"))
    yield from balanced([one.solved for one in solutions])
    if given.dim == 3:  # drawn on the level that is coarse enough to see the cells
        yield solutions[0].solved.picture(title)


#: errors with macro = "stars" over those of the cut on the same mesh, at most
_OVER_CUT = {"energy": 1.05, "p_m": 1.8, "recovered": 1.8}


@problem
def over_cut(given: Given, *, levels: int) -> Rows:
    """Errors with stars over those of the cut, on so many meshes."""
    every = []
    for level, k in enumerate(given.levels[:levels]):
        stars, cut = (solve_level(replace(given, macro=macro), level) for macro in ("stars", "cut"))
        every += [stars.solved, cut.solved]
        for name, most in _OVER_CUT.items():
            quantity, over = f"{name}, error over that of the cut, k = {k}", stars.errors[name] / cut.errors[name]
            yield at_most(quantity, over, most, source="the same mesh, cut")
    yield from balanced(every)


PLANE_CELLS = ("TRIA3", "TRIA6", "QUAD4", "QUAD8", "QUAD9")
#: cells in space, and how they are cut; those on four levels first
MAIN_CELLS = (
    ("TETRA4", "pyramid"), ("TETRA10", "pyramid"), ("HEXA8", "pyramid"), ("HEXA8", "hexa"),
    ("HEXA20", "pyramid"), ("HEXA20", "hexa"), ("HEXA27", "pyramid"), ("PENTA15", "pyramid"),
)  # fmt: skip
OTHER_CELLS = tuple((name, "pyramid") for name in ("PENTA6", "PENTA18", "PYRAM5", "PYRAM13", "PYRAM14"))
#: slave cells to the half-width: in the plane, and in space by the order of the cells
_PLANE = (8, 16, 32, 64, 128)
_SPACE = {1: (8, 12, 16, 24), 2: (6, 8, 12, 16)}
_QUICK = (
    "2d-TRIA3-elastic", "2d-QUAD8-elastic", "2d-TRIA6-rigid", "axisymmetric-QUAD4-elastic",
    "axisymmetric-TRIA6-rigid", "3d-HEXA8-pyramid-elastic",
)  # fmt: skip


def _cases() -> Iterator[Case]:
    def case(given: Given, label: str, full: int, every: int, seconds: float) -> Case:
        shape = {"plane_strain": "cylinder", "axisymmetric": "sphere, axisymmetric", "3d": "sphere"}[given.model]
        words = f"{shape} on {'a rigid plane' if given.rigid else 'an elastic half-space'}, {label}"
        start = "2d" if given.model == "plane_strain" else given.model
        name = f"{start}-{label}-{'rigid' if given.rigid else 'elastic'}".replace(" ", "-")
        quick = 3 * (name in _QUICK)
        return row("hertz", name, words, outcome, given, words, quick=quick, full=full, every=every, seconds=seconds)

    for rigid in (False, True):
        for model in ("plane_strain", "axisymmetric"):
            for cell in PLANE_CELLS:
                yield case(Given(model, cell, "pyramid", rigid, _PLANE), cell, 5, 5, 6.0)
        for cell, hexa in (*MAIN_CELLS, *OTHER_CELLS):
            many, order = (cell, hexa) in MAIN_CELLS, CELLS[cell].order
            label = f"{cell} {hexa}" if cell in ("HEXA8", "HEXA20") else cell
            seconds = {1: 30.0, 2: 150.0 if many else 80.0}[order] * (0.5 if rigid else 1.0)
            yield case(Given("3d", cell, hexa, rigid, _SPACE[order]), label, 4 if many else 3, 4, seconds)
    for model, cells in (("plane_strain", ("TRIA3", "QUAD4")), ("axisymmetric", ("QUAD4",)),
                         ("3d", ("TETRA4", "HEXA8", "TETRA10"))):  # fmt: skip
        sizes, quick, full = ((8, 12), 0, 2) if model == "3d" else ((16, 32, 64), 2, 3)
        for cell in cells:
            name, words = f"{model}-{cell}-stars", f"{cell}, stars over the cut"
            given = Given(model, cell, "pyramid", False, sizes)
            yield row("hertz", name, words, over_cut, given, quick=quick, full=full, seconds=15.0)


FAMILY = Family("hertz", "Hertz, half-spaces", __doc__.partition("\n\n")[2], tuple(_cases()))
