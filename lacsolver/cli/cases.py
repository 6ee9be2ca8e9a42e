"""`lacsolver example`, `new`, `import`, `validate` and `schema`: case files; `docs`: pages."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from lacmesh.cli.files import Folder, Name, Page, PathOnly, offer, open_page
from lacmesh.cli.options import Force
from lacmesh.cli.program import Run
from lacmesh.cli.terminal import Stages, print_json, print_table
from lacsolver.cli.options import CaseFile, NewCase, case_beside
from lacsolver.cli.ranks import check_alone

if TYPE_CHECKING:
    from lacsolver.case import Case
    from lacsolver.case.entry import Entry
    from lacsolver.decks import Imported
    from lacsolver.validation import Validation, ZoneFound

#: sections whose records are listed one by one, in this order
ACTING = (
    "displacement", "rigid", "coupling", "equation", "cyclic", "pretension", "spring", "pressure", "traction", "force",
    "body_force", "gravity", "temperature",
)  # fmt: skip
#: keys that tell where a record acts
_WHERE = ("name", "group", "groups", "at", "kind", "place", "centre")


def example(name: Name = None, *, folder: Folder = ".", force: Force = False, run: Run) -> None:
    """List the cases that come with lacsolver, or copy one here with its mesh.

    $ lacsolver example
    $ lacsolver example press_fit -o examples
    """
    from lacmesh.examples import CASES

    offer(CASES, name, folder, force=force)


def docs(page: Page = "README", *, path: PathOnly = False, run: Run) -> None:
    """Open a page of the documentation in the browser.

    $ lacsolver docs case
    $ lacsolver docs solver --path
    """
    open_page(page, path_only=path)


def new(
    mesh: Annotated[str, Argument(metavar="MESH", help="the mesh, cut or not")],
    *,
    target: NewCase = None,
    force: Force = False,
    run: Run,
) -> None:
    """Write a first case for a mesh: its groups, and surfaces that may touch.

    $ lacsolver new part.msh
    $ lacsolver new part.med -o first.toml
    """
    import lacmesh
    from lacmesh.formats.output import replace_file
    from lacsolver.first_case import facing_pairs, first_case

    check_alone()
    path = case_beside(mesh, target)
    run.will_write(path, force=force)
    content = lacmesh.read(mesh)
    pairs = facing_pairs(content)
    replace_file(path, first_case(content, os.path.relpath(mesh, path.parent), pairs).encode())
    touching = "; ".join(f"{a!r} and {b!r}" for a, b in pairs) or "no two opposite surfaces"
    print(f"{path}: {touching}")
    print(f"next: fill in material, supports and loads, then lacsolver validate {path}")


def import_(
    deck: Annotated[str, Argument(metavar="MODEL.inp", help="the deck, with the files that it includes")],
    *,
    target: NewCase = None,
    lenient: Annotated[
        bool, Option(help="leave out cards that lacsolver has no place for, instead of refusing")
    ] = False,
    partial: Annotated[
        bool, Option(help="leave out all that lacsolver does not take, with a warning for each, and import the rest")
    ] = False,
    force: Force = False,
    run: Run,
) -> None:
    """Write the mesh and the case file of a deck of CalculiX or Abaqus (.inp).

    $ lacsolver import engine.inp --partial
    $ lacsolver import model.inp --lenient -o model.toml
    """
    import lacmesh
    from lacmesh.formats.output import replace_file
    from lacsolver.decks import import_deck

    check_alone()
    path = case_beside(deck, target)
    for place in (path.with_suffix(".med"), path):
        run.will_write(place, force=force)
    stage = Stages(run)
    with stage("read"):
        imported = import_deck(deck, path, lenient=lenient, partial=partial)
    with stage("write"):
        lacmesh.write(path.with_suffix(".med"), imported.mesh, force=force)
        replace_file(path, imported.text.encode())
    for finding in imported.findings:
        if not (run.quiet and finding.level == "note"):
            print(f"lacsolver: {finding.level}: {finding.text}", file=sys.stderr)
    print_table(("case", str(path)), _content(imported))
    print(f"next: lacsolver validate {path}, lacsolver run {path}")
    print(f"{deck}: {stage.spent()}")


def _content(imported: Imported) -> Iterator[tuple[str, str]]:
    """Yield rows of what a deck has become."""
    case = imported.case
    yield from _model(case, imported.mesh)
    yield "steps", f"{len(case.steps.planned)}, to t = {case.steps.last:g}"
    if case.dynamics is not None:
        yield "motion", f"with inertia, from t = {case.dynamics.start:g}"
    counts = Counter(str(path[0]) for path, _ in case.records())
    for name in ("material", "contact", "tie", "rigid", "initial", "probe"):
        if counts[name]:
            yield name, f"{counts[name]}"
    yield "supports and loads", ", ".join(f"{counts[name]} {name}" for name in ACTING if counts[name])


def _model(case: Case, mesh: Any) -> Iterator[tuple[str, str]]:
    yield "model", f"{case.model}, {case.kinematics} kinematics"
    cells = ", ".join(f"{count:,} {kind}" for kind, count in mesh.cells_by_type.items())
    yield "mesh", f"{case.mesh}: {mesh.n_nodes:,} nodes, {cells}"


def validate(case: CaseFile, *, run: Run) -> None:
    """Read a case and its mesh, list all mistakes, and print the model.

    $ lacsolver validate press_fit.toml
    $ lacsolver validate press_fit.toml --quiet
    """
    from lacsolver.case import CaseError, read_case
    from lacsolver.problem.skin import mesh_of
    from lacsolver.validation import validate as validation_of

    stage = Stages(run)
    with stage("read"):
        record = read_case(case)
        mesh = mesh_of(record)
    with stage("check"):
        validation = validation_of(record, mesh)
    if not run.quiet:
        print_table(("case", ""), _validation_rows(record, validation))
        print(f"{case}: {stage.spent()}")
        sys.stdout.flush()
    if validation.problems:
        raise CaseError(validation.problems)


def _validation_rows(case: Case, validation: Validation) -> Iterator[tuple[str, ...]]:
    """Yield rows of the model, the sizes, the steps, the zones, supports and loads of a case."""
    from lacsolver.cli.summary import resultants

    mesh, steps = validation.mesh, case.steps
    yield from _model(case, mesh)
    if case.contact or case.ties:
        yield "cut", _cut(validation)
    if validation.unknowns:
        yield "unknowns", f"{validation.unknowns:,} of {validation.dim * mesh.n_nodes:,} displacements"
    halved = f"each halved {steps.max_halvings} times at most"
    yield "steps", f"{len(steps.planned)}, to t = {steps.last:g}, {halved}"
    if validation.motion is not None:
        yield from _motion(validation.motion)
    for motion in validation.held:
        yield "rigid-body mode without support", motion
    for zone in validation.zones:
        yield ()
        yield from _zone(zone)
    yield ()
    for name in ACTING:
        records = getattr(case, name)
        for record in records if isinstance(records, tuple) else [records] if records else []:
            yield name, _described(record)
    yield from resultants(validation.loads, steps.last, axisymmetric=case.model == "axisymmetric")


def _motion(motion: Any) -> Iterator[tuple[str, str]]:
    """Yield the figures of a case with [dynamics]: waves and steps, what is moved of the inertia, the momentum."""
    low, high = motion.speeds
    yield "wave speeds", f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"
    yield "cells crossed in a step", f"{motion.crossed:.3g}; the smallest uncut cell is {motion.cell:.4g} long"
    yield "step suggested", f"{motion.suggested / 2:.4g} to {motion.suggested:.4g}, if waves matter"
    massless = f"{motion.massless:,} nodes have none, which changes the moment of inertia by {motion.moved:+.2%}"
    yield "mass", f"{motion.mass:.6g}; {massless}"
    yield "momentum at the start", ", ".join(f"{value:.6g}" for value in motion.momentum)
    yield from (("warning", warning) for warning in motion.told)


def _cut(validation: Validation) -> str:
    """Describe the cut: none, of this run, or present in the mesh (also if found by `recognition`)."""
    if not validation.zones:
        return "none, because of the mistakes below"
    if validation.whole:
        return "not needed: every slave face is a macro-element as it is"
    if validation.stars_here:
        return "none: the macro-elements are stars"
    return "of this run" if validation.cut_here else "present in the mesh"


def _zone(zone: ZoneFound) -> Iterator[tuple[str, str]]:
    from lacsolver.output.words import adjusted_in_words

    yield "tie" if zone.tie else "contact", f"{zone.name}: slave {zone.slave}, master {zone.master}"
    if zone.why:
        yield "slave chosen", zone.why
    if zone.adjusted is not None:
        yield "slave nodes adjusted", adjusted_in_words(**zone.adjusted._asdict())
    paired = f"{zone.macros - zone.unpaired:,} of {zone.macros:,} face the master"
    yield "macro-elements", f"{paired}; {100 * zone.covered:.4g} % of the slave is covered"
    if zone.unpaired < zone.macros:
        yield "mean gaps", f"{zone.gap[0]:.6g} to {zone.gap[1]:.6g}"
    if zone.overlap > 0:
        yield "deepest overlap", f"{zone.overlap:.6g}"
    if zone.bridged > 0:
        yield "widest gap that the tie bridges", f"{zone.bridged:.6g}"
    yield from (("warning", warning) for warning in zone.told)


def _described(record: Entry) -> str:
    """Describe a record, its group or place first: `top: value = 25.0, ramped`."""
    from lacsolver.case.toml import written
    from lacsolver.case.value import values_in
    from lacsolver.space.places import where_of

    parts = [where_of(record)]
    for name in [name for name in record.KEYS if name not in _WHERE]:
        value = getattr(record, name)
        ramped = any(one.ramp_end and one.source != 0 for one in values_in(value))
        parts += [] if value in (None, False) else [f"{name} = {written(value)}{', ramped' if ramped else ''}"]
    return f"{parts[0]}: {', '.join(parts[1:])}" if parts[1:] else parts[0]


def schema(
    *,
    json: Annotated[bool, Option(help="as JSON Schema, with which editors check and complete TOML")] = False,
    run: Run,
) -> None:
    """List every section and key of a case file, with units and defaults.

    $ lacsolver schema
    $ lacsolver schema --json > case.schema.json
    """
    from lacsolver.case.schema import json_schema, schema_text

    if json:
        print_json(json_schema())
    else:
        print(schema_text(), end="")
