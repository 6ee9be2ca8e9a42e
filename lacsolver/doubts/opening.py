"""Gaps that open at an angle, as between a cylinder and a plane: there friction on undeformed skins is inexact.

With `geometry = "reference"` the traction p n + t e is along the undeformed slave. Skins that are at an angle phi to
each other touch along a plane that is at up to phi to it once they are pressed together, so that up to p phi of t are
no friction, and count against its bound b: t is off by up to p phi / b of the bound, phi / mu for Coulomb's law, in any
number of steps. Skins that touch in the mesh, and skins that a `clearance` alone keeps apart, are parallel.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacmesh.surface.normals import normals_of, unit
from lacsolver.contact import Interface
from lacsolver.contact.faces import tangents
from lacsolver.contact.friction import Bounds
from lacsolver.contact.shear import integrals
from lacsolver.distributed.share import Share
from lacsolver.doubts.run import Doubt, Run
from lacsolver.problem.pair import ContactPair

#: gap, of a macro-element's size, below which it is that of flat faces on curved skins
_SMALL = 0.05
#: part of the bound that friction may be off by
_MUCH = 0.1


def opening_angles(face: Interface, share: Share) -> NDArray[np.floating]:
    """Return the angle (m,) between the mean normals of slave and master over each macro-element, in radians.

    `face`: interface of the undeformed skins. 0 where the gap is small.
    """
    points = face.points  # with the normals of faces, as the direction of contact is the master's where this is plane
    own = unit(normals_of(tangents(face.slave, points.slave, points.xi_slave)))
    other = unit(normals_of(tangents(face.master, points.master, points.xi_master)))
    sums = share.total(integrals(own + other, points.macro, face.weight, len(face.w)))
    apart = np.divide(np.linalg.norm(sums, axis=1), face.w, out=np.zeros_like(face.w), where=face.w > 0)
    return np.where(face.gap > _SMALL * face.length, 2 * np.arcsin(np.minimum(apart / 2, 1.0)), 0.0)


def closed_at_an_angle(run: Run) -> Iterator[Doubt]:
    """Doubt friction that is inexact at the end, as a gap closed at an angle."""
    for pair, zone in run.zones:
        bounds = pair.bounds(run.space, run.state.time)
        if bounds is not None:
            yield from _inexact(run, pair, bounds, zone.pressure)


def may_close_at_an_angle(run: Run) -> Iterator[Doubt]:
    """Doubt friction that would be inexact wherever a gap closed, under a pressure of 1."""
    for pair in run.pairs:
        bounds = pair.bounds(run.space, run.start)
        if bounds is not None:
            p = np.ones(pair.zone.n_macros)
            coulomb = bounds._replace(cohesion=np.where(bounds.friction > 0, 0.0, np.inf), limit=np.inf * p)
            yield from _inexact(run, pair, coulomb, p)


def _inexact(run: Run, pair: ContactPair, bounds: Bounds, p: Floats) -> Iterator[Doubt]:
    """Yield a doubt if friction may be off by much somewhere under pressures p (m,)."""
    if pair.moving:  # paired again on deformed skins
        return
    angles = opening_angles(run.face(pair), run.space.share)
    bound = bounds.at(p)[0]
    part = np.divide(p * angles, bound, out=np.zeros_like(p), where=bound > 0)
    if part.max(initial=0.0) > _MUCH:
        worst = int(part.argmax())
        message = f"friction of contact {pair.name!r} may be off by up to {100 * part[worst]:.2g} % of its bound where "
        message += f"a gap closes between surfaces that are at an angle of {np.degrees(angles[worst]):.2g} degrees to "
        advice = 'take geometry = "current", or flat surfaces with the gap as a clearance'
        yield Doubt(f"{message}each other in the mesh; {advice}", pair.record)
