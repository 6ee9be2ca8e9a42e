"""`lacsolver matrices`: contact matrices B, G, w of the zones of a case, for use in another solver."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lacmesh.cli.options import pending_output
from lacmesh.cli.terminal import Stages
from lacmesh.errors import RequestError, did_you_mean
from lacsolver.cli.options import add_case, add_command
from lacsolver.cli.ranks import check_alone


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands,
        "matrices",
        run,
        "write the contact matrices of a case, for another solver; no material or load is needed",
    )
    add_case(parser)
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="FILE.npz",
        help="the output; with several zones one FILE-ZONE.npz for each",
    )
    parser.add_argument("--mtx", action="store_true", help="also write B in Matrix Market format")
    parser.add_argument("--force", action="store_true", help="replace existing outputs")


def run(args: argparse.Namespace) -> None:
    """Write the matrices of a case."""
    from lacmesh.cutting.records import is_cut
    from lacsolver.case import check_groups, read_case
    from lacsolver.matrices import contact_matrices, write_matrices
    from lacsolver.problem.roles import with_roles
    from lacsolver.problem.skin import mesh_of

    check_alone()
    output = Path(args.output)
    if output.suffix.lower() != ".npz":
        raise RequestError(f"{output}: matrices are written as .npz{did_you_mean(output.suffix, ['.npz'])}")
    case = read_case(args.case, matrices=True)
    stage = Stages(args, ("pair", "write"))
    with stage("pair"):
        mesh = mesh_of(case)
        if any(zone.surfaces for zone in (*case.contact, *case.ties)):
            check_groups(case, mesh)
            case = with_roles(case, mesh)
        targets = places([zone.name for zone in (*case.contact, *case.ties)], output)
        for target in targets.values():
            for path in (target, *([target.with_suffix(".mtx")] if args.mtx else [])):
                args.left = pending_output(path, force=args.force)
        matrices_of = contact_matrices(case, mesh)
    with stage("write"):
        for name, matrices in matrices_of.items():
            rubs = any(record.name == name and record.has_friction for record in case.contact)
            write_matrices(targets[name], matrices, mtx=args.mtx, friction=rubs)
    if not args.quiet:
        for name, matrices in matrices_of.items():
            rows, columns = matrices.B.shape
            also = f" and {targets[name].with_suffix('.mtx').name}" if args.mtx else ""
            print(f"{name}: B {rows:,} x {columns:,}, {matrices.B.nnz:,} entries: {targets[name]}{also}")
        if not is_cut(mesh):
            print("the columns follow the nodes of the cut mesh; lacmesh cut writes that mesh")
        print(f"{args.case}: {stage.spent()}")


def places(zones: Iterable[str], output: Path) -> dict[str, Path]:
    """Return the file of each zone: `output`, or FILE-ZONE.npz if there are several."""
    from lacsolver.output.names import CONTACT, contact_stems

    stems = contact_stems(zones)
    if len(stems) == 1:
        return dict.fromkeys(stems, output)
    return {
        zone: output.with_name(f"{output.stem}-{stem.removeprefix(CONTACT)}{output.suffix}")
        for zone, stem in stems.items()
    }
