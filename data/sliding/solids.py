"""Parts of the meshes in this folder: bodies of QUAD4 or HEXA8 from grids, outward skins, and one msh file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

import lacmesh
from lacmesh.cells import CELLS

#: points nearer than this part of the body's size are one
NEAR = 1e-9


class Body(NamedTuple):
    """Points (n, d) and cells (c, 4 or 8), which are rows of `points`: QUAD4 turning left, or HEXA8."""

    points: np.ndarray
    cells: np.ndarray


class Skin(NamedTuple):
    """A bare skin: points (n, d) and its faces (f, 2 or 4)."""

    points: np.ndarray
    faces: np.ndarray


def brick(*axes: np.ndarray) -> Body:
    """A grid of points with these coordinates along x, y and, in space, z."""
    return body(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))


def body(*grids: np.ndarray) -> Body:
    """A body of grids of points (a, b, 2) or (a, b, c, 3), whose axes are right-handed; coincident points are one."""
    d = grids[0].shape[-1]
    points = np.concatenate([grid.reshape(-1, d) for grid in grids])
    first = np.cumsum([0, *(grid[..., 0].size for grid in grids)])
    nodes = [k + np.arange(grid[..., 0].size).reshape(grid.shape[:-1]) for k, grid in zip(first, grids, strict=False)]
    cells = np.concatenate([quadrangles(node) if d == 2 else hexahedra(node) for node in nodes])
    place = np.round(points / (NEAR * np.ptp(points, axis=0).max())) + 0.0
    kept, of = np.unique(place, axis=0, return_index=True, return_inverse=True)[1:]
    return Body(points[kept], of.ravel()[cells])


def quadrangles(node: np.ndarray) -> np.ndarray:
    """(n, 4): the quadrangles of a grid of nodes, turning from its first axis to its second."""
    corners = node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]
    return np.stack([c.ravel() for c in corners], axis=1)


def hexahedra(node: np.ndarray) -> np.ndarray:
    """(n, 8): the hexahedra of a grid of nodes with right-handed axes."""
    floors = [quadrangles(node[:, :, k]) for k in range(node.shape[2])]
    return np.concatenate([np.hstack(pair) for pair in pairwise(floors)])


def half_disc(radius: float, n: int, rows: int, core: float = 0.55) -> Body:
    """The half x >= 0 of a disc: 4 n segments on its arc, and `rows` of cells around a rounded core of n by 2 n."""
    u = np.linspace(-1.0, 1.0, 2 * n + 1)
    arc = np.stack([np.cos(np.pi / 4 * u), np.sin(np.pi / 4 * u)], axis=-1)  # a quarter, about the x axis
    rim = core * (arc + np.stack([np.full_like(u, np.sqrt(0.5)), np.sqrt(0.5) * u], axis=-1)) / 2
    w = np.linspace(0.0, 1.0, rows + 1)[:, None, None]
    shell = (1 - w) * rim + w * arc
    low, high = quarter_turns(rim[n:], -1), quarter_turns(rim[: n + 1], 1)[::-1]
    around = shell, quarter_turns(shell[:, n:], -1), quarter_turns(shell[:, : n + 1], 1)
    return body(*(radius * grid for grid in (filled(low, high, rim), *around)))


def quarter_turns(points: np.ndarray, times: int) -> np.ndarray:
    """Points (.., 2) turned to the left by so many right angles."""
    c, s = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])[times % 4]
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def filled(low: np.ndarray, high: np.ndarray, right: np.ndarray) -> np.ndarray:
    """(a, b, 2): Coons' grid between two lines (a, 2), a third on their right (b, 2) and the straight one on x = 0."""
    s, t = (np.linspace(0.0, 1.0, len(line)) for line in (low, right))
    s, t = s[:, None, None], t[None, :, None]
    left = (1 - t) * low[0] + t * high[0]
    corners = (1 - s) * left + s * ((1 - t) * low[-1] + t * high[-1])
    return (1 - s) * left + s * right + (1 - t) * low[:, None] + t * high[:, None] - corners


def skin(of: Body, where: Callable[..., np.ndarray]) -> np.ndarray:
    """(f, 2 or 4): the outer faces, turned outward, for all of whose nodes where(x, y[, z]) is true."""
    kind = CELLS["QUAD4" if of.points.shape[1] == 2 else "HEXA8"]
    faces = np.concatenate([of.cells[:, facet.nodes] for facet in kind.facets])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    outer = faces[np.sort(first[count == 1])]
    return outer[where(*of.points.T)[outer].all(axis=1)]


def write(
    path: Path,
    bodies: Mapping[str, Body],
    skins: Mapping[str, tuple[str, np.ndarray]],
    layers: Mapping[str, tuple[str, np.ndarray]] | None = None,
    bare: Mapping[str, Skin] | None = None,
    at: Mapping[str, tuple[str, Sequence[float]]] | None = None,
) -> None:
    """Write bodies by name, groups (body, faces (f, k)) of their skins and (body, rows) of their cells, bare skins.

    `at`: groups of the one node of a body that is nearest to a place.

    msh 4.1, ASCII so that one can read it.
    """
    parts = {**bodies, **(bare or {})}
    first = dict(zip(parts, np.cumsum([0, *(len(part.points) for part in parts.values())]), strict=False))
    faces = {name: rows + first[of] for name, (of, rows) in skins.items()}
    faces |= {name: part.faces + first[name] for name, part in (bare or {}).items()}
    groups, n = {}, 0
    for name, rows in faces.items():
        groups[name] = np.arange(n, n + len(rows))
        n += len(rows)
    start = {}
    for name, part in bodies.items():
        start[name] = n
        groups[name] = np.arange(n, n + len(part.cells))
        n += len(part.cells)
    groups |= {name: start[of] + rows for name, (of, rows) in (layers or {}).items()}
    kinds = ("SEG2", "QUAD4") if all(part.points.shape[1] == 2 for part in bodies.values()) else ("QUAD4", "HEXA8")
    cells = np.concatenate([part.cells + first[name] for name, part in bodies.items()])
    blocks = [(kinds[0], np.concatenate([*faces.values()])), (kinds[1], cells)]
    nodes = {
        name: [first[of] + np.linalg.norm(bodies[of].points - place, axis=1).argmin()]
        for name, (of, place) in (at or {}).items()
    }
    points = np.concatenate([part.points for part in parts.values()]) + 0.0
    mesh = lacmesh.Mesh.create(points, blocks, cell_groups=groups, node_groups=nodes)
    lacmesh.write(path, mesh, binary=False)
