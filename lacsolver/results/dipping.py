"""Warning of macro-elements in contact that dip into their master: an edge of the slave that tilts or folds under.

The gap of a macro-element is zero in the mean. Where it is at an angle to the master, one side of it is inside the
master and the other one above. Beside an edge of the slave nothing keeps it from turning.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacsolver.equilibrium.state import CONTACT, State
from lacsolver.problem.problem import Problem

#: depth, of the size of a macro-element, from which it is warned of
_DEEP = 0.1


def dipped(problem: Problem, state: State) -> Iterator[str]:
    """Yield a warning for each zone of a converged step with a macro-element that dips deep into its master."""
    for pair, zone in zip(problem.joints, state.zones, strict=True):
        if zone.dip is None:
            continue
        dip = np.where(zone.status >= CONTACT, zone.dip, 0.0)
        if dip.max(initial=0.0) <= _DEEP:
            continue
        worst = int(dip.argmax())
        place = ", ".join(problem.space.told(zone.centre[worst]))
        depth = dip[worst] * pair.zone.area[worst] ** (1 / pair.zone.slave.dim)
        yield (
            f"slave {pair.record.slave!r} of contact {zone.name!r} is inside its master by {depth:.3g} near ({place}) "
            f"at time {state.time:.6g}, {100 * dip[worst]:.2g} % of a macro-element, whose gap is zero in the mean: "
            "forces and friction are doubtful there; round the edge off in the mesh, over several faces"
        )
