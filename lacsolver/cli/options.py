"""Declarations of arguments that the commands share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any

from lacmesh.cli.options import add_command as add_lacmesh_command

EPILOG = """\
Exit status: 0 done, 1 the data are wrong, 2 the command is wrong, 3 a file cannot be read or written,
4 did not converge, 130 interrupted, 143 terminated."""


def add_command(commands: Any, name: str, run: Callable[..., None], text: str) -> argparse.ArgumentParser:
    """Declare a command, with the arguments that all commands take; `text` is its line in the help."""
    parser = add_lacmesh_command(commands, name, run, text)
    parser.epilog = EPILOG
    return parser


def add_case(parser: argparse.ArgumentParser) -> None:
    """Declare the argument for the case file."""
    parser.add_argument("case", metavar="CASE.toml", help="the case file (lacsolver schema lists its keys)")
