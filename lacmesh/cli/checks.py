"""`lacmesh check` and `quality`: whether a mesh is usable, and how good its cells are."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from typer import Option

import lacmesh
from lacmesh.cli.options import AsJson, Facing, Force, MeshFile, MeshName, Recognition, Skins
from lacmesh.cli.program import Run
from lacmesh.cli.terminal import Stages, print_json, print_table
from lacmesh.errors import DataError, LacmeshWarning, counted

_STYLE = {"error": "bold red", "warning": "yellow", "info": "dim"}
_STATISTICS = ("+min", "+1 %", "+5 %", "+median", "+95 %", "+99 %", "+max", "+mean")


def check(
    source: MeshFile,
    *,
    skins: Skins,
    recognition: Recognition,
    json: AsJson = False,
    mesh_name: MeshName = None,
    facing: Facing,
    run: Run,
) -> None:
    """Check whether a mesh, cut or not, is usable for LAC, and where not; exit status 1 if any finding is an error.

    $ lacmesh check part.lac.msh --slave slave --master master
    $ lacmesh check part.med --pair pin:bore --pair head:plate --json
    """
    skins.check()
    stage = Stages(run)
    with stage("read"):
        mesh = lacmesh.read(source, mesh=mesh_name)
    with stage("check"):
        sides = skins.sides(mesh, "check", source)
        findings = lacmesh.check(mesh, **sides, recognise=recognition.choice(), **vars(facing))
    if json:
        print_json(findings.as_dict())
    elif run.quiet:
        warn_of(findings)
    else:
        _print_findings(findings, mesh)
        print(f"{source}: {stage.spent()}")
    sys.stdout.flush()
    if findings.errors:
        rules = ", ".join(dict.fromkeys(f.rule for f in findings.errors))
        raise DataError(f"{source} is not usable for LAC: {counted(len(findings.errors), 'error')} ({rules})")


def warn_of(findings: lacmesh.Findings) -> None:
    """Issue the findings of severity warning as warnings of the command."""
    for finding in findings.warnings:
        warnings.warn(f"{finding.rule}: {finding.message}", LacmeshWarning, stacklevel=1)


def _print_findings(findings: lacmesh.Findings, mesh: lacmesh.Mesh) -> None:
    from rich.text import Text

    size, rows = lacmesh.origin.size_of(mesh), []
    for f in findings:
        places = [f"in {f.where.group}"] if f.where.group and not f.where.pair else []
        if f.where.box and f.severity != "info":
            axes = zip("xyz", *(lacmesh.origin.format_coordinates(corner, size) for corner in f.where.box), strict=True)
            places.append(", ".join(f"{a} {lo}" if lo == hi else f"{a} {lo} to {hi}" for a, lo, hi in axes))
        where = f" [{'; '.join(places)}]" if places else ""
        rows.append((Text(f.severity, _STYLE[f.severity]), f.rule, f.message + where))
    if rows:
        print_table(("|finding", "|rule", "what, where, what to do"), rows)
    print_table(("summary", ""), _figures(findings.summary))
    verdict = counted(len(findings.errors), "error") if findings.errors else "no errors"
    not_cut = ", not cut yet" if findings.of_rule("not-cut") else ""
    print(f"{verdict}, {counted(len(findings.warnings), 'warning')}{not_cut}")


def _figures(s: Any) -> Iterator[tuple[str, str]]:
    """Yield rows (name, value) of the check's summary, for people."""
    for what in ("slave", "master"):
        if what in s:
            yield what, f"{s[f'{what}_faces']:,} faces in {', '.join(s[what])}"
    if "macro_elements" in s:
        inside, free = s["with_internal_dof"], s["with_free_internal_dof"]
        text = f"{inside:,} of {s['macro_elements']:,}" + (f", {free:,} of them free" if free != inside else "")
        yield "macro-elements with an internal dof", text
    if s.get("shapes"):
        from lacmesh.smooth.fitted import shapes_text

        yield from ((f"shape of {group}", shapes_text(shapes)) for group, shapes in s["shapes"].items())
    if "bodies" in s:
        yield "bodies", f"{s['bodies']:,}"
    if "worst_quality" in s:
        yield "worst corner Jacobian", f"{s['worst_quality']:.3f}"
    for pair in (s, *s.get("pairs", ())):
        if pair is not s:
            yield "pair", f"{pair['slave']} on {pair['master']}"
        if "gap" in pair:
            whole, part, none = (pair[f"{k}_macro_elements"] for k in ("covered", "partly_covered", "uncovered"))
            yield "gap: least, mean, largest", ", ".join(f"{pair['gap'][k]:.6g}" for k in ("min", "mean", "max"))
            share = f"{100 * pair['covered']:.4g} % of the slave; macro-elements"
            yield "covered by the master", f"{share}: {whole:,} whole, {part:,} in part, {none:,} not"


def quality(
    source: MeshFile,
    *,
    group: Annotated[str | None, Option(metavar="GROUP", help="the cells of this group only")] = None,
    measures: Annotated[
        str | None, Option(metavar="all|NAME[,NAME]", help="default: the leading ones of each type")
    ] = None,
    json: AsJson = False,
    plot: Annotated[str | None, Option(metavar="FILE.png", help="draw the histograms (needs matplotlib)")] = None,
    mesh_name: MeshName = None,
    force: Force = False,
    run: Run,
) -> None:
    """Measure the cells of a mesh: invalid ones, statistics of the measures, the worst cells. No quality is an error.

    $ lacmesh quality part.lac.msh
    $ lacmesh quality part.med --group slave --measures all --plot quality.png
    """
    if plot:
        lacmesh.report.check_plot(Path(plot), force=force)
    stage = Stages(run)
    with stage("read"):
        mesh = lacmesh.read(source, mesh=mesh_name)
    with stage("measure"):
        names: Any = measures
        if measures not in (None, "all"):
            names = [name.strip() for name in measures.split(",") if name.strip()]
        qualities = lacmesh.measure_quality(mesh, group, names)
        cut = None if group else lacmesh.cutting.records.cut_of(mesh)
        children = cut and lacmesh.report.children_quality(cut)
    if plot:
        with stage("draw"):
            name = lacmesh.formats.output.readable(Path(source).name + (f", group {group}" if group else ""))
            lacmesh.report.plot_quality(qualities, plot, title=f"Quality of {name}", force=force)
    if json:
        print_json({"file": source, **qualities.as_json(), "cut": children and children.as_json()})
    elif not run.quiet:
        _print_quality(f"{source}, group {group}" if group else source, qualities, children)
        print(f"{plot}: {stage.spent()}" if plot else stage.spent())


def _print_quality(where: str, quality: lacmesh.Quality, children: Any | None) -> None:
    poor = [t.poor for t in quality.types if t.poor is not None]
    poor_cells = f", {sum(poor):,} poor" if poor else ""
    print(f"{where}: {counted(quality.count, 'cell')} measured, {quality.invalid:,} invalid{poor_cells}")
    if quality.not_measured:
        print("not measured: " + ", ".join(f"{n:,} {of_type}" for of_type, n in quality.not_measured.items()))
    for of_type in quality.types:
        _print_type(of_type)
    if quality.groups:
        columns = ("group", "type", "+cells", "+invalid", "+poor", "ranked by", "+min", "+5 %", "+median", "worst cell")
        print_table(columns, _groups(quality))
    if children is not None:
        print(f"cut: {children.children:,} children, {children.invalid:,} invalid")
        print_table(("corner_jacobian", *_STATISTICS), [("of the children", *lacmesh.report.values(children.child))])


def _print_type(cells: Any) -> None:
    """Print the quality of the cells of a type."""
    from lacmesh.quality.measures import ACCEPTED, POOR, primary_metric

    rank, accepted = primary_metric(cells.type) or "", ACCEPTED.get(cells.type, {})
    places = ", ".join(f"{n:,} at {'an' if k[0] == 'i' else 'a'} {k}" for k, n in cells.invalid_at.items() if n)
    invalid = f"{cells.invalid:,} invalid" + (f" ({places})" if cells.invalid else "")
    poor = "" if cells.poor is None else f", {cells.poor:,} poor ({rank} below {POOR})"
    print(f"\n{cells.type}: {counted(cells.count, 'cell')}, {invalid}{poor}")
    rows: list[tuple[str, ...]] = []
    for name, s in cells.measures.items():
        limits = " to ".join(map(lacmesh.report.number, accepted.get(name) or ()))
        rows.append((name, *lacmesh.report.values(s), limits, "" if s.outside is None else f"{s.outside:,}"))
    print_table(("measure", *_STATISTICS, "accepted", "+outside"), rows)
    if not cells.invalid and rank == "validity":  # lines are all alike as long as they are valid
        return
    rows = []
    for bad in cells.worst:
        values = {rank: bad.value, "validity": bad.validity}
        place = ", ".join(f"{v:.4g}" for v in bad.centroid)
        where = (", ".join(bad.invalid_at),) if cells.invalid else ()
        rows.append(
            (str(bad.number), *map(lacmesh.report.number, values.values()), place, ", ".join(bad.groups), *where)
        )
    at = ("invalid at",) if cells.invalid else ()
    print_table(("worst", *dict.fromkeys((rank, "validity")), "centroid", "groups", *at), rows)


def _groups(quality: lacmesh.Quality) -> Iterator[tuple[str, ...]]:
    from lacmesh.quality.measures import primary_metric

    for name, types in quality.groups.items():
        for t in types:
            rank = primary_metric(t.type) or ""
            s, poor = t.measures[rank], "" if t.poor is None else f"{t.poor:,}"
            values = map(lacmesh.report.number, (s.least, s.percentiles[1], s.median))
            yield name, t.type, f"{t.count:,}", f"{t.invalid:,}", poor, rank, *values, str(t.worst[0].number)
