"""Cases with [dynamics] for several processes: what they can have, on small meshes."""

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


#: the text of each case, and its mesh
CASES = {
    "bar on a wall": (
        _dropped(PLANE + SMALL) + thrown("bar", vy=-0.2) + "[dynamics]\n" + steps(2.4, 24),
        lambda: bar_on_wall("QUAD8", 8, 0.02),
    ),
    "preloaded, pushed by a foot, damped": (
        PLANE + SMALL + _TOUCH + _PROBE + held_sideways() + _FOOT + _DAMPED + steps(2.0, 16),
        lambda: bars(("TRIA3", "QUAD4"), (8, 7), (2, 3)),
    ),
    "one cell thick": (
        _dropped(PLANE + SMALL) + thrown("bar", vy=-0.2) + '[dynamics]\nmass = "lumped"\n' + steps(1.5, 8),
        lambda: bar_on_wall("TRIA6", 1, 0.02),
    ),
    "in space, finite, thrown with a spin": (
        SPACE + FINITE + _TOUCH + _PROBE + '[[initial]]\ngroups = ["upper"]\nvz = -0.15\nrotation = [0.0, 0.1, 0.05]\n'
        + '[dynamics]\nscheme = "newmark"\n' + steps(1.2, 8),
        lambda: bars(("HEXA8", "TETRA4"), (4, 3), (2, 1), 0.02),
    ),
}  # fmt: skip
