"""`lacmesh example`: the meshes that come with lacmesh, as a list or copied into a folder."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import add_command

if TYPE_CHECKING:
    from lacmesh.examples import Example


def add(commands: Any) -> None:
    """Declare the command."""
    declare(add_command(commands, "example", run, "list the meshes that come with lacmesh, or copy one here"))


def declare(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments, which lacsolver's command has too."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="the example (default: list all)")
    parser.add_argument("-o", "--output", metavar="DIR", default=".", help="folder for its files (default: this one)")
    parser.add_argument("--force", action="store_true", help="replace existing files")


def run(args: argparse.Namespace) -> None:
    """List the meshes, or copy one."""
    from lacmesh.examples import MESHES

    offer(MESHES, args)


def offer(examples: Mapping[str, Example], args: argparse.Namespace) -> None:
    """List examples, or copy the one that is named, and print the command to try."""
    from lacmesh.examples import copy_example, example_of

    if args.name is None:
        wide = max(map(len, examples))
        for name, one in examples.items():
            print(f"{name:{wide}}  {one.words}")
        return
    chosen = example_of(args.name, examples)
    copied = copy_example(chosen, Path(args.output), force=args.force)
    if not args.quiet:
        print(f"{', '.join(map(str, copied))}; next: {_in(chosen.command, copied[0])}")


def _in(command: str, path: Path) -> str:
    """Return a command with the path of the file that it takes."""
    return command.replace(f" {path.name}", f" {path}", 1)
