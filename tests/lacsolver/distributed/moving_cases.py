"""Cases with [dynamics], and with rigid bodies that are free, for several processes: on small meshes."""

from __future__ import annotations

from tests.lacsolver.moving import FINITE, PLANE, SMALL, SPACE, WALL, held_sideways, steps, thrown
from verification.meshes.bars import bar_on_wall, bars

_TOUCH = '[[contact]]\nname = "zone"\nslave = "slave"\nmaster = "master"\n'
_PROBE = '[[probe]]\nname = "end"\ngroup = "top"\n'
_FOOT = '[[displacement]]\ngroup = "bottom"\nuy = "0.01 * t ** 2"\n'
_DAMPED = "[gravity]\ngy = -0.05\n[dynamics]\nalpha = 0.1\nrayleigh = [0.02, 0.01]\nstart = 0.5\n"


def _dropped(text, dim=2):
    """A bar that hits a rigid wall; sideways held."""
    return text + WALL.replace("[[contact]]", '[[contact]]\nname = "zone"') + held_sideways(dim) + _PROBE


_BOTTOM = '[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\nuz = 0.0\n'
_ALL = "fx = 0.0\nfy = 0.0\nfz = 0.0\nmoment = [0.0, 0.0, 0.0]\n"
_PRESSED = '[[rigid]]\ngroup = "top"\nfz = "-1e-4 * t"\nmoment = [0.0, "1e-6 * t", 0.0]\n'
_SPRING = '[[spring]]\ngroup = "top"\nkx = 1e-3\nky = 1e-3\n'

#: rigid bodies in static equilibrium: the text of each case, and its mesh
RIGID = {
    "in space, a top that is pushed and turned": (
        SPACE + SMALL + _TOUCH + _BOTTOM + _PRESSED + _SPRING + steps(1.0, 2),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1)),
    ),
    "in space, finite": (
        SPACE + FINITE + _TOUCH.replace("contact", "tie") + _BOTTOM + _PRESSED
        + "fx = 0.0\nfy = 1e-6\n" + steps(1.0, 2),
        lambda: bars(("TETRA4", "HEXA8"), (4, 3), (2, 1)),
    ),
    "a bare plate that contact alone stops": (
        PLANE + SMALL + WALL.replace("[[contact]]", '[[contact]]\nname = "zone"') + 'fy = "0.01 * t"\nmoment = 0.0\n'
        + '[[displacement]]\ngroup = "top"\nux = 0.0\nuy = 0.0\n' + steps(1.0, 2),
        lambda: bar_on_wall("QUAD8", 8),
    ),
}  # fmt: skip
#: a case without contact: no process has nodes of both bars, one of which stays at rest
APART = "thrown away from a bar at rest"
#: the text of each case, and its mesh
CASES = {
    "bar on a wall": (
        _dropped(PLANE + SMALL) + thrown("bar", vy=-0.2) + "[dynamics]\n" + steps(2.4, 12),
        lambda: bar_on_wall("QUAD8", 5, 0.02),
    ),
    "preloaded, pushed by a foot, damped": (
        PLANE + SMALL + _TOUCH + _PROBE + held_sideways() + _FOOT + _DAMPED + steps(2.0, 8),
        lambda: bars(("TRIA3", "QUAD4"), (5, 4), (2, 3)),
    ),
    "one cell thick": (
        _dropped(PLANE + SMALL) + thrown("bar", vy=-0.2) + '[dynamics]\nmass = "lumped"\n' + steps(1.5, 8),
        lambda: bar_on_wall("TRIA6", 1, 0.02),
    ),
    "in space, finite, thrown with a spin": (
        SPACE + FINITE + _TOUCH + _PROBE + '[[initial]]\ngroups = ["upper"]\nvz = -0.15\nrotation = [0.0, 0.1, 0.05]\n'
        + '[dynamics]\nscheme = "newmark"\n' + steps(0.6, 4),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1), 0.02),
    ),
    "a wall of its own mass, finite": (
        PLANE + FINITE + WALL.replace("[[contact]]", '[[contact]]\nname = "zone"')
        + "fx = 0.0\nfy = 0.0\nmoment = 0.0\nmass = 0.5\ninertia = 0.01\n" + _PROBE
        + "[gravity]\ngx = 0.1\n[dynamics]\n"
        + thrown("wall", rotation=2.0) + thrown("bar", vy=-0.53) + steps(0.4, 4),
        lambda: bar_on_wall("QUAD4", 6, 0.05),
    ),
    "thrown so far in a step that it would pass through the wall": (
        _dropped(PLANE + SMALL).replace('"zone"', '"zone"\ngeometry = "current"\nsearch_distance = 0.2')
        + thrown("bar", vy=-1.5) + "[dynamics]\n" + steps(1.0, 1),
        lambda: bar_on_wall("QUAD4", 4, 0.7),
    ),
    "in space, a rigid top that is thrown": (
        SPACE + SMALL + _TOUCH + _PROBE + _BOTTOM + '[[rigid]]\ngroup = "top"\n' + _ALL
        + "mass = 0.01\ninertia = [1e-4, 1e-4, 2e-4]\n[dynamics]\n" + thrown("upper", vz=-0.1) + steps(1.0, 4),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1), 0.01),
    ),
    APART: (
        PLANE + SMALL + _PROBE + held_sideways() + thrown("upper", uy='"0.01 * y"', vy=0.15) + "[dynamics]\n"
        + steps(1.0, 2),
        lambda: bars(("QUAD4", "TRIA3"), (4, 4), (2, 2), 0.1),
    ),
}  # fmt: skip
