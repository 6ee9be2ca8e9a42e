"""The manufactured contact problems: two exact solutions, and the rows that solve them, one a cell type.

Displacements, masters and code_aster's rates are those of its validation suite (ssnp150c to f, ssnv219e to m; rates of
the last two levels, from its test files).
"""

from __future__ import annotations

from dataclasses import dataclass

from lacmesh import CELLS
from verification.exact.sources import Law, Texts

LAW = Law(young=1.0, poisson=0.0)


@dataclass(frozen=True)
class Solution:
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

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return len(self.low)


PLANE = Solution(
    "plane_strain", (0.0, 0.0), (1.0, 1.0),
    ("-0.2 * y**3 * (x - 0.5)", "-0.05 * (x - 0.5)**2 * (1 + y) - 0.01 * y"),
    "SEG3", "-0.05 * (x - 0.5)**2", (0.5,),
)  # fmt: skip
SOLID = Solution(
    "3d", (-0.5, -0.5, 0.0), (0.5, 0.5, 1.0),
    ("0.2 * z**2 * x * y", "0.2 * z**2 * x * y", "-0.2 * (1 + x**2 + y**2) * (1 + 0.01 * z) - 0.01 * z - 0.3"),
    "QUAD8", "-0.2 * (x**2 + y**2) - 0.5", (0.0, 0.0),
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """A cell type to solve a manufactured problem with, on `levels` meshes, each of twice as many cells a side.

    `displacement_rate`, `pressure_rate`: code_aster's, in L2; None for a row that it does not have.
    """

    name: str
    cell: str
    levels: int
    displacement_rate: float | None = None
    pressure_rate: float | None = None
    hexa: str = "pyramid"

    @property
    def solution(self) -> Solution:
        """The problem that it solves."""
        return PLANE if CELLS[self.cell].dim == 2 else SOLID

    @property
    def wanted(self) -> float:
        """The displacement's rate that must come out: a little below h^2, and for quadratic cells h^2.5 (Theorem 1)."""
        return 1.92 if CELLS[self.cell].order == 1 else 2.45


#: every row by its name
ROWS = {
    row.name: row
    for row in (
        Row("ssnp150c", "TRIA3", 6, 1.9976453888, 1.04123265161),
        Row("ssnp150d", "TRIA6", 6, 2.81404623178, 1.01178177732),
        Row("ssnp150e", "QUAD4", 6, 2.00221480429, 1.01326727416),
        Row("ssnp150f", "QUAD8", 6, 2.67333768953, 1.0193044686),
        Row("quad9", "QUAD9", 6),
        Row("ssnv219e", "TETRA4", 5, 1.95251207759, 1.28200774331),
        Row("ssnv219f", "TETRA10", 4, 2.99572191679, 1.99358507301),
        Row("ssnv219g", "HEXA8", 5, 1.99015204106, 1.88672668502, "hexa"),
        Row("ssnv219h", "HEXA20", 4, 2.54224148291, 1.04466517181, "hexa"),
        Row("ssnv219i", "HEXA27", 4, 2.99861260357, 1.01557409035),
        Row("ssnv219j", "HEXA8", 5, 1.98820777562, 1.86635688107),
        Row("ssnv219k", "HEXA20", 4, 3.66986265524, 1.09023168237),
        Row("ssnv219l", "PENTA6", 5, 1.9570244685, 1.88093381083),
        Row("ssnv219m", "PENTA15", 4, 3.93327482127, 2.04956032802),
        Row("penta18", "PENTA18", 4),
        Row("pyram5", "PYRAM5", 4),
        Row("pyram13", "PYRAM13", 4),
    )
}
