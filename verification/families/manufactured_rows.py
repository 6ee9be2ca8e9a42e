"""The manufactured contact problems: two exact solutions, and the rows that solve them, one a cell type.

Displacements, masters and code_aster's rates are those of its validation suite (ssnp150c to f, ssnv219e to m; rates of
the last two levels, from its test files).
"""

from __future__ import annotations

from dataclasses import dataclass

from lacmesh.cells import CELLS
from verification.exact.sources import Law, Texts

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
