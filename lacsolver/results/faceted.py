"""Pressures that are those of flat faces, not of the curved skins that these stand for.

Flat faces of size h miss a skin of radius R by h^2 / 8R, and a macro-element answers a gap d with a pressure of about
E d / h: what faces that turn by theta = h / R from one to the next are wrong by is E theta / 8 (docs/theory.md, 'Smooth
surfaces over flat faces'). Where that is not small beside the pressures that came out, and these alternate from a
macro-element to its neighbours, they say more of the mesh than of the contact.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacmesh.mesh import Floats
from lacmesh.smooth import unresolved
from lacsolver.case import Contact
from lacsolver.contact import Zone
from lacsolver.problem.problem import Problem
from lacsolver.results.state import State

#: part of the pressures by which neighbours differ, and of the mean pressure of the macro-elements in contact that the
#: faces are worth: from there on a run says so
_ALTERNATE, _WORTH = 0.3, 0.5


def faceted(problem: Problem, state: State) -> Iterator[str]:
    """A sentence on each contact of a converged state whose pressures look like those of flat faces."""
    young = min((float(np.min(material.young)) for material in problem.case.material), default=0.0)
    for joint, zone in zip(problem.joints, state.zones, strict=True):
        part = _differing(joint.zone, zone.pressure)
        if not isinstance(joint.record, Contact) or part <= _ALTERNATE:
            continue
        record, mesh = joint.record, problem.space.local
        turns = [
            unresolved(mesh, skin, how=record.surface, crease_angle=record.crease_angle)
            for skin in (joint.zone.slave, joint.zone.master)
        ]
        turn = max((float(np.median(one)) for one in turns if len(one)), default=0.0)
        on = zone.pressure > 0
        worth, mean = young * turn / 8, float(np.average(zone.pressure[on], weights=zone.area[on])) if on.any() else 0.0
        if mean > 0 and worth > _WORTH * mean:
            message = f"pressures of contact {joint.name!r} differ by {100 * part:.0f} % from one macro-element to the "
            message += (
                f"next, as they do where flat faces stand for curved skins: these turn by {np.degrees(turn):.2g} "
            )
            message += f"degrees from face to face, which is worth E h / 8R = {worth:.4g} beside their mean, {mean:.4g}"
            other = 'take surface = "smooth", or ' if record.surface == "faces" else ""
            yield f"{message}; {other}refine both skins, or mesh with quadratic cells, whose mid-nodes lie on the skins"


def _differing(zone: Zone, pressure: Floats) -> float:
    """By what part of their pressures neighbouring macro-elements differ, pairs that are open left out."""
    beyond = zone.slave.neighbours
    face, k = np.nonzero(beyond >= 0)
    a, b = zone.macro[face], zone.macro[beyond[face, k]]
    apart = a != b
    p, q = np.abs(pressure[a[apart]]), np.abs(pressure[b[apart]])
    total = float((p + q).sum())
    return float(np.abs(p - q).sum()) / total if total > 0 else 0.0
