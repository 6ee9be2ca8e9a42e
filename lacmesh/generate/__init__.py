"""Meshes in a line, without a file: boxes, rings, discs, cylinders and spheres of every type of cell, and stacks.

Lengths have the user's unit, angles are in degrees. Cells are in the group `body`, the faces of each side, which turn
outward, in a group of their own:

| shape | groups of its sides |
|---|---|
| `rectangle`, `box` | left, right (along x); in space front, back (along y); bottom, top (along the last axis) |
| `ring` | inner, outer; start, end, unless it is whole; in space bottom, top |
| `disc`, `cylinder` | outer; start, end, unless it is whole; in space bottom, top |
| `sphere`, an octant | outer, and inner if it is hollow; left, front, bottom: the planes x, y, z = 0 |
| `grid` | skin |
| `line` | none |

A `kind` is a type of cell, linear or quadratic: nodes between the corners of quadratic cells lie on circles and spheres
too. A pyramid or prism may say what it turns up and down, "PENTA15 quadrangle" or "PYRAM5 triangle"; it is triangles
for prisms and quadrangles for pyramids. "mixed", "mixed 2" and "mixed 2-full" are quadrangles and triangles, or
hexahedra, prisms, pyramids and tetrahedra, of an order of `raise_order`. Not every kind fills every shape: prisms fill
no solid sphere, and pyramids with triangles up need even numbers of cells. A kind that leaves gaps is an error.

`distortion`: inner corners are moved at random along each axis of the grid by up to this share of the smaller cell
beside them; those on a side stay on it. It may be up to 0.125, with which cells of all kinds stay valid. The same
`seed` gives the same mesh on every machine.

>>> from lacmesh.generate import box, stack
>>> stack(box(3, kind="TETRA10"), box((2, 2, 1), (1, 1, 0.5)))
Mesh
  nodes            361
  cells            162 TETRA10, 108 TRIA6, 4 HEXA8, 16 QUAD4
  groups of cells  lower (162), left (20), right (20), front (20), back (20), bottom (18) and 4 more
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lacmesh.errors import RequestError
from lacmesh.generate.parts import SEAM, Counts, box_of, check_seams, dim_of, kinds, linear, raised, sew
from lacmesh.joining import join
from lacmesh.mesh import Floats, Mesh

__all__ = ["box", "cylinder", "disc", "grid", "kinds", "line", "rectangle", "ring", "sphere", "stack"]
#: names of the sides (axis, end) of a grid, the least and the greatest of each axis
_SIDES = (("left", "right"), ("bottom", "top")), (("left", "right"), ("front", "back"), ("bottom", "top"))
_RING = (("inner", "outer"), ("start", "end"), ("bottom", "top"))
#: corners of the square within a disc, and of the cube within a sphere, along axes, in the middle, at the diagonal
_ALONG, _MIDDLE, _DIAGONAL = 0.6, 0.46, 0.39
_SKIN = "skin"


def line(n: int, start: ArrayLike, end: ArrayLike, kind: str = "SEG2") -> Mesh:
    """A straight line of n segments between two points (2,); its normal points to its right, as that of a skin does.

    >>> line(1, (3, 0), (-1, 0)).points.tolist()  # a wall that faces up
    [[3.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
    """
    a, b = (np.asarray(point, float) for point in (start, end))
    mesh = box_of(kind, 1, (n,), 1.0, 0.0, 0.0, 0, ())
    return replace(mesh, points=np.pad(a + mesh.points[:, :1] * (b - a), ((0, 0), (0, 3 - len(a)))))


def rectangle(
    n: Counts = 2, size: ArrayLike = 1.0, kind: str = "QUAD4", *, corner: ArrayLike = 0.0, distortion: float = 0.0,
    seed: int = 0,
) -> Mesh:  # fmt: skip
    """A rectangle in the plane: n cells along each axis, or (nx, ny), where lines x (m,) may stand for a number.

    `size`: its length along each axis, `corner`: its lower left corner; a number is that of both axes. Lines have their
    own coordinates. A triangle is half of a grid's quadrangle.

    >>> rectangle((4, [0, 0.1, 0.3, 1]), (2, 1), "TRIA6").cells_by_type
    {'TRIA6': 24, 'SEG3': 14}
    """
    return box_of(kind, 2, n, size, corner, distortion, seed, _SIDES[0])


def box(
    n: Counts = 2, size: ArrayLike = 1.0, kind: str = "HEXA8", *, corner: ArrayLike = 0.0, distortion: float = 0.0,
    seed: int = 0,
) -> Mesh:  # fmt: skip
    """A box in space; arguments as those of `rectangle`. A hexahedron of the grid is divided into 6 tetrahedra (Kuhn),
    2 prisms, 6 pyramids around its centre, or 3 from a corner where these turn triangles up.

    >>> box((2, 2, 1), kind="PENTA15").cells_by_type
    {'PENTA15': 8, 'QUAD8': 8, 'TRIA6': 16}
    """
    return box_of(kind, 3, n, size, corner, distortion, seed, _SIDES[1])


def ring(
    n: Counts = (2, 16), radii: tuple[float, float] = (1.0, 2.0), kind: str = "QUAD4", *, angle: float = 360.0,
    height: float = 1.0, distortion: float = 0.0, seed: int = 0,
) -> Mesh:  # fmt: skip
    """A ring about the origin from the axis x on by an angle, or in space (by `kind`) a tube about z from z = 0 up.

    `n`: cells along the radius, around, and in space along the height; lines, as in `rectangle`, are radii, angles
    from 0, and heights. `radii`: the inner and the outer one.

    >>> sorted(ring((1, 3), (10, 12), "QUAD8", angle=90).cell_groups)
    ['body', 'end', 'inner', 'outer', 'start']
    """
    dim = dim_of(kind, (2, 3) if isinstance(n, int) or len(n) == 2 else (3, 2))
    if not (0 < radii[0] < radii[1] and 0 < angle <= 360):
        raise RequestError(
            f"a ring has 0 < inner < outer radius and an angle up to 360, not {tuple(radii)} and {angle}"
        )
    whole = np.isclose(angle, 360)
    sides = (_RING[0], (SEAM, SEAM) if whole else _RING[1], _RING[2])[:dim]
    size, corner = (radii[1] - radii[0], angle, height)[:dim], (radii[0], 0.0, 0.0)[:dim]
    flat = box_of(kind, dim, n, size, corner, distortion, seed, sides)
    x = flat.points
    mesh = replace(flat, points=np.column_stack([_polar(x[:, 0], x[:, 1]), x[:, 2]]))
    return check_seams(sew(mesh, SEAM), kind, "ring")


def disc(
    n: int | tuple[int, int] = 3, radius: float = 1.0, kind: str = "QUAD4", *, angle: int = 360,
    distortion: float = 0.0, seed: int = 0,
) -> Mesh:  # fmt: skip
    """A disc about the origin, or a half (`angle` 180, y > 0) or a quarter (90) of it, without a hole.

    `n`: cells along the radius of the square in its middle, and of the shell around it; an arc of 90 degrees has twice
    as many as the first.

    >>> disc(2, kind="QUAD8", angle=90).cells_by_type
    {'QUAD8': 12, 'SEG3': 12}
    """
    return _disc(n, radius, kind, angle, 2, 1, 0.0, distortion, seed)


def cylinder(
    n: int | tuple[int, int, int] = 3, radius: float = 1.0, height: float = 1.0, kind: str = "HEXA8", *,
    angle: int = 360, distortion: float = 0.0, seed: int = 0,
) -> Mesh:  # fmt: skip
    """A cylinder about the axis z from z = 0 up, without a bore; a half or a quarter of it as of a `disc`.

    `n`: cells as for a disc, and along the height.

    >>> cylinder((2, 1, 4), 5.0, 20.0, angle=90).cells_by_type
    {'HEXA8': 32, 'QUAD4': 56}
    """
    core, shell, up = _numbers(n, 3)
    return _disc((core, shell), radius, kind, angle, 3, up, height, distortion, seed)


def sphere(
    n: int | tuple[int, int] = 3, radius: float = 1.0, kind: str = "HEXA8", *, inner: float = 0.0,
    distortion: float = 0.0, seed: int = 0,
) -> Mesh:  # fmt: skip
    """The octant x, y, z > 0 of a sphere about the origin; with an `inner` radius it is hollow.

    `n`: cells along the sides of its three parts, of which two divide each arc of 90 degrees, and along the radius
    around the cube in its middle.

    >>> sphere(2, 10.0, "TETRA10", inner=8.0).cells_by_type
    {'TETRA10': 144, 'TRIA6': 96}
    """
    core, shell = _numbers(n, 2)
    dim_of(kind, (3,))
    if not 0 <= inner < radius:
        raise RequestError(f"a sphere has 0 <= inner < radius, not {inner} and {radius}")
    parts = []
    random = np.random.Generator(np.random.PCG64(seed))
    planes = ("left", "front", "bottom")
    for turn in range(3):
        own = planes[(1 + turn) % 3], planes[(2 + turn) % 3]
        sides = ((own[0], SEAM), (own[1], SEAM), ("inner" if inner else SEAM, "outer"))
        mesh = box_of(kind, 3, (core, core, shell), 1.0, 0.0, distortion, random, sides)
        u, v, w = mesh.points.T[..., None]
        way = np.hstack([np.ones_like(u), np.tan(np.pi / 4 * u), np.tan(np.pi / 4 * v)])
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        low = inner * way if inner else radius * _within(np.hstack([np.ones_like(u), u, v]))
        parts.append(replace(mesh, points=np.roll((1 - w) * low + w * radius * way, turn, axis=1)))
    if not inner:
        mesh = box_of(kind, 3, core, 1.0, 0.0, distortion, random, tuple((plane, SEAM) for plane in planes))
        parts.append(replace(mesh, points=radius * _within(mesh.points)))
    return check_seams(sew(join(*parts), SEAM), kind, "sphere")


def grid(*points: ArrayLike, kind: str = "") -> Mesh:
    """A body of one or several grids of corner points (a, b, 2) or (a, b, c, 3), whose axes are right-handed.

    Points of the outsides of grids at the same place become one node. `kind`: QUAD4 or HEXA8 by default; quadratic
    cells are straight. The whole outside is the group `skin`; `Mesh.with_groups` makes groups of its parts.

    >>> x, y = np.meshgrid([0.0, 1.0, 2.0], [0.0, 1.0], indexing="ij")
    >>> grid(np.stack([x, y + 0.1 * x**2], axis=-1)).cells_by_type
    {'QUAD4': 2, 'SEG2': 6}
    """
    arrays = [np.asarray(one, float) for one in points]
    dims = {one.ndim - 1 for one in arrays if one.ndim - 1 == one.shape[-1]}
    if len(dims) != 1 or dims > {2, 3} or any(one.ndim != arrays[0].ndim or min(one.shape) < 2 for one in arrays):
        raise RequestError("a grid is an array of points (a, b, 2) or (a, b, c, 3), two or more along each axis")
    (dim,) = dims
    kind = kind or ("QUAD4", "HEXA8")[dim - 2]
    dim_of(kind, (dim,))
    return sew(join(*(raised(linear(one, kind, ((_SKIN, _SKIN),) * dim), kind) for one in arrays)), _SKIN)


def stack(lower: Mesh, upper: Mesh, *, gap: float = 0.0, slave: str = "upper") -> Mesh:
    """Put a mesh upon another: the `bottom` of the upper is moved along the last axis to the `top` of the lower.

    `gap`: how far apart the highest node of the one and the lowest node of the other are. These two groups become
    `slave` and `master`; `slave` says which body has the slave, "upper" or "lower". The bodies become `lower` and
    `upper`; other groups of the same name are united.

    >>> mesh = stack(rectangle(2), rectangle(3), gap=0.1)
    >>> list(mesh.cell_groups)
    ['lower', 'left', 'right', 'bottom', 'master', 'upper', 'slave', 'top']
    """
    if slave not in ("lower", "upper"):
        raise RequestError(f"the slave is on the lower or on the upper mesh, not on {slave!r}")
    if lower.space_dim != upper.space_dim:
        raise RequestError("of two meshes, one of the plane and one of space, neither can stand on the other")
    axis = lower.space_dim - 1
    top, bottom = (m.points[m.nodes_on(m.cells_of(name)), axis] for m, name in ((lower, "top"), (upper, "bottom")))
    shift = np.eye(3)[axis] * (top.max() + gap - bottom.min())
    roles = ("slave", "master") if slave == "lower" else ("master", "slave")
    bodies = (
        {"body": name} if "body" in mesh.cell_groups else {} for mesh, name in ((lower, "lower"), (upper, "upper"))
    )
    low, high = bodies
    return join(lower.renamed(top=roles[0], **low), upper.moved(shift).renamed(bottom=roles[1], **high))


def _disc(
    n: int | tuple[int, int], radius: float, kind: str, angle: int, dim: int, up: int, height: float, distortion: float,
    seed: int,
) -> Mesh:  # fmt: skip
    """A disc, or in space a cylinder: in each quarter a square with a curved shell on two of its sides."""
    dim_of(kind, (dim,))
    if angle not in (90, 180, 360):
        raise RequestError(f"a disc or cylinder has an angle of 90, 180 or 360 degrees, not {angle}")
    if not radius > 0 or (dim == 3 and not height > 0):
        raise RequestError("a disc or cylinder has a radius and a height above 0")
    core, shell = _numbers(n, 2)
    more = ((up,), (height,), (_RING[2],)) if dim == 3 else ((), (), ())
    random = np.random.Generator(np.random.PCG64(seed))
    parts: list[Mesh] = []
    for k in range(angle // 90):
        start = "start" if angle < 360 and k == 0 else SEAM
        end = "end" if angle < 360 and k == angle // 90 - 1 else SEAM
        for counts, sides in (
            ((core, core), ((end, SEAM), (start, SEAM))),
            ((shell, core), ((SEAM, "outer"), (start, SEAM))),
            ((core, shell), ((end, SEAM), (SEAM, "outer"))),
        ):
            first = len(parts) % 3
            mesh = box_of(
                kind, dim, (*counts, *more[0]), (1.0, 1.0, *more[1]), 0.0, distortion, random, (*sides, *more[2])
            )
            u, v, z = mesh.points.T
            plane = (
                _within(np.stack([u, v], axis=1))
                if first == 0
                else _shell(u, v)
                if first == 1
                else _shell(v, u)[:, ::-1]
            )
            plane = radius * plane @ _quarters(np.array([k]))[0].T
            parts.append(replace(mesh, points=np.column_stack([plane, z])))
    return check_seams(sew(join(*parts), SEAM), kind, "disc" if dim == 2 else "cylinder")


def _numbers(n: int | Sequence[int], count: int) -> Sequence[int]:
    """So many numbers of cells, of one for all or of a sequence. Raises RequestError."""
    numbers = (n,) * count if isinstance(n, int) else tuple(n)
    if len(numbers) != count:
        raise RequestError(f"n is a number of cells, or {count} of them, not {n}")
    return numbers


def _within(x: Floats) -> Floats:
    """Points of the square or cube [0, 1]^d, put in the middle of a disc or sphere of radius 1: linear in each x."""
    d = x.shape[1]
    corner = np.array([0.0, _ALONG, _MIDDLE, _DIAGONAL])
    out = np.zeros(x.shape)
    for place in np.ndindex(*(2,) * d):
        share = np.prod(np.where(np.array(place) == 1, x, 1 - x), axis=1)
        out += share[:, None] * np.array(place) * corner[sum(place)]
    return out


def _shell(out: Floats, around: Floats) -> Floats:
    """Points from the square in the middle of a disc of radius 1 to its circle, between 0 and 45 degrees."""
    rim = _within(np.stack([np.ones_like(around), around], axis=1))
    return (1 - out)[:, None] * rim + out[:, None] * _polar(np.ones_like(around), 45 * around)


def _polar(r: Floats, degrees: Floats) -> Floats:
    """(n, 2): points by radius and angle; those at multiples of 90 degrees are on the axes."""
    quarters = np.floor(degrees / 90)
    t = np.pi / 2 * (degrees / 90 - quarters)
    return np.einsum("nij,nj->ni", _quarters(quarters), r[:, None] * np.column_stack([np.cos(t), np.sin(t)])) + 0.0


def _quarters(k: NDArray[np.generic]) -> Floats:
    """(n, 2, 2): rotations by so many right angles."""
    c, s = (np.array(row, float)[np.asarray(k, int) % 4] for row in ((1, 0, -1, 0), (0, 1, 0, -1)))
    return np.moveaxis(np.array([[c, -s], [s, c]]), -1, 0)
