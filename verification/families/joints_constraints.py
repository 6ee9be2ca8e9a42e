"""**Couplings.** *spread*: a force and a moment at a point, spread over a side by weights, have their resultant and
moment. *pulled*: a body that is pulled through a distributing coupling strains as under the same tractions. *turned*: a
body whose side is turned by a large angle, by a coupling alone, in steps or at once, is turned as a whole, without
strain.

**Sectors.** *ring*: a sector with sides that match against the whole ring, under a load without any other symmetry.
*growth*: an even growth, across sides that do not match. *disc*: a rotating disc by sectors against the exact solution,
matching and not. *fit*: a press fit by sectors, whose contact touches the sides, against Lame. A quarter has sides
along the axes, as its supports in cylindrical axes have there but for round-off.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacsolver.problem.resultants import resultants
from verification.exact.lame import Disc, Fit, Shell
from verification.measures.norms import displacement_error
from verification.meshes.blocks import block
from verification.meshes.sectors import fitted, sector, whole
from verification.records import Case, Rows, at_most, problem, rate, row
from verification.solving import LevelSolution, case_text, convergence, entry, model_of, solve

Floats = NDArray[np.floating]
#: rounding of sums of forces, and of solutions
EXACT, SOLVED = 1e-12, 1e-10
SECTORS = 6
_STEEL = {"young": 100.0, "poisson": 0.3}
_FINITE = {"law": "neo_hookean"}


# ---- couplings


@problem
def solve_spread(cell: str, kinematics: str, weights: str | None = "1 + x + y**2") -> Rows:
    """A force and a moment at a point, spread by `weights` over a side of a block of a cell type. Solve under the
    loads: what the load is, and what the support carries, about the place of the point.
    """
    dim, point, F, M = _loads(cell)
    moment = M.tolist() if dim == 3 else float(M[0])
    load = _coupling(dim, at=point.tolist(), weights=weights, moment=moment, **_components("f", F))
    one = solve(_block_text(cell, kinematics, load), _block(cell))
    (total,) = resultants(one.problem.loads, 1.0, one.state.u)
    coupling, reaction = next(iter(one.figures.couplings.values())), next(iter(one.figures.reactions.values()))
    size = float(np.abs(F).max())
    source = "the forces add up to the load at the point, whatever the weights"
    off = np.abs(np.array(total.force) - F).max() / size
    yield at_most("error of the resultant of the load", off, EXACT, source=source)
    off = np.abs(coupling.moment - M).max() / np.abs(M).max()
    yield at_most("error of the moment of the load about the displaced point", off, EXACT, source=source)
    off = np.abs(reaction + F).max() / size
    yield at_most("error of the support's force", off, 1e-9, source="equilibrium")


@problem
def solve_pulled(cell: str, kinematics: str) -> Rows:
    """A block of a cell type, pulled by a traction, and by a coupling with the same force: one solution."""
    dim, _, F, _ = _loads(cell)
    traction = entry("traction", group=f"{'xyz'[dim - 1]}1", **_components("t", F))
    coupling = _coupling(dim, **_components("f", F))
    one, other = (solve(_block_text(cell, kinematics, how), _block(cell)) for how in (traction, coupling))
    error = np.abs(other.u - one.u).max() / np.abs(one.u).max()
    yield at_most("difference of the displacements", error, SOLVED, source="weights of the area's shape functions")


@problem
def solve_turned(cell: str, weights: str | None = None, count: int = 4) -> Rows:
    """A block of a cell type, fixed by one side alone, which is turned by large angles in `count` steps. The body turns
    as a whole, without energy.
    """
    dim, point, _, _ = _loads(cell)
    theta = [1.5, -1.2, 0.9] if dim == 3 else 2.5
    moved = _components("u", [0.5] * dim)
    turn = _coupling(dim, at=point.tolist(), rotation=theta, weights=weights, **moved)
    one = solve(_block_text(cell, "finite", turn, entry("steps", count=count), fixed=False), _block(cell))
    arm = one.mesh.points.copy()
    arm[:, :dim] -= point
    wanted = (arm @ _rotation(np.atleast_1d(theta)).T - arm)[:, :dim] + 0.5
    yield at_most("largest error of a displacement", np.abs(one.u - wanted).max(), 1e-11, source="a rotation")
    yield at_most("strain energy over young", one.figures.energy / _STEEL["young"], 1e-20, source="no strain")


def _rotation(theta: Floats) -> Floats:
    """Rotation by a vector (3,), or about z by an angle (1,), by Rodrigues' formula."""
    full = theta if len(theta) == 3 else np.array([0.0, 0.0, theta[0]])
    angle = float(np.linalg.norm(full))
    x, y, z = full / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def _coupling(dim: int, **keys: object) -> str:
    """A coupling of the upper side of a block."""
    return entry("coupling", group=f"{'xyz'[dim - 1]}1", **keys)


def _components(letter: str, values: Iterable[float]) -> dict[str, float]:
    """Keys of a case for the components of a vector."""
    return {f"{letter}{axis}": float(value) for axis, value in zip("xyz", values, strict=False)}


def _loads(cell: str) -> tuple[int, Floats, Floats, Floats]:
    """Dimension, a point beside the block, a force and a moment there."""
    dim = CELLS[cell].dim
    point = np.array([0.8, 1.6, 1.9]) if dim == 3 else np.array([0.8, 1.9])
    return dim, point, np.array([0.6, -0.4, 0.9])[3 - dim :], np.array([0.3, -0.2, 0.5])[:: 1 if dim == 3 else -3]


def _block(cell: str) -> Mesh:
    dim = CELLS[cell].dim
    return block(cell, 2, (0.0,) * dim, (1.0,) * dim)


def _block_text(cell: str, kinematics: str, *tables: str, fixed: bool = True) -> str:
    dim = CELLS[cell].dim
    law = _FINITE if kinematics == "finite" else {}
    foot = entry("displacement", group=f"{'xyz'[dim - 1]}0", **_components("u", [0.0] * dim))
    keys = [entry("material", **_STEEL, **law), *([foot] if fixed else []), *tables]
    return case_text(model_of(dim), *keys, kinematics=kinematics)


# ---- sectors


@problem
def solve_ring(cell: str, kinematics: str) -> Rows:
    """A sixth of a ring of a cell type, and the whole. Both under a load that every sector has, without a plane of
    symmetry.
    """
    dim = CELLS[cell].dim
    counts, radii = ((3, 4) if dim == 2 else (2, 3, 2)), (1.0, 2.0)
    angle = f"{SECTORS} * atan2(y, x)"
    law = _FINITE if kinematics == "finite" else {}
    tables = [
        entry("material", **_STEEL, **law),
        _axes(entry("displacement", group="in", ux=f"0.01 * t * sin({angle})", uy=f"0.02 * t * cos({angle})"), dim),
        *([entry("displacement", group="bottom", uz=0.0)] if dim == 3 else []),
        entry("pressure", group="out", value=f"t * (1 + cos({angle} + 1))"),
    ]
    one = solve(case_text(model_of(dim), *tables, kinematics=kinematics), whole(cell, counts, radii, SECTORS))
    text = case_text(model_of(dim), *tables, _cyclic(), kinematics=kinematics)
    part = solve(text, sector(cell, counts, radii, SECTORS))
    away, at = cKDTree(one.mesh.points).query(part.mesh.points)
    yield at_most("distance of the nodes", away.max(), 1e-9, source="the same mesh")
    error = np.abs(part.u - one.u[at]).max() / np.abs(one.u).max()
    yield at_most("difference of the displacements", error, 1e-9, source="the sector is a part of the ring")


@problem
def solve_growth(cell: str, kinematics: str) -> Rows:
    """A sixth of a ring of a cell type, whose sides do not match. The displacement e X of an even strain, which is
    given within and around.
    """
    dim = CELLS[cell].dim
    law = _FINITE if kinematics == "finite" else {}
    grown = [
        _axes(entry("displacement", group=g, ux="0.05 * t * sqrt(x**2 + y**2)", uy=0.0), dim) for g in ("in", "out")
    ]
    flat = [entry("displacement", group=g, uz=0.0) for g in ("bottom", "top")] if dim == 3 else []
    text = case_text(model_of(dim), entry("material", **_STEEL, **law), _cyclic(), *grown, *flat, kinematics=kinematics)
    counts = (3, 4) if dim == 2 else (2, 3, 2)
    one = solve(text, sector(cell, counts, (1.0, 2.0), SECTORS, skew=0.2))
    wanted = 0.05 * one.mesh.points[:, :dim] * np.array([1.0, 1.0, 0.0])[:dim]
    yield at_most("largest error of a displacement", np.abs(one.u - wanted).max(), SOLVED, source="a patch test")
    tied = len(one.problem.joints)
    yield at_most("sides that are tied, short of one", 1 - tied, 0.0, source="they do not match")


@problem
def solve_disc(cell: str, skew: float, *, levels: int) -> Rows:
    """A sixth of a disc that rotates, in cells of one type; `skew`: of the sides. Displacements on finer and finer
    meshes.
    """
    exact, order = Disc(1.0, 2.0, 100.0, 0.3, 3.0), CELLS[cell].order
    text = case_text(
        "plane_stress",
        entry("material", young=exact.young, poisson=exact.poisson),
        _cyclic(),
        entry("body_force", fx=f"{exact.load!r} * x * t", fy=f"{exact.load!r} * y * t"),
        _axes(entry("displacement", group="in", uy=0.0), 2),
    )
    solutions = []
    for k in range(levels):
        n = 4 * 2**k if order == 1 else 2 * 2**k
        one = solve(text, sector(cell, (n, n), (1.0, 2.0), SECTORS, skew=skew))
        error = displacement_error(one.mesh, one.u, exact.displacement)
        solutions.append(LevelSolution(one, 1 / n, {"u": error}))
    reason = "displacements of order p + 1" + ("; a tie leaves an error of the mean jumps" if skew else "")
    wanted = order + 1 - (0.4 if skew else 0.15)
    yield rate("displacement in L2", convergence(solutions, "u"), wanted, source="interpolation", reason=reason)


@problem
def solve_fit(cell: str, skew: float, sectors: int = SECTORS, *, levels: int) -> Rows:
    """One of `sectors` of a press fit, in cells of one type; `skew`: of the sides. The pressure of contact on finer
    and finer meshes: its slave ends at the sides of the sector.
    """
    within, around = (Shell("plane_stress", *radii, 100.0, 0.3) for radii in ((1.0, 1.5), (1.5, 2.0)))
    exact = Fit(within, around, interference=0.01)
    text = case_text(
        "plane_stress",
        entry("material", young=100.0, poisson=0.3),
        entry("contact", slave="slave", master="master", clearance=-0.01),
        _cyclic(sectors),
        *(_axes(entry("displacement", group=g, uy=0.0), 2) for g in ("inner", "outer")),
    )
    solutions = []
    for k in range(levels):
        n = 3 * 2**k
        one = solve(text, fitted(cell, n, (1.0, 1.5, 2.0), sectors, skew=skew))
        zone = next(zone for zone in one.state.zones if not zone.tie)
        error = float(np.abs(zone.pressure / exact.between - 1).max())
        solutions.append(LevelSolution(one, 1 / n, {"p": error}))
    wanted, reason = (1.8 if not skew else 1.0), "the worst macro-element; linear cells on facets"
    yield rate("largest error of a pressure", convergence(solutions, "p"), wanted, source="Lame", reason=reason)


def _cyclic(sectors: int = SECTORS) -> str:
    return entry("cyclic", slave="a", master="b", sectors=sectors)


def _axes(table: str, dim: int) -> str:
    """A table with cylindrical axes about z."""
    return f"{table}\naxes = {{ origin = {[0.0] * dim}, axis = [0.0, 0.0, 1.0] }}"


CELL_TYPES = ("TRIA3", "QUAD4", "TRIA6", "QUAD8", "QUAD9", "TETRA4", "HEXA8", "PENTA6", "TETRA10", "HEXA20")


def cases(family: str) -> Iterator[Case]:
    """Cases of this module."""
    for cell in CELL_TYPES:
        quick = int(cell in ("QUAD8", "HEXA8"))
        for kinematics in ("small", "finite"):
            for name, words, solve_, seconds in (
                ("spread", "a force and a moment at a point", solve_spread, 1.0),
                ("pulled", "pulled by a coupling and by a traction", solve_pulled, 1.0),
                ("ring", "a sector against the whole ring", solve_ring, 4.0),
                ("growth", "growth across sides that do not match", solve_growth, 2.0),
            ):
                words = f"{words}, {kinematics} displacements, {cell}"
                yield row(family, f"{name}-{kinematics}-{cell}", words, solve_, cell, kinematics, quick=quick, full=1,
                          seconds=seconds)  # fmt: skip
        for name, words, given in (
            ("by-area", "area weights", (cell, None)), ("by-given", "given weights", (cell, "1 + x")),
            ("at-once", "one step", (cell, None, 1)),
        ):  # fmt: skip
            words = f"a large rotation, {words}, {cell}"
            yield row(family, f"turned-{name}-{cell}", words, solve_turned, *given, quick=quick, full=1, seconds=2.0)
    words = "a press fit, a quarter between the axes, QUAD4"
    yield row(family, "fit-quarter-QUAD4", words, solve_fit, "QUAD4", 0.0, 4, quick=3, full=3, seconds=4.0)
    for cell in ("TRIA3", "QUAD4", "TRIA6", "QUAD8", "QUAD9"):
        for sides, skew in (("matching", 0.0), ("other", 0.2)):
            suites, name = {"quick": 3 * (cell == "QUAD4"), "full": 3}, f"{sides}-{cell}"
            words = f"{sides} sides, {cell}"
            yield row(
                family, f"disc-{name}", f"a rotating disc, {words}", solve_disc, cell, skew, **suites, seconds=3.0
            )
            yield row(family, f"fit-{name}", f"a press fit, {words}", solve_fit, cell, skew, **suites, seconds=4.0)
