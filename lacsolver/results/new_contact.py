"""Warning about macro-elements that come into contact and slide in one step, so that friction depends on the steps.

Their slip is counted from the start of the step, although part of it was before they touched. It is said where they
carry more than a quarter of the friction of their zone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from lacsolver.contact import Interface
from lacsolver.problem.problem import Problem
from lacsolver.results.state import CONTACT, SLIDES, State

#: part of the friction of a zone that such macro-elements carry
_MUCH = 0.25


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
                f"friction of {zone.name!r} depends on the way: {part} closed and slid in one step, "
                f"at time {state.time:.6g}; compare with twice as many steps"
            )
