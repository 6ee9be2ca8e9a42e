"""`lacmesh orient`: orient the faces of a skin outward."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import add_command, add_output_options, output_of, pending_mesh, write_mesh

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh
    from lacmesh.topology.orientation import SkinOrientation


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "orient", run, "orient the faces of a skin outward")
    parser.add_argument("input", metavar="IN", help="mesh")
    parser.add_argument("--group", action="append", required=True, metavar="GROUP", help="the skin; may be repeated")
    parser.add_argument("-o", "--output", metavar="OUT", help="default: beside the input, with .out before its suffix")
    add_output_options(parser)


def run(args: argparse.Namespace) -> None:
    """Orient the skins of a file outward."""
    from lacmesh.formats import read
    from lacmesh.topology.orientation import analyse_orientation, reverse, skin_cells

    source = Path(args.input)
    target = output_of(args, "out")
    args.left = pending_mesh(target, args)
    mesh = read(source, mesh=args.mesh)
    said = []
    for group in args.group:
        cells = skin_cells(mesh, group)
        orientation = analyse_orientation(mesh, cells)
        mesh = reverse(mesh, orientation.to_flip)
        said += _report(mesh, group, len(cells), orientation)
    write_mesh(target, mesh, source, args)
    if not args.quiet:
        print("\n".join([*said, f"written to {target}"]))


def _report(mesh: Mesh, group: str, count: int, orientation: SkinOrientation) -> list[str]:
    """Lines that say what was done to the faces of a group."""
    lines = [f"{group}: {len(orientation.to_flip):,} of {count:,} {'face' if count == 1 else 'faces'} flipped"]
    for cells, what in (
        (orientation.interface, "between two cells, with no outward side, left as they are"),
        (orientation.open, "with no cell behind and enclosing nothing, made to agree; outward is for you to say"),
        (orientation.one_sided, "on a skin with one side only, which cannot agree, left as they are"),
    ):
        if len(cells):
            lines.append(f"{group}: {what}: {len(cells):,} ({mesh.cell_names(cells)})")
    return lines
