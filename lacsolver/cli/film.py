"""`lacsolver film`: a film, or a sheet of pictures, of the results of a run or of a natural mode."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lacmesh.cli.options import pending_output
from lacsolver.cli.options import add_command, add_folder, folder_of, print_size
from lacsolver.cli.ranks import check_alone

#: quantities that may be shown: the keys of lacsolver.pictures.frames.COLOURS and of quantities.QUANTITIES
COLOURS = ("stress", "pressure", "recovered", "gap", "status", "slip", "shear", "path", "use")


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "film",
        run,
        "make a film of a run or a natural mode, or a sheet of pictures, with curves of a run's history",
    )
    add_folder(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="a film (.gif) or a sheet of pictures (.png)"
    )
    parser.add_argument(
        "--colour",
        "--field",
        choices=COLOURS,
        default="stress",
        help="on bodies the von Mises stress (default), or the contact pressure on slaves; others show each zone",
    )
    parser.add_argument(
        "--mode",
        type=int,
        metavar="N",
        help="film the natural mode N of a folder that lacsolver modes wrote, coloured by its displacement",
    )
    parser.add_argument(
        "--curve",
        action="append",
        default=[],
        metavar="X:Y",
        help="two columns of history.csv; - before a column changes its sign; may be repeated (default: the reaction "
        "that varies most, against the displacement of the probe of the same name, or time)",
    )
    parser.add_argument(
        "--frames",
        type=int,
        metavar="N",
        help="largest number of times shown (default: 60 in a film, 24 of a mode, 6 on a sheet)",
    )
    parser.add_argument("--scale", nargs=2, type=float, metavar=("LOW", "HIGH"), help="ends of the colour scale")
    parser.add_argument("--log", action="store_true", help="a logarithmic colour scale")
    parser.add_argument("--camera", nargs=3, type=float, metavar=("X", "Y", "Z"), help="in 3D: direction to the eye")
    parser.add_argument("--rate", type=float, default=12.0, metavar="N", help="frames per second (default: 12)")
    parser.add_argument("--title", help="a line above (default: the folder's name)")
    parser.add_argument("--force", action="store_true", help="replace an existing output")


def run(args: argparse.Namespace) -> None:
    """Make a film."""
    from lacsolver.pictures.filming import CAMERA, check_film, film

    check_alone()
    folder, target = folder_of(args), Path(args.output)
    check_film(target, folder)
    args.left = pending_output(target, force=args.force)
    film(
        folder,
        target,
        colour=args.colour,
        curves=args.curve,
        frames=args.frames,
        scale=args.scale and tuple(args.scale),
        log=args.log,
        camera=tuple(args.camera or CAMERA),
        rate=args.rate,
        title=args.title,
        mode=args.mode,
    )
    print_size(target, args)
