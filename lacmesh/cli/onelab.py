"""`lacmesh onelab`: gmsh's window with choices and buttons to cut, check and solve."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lacmesh.cli.options import add_command


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "onelab", run, "open a model in gmsh's window, with buttons to cut, check and solve")
    parser.add_argument("model", metavar="MODEL", help="mesh, or geometry: .msh, .geo, .step and others")


def run(args: argparse.Namespace) -> None:
    """Open the window, and return when it is closed."""
    from lacmesh.gmsh import onelab, session

    args.left = lambda: "files that Solve has written stay"
    gmsh = session.load()
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        onelab.open_model(Path(args.model))
        onelab.show(Path(args.model))
    finally:
        gmsh.finalize()
