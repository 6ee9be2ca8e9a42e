"""Cells in space: ideal shapes with the slave face on top, the eye, what hides what, light."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from drawing.patterns import Pattern, in_order
from lacmesh.cells import CELLS
from lacmesh.reference.shapes import shape

Array = NDArray[np.floating]


def ideal(family: str) -> Array:
    """Corners of a cell whose edges are all as long: x to the right, y away, z up."""
    r = 3**0.5
    triangle = np.array([(-1, -1 / r), (1, -1 / r), (0, 2 / r)])
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    if family in ("TRIA", "QUAD"):
        return 1.15 * triangle if family == "TRIA" else square
    if family in ("TETRA", "PYRAM"):
        base, height, size = (triangle, (8 / 3) ** 0.5, 1.4) if family == "TETRA" else (square, 2**0.5, 1.15)
        return size * np.vstack([np.pad(base, ((0, 0), (0, 1))), [(0, 0, height)]])
    base, size = (triangle, 1.1) if family == "PENTA" else (square, 1.0)
    return size * np.vstack([np.pad(base, ((0, 0), (0, 1)), constant_values=z) for z in (-1, 1)])


#: (family, corners of the slave face): turn about the vertical, in degrees, that shows the face and what is under it
_TURN = {
    ("TETRA", 3): 15.0,
    ("HEXA", 4): 0.0,
    ("PENTA", 3): 35.0,
    ("PENTA", 4): -30.0,
    ("PYRAM", 4): 0.0,
    ("PYRAM", 3): -5.0,
}
_VIEW = np.radians([-62.0, 30.0])  # azimuth, elevation of the eye
EYE = np.array([np.cos(_VIEW[1]) * np.cos(_VIEW[0]), np.cos(_VIEW[1]) * np.sin(_VIEW[0]), np.sin(_VIEW[1])])
_RIGHT = np.array([-np.sin(_VIEW[0]), np.cos(_VIEW[0]), 0.0])
_PLANE = np.stack([_RIGHT, np.cross(EYE, _RIGHT)])
_LIGHT = np.array([0.15, -0.55, 0.82]) / np.linalg.norm([0.15, -0.55, 0.82])


@dataclass(frozen=True)
class Body:
    """A pattern in space: nodes `points` (cell's own, on the face, inside) and the children in order."""

    pattern: Pattern
    points: Array
    children: list[tuple[str, NDArray[np.intp]]]

    @property
    def flat(self) -> bool:
        """True for a plane cell."""
        return CELLS[self.pattern.cell].dim == 2

    @property
    def n_own(self) -> int:
        """Number of the cell's own nodes."""
        return CELLS[self.pattern.cell].n_nodes

    @property
    def n_face(self) -> int:
        """Number of new nodes on the face."""
        return len(self.pattern.volume.on_face)


def body(pattern: Pattern) -> Body:
    """The nodes of a pattern in an ideal cell with the slave face on top."""
    cell, template = CELLS[pattern.cell], pattern.volume
    where = np.vstack([np.array(cell.reference), template.on_face, template.inside])
    corners = ideal(cell.family)
    points = shape(cell.linear, where) @ corners
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    return Body(pattern, _upright(pattern, points), in_order(template))


def _upright(pattern: Pattern, points: Array) -> Array:
    """Turned so that the slave facet looks up (in the plane: along y), about the cell's middle."""
    cell = CELLS[pattern.cell]
    facet = points[[n for n in cell.facets[pattern.facet].nodes if n < cell.n_corners]]
    middle = points[: cell.n_corners].mean(axis=0)
    along = facet[1] - facet[0]
    along = along / np.linalg.norm(along)
    if cell.dim == 2:
        x, y = -along, np.array([-along[1], along[0], 0.0])  # the cell lies to the left of its edge
        y = y if (facet.mean(axis=0) - middle) @ y > 0 else -y
        return (points - middle) @ np.array([x, y, np.cross(x, y)]).T
    z = np.cross(facet[1] - facet[0], facet[2] - facet[1])
    z = z / np.linalg.norm(z)
    turn = np.radians(_TURN[cell.family, len(facet)])
    frame = np.array([along, np.cross(z, along), z])
    c, s = np.cos(turn), np.sin(turn)
    return (points - middle) @ frame.T @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T


def project(points: Array, flat: bool) -> Array:
    """(n, 2): points on the page."""
    return points[:, :2] if flat else points @ _PLANE.T


def apart(shape_of: Body) -> Array:
    """(children, 3): how far each child is moved from its place, along the line from the cell's middle to its own."""
    corners = [shape_of.points[n[: CELLS[k].n_corners]].mean(axis=0) for k, n in shape_of.children]
    middle = shape_of.points[: CELLS[shape_of.pattern.cell].n_corners].mean(axis=0)
    spread = np.array([0.45, 0.45, 0.0]) if shape_of.flat else np.array([0.85, 0.85, 1.7])
    return (np.array(corners) - middle) * spread


def faces_of(kind: str) -> list[tuple[int, ...]]:
    """Corners of the faces of a child (a plane cell: its own corners)."""
    cell = CELLS[kind]
    if cell.dim == 2:
        return [tuple(range(cell.n_corners))]
    return [tuple(n for n in f.nodes if n < cell.n_corners) for f in cell.facets]


def back_to_front(solids: list[Array], planes: list[list[tuple[Array, Array]]]) -> list[int]:
    """An order in which convex solids may be painted. `planes`: of each, a point and outward normal of its faces."""
    behind: dict[int, set[int]] = {k: set() for k in range(len(solids))}
    for a, b in combinations(range(len(solids)), 2):
        normal = _separating(solids[a], solids[b], planes[a], planes[b])
        front = normal @ EYE if normal is not None else (solids[b].mean(axis=0) - solids[a].mean(axis=0)) @ EYE
        if abs(front) > 1e-9:
            behind[b if front > 0 else a].add(a if front > 0 else b)
    order: list[int] = []
    while len(order) < len(solids):
        ready = [k for k in behind if k not in order and behind[k] <= set(order)]
        ready = ready or [k for k in behind if k not in order]
        order.append(min(ready, key=lambda k: round(float(solids[k].mean(axis=0) @ EYE), 9)))
    return order


def _separating(a: Array, b: Array, of_a: list[tuple[Array, Array]], of_b: list[tuple[Array, Array]]) -> Array | None:
    """Normal, from a to b, of a face's plane that has the two solids on its two sides."""
    for point, normal in of_a:
        if ((b - point) @ normal > -1e-9).all():
            return normal
    for point, normal in of_b:
        if ((a - point) @ normal > -1e-9).all():
            return -normal
    return None


def plane(x: Array) -> tuple[Array, Array]:
    """A point and the normal of a face, from its corners."""
    normal = np.cross(x[1] - x[0], x[2] - x[1])
    return x[0], normal / np.linalg.norm(normal)


def nodes_of_face(kind: str, corners: tuple[int, ...]) -> tuple[int, ...]:
    """All nodes of a child's face, from its corners."""
    cell = CELLS[kind]
    if cell.dim == 2:
        return tuple(range(cell.n_nodes))
    return next(f.nodes for f in cell.facets if set(f.nodes[: len(corners)]) == set(corners))


def seen_faces(kind: str, x: Array, flat: bool) -> list[tuple[int, ...]]:
    """The faces of a child that are turned to the eye."""
    faces = faces_of(kind)
    return faces if flat else [f for f in faces if plane(x[list(f)])[1] @ EYE > 1e-9]


def shade(colour: str, x: Array, flat: bool) -> str:
    """A colour in the light that falls on a face."""
    rgb = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    bright = 1.0 if flat else 0.80 + 0.30 * max(float(plane(x)[1] @ _LIGHT), 0.0)
    rgb = np.clip(rgb * bright, 0, 1)
    return "#" + "".join(f"{round(255 * c):02x}" for c in rgb)
