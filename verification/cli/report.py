"""`python -m verification report`: the report of a run, written again."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from verification.cli.options import add_command


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "report", run, "write the report of a run again, from its folder")
    parser.add_argument("folder", type=Path, metavar="DIR", help="what `run -o` made")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="the page (default: DIR/report.html)")


def run(args: argparse.Namespace) -> None:
    """Write the page, and Markdown beside it; the results too where it is not in their folder."""
    from verification import report
    from verification.running.folder import read_run

    path = args.output or args.folder / "report.html"
    report.write(read_run(args.folder), path)
    if not args.quiet:
        print(path)
