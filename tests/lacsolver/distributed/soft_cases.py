"""Cases of contact that is adjusted, for several processes: on small meshes."""

from __future__ import annotations

from tests.lacsolver.moving import PLANE, SMALL, SPACE, steps
from verification.meshes.bars import bars

_CLOSED = '[[contact]]\nname = "zone"\nslave = "slave"\nmaster = "master"\nadjust = 0.03\n'


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
}  # fmt: skip
