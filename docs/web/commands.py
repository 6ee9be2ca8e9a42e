"""Reference of the commands, from their declarations."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from lacmesh.cli.program import Program
from web.markdown import escaped, table


def page(program: Program, start: str) -> str:
    """The page of a program that is started as `start`: each command with its examples, arguments and options."""
    group = program.group
    lines = [f"# Command {start}", "", escaped(group.help or ""), ""]
    rows = [(f"[{name}](#{slug(start, name)})", escaped(one.short_help or "")) for name, one in group.commands.items()]
    lines += table(("command", "does"), rows)
    for name, command in group.commands.items():
        lines += _command(f"{start} {name}", command)
    lines += ["## After the options", "", "```text", (group.epilog or "").lstrip("\b\n"), "```", ""]
    return "\n".join(lines)


def slug(start: str, name: str) -> str:
    """The anchor of a command's heading."""
    return f"{start} {name}".replace(" ", "-").lower()


def _command(title: str, command: Any) -> Iterator[str]:
    about, _, examples = command.help.partition("\b\n")
    yield from (f"## {title}", "", escaped(about.strip()), "")
    yield from ("```console", re.sub(r"^\$ \w+ \S+", f"$ {title}", examples, flags=re.MULTILINE), "```", "")
    context = command.context_class(command, info_name=title)
    rows = []
    for param in command.get_params(context):
        name, text = param.get_help_record(context)
        name = param.metavar if param.param_type_name == "argument" else name
        rows.append((f"`{name}`".replace("|", r"\|"), escaped(text)))
    yield from table(("argument", "meaning"), rows)
