"""Bodies that slide far: a block on a longer one, a ring on a block, a half-cylinder dragged over a block (lengths in
mm). No two skins that meet have nodes in the same places.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lacmesh import Mesh
from lacmesh.cells import CELLS
from verification.grids import box, half_disc, quadrangles
from verification.meshes.blocks import bent, block, polar, with_skin
from verification.meshes.blocks import joined as stacked
from verification.meshes.bodies import Body, Where, at, body, joined

Floats = NDArray[np.floating]

#: the ring: radii, of the middle between its layers too, its height above the block; the block
INNER, MIDDLE, OUTER, ABOVE = 90.0, 95.0, 100.0, 20.0
WIDE, HIGH = 250.0, 50.0
#: the die in the plane: radius, where it starts, its height above the block; the block
DIE, START, GAP = 1.5, -2.25, 0.05
IRONED = (9.0, 3.0)
#: in space: radius, half length, what is less at its ends; where it starts; half of the block
DIE_3D, HALF, CROWN, START_3D = 1.0, 0.9, 0.06, -1.5
IRONED_3D = (6.0, 1.5, 1.5)


def slider(kind: str, n: int, faces: int, wave: float = 0.0) -> Mesh:
    """A unit block of cells of type `kind`, n a side, above a bare skin that is longer, of so many faces along x.

    The skin is flat, or has waves along x that go down by twice `wave`. Groups: slave, top, plate, and the block's
    other sides x0, x1, (y0, y1).
    """
    dim = CELLS[kind].dim
    above = block(kind, n, (0.0,) * dim, (1.0,) * dim)
    names = {f"{'xyz'[dim - 1]}0": "slave", f"{'xyz'[dim - 1]}1": "top"}
    lines = np.linspace(-0.5, 3.5, faces + 1), np.linspace(-0.4, 1.4, 4)
    points = box(*lines[: dim - 1], np.zeros(1))
    points[..., -1] = wave * (np.cos(2 * np.pi * points[..., 0] / 1.6) - 1)
    number = np.arange(points[..., 0].size).reshape(points.shape[:-1])
    plate = np.stack([number[1:, 0], number[:-1, 0]], axis=1) if dim == 2 else quadrangles(number[..., 0])
    block_above = stacked([(above, names)], keep=True)
    return with_skin(block_above, "SEG2" if dim == 2 else "QUAD4", points.reshape(-1, dim), plate, "plate")


def ring(segments: int = 30) -> Mesh:
    """Half a ring of two layers over a block, so many segments on either side of the contact. Groups: inner, outer
    (cells), block, slave (of the block), master, ends, bottom.
    """
    angle = np.linspace(-np.pi, 0, segments + 1)[:, None]
    radius = np.linspace(OUTER, INNER, 5)
    centre = ABOVE + OUTER
    grid = np.stack([radius * np.cos(angle), centre + radius * np.sin(angle)], axis=-1)
    disc = body(grid, skins={"ends": at(1, centre), "master": _around(0.0, centre, OUTER)})
    middle = np.hypot(*(disc.points[disc.cells].mean(axis=1) - [0.0, centre]).T)
    parts = {"inner": np.flatnonzero(middle < MIDDLE), "outer": np.flatnonzero(middle > MIDDLE)}
    low = box(np.linspace(-WIDE / 2, WIDE / 2, segments + 1), np.linspace(-HIGH, 0, segments // 5 + 1))
    block = body(low, skins={"slave": at(1, 0.0), "bottom": at(1, -HIGH)})
    return joined({"block": block, "ring": disc._replace(parts=parts)})


def ironing_2d(across: int = 60) -> Mesh:
    """A half-cylinder on a block of so many segments. Groups: block, die, slave (of the block), master, top, bottom."""
    long, high = IRONED
    flat = DIE + GAP
    block = box(np.linspace(-long / 2, long / 2, across + 1), np.linspace(-high, 0, across // 4))
    grids = (grid + np.array([START, flat]) for grid in half_disc(DIE, across // 8, across // 20))
    return joined(
        {
            "block": body(block, skins={"slave": at(1, 0.0), "bottom": at(1, -high)}),
            "die": body(*grids, skins={"top": at(1, flat), "master": _around(START, flat, DIE)}),
        }
    )


def ironing_3d(across: int = 24) -> Mesh:
    """One half of a crowned half-cylinder over one half of a block of so many cells. Groups: block, die, slave (of the
    die), master, top, bottom, symmetry.

    The die is the slave, as all of its skin finds the block, and the stiff one: its faces are the larger ones (0.27 at
    24 cells of 0.25, 0.2 at 40 of 0.15), so that there are no more pressures than the soft block can tell apart.
    """
    long, deep, high = IRONED_3D
    counts = across, across // 4, 5 * across // 24
    ends = (-long / 2, long / 2), (0.0, deep), (-high, 0.0)
    block = box(*(np.linspace(*end, n + 1) for end, n in zip(ends, counts, strict=True)))
    symmetry = {"symmetry": at(1, 0.0)}
    return joined(
        {
            "block": body(block, skins={"master": at(2, 0.0), "bottom": at(2, -high), **symmetry}),
            "die": _die(round(across / 9), skins={"slave": _crowned, "top": at(2, DIE_3D + GAP), **symmetry}),
        }
    )


def _die(n: int, skins: dict[str, Where]) -> Body:
    """Half a disc swept along y, smaller and smaller; x, z turn left as they are seen along y, from far to near."""
    flat, stations = DIE_3D + GAP, np.linspace(HALF, 0.0, n + 1)
    grids = []
    for grid in half_disc(1.0, n, n // 2):
        x, z = np.moveaxis(grid, -1, 0)
        swept = [np.stack([START_3D + _shrunk(y) * x, np.full_like(x, y), flat + _shrunk(y) * z], -1) for y in stations]
        grids.append(np.stack(swept, axis=2))
    return body(*grids, skins=skins)


def _shrunk(y: Floats | float) -> Floats | float:
    """The radius of the die along its axis."""
    return DIE_3D * (1 - CROWN * (y / HALF) ** 2)


def _crowned(x: Floats, y: Floats, z: Floats) -> NDArray[np.bool_]:
    return np.isclose(np.hypot(x - START_3D, z - DIE_3D - GAP), _shrunk(y))


def _around(x0: float, y0: float, radius: float) -> Where:
    """Condition that holds for points on a circle."""
    return lambda x, y: np.isclose(np.hypot(x - x0, y - y0), radius)


def on_table(n: int, radius: float = 0.0) -> Mesh:
    """Return a unit block of n x n QUAD4 on one face of a rigid table: `block`, `underside`, `top`, `table`.

    `radius`: of the arcs of 60 degrees in which the underside ends, 0 for sharp edges.
    """

    def where(x: Floats) -> Floats:
        beyond = np.maximum(np.abs(x[:, 0] - 0.5) - 0.5 + radius * np.sin(np.pi / 3), 0.0)
        rise = radius - np.sqrt(radius**2 - np.minimum(beyond, radius) ** 2)
        return np.stack([1 + x[:, 0], x[:, 1] + (1 - x[:, 1]) * rise, x[:, 2]], axis=1)

    above = stacked([(block("QUAD4", n, (0, 0), (1, 1)), {"": "block", "y0": "underside", "y1": "top"})])
    return with_skin(bent(above, where), "SEG2", np.array([[4.0, 0.0], [0.0, 0.0]]), np.array([[0, 1]]), "table")


def in_groove(n: int) -> Mesh:
    """Return half of a round body, n faces to a quarter, in a groove of 90 degrees: `round`, `flank` are its skins.

    `ball` and `seat`: the bodies; `axis`: their lines of symmetry; `base`: below the seat.
    """
    ball = bent(block("QUAD4", (5, 2 * n), (4.0, -np.pi / 2), (10.0, np.pi / 2)), polar)
    seat = block("QUAD4", (13, 8), (0, 0), (25, 1))
    return stacked([
        (bent(ball, lambda x: x + np.array([0.0, 10 * np.sqrt(2), 0.0])),
         {"": "ball", "x1": "round", "y0": "axis", "y1": "axis"}),
        (bent(seat, lambda x: np.stack([x[:, 0], -20 + (20 + x[:, 0]) * x[:, 1], x[:, 2]], axis=1)),
         {"": "seat", "y1": "flank", "x0": "axis", "y0": "base"}),
    ])  # fmt: skip
