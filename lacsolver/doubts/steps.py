"""What a step may have done to its results: friction that depends on the steps, edges that dip, cells that fold.

The slip of macro-elements that close and slide in one step is counted from its start, although part of it was before
they touched. They are doubted where they carry more than a quarter of the friction of their zone. Slip is measured in a
straight line from the start of a step to its end, which is too short by 4 % for points that go round by half a radian,
and 0 after a turn.

The gap of a macro-element is zero in the mean. Where it is at an angle to the master, one side of it is inside the
master and the other one above. Beside an edge of the slave nothing keeps it from turning.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lacsolver.doubts.run import Doubt, Run
from lacsolver.equilibrium.state import CONTACT, SLIDES

#: part of the friction of a zone that such macro-elements carry
_MUCH = 0.25
#: angle (radians) of a rigid body in a step above which it is said
_FAR = 0.5
#: depth, of the size of a macro-element, from which it is warned of
_DEEP = 0.1


def touching_at_start(run: Run) -> dict[str, NDArray[np.bool_]]:
    """Return the macro-elements (n,) of each pair with friction that touch before the first step."""
    out = {}
    for pair in run.pairs:
        if pair.pairing.friction:
            face = pair.undeformed(run.space, 0.0) if pair.timed else run.face(pair)  # the clearance was another one
            out[pair.name] = face.touching
    return out


def closed_and_slid(run: Run) -> Iterator[Doubt]:
    """Doubt friction of macro-elements that closed and slid in the last step."""
    for pair, zone in run.zones:
        before = run.touched.get(zone.name)
        if zone.friction is None or before is None:
            continue
        new = (zone.status == SLIDES) & ~before
        carried = np.linalg.norm(zone.friction.shear, axis=1) * zone.area * zone.coverage
        if carried[new].sum() > _MUCH * carried.sum():
            part = f"{int(new.sum())} of {int((zone.status >= CONTACT).sum())} macro-elements"
            message = f"friction of {zone.name!r} depends on the load path: {part} closed and slid in one step, "
            message += f"at time {run.state.time:.6g}; compare with twice as many steps"
            yield Doubt(message, pair.record)


def turned_far(run: Run) -> Iterator[Doubt]:
    """Doubt friction of rigid bodies that turned far in the last step and slid, or so far that slip is not seen."""
    problem, state = run.problem, run.state
    for body in problem.constraints.rigid if problem.kinematics.finite else ():
        moved = state.rigid[body.name] - run.rigid.get(body.name, 0.0)
        angle = float(np.linalg.norm(moved[problem.space.dim :]))
        for pair, zone in run.zones:
            skins = [skin.faces.distinct_nodes for skin in (pair.zone.slave, pair.zone.master)]
            rubs = zone.friction is not None and np.isin(np.concatenate(skins), body.nodes).any()
            if rubs and angle > _FAR * (1 + 1e-6) and (angle > np.pi or (zone.status == SLIDES).any()):
                message = f"friction of {zone.name!r} measures slip in straight lines, and {body.name!r} turns by "
                message += f"{angle:.3g} radians in the step to time {state.time:.6g}"
                yield Doubt(f"{message}; take steps that turn it by {_FAR:g} at most", pair.record)


def dips(run: Run) -> Iterator[Doubt]:
    """Doubt zones of the last state with a macro-element that dips deep into its master."""
    for pair, zone in run.zones:
        dip = np.zeros(1) if zone.dip is None else np.where(zone.status >= CONTACT, zone.dip, 0.0)
        worst = int(dip.argmax())
        if dip[worst] <= _DEEP:
            continue
        place = ", ".join(run.space.told(zone.centre[worst]))
        depth = dip[worst] * pair.zone.area[worst] ** (1 / pair.zone.slave.dim)
        message = f"slave {pair.record.slave!r} of contact {zone.name!r} is inside its master by {depth:.3g} near "
        message += f"({place}) at time {run.state.time:.6g}, {100 * dip[worst]:.2g} % of a macro-element, whose gap "
        message += "is zero in the mean: forces and friction are doubtful there"
        yield Doubt(f"{message}; round the edge off in the mesh, over several faces", pair.record)


def folded(run: Run) -> Iterator[Doubt]:
    """Doubt cells that the last step has folded, of which the solver knows."""
    if run.state.folded:
        yield Doubt(run.state.folded)
