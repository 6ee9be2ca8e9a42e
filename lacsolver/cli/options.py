"""Declarations of arguments that the commands share."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lacmesh.cli.options import add_command as add_lacmesh_command
from lacmesh.errors import ReadError, RequestError, did_you_mean

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


def add_folder(parser: argparse.ArgumentParser) -> None:
    """Declare the argument for the folder of a run."""
    parser.add_argument(
        "folder", metavar="DIR", help="folder of a run; or its CASE.toml, for the folder of the same name"
    )


def folder_of(args: argparse.Namespace) -> Path:
    """Return the folder of a run that was named, itself or by its case. Raises ReadError where there is none."""
    folder = Path(args.folder)
    folder = folder.with_suffix("") if folder.suffix == ".toml" else folder
    if not folder.exists():
        runs = [results.parent.name for results in folder.parent.glob("*/results.json")]
        raise ReadError(folder, f"a run with this folder does not exist{did_you_mean(folder.name, runs)}")
    return folder


def beside(case: Path, what: str, ending: str = "") -> Path:
    """Return the default folder of what a command writes: the case's name without its suffix, and an ending."""
    if not case.suffix:
        raise RequestError(f"{case} has no suffix to leave out for the folder of the {what}; name one with -o")
    return case.with_name(f"{case.stem}{ending}")


def print_size(target: Path, args: argparse.Namespace) -> None:
    """Print the size of a picture or film, unless the command is quiet."""
    if not args.quiet:
        print(f"{target}: {target.stat().st_size / 1e6:.2f} MB")
