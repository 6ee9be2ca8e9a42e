"""Check of curved skins of linear faces: their shapes, exact or free form, and whether the mesh resolves them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lacmesh.checks.findings import Finding
from lacmesh.checks.subject import CheckedSkin, Subject
from lacmesh.errors import DataError
from lacmesh.smooth.coarse import DOUBTFUL, Faceted, doubt_in_words, faceted
from lacmesh.smooth.fitted import few_in_words, fitted_shapes
from lacmesh.smooth.heights import smooth_of
from lacmesh.surface.record import Surface


def check_shapes(subject: Subject) -> tuple[list[Finding], dict[str, Any]]:
    """Report the shapes of each curved group, and groups that are too coarse to be treated as smooth."""
    findings: list[Finding] = []
    shapes: dict[str, Any] = {}
    for side in subject.sides:
        for zone, name in enumerate(side.names):
            cells = side.cells[side.zone == zone]
            if not len(cells):
                continue
            try:
                surface = Surface.of(subject.cut_mesh, cells)
            except DataError:  # faces without a normal: `facing-left-out` says it
                continue
            smooth = smooth_of(subject.cut_mesh, surface, subject.options["crease_angle"])
            fitted = fitted_shapes(smooth, surface)
            if not all(one.flat for one in fitted):
                at = [one if one.centre is None else replace(one, centre=one.centre + subject.origin) for one in fitted]
                shapes[name] = [one.as_dict() for one in at]
            if subject.options["surface"] != "smooth":
                continue
            coarse = faceted(smooth, surface)
            if len(coarse.cells):
                findings.append(subject.found("faceted", _coarse(side, coarse), coarse.cells, group=name))
            if message := few_in_words(smooth):
                message += "; give --crease-angle 40 if the edges are sharp"
                findings.append(subject.found("few-faces", message, surface.cell, group=name))
    return findings, {"shapes": shapes}


def _coarse(side: CheckedSkin, coarse: Faceted) -> str:
    message = side.counted(len(coarse.cells), "is", "are") + " too coarse for a curved skin: they "
    what = [f"meet at angles up to {coarse.turn:.0f} degrees"]
    if coarse.no_height:
        what.append(f"{coarse.no_height:,} of them have too few neighbours for a fit")
    if coarse.doubt > DOUBTFUL:
        what.append(f"their {doubt_in_words(coarse.doubt)}")
    return f"{message}{', and '.join(what)}; refine the mesh (16 faces to a full turn or more), or use quadratic cells"
