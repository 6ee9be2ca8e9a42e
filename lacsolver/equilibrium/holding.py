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
from lacsolver.problem.rigid_modes import STOPPED_BY_CONTACT, FreeMotion, describe, displaced_by, felt, still_free
from lacsolver.space.space import Space

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


def warnings_of(held: Sequence[Held], prescribed: float) -> Iterator[str]:
    """Yield warnings about motions that contact hardly resists, or that displaced a body by more than its size.

    `prescribed`: largest prescribed displacement, by which a body may move in addition.
    """
    described: set[str] = set()
    for one in held:
        far = one.moved > one.size + prescribed
        if one.words not in described and (far or one.part < HARDLY):
            described.add(one.words)
            went = f"{one.words} by {one.moved:.4g}"
            went += f", farther than it is long ({one.size:.4g})" if far else ""
            advice = "support it by a displacement or a spring, or check where its load moves it"
            yield f"{went}: {_resisted(one.part)}; {advice}"


def _resisted(part: float) -> str:
    if np.isnan(part):
        return "contact alone resists that"
    if part < STOPPED_BY_CONTACT**2:
        return "contact alone could stop that, and no closed macro-element does"
    return f"contact alone resists that, with {part:.1e} of its stiffness, as little as the roughness of a mesh gives"


def beyond_a_cell(space: Space, u: Floats) -> str | None:
    """Return a warning if the largest nodal displacement of u (n_dof,) exceeds the size of the node's largest cell.

    Of several processes the one that has the node tells. Under small kinematics bodies and contact are evaluated
    undeformed.
    """
    far = np.linalg.norm(u.reshape(-1, space.dim), axis=1)
    if space.share.own is not None:
        far[~space.share.own] = 0.0
    node = int(far.argmax())
    if far[node] < space.share.largest(float(far[node])):
        return None
    size = 0.0
    for block in space.blocks:
        x = space.local.points[block.nodes[(block.nodes == node).any(axis=1)]]
        size = max(size, float(np.ptp(x, axis=1).max(initial=0.0)))
    if not far[node] > size > 0:
        return None
    place = ", ".join(space.told(space.mesh.points[node]))
    who = f"node {space.mesh.node_number[node]} ({place})"
    message = f"{who} moves by {far[node]:.4g} and its cells are {size:.4g} long"
    return f'{message}: small kinematics assumes small displacements; check what moves, or set kinematics = "finite"'
