"""`lacsolver example`: the cases that come with lacsolver, as a list or copied into a folder."""

from __future__ import annotations

import argparse
from typing import Any

from lacmesh.cli.example import declare, offer
from lacsolver.cli.options import add_command


def add(commands: Any) -> None:
    """Declare the command."""
    declare(add_command(commands, "example", run, "list the cases that come with lacsolver, or copy one here"))


def run(args: argparse.Namespace) -> None:
    """List the cases, or copy one with its mesh."""
    from lacmesh.examples import CASES

    offer(CASES, args)
