"""Rotations that are prescribed, and how far they go in one step.

After a rotation by much more than a quarter of a turn the places of the nodes that it takes hardly tell which way round
the bodies behind them were bent or twisted, and a full turn leaves these nodes where they are. Such steps are halved.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lacmesh.mesh import Floats
from lacsolver.case.entry import Entry
from lacsolver.constraints.coupling import CouplingRows
from lacsolver.problem.problem import Problem
from lacsolver.space.places import said

#: largest rotation (radians) in a step: a quarter of a turn
_QUARTER = np.pi / 2 * (1 + 1e-9)


def turned_too_far(problem: Problem, before: float | None, t: float) -> str | None:
    """Return a sentence about a coupling or rigid body whose prescribed rotation is too large for a step to time t.

    `before`: time of the last state, None without one. None if there is no such rotation.
    """
    if not problem.kinematics.finite:
        return None
    turns: list[tuple[Entry, Callable[[float], Floats | None]]]
    turns = [(rows.record, rows.motion.rotation) for rows in problem.equalities if isinstance(rows, CouplingRows)]
    turns += [(body.record, body.rotation) for body in problem.constraints.rigid]
    for record, rotation in turns:
        now, then = rotation(t), None if before is None else rotation(before)
        angle = 0.0 if now is None else float(np.linalg.norm(now if then is None else now - then))
        if angle > _QUARTER:
            message = f"{said(record)} turns by {angle:.4g} radian in the step to time {t:.6g}, and the limit is"
            return f"{message} a quarter of a turn; take more steps ([steps] count) or max_halvings"
    return None
