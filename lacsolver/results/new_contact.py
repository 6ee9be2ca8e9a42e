"""Warnings where friction depends on the steps: macro-elements that come into contact and slide in one step, and rigid
bodies that turn far in one.

The slip of the first is counted from the start of the step, although part of it was before they touched. It is said
where they carry more than a quarter of the friction of their zone. Slip is measured in a straight line from the start
of a step to its end, which is too short by 4 % for points that go round by half a radian, and 0 after a turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from lacmesh.mesh import Floats
from lacsolver.contact import Interface
from lacsolver.equilibrium.state import CONTACT, SLIDES, State
from lacsolver.problem.problem import Problem

#: part of the friction of a zone that such macro-elements carry
_MUCH = 0.25
#: angle (radians) of a rigid body in a step above which it is said
_FAR = 0.5


def closed_at_start(problem: Problem, faces: Mapping[str, Interface]) -> dict[str, NDArray[np.bool_]]:
    """Return the macro-elements (n,) of each zone with friction that touch before the first step.

    `faces`: interface of each zone in the undeformed configuration, at the end of the first step.
    """
    out = {}
    for pair in problem.joints:
        if pair.pairing.friction:
            face = faces[pair.name]
            if pair.timed:  # the clearance was another one
                face = pair.integrate(problem.space, np.zeros(problem.space.n_dof), 0.0)
            out[pair.name] = face.touching
    return out


def sliding_since_contact(state: State, closed: dict[str, NDArray[np.bool_]]) -> Iterator[str]:
    """Yield a warning for each zone of a converged step; `closed`: macro-elements in contact before it."""
    for zone in state.zones:
        if zone.friction is None or zone.name not in closed:
            continue
        new = (zone.status == SLIDES) & ~closed[zone.name]
        carried = np.linalg.norm(zone.friction.shear, axis=1) * zone.area * zone.coverage
        if carried[new].sum() > _MUCH * carried.sum():
            part = f"{int(new.sum())} of {int((zone.status >= CONTACT).sum())} macro-elements"
            yield (
                f"friction of {zone.name!r} depends on the load path: {part} closed and slid in one step, "
                f"at time {state.time:.6g}; compare with twice as many steps"
            )


def turned_far(problem: Problem, state: State, before: Mapping[str, Floats]) -> Iterator[str]:
    """Yield a warning for each rigid body that turns far in a step and slides, or turns so far that slip is not seen.

    `before`: motion of each rigid body in the last state; none before the first step.
    """
    for body in problem.constraints.rigid if problem.kinematics.finite else ():
        moved = state.rigid[body.name] - before.get(body.name, 0.0)
        angle = float(np.linalg.norm(moved[problem.space.dim :]))
        for pair, zone in zip(problem.joints, state.zones, strict=True):
            skins = [skin.faces.distinct_nodes for skin in (pair.zone.slave, pair.zone.master)]
            rubs = zone.friction is not None and np.isin(np.concatenate(skins), body.nodes).any()
            if rubs and angle > _FAR * (1 + 1e-6) and (angle > np.pi or (zone.status == SLIDES).any()):
                yield (
                    f"friction of {zone.name!r} measures slip in straight lines, and {body.name!r} turns by "
                    f"{angle:.3g} radians in the step to time {state.time:.6g}; take steps that turn it by {_FAR:g} "
                    "at most"
                )
