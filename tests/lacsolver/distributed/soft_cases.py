"""Cases of contact that is adjusted, and damped, for several processes: on small meshes."""

from __future__ import annotations

from tests.lacsolver.moving import PLANE, SMALL, SPACE, steps, thrown
from verification.meshes.bars import bars

_CLOSED = '[[contact]]\nname = "zone"\nslave = "slave"\nmaster = "master"\nadjust = 0.03\n'
_DAMPED = _CLOSED.replace("adjust = 0.03", "stiffness = 2.0\ndamping = 0.5")
_DAMPED += '[[probe]]\nname = "end"\ngroup = "top"\n[[displacement]]\ngroup = "bottom"\nux = 0.0\nuy = 0.0\n'


def _pressed(dim):
    """The lower body held, the upper one pressed onto it and aside."""
    low = "".join(f"u{a} = 0.0\n" for a in "xyz"[:dim])
    high = "ux = 0.001\n" + ("uy = 0.0\nuz = -0.01\n" if dim == 3 else "uy = -0.01\n")
    return f'[[displacement]]\ngroup = "bottom"\n{low}[[displacement]]\ngroup = "top"\n{high}'


#: the text of each case, and its mesh
CASES = {
    "adjusted": (
        PLANE + SMALL + _CLOSED + _pressed(2) + steps(1.0, 1),
        lambda: bars(("QUAD4", "TRIA6"), (4, 3), (3, 2), 0.02),
    ),
    "adjusted in space": (
        SPACE + SMALL + _CLOSED + _pressed(3) + steps(1.0, 1),
        lambda: bars(("HEXA20", "TETRA4"), (4, 3), (2, 1), 0.02),
    ),
    "damped": (
        PLANE + SMALL + _DAMPED + thrown("upper", vy=-0.1) + "[dynamics]\n" + steps(0.6, 4),
        lambda: bars(("QUAD4", "TRIA6"), (4, 3), (3, 2), 0.01),
    ),
}  # fmt: skip
