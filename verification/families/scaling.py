"""Growth of computing time with size: cut, search, assembly.

The time of each stage against the size of the problem, on two plates whose faces do not match, each two cells thick, so
that skins grow as bodies do. Each stage visits every cell or face a bounded number of times (trees of boxes add a
logarithm), so its time goes with the size to the power 1; the exponent is the slope of the logarithms by least squares.

Seconds are those of the process, the least of some repetitions, after a small problem that compiles and loads all that
is used, with nothing of the harness beside. What the kernel spends on clearing new pages is in them, which arrays below
some size do without, since their memory is used again: a step.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from numpy.typing import NDArray

import lacmesh
import lacsolver
from lacmesh import Mesh
from lacsolver.bodies.small import assemble_stiffness
from lacsolver.contact import integrate
from lacsolver.problem.problem import Problem
from lacsolver.space.space import Space
from verification.measures.rates import fitted
from verification.meshes.stacks import stack
from verification.records import Case, Family, Result, Rows, at_most, levels_of, problem, row
from verification.solving import case_text, contact, entry, fixed, material

#: of the exponents; the five hundredths are for the logarithm of a search, and caches
LINEAR = 1.05
#: every stage is timed on every mesh in so many rounds, so that what else a machine does is the same for all
ROUNDS = 4
#: seconds that a stage is repeated for in a round
LONG_ENOUGH = 0.15
_SOURCE = "every cell and face is visited a bounded number of times"


@dataclass(frozen=True, eq=False)
class BenchmarkStages:
    """A problem on plates whose stages can be run again and again; `mesh`: as it is before the cut."""

    hexa: str
    mesh: Mesh
    problem: Problem

    @classmethod
    def of(cls, kind: str, n: int, hexa: str = "pyramid") -> BenchmarkStages:
        """Plates of n cells a side, each two thick; the master has 3 where the slave has 4. `hexa`: how it is cut."""
        mesh = stack(kind, kind, 3, counts=(n, 3 * n // 4), bend=0.2)
        cut = lacmesh.cut_skin(mesh, "slave", hexa=hexa).mesh
        return cls(hexa, mesh, Problem.of(lacsolver.parse_case(text()), cut))

    @property
    def cells(self) -> int:
        """Number of cells of the mesh that is cut, skins included."""
        return self.mesh.n_cells

    @property
    def faces(self) -> int:
        """Number of faces of slave and master after the cut."""
        zone = self.problem.joints[0].zone
        return len(zone.slave) + len(zone.master)

    @property
    def unknowns(self) -> int:
        """Number of displacement unknowns."""
        return int(self.problem.constraints.n_q)

    def cut(self) -> None:
        """Cut the slave."""
        lacmesh.cut_skin(self.mesh, "slave", hexa=self.hexa)

    def search(self) -> None:
        """Find the master in front of the slave, and the points at which contact is integrated."""
        zone = self.problem.joints[0].zone
        lacmesh.contact_points(zone.slave, zone.master)

    def integrate(self) -> None:
        """Search, and the contact matrices."""
        integrate(self.problem.joints[0].zone, 3)

    def assemble(self) -> None:
        """The stiffness, with the pattern of its entries, which a space would keep."""
        space = Space.of(self.problem.space.mesh, "3d")
        assemble_stiffness(space, self.problem.materials, 1)


#: name of a stage -> the method of `BenchmarkStages` that runs it, the property it is compared with, that in words
_STAGES: dict[str, tuple[str, str, str]] = {
    "cut": ("cut", "cells", "cells of the mesh"),
    "search": ("search", "faces", "faces of slave and master"),
    "search and integration": ("integrate", "faces", "faces of slave and master"),
    "assembly": ("assemble", "unknowns", "unknowns"),
}


@problem
def run(kind: str, sides: tuple[int, ...], hexa: str = "pyramid", *, levels: int) -> Rows:
    """Time all stages on plates of some sizes.

    `sides`: cells along the slave's side, level by level. The coarsest matrix is larger than a processor's cache: what
    fits takes less time a cell, which is not growth.
    """
    small = BenchmarkStages.of(kind, 6, hexa)
    _ = timed([small])  # compiled and loaded, all that is used
    problems = [BenchmarkStages.of(kind, n, hexa) for n in sides[:levels]]
    for stage, seconds in zip(_STAGES, timed(problems), strict=True):
        yield _judged(stage, problems, seconds)


def timed(problems: Sequence[BenchmarkStages]) -> NDArray[np.floating]:
    """(stages, problems): seconds of the process, the least of all rounds."""
    rounds = [
        [[seconds_of(getattr(one, name)) for one in problems] for name, _, _ in _STAGES.values()] for _ in range(ROUNDS)
    ]
    return np.asarray(np.min(rounds, axis=0))


def seconds_of(work: Callable[[], None], long_enough: float = LONG_ENOUGH) -> float:
    """Seconds of the process that a piece of work takes, the least of some repetitions."""
    seconds: list[float] = []
    gc.collect()
    while sum(seconds) <= long_enough:
        start = process_time()
        work()
        seconds.append(process_time() - start)
    return min(seconds)


def text() -> str:
    """The upper plate pressed on the lower one, which has to find where they touch."""
    return case_text(
        "3d",
        entry("solver", threads=1),
        material(1e3, 0.3),
        contact(clearance="0.01 * ((x - 0.5)**2 + (y - 0.5)**2)"),
        fixed("bottom", "xyz"),
        entry("displacement", group="top", ux=0.0, uy=0.0, uz=-0.002),
    )


def _judged(stage: str, problems: Sequence[BenchmarkStages], seconds: Sequence[float]) -> Result:
    _, size, words = _STAGES[stage]
    sizes = [getattr(one, size) for one in problems]
    reason = (
        f"the slope of the logarithms of seconds and {words} (h of the levels; the error is seconds); the kernel's "
        "seconds for new memory, which only large arrays take, are in it"
    )
    levels = levels_of(sizes, [one.unknowns for one in problems], seconds)
    return at_most(f"exponent of {stage}", fitted(sizes, seconds), LINEAR, source=_SOURCE, reason=reason, levels=levels)


def _cases() -> Iterator[Case]:
    hexahedra, tetrahedra = (34, 68, 136, 204), (56, 80, 112, 160, 224)
    for name, kind, sides, hexa, suites in (
        ("HEXA8", "HEXA8", hexahedra, "pyramid", {"quick": 3, "full": 4}),
        ("TETRA4", "TETRA4", tetrahedra, "pyramid", {"full": 5}),
        ("HEXA8-hexa", "HEXA8", hexahedra, "hexa", {"every": 3}),
    ):
        words = f"plates of {kind}, the slave cut {hexa}"
        yield replace(row("scaling", name, words, run, kind, sides, hexa, **suites, seconds=90.0), exclusive=True)


FAMILY = Family("scaling", "Scaling", __doc__.partition("\n\n")[2], tuple(_cases()))
