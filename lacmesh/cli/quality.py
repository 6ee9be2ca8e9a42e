"""`lacmesh quality`: count invalid and poor cells, print statistics of the measures, and list the worst cells."""

from __future__ import annotations

import argparse
import sys
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lacmesh.cli.options import add_command, add_mesh_option
from lacmesh.cli.terminal import Stages, as_json, console, table

if TYPE_CHECKING:
    from lacmesh.mesh import Mesh
    from lacmesh.quality.statistics import Histogram
    from lacmesh.quality.summary import Quality, TypeQuality
    from lacmesh.report.parents import ChildrenQuality

_BAR = 40
_ARTICLES = {"c": "a", "m": "a", "i": "an"}
_PERCENTS = ("1 %", "5 %", "median", "95 %", "99 %")


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(
        commands, "quality", run, "quality of the cells: invalid ones, statistics of the measures, the worst cells"
    )
    parser.add_argument("input", metavar="IN", help="mesh, cut or not")
    parser.add_argument("--group", metavar="GROUP", help="the cells of this group only")
    parser.add_argument(
        "--measures", metavar="all|NAME[,NAME]", help="which measures (default: the leading ones of each type)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object")
    parser.add_argument("--plot", metavar="FILE.png", help="draw the histograms (needs matplotlib)")
    parser.add_argument("--force", action="store_true", help="replace an existing plot")
    add_mesh_option(parser)


def run(args: argparse.Namespace) -> None:
    """Measure the cells of a file. The status is 0 for any quality: `lacmesh check` is the command that judges."""
    from lacmesh.formats import read

    if args.plot:
        from lacmesh.report.drawing import check_plot

        check_plot(Path(args.plot), force=args.force)
    stage = Stages(args, ("read", "measure", "draw") if args.plot else ("read", "measure"))
    with stage("read"):
        mesh = read(args.input, mesh=args.mesh)
    with stage("measure"):
        from lacmesh.quality import measure_quality

        quality = measure_quality(mesh, args.group, _measures(args.measures))
        children = _children(mesh) if args.group is None else None
    if args.plot:
        with stage("draw"):
            from lacmesh.formats.output import readable
            from lacmesh.report import plot_quality

            name = readable(Path(args.input).name + (f", group {args.group}" if args.group else ""))
            plot_quality(quality, args.plot, title=f"Quality of {name}", force=args.force)
    if args.json:
        report = {"file": str(args.input), **quality.as_json(), "cut": children and children.as_json()}
        print(as_json(report))
    elif not args.quiet:
        _print(args, quality, children)
        print(f"{args.plot}: {stage.spent()}" if args.plot else stage.spent())


def _measures(text: str | None) -> str | list[str] | None:
    return text if text in (None, "all") else [name.strip() for name in text.split(",") if name.strip()]


def _children(mesh: Mesh) -> ChildrenQuality | None:
    """Quality of the children of a mesh that carries a cut, against their parents; None without a cut."""
    from lacmesh.cutting.cut import Cut, is_cut
    from lacmesh.errors import CutError
    from lacmesh.report import children_quality

    if not is_cut(mesh):
        return None
    try:
        return children_quality(Cut(mesh))
    except CutError:  # records that mean something else
        return None


def _print(args: argparse.Namespace, quality: Quality, children: ChildrenQuality | None) -> None:
    where = f"{args.input}, group {args.group}" if args.group else str(args.input)
    poor = [t.poor for t in quality.types if t.poor is not None]
    poor_cells = f", {sum(poor):,} poor" if poor else ""
    print(f"{where}: {_count(quality.count, 'cell')} measured, {quality.invalid:,} invalid{poor_cells}")
    if quality.not_measured:
        print("not measured: " + ", ".join(f"{n:,} {of_type}" for of_type, n in quality.not_measured.items()))
    for of_type in quality.types:
        _print_type(of_type)
    if quality.groups:
        _print_groups(quality)
    if children is not None:
        _print_children(children)


def _print_type(of_type: TypeQuality) -> None:
    from lacmesh.quality.measures import ACCEPTED, primary_metric
    from lacmesh.report.outline import number

    rank = primary_metric(of_type.type) or ""
    accepted = ACCEPTED.get(of_type.type, {})
    print(f"\n{_title(of_type, rank)}")
    rows = table("measure", *(f"+{name}" for name in ("min", *_PERCENTS, "max", "mean")), "accepted", "+outside")
    for name, s in of_type.measures.items():
        limits = accepted.get(name)
        range_text = "" if limits is None else f"{number(limits[0])} to {number(limits[1])}"
        outside = "" if s.outside is None else f"{s.outside:,}"
        rows.add_row(name, *(number(v) for v in (s.least, *s.percentiles, s.largest, s.mean)), range_text, outside)
    out = console()
    out.print(rows)
    if rank in of_type.measures and rank != "validity":
        print(rank)
        for line in _bars(of_type.measures[rank].histogram):
            print(f"  {line}")
        print()
    if of_type.invalid or rank != "validity":  # lines are all alike as long as they are valid
        _print_worst(of_type, rank)


def _count(n: int, noun: str) -> str:
    return f"{n:,} {noun}{'' if n == 1 else 's'}"


def _title(of_type: TypeQuality, rank: str) -> str:
    from lacmesh.quality.measures import POOR

    title = f"{of_type.type}: {_count(of_type.count, 'cell')}, {of_type.invalid:,} invalid"
    if of_type.invalid:
        title += (
            f" ({', '.join(f'{n:,} at {_ARTICLES[where[0]]} {where}' for where, n in of_type.invalid_at.items() if n)})"
        )
    if of_type.poor is not None:
        title += f", {of_type.poor:,} poor ({rank} below {POOR})"
    return title


def _bars(histogram: Histogram) -> list[str]:
    """Histogram drawn in characters, two bins per line, limited to the part in use."""
    from lacmesh.report.histograms import bar

    edges = histogram.edges[::2]
    counts = [a + b for a, b in zip(histogram.counts[::2], histogram.counts[1::2], strict=True)]
    names = [f"{low:.3g} to {high:.3g}" for low, high in pairwise(edges)]
    names = [f"below {edges[0]:.3g}", *names, f"above {edges[-1]:.3g}"]
    counts = [histogram.below, *counts, histogram.above]
    used = [k for k, n in enumerate(counts) if n]
    if not used:
        return []
    plain = "utf" not in (sys.stdout.encoding or "").lower()
    total, out = max(counts), []
    for k in range(min(used[0], 1), max(used[-1], len(counts) - 2) + 1):
        drawn = "#" * round(_BAR * counts[k] / total) if plain else bar(counts[k], total, _BAR)
        out.append(f"{names[k]:12} {counts[k]:>11,}  {drawn}".rstrip())
    return out


def _print_worst(of_type: TypeQuality, rank: str) -> None:
    from lacmesh.report.outline import number

    ranks = dict.fromkeys((rank, "validity"))
    rows = table("worst", *ranks, "centroid", "groups", *(("invalid at",) if of_type.invalid else ()))
    for bad in of_type.worst:
        values = {rank: bad.value, "validity": bad.validity}
        place = ", ".join(f"{v:.4g}" for v in bad.centroid)
        where = (", ".join(bad.invalid_at),) if of_type.invalid else ()
        rows.add_row(str(bad.number), *(number(values[r]) for r in ranks), place, ", ".join(bad.groups), *where)
    console().print(rows)


def _print_groups(quality: Quality) -> None:
    from lacmesh.quality.measures import primary_metric
    from lacmesh.report.outline import number

    rows = table("group", "type", "cells", "+invalid", "+poor", "ranked by", "+min", "+5 %", "+median", "worst cell")
    for name, types in quality.groups.items():
        for t in types:
            rank = primary_metric(t.type) or ""
            s = t.measures[rank]
            poor = "" if t.poor is None else f"{t.poor:,}"
            values = (number(s.least), number(s.percentiles[1]), number(s.median))
            rows.add_row(name, t.type, f"{t.count:,}", f"{t.invalid:,}", poor, rank, *values, str(t.worst[0].number))
    console().print(rows)


def _print_children(c: ChildrenQuality) -> None:
    from lacmesh.report.outline import number

    known = f"{_count(c.parents, 'parent')} put together again"
    known += f", {c.unknown:,} not (cut by several of their faces)" if c.unknown else ""
    print(f"cut: {c.children:,} children, {c.invalid:,} invalid; {known}")
    rows = table("corner_jacobian", *(f"+{name}" for name in ("min", *_PERCENTS, "max", "mean")))
    for name, s in (("of the children", c.child), ("of their parents", c.parent), ("child / parent", c.ratio)):
        rows.add_row(name, *(number(v) for v in (s.least, *s.percentiles, s.largest, s.mean)))
    console().print(rows)
