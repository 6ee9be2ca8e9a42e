"""The command `lacsolver`: `lacmesh.cli.program` runs its commands, which are functions of the other modules."""

from __future__ import annotations

from lacmesh.cli.program import Program, Run
from lacmesh.errors import LacmeshError
from lacsolver.cli.cases import docs, example, import_, new, schema, validate
from lacsolver.cli.exporting import export
from lacsolver.cli.options import EPILOG
from lacsolver.cli.pictures import film, plot, report
from lacsolver.cli.solve import matrices, modes, run_command


def _error_lines(error: LacmeshError, run: Run) -> list[str]:
    """Return the lines of an error, one for each mistake of a case.

    A line about the case that does not name the case's file gets that name in front. There is none for
    StoppedError: a run in several processes has reported its error already.
    """
    from lacsolver.case.errors import CaseError
    from lacsolver.distributed.together import StoppedError

    if isinstance(error, StoppedError):
        return []
    lines = str(error).splitlines() if isinstance(error, CaseError) else [str(error)]
    case, about = run.source, error.status in (1, 4)
    return [f"{case}: {line}" if about and case and case not in line else line for line in lines]


PROGRAM = Program(
    "lacsolver",
    "Solve contact problems with the Local Average Contact method. A case file describes the problem.",
    EPILOG,
    (example, new, run_command, validate, import_, modes, film, plot, report, export, matrices, schema, docs),
    error_lines=_error_lines,
    too_large="there is not enough memory for this model; a coarser mesh needs less, and so does [solver] backend = "
    '"multigrid"',
    of_file="run",
    source="case",
)
#: runs the command and returns its exit status
main = PROGRAM.main
