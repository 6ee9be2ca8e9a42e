"""Warning of macro-elements in contact that dip into their master: an edge of the slave that tilts or folds under.

The gap of a macro-element is zero in the mean. Where it is at an angle to the master, one side of it is inside the
master and the other one above. Beside an edge of the slave nothing keeps it from turning.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lacsolver.doubts.run import Doubt, Run
from lacsolver.equilibrium.state import CONTACT

#: depth, of the size of a macro-element, from which it is warned of
_DEEP = 0.1


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
