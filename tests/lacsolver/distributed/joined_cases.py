"""Cases for several processes whose nodes are joined: equations, couplings, bolts, sectors; some of soft contact."""

from __future__ import annotations

from tests.lacsolver.moving import FINITE, PLANE, SMALL, SPACE, steps
from tests.lacsolver.patch_meshes import joined
from tests.lacsolver.sectors import sector
from tests.lacsolver.test_pretension import joint
from verification.meshes.bars import bars

_TOUCH = '[[contact]]\nname = "zone"\nslave = "slave"\nmaster = "master"\n'
_BOTTOM = '[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\nuz = 0.0\n'
_METAL = "[[material]]\nyoung = 1000.0\npoisson = 0.3\n"
_TERMS = """[[equation]]
terms = [
    { factor = 2.0, at = [0.0, 0.0, 1.0], component = "uz" },
    { factor = -1.0, at = [0.25, 0.25, 1.0], component = "ux" },
    { factor = 1.0, at = [0.25, 0.25, -0.5], component = "uy" },
]
value = "0.01 * t"
"""
_MOTION = '[[probe]]\nname = "end"\ngroup = "top"\n[gravity]\ngz = -0.01\n[dynamics]\n'
_BOLT = """
[[displacement]]\ngroup = "foot"\nux = 0.0\nuy = 0.0\nuz = 0.0
[[rigid]]\ngroup = "head"\nux = 0.0\nuy = 0.0\nfz = [[0, 0], [1, 0], [2, 6]]
[[pretension]]\ngroup = "shank"\nforce = [[0, 0], [1, 10]]
"""
_SIDES = '[[cyclic]]\nslave = "a"\nmaster = "b"\nsectors = 6\n'
_LID = '[[coupling]]\nname = "lid"\ngroup = "lid"\nfz = "-20 * t"\nmoment = [0.0, 0.0, "2 * t"]\n'
_TABLE = 'law = "table"\npressures = [[0, 0], [1, 0.002], [30, 0.02]]\n'
_EXPONENTIAL = 'law = "exponential"\npressure_at_contact = 0.01\nclearance_at_zero = 0.1\n'
_LATE = (
    '[[displacement]]\ngroup = "top"\nuy = 0.0\nuz = [[0, 0], [1, -0.01]]\n'
    '[[displacement]]\ngroup = "top"\nux = [[0, 0], [1, 0], [2, 0.005]]\nbegin = 1.0\nreached = 2.0\n'
)
_LEVEL = '[[equation]]\ngroup = "lid"\nsame = ["uz"]\n'


def stacked_sectors(kinds, counts, skew=0.0):
    """A sector on a sector, whose sides are in one group each."""
    low, high = (sector(kind, count, 6, skew=skew) for kind, count in zip(kinds, counts, strict=True))
    sides = {"a": "a", "b": "b"}
    return joined([
        (low, (0, 0, 0), {"body": "lower", "bottom": "bottom", "top": "slave", **sides}),
        (high, (0, 0, 1), {"body": "upper", "bottom": "master", "top": "lid", **sides}),
    ])  # fmt: skip


#: of a case whose iterations may end anywhere below 1e-10, so that processes are compared, and not where they end
SOLVER = {"shared displacements and a coupling in a plane": "tolerance = 1e-11\n"}
#: the text of each case, and its mesh
CASES = {
    "shared displacements and a coupling in a plane": (
        PLANE + SMALL + _TOUCH + _EXPONENTIAL + _BOTTOM.replace("uz = 0.0\n", "")
        + '[[equation]]\ngroup = "top"\nsame = ["uy"]\n'
        + '[[coupling]]\ngroup = "x0"\nkind = "rigid"\ncomponents = ["ux"]\nfx = 1e-3\nmoment = 1e-4\n'
        + '[[force]]\ngroup = "top"\nfy = -0.02\nmoment = 0.001\ntotal = true\n' + steps(1.0, 2),
        lambda: bars(("QUAD8", "TRIA6"), (4, 3), (3, 2)),
    ),
    "a moved point of a coupling, finite": (
        SPACE + FINITE + _TOUCH + _BOTTOM
        + '[[coupling]]\ngroup = "top"\nat = [0.2, 0.0, 1.5]\nux = 0.0\nuy = 0.0\nuz = "-0.05 * t"\n'
        + 'rotation = [0.0, "0.02 * t", "0.1 * t"]\n' + steps(1.0, 2),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1)),
    ),
    "an equation of three nodes, in motion": (
        SPACE + SMALL + _TOUCH + _BOTTOM + _TERMS + _MOTION + steps(1.0, 4),
        lambda: bars(("HEXA8", "HEXA8"), (4, 2), (2, 1)),
    ),
    "a bolt": (
        SPACE + _METAL + _TOUCH + _BOLT + "lock = 1.0\n" + steps(2.0, 2), lambda: joint("HEXA8", m=3),
    ),
    "a bolt of halves that do not match, finite": (
        SPACE + _METAL.replace("young", 'law = "neo_hookean"\nyoung').replace("[[m", 'kinematics = "finite"\n[[m', 1)
        + _TOUCH + _BOLT + steps(2.0, 2),
        lambda: joint("HEXA8", halves=True),
    ),
    "a sector with friction": (
        SPACE + _METAL + _SIDES + _TOUCH + "friction = 0.3\n" + _BOTTOM + _LID + _LEVEL + steps(1.0, 2),
        lambda: stacked_sectors(("HEXA8", "HEXA8"), ((3, 4, 2), (2, 3, 2))),
    ),
    "a sector with a rigid lid that turns": (
        SPACE + _METAL + _SIDES + _TOUCH + "friction = 0.3\n" + _BOTTOM + _LID.replace("group", 'kind = "rigid"\ngroup')
        + "at = [0.0, 0.0, 2.0]\nux = 0.0\n" + steps(1.0, 1),
        lambda: stacked_sectors(("HEXA8", "HEXA8"), ((3, 4, 2), (2, 3, 2))),
    ),
    "a sector of sides that do not match": (
        SPACE + _METAL + _SIDES + _TOUCH + "friction = 0.3\n" + _TABLE + _BOTTOM + _LID + steps(1.0, 2),
        lambda: stacked_sectors(("HEXA8", "HEXA8"), ((3, 4, 2), (2, 3, 2)), skew=0.2),
    ),
    "a support that begins late, and an equation": (
        SPACE + SMALL + _TOUCH + "friction = 0.3\n" + _BOTTOM + _LATE + _TERMS + steps(2.0, 4),
        lambda: bars(("HEXA8", "HEXA8"), (4, 2), (2, 1)),
    ),
}  # fmt: skip
