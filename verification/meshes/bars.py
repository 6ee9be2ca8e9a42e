"""Bars along the last axis, of length 1 and width 1/4, that hit a flat rigid wall or one another.

Sideways motion is held on the groups `x0`, `x1` (and `y0`, `y1` in space), so that waves are those of one dimension.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import assembled
from verification.meshes.blocks import block, joined

#: width of a bar
WIDTH = 0.25


def bar(kind: str, n: int, low: float = 0.0, across: int | None = None) -> Mesh:
    """A bar from height `low` to `low` + 1, n cells of type `kind` long, its sides as groups.

    >>> bar("QUAD4", 8).n_nodes
    27
    """
    dim = CELLS[kind].dim
    corners = (0.0,) * (dim - 1) + (low,), (WIDTH,) * (dim - 1) + (low + 1.0,)
    counts = (across or max(1, n // 4),) * (dim - 1) + (n,)
    return block(kind, counts, *corners)


def bar_on_wall(kind: str, n: int, gap: float = 0.0) -> Mesh:
    """A bar above a rigid wall: groups `bar`, `slave` (its lower end), `top`, its sides, and `wall`, one flat face."""
    dim = CELLS[kind].dim
    mesh = bar(kind, n, gap)
    plane = "SEG2" if dim == 2 else "QUAD4"
    x = np.array(CELLS[plane].reference, float) * 2 * WIDTH + WIDTH / 2  # from -3/8 to 5/8
    x = np.column_stack([x if dim == 3 else WIDTH - x, np.zeros(len(x))])  # it faces up
    wall = assembled(np.pad(x, ((0, 0), (0, 3 - dim))), {(plane, "wall"): np.arange(len(x))[None]}, dim)
    return joined([(mesh, _names(dim, "slave", "top", "bar")), (wall, {"wall": "wall"})])


def bars(kinds: tuple[str, str], counts: tuple[int, int], across: tuple[int, int], gap: float = 0.0) -> Mesh:
    """A bar above another: groups `upper`, `lower`, `slave` (of the upper), `master`, `top`, `bottom`, the sides."""
    dim = CELLS[kinds[0]].dim
    upper, lower = bar(kinds[0], counts[0], gap, across[0]), bar(kinds[1], counts[1], -1.0, across[1])
    return joined([(upper, _names(dim, "slave", "top", "upper")), (lower, _names(dim, "bottom", "master", "lower"))])


def _names(dim: int, low: str, high: str, body: str) -> Mapping[str, str]:
    up = "xyz"[dim - 1]
    sides = {f"{a}{e}": f"{a}{e}" for a in "xyz"[: dim - 1] for e in "01"}
    return {f"{up}0": low, f"{up}1": high, "body": body, "": body, **sides}
