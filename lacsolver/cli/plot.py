"""`lacsolver plot`: a picture of the contact of a run, or columns of its history over time."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lacmesh.cli.options import pending_output
from lacmesh.errors import RequestError
from lacsolver.cli.options import add_command, add_folder, folder_of, print_size
from lacsolver.cli.ranks import check_alone

#: options of a picture of contact, and the values that stand for "not given"
_OF_CONTACT: dict[str, Any] = {"field": None, "zone": [], "time": None, "zoom": False, "ring": False}


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "plot", run, "draw the contact of a run, or columns of its history.csv over time")
    add_folder(parser)
    parser.add_argument(
        "--field",
        metavar="FIELD",
        help="pressure (default), recovered, gap, status; with friction also slip, shear, path, use",
    )
    parser.add_argument(
        "--zone", action="append", default=[], metavar="NAME", help="only this contact or tie; may be repeated"
    )
    parser.add_argument(
        "--time", type=float, metavar="T", help="a time of which fields were written (default: the last)"
    )
    parser.add_argument("--zoom", action="store_true", help="show only the surroundings of what is under pressure")
    parser.add_argument("--ring", action="store_true", help="draw the whole ring of a sector ([[cyclic]])")
    parser.add_argument(
        "--history",
        nargs="*",
        metavar="COLUMN",
        help="in place of the contact: columns of history.csv over time, or patterns such as 'energy.*' (default: all "
        "energies, or all reactions)",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE.png", help="the picture (default: in the folder, named like the field)"
    )
    parser.add_argument("--title", help="a line above (default: the folder's name)")
    parser.add_argument("--force", action="store_true", help="replace an existing output")


def run(args: argparse.Namespace) -> None:
    """Draw the contact, or the columns."""
    check_alone()
    folder = folder_of(args)
    of_contact = [name for name, none in _OF_CONTACT.items() if getattr(args, name) != none]
    if args.history is not None and of_contact:
        raise RequestError(f"--{of_contact[0]} is for a picture of the contact, and --history draws columns over time")
    name = "history" if args.history is not None else args.field or "pressure"
    target = Path(args.output) if args.output else folder / f"{name}.png"
    args.left = pending_output(target, force=args.force)
    if args.history is not None:
        from lacsolver.pictures.history import check_plot_history, plot_history

        check_plot_history(target)
        plot_history(folder, target, args.history, title=args.title)
    else:
        from lacsolver.pictures.drawing import plot

        title = args.title or folder.resolve().name
        plot(folder, target, field=name, zone=args.zone, time=args.time, zoom=args.zoom, ring=args.ring, title=title)
    print_size(target, args)
