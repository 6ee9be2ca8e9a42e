"""`lacsolver plot`: columns of a run's history over time, such as its energies and contact forces."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lacmesh.cli.options import pending_output
from lacsolver.cli.options import add_command, add_folder, folder_of, print_size
from lacsolver.cli.ranks import check_alone


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "plot", run, "draw columns of a run's history.csv over time")
    add_folder(parser)
    parser.add_argument(
        "--history",
        nargs="+",
        default=[],
        metavar="COLUMN",
        help="columns of history.csv, or patterns such as 'energy.*' (default: all energies, or all reactions)",
    )
    parser.add_argument("-o", "--output", metavar="FILE.png", required=True, help="the picture")
    parser.add_argument("--title", help="a line above (default: the folder's name)")
    parser.add_argument("--force", action="store_true", help="replace an existing output")


def run(args: argparse.Namespace) -> None:
    """Draw the columns."""
    from lacsolver.pictures.history import check_plot_history, plot_history

    check_alone()
    folder, target = folder_of(args), Path(args.output)
    check_plot_history(target)
    args.left = pending_output(target, force=args.force)
    plot_history(folder, target, args.history, title=args.title)
    print_size(target, args)
