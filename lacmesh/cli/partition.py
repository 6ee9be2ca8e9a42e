"""`lacmesh partition`: the parts of a mesh for several processes, in a folder."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import add_command, add_mesh_option, left_at
from lacmesh.cli.terminal import Stages

if TYPE_CHECKING:
    from lacmesh.mesh import Ints, Mesh


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "partition", run, "divide a mesh into parts, of which each process of a parallel run reads its own"
    )
    parser.add_argument("input", metavar="IN")
    parser.add_argument("-n", "--parts", type=int, required=True, metavar="N", help="number of parts")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder (default: next to the input, with suffix .parts)")
    parser.add_argument(
        "--method",
        choices=("bisection", "metis"),
        default="bisection",
        help="recursive bisection of the coordinates, or METIS on the graph of nodes, which needs pymetis "
        "(default: bisection)",
    )
    parser.add_argument("--force", action="store_true", help="replace existing parts")
    add_mesh_option(parser)


def run(args: argparse.Namespace) -> None:
    """Divide a mesh into parts."""
    from lacmesh.formats import read
    from lacmesh.partition.store import FILE, check_folder, describe_parts, write_parts

    source = Path(args.input)
    folder = Path(args.output) if args.output else _beside(source)
    stage = Stages(args, ("read", "divide", "write"))
    args.left = left_at(folder / FILE)
    check_folder(folder, force=args.force)
    with stage("read"):
        mesh = read(source, mesh=args.mesh)
    with stage("divide"):
        owner = _distribute(mesh, args)
    with stage("write"):
        write_parts(folder, mesh, owner, force=args.force)
    if not args.quiet:
        described = describe_parts(folder)
        nodes = described["parts"]["nodes"]
        print(f"{source}: {args.parts:,} parts of {min(nodes):,} to {max(nodes):,} nodes, ", end="")
        print(f"{described['copies']:.2f} copies of a node; written to {folder}")
        print(stage.spent())


def _beside(source: Path) -> Path:
    """Return the default folder: the input's name with the suffix .parts. Raises ReadError if there is no input."""
    from lacmesh.formats import detect_format

    detect_format(source)
    return source.with_suffix(".parts")


def _distribute(mesh: Mesh, args: argparse.Namespace) -> Ints:
    """Distribute the nodes of a mesh by the method that was asked for."""
    if args.method == "metis":
        from lacmesh.partition.owners import distribute_by_metis

        return distribute_by_metis(mesh, args.parts)
    from lacmesh.partition import distribute_nodes

    return distribute_nodes(mesh, args.parts)
