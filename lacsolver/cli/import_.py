"""`lacsolver import`: the mesh and the case file of a deck of CalculiX or Abaqus."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import pending_output
from lacmesh.cli.terminal import Stages, console, table
from lacmesh.errors import RequestError
from lacsolver.cli.options import add_command
from lacsolver.cli.ranks import check_alone
from lacsolver.cli.validate import ACTING

if TYPE_CHECKING:
    from lacsolver.decks import Imported


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "import", run, "write the mesh and the case file of a deck of CalculiX or Abaqus (.inp)"
    )
    parser.add_argument("deck", metavar="MODEL.inp", help="the deck, with the files that it includes")
    parser.add_argument(
        "-o", "--output", metavar="CASE.toml",
        help="the case file (default: the deck's name with .toml); its mesh is beside it, with .med",
    )  # fmt: skip
    parser.add_argument(
        "--lenient", action="store_true",
        help="leave out cards that lacsolver has no place for, as friction, instead of refusing the deck",
    )  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace existing outputs")


def run(args: argparse.Namespace) -> None:
    """Import a deck. Raises CaseError with every card that changes the answer and is not taken."""
    import lacmesh
    from lacmesh.formats.output import replace_file
    from lacsolver.decks import import_deck

    check_alone()
    target = Path(args.output) if args.output else Path(args.deck).with_suffix(".toml")
    if target.suffix != ".toml":
        raise RequestError(f"{target}: a case file is called .toml; name it so")
    for path in (target.with_suffix(".med"), target):
        args.left = pending_output(path, force=args.force)
    stage = Stages(args, ("read", "write"))
    with stage("read"):
        imported = import_deck(args.deck, target, lenient=args.lenient)
    with stage("write"):
        lacmesh.write(target.with_suffix(".med"), imported.mesh, force=args.force)
        replace_file(target, imported.text.encode())
    for finding in imported.findings:
        if args.quiet and finding.level == "note":
            continue
        print(f"lacsolver: {finding.level}: {finding.text}", file=sys.stderr)
    if not args.quiet:
        _print(target, imported)
        print(f"{args.deck}: {stage.spent()}")


def _print(target: Path, imported: Imported) -> None:
    case, mesh = imported.case, imported.mesh
    rows = table("case", str(target))
    rows.add_row("model", f"{case.model}, {case.kinematics} strains")
    cells = ", ".join(f"{count:,} {kind}" for kind, count in mesh.cells_by_type.items())
    rows.add_row("mesh", f"{case.mesh}: {mesh.n_nodes:,} nodes, {cells}")
    rows.add_row("steps", f"{len(case.steps.planned)}, to t = {case.steps.last:g}")
    if case.dynamics is not None:
        rows.add_row("motion", f"with inertia, from t = {case.dynamics.start:g}")
    counts = Counter(str(path[0]) for path, _ in case.records())
    for name in ("material", "contact", "tie", "rigid", "initial", "probe"):
        if counts[name]:
            rows.add_row(name, f"{counts[name]}")
    rows.add_row("supports and loads", ", ".join(f"{counts[name]} {name}" for name in ACTING if counts[name]))
    console().print(rows)
    print(f"next: lacsolver validate {target}, lacsolver run {target}")
