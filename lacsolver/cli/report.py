"""`lacsolver report`: a page on a finished run, with its turning model, pictures, curves, loads and case."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lacmesh.cli.options import pending_output
from lacsolver.cli.options import add_command, add_folder, folder_of, print_size
from lacsolver.cli.ranks import check_alone


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "report", run, "write a page on a run: the turning model, pictures, curves, the case"
    )
    add_folder(parser)
    parser.add_argument("-o", "--output", metavar="FILE.html", help="the page (default: report.html in the folder)")
    parser.add_argument("--case", metavar="CASE.toml", help="the case to show (default: the one beside the folder)")
    parser.add_argument("--force", action="store_true", help="replace an existing output")


def run(args: argparse.Namespace) -> None:
    """Write the page."""
    from lacsolver.reporting.outline import check_report, write_run_report

    check_alone()
    folder = folder_of(args)
    target = Path(args.output) if args.output else folder / "report.html"
    check_report(target)
    args.left = pending_output(target, force=args.force)
    write_run_report(folder, target, case=args.case)
    print_size(target, args)
