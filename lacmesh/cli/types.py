"""`lacmesh types`: the supported cells and their subdivisions, with the nodes and elements added."""

from __future__ import annotations

import argparse
from typing import Any

from lacmesh.cli.options import add_command
from lacmesh.cli.terminal import console, table


def add(commands: Any) -> None:
    """Declare the command."""
    types = add_command(
        commands, "types", run, "list the supported cells and their subdivisions: nodes and elements added"
    )
    types.epilog = "Nodes and cells are those added for one slave face, skin and volume together."


def run(args: argparse.Namespace) -> None:
    """Print the table."""
    from lacmesh.cells import CELLS
    from lacmesh.report import pattern_table

    rows = table("cell", "slave face", "variant", "faces", "children", "++nodes", "++cells")
    previous = None
    for row in pattern_table():
        name = "" if row.cell == previous else row.cell
        previous = row.cell
        rows.add_row(name, row.face, row.variant, row.faces, row.children, str(row.added_nodes), str(row.added_cells))
    console().print(rows)
    skin = ", ".join(c.name for c in CELLS.values() if c.dim < 2)
    print(f"Also read and written: {skin}, and cells of higher order, which are left whole.")
    print("A skin without cells behind it (--skin-only) is cut as its faces are here; QUAD4 and QUAD8 follow --hexa.")
