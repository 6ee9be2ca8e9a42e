"""Manufactured finite-deformation contact: exact displacement and pressure, error by error, level by level.

A block comes down on a curved rigid master. The exact displacement u is given (code_aster's validation suite, ssnp150
and ssnv219); body force -Div P, dead tractions P N on the free sides and, on the slave, P N less its part along the
exact deformed normal are derived from it (`exact.sources`) and applied, u is imposed on the side opposite the slave;
the pressure is what contact must find. One step leads from the flat slave to t = 1; loads and displacements grow with
t, so that it can be halved.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.exact.sources import Law, SymbolicFunction, Texts, compiled, derive, missing
from verification.measures.norms import displacement_error, nodal_pressure_error, pressure_errors
from verification.meshes.blocks import block, with_master
from verification.records import Case, Family, Published, Rows, problem, rate, row
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
    one.name: one
    for one in (
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


@problem
def solve_case(given: CellRow, *, levels: int) -> Rows:
    """A row on so many meshes, each of twice as many cells a side: rates of u and of pressures."""
    solutions = [solution(given, level) for level in range(levels)]
    of, (u, p, recovered) = partial(convergence, solutions), WANTED[given.order]
    yield rate(
        "displacement in L2, rate", of("displacement"), u, last=LAST, source=_DISPLACEMENT[given.order],
        reason=_RIM if given.order == 2 else "", published=_theirs(given, given.displacement_rate),
    )  # fmt: skip
    yield rate(
        "p_m in L2, rate", of("pressure"), p, last=LAST, source=f"order h of constants ({_PAPER})",
        reason=_CONSTANT, published=_theirs(given, given.pressure_rate),
    )  # fmt: skip
    yield rate(
        "recovered pressure in L2, rate", of("recovered"), recovered, last=LAST, reason=_LAYER,
        source="approximation by the slave's own shape functions",
    )  # fmt: skip
    name, reason = "p_m against the exact means, rate", f"for information: p_m as what it stands for, a mean; {_LAYER}"
    yield rate(name, of("means"), None, last=LAST, source="", reason=reason)
    yield from balanced([one.solved for one in solutions])
    if given.pictured:
        one = solutions[min(levels - 1, 2 if given.solution.dim == 2 else 1)]
        yield one.solved.picture(f"{given.name}, {round(1 / one.h)} cells a side")


def _theirs(given: CellRow, value: float | None) -> tuple[Published, ...]:
    """Rate of code_aster, for comparison only: ours is not judged by it."""
    source = f"{given.test} of its validation suite: the last two of {given.levels} levels"
    return () if value is None else (Published("code_aster, LAC", value, source),)


def solution(given: CellRow, level: int) -> LevelSolution:
    """Solve a row on one level; errors in L2, relative. Raises what `solve` raises.

    `means`: of p_m against the exact means, `recovered`: of the nodal pressure.
    """
    solved = solve(case_of(given), mesh_of(given, level))
    mesh, exact = solved.mesh, exact_pressure(given)
    p = pressure_errors(mesh, solved.zone.pressure, exact)
    errors = {
        "displacement": displacement_error(mesh, solved.u, compiled(given.solution.displacement)),
        "pressure": p.exact,
        "means": p.mean,
        "recovered": nodal_pressure_error(mesh, solved.recovered, exact),
    }
    return LevelSolution(solved, 1 / cells_a_side(given, level), errors)


def exact_pressure(given: CellRow) -> SymbolicFunction:
    """Nominal pressure (n, 1) at points of the undeformed slave."""
    return compiled([derive(given.solution.displacement, given.solution.law).pressure])


def cells_a_side(given: CellRow, level: int) -> int:
    """Number of cells, or of pairs of triangles and the like, along each axis of a block."""
    return _COARSEST[given.solution.dim] << level


def mesh_of(of: CellRow, level: int) -> Mesh:
    """The block of a row's cells and its master, not cut."""
    given = of.solution
    turn = -1 if given.dim == 2 else 1  # the skin's normal, (t_y, -t_x) of a segment along t, faces the block
    plane = turn * np.array(CELLS[given.master].reference) + given.master_centre
    points = np.column_stack([plane, compiled([given.master_height])(plane)])
    return with_master(block(of.cell, cells_a_side(of, level), given.low, given.high), given.master, points)


def case_of(of: CellRow) -> str:
    """The case of a row, as TOML."""
    given = of.solution
    axes = "xyz"[: given.dim]
    sources = derive(given.displacement, given.law)
    return case_text(
        given.model,
        entry("material", law="saint_venant_kirchhoff", young=given.law.young, poisson=given.law.poisson),
        entry(
            "contact", slave=given.slave, master="master", measure="reference", geometry="current",
            search_distance=1.0, hexa=of.hexa,
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


def _case(given: CellRow) -> Case:
    theirs = f", code_aster's {given.test}" if given.test else ""
    words = f"A block of {given.cell} comes down on a curved rigid master{theirs}"
    full, every = (5, 6) if given.solution.dim == 2 else (4, max(4, given.levels))
    suites = {"quick": _QUICK.get(given.name, 0), "full": full, "every": every}
    return row("manufactured", given.name, words, solve_case, given, **suites, seconds=_SECONDS[given.name])


FAMILY = Family(
    name="manufactured",
    title="Manufactured contact at finite deformation",
    text=__doc__.partition("\n\n")[2],
    cases=tuple(map(_case, ROWS.values())),
    missing=missing,
)
