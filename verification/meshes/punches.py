"""Flat punches with sharp corners on a block: corners anywhere over its faces, chosen at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lacmesh import Mesh
from verification.meshes.blocks import block, joined

#: size of the block's faces, and the height of the punch above it
FACE, ABOVE = 0.5, 0.05
#: faces of the block along each axis in front of the punch, and its cells below, by dimension
_COUNTS = {2: (8, 4), 3: (5, 2)}


@dataclass(frozen=True)
class Punch:
    """A punch over a block: where its lower corner is, its width, faces a side, how deep it goes; the block's law."""

    corner: tuple[float, ...]
    wide: float
    faces: int
    depth: float
    poisson: float

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return len(self.corner) + 1


def random_punch(dim: int, seed: int) -> Punch:
    """A punch of a random place, size and depth; three in ten are as wide as two faces or begin at a node."""
    draw = np.random.default_rng([dim, seed])
    aligned, whole = draw.random(2) < 0.3
    corner = tuple((3 if dim == 2 else 1.5) * FACE + (0.0 if aligned else FACE) * draw.random(dim - 1))
    wide = 2 * FACE if whole else draw.uniform(0.7, 1.3)
    return Punch(
        corner, wide, int(draw.integers(2, 5)) if dim == 2 else 2, draw.uniform(0.05, 0.25), draw.uniform(0.2, 0.45)
    )


def punched(punch: Punch) -> Mesh:
    """The block, QUAD4 or HEXA8, and the punch above it. Groups: block, bottom, top; punch, face."""
    kind, up = ("QUAD4", "y") if punch.dim == 2 else ("HEXA8", "z")
    along, below = _COUNTS[punch.dim]
    flat, names = punch.dim - 1, {"": "block", f"{up}0": "bottom", f"{up}1": "top"}
    under = block(kind, (along,) * flat + (below,), (0.0,) * flat + (-1.0,), (along * FACE,) * flat + (0.0,))
    low, high = (*punch.corner, ABOVE), (*(x + punch.wide for x in punch.corner), ABOVE + FACE)
    over = block(kind, (punch.faces,) * flat + (1,), low, high)
    return joined([(under, names), (over, {"": "punch", f"{up}0": "face"})])
