"""Warnings about pressures that show the flat faces of a mesh rather than the curved skins that they approximate.

Flat faces of size h deviate from a skin of radius R by h^2 / 8R, and a gap d changes the pressure of a macro-element by
about E d / h: with an angle theta = h / R between neighbouring faces the error is E theta / 8 (docs/theory.md, 'Smooth
surfaces over flat faces'). If that is not small compared with the computed pressures, and these alternate between
neighbouring macro-elements, they reflect the mesh more than the contact.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacmesh.mesh import Floats
from lacmesh.smooth import unresolved
from lacmesh.surface import Surface
from lacsolver.case import Contact
from lacsolver.contact import Zone
from lacsolver.equilibrium.state import State
from lacsolver.problem.problem import Problem

#: a run warns above both of these: relative difference between pressures of neighbours, and error of flat faces
#: relative to the mean pressure of the macro-elements in contact
_ALTERNATE, _WORTH = 0.3, 0.5
#: the first of these where only a few faces may be off, as at a fillet
_LOCAL = 0.1


def faceted(problem: Problem, state: State) -> Iterator[str]:
    """Yield a warning for each contact of a converged state whose pressures look like those of flat faces."""
    moduli = (material.young for material in problem.case.material if material.young is not None)
    young = min((float(np.min(one)) for one in moduli), default=0.0)
    for joint, zone in zip(problem.joints, state.zones, strict=True):
        part = _differing(joint.zone, zone.pressure)
        if not isinstance(joint.record, Contact) or part <= _LOCAL:
            continue
        record, mesh = joint.record, problem.space.local
        turns = [
            unresolved(mesh, skin, how=record.surface, crease_angle=record.crease_angle)
            for skin in (joint.zone.slave, joint.zone.master)
        ]
        turn = max((float(np.median(one)) for one in turns if len(one)), default=0.0)
        doubt = max(_doubt(skin) for skin in (joint.zone.slave, joint.zone.master))
        on = zone.pressure > 0
        worth, mean = young * turn / 8, float(np.average(zone.pressure[on], weights=zone.area[on])) if on.any() else 0.0
        flat = part > _ALTERNATE and worth > _WORTH * mean
        if mean > 0 and not flat and young * doubt > _WORTH * mean:
            yield (
                f"pressures of contact {joint.name!r} differ by {100 * part:.0f} % from one macro-element to the next, "
                f"where heights of curved surfaces are uncertain by {doubt:.2g} of a face's size, an error of "
                f"{young * doubt:.4g} for a mean pressure of {mean:.4g}; refine both surfaces where their curvature "
                "changes, put nodes on the line where two shapes touch, or mesh with quadratic cells"
            )
        if mean > 0 and flat:
            message = f"pressures of contact {joint.name!r} differ by {100 * part:.0f} % from one macro-element to the "
            message += f"next, a known effect of flat faces on curved surfaces: normals turn by {np.degrees(turn):.2g} "
            message += (
                f"degrees from face to face, an error of E h / 8R = {worth:.4g} for a mean pressure of {mean:.4g}"
            )
            other = 'take surface = "smooth", or ' if record.surface == "faces" else ""
            yield f"{message}; {other}refine both surfaces, or mesh with quadratic cells, whose mid-nodes lie on them"


def _doubt(skin: Surface) -> float:
    """Return how far the heights of a skin may be off, over the size of a face; 0 if it has none."""
    return 0.0 if skin.height is None or skin.height.doubt is None else float(skin.height.doubt.max(initial=0.0))


def _differing(zone: Zone, pressure: Floats) -> float:
    """Return the sum of pressure differences of neighbouring macro-elements, relative to the sum of their pressures."""
    beyond = zone.slave.neighbours
    face, k = np.nonzero(beyond >= 0)
    a, b = zone.macro[face], zone.macro[beyond[face, k]]
    apart = a != b
    p, q = np.abs(pressure[a[apart]]), np.abs(pressure[b[apart]])
    total = float((p + q).sum())
    return float(np.abs(p - q).sum()) / total if total > 0 else 0.0
