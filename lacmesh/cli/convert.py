"""`lacmesh convert`: the same mesh in another format, or of another order."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lacmesh.cli.options import add_command, add_output_options, add_program_option, pending_mesh, write_mesh


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "convert", run, "write a mesh in another format, or with elevated order; groups are kept"
    )
    parser.add_argument("input", metavar="IN")
    parser.add_argument("output", metavar="OUT", help="the suffix says the format (docs/formats.md)")
    parser.add_argument(
        "--order",
        choices=("2", "2-full"),
        help="raise linear cells to serendipity (2) or full quadratic (2-full: HEXA27 ...), curved on curved skins",
    )
    add_program_option(parser, "refuse cells that this program cannot take")
    add_output_options(parser)


def run(args: argparse.Namespace) -> None:
    """Convert a file."""
    from lacmesh.formats import read

    source, target = Path(args.input), Path(args.output)
    args.left = pending_mesh(target, args)
    mesh = read(source, mesh=args.mesh)
    if args.order:
        from lacmesh.cutting.order import raise_order

        mesh = raise_order(mesh, args.order)
    if args.program:
        from lacmesh.exchange.targets import check_cells

        check_cells(mesh, args.program)
    write_mesh(target, mesh, source, args)
    if not args.quiet:
        types = ", ".join(f"{n:,} {cell_type}" for cell_type, n in mesh.cells_by_type.items())
        groups = len(mesh.cell_groups) + len(mesh.node_groups)
        counts = f"{mesh.n_nodes:,} nodes, {mesh.n_cells:,} cells ({types}), {groups} group{'' if groups == 1 else 's'}"
        print(f"{source}: {counts}; written to {target}")
