"""`lacmesh cut`, `split` and `orient`: the skins of a contact."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from typer import Option

import lacmesh
from lacmesh.cli.checks import warn_of
from lacmesh.cli.options import Facing, ForProgram, MeshFile, MeshName, MeshOutput, Recognition, Skins, Target, output
from lacmesh.cli.program import Run
from lacmesh.cli.terminal import Stages, print_table
from lacmesh.errors import DataError, LacmeshWarning, RequestError, counted


@dataclass
class CutOptions:
    """How a skin is cut: keyword arguments of `lacmesh.cut_skin`."""

    hexa: Annotated[
        Literal["pyramid", "hexa", "auto"],
        Option(help="subdivision of hexahedra; auto: the variant with the higher minimum Jacobian"),
    ] = "pyramid"
    interface: Annotated[
        Literal["both", "refuse"], Option(help="slave faces inside a body: cut both sides, or stop")
    ] = "both"
    orient: Annotated[Literal["keep", "outward"], Option(help="flip slave faces that point inward")] = "keep"
    skin_only: Annotated[bool, Option("--skin-only", help="cut a surface without parent cells (a shell)")] = False
    node_groups: Annotated[
        Literal["extend", "keep"], Option(help="extend: new nodes between nodes of a set join it")
    ] = "extend"
    macro: Annotated[Literal["cut", "stars"], Option(help="cut each face, or join faces around nodes, uncut")] = "cut"
    rest: Annotated[Literal["cut", "join"], Option(help="with stars: faces that none reaches")] = "cut"
    pairs: Annotated[bool, Option("--pairs", help="with stars: QUAD8 are joined in pairs, not cut")] = False


def cut(
    source: MeshFile,
    *,
    skins: Skins,
    how: CutOptions,
    min_quality: Annotated[
        float | None,
        Option(metavar="X", help="write nothing if a new cell's corner Jacobian is below X (1: ideal, 0: flat)"),
    ] = None,
    recognition: Recognition,
    mesh_name: MeshName = None,
    facing: Facing,
    target: Target = None,
    program: ForProgram = None,
    report: Annotated[str | None, output(metavar="FILE", help="effect of the cut: .html, .md, .json")] = None,
    out: MeshOutput,
    run: Run,
) -> None:
    """Subdivide the slave faces, and the cells behind them, into macro-elements; or join faces, without a cut.

    With a master the cut is checked against it, as by lacmesh check, and not written if the check finds an error.

    $ lacmesh cut part.msh --slave slave
    $ lacmesh cut part.med --slave slave --master master --report cut.html
    """
    skins.check()
    choice = recognition.choice()
    place = out.target(run, source, target, "lac")
    if report:
        if Path(report) == place:
            raise RequestError(f"{place} cannot be both the mesh and the report; name another file")
        lacmesh.report.check_report(Path(report), force=out.force)
    stage = Stages(run)
    with stage("read"):
        mesh = lacmesh.read(source, mesh=mesh_name)
    sides = skins.sides(mesh, "cut", source)
    with stage("cut"):
        if program:
            _check_program(mesh, skins.slave or [], program, how, choice)
        rims: dict[str, Any] = {"crease_angle": facing.crease_angle, "dirichlet": facing.dirichlet or ()}
        result = lacmesh.cut_skin(mesh, skins.slave or [], recognise=choice, **vars(how), **rims)
        if min_quality is not None:
            lacmesh.report.refuse_poor(None if result.origin is None else mesh, result, min_quality)
    findings = page = None
    if skins.master:
        with stage("check"):
            findings = lacmesh.check(result, **sides, **vars(facing))
        _refuse_errors(findings)
    if report and result.origin is not None:
        with stage("report"):
            page = lacmesh.report.cut_report(mesh, result, findings=findings)
    with stage("write"), _report_beside(report, page, source):
        out.write(place, result.mesh, source, program)
    if not run.quiet:
        _print_summary(source, place, mesh, result, page, stage.spent())
        if program == "aster":
            print(f"note: code_aster's own LAC contact cuts the mesh itself, by DECOUPE_LAC: give it {source}, not cut")
        if page:
            print(f"report: {report}")


def _check_program(mesh: lacmesh.Mesh, slave: list[str], program: str, how: CutOptions, choice: bool | None) -> None:
    """Check that a program can take the cells that the cut makes. Raises RequestError."""
    from lacmesh.exchange.targets import check_target_cells

    same: dict[str, Any] = {name: getattr(how, name) for name in ("hexa", "interface", "skin_only")}
    check_target_cells(mesh, slave, program, recognise=choice, **same)


def _refuse_errors(findings: lacmesh.Findings) -> None:
    """Raise DataError for an error of the check of a cut; warn of other findings."""
    if findings.errors:
        first, more = findings.errors[0], len(findings.errors) - 1
        others = f"; to list {more} more, cut without --master, then run lacmesh check" if more else ""
        raise DataError(f"the cut is not usable for LAC: {first.rule}: {first.message}{others}")
    warn_of(findings)


@contextmanager
def _report_beside(path: str | None, report: Any, source: str) -> Iterator[None]:
    """Write the report, if there is one; it takes its place only after the block has succeeded: both, or neither."""
    if path is None or report is None:
        if path:
            message = "no report is written, because the mesh is cut already; see lacmesh quality"
            warnings.warn(message, LacmeshWarning, stacklevel=1)
        yield
        return
    files = lacmesh.formats.output
    with files.replacing(Path(path)) as (beside,):
        name = files.readable(Path(source).name)
        beside.write_bytes(lacmesh.report.report_bytes(Path(path).suffix.lower(), report, name))
        yield


def _print_summary(source: str, place: Path, before: lacmesh.Mesh, cut: lacmesh.Cut, report: Any, spent: str) -> None:
    """Print what a cut has changed."""
    if cut.origin is None:  # it was cut before, from what is not known
        print(f"{source} is already cut ({', '.join(cut.zones)}): written unchanged to {place}")
        return
    summary = report.summary if report else lacmesh.report.CutSummary.of(before, cut)
    rows = [*summary.rows()]
    rows.insert(2 + len(summary.zones), ())
    print_table((f"{Path(source).name} -> {place.name}", "+before", "+after", "+added"), rows)
    print(f"{place}: {spent}")
    if summary.worst[0] <= 0:
        message = "cells behind the slave faces were inverted or degenerate before the cut: their children are too"
        warnings.warn(message, LacmeshWarning, stacklevel=1)


def split(
    source: MeshFile,
    *,
    faces: Annotated[
        list[str],
        Option(metavar="G", help="faces inside a body, whose normals point from side a to b; may be repeated"),
    ],
    target: Target = None,
    mesh_name: MeshName = None,
    out: MeshOutput,
    run: Run,
) -> None:
    """Divide a mesh along faces inside a body (edges in a plane mesh) into two surfaces, G_a and G_b, that touch.

    $ lacmesh split bolt.med --faces section
    $ lacmesh split part.msh --faces crack -o cracked.msh
    """
    from lacmesh.cutting.split import split_skins

    place = out.target(run, source, target, "split")
    stage = Stages(run)
    with stage("read"):
        mesh = lacmesh.read(source, mesh=mesh_name)
    with stage("split"):
        parts = split_skins(mesh, faces)
    with stage("write"):
        out.write(place, parts.mesh, source)
    after, front, several = parts.mesh, int((parts.n_sides == 1).sum()), parts.n_sides[parts.n_sides > 2]
    rows: dict[str, tuple[int, int]] = {
        "nodes": (mesh.n_nodes, after.n_nodes),
        "cells": (mesh.n_cells, after.n_cells),
    }
    rows["bodies"] = parts.bodies
    for name, (a, b) in parts.skins.items():
        n_faces = len(after.cell_groups[a])
        rows[f"faces of {name} in {a}, {b}"] = n_faces, 2 * n_faces
    if front:
        rows["nodes on the front, shared by both sides: closed"] = front, front
    if len(several):
        rows["nodes where three or more sides meet, one for each"] = len(several), several.sum()
    cells = [(name, *(f"{n:,}" for n in numbers)) for name, numbers in rows.items()]
    print_table((f"{Path(source).name} -> {place.name}", "+before", "+after"), [*cells[:3], (), *cells[3:]])
    print(f"{place}: {stage.spent()}")


def orient(
    source: MeshFile,
    *,
    group: Annotated[list[str], Option(metavar="GROUP", help="the surface; may be repeated")],
    target: Target = None,
    mesh_name: MeshName = None,
    out: MeshOutput,
    run: Run,
) -> None:
    """Orient the faces of a surface outward.

    $ lacmesh orient part.msh --group slave
    $ lacmesh orient part.med --group slave --group master -o outward.med
    """
    from lacmesh.topology.orientation import analyse_orientation, reverse, skin_cells

    place = out.target(run, source, target, "out")
    mesh, lines = lacmesh.read(source, mesh=mesh_name), []
    for name in group:
        cells = skin_cells(mesh, name)
        sides = analyse_orientation(mesh, cells)
        mesh = reverse(mesh, sides.to_flip)
        lines.append(f"{name}: {len(sides.to_flip):,} of {counted(len(cells), 'face')} flipped")
        for left, what in (
            (sides.interface, "between two cells, with no outward side, left as they are"),
            (sides.open, "without a cell behind, oriented alike; they enclose no volume: choose their side"),
            (sides.one_sided, "on a surface with one side only, which cannot agree, left as they are"),
        ):
            if len(left):
                lines.append(f"{name}: {what}: {len(left):,} ({mesh.cell_names(left)})")
    out.write(place, mesh, source)
    print("\n".join([*lines, f"written to {place}"]))
