"""`lacsolver completion`: the script by which bash, zsh or fish completes the commands, their options and files."""

from __future__ import annotations

import argparse
from typing import Any

from lacmesh.cli.completion import declare, print_script


def add(commands: Any) -> None:
    """Declare the command."""
    declare(commands, "lacsolver", run)


def run(args: argparse.Namespace) -> None:
    """Print the script."""
    from lacsolver.cli import PROGRAM

    print_script(PROGRAM, args.shell)
