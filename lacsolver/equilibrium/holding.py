"""Bodies that only contact supports: the displacement along each rigid-body mode, and the resistance of contact to it.

The resistance to a rigid-body motion is measured at the closed rows, those of the contacts and ties that are active in
the end. A closed row resists a change of its gap with the stiffness of its skin: a motion along its normal meets all of
that stiffness, a motion at an angle the square of the cosine. So the mean square, over the closed rows of a motion's
bodies, of the normal components of the motion of size 1 is the fraction of the stiffness that resists it. It is
dimensionless and needs no solve; all rows count equally, whatever their area and their bodies' moduli. It is about 1
for a block between two others, whichever way they press, and the square of the slope for a wedge; for a pin along the
axis of its bore it is the square of the angle by which the mesh's roughness tilts normals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.equilibrium.state import Held
from lacsolver.problem.rigid_modes import FreeMotion, describe, displaced_by, felt, still_free

#: fraction of the contact stiffness below which contact hardly constrains a motion
HARDLY = 1e-6


def holdings(
    motions: Sequence[FreeMotion], closed: csr_array, u: Floats, *, x: Floats | None = None
) -> tuple[Held, ...]:
    """Evaluate rigid-body motions that only contact constrains, at u (n_dof,) with the closed rows (m, n_dof).

    Returns first the motions that contact hardly constrains, alone or combined, then the motions as given. `x`
    (n_nodes, 3): deformed coordinates; None for the undeformed bodies.
    """
    if not motions:
        return ()
    loose = _loose(motions, closed, x)
    parts = np.square(felt(closed, loose, x)) if loose else np.empty(0)
    loosely = [Held(*one, float(part)) for one, part in zip(_moved(loose, u, x), parts, strict=True)]
    return (*loosely, *(Held(*one) for one in _moved(motions, u, x)))


def _loose(motions: Sequence[FreeMotion], closed: csr_array, x: Floats | None) -> Sequence[FreeMotion]:
    """Return the motions that contact hardly constrains: those among the given ones, or combinations if there are more.

    The given ones are preferred, since a combination is only accurate to the root of `HARDLY`, which is too little to
    describe its axis.
    """
    alone = [m for m, size in zip(motions, felt(closed, motions, x), strict=True) if size**2 < HARDLY]
    together = still_free(closed, motions, least=float(np.sqrt(HARDLY)), x=x)
    return together if len(together) > len(alone) else alone


def _moved(motions: Sequence[FreeMotion], u: Floats, x: Floats | None) -> Iterator[tuple[str, float, float]]:
    """Yield the description of each motion, its largest nodal displacement, and the least extent of its bodies.

    A body of one point has an infinite extent, so that no displacement is large for it.
    """
    for motion, far in zip(motions, displaced_by(motions, u, x), strict=True):
        sizes = [motion.space.extent_of(body.nodes) for body in motion.bodies]
        yield describe(motion), float(far), min(float(size) or np.inf for size in sizes)
