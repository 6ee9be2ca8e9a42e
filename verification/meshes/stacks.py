"""Blocks on one another whose faces do not match: every type of cell and mixtures, distorted, tilted, bent.

A block fills [0, 1]^d; the lower of a stack is at heights 0 to 1, the upper at 1 to 2. Groups of a stack: `slave` and
`master` between the blocks, `bottom`, `top`, and `x0`, `x1` (`y0`, `y1`) on the sides, over both blocks; the cells are
in `lower` and `upper`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.generate.parts import linear, raised
from verification import grids
from verification.meshes.blocks import SIDES, bent, joined

Ints = NDArray[np.integer]
Floats = NDArray[np.floating]

#: kinds of blocks: a type of cell, with what it turns to the other block where it has faces of two shapes; mixtures,
#: with the order that they are raised to
PLANE_KINDS = ("TRIA3", "TRIA6", "TRIA7", "QUAD4", "QUAD8", "QUAD9", "mixed 1", "mixed 2", "mixed 2-full")
SOLID_KINDS = (
    *("TETRA4", "TETRA10", "HEXA8", "HEXA20", "HEXA27"),
    *(f"{name} {face}" for name in ("PENTA6", "PENTA15", "PENTA18") for face in ("triangle", "quadrangle")),
    *(f"{name} {face}" for name in ("PYRAM5", "PYRAM13", "PYRAM14") for face in ("triangle", "quadrangle")),
    *("mixed 1", "mixed 2", "mixed 2-full"),
)
#: kinds whose slave faces may be cut in two ways
TWO_WAYS = ("HEXA8", "HEXA20")
#: layers of cells in a block; even, so that pyramids turn the same faces up and down
LAYERS = 2
#: how uneven grid lines are along each axis, as parts of `bend`: t -> t + bend BEND t (1 - t)
BEND = (1.0, -0.8, 0.5)


def block(kind: str, counts: Sequence[int], *, bend: float = 0.0, skew: float = 0.0) -> Mesh:
    """A block of cells of a kind, `counts` (dim,) along the axes (the last even); its sides are groups x0, x1, ...

    `bend`: how uneven the grid's lines are. `skew`: how far columns of nodes are moved at the middle of the block,
    which leaves its sides flat and makes quadrangles of faces that were rectangles.

    >>> block("PYRAM5 triangle", (1, 1, 2)).cells_by_type
    {'PYRAM5': 6, 'TRIA3': 12, 'QUAD4': 4}
    """
    dim = len(counts)
    even = grids.box(*(np.arange(n + 1) / n for n in counts))
    mesh = linear(even, kind, SIDES).renamed(body="")
    points = mesh.points.copy()
    for axis in range(dim):
        t = points[:, axis]
        points[:, axis] = t + bend * BEND[axis] * t * (1 - t)
    plane = points[:, : dim - 1]
    bubble = np.prod(4 * plane * (1 - plane), axis=1)
    points[:, : dim - 1] = plane + skew * bubble[:, None] * np.array([1.0, -0.7])[: dim - 1]
    return raised(replace(mesh, points=points), kind)


def stack(
    slave: str, master: str, dim: int, *, slave_below: bool = True, counts: tuple[int, int] = (3, 2), gap: float = 0.0,
    bend: float = 0.0, skew: float = 0.0,
) -> Mesh:  # fmt: skip
    """Two blocks of kinds `slave` and `master`, `counts` cells a side of the lower and of the upper one.

    `gap`: how far the upper is above the lower, which is skewed the other way.
    """
    up = "xyz"[dim - 1]
    kinds, roles = ((slave, master), ("slave", "master")) if slave_below else ((master, slave), ("master", "slave"))
    parts = []
    for k, (kind, n, role) in enumerate(zip(kinds, counts, roles, strict=True)):
        part = block(kind, (*(n,) * (dim - 1), LAYERS), bend=bend, skew=-skew if k else skew)
        names = {f"{a}{e}": f"{a}{e}" for a in "xyz"[: dim - 1] for e in "01"}
        names |= {f"{up}{1 - k}": role, f"{up}{k}": ("bottom", "top")[k], "": ("lower", "upper")[k]}
        parts.append((moved(part, shift=np.eye(3)[dim - 1] * k * (1 + gap)), names))
    return joined(parts)


def tower(kinds: Sequence[str], counts: Sequence[int]) -> Mesh:
    """Blocks on one another in space: `slave1` lies on `master1`, `slave2` on `master2` ...; cells `body0`, ..."""
    parts = []
    for k, (kind, n) in enumerate(zip(kinds, counts, strict=True)):
        names = {f"{a}{e}": f"{a}{e}" for a in "xy" for e in "01"} | {"": f"body{k}"}
        names |= {"z0": f"slave{k}" if k else "bottom", "z1": f"master{k + 1}" if k + 1 < len(kinds) else "top"}
        parts.append((moved(block(kind, (n, n, LAYERS)), shift=np.array([0.0, 0, k])), names))
    return joined(parts)


def moved(mesh: Mesh, turn: Floats | None = None, shift: Floats | None = None) -> Mesh:
    """The mesh turned by a rotation (3, 3), then shifted by (3,)."""
    return bent(mesh, lambda x: (x if turn is None else x @ turn.T) + (0.0 if shift is None else shift))


def tilt(dim: int, angle: float = 0.7) -> NDArray[np.floating]:
    """(3, 3): a rotation about an axis that is no coordinate axis; about z in 2D (Rodrigues' formula)."""
    axis = np.array([0.0, 0.0, 1.0]) if dim == 2 else np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1, -2, 0.5])
    cross = -np.cross(np.eye(3), axis)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
