"""`lacsolver schema`: every key of a case file, as text for people or as JSON Schema for editors."""

from __future__ import annotations

import argparse
import json
from typing import Any

from lacsolver.cli.options import add_command


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "schema", run, "list every section and key of a case file, with units and defaults")
    parser.add_argument(
        "--json", action="store_true", help="as JSON Schema, with which editors check and complete TOML"
    )


def run(args: argparse.Namespace) -> None:
    """Print the table of keys."""
    from lacsolver.case.schema import json_schema, schema_text

    if args.json:
        print(json.dumps(json_schema(), ensure_ascii=False, indent=2, allow_nan=False))
    else:
        print(schema_text(), end="")
