"""Manufactured finite-deformation contact: exact displacement and pressure, error by error, level by level.

A block comes down on a curved rigid master. The exact displacement u is given (code_aster's validation suite, ssnp150
and ssnv219); body force -Div P, dead tractions P N on the free sides and, on the slave, P N less its part along the
exact deformed normal are derived from it (`exact.sources`) and applied, u is imposed on the side opposite the slave;
the pressure is what contact must find. One step leads from the flat slave to t = 1; loads and displacements grow with
t, so that it can be halved.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.exact.sources import Law, SymbolicFunction, Texts, compiled, derive, missing
from verification.measures.norms import displacement_error, nodal_pressure_error, pressure_errors
from verification.meshes.blocks import block, with_master
from verification.pages.charts import Plot
from verification.profiles import line, pressures, residuals
from verification.records import Case, Family, Outcome, Picture, Published, Result, informative, rate
from verification.solving import LevelSolution, balanced, case_text, convergence, entry, solve

LAW = Law(young=1.0, poisson=0.0)


@dataclass(frozen=True)
class ManufacturedProblem:
    """A block from `low` to `high` whose lower side, the slave, comes down flat onto a curved rigid master.

    `displacement`: exact, a text of x, y(, z) each component. `master`: type of the one cell that carries the surface
    `master_height` exactly over [-1, 1]^(dim - 1) from `master_centre`.
    """

    model: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    displacement: Texts
    master: str
    master_height: str
    master_centre: tuple[float, ...]
    law: Law = LAW

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return len(self.low)

    @property
    def slave(self) -> str:
        """The group of the slave's faces."""
        return f"{'xyz'[self.dim - 1]}0"


PLANE = ManufacturedProblem(
    "plane_strain", (0.0, 0.0), (1.0, 1.0),
    ("-0.2 * y**3 * (x - 0.5)", "-0.05 * (x - 0.5)**2 * (1 + y) - 0.01 * y"),
    "SEG3", "-0.05 * (x - 0.5)**2", (0.5,),
)  # fmt: skip
SOLID = ManufacturedProblem(
    "3d", (-0.5, -0.5, 0.0), (0.5, 0.5, 1.0),
    ("0.2 * z**2 * x * y", "0.2 * z**2 * x * y", "-0.2 * (1 + x**2 + y**2) * (1 + 0.01 * z) - 0.01 * z - 0.3"),
    "QUAD8", "-0.2 * (x**2 + y**2) - 0.5", (0.0, 0.0),
)  # fmt: skip


@dataclass(frozen=True)
class CellRow:
    """A cell type to solve a manufactured problem with; `hexa`: how HEXA8 and HEXA20 are cut.

    `test`: code_aster's, with its rates in L2 over the last two of its `levels`; None and 0 for a row that it does not
    have. `pictured`: the deformed block is drawn.
    """

    cell: str
    test: str = ""
    levels: int = 0
    displacement_rate: float | None = None
    pressure_rate: float | None = None
    hexa: str | None = None
    pictured: bool = False

    @property
    def name(self) -> str:
        """Name of the case: the cell, with the subdivision where there are two."""
        return f"{self.cell}-{self.hexa}" if self.hexa else self.cell

    @property
    def solution(self) -> ManufacturedProblem:
        """The problem that it solves."""
        return PLANE if CELLS[self.cell].dim == 2 else SOLID

    @property
    def order(self) -> int:
        """Order of the cells: 1 or 2."""
        return CELLS[self.cell].order


#: every row by its name
ROWS = {
    row.name: row
    for row in (
        CellRow("TRIA3", "ssnp150c", 6, 1.9976453888, 1.04123265161),
        CellRow("TRIA6", "ssnp150d", 6, 2.81404623178, 1.01178177732),
        CellRow("TRIA7"),
        CellRow("QUAD4", "ssnp150e", 6, 2.00221480429, 1.01326727416),
        CellRow("QUAD8", "ssnp150f", 6, 2.67333768953, 1.0193044686, pictured=True),
        CellRow("QUAD9"),
        CellRow("TETRA4", "ssnv219e", 5, 1.95251207759, 1.28200774331, pictured=True),
        CellRow("TETRA10", "ssnv219f", 4, 2.99572191679, 1.99358507301, pictured=True),
        CellRow("HEXA8", "ssnv219g", 5, 1.99015204106, 1.88672668502, "hexa"),
        CellRow("HEXA20", "ssnv219h", 4, 2.54224148291, 1.04466517181, "hexa"),
        CellRow("HEXA27", "ssnv219i", 4, 2.99861260357, 1.01557409035, pictured=True),
        CellRow("HEXA8", "ssnv219j", 5, 1.98820777562, 1.86635688107, "pyramid", pictured=True),
        CellRow("HEXA20", "ssnv219k", 4, 3.66986265524, 1.09023168237, "pyramid", pictured=True),
        CellRow("PENTA6", "ssnv219l", 5, 1.9570244685, 1.88093381083, pictured=True),
        CellRow("PENTA15", "ssnv219m", 4, 3.93327482127, 2.04956032802),
        CellRow("PENTA18"),
        CellRow("PYRAM5", pictured=True),
        CellRow("PYRAM13"),
        CellRow("PYRAM14"),
    )
}


#: cells a side on level 0
_COARSEST = {2: 4, 3: 2}
#: rates that must come out, by the order of the cells: of u, p_m, the recovered pressure
WANTED = {1: (1.92, 0.95, 1.5), 2: (2.45, 0.95, 1.8)}
#: levels that fitted rates are of: two cells a side, in space, are no field of pressures yet
LAST = 3
#: of the width of the slave: how far from its rim is away from it
RIM = 0.2
#: levels of the rows that are solved in `quick`
_QUICK = {**dict.fromkeys(("TRIA3", "TRIA6", "QUAD4", "QUAD8", "QUAD9", "HEXA8-hexa", "HEXA8-pyramid"), 3), "TETRA4": 4}
#: what rows take in `full`, in seconds
_SECONDS = {
    "TRIA3": 5.0, "TRIA6": 7.0, "TRIA7": 8.0, "QUAD4": 5.0, "QUAD8": 8.0, "QUAD9": 8.0,
    "TETRA4": 18.0, "TETRA10": 75.0, "HEXA8-hexa": 20.0, "HEXA20-hexa": 125.0, "HEXA27": 50.0, "HEXA8-pyramid": 15.0,
    "HEXA20-pyramid": 85.0, "PENTA6": 20.0, "PENTA15": 120.0, "PENTA18": 120.0, "PYRAM5": 25.0, "PYRAM13": 110.0,
    "PYRAM14": 120.0,
}  # fmt: skip
_PAPER = "Abbas, Drouet and Hild 2018"
_DISPLACEMENT = {
    1: f"order h^2 of linear cells ({_PAPER}), less what is not yet asymptotic",
    2: f"order h^2.5 of quadratic cells ({_PAPER}, Theorem 1), less what is not yet asymptotic",
}
#: why u of quadratic cells may converge more slowly than h^3, and ever more so
_RIM = (
    "forces act along the slave's normal, which is not the derivative of the gap where the normals are not parallel; "
    "the rim of the slave stands off its master by h^2, so that they push along it: in the plane the rate falls from 3 "
    "towards 2 as meshes get finer, soonest on quadrangles, which have 2.5 up to 64 cells a side and 2.2 up to 128"
)
_CONSTANT = "constant on a macro-element: order 1 is the end, and figures above it are not asymptotic"
_LAYER = (
    "p_m is constant where p is not, and what it lacks bends the slave by h^2 between the ends of a macro-element; in "
    "the middle of the skin neighbours cancel that out, at its rim p_m has to, by a part of order h of the slope of p. "
    "So it is on plane skins and at small strains too. In L2 such a layer is h^1.5, whatever the cells; it alternates "
    "and falls to about a third from one macro-element to the next, so that the recovery weighs the last two less"
)
_MEANS = f"for information: p_m as what it stands for, a mean; {_LAYER}"
_AWAY = "for information: without the layer along the rim"


def solve_case(row: CellRow, *, levels: int) -> Outcome:
    """A row on so many meshes, each of twice as many cells a side."""
    solutions = [solution(row, level) for level in range(levels)]
    results = (*_rates(row, solutions), _iterations(solutions), *balanced([one.solved for one in solutions]))
    plots = [_pressures(row, solutions[min(2, levels - 1)])] if row.solution.dim == 2 else []
    return Outcome(results, (*plots, _newton(row, solutions)), _pictures(row, solutions))


def solution(row: CellRow, level: int) -> LevelSolution:
    """Solve a row on one level; errors in L2, relative. Raises what `solve` raises.

    `means`: of p_m against the exact means, `recovered`: of the nodal pressure, `away`: of that, away from the rim of
    the slave.
    """
    given = row.solution
    solved = solve(case_of(row), mesh_of(row, level))
    mesh, exact = solved.mesh, exact_pressure(row)
    p = pressure_errors(mesh, solved.zone.pressure, exact)
    errors = {
        "displacement": displacement_error(mesh, solved.u, compiled(given.displacement)),
        "pressure": p.exact,
        "means": p.mean,
        "recovered": nodal_pressure_error(mesh, solved.recovered, exact),
        "away": nodal_pressure_error(mesh, solved.recovered, exact, faces=_away(row, mesh)),
    }
    return LevelSolution(solved, 1 / cells_a_side(row, level), errors)


def _away(row: CellRow, mesh: Mesh) -> NDArray[np.integer]:
    """The faces of the slave whose middle is `RIM` and more away from its rim."""
    faces = np.flatnonzero(mesh.cell_data["lac_macro"] >= 0)
    low, high = (np.array(end)[:-1] for end in (row.solution.low, row.solution.high))
    kept = []
    for _, chosen, nodes in mesh.select(faces):
        middle = mesh.points[nodes].mean(axis=1)[:, : len(low)]
        kept.append(chosen[(np.minimum(middle - low, high - middle) >= RIM * (high - low)).all(axis=1)])
    return np.sort(np.concatenate(kept))


def exact_pressure(row: CellRow) -> SymbolicFunction:
    """Nominal pressure (n, 1) at points of the undeformed slave."""
    return compiled([derive(row.solution.displacement, row.solution.law).pressure])


def cells_a_side(row: CellRow, level: int) -> int:
    """Number of cells, or of pairs of triangles and the like, along each axis of a block."""
    return _COARSEST[row.solution.dim] << level


def mesh_of(row: CellRow, level: int) -> Mesh:
    """The block of a row's cells and its master, not cut."""
    given = row.solution
    turn = -1 if given.dim == 2 else 1  # the skin's normal, (t_y, -t_x) of a segment along t, faces the block
    plane = turn * np.array(CELLS[given.master].reference) + given.master_centre
    points = np.column_stack([plane, compiled([given.master_height])(plane)])
    return with_master(block(row.cell, cells_a_side(row, level), given.low, given.high), given.master, points)


def case_of(row: CellRow) -> str:
    """The case of a row, as TOML."""
    given = row.solution
    axes = "xyz"[: given.dim]
    sources = derive(given.displacement, given.law)
    return case_text(
        given.model,
        entry("material", law="saint_venant_kirchhoff", young=given.law.young, poisson=given.law.poisson),
        entry(
            "contact", slave=given.slave, master="master", measure="reference", geometry="current",
            search_distance=1.0, hexa=row.hexa,
        ),
        entry("rigid", group="master"),
        _vector("displacement", "u", given.displacement, f"{axes[-1]}1"),
        _vector("body_force", "f", sources.body_force),
        _vector("traction", "t", sources.tangential, given.slave),
        *(
            _vector("traction", "t", sources.traction(axis, 2 * end - 1), f"{axes[axis]}{end}")
            for axis in range(given.dim - 1)
            for end in range(2)
        ),
        kinematics="finite",
    )  # fmt: skip


def _vector(table: str, letter: str, texts: Iterable[str], group: str | None = None) -> str:
    """A table of the case whose components are texts, growing with t."""
    components = {f"{letter}{axis}": f"t * ({text})" for axis, text in zip("xyz", texts, strict=False)}
    return entry(table, group=group, **components)


def _rates(row: CellRow, solutions: Sequence[LevelSolution]) -> Iterator[Result]:
    """The rates of u, p_m, the recovered pressure, and of p_m against the exact means."""
    u, p, recovered = WANTED[row.order]
    yield rate(
        "displacement in L2, rate", convergence(solutions, "displacement"), u, last=LAST,
        source=_DISPLACEMENT[row.order], reason=_RIM if row.order == 2 else "",
        published=_theirs(row, row.displacement_rate),
    )  # fmt: skip
    yield rate(
        "p_m in L2, rate", convergence(solutions, "pressure"), p, last=LAST, source=f"order h of constants ({_PAPER})",
        reason=_CONSTANT, published=_theirs(row, row.pressure_rate),
    )  # fmt: skip
    source = "approximation by the slave's own shape functions"
    yield rate(
        "recovered pressure in L2, rate", convergence(solutions, "recovered"), recovered, last=LAST, source=source,
        reason=_LAYER,
    )  # fmt: skip
    away = f"recovered pressure in L2, {RIM:g} of the width away from the rim, rate"
    yield rate(away, convergence(solutions, "away"), None, last=LAST, source="", reason=_AWAY)
    yield rate(
        "p_m against the exact means, rate", convergence(solutions, "means"), None, last=LAST, source="", reason=_MEANS
    )


def _theirs(row: CellRow, value: float | None) -> tuple[Published, ...]:
    """Rate of code_aster, for comparison only: ours is not judged by it."""
    source = f"{row.test} of its validation suite: the last two of {row.levels} levels"
    return () if value is None else (Published("code_aster, LAC", value, source),)


def _iterations(solutions: Sequence[LevelSolution]) -> Result:
    finest = solutions[-1].solved
    reason = "for information: one step, and none that is halved, is what to hope for"
    return informative(
        f"Newton iterations on the finest mesh ({finest.halvings} halved steps)", finest.iterations, reason=reason
    )


def _newton(row: CellRow, solutions: Sequence[LevelSolution]) -> Plot:
    """The residuals of every mesh, iteration by iteration."""
    lines = tuple(residuals(f"h = {one.h:.4g}", one.solved.states) for one in solutions)
    title = f"{row.name}: residual of each Newton iteration"
    return Plot("Newton", title, "iteration", "relative residual", lines, log_y=True)


def _pressures(row: CellRow, one: LevelSolution) -> Plot:
    """Exact, p_m and recovered pressure along the slave of a plane problem."""
    x = np.linspace(row.solution.low[0], row.solution.high[0], 101)
    exact = line("exact", x, exact_pressure(row)(np.column_stack([x, np.zeros_like(x)]))[:, 0])
    lines = pressures(one.solved, exact, _along)
    return Plot("pressure", f"{row.name}: nominal pressure, h = {one.h:.4g}", "x", "pressure", lines)


def _along(x: NDArray[np.floating]) -> NDArray[np.floating]:
    return x[..., 0]


def _pictures(row: CellRow, solutions: Sequence[LevelSolution]) -> tuple[Picture, ...]:
    one = solutions[min(len(solutions) - 1, 2 if row.solution.dim == 2 else 1)]
    return (one.solved.picture(f"{row.name}, {round(1 / one.h)} cells a side"),) if row.pictured else ()


def _case(row: CellRow) -> Case:
    theirs = f", code_aster's {row.test}" if row.test else ""
    return Case(
        family="manufactured",
        name=row.name,
        description=f"A block of {row.cell} comes down on a curved rigid master{theirs}",
        solve=partial(solve_case, row),
        levels=_suites(row),
        seconds=_SECONDS[row.name],
    )


def _suites(row: CellRow) -> dict[str, int]:
    """Number of levels in each suite."""
    quick = {"quick": _QUICK[row.name]} if row.name in _QUICK else {}
    if row.solution.dim == 2:
        return {**quick, "full": 5, "all": 6}
    return {**quick, "full": 4, "all": max(4, row.levels)}


FAMILY = Family(
    name="manufactured",
    title="Manufactured contact at finite deformation",
    text=__doc__.partition("\n\n")[2],
    cases=tuple(_case(row) for row in ROWS.values()),
    missing=missing,
)
