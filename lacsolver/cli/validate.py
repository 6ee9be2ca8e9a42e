"""`lacsolver validate`: check that a case can be run, and print its sizes, zones, supports and loads."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from lacmesh.cli.terminal import Stages, console, table
from lacsolver.cli.options import add_case, add_command

if TYPE_CHECKING:
    from lacsolver.case import Case
    from lacsolver.case.entry import Entry
    from lacsolver.problem.first_look import MotionFound
    from lacsolver.validation import Validation, ZoneFound

#: sections whose records are listed one by one, in this order
ACTING = (
    "displacement",
    "rigid",
    "coupling",
    "equation",
    "cyclic",
    "pretension",
    "spring",
    "pressure",
    "traction",
    "force",
    "body_force",
    "gravity",
    "temperature",
)
#: keys that tell where a record acts
_WHERE = ("name", "group", "groups", "at", "kind", "place", "centre")


def add(commands: Any) -> None:
    """Declare the command."""
    parser = add_command(commands, "validate", run, "read a case and its mesh, list all mistakes, and print the model")
    add_case(parser)


def run(args: argparse.Namespace) -> None:
    """Check a case and print what was found. Raises CaseError with every mistake that would prevent a run."""
    from lacsolver.case import CaseError, read_case
    from lacsolver.problem.skin import mesh_of
    from lacsolver.validation import validate

    stage = Stages(args, ("read", "look"))
    with stage("read"):
        case = read_case(args.case)
        mesh = mesh_of(case)
    with stage("look"):
        validation = validate(case, mesh)
    if not args.quiet:
        _print(case, validation)
        print(f"{args.case}: {stage.spent()}")
    sys.stdout.flush()
    if validation.problems:
        raise CaseError(validation.problems)


def _print(case: Case, validation: Validation) -> None:
    from lacsolver.cli.summary import add_resultants

    rows = table("case", "")
    for name, value in _figures(case, validation):
        rows.add_row(name, value)
    for zone in validation.zones:
        rows.add_section()
        for name, value in _zone(zone):
            rows.add_row(name, value)
    rows.add_section()
    for name in ACTING:
        records = getattr(case, name)
        for record in records if isinstance(records, tuple) else [records] if records else []:
            rows.add_row(name, said(record))
    add_resultants(rows, validation.loads, case.steps.last, axisymmetric=case.model == "axisymmetric")
    console().print(rows)


def _figures(case: Case, validation: Validation) -> Iterator[tuple[str, str]]:
    """Yield the model, the sizes, the steps, and the rigid-body motions that only contact holds."""
    mesh = validation.mesh
    cells = ", ".join(f"{count:,} {kind}" for kind, count in mesh.cells_by_type.items())
    yield "model", f"{case.model}, {case.kinematics} strains"
    yield "mesh", f"{case.mesh}: {mesh.n_nodes:,} nodes, {cells}"
    if case.contact or case.ties:
        yield "cut", _cut(validation)
    if validation.unknowns:
        yield "unknowns", f"{validation.unknowns:,} of {validation.dim * mesh.n_nodes:,} displacements"
    steps = case.steps
    halved = f"each halved {steps.max_halvings} times at most"
    yield "steps", f"{len(steps.planned)}, to t = {steps.last:g}, {halved}"
    if validation.motion is not None:
        yield from _motion(case, validation.motion)
    for motion in validation.held:
        yield "rigid-body mode without support", motion


def _motion(case: Case, motion: MotionFound) -> Iterator[tuple[str, str]]:
    """Yield the figures of a case with [dynamics]: waves and steps, what is moved of the inertia, the momentum."""
    low, high = motion.speeds
    yield "wave speeds", f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"
    yield "cells crossed in a step", f"{motion.crossed:.3g}; the smallest that is not cut is {motion.cell:.4g} long"
    yield "step suggested", f"{motion.suggested / 2:.4g} to {motion.suggested:.4g}, where waves matter"
    yield (
        "mass",
        f"{motion.mass:.6g}; {motion.massless:,} nodes have none, which changes inertia {motion.moved:+.2%}",
    )
    yield "momentum at the start", ", ".join(f"{value:.6g}" for value in motion.momentum)
    for said in motion.told:
        yield "warning", said


def _cut(validation: Validation) -> str:
    """Describe the cut: none, made for this run, or present in the mesh (also if found by `recognition`)."""
    if not validation.zones:
        return "none, because of the mistakes below"
    if validation.whole:
        return "not needed: every slave face is a macro-element as it is"
    return "made for this run" if validation.cut_here else "present in the mesh"


def _zone(zone: ZoneFound) -> Iterator[tuple[str, str]]:
    yield "tie" if zone.tie else "contact", f"{zone.name}: slave {zone.slave}, master {zone.master}"
    if zone.why:
        yield "slave chosen", zone.why
    if zone.adjusted is not None:
        from lacsolver.cli.summary import adjusted_in_words

        yield "slave nodes adjusted", adjusted_in_words(zone.adjusted)
    paired = f"{zone.macros - zone.unpaired:,} of {zone.macros:,} face the master"
    yield "macro-elements", f"{paired}; {100 * zone.covered:.4g} % of the slave is covered"
    if zone.unpaired < zone.macros:
        yield "mean gaps", f"{zone.gap[0]:.6g} to {zone.gap[1]:.6g}"
    if zone.overlap > 0:
        yield "deepest overlap", f"{zone.overlap:.6g}"
    for said in zone.told:
        yield "warning", said


def said(record: Entry) -> str:
    """Describe a record, its group or place first: `top: value = 25, ramped`."""
    from lacsolver.case.keys import keys_of
    from lacsolver.space.places import where_of

    where = where_of(record)
    values = [
        f"{name} = {_value(getattr(record, name))}"
        for name in keys_of(type(record))
        if name not in _WHERE and getattr(record, name) not in (None, False)
    ]
    return f"{where}: {', '.join(values)}" if values else where


def _value(value: Any) -> str:
    from lacsolver.case.formula import Formula
    from lacsolver.case.value import Value

    if isinstance(value, Value):
        ramped = ", ramped" if value.ramp_end and value.source != 0 else ""
        return f"{_value(value.source)}{ramped}"
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Formula):
        return repr(value.text)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
