"""`python -m verification compare`: what changed from one run to another."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from verification.cli.options import add_command


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "compare", run, "say what changed from one run to another")
    parser.add_argument("before", type=Path, metavar="DIR1")
    parser.add_argument("after", type=Path, metavar="DIR2")


def run(args: argparse.Namespace) -> None:
    """Print the differences."""
    from verification import report
    from verification.running.folder import read_run

    print(report.compare(read_run(args.before), read_run(args.after)))
