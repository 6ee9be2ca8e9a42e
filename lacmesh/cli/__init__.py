"""The command `lacmesh`: one module for each of its commands; `program` runs them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from lacmesh.cli.options import EPILOG
from lacmesh.cli.program import Program
from lacmesh.errors import GroupNotFoundError, LacmeshError

#: in the order of the help
COMMANDS = (
    "example",
    "cut",
    "check",
    "quality",
    "orient",
    "split",
    "view",
    "mesh",
    "partition",
    "info",
    "convert",
    "compile",
    "completion",
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    return PROGRAM.main(argv)


def _error_lines(error: LacmeshError, args: argparse.Namespace) -> list[str]:
    """Lines of an error message; the file is put before an error about the mesh that does not name it."""
    message, source = str(error), getattr(args, "input", None)
    about_mesh = error.status == 1 or isinstance(error, GroupNotFoundError)
    return [f"{source}: {message}" if about_mesh and source and source not in message else message]


PROGRAM = Program(
    "lacmesh",
    __name__,
    "Prepare meshes for Local Average Contact: subdivide the slave faces into macro-elements with an internal "
    "displacement node, check, measure, draw, partition and convert.",
    EPILOG,
    COMMANDS,
    _error_lines,
    "there is not enough memory for this mesh",
    "info",
    collects=False,  # a short life of large arrays and no cycles: collecting would only cost time
)
