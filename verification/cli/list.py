"""`python -m verification list`: the cases of a suite, and what they are made of."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lacmesh.cli.terminal import console, table
from verification.cli.options import add_choice, add_command

if TYPE_CHECKING:
    from verification.running.plan import Planned


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "list", run, "list the cases of a suite")
    add_choice(parser, "all")
    parser.add_argument("--json", action="store_true", help="as JSON, with all that each case is made of")


def run(args: argparse.Namespace) -> None:
    """Print the cases."""
    from verification.running.plan import plan, suite_of

    planned = plan(suite_of(args.suite, args.family, args.default_suite), args.family, args.case)
    if args.json:
        print(json.dumps([_record(p) for p in planned], indent=1))
        return
    rows = table("case", "levels", "what")
    for p in planned:
        rows.add_row(p.case.id, str(p.levels), p.case.description)
    console().print(rows)
    print(f"{len(planned)} cases, about {_minutes(planned)} minutes of one core")


def _record(planned: Planned) -> dict[str, Any]:
    from verification.running.folder import parameters_of

    case = planned.case
    named = {"family": case.family, "case": case.name, "about": case.description, "levels": dict(case.levels)}
    return {**named, "seconds": case.seconds, "alone": case.exclusive, "given": parameters_of(case)}


def _minutes(planned: Sequence[Planned]) -> str:
    return f"{sum(p.case.seconds for p in planned) / 60:.0f}"
