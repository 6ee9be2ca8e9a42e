"""Manufactured finite-deformation contact: exact displacement and pressure, error by error, level by level.

A block comes down on a curved rigid master. The exact displacement u is given; body force -Div P, dead tractions P N
on the free sides and, on the slave, P N less its part along the exact deformed normal are applied, u is imposed on the
side opposite the slave; the pressure is what contact must find. One step leads from the flat slave to t = 1; loads and
displacements grow with t, so that it can be halved.

    python -m verification.manufactured ssnp150c ssnv219e --levels 4
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import lacmesh
import lacsolver
from lacmesh import CELLS, Mesh
from verification.exact.sources import compiled, derive
from verification.manufactured_rows import LAW, ROWS, Row
from verification.measures.norms import displacement_error, pressure_errors
from verification.measures.rates import fitted, pairwise
from verification.meshes.blocks import block, with_master

#: cells a side on level 0
_COARSEST = {2: 4, 3: 2}
#: cells that are cut in one of two ways
TWO_WAYS = ("HEXA8", "HEXA20")
#: levels that the fitted rate is of
LAST = 3


@dataclass(frozen=True)
class Level:
    """One solution. `h`: mesh size; errors are relative, in L2; `mean_error_p`: of p_m against the exact pressure's
    mean over each macro-element; `iterations` of Newton's method and `halvings`, all steps together.
    """

    level: int
    h: float
    unknowns: int
    error_u: float
    error_p: float
    mean_error_p: float
    steps: int
    iterations: int
    halvings: int
    seconds: float


@dataclass(frozen=True)
class Rates:
    """Levels and what they come to: rates from level to level (n - 1,), and fitted over the last `LAST`."""

    row: Row
    levels: tuple[Level, ...]

    @property
    def displacement(self) -> float:
        """The fitted rate of u."""
        return fitted(*self._errors("error_u"), LAST)

    @property
    def pressure(self) -> float:
        """The fitted rate of p_m."""
        return fitted(*self._errors("error_p"), LAST)

    def pairwise(self, error: str) -> NDArray[np.floating]:
        """(n - 1,): rates from level to level of an error, by the name that it has in `Level`."""
        return pairwise(*self._errors(error))

    def _errors(self, name: str) -> tuple[list[float], list[float]]:
        return [level.h for level in self.levels], [getattr(level, name) for level in self.levels]


def rates(row: Row, levels: Sequence[int] | None = None) -> Rates:
    """Solve a row on some levels, or on all of its own. Raises what `solve` raises."""
    return Rates(row, tuple(solve(row, level) for level in (range(row.levels) if levels is None else levels)))


def solve(row: Row, level: int) -> Level:
    """Solve a row on one level. Raises NotConvergedError."""
    began = time.perf_counter()
    case = lacsolver.parse_case(case_text(row))
    problem = lacsolver.Problem.of(case, mesh_of(row, level))
    states = list(lacsolver.march(problem))
    mesh, sought = problem.space.mesh, row.solution
    u = states[-1].u.reshape(-1, sought.dim)
    p = pressure_errors(mesh, states[-1].zones[0].pressure, compiled([derive(sought.displacement, LAW).pressure]))
    return Level(
        level=level,
        h=1 / cells_a_side(row, level),
        unknowns=problem.constraints.n_q,
        error_u=displacement_error(mesh, u, compiled(sought.displacement)),
        error_p=p.exact,
        mean_error_p=p.mean,
        steps=len(states),
        iterations=sum(state.iterations for state in states),
        halvings=sum(state.halvings for state in states),
        seconds=time.perf_counter() - began,
    )


def cells_a_side(row: Row, level: int) -> int:
    """How many cells, or pairs of triangles and so on, a block has along each axis."""
    return _COARSEST[row.solution.dim] << level


def mesh_of(row: Row, level: int) -> Mesh:
    """The block of a row's cells and its master, not cut."""
    given = row.solution
    turn = -1 if given.dim == 2 else 1  # the skin's normal, (t_y, -t_x) of a segment along t, faces the block
    plane = turn * np.array(CELLS[given.master].reference) + given.master_centre
    points = np.column_stack([plane, compiled([given.master_height])(plane)])
    return with_master(block(row.cell, cells_a_side(row, level), given.low, given.high), given.master, points)


def case_text(row: Row, mesh: str = "manufactured.msh") -> str:
    """The case of a row, as TOML."""
    given = row.solution
    axes = "xyz"[: given.dim]
    up, sides = axes[-1], [f"{a}{end}" for a in axes[:-1] for end in "01"]
    sources = derive(given.displacement, LAW)
    hexa = f'\nhexa = "{row.hexa}"' if row.cell in TWO_WAYS else ""
    tables = [
        f'mesh = "{mesh}"\nmodel = "{given.model}"\nkinematics = "finite"',
        f'[[material]]\nlaw = "saint_venant_kirchhoff"\nyoung = {LAW.young}\npoisson = {LAW.poisson}',
        f'[[contact]]\nslave = "{up}0"\nmaster = "master"\nmeasure = "reference"\ngeometry = "current"'
        f"\nsearch_distance = 1.0{hexa}",
        '[[rigid]]\ngroup = "master"',
        _vector("displacement", "u", map(_growing, given.displacement), f"{up}1"),
        _vector("body_force", "f", map(_growing, sources.body_force)),
        _vector("traction", "t", map(_growing, sources.tangential), f"{up}0"),
        *(
            _vector("traction", "t", map(_growing, sources.traction(axes.index(side[0]), 2 * int(side[1]) - 1)), side)
            for side in sides
        ),
    ]
    return "\n\n".join(tables) + "\n"


def write_case(row: Row, level: int, folder: Path) -> Path:
    """Write a row's case and mesh into a folder, to be run by `lacsolver run`; the case's path."""
    name = f"{row.name}_{level}"
    lacmesh.write(folder / f"{name}.msh", mesh_of(row, level))
    path = folder / f"{name}.toml"
    path.write_text(case_text(row, f"{name}.msh"), encoding="utf-8")
    return path


def _growing(text: str) -> str:
    return f"t * ({text})"


def _vector(table: str, letter: str, texts: Iterable[str], group: str | None = None) -> str:
    """A table of the case whose components are texts."""
    lines = [f"[[{table}]]", *([f'group = "{group}"'] if group else [])]
    return "\n".join([*lines, *(f'{letter}{axis} = "{text}"' for axis, text in zip("xyz", texts, strict=False))])


def table(row: Row, levels: Sequence[int]) -> Generator[str, None, Rates]:
    """The lines of a row's table, each as soon as it is known; what `rates` gives at the end."""
    yield f"{row.name}: {row.cell}{' ' + row.hexa if row.cell in TWO_WAYS else ''}"
    yield _line("level", "h", "unknowns", "error u", "rate", "error p", "rate", "p - mean", "steps", "iter.", "seconds")
    done: list[Level] = []
    for level in levels:
        done.append(at := solve(row, level))
        made = Rates(row, tuple(done))
        u, p = (f"{made.pairwise(e)[-1]:.3f}" if len(done) > 1 else "" for e in ("error_u", "error_p"))
        errors = f"{at.error_u:.3e}", u, f"{at.error_p:.3e}", p, f"{at.mean_error_p:.2e}"
        steps = f"{at.steps}+{at.halvings}" if at.halvings else at.steps
        yield _line(at.level, f"{at.h:.4g}", at.unknowns, *errors, steps, at.iterations, f"{at.seconds:.1f}")
    if len(done) > 1:
        theirs = (f"{rate:.3f}" if rate else "-" for rate in (row.displacement_rate, row.pressure_rate))
        yield _line("fitted", "", "", "", f"{made.displacement:.3f}", "", f"{made.pressure:.3f}", f">= {row.wanted}")
        yield _line("code_aster", "", "", "", next(theirs), "", next(theirs))
    return made


def _line(*entries: object) -> str:
    return "".join(f"{entry!s:>10}" for entry in entries)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table of each row asked for; 1 where a displacement's rate falls short."""
    parser = argparse.ArgumentParser(prog="python -m verification.manufactured", description="Manufactured contact.")
    parser.add_argument("rows", nargs="+", choices=list(ROWS), metavar="ROW", help=", ".join(ROWS))
    parser.add_argument("--levels", type=int, help="how many meshes, from the coarsest on (default: the row's own)")
    parser.add_argument("--write", type=Path, metavar="DIR", help="write the finest case and its mesh there, and end")
    given = parser.parse_args(arguments)
    short = False
    for row in (ROWS[name] for name in given.rows):
        levels = given.levels or row.levels
        if given.write:
            print(write_case(row, levels - 1, given.write))
            continue
        made = _printed(table(row, range(levels)))
        short |= levels > 1 and made.displacement < row.wanted
    return int(short)


def _printed(lines: Generator[str, None, Rates]) -> Rates:
    while True:
        try:
            print(next(lines), flush=True)
        except StopIteration as end:
            made: Rates = end.value
            return made


if __name__ == "__main__":
    sys.exit(main())
