"""`lacmesh view`: draw a picture of a mesh, or make a page that turns it in a browser."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import (
    add_command,
    add_mesh_option,
    add_skin_options,
    check_skins,
    pending_output,
    sides,
    skins,
)
from lacmesh.cli.terminal import Stages

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh

PICTURES = (".png",)


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "view", run, "draw a mesh: a picture (.png), or a page that opens offline (.html)")
    parser.add_argument("input", metavar="IN", help="mesh, cut or not")
    parser.add_argument("-o", "--output", required=True, metavar="FILE", help="the suffix says which: .png, .html")
    add_skin_options(parser, "slave skin (default: all of a cut)", "master skin")
    parser.add_argument("--check", action="store_true", help="mark the cells that `lacmesh check` finds fault with")
    parser.add_argument(
        "--quality",
        nargs="?",
        const="corner_jacobian",
        metavar="MEASURE",
        help="colour cells by a measure of their quality (default: corner_jacobian)",
    )
    direction = {"nargs": 3, "type": float, "metavar": ("X", "Y", "Z")}
    parser.add_argument("--camera", **direction, help="direction from the mesh to the eye")  # type: ignore[arg-type]
    parser.add_argument("--cutaway", **direction, help="leave out cells beyond the middle in this direction")  # type: ignore[arg-type]
    parser.add_argument(
        "--explode",
        type=float,
        metavar="GAP",
        help="gap between bodies, in sizes of the mesh, 0 to 100; 0: as they are",
    )
    parser.add_argument(
        "--bodies",
        choices=("solid", "ghost", "hidden"),
        help="ghost: see-through, so that nothing hides the skins; hidden: the skins alone (default: solid, or ghost"
        " where nothing can be moved to show the slave skin)",
    )
    parser.add_argument("--size", type=_size, metavar="WxH", help="pixels of a picture (default: 1600x1000)")
    parser.add_argument("--title", help="a line above (default: the file's name, or what the mesh holds)")
    parser.add_argument("--force", action="store_true", help="replace an existing output")
    add_mesh_option(parser)


def run(args: argparse.Namespace) -> None:
    """Draw a file."""
    target = Path(args.output)
    from lacmesh.view import check_request

    check_skins(args, needed=False)
    check_request(target, size=args.size, camera=args.camera, cutaway=args.cutaway, explode=args.explode)
    args.left = pending_output(target, force=args.force)
    from lacmesh.formats import read

    stage = Stages(args, ("read", "look", "draw"))
    with stage("read"):
        mesh = read(args.input, mesh=args.mesh)
    with stage("look"):
        shown = _shown(mesh, args)
    with stage("draw"):
        if target.suffix.lower() in PICTURES:
            from lacmesh.view import picture

            tilt = 0.0 if args.explode == 0 else None
            picture(mesh, target, size=args.size or (1600, 1000), tilt=tilt, title=args.title, **shown)
        else:
            from lacmesh.view import page

            page(mesh, target, title=args.title or Path(args.input).name, **shown)
    if not args.quiet:
        print(f"{target}: {target.stat().st_size / 1e6:.1f} MB; {stage.spent()}")


def _shown(mesh: Mesh, args: argparse.Namespace) -> dict[str, Any]:
    """Options that a picture and a page share, as keyword arguments."""
    groups = skins(mesh, args, checked=args.check)
    shown: dict[str, Any] = {
        "slave": groups["slave"],
        "master": groups["master"] or None,
        "camera": args.camera and tuple(args.camera),
        "cutaway": args.cutaway and tuple(args.cutaway),
        "explode": args.explode,
        "bodies": args.bodies,
    }
    if args.check:
        from lacmesh.checks import check

        groups["slave"] = groups["slave"] or mesh.zones
        shown["findings"] = check(mesh, **sides(groups))
    if args.quality:
        from lacmesh.view import cell_values

        shown["values"] = cell_values(mesh, args.quality)
    return shown


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"{text!r} is no size; write it as 1600x1000")
    return int(width), int(height)
