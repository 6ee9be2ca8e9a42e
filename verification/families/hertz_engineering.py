"""Hertz's contact of finite bodies: the cylinder that contact codes are compared on, and the spheres of ssnv104.

Bodies of finite size, as engineers mesh them. *The cylinder*: steel, of radius 50, on a block of alloy, plane strain,
pushed by 0.2; N slave faces to the half-width, the mesh that other contact codes ran (`reference/peers.md`). *The
spheres*: code_aster's ssnv104 k and l, two hemispheres whose flats are moved towards one another by 4 in ten steps.

**The reference of the pressures** is not the half-space, from which these bodies differ by 0.17 %, but the same bodies
solved by other finite elements, written in `data/provenance/finite_bodies.py` with numpy and scipy alone: QUAD4 with
128 cells to the half-width, whose nodes meet, so that contact is a linear complementarity problem. It has two answers,
which differ by 0.2 % and are both right to first order: of the linear theory (`linear`, gaps of the undeformed skins
along the normal of the plane, as Hertz's), and with the deformed skins followed (`current`). Each case is compared with
its own.

**The bounds are errors of peers.** Their published errors are against the half-space (`docs/benchmarks.md`). The same
programs were run again by `benchmarks/peers.py` and their pressures measured against `current`, as they follow the
deformed skins; the least of these errors on each mesh is what ours must not exceed. Pressures are measured under their
own force, within 0.9 of the half-width, at the slave's nodes before the cut (NGSolve: means of faces).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from verification.exact.finite_bodies import ALLOY, POISSON, PROFILES, PUSH, SPHERE, STEEL, Hertz, Profile
from verification.meshes.cylinder import cylinder_on_block
from verification.meshes.spheres import spheres
from verification.records import Family, Published, Rows, at_most, equal, informative, problem, row
from verification.solving import Solved, balanced, case_text, contact, entry, fixed, material, solve

Floats = NDArray[np.floating]

#: of each level of the cylinder, and of the first of the spheres: slave faces to the half-width
SIZES, SPHERES = (4, 8, 16, 32, 64), 12
#: of the spheres: normal stress of the half-space on the axis, and load steps
HALF_SPACE, STEPS = -2798.3, 10
#: where pressures are compared, in parts of the half-space's half-width
INNER = 0.9
_PEERS = "benchmarks/peers.py: the same mesh, the answers measured as ours are"
#: rms errors in % of peers on the same mesh against the profile "current", as they follow the deformed skins
_MEASURED = {
    "Kratos 10.4, dual mortar, augmented Lagrangian": {4: 1.129, 8: 0.441, 16: 0.223, 32: 0.280},
    "NGSolve, penalty 10 E / h": {4: 1.863, 8: 0.486, 16: 0.432, 32: 0.382},
    "GetFEM 5.4, ray tracing, order 25": {4: 5.715, 8: 2.625, 16: 0.321, 32: 0.235},
    "CalculiX, surface to surface, K = 50 E": {4: 19.383, 8: 5.493, 16: 1.079, 32: 0.356},
}
#: the least of them
BEST = {n: min(figures[n] for figures in _MEASURED.values()) for n in (4, 8, 16, 32)}
_WHY = (
    "the least error of a peer on this mesh, at the same nodes, against the solution of the same bodies with skins "
    "that are followed, as all of them do"
)


def rms_error(x: Floats, p: Floats, half_space: Hertz, profile: Profile) -> float:
    """Rms error, within `INNER`, of pressures p at distances x from the axis, over the half-space's peak."""
    s = x / half_space.radius
    return float(np.sqrt(np.mean((p / half_space.peak - profile(s))[s <= INNER] ** 2)))


def recovered(solved: Solved, uncut: Mesh) -> tuple[Floats, Floats]:
    """Distance from the axis and recovered pressure of the slave's nodes that the mesh had before it was cut."""
    p = solved.recovered[: uncut.n_nodes]
    given = np.flatnonzero(np.isfinite(p))
    return solved.mesh.points[given, 0], p[given]


@problem
def solve_cylinder(geometry: str, *, levels: int) -> Rows:
    """The cylinder of steel on a block of alloy; `geometry`: of the undeformed skins, or of the deformed ones."""
    every, reference = [], PROFILES["linear" if geometry == "reference" else "current"]
    for n in SIZES[:levels]:
        mesh = cylinder_on_block(n)
        solved = solve(_cylinder_text(geometry), mesh)
        half_space = Hertz.plane(2 * abs(float(solved.figures.contact["slave"].resultant[1])))
        rms = rms_error(*recovered(solved, mesh), half_space, reference)
        theirs = tuple(Published(who, f[n] / 100, _PEERS) for who, f in _MEASURED.items() if n in f)
        name = f"rms error of the recovered pressure, N = {n}"
        if n in BEST:
            yield at_most(name, rms, BEST[n] / 100, source=_PEERS, reason=_WHY, published=theirs)
        else:
            yield informative(name, rms, reason="no peer ran this mesh")
        every.append(solved)
    yield from balanced(every)


def _cylinder_text(geometry: str) -> str:
    return case_text(
        "plane_strain",
        *(entry("material", groups=[group], young=young, poisson=POISSON)
          for group, young in (("upper", STEEL), ("lower", ALLOY))),
        contact(geometry=geometry, surface="smooth"),
        fixed("bottom", "xy"),
        fixed("x0", "x"),
        entry("displacement", group="top", uy=-PUSH),
    )  # fmt: skip


@problem
def solve_spheres(cell: str, twin: str, stress: tuple[float, float], iterations: int, *, levels: int) -> Rows:
    """Two like hemispheres of cells of a type, half as large on each level: normal stress of both bodies where the axis
    meets the skins, against the half-space and against the same bodies; errors of the pressures. `twin`: the test of
    code_aster, with its `stress` and `iterations`.
    """
    text = case_text(
        "axisymmetric",
        material(SPHERE, POISSON),
        contact(normals="smoothed", geometry="current",
              surface="faces"),  # as code_aster's are
        entry("displacement", group="up", uy=-2.0), entry("displacement", group="down", uy=2.0),
        fixed("axis", "x"), entry("steps", count=STEPS),
    )  # fmt: skip
    every, reference = [], PROFILES["spheres"]
    exact = -reference.shape[0] * Hertz.round(reference.force).peak
    code_aster = tuple(Published(f"code_aster {twin}", v, "reference/cases.json") for v in stress)
    for n in (SPHERES << level for level in range(levels)):
        mesh = spheres(cell, n)
        solved = solve(text, mesh)
        every.append(solved)
        half_space = Hertz.round(abs(float(solved.figures.contact["slave"].resultant[1])))
        stresses, rms = solved.fields.stress[:, 1], rms_error(*recovered(solved, mesh), half_space, reference)
        pole = np.isfinite(stresses) & (np.abs(solved.mesh.points).max(axis=1) < 1e-9)
        for k, value in enumerate(stresses[pole], 1):
            yield equal(
                f"normal stress on the axis, point {k}, N = {n}", value, HALF_SPACE, 0.05 * abs(HALF_SPACE),
                source=f"Hertz's half-space, the analytic value of code_aster's {twin}", published=code_aster,
                reason="code_aster's own tolerance, as its bodies are finite: they are 4.0 % above the half-space",
            )  # fmt: skip
        worst, theirs = (float(np.abs(np.array(v) / exact - 1).max()) for v in (stresses[pole], stress))
        yield at_most(
            f"error of the normal stress on the axis, N = {n}", worst, theirs,
            source=f"{exact:.1f}: the same bodies by other finite elements, 128 cells to the radius of contact",
            reason="the worse of two points; of code_aster's too, on its mesh, of cells as large on the first level",
        )  # fmt: skip
        reason = "nobody published it"
        yield informative(f"rms error of the recovered pressure, N = {n}", rms, reason=reason)
    yield at_most(
        "Newton iterations", every[0].iterations, iterations,
        source=f"reference/peers.md: code_aster {twin}, {STEPS} steps",
        reason="the same steps on cells of the size of its mesh; ours also ends at a tighter tolerance",
    )  # fmt: skip
    yield at_most("halved steps", every[0].halvings, 0, source="the steps that are given")
    yield from balanced(every)
    yield every[0].picture(f"Two spheres, {cell}")


_NAME = "hertz-engineering"
FAMILY = Family(
    _NAME,
    "Hertz's contact of finite bodies",
    __doc__.partition("\n\n")[2],
    (
        row(_NAME, "cylinder", "a cylinder on a block, linear theory", solve_cylinder, "reference",
            quick=2, full=4, every=5, seconds=15.0),
        row(_NAME, "cylinder_current", "the same, deformed skins followed", solve_cylinder, "current",
            full=4, every=5, seconds=40.0),
        row(_NAME, "ssnv104k", "two spheres, TRIA3", solve_spheres,
            "TRIA3", "ssnv104k", (-2868.94105333, -2888.31508848), 77, full=2, every=3, seconds=40.0),
        row(_NAME, "ssnv104l", "two spheres, TRIA6", solve_spheres,
            "TRIA6", "ssnv104l", (-2910.23188455, -2912.21233959), 69, full=2, every=3, seconds=60.0),
    ),
)  # fmt: skip
