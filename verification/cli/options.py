"""Declaration of the commands' arguments."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from lacmesh.cli.options import add_command as add_lacmesh_command
from verification.records import SUITES


def add_command(commands: Any, name: str, run: Callable[..., None], text: str) -> argparse.ArgumentParser:
    """Declare a command with the options common to all commands; `text` is its line in the help."""
    from verification.cli import EPILOG

    parser = add_lacmesh_command(commands, name, run, text)
    parser.epilog = EPILOG
    return parser


def add_choice(parser: argparse.ArgumentParser, suite: str) -> None:
    """Declare the arguments that select cases."""
    words = {"quick": "10 minutes on two cores", "full": "90 minutes", "all": "hours"}
    which = ", ".join(f"{name} ({words[name]})" for name in SUITES)
    text = f"{which}; default: {suite}, or the first that has the family"
    parser.add_argument("--suite", choices=SUITES, help=text)
    parser.set_defaults(default_suite=suite)
    parser.add_argument("--family", metavar="F", help="the cases of one family")
    parser.add_argument("--case", metavar="C", help="one case, by its name or as family/name")
