"""The pieces of two half-spaces near their contact, between grid lines whose places follow the edge of contact.

The contact is where |x| <= 1 (lengths are in its half-width a): the slave is above y = 0 (z = 0 in space), its grid
lines stand h = 1 / (k + f) apart up to the one beyond the edge, so that on every level the edge lies at the same
fraction f inside its macro-element. The pieces reach to 2 a sideways and in depth. Bodies are cut at their planes of
symmetry x = 0 (y = 0). The lines of the master are spread evenly and do not match.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import SPLITS, assembled
from verification import grids
from verification.meshes.blocks import LEFT, block, boxed, joined

#: how far the pieces reach, in half-widths
REACH = 2.0
Floats = NDArray[np.floating]


def half_spaces(kind: str, k: int, fraction: float, *, rigid: bool = False) -> Mesh:
    """Slave and master of cells of type `kind`, about k slave cells to the half-width (k even), or a flat rigid master.

    Groups: `upper`, `lower`, `slave`, `master`; `axis_x` (and `axis_y`): x = 0, y = 0; `far_upper`, `far_lower`.
    """
    dim = CELLS[kind].dim
    aside, even = edge_lines(k, fraction), np.linspace(0, REACH, 3 * k // 2 + 1)
    deep = depth_lines(k)
    up = "xyz"[dim - 1]
    upper = piece(kind, [*[aside] * (dim - 1), deep])
    slave = upper, _roles(upper, "upper", {f"{up}0": "slave"})
    if rigid:
        plane = "SEG2" if dim == 2 else "QUAD4"
        x = (np.array(CELLS[plane].reference) + 1) / 2
        x = np.column_stack([x if dim == 3 else 1 - x, np.zeros(len(x))]) * (REACH + 1)  # it faces up
        master = assembled(np.pad(x, ((0, 0), (0, 3 - dim))), {(plane, "master"): np.arange(len(x))[None]}, dim)
        return joined([slave, (master, {"master": "master"})])
    lower = piece(kind, [*[even] * (dim - 1), -deep[::-1]])
    return joined([slave, (lower, _roles(lower, "lower", {f"{up}1": "master"}))])


def half_planes(kind: str, k: int, fraction: float) -> Mesh:
    """Two half-planes, 4 wide and 2 deep each, about k slave cells to the half-width; triangles of the one half are
    the other's in a mirror, so that a shear to the right and one to the left are the same.

    Groups: `upper`, `lower`, `slave`, `master`, `far_upper`, `far_lower`.
    """
    aside, even, deep = edge_lines(k, fraction), np.linspace(-REACH, REACH, 3 * k + 1), depth_lines(k)
    upper = piece(kind, [np.concatenate([-aside[:0:-1], aside]), deep], mirrored=True)
    lower = piece(kind, [even, -deep[::-1]], mirrored=True)
    return facing(upper, lower)


def facing(upper: Mesh, lower: Mesh, **sides: str) -> Mesh:
    """A body on another: `upper`, `lower`, `slave`, `master`; other sides are far_upper, far_lower, or of `sides`."""
    up = "xyz"[upper.space_dim - 1]
    roles = (("upper", f"{up}0", "slave"), ("lower", f"{up}1", "master"))
    return joined([
        (mesh, dict.fromkeys(mesh.cell_groups, f"far_{body}") | {"": body, surface: role} | sides)
        for mesh, (body, surface, role) in zip((upper, lower), roles, strict=True)
    ])  # fmt: skip


def edge_lines(k: int, fraction: float) -> Floats:
    """Lines from 0 to REACH: k + 1 even steps, the last around the edge of contact at 1, then half as many as k.

    >>> edge_lines(2, 0.5).round(12).tolist()
    [0.0, 0.4, 0.8, 1.2, 2.0]
    """
    inner = np.arange(k + 2) / (k + fraction)
    return np.concatenate([inner, np.linspace(inner[-1], REACH, k // 2 + 1)[1:]])


def depth_lines(k: int) -> Floats:
    """Lines from the surface to REACH: k steps down to 1, then half as many."""
    return np.concatenate([np.linspace(0, 1, k + 1), np.linspace(1, REACH, k // 2 + 1)[1:]])


def piece(kind: str, lines: Sequence[Floats], *, mirrored: bool = False) -> Mesh:
    """A box of cells of type `kind` between grid lines, its sides as groups.

    `mirrored`: diagonals of triangles point away from the origin in all quadrants.
    """
    if not mirrored or CELLS[kind].linear != "TRIA3":
        return block(kind, lines, [line[0] for line in lines], [line[-1] for line in lines])
    x, y = (line[1:] + line[:-1] for line in lines)
    left = np.outer(x, y).ravel() < 0
    return boxed(kind, grids.box(*lines), ([SPLITS["TRIA3"], LEFT], left.astype(int)))


def _roles(mesh: Mesh, body: str, names: dict[str, str]) -> dict[str, str]:
    """New names of the groups of a piece, by their role: symmetry, surface, far boundary."""
    symmetric = ("x0", "y0")[: mesh.space_dim - 1]
    known = {"": body, **{side: f"axis_{side[0]}" for side in symmetric}, **names}
    return {name: known.get(name, f"far_{body}") for name in ("", *mesh.cell_groups)}
