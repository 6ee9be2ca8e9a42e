"""A run in several processes: the distributed counterpart of `lacsolver.running`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from lacmesh.errors import RequestError
from lacsolver.distributed.launch import import_petsc

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh
    from lacsolver.case import Case
    from lacsolver.output import OutputFolder
    from lacsolver.results.results import Restart, Results, StepFigures
    from lacsolver.solve.stepping import Told


def run(
    case: Case,
    folder: OutputFolder,
    *,
    mesh: Mesh | None = None,
    start: Restart | None = None,
    told: Callable[[Told], None] | None = None,
    stepped: Callable[[StepFigures], None] | None = None,
) -> Results:
    """Solve a case on all processes and write its results into a folder; the arguments are those of `lacsolver.run`.

    Every process calls it with the same arguments. Rank 0 alone locks the folder and writes tables; the results are
    returned on all. Raises RequestError if PETSc or MPI is missing, and the errors of `lacsolver.run`.
    """
    import_petsc()
    raise RequestError('the engine petsc does not solve anything yet; take [solver] engine = "serial" in one process')
