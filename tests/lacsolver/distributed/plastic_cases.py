"""Cases of metals that yield for several processes: pressed unevenly, relieved, pressed again, on small meshes."""

from __future__ import annotations

from tests.lacsolver.moving import PLANE, steps
from verification.meshes.bars import bars

_METAL = """[[material]]\nlaw = "plastic"\nyoung = 1000.0\npoisson = 0.3
hardening = [[2.0, 0.0], [3.0, 0.1]]\nkinematic = 20.0
"""
_PRESSED = """
[[contact]]\nslave = "slave"\nmaster = "master"
[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0
[[displacement]]\ngroup = "top"\nux = 0.0\nuy = [[0, 0], [1, -0.01], [2, -0.004], [3, -0.02]]
"""

#: the text of each case, and its mesh
CASES = {
    "metal": (PLANE + _METAL + _PRESSED + steps(3.0, 3), lambda: bars(("QUAD8", "QUAD4"), (4, 3), (3, 2))),
    "metal, finite": (
        PLANE + 'kinematics = "finite"\n' + _METAL + _PRESSED + steps(3.0, 3),
        lambda: bars(("QUAD4", "TRIA6"), (4, 3), (3, 2)),
    ),
}
