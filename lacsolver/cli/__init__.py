"""The command `lacsolver`: a module for each of its commands beside it; how it runs is in `lacmesh.cli.program`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from lacmesh.cli.options import written
from lacmesh.cli.program import Program
from lacmesh.errors import LacmeshError
from lacsolver.cli.options import EPILOG

#: in the order of the help
COMMANDS = ("run", "validate", "film", "matrices", "schema")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return PROGRAM.main(argv)


def _left(args: argparse.Namespace) -> str:
    """For a command that is stopped: what there is of its output."""
    left = getattr(args, "left", None)
    return str(left()) if left else written(args)


def _told(error: LacmeshError, args: argparse.Namespace) -> list[str]:
    """What an error says, a line each mistake of a case; where it is about the case and names no file, the case's."""
    from lacsolver.case.errors import CaseError

    lines = str(error).splitlines() if isinstance(error, CaseError) else [str(error)]
    case, about = getattr(args, "case", None), error.status in (1, 4)
    return [f"{case}: {line}" if about and case and case not in line else line for line in lines]


PROGRAM = Program(
    "lacsolver",
    __name__,
    "Solve contact problems with the Local Average Contact method: a case file says what, lacmesh cuts the mesh.",
    EPILOG,
    COMMANDS,
    _told,
    _left,
    'there is not enough memory for this model; a coarser mesh needs less, and so does [solver] backend = "multigrid"',
)
