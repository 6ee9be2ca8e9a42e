"""Reference of the commands, from their parsers."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from lacmesh.cli.program import Program
from web.markdown import escaped, table


def page(program: Program, start: str) -> str:
    """The page of a program that is started as `start`: each command with its usage, arguments and options."""
    parser = program.parser
    (commands,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    lines = [f"# Command {start}", "", escaped(parser.description or ""), ""]
    helps = {choice.dest: choice.help or "" for choice in commands._choices_actions}
    rows = [(f"[{name}](#{slug(start, name)})", escaped(helps.get(name, ""))) for name in commands.choices]
    lines += table(("command", "does"), rows)
    for name, command in commands.choices.items():
        lines += _command(f"{start} {name}", command)
    lines += ["## After the options", "", "```text", parser.epilog or "", "```", ""]
    return "\n".join(lines)


def slug(start: str, name: str) -> str:
    """The anchor of a command's heading."""
    return f"{start} {name}".replace(" ", "-").lower()


def _command(title: str, command: argparse.ArgumentParser) -> Iterator[str]:
    yield from (f"## {title}", "", escaped(command.description or ""), "")
    command.prog = title
    yield from ("```text", command.format_usage().removeprefix("usage: ").rstrip(), "```", "")
    rows = [(_names(action, command), escaped(_help(action, command))) for action in command._actions]
    yield from table(("argument", "meaning"), rows)
    if command.epilog:
        yield from ("```text", command.epilog.rstrip(), "```", "")


def _names(action: argparse.Action, command: argparse.ArgumentParser) -> str:
    """The argument as it is typed: `-o FILE, --output FILE`."""
    invocation = command._get_formatter()._format_action_invocation(action)
    return f"`{invocation}`".replace("|", r"\|")


def _help(action: argparse.Action, command: argparse.ArgumentParser) -> str:
    return command._get_formatter()._expand_help(action) if action.help else ""
