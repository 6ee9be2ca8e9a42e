"""`lacmesh completion`: the script by which bash, zsh or fish completes the commands, their options and files."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import add_command

if TYPE_CHECKING:
    from lacmesh.cli.program import Program

SHELLS = ("bash", "zsh", "fish")
#: where each shell looks for the script of a program
PLACES = {
    "bash": "~/.local/share/bash-completion/completions/{0}",
    "zsh": "~/.zfunc/_{0}",
    "fish": "~/.config/fish/completions/{0}.fish",
}


def add(commands: Any) -> None:
    """Declare the command."""
    declare(commands, "lacmesh", run)


def declare(commands: Any, program: str, function: Any) -> None:
    """Declare the command of a program, which lacsolver has too."""
    parser = add_command(commands, "completion", function, "print the script by which a shell completes the commands")
    lines = [f"{shell}: {program} completion {shell} > {place.format(program)}" for shell, place in PLACES.items()]
    zsh = "zsh also needs, in ~/.zshrc: fpath+=(~/.zfunc); autoload -Uz compinit; compinit"
    parser.epilog = "\n".join([*lines, zsh])
    parser.add_argument("shell", choices=SHELLS, help="the shell")


def run(args: argparse.Namespace) -> None:
    """Print the script."""
    from lacmesh.cli import PROGRAM

    print_script(PROGRAM, args.shell)


def print_script(program: Program, shell: str) -> None:
    """Print the script of a program for a shell as it is, tabs and all."""
    out = getattr(sys.stdout, "out", sys.stdout)  # past what escapes names from files
    out.write(script(program, shell))


def script(program: Program, shell: str) -> str:
    """Return the script of a program for a shell. File names are completed by suffix."""
    import shtab

    parser = program.parser
    patterns = _patterns()
    for action in _arguments(parser):
        name = " ".join(action.metavar) if isinstance(action.metavar, tuple) else action.metavar
        action.metavar = name
        if name in patterns:
            action.complete = shtab.glob(*patterns[name]) if patterns[name] else shtab.DIRECTORY  # type: ignore[attr-defined]
    return shtab.complete(parser, shell)


def _arguments(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the arguments of all commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _arguments(command)
        else:
            yield action


def _patterns() -> dict[str, tuple[str, ...]]:
    """Return what an argument takes, by its name in the help: patterns of files; none for folders."""
    from lacmesh.formats.registry import SUFFIXES
    from lacmesh.gmsh.cad import SUFFIXES as OF_CAD

    meshes, cad = (tuple(f"*{suffix}" for suffix in table) for table in (SUFFIXES, OF_CAD))
    named = ("CASE.toml", "MODEL.inp", "FILE.html", "FILE.png", "FILE.npz")
    return {
        **dict.fromkeys(("IN", "OUT", "MESH"), meshes),
        "CAD": cad,
        "FILE": ("*", ".*"),
        "DIR": (),
        **{name: _of_suffix(name.partition(".")[2]) for name in named},
    }


def _of_suffix(suffix: str) -> tuple[str, str]:
    """Return two patterns: of one alone, in brackets as shtab writes it, zsh takes the brackets for a qualifier."""
    return f"*.{suffix}", f"*.{suffix.upper()}"
