"""Hertz's contact of finite bodies: the cylinder that contact codes are compared on, and the spheres of ssnv104.

Held against a solution of the same bodies by other finite elements (`verification.exact.finite_bodies`), 128 cells to
the half-width; Hertz's half-space is beside it, as the figures of others are measured against that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from verification.exact.finite_bodies import ALLOY, POISSON, PROFILES, PUSH, SPHERE, STEEL, Hertz, profile
from verification.measures.edge import edge_of_contact
from verification.meshes.cylinder import cylinder_on_block
from verification.meshes.spheres import spheres
from verification.pages.charts import Line, Plot
from verification.profiles import line
from verification.records import Case, Family, Outcome, Published, Result, at_most, equal, informative
from verification.solving import Solved, balanced, case_text, entry, solve

Floats = NDArray[np.floating]

#: of each level of the cylinder, and of the first of the spheres: slave faces to the half-width
SIZES, SPHERES = (4, 8, 16, 32, 64), 12
#: where pressures are compared, in parts of the half-space's half-width
INNER = 0.9
_PEERS = "benchmarks/peers.py: the same mesh, the answers measured as ours are"
_TABLE = "reference/peers.md: the same problem, against the half-space"
#: rms errors in % of peers on the same mesh against the profile "current", as they follow the deformed skins
_MEASURED = {
    "Kratos 10.4, dual mortar, augmented Lagrangian": {4: 1.129, 8: 0.441, 16: 0.223, 32: 0.280},
    "NGSolve, penalty 10 E / h": {4: 1.863, 8: 0.486, 16: 0.432, 32: 0.382},
    "GetFEM 5.4, ray tracing, order 25": {4: 5.715, 8: 2.625, 16: 0.321, 32: 0.235},
    "CalculiX, surface to surface, K = 50 E": {4: 19.383, 8: 5.493, 16: 1.079, 32: 0.356},
}
#: the least of them
BEST = {n: min(figures[n] for figures in _MEASURED.values()) for n in (4, 8, 16, 32)}
#: published, in %, against the half-space: rms of p, error of the peak
_RMS = {
    "Kratos, dual mortar": {4: 1.7, 8: 0.59, 16: 0.32, 32: 0.37},
    "CalculiX, surface to surface, K = 50 E": {4: 19.0, 8: 5.4, 16: 1.0},
    "GetFEM, ray tracing, order 25": {8: 2.9, 16: 0.44},
    "NGSolve, penalty 10": {4: 4.1, 8: 2.5, 16: 1.3},
    "CalculiX LINMORTAR (full width, nu = 0: another problem)": {4: 0.71, 8: 0.29, 16: 0.28},
}
_PEAK = {
    "Kratos, dual mortar": {4: -2.1, 8: -0.39, 16: 0.07, 32: 0.21},
    "CalculiX, surface to surface, K = 50 E": {4: 16.0, 8: 6.1, 16: 1.3},
    "GetFEM, ray tracing, order 25": {8: 0.18, 16: 0.48},
    "NGSolve, penalty 10": {4: 3.8, 8: 2.3, 16: 1.3},
    "CalculiX LINMORTAR (full width, nu = 0: another problem)": {4: -0.69, 8: -0.49, 16: -0.45},
}
_WIDTH = {"CalculiX LINMORTAR": {16: 0.08}, "NGSolve": {16: -0.09}, "Kratos": {16: -0.5}, "GetFEM": {16: 0.77}}
_WHY = (
    "the least error of a peer on this mesh, at the same nodes, against the solution of the same bodies with skins "
    "that are followed, as all of them do"
)
#: what is drawn of a pressure
_ASKED: tuple[tuple[str, Literal["given", "means"]], ...] = (("recovered", "given"), ("p_m", "means"))
_NEWTON = {"Kratos": {16: 7}, "GetFEM": {16: 11}, "NGSolve": {16: 16}, "CalculiX": {16: 12}}


@dataclass(frozen=True)
class Cylinder:
    """A cylinder of steel on a block of alloy. `geometry`: of the undeformed skins, or of the deformed ones; `surface`:
    what the gap is measured between.
    """

    geometry: str
    surface: str = "smooth"
    young: tuple[float, float] = (STEEL, ALLOY)
    poisson: float = POISSON
    push: float = PUSH
    sizes: tuple[int, ...] = SIZES

    @property
    def profile(self) -> str:
        """Name of the reference profile."""
        return "linear" if self.geometry == "reference" else "current"


@dataclass(frozen=True)
class Spheres:
    """Two like hemispheres of radius 50, of cells of a type, code_aster's figures of its twin beside ours."""

    cell: str
    twin: str
    stress: tuple[float, float]
    iterations: int
    young: float = SPHERE
    poisson: float = POISSON
    half_space: float = -2798.3
    steps: int = 10
    coarsest: int = SPHERES


class Measured(NamedTuple):
    """Errors over the half-space's peak under the same force: rms within `INNER`, at the peak, of the half-width."""

    rms: float
    peak: float
    width: float


def measured(x: Floats, p: Floats, half_space: Hertz, exact: Floats, top: float) -> Measured:
    """Errors of pressures p at distances x from the axis; `exact` (at x) and `top` are over the half-space's peak.

    The half-width is that of the pressures in the outer half of contact.
    """
    s, p = x / half_space.radius, p / half_space.peak
    rms = float(np.sqrt(np.mean((p - exact)[s <= INNER] ** 2)))
    return Measured(rms, float(p.max() / top - 1), edge_of_contact(s, p, 1.0, 0.5) - 1)


@dataclass(frozen=True, eq=False)
class MeasuredPressures:
    """Pressures of a solution over the distance from the axis: p_m at the middle of the macro-elements; the recovered
    one at the slave's `nodes`, and at those of them that the mesh had before it was cut, `given`.
    """

    solved: Solved
    half_space: Hertz
    means: tuple[Floats, Floats]
    nodes: tuple[Floats, Floats]
    given: tuple[Floats, Floats]

    @classmethod
    def of(cls, solved: Solved, half_space: Hertz, uncut: Mesh) -> MeasuredPressures:
        """Pressures on the zone `slave` of a solution."""
        zone, x = solved.fields.zones["slave"], solved.mesh.points[:, 0]
        skin = np.flatnonzero(np.isfinite(zone.pressure_recovered))
        skin = skin[np.argsort(x[skin])]
        middle = middles(solved.mesh)[zone.number]
        first, there = np.argsort(middle), skin[skin < uncut.n_nodes]
        p = zone.pressure_recovered
        means = middle[first], zone.pressure[first]
        return cls(solved, half_space, means, (x[skin], p[skin]), (x[there], p[there]))

    def against(self, name: str, at: Literal["given", "nodes", "means"] = "given") -> Measured:
        """Errors against a profile, or the `half-space`; of the recovered pressure at some nodes, or of p_m."""
        x, p = getattr(self, at)
        s = x / self.half_space.radius
        if name == "half-space":
            return measured(x, p, self.half_space, np.sqrt(np.maximum(1 - s**2, 0.0)), 1.0)
        exact = PROFILES[name]
        return measured(x, p, self.half_space, exact(s), exact.shape[0])

    def lines(self, name: str) -> tuple[Line, ...]:
        """Both pressures and the exact one over the distance, in half-space's units."""
        s = np.linspace(0, 1.3, 261)
        a, p0 = self.half_space
        return (
            line("finite bodies", s, PROFILES[name](s), "line"),
            line("p_m", self.means[0] / a, self.means[1] / p0, "points"),
            line("recovered", self.nodes[0] / a, self.nodes[1] / p0, "both"),
        )


def middles(mesh: Mesh) -> Floats:
    """Distance (n_macros,) from the axis to the middle of each undeformed macro-element of a plane mesh."""
    macro = mesh.cell_data["lac_macro"]
    faces = np.flatnonzero(macro >= 0)
    ends = np.concatenate([mesh.points[nodes[:, :2]] for _, _, nodes in mesh.select(faces)])
    own = np.concatenate([macro[cells] for _, cells, _ in mesh.select(faces)])
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    total = np.bincount(own, length)
    return np.asarray(np.bincount(own, length * ends[:, :, 0].mean(axis=1)) / total)


def solve_cylinder(given: Cylinder, *, levels: int) -> Outcome:
    """The cylinder on the block."""
    measured = {n: pushed(given, n) for n in given.sizes[:levels]}
    results: list[Result] = []
    for n, own in measured.items():
        results += errors(given, n, own)
    n = 16 if 16 in measured else max(measured)
    width = measured[n].against("half-space").width
    results += [
        informative(f"half-width against the half-space's, N = {n}", width,
                 reason="the half-space has no edge of finite bodies", published=_published(_WIDTH, n)),
        informative(f"Newton iterations, N = {n}", measured[n].solved.iterations,
                 reason="one load step; others stop at other tolerances", published=_published(_NEWTON, n, 1.0)),
    ]  # fmt: skip
    pressure = Plot("pressure", f"Cylinder on a block, N = {n}", "x / a", "p / p0", measured[n].lines(given.profile))
    every = [own.solved for own in measured.values()]
    return Outcome((*results, *balanced(every)), (pressure, falling(given, measured)))


def pushed(given: Cylinder, n: int) -> MeasuredPressures:
    """The cylinder on the mesh of n faces to the half-width."""
    bodies = zip(("upper", "lower"), given.young, strict=True)
    text = case_text(
        "plane_strain",
        *(entry("material", groups=[group], young=young, poisson=given.poisson) for group, young in bodies),
        entry("contact", slave="slave", master="master", geometry=given.geometry, surface=given.surface),
        entry("displacement", group="bottom", ux=0.0, uy=0.0),
        entry("displacement", group="x0", ux=0.0),
        entry("displacement", group="top", uy=-given.push),
    )
    mesh = cylinder_on_block(n)
    solved = solve(text, mesh)
    force = 2 * abs(float(solved.figures.contact["slave"].resultant[1]))
    return MeasuredPressures.of(solved, Hertz.plane(force), mesh)


def errors(given: Cylinder, n: int, own: MeasuredPressures) -> tuple[Result, ...]:
    """Judged error of the recovered pressure, against the best peer's, and the reported errors beside it."""
    misfit = {at: own.against(given.profile, at) for at in ("given", "nodes", "means")}
    half_space = own.against("half-space")
    theirs = tuple(Published(who, f[n] / 100, _PEERS) for who, f in _MEASURED.items() if n in f)
    rms = f"rms error of the recovered pressure, N = {n}"
    if n in BEST:
        first = at_most(rms, misfit["given"].rms, BEST[n] / 100, source=_PEERS, reason=_WHY, published=theirs)
    else:
        first = informative(rms, misfit["given"].rms, reason="no peer ran this mesh")
    against = f"of the recovered pressure against the half-space, N = {n}"
    bodies = "Hertz's half-space is not these bodies; the peers' published figures"
    return (
        first,
        informative(
            f"the same at all slave nodes, N = {n}", misfit["nodes"].rms, reason="the cut adds two nodes to a face"
        ),
        informative(f"rms error of p_m, N = {n}", misfit["means"].rms, reason="peers have no means", published=theirs),
        informative(f"rms error {against}", half_space.rms, reason=bodies, published=_published(_RMS, n)),
        informative(f"error of the peak {against}", half_space.peak, reason=bodies, published=_published(_PEAK, n)),
    )


def falling(given: Cylinder, measured: Mapping[int, MeasuredPressures]) -> Plot:
    """Errors over the mesh, ours and the peers'."""
    sizes = np.array(list(measured))
    ours = [line(label, sizes, np.array([own.against(given.profile, at).rms for own in measured.values()]), "both")
            for label, at in _ASKED]  # fmt: skip
    peers = [line(who, np.array(list(f)), np.array(list(f.values())) / 100, "both") for who, f in _MEASURED.items()]
    return Plot(
        "convergence", "Cylinder on a block: rms error of the pressure", "faces to the half-width", "error over peak",
        (*ours, *peers), log_x=True, log_y=True,
    )  # fmt: skip


def solve_spheres(given: Spheres, *, levels: int) -> Outcome:
    """The spheres, each level of cells half as large."""
    every = [pressed(given, given.coarsest << level) for level in range(levels)]
    results = [result for n, own in _numbered(given, every) for result in axis_stress(given, n, own)]
    first = every[0].solved
    results.append(
        at_most("Newton iterations", first.iterations, given.iterations,
                source=f"reference/peers.md: code_aster {given.twin}, {given.steps} steps",
                reason="the same steps on cells of the size of its mesh; ours also ends at a tighter tolerance")
    )  # fmt: skip
    results.append(at_most("halved steps", first.halvings, 0, source="the steps that are given"))
    n = given.coarsest << (levels - 1)
    plot = Plot("pressure", f"Two spheres, {given.cell}, N = {n}", "r / a", "p / p0", every[-1].lines("spheres"))
    picture = every[0].solved.picture(f"Two spheres, {given.cell}")
    return Outcome((*results, *balanced([own.solved for own in every])), (plot,), (picture,))


def _numbered(given: Spheres, every: Sequence[MeasuredPressures]) -> list[tuple[int, MeasuredPressures]]:
    return [(given.coarsest << level, own) for level, own in enumerate(every)]


def pressed(given: Spheres, n: int) -> MeasuredPressures:
    """The spheres with n faces to a radius of 10."""
    text = case_text(
        "axisymmetric",
        entry("material", young=given.young, poisson=given.poisson),
        entry("contact", slave="slave", master="master", normals="smoothed", geometry="current",
              surface="faces"),  # as code_aster's are
        entry("displacement", group="up", uy=-2.0), entry("displacement", group="down", uy=2.0),
        entry("displacement", group="axis", ux=0.0), entry("steps", count=given.steps),
    )  # fmt: skip
    mesh = spheres(given.cell, n)
    solved = solve(text, mesh)
    return MeasuredPressures.of(solved, Hertz.round(abs(float(solved.figures.contact["slave"].resultant[1]))), mesh)


def axis_stress(given: Spheres, n: int, own: MeasuredPressures) -> tuple[Result, ...]:
    """Normal stress of both bodies where the axis meets the skins, against the half-space and against the same bodies;
    what the pressures are off by.
    """
    fields, errors = own.solved.fields, own.against("spheres")
    pole = np.isfinite(fields.stress[:, 1]) & (np.abs(own.solved.mesh.points).max(axis=1) < 1e-9)
    stress, reference = fields.stress[pole, 1], PROFILES["spheres"]
    exact = -reference.shape[0] * Hertz.round(reference.force).peak
    worst, theirs = (float(np.abs(np.array(v) / exact - 1).max()) for v in (stress, given.stress))
    code_aster = tuple(Published(f"code_aster {given.twin}", v, "reference/cases.json") for v in given.stress)
    bodies = f"{exact:.1f}: the same bodies by other finite elements, 128 cells to the radius of contact"
    more = "nobody published it"
    return (
        *(
            equal(
                f"normal stress on the axis, point {k}, N = {n}",
                value,
                given.half_space,
                0.05 * abs(given.half_space),
                source=f"Hertz's half-space, the analytic value of code_aster's {given.twin}",
                reason="code_aster's own tolerance, as its bodies are finite: they are 4.0 % above the half-space",
                published=code_aster,
            )
            for k, value in enumerate(stress, 1)
        ),
        at_most(
            f"error of the normal stress on the axis, N = {n}",
            worst,
            theirs,
            source=bodies,
            reason="the worse of two points; of code_aster's too, on its mesh, of cells as large on the first level",
        ),
        informative(f"error of the recovered pressure on the axis, N = {n}", own.nodes[1][0] / -exact - 1, reason=more),
        informative(f"rms error of the recovered pressure, N = {n}", errors.rms, reason=more),
        informative(f"rms error of p_m, N = {n}", own.against("spheres", "means").rms, reason=more),
    )


def compare_profiles(n: int = 64, *, levels: int) -> Outcome:
    """Compare the stored profiles with ones of `n` cells to the half-width computed now, to estimate their accuracy."""
    s = np.linspace(0, INNER, 91)
    results, plots = [], []
    for name, kept in PROFILES.items():
        computed = profile(name, n)
        off = float(np.abs(computed(s) - kept(s)).max())
        results.append(
            at_most(f"profile {name}: kept against {n} cells", off, 5e-4,
                    source="verification.exact.finite_bodies, 128 cells to the half-width",
                    reason="a fifth of the least error that it is to measure, 0.22 %")
        )  # fmt: skip
        space = np.sqrt(1 - s**2)
        plots.append(line(name, s, 100 * (kept(s) - space), "line"))
    title = "Finite bodies against the half-space"
    return Outcome(tuple(results), (Plot("pressure", title, "x / a", "difference, % of the peak", tuple(plots)),))


def _published(of: Mapping[str, Mapping[int, float]], n: int, unit: float = 100.0) -> tuple[Published, ...]:
    return tuple(Published(who, figures[n] / unit, _TABLE) for who, figures in of.items() if n in figures)


TEXT = """
Bodies of finite size, as engineers mesh them. *The cylinder*: steel, of radius 50, on a block of alloy, plane strain,
pushed by 0.2; N slave faces to the half-width, the mesh that other contact codes ran (`reference/peers.md`). *The
spheres*: code_aster's ssnv104 k and l, two hemispheres whose flats are moved towards one another by 4 in ten steps.

**What the pressure is held against.** Not the half-space, from which these bodies differ by 0.17 %, but the same
bodies solved by other finite elements, written in `verification/exact/finite_bodies.py` with numpy and scipy alone:
QUAD4 with 128 cells to the half-width, whose nodes meet, so that contact is a linear complementarity problem. It has
two answers, which differ by 0.2 % and are both right to first order: of the linear theory (`linear`, gaps of the
undeformed skins along the normal of the plane, as Hertz's), and with the deformed skins followed (`current`). Each case
is held against its own.

**What the peers are held against.** Their published errors are against the half-space. The same programs were run again
by `benchmarks/peers.py` and their pressures measured against `current`, as they follow the deformed skins; the least of
these errors on each mesh is what ours must not exceed. Pressures are measured under their own force, within 0.9 of the
half-width, at the slave's nodes before the cut (NGSolve: means of faces).
"""

FAMILY = Family(
    "hertz-engineering",
    "Hertz's contact of finite bodies",
    TEXT,
    (
        Case("hertz-engineering", "cylinder", "a cylinder on a block, linear theory",
             partial(solve_cylinder, Cylinder("reference")), {"quick": 2, "full": 4, "all": 5}, 15),
        Case("hertz-engineering", "cylinder_current", "the same, deformed skins followed",
             partial(solve_cylinder, Cylinder("current")),
             {"full": 4, "all": 5}, 40),
        Case("hertz-engineering", "ssnv104k", "two spheres, TRIA3",
             partial(solve_spheres, Spheres("TRIA3", "ssnv104k", (-2868.94105333, -2888.31508848), 77)),
             {"full": 2, "all": 3}, 40),
        Case("hertz-engineering", "ssnv104l", "two spheres, TRIA6",
             partial(solve_spheres, Spheres("TRIA6", "ssnv104l", (-2910.23188455, -2912.21233959), 69)),
             {"full": 2, "all": 3}, 60),
        Case("hertz-engineering", "reference", "the solutions that these are held against, made again",
             partial(compare_profiles), {"full": 1}, 60),
    ),
)  # fmt: skip
