"""The command `python -m verification`: a module for each of its commands beside it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from lacmesh.cli.program import Program
from lacmesh.errors import LacmeshError

#: in the order of the help
COMMANDS = ("list", "run", "report", "compare")
EPILOG = """\
Exit status: 0 every figure is met, 1 some fall short, 2 the command is wrong, 3 a file cannot be read or written,
130 interrupted, 143 terminated."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; the exit status."""
    return PROGRAM.main(argv)


def _told(error: LacmeshError, args: argparse.Namespace) -> list[str]:
    return [str(error)]


PROGRAM = Program(
    "verification",
    __name__,
    "Reproduce what the LAC method promises: cases with known solutions, and how near lacsolver comes to them.",
    EPILOG,
    COMMANDS,
    _told,
    "there is not enough memory; run fewer processes at once (-j 1)",
)
