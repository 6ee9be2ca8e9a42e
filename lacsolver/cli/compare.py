"""`lacsolver compare`: the figures of two runs side by side."""

from __future__ import annotations

import argparse
import math
from typing import Any

from lacsolver.cli.options import add_command
from lacsolver.cli.ranks import check_alone


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "compare", run, "compare the figures of two runs at their last step")
    parser.add_argument("folders", nargs=2, metavar="DIR", help="folder of a run")
    parser.add_argument("--all", action="store_true", help="list what is the same, too")


def run(args: argparse.Namespace) -> None:
    """Print the figures that differ, the largest difference of all, and how many are the same."""
    from lacmesh.cli.terminal import console, table
    from lacsolver.reporting.comparing import compare_runs

    check_alone()
    compared = compare_runs(*args.folders)
    differing = [row for row in compared if not row.same]
    shown = compared if args.all else differing
    if shown:
        rows = table("figure", *(f"+{folder}" for folder in args.folders), "++difference")
        for name, first, second, difference in shown:
            share = "" if math.isnan(difference) else f"{100 * difference:.3g} %"
            rows.add_row(name, _words(first), _words(second), share)
        console().print(rows)
    print(f"{len(compared) - len(differing)} of {len(compared)} figures are the same, but for round-off")


def _words(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, list):
        return ", ".join(_words(part) for part in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
