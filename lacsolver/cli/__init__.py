"""The command `lacsolver`: each of its commands has a module in this package, run by `lacmesh.cli.program`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from lacmesh.cli.program import Program
from lacmesh.errors import LacmeshError
from lacsolver.cli.options import EPILOG

#: in the order of the help
COMMANDS = (
    "example",
    "new",
    "run",
    "validate",
    "import",
    "modes",
    "film",
    "plot",
    "report",
    "compare",
    "matrices",
    "schema",
    "completion",
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    return PROGRAM.main(argv)


def _error_lines(error: LacmeshError, args: argparse.Namespace) -> list[str]:
    """Return the lines of an error, one for each mistake of a case.

    A line about the case that does not name the case's file gets that name in front. There is none for
    StoppedError: a run in several processes has reported its error already.
    """
    from lacsolver.case.errors import CaseError
    from lacsolver.distributed.together import StoppedError

    if isinstance(error, StoppedError):
        return []
    lines = str(error).splitlines() if isinstance(error, CaseError) else [str(error)]
    case, about = getattr(args, "case", None), error.status in (1, 4)
    return [f"{case}: {line}" if about and case and case not in line else line for line in lines]


PROGRAM = Program(
    "lacsolver",
    __name__,
    "Solve contact problems with the Local Average Contact method. A case file describes the problem.",
    EPILOG,
    COMMANDS,
    _error_lines,
    'there is not enough memory for this model; a coarser mesh needs less, and so does [solver] backend = "multigrid"',
    "run",
)
