"""`lacmesh split`: divide a mesh along interior faces into two skins, as a crack, a joint or a bolt's section."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import add_command, add_output_options, output_of, pending_mesh, write_mesh
from lacmesh.cli.terminal import Stages, console, table

if TYPE_CHECKING:
    from lacmesh.cutting.split import Split
    from lacmesh.mesh import Mesh


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "split", run, "divide a mesh along faces inside a body into two skins, G_a and G_b, that touch"
    )
    parser.add_argument("input", metavar="IN", help="mesh, not cut yet")
    parser.add_argument(
        "--faces",
        action="append",
        required=True,
        metavar="G",
        help="group of faces inside a body (edges in a plane mesh), whose normals point from side a to side b; "
        "may be repeated",
    )
    parser.add_argument("-o", "--output", metavar="OUT", help="default: next to IN, with .split before its suffix")
    add_output_options(parser)


def run(args: argparse.Namespace) -> None:
    """Divide a file's mesh."""
    from lacmesh.cutting.split import split_skins
    from lacmesh.formats import read

    source = Path(args.input)
    target = output_of(args, "split")
    stage = Stages(args, ("read", "split", "write"))
    args.left = pending_mesh(target, args)
    with stage("read"):
        mesh = read(source, mesh=args.mesh)
    with stage("split"):
        parts = split_skins(mesh, args.faces)
    with stage("write"):
        write_mesh(target, parts.mesh, source, args)
    if not args.quiet:
        _print_summary(mesh, parts, source, target)
        print(f"{target}: {stage.spent()}")


def _print_summary(mesh: Mesh, parts: Split, source: Path, target: Path) -> None:
    rows = table(f"{source.name} -> {target.name}", "before", "after")
    rows.add_row("nodes", f"{mesh.n_nodes:,}", f"{parts.mesh.n_nodes:,}")
    rows.add_row("cells", f"{mesh.n_cells:,}", f"{parts.mesh.n_cells:,}")
    rows.add_row("bodies", *(f"{n:,}" for n in parts.bodies))
    rows.add_section()
    for name, skins in parts.skins.items():
        n_faces = len(parts.mesh.cell_groups[skins[0]])
        rows.add_row(f"faces of {name} in {skins[0]}, {skins[1]}", f"{n_faces:,}", f"{2 * n_faces:,}")
    front, junction = int((parts.n_sides == 1).sum()), int((parts.n_sides > 2).sum())
    if front:
        rows.add_row("nodes on the front, shared by both sides: closed", f"{front:,}", f"{front:,}")
    if junction:
        sides = int(parts.n_sides[parts.n_sides > 2].sum())
        rows.add_row("nodes where three or more sides meet, one for each", f"{junction:,}", f"{sides:,}")
    console().print(rows)
