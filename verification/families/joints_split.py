"""**Cracks.** A crack is faces inside a body along which the mesh is split (`lacmesh split`), a contact, and here a
pressure that opens it. *edge*: the tip of an edge crack, the term of a stress intensity (opening as sqrt r) or the next
one (a cusp), so that the rates are those of the cells. *penny*: a penny-shaped crack, axisymmetric and in space. What
lies beyond the mesh is prescribed by the exact solution.

**Bolts.** *clamped*: a bolt of columns (nu = 0) beside two columns that it clamps, all cells: tightened by F0 and
locked, it has F0 + F kb / (kb + kc) under a load F until the columns part, F after it. *turned*: the same by a
prescribed shortening, across a section between meshes that do not match, too. *bent*: forces across the bolt, and the
moments of its section.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import lacsolver
from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacsolver.case import Displacement, Traction, Value
from verification.exact.opened_cracks import EdgeCrack, PennyCrack
from verification.meshes import cracks as meshes
from verification.meshes.blocks import BLOCK_TYPES, block, joined
from verification.records import Case, Rows, at_most, informative, problem, rate, row
from verification.solving import LevelSolution, Solved, balanced, case_text, convergence, entry, solve, with_motions

Floats = NDArray[np.floating]
#: forces of columns, to rounding
ROUNDING = 1e-10
#: power of h that the opening r^(n/2) reaches, less what its logarithm takes on these meshes
RATES = {1: 0.6, 3: 1.5}
#: cells along a crack, by the order of the cells
_SIZES = {1: (8, 16, 32), 2: (4, 8, 16)}


# ---- cracks


@problem
def solve_edge(cell: str, sizes: tuple[int, ...], exact: EdgeCrack, wanted: float, *, levels: int) -> Rows:
    """An edge crack in cells of one type, of `sizes` cells along it."""
    yield from _judged([_edge(cell, exact, n) for n in sizes[:levels]], wanted)


def _edge(cell: str, exact: EdgeCrack, n: int) -> LevelSolution:
    dim = CELLS[cell].dim

    def moved(k: int) -> Value:
        return Value.of(lambda x, t: exact.displacement(np.asarray(x)[:, :2])[:, k])

    def pulled(k: int) -> Value:
        which = ((0, 2), (2, 1))[k]
        return Value.of(lambda x, normal, t: (exact.stress(np.asarray(x)[:, :2])[:, which] * normal[:, :2]).sum(axis=1))

    text = case_text(
        "plane_strain" if dim == 2 else "3d",
        entry("material", young=exact.young, poisson=exact.poisson),
        entry("contact", slave="crack_a", master="crack_b"),
        entry("pressure", group="crack", value=exact.pressure),
    )
    supports = [Displacement(group=side, ux=moved(0), uy=moved(1)) for side in ("x1", "y0", "y1")]
    supports += [Displacement(group=side, uz=0.0) for side in ("z0", "z1")] if dim == 3 else []
    mouth = Traction(group="x0", tx=replace(pulled(0), takes_normals=True), ty=replace(pulled(1), takes_normals=True))
    model = replace(lacsolver.parse_case(text), displacement=tuple(supports), traction=(mouth,))
    one = solve(model, meshes.split_at(meshes.edge_cracked(cell, n), "crack"))
    x, opening = _openings(one, 1)
    return _level(one, n, opening, exact.opening(-x[:, 0]), np.ones(len(x)))


@problem
def solve_penny(cell: str, sizes: tuple[int, ...], *, levels: int) -> Rows:
    """A penny-shaped crack, axisymmetric in cells of one type or in space, of `sizes` cells along its radius."""
    yield from _judged([_penny(cell, PennyCrack(), n) for n in sizes[:levels]], RATES[1])


def _penny(cell: str, exact: PennyCrack, n: int) -> LevelSolution:
    dim = CELLS[cell].dim

    def moved(x: Floats, t: float) -> Floats:
        r = np.hypot(x[:, 0], x[:, 1]) if dim == 3 else x[:, 0]
        u = exact.displacement(r, x[:, dim - 1])
        if dim == 2:
            return u
        aside = np.divide(x[:, :2], r[:, None], out=np.ones((len(x), 2)), where=r[:, None] > 0)
        return np.column_stack([u[:, :1] * aside, u[:, 1]])

    text = case_text(
        "axisymmetric" if dim == 2 else "3d",
        entry("material", young=exact.young, poisson=exact.poisson),
        entry("contact", slave="crack_a", master="crack_b"),
        entry("pressure", group="crack", value=exact.pressure),
        *(entry("displacement", group=f"{axis}0", **{f"u{axis}": 0.0}) for axis in "xy"[: dim - 1]),
    )
    mesh = meshes.penny(cell, n) if dim == 2 else meshes.penny_in_space(n)
    model = with_motions(text, dict.fromkeys(("x1", "y0", "y1") if dim == 2 else ("far",), moved))
    one = solve(model, meshes.split_at(mesh, "crack"))
    x, opening = _openings(one, dim - 1)
    r = np.hypot(x[:, 0], x[:, 1]) if dim == 3 else x[:, 0]
    return _level(one, n, opening, exact.opening(r), r if dim == 2 else np.ones(len(r)))


def _openings(one: Solved, axis: int) -> tuple[Floats, Floats]:
    """Places (n, 3) of the nodes that a crack has on both sides, and its opening along an axis there (n,)."""
    mesh, u = one.mesh, one.u[:, axis]
    sides = []
    for name in ("crack_a", "crack_b"):
        nodes = mesh.nodes_on(mesh.cells_of(name))
        sides.append({tuple(np.round(mesh.points[node], 9).tolist()): int(node) for node in nodes})
    both = [(sides[0][place], sides[1][place]) for place in sides[0].keys() & sides[1].keys()]
    a, b = np.array(both).T
    return mesh.points[a], np.abs(u[b] - u[a])


def _level(one: Solved, n: int, opening: Floats, exact: Floats, weight: Floats) -> LevelSolution:
    """Relative error of the opening at the nodes, in the square mean, and the largest pressure of contact."""
    error = float(np.sqrt((weight * (opening - exact) ** 2).sum() / (weight * exact**2).sum()))
    return LevelSolution(one, 1 / n, {"opening": error, "pressure": float(one.zone.pressure.max())})


def _judged(solutions: list[LevelSolution], wanted: float) -> Rows:
    reason = "the opening is r^(n/2): h^n sqrt(log(1 / h)), as errors fall with 1 / sqrt(r) from the front"
    levels = convergence(solutions, "opening")
    yield rate("opening at the nodes", levels, wanted, source="regularity at the front", reason=reason, last=3)
    yield informative("relative error of the opening on the finest mesh", levels[-1].error, reason="no bound")
    yield at_most("pressure of contact", max(s.errors["pressure"] for s in solutions), 0.0, source="it is open")


# ---- bolts


@problem
def solve_clamped(
    cell: str, locked: bool = True, halves: bool = False, young: float = 1000.0, force: float = 10.0
) -> Rows:
    """A bolt and the columns that it clamps; `halves`: its section lies between two meshes; `locked`: by a force.
    Tighten, then pull with 0, F0, 2 F0 and 3 F0: the columns part at 2 F0, as both are as stiff as the bolt.
    """
    dim, F = CELLS[cell].dim, force
    stiffness = young / 2
    text = case_text(
        "3d" if dim == 3 else "plane_stress",
        entry("material", young=young, poisson=0.0),
        entry("contact", slave="slave", master="master"),
        entry("displacement", group="foot", **dict.fromkeys(("ux", "uy", "uz")[:dim], 0.0)),
        entry(
            "rigid", group="head", **dict.fromkeys(("ux", "uy")[: dim - 1], 0.0),
            **{"fy" if dim == 2 else "fz": [[0.0, 0.0], [1.0, 0.0], [4.0, 3 * F]]},
        ),
        entry("pretension", group="shank", force=[[0.0, 0.0], [1.0, F]], lock=1.0)
        if locked
        else entry("pretension", group="shank", shortening=[[0.0, 0.0], [1.0, 2 * F / stiffness]]),
        entry("steps", times=[1.0, 2.0, 3.0, 4.0]),
    )  # fmt: skip
    one = solve(text, meshes.clamped(cell, (2, 2, 3), halves=halves))
    states = [replace(one, states=one.states[: k + 1]).figures for k in range(4)]
    off = [states[k].pretension["shank"].force / wanted - 1 for k, wanted in enumerate((F, 1.5 * F, 2 * F, 3 * F))]
    clamp = [-states[k].contact["slave"].resultant[-1] - wanted for k, wanted in enumerate((F, F / 2, 0, 0))]
    source = "F0 + F kb / (kb + kc) until the columns part, F after it"
    yield at_most("relative error of the bolt's force", np.abs(off).max(), ROUNDING, source=source)
    yield at_most("error of the clamping force over F0", np.abs(clamp).max() / F, ROUNDING, source=source)
    yield from balanced([one])


@problem
def solve_bent(cell: str, halves: bool, force: tuple[float, float, float] = (0.3, 0.2, 5.0)) -> Rows:
    """A bolt 1 wide and 3 high, fixed below, with a section at the height 1 and forces on its end. The section carries
    what acts beyond it: forces, and their moments about its centre.
    """
    dim = CELLS[cell].dim
    pull = np.array(force)[[0, 2] if dim == 2 else [0, 1, 2]]
    text = case_text(
        "3d" if dim == 3 else "plane_strain",
        entry("material", young=1000.0, poisson=0.3),
        entry("displacement", group="foot", **dict.fromkeys(("ux", "uy", "uz")[:dim], 0.0)),
        entry("traction", group="end", **dict(zip(("tx", "ty", "tz"), pull.tolist(), strict=False))),
        entry("pretension", group="shank", shortening=0.01),
    )
    one = solve(text, _beam(cell, halves))
    bolt = one.figures.pretension["shank"]
    side = np.sign(one.problem.sections[0].normal[-1])
    exact = np.cross([0.0, 0.0, 2.0], force) if dim == 3 else np.array(-2.0 * force[0])
    assert bolt.moment is not None
    for name, error in (
        ("force across and along the bolt", np.abs(side * bolt.resultant - pull).max() / force[2]),
        ("moment of the section", np.abs(side * bolt.moment - exact).max() / np.abs(exact).max()),
        ("shortening", abs(bolt.shortening / 0.01 - 1)),
    ):
        yield at_most(f"error of the {name}", error, 1e-9, source="equilibrium")


def _beam(kind: str, halves: bool) -> Mesh:
    dim = CELLS[kind].dim
    up, across = "xyz"[dim - 1], [0.0] * (dim - 1)
    ends = [1.0] * (dim - 1)
    if halves:
        low, high = block(kind, 2, (*across, 0.0), (*ends, 1.0)), block(kind, 3, (*across, 1.0), (*ends, 3.0))
        return joined([
            (low, {"": "low", f"{up}0": "foot", f"{up}1": "shank_a"}),
            (high, {"": "high", f"{up}0": "shank_b", f"{up}1": "end"}),
        ])  # fmt: skip
    mesh = joined([(block(kind, 3, (*across, 0.0), (*ends, 3.0)), {"": "bolt", f"{up}0": "foot", f"{up}1": "end"})])
    return meshes.with_inner(mesh, "shank", lambda *x: np.abs(x[dim - 1] - 1) < 1e-9)


def cases(family: str) -> Iterator[Case]:
    """Cases of this module."""
    plane, space = ("TRIA3", "QUAD4", "TRIA6", "QUAD8", "QUAD9"), ("TETRA4", "HEXA8", "PENTA6", "HEXA20", "TETRA10")
    for n, called, what in ((1, "edge", "of a stress intensity"), (3, "cusp", "that opens as a cusp")):
        for cell in (*plane, *space):
            sizes, quick = _SIZES[CELLS[cell].order], 3 * (cell in ("QUAD4", "TRIA6"))
            case = (solve_edge, cell, sizes, EdgeCrack(n), RATES[n])
            yield row(family, f"{called}-{cell}", f"edge crack {what}, {cell}", *case, quick=quick, full=3, seconds=6.0)
    for cell in ("TRIA3", "QUAD4", "QUAD8", "TRIA6"):
        words, given = f"penny-shaped crack, axisymmetric, {cell}", (cell, _SIZES[CELLS[cell].order])
        yield row(family, f"penny-{cell}", words, solve_penny, *given, quick=3 * (cell == "QUAD4"), full=3, seconds=6.0)
    words = "penny-shaped crack in space"
    yield row(family, "penny-HEXA20", words, solve_penny, "HEXA20", (2, 3, 4), full=3, seconds=30.0)
    for cell in BLOCK_TYPES:
        suites = {"quick": int(cell in ("QUAD4", "TETRA10", "HEXA8")), "full": 1}
        yield row(family, f"clamped-{cell}", f"a locked bolt and what it clamps, {cell}", solve_clamped, cell, **suites)
        for halves, name, where in ((False, "whole", "inside"), (True, "halves", "between meshes")):
            name, words = f"{name}-{cell}", f"a bolt shortened at a section {where}, {cell}"
            yield row(family, f"turned-{name}", words, solve_clamped, cell, False, halves, **suites)
            words = f"a bent bolt, its section {where}, {cell}"
            yield row(family, f"bent-{name}", words, solve_bent, cell, halves, **suites)
