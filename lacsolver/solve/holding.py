"""Bodies that contact alone holds: how far each of their motions took them, and how much of contact stands against it.

What a motion of a whole body meets is measured at the closed rows, those of the contacts and ties that hold their gaps
in the end. A closed row resists what changes its gap, as stiffly as its skin is: a motion along its normal meets all of
that, one at an angle to it the square of the cosine. So the mean, over the closed rows of a motion's bodies, of the
squares of how far the motion of size 1 takes the skins along the normals is the part of the stiffness there that
resists it. It has no unit and needs no solve; rows count alike, whatever their area and their bodies' moduli. A block
between two others has about 1, whichever way they press, and a wedge the square of its slope; a pin along the axis of
its bore has the square of what the mesh's roughness tilts normals by.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import csr_array

from lacmesh.mesh import Floats
from lacsolver.problem.rigid_modes import STOPPED_BY_CONTACT, FreeMotion, describe, displaced_by, felt, still_free
from lacsolver.results.state import Held
from lacsolver.space.space import Space

#: of the stiffness of contact: below it, contact hardly holds
HARDLY = 1e-6


def holdings(
    motions: Sequence[FreeMotion], closed: csr_array, u: Floats, *, x: Floats | None = None
) -> tuple[Held, ...]:
    """What came of motions that nothing but contact stops, at u (n_dof,), where rows `closed` (m, n_dof) hold.

    First those that contact hardly stops, alone or together, then the motions as they are given. `x` (n_nodes, 3):
    where the bodies are, if that is not where the mesh has them.
    """
    if not motions:
        return ()
    loose = _loose(motions, closed, x)
    parts = np.square(felt(closed, loose, x)) if loose else np.empty(0)
    told = [Held(*one, float(part)) for one, part in zip(_moved(loose, u, x), parts, strict=True)]
    return (*told, *(Held(*one) for one in _moved(motions, u, x)))


def _loose(motions: Sequence[FreeMotion], closed: csr_array, x: Floats | None) -> Sequence[FreeMotion]:
    """The motions that contact hardly stops: those among the ones given, by their names, unless more of them together.

    A motion that is hardly stopped is known to the root of `HARDLY` alone, too little to tell its axis by.
    """
    alone = [m for m, size in zip(motions, felt(closed, motions, x), strict=True) if size**2 < HARDLY]
    together = still_free(closed, motions, least=float(np.sqrt(HARDLY)), x=x)
    return together if len(together) > len(alone) else alone


def _moved(motions: Sequence[FreeMotion], u: Floats, x: Floats | None) -> Iterator[tuple[str, float, float]]:
    """What each motion is called, how far it displaced a node at most, and the least extent of a body that it moves.

    A point has no extent that it could be compared with.
    """
    for motion, far in zip(motions, displaced_by(motions, u, x), strict=True):
        sizes = [np.ptp(motion.space.local.points[body.nodes], axis=0).max() for body in motion.bodies]
        yield describe(motion), float(far), min(float(size) or np.inf for size in sizes)


def warnings_of(held: Sequence[Held], prescribed: float) -> Iterator[str]:
    """Sentences on motions that contact hardly resists, or that took a body farther than its size.

    `prescribed`: how far what is prescribed moves; a body that goes along with that goes where it is meant to.
    """
    told: set[str] = set()
    for one in held:
        far = one.moved > one.size + prescribed
        if one.words not in told and (far or one.part < HARDLY):
            told.add(one.words)
            went = f"{one.words} by {one.moved:.4g}"
            went += f", farther than it is long ({one.size:.4g})" if far else ""
            advice = "hold it by a displacement or a spring, or look where its load takes it"
            yield f"{went}: {_resisted(one.part)}; {advice}"


def _resisted(part: float) -> str:
    if np.isnan(part):
        return "contact alone resists that"
    if part < STOPPED_BY_CONTACT**2:
        return "contact alone could stop that, and no closed macro-element does"
    return f"contact alone resists that, with {part:.1e} of its stiffness, as little as the roughness of a mesh gives"


def beyond_a_cell(space: Space, u: Floats) -> str | None:
    """A sentence on the node that u (n_dof,) takes farthest, if that is farther than the largest cell it is of is long.

    Small kinematics leaves bodies and contact where they were.
    """
    far = np.linalg.norm(u.reshape(-1, space.dim), axis=1)
    node = int(far.argmax())
    size = 0.0
    for block in space.blocks:
        x = space.local.points[block.nodes[(block.nodes == node).any(axis=1)]]
        size = max(size, float(np.ptp(x, axis=1).max(initial=0.0)))
    if not far[node] > size > 0:
        return None
    place = ", ".join(space.told(space.mesh.points[node]))
    who = f"node {space.mesh.node_number[node]} ({place})"
    message = f"{who} moves by {far[node]:.4g} and its cells are {size:.4g} long"
    return f'{message}: small kinematics takes displacements for small; look what moves, or take kinematics = "finite"'
