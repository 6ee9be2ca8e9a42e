"""The command `lacmesh`: `program` runs its commands, which are functions of the other modules."""

from __future__ import annotations

from lacmesh.cli.checks import check, quality
from lacmesh.cli.cuts import cut, orient, split
from lacmesh.cli.files import compile_, convert, docs, example, info, partition
from lacmesh.cli.models import mesh_command, view
from lacmesh.cli.options import EPILOG
from lacmesh.cli.program import Program, Run
from lacmesh.errors import GroupNotFoundError, LacmeshError


def _error_lines(error: LacmeshError, run: Run) -> list[str]:
    """Lines of an error message; the file is put before an error about the mesh that does not name it."""
    message = str(error)
    about_mesh = error.status == 1 or isinstance(error, GroupNotFoundError)
    return [f"{run.source}: {message}" if about_mesh and run.source and run.source not in message else message]


PROGRAM = Program(
    "lacmesh",
    "Prepare meshes for Local Average Contact: subdivide the slave faces into macro-elements with an internal "
    "displacement node, check, measure, draw, partition and convert.",
    EPILOG,
    (example, cut, check, quality, orient, split, view, mesh_command, partition, info, convert, docs, compile_),
    error_lines=_error_lines,
    too_large="there is not enough memory for this mesh",
    of_file="info",
)
#: runs the command and returns its exit status
main = PROGRAM.main
