"""`lacmesh cut`: cut the slave skin, and the cells behind it, into macro-elements."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import (
    add_command,
    add_facing_options,
    add_output_options,
    add_program_option,
    add_recognition_options,
    add_skin_options,
    check_skins,
    facing_options,
    output_of,
    pending_mesh,
    sides,
    skins,
    write_mesh,
)
from lacmesh.cli.terminal import Stages, console, table
from lacmesh.errors import DataError, LacmeshWarning, RequestError

if TYPE_CHECKING:
    from lacmesh.checks import Findings
    from lacmesh.cutting.cut import Cut
    from lacmesh.mesh import Mesh
    from lacmesh.report import CutReport, CutSummary
    from lacmesh.report.touched import Touched


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "cut", run, "subdivide the slave faces, and the cells behind them, into macro-elements"
    )
    parser.add_argument("input", metavar="IN", help="mesh: .msh, .med, .mail, .inp, .vtu, .xdmf and more")
    add_skin_options(
        parser,
        "slave skin",
        "master skin: the cut is checked against it (as by lacmesh check), and not written if the check finds an error",
    )
    add_facing_options(parser)
    parser.add_argument("-o", "--output", metavar="OUT", help="default: next to the input, with .lac before its suffix")
    parser.add_argument(
        "--hexa",
        choices=("pyramid", "hexa", "auto"),
        default="pyramid",
        help="subdivision of hexahedra; auto: the variant with the higher minimum Jacobian (default: pyramid)",
    )
    parser.add_argument(
        "--interface",
        choices=("both", "refuse"),
        default="both",
        help="internal face: subdivide both sides, or stop (default: both)",
    )
    parser.add_argument(
        "--orient",
        choices=("keep", "outward"),
        default="keep",
        help="orientation of slave faces: keep it, or flip faces that point inward (default: keep)",
    )
    parser.add_argument("--skin-only", action="store_true", help="cut a surface without parent cells (a shell)")
    parser.add_argument(
        "--node-groups",
        choices=("extend", "keep"),
        default="extend",
        help="node sets gain new nodes when all corners belong (default: extend)",
    )
    parser.add_argument(
        "--min-quality",
        type=_number,
        metavar="X",
        help="write nothing if the minimum corner Jacobian of the new cells is below X (1: ideal, 0: flat)",
    )
    add_recognition_options(parser)
    add_program_option(parser, "stop before cutting if the cut would have cells that this program does not support")
    parser.add_argument(
        "--report",
        metavar="FILE",
        help="report on the effect of the cut on the cells: .html (opens offline), .md, .json",
    )
    add_output_options(parser)


def run(args: argparse.Namespace) -> None:
    """Cut a file."""
    from concurrent.futures import ThreadPoolExecutor

    from lacmesh.formats import read

    check_skins(args)
    source = Path(args.input)
    target = output_of(args, "lac")
    asked = {"check": args.master or args.pair, "report": args.report}
    stage = Stages(args, ("read", "cut", *(name for name, wanted in asked.items() if wanted), "write"))
    args.left = pending_mesh(target, args)
    if args.report:
        _check_report(target, args)
    with stage("read"):
        mesh = read(source, mesh=args.mesh)
    groups = skins(mesh, args)
    args.slave = groups["slave"]
    with stage("cut"):
        cut = _cut(mesh, args)
        done = cut.origin is None  # it was cut before, from what is not known
        cells = None if done or (args.min_quality is None and not args.report) else _touched(mesh, cut)
        if args.min_quality is not None:
            _refuse_poor(mesh, cut, args.min_quality, cells)
    report = findings = None
    if groups["master"]:
        with stage("check"):
            findings = _check(cut, sides(groups), args)
    if args.report:
        with stage("report"):
            report = _report(mesh, cut, findings, cells)
    with ThreadPoolExecutor(1) as beside:
        # beside the writing, which waits for the disk
        summary = None if args.quiet or done else beside.submit(_summarise, mesh, cut, report)
        with stage("write"), _beside_report(args, report):
            write_mesh(target, cut.mesh, source, args)
    if summary is not None:
        _print_summary(summary.result(), source, target, stage)
    elif done and not args.quiet:
        print(f"{source} is already cut on all of {', '.join(args.slave)}: written unchanged to {target}")
    if args.program == "aster" and not args.quiet:
        print(f"note: code_aster's own LAC contact cuts the mesh itself, by DECOUPE_LAC: give it {source}, not cut")
    if report is not None and not args.quiet:
        print(f"report: {args.report}")


def _cut(mesh: Mesh, args: argparse.Namespace) -> Cut:
    """Make the cut that the options ask for. Raises CutError if the program that it is for cannot take its cells."""
    from lacmesh.cutting.cut import cut_skin

    choices = {"hexa": args.hexa, "interface": args.interface, "skin_only": args.skin_only}
    choices |= {"recognise": args.recognise}
    if args.program:
        from lacmesh.exchange.targets import check_target_cells

        check_target_cells(mesh, args.slave, args.program, **choices)
    return cut_skin(mesh, args.slave, orient=args.orient, node_groups=args.node_groups, **choices)


def _check(cut: Cut, groups: dict[str, Any], args: argparse.Namespace) -> Findings:
    """Check the cut against its master: raise DataError for an error, warn of other findings, and return them all."""
    from lacmesh.checks import check
    from lacmesh.cli.check import warn_of

    findings = check(cut, **groups, **facing_options(args))
    if findings.errors:
        first, more = findings.errors[0], len(findings.errors) - 1
        others = f"; lacmesh check of a cut made without --master lists {more} more" if more else ""
        raise DataError(f"the cut is not usable for LAC: {first.rule}: {first.message}{others}")
    warn_of(findings)
    return findings


def _check_report(target: Path, args: argparse.Namespace) -> None:
    """Check early that the report can be written. Raises RequestError, WriteError."""
    from lacmesh.report import check_report

    if Path(args.report) == target:
        raise RequestError(f"{target} cannot be both the mesh and the report; name another file")
    check_report(Path(args.report), force=args.force)


def _touched(before: Mesh, cut: Cut) -> Touched:
    from lacmesh.report import touched

    return touched(before, cut)


def _refuse_poor(before: Mesh, cut: Cut, least: float, cells: Touched | None) -> None:
    """Raise CutError if the quality of a touched cell is below `least`; `cells`: None if the mesh was cut already."""
    from lacmesh.report import refuse_poor, refuse_poor_children

    if cells is None:
        refuse_poor_children(cut, least)
    else:
        refuse_poor(before, cut, least, cells)


def _report(before: Mesh, cut: Cut, findings: Findings | None, cells: Touched | None) -> CutReport | None:
    from lacmesh.report import cut_report

    if cells is None:
        message = "this mesh was cut before, from what is not known: no report is written; see lacmesh quality"
        warnings.warn(message, LacmeshWarning, stacklevel=1)
        return None
    return cut_report(before, cut, findings=findings, cells=cells)


@contextmanager
def _beside_report(args: argparse.Namespace, report: CutReport | None) -> Iterator[None]:
    """Write the report, if there is one; it takes its place only after the block has succeeded: both, or neither."""
    if report is None:
        yield
        return
    from lacmesh.formats.output import readable, replacing
    from lacmesh.report import report_bytes

    path = Path(args.report)
    with replacing(path) as (beside,):
        beside.write_bytes(report_bytes(path.suffix.lower(), report, readable(Path(args.input).name)))
        yield


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
    if value != value:
        raise argparse.ArgumentTypeError("NaN is no quality")
    return value


def _summarise(mesh: Mesh, cut: Cut, report: CutReport | None) -> CutSummary:
    import rich.console
    import rich.table  # noqa: F401  (what the printing will need)

    from lacmesh.report import summarise

    return summarise(mesh, cut) if report is None else report.summary


def _print_summary(summary: CutSummary, source: Path, target: Path, stage: Stages) -> None:
    out = console()
    rows = table(f"{source.name} -> {target.name}", "before", "after", "added")
    for name, (before, after) in (("nodes", summary.nodes), ("cells", summary.cells)):
        rows.add_row(name, f"{before:,}", f"{after:,}", f"+{after - before:,}")
    for zone, macros in summary.zones.items():
        rows.add_row(f"macro-elements of {zone}", "", f"{macros:,}", "")
    rows.add_section()
    for cell_type in dict.fromkeys([*summary.replaced, *summary.children]):
        old, new = summary.replaced.get(cell_type, 0), summary.children.get(cell_type, 0)
        rows.add_row(f"{cell_type} touched", f"{old:,}", f"{new:,}", f"{new - old:+,}")
    if summary.replaced:
        rows.add_row("worst quality of the touched cells", *(f"{q:.3f}" for q in summary.worst), "")
    else:
        rows.add_row("every slave face owns an internal dof already: no cell is cut", "", "", "")
    out.print(rows)
    if summary.worst[0] <= 0:
        message = "cells behind the slave faces were inverted or degenerate before the cut: their children are too"
        warnings.warn(message, LacmeshWarning, stacklevel=1)
    print(f"{target}: {stage.spent()}")
