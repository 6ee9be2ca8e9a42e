"""`lacsolver new`: a first case for a mesh, with its groups and the skins that lie opposite one another."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

from lacmesh.cli.options import pending_output
from lacmesh.errors import RequestError
from lacsolver.cli.options import add_command
from lacsolver.cli.ranks import check_alone


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "new", run, "write a first case for a mesh: its groups, and skins that may touch")
    parser.add_argument("mesh", metavar="MESH", help="the mesh, cut or not")
    parser.add_argument(
        "-o", "--output", metavar="CASE.toml", help="the case file (default: beside the mesh, with .toml)"
    )
    parser.add_argument("--force", action="store_true", help="replace an existing output")


def run(args: argparse.Namespace) -> None:
    """Write the case."""
    import lacmesh
    from lacmesh.formats.output import replace_file
    from lacsolver.first_case import facing_pairs, first_case

    check_alone()
    source = Path(args.mesh)
    target = Path(args.output) if args.output else source.with_suffix(".toml")
    if target.suffix != ".toml":
        raise RequestError(f"{target}: a case file is called .toml; name it so")
    args.left = pending_output(target, force=args.force)
    mesh = lacmesh.read(source)
    pairs = facing_pairs(mesh)
    text = first_case(mesh, os.path.relpath(source, target.parent), pairs)
    replace_file(target, text.encode())
    if not args.quiet:
        touching = "; ".join(f"{a!r} and {b!r}" for a, b in pairs) or "no two skins that lie opposite one another"
        print(f"{target}: {touching}")
        print(f"next: fill in material, supports and loads, then lacsolver validate {target}")
