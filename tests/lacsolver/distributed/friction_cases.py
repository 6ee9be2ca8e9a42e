"""Cases with friction for several processes: parts stick and parts slide, on small meshes."""

from __future__ import annotations

from tests.lacsolver.moving import FINITE, PLANE, SMALL, SPACE, steps
from verification.meshes.bars import bars

_RUBBED = '[[contact]]\nname = "zone"\nslave = "slave"\nmaster = "master"\nfriction = 0.1\n'
_PLANE = """
[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0
[[displacement]]\ngroup = "top"\nux = "0.07 * sin(5 * t)"\nuy = "-0.05 * t - 0.1 * x * t"
"""
_SPACE = """
[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\nuz = 0.0
[[displacement]]\ngroup = "top"\nux = "0.07 * sin(5 * t)"\nuy = "0.05 * t"\nuz = "-0.05 * t - 0.1 * x * t"
"""
_DRAWN = """
[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0
[[traction]]\ngroup = "top"\ntx = "2e-4 * t"\nty = "-5e-3 * t"
"""
_MOVING = _RUBBED.replace("0.1", "0.3") + 'geometry = "current"\n'

#: the text of each case, and its mesh
CASES = {
    "rubbed in a plane": (
        PLANE + SMALL + _RUBBED + _PLANE + steps(1.0, 4), lambda: bars(("TRIA3", "QUAD4"), (5, 4), (5, 4)),
    ),
    "rubbed in a plane, finite": (
        PLANE + FINITE + _RUBBED + "cohesion = 0.001\n" + _PLANE + steps(1.0, 4),
        lambda: bars(("QUAD8", "TRIA6"), (4, 3), (4, 3)),
    ),
    "rubbed in space": (
        SPACE + SMALL + _RUBBED + _SPACE + steps(1.0, 3), lambda: bars(("HEXA8", "TETRA4"), (4, 3), (3, 2)),
    ),
    "rubbed in space, in the current geometry": (
        SPACE + SMALL + _MOVING + _SPACE + steps(0.5, 3), lambda: bars(("TETRA4", "HEXA8"), (4, 3), (3, 2)),
    ),
    "held by contact alone": (  # loads act on nodes of some processes only
        PLANE + SMALL + _RUBBED + _DRAWN + steps(1.0, 2), lambda: bars(("QUAD4", "TRIA3"), (4, 4), (2, 2)),
    ),
}  # fmt: skip
