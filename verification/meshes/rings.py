"""Quarters of thick rings and octants of thick spheres, one around another, that do not match where they meet.

A ring is a structured block in radius and angle, whose nodes, those between corners too, are then put where these say:
quadratic cells lie on their circles, the nodes of linear ones do. An octant is made of three such blocks, one to each
face of a cube that is blown up to a sphere.

Groups of a pair: `within`, `around` (the bodies), `inner` (the pressed face), `slave`, `master`, and x0, y0(, z0), the
planes of symmetry.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import SPLITS, assembled
from verification import grids
from verification.meshes.blocks import LEFT, bent, block, boxed, joined, polar, rows_of

Floats = NDArray[np.floating]
Ints = NDArray[np.integer]
#: sides of a block of an octant: two angles, then radius
_FACES = {"z0": "low", "z1": "high"}


def ring(kind: str, counts: Sequence[int], radii: Sequence[float], *, jitter: float = 0.0, seed: int = 0) -> Mesh:
    """A quarter of a ring of cells of a plane type, `counts` of quadrangles: along the radius and around.

    `jitter`: how far corners are moved at random, in cells; those on a side stay on it. Groups: low, high (the faces),
    x0, y0.
    """
    flat = _patch(kind, counts, (radii[0], 0.0), (radii[1], np.pi / 2), jitter=jitter, seed=seed)
    return bent(joined([(flat, {"x0": "low", "x1": "high", "y1": "x0"})], keep=True), _around)


def _around(x: Floats) -> Floats:
    """Points (n, 3) at a radius, an angle and a height; those in the planes x = 0 and y = 0 are there exactly."""
    points = polar(x)
    points[np.abs(points) < 1e-12 * x[:, :1].max()] = 0.0
    return points


def octant(kind: str, counts: Sequence[int], radii: Sequence[float], *, jitter: float = 0.0, seed: int = 0) -> Mesh:
    """An eighth of a thick sphere of cells of a type in space, `counts` of hexahedra: along the radius, and along each
    of the two sides of its three parts. Groups: low, high (the faces), x0, y0, z0.

    `jitter`: how far the rays that nodes lie on are turned at random, in cells; a plane of symmetry keeps its own.
    """
    radial, n = counts
    mesh = _patch(kind, (n, n, radial), (0.0, 0.0, radii[0]), (np.pi / 4, np.pi / 4, radii[1]))
    a, b, r = mesh.points.T
    way = np.column_stack([np.ones_like(a), np.tan(a), np.tan(b)])
    points = way * (r / np.linalg.norm(way, axis=1))[:, None]
    rows = rows_of(mesh)
    parts = [(np.roll(points, turn, axis=1), turn) for turn in range(3)]
    place, number = _merged(np.concatenate([x for x, _ in parts]))
    if jitter:
        place = _shaken(place, jitter * np.pi / 4 / n, np.random.default_rng(seed))
    merged: dict[tuple[str, str], list[Ints]] = defaultdict(list)
    for (_, turn), own in zip(parts, number.reshape(3, -1), strict=True):
        for (cell, name), nodes in rows.items():
            if name not in ("x1", "y1"):  # the seams
                merged[cell, _turned(name, turn)].append(own[nodes])
    return assembled(place, {key: np.concatenate(nodes) for key, nodes in merged.items()}, 3)


def sleeve(
    kind: str, counts: Sequence[int], radii: Sequence[float], length: float, *, slope: float = 0.0, jitter: float = 0.0,
    seed: int = 0,
) -> Mesh:  # fmt: skip
    """A thick tube about its axis, from its plane of symmetry up to its `length`: a quarter of it in space, its section
    (axisymmetric, the axis is y) in a plane. `counts` along the radius(, around) and along the axis.

    `slope`: growth of each radius along the axis, over the radius at its start: faces are cones, in space. `jitter` as
    in `ring`. Groups: low, high (the faces), middle (the plane of symmetry), and x0, y0 in space.
    """
    if CELLS[kind].dim == 2:
        flat = _patch(kind, counts, (radii[0], 0.0), (radii[1], length), jitter=jitter, seed=seed)
        return joined([(flat, {"x0": "low", "x1": "high", "y0": "middle"})], keep=True)
    flat = _patch(kind, counts, (radii[0], 0.0, 0.0), (radii[1], np.pi / 2, length), jitter=jitter, seed=seed)
    names = {"x0": "low", "x1": "high", "y1": "x0", "z0": "middle"}
    mesh = joined([(flat, names)], keep=True)
    return bent(mesh, lambda x: _around(x * np.stack([1 + slope * x[:, 2], *np.ones((2, len(x)))], axis=1)))


def pair(within: Mesh, around: Mesh, *, slave: str = "within") -> Mesh:
    """Two rings or octants, one around the other. `slave`: the body whose face is the slave."""
    outer, inner = ("slave", "master") if slave == "within" else ("master", "slave")
    names = ({"": "within", "low": "inner", "high": outer}, {"": "around", "low": inner, "high": "outer"})
    return joined([(within, names[0]), (around, names[1])], keep=True)


def _patch(
    kind: str, counts: Sequence[int], low: Sequence[float], high: Sequence[float], *, jitter: float = 0.0, seed: int = 0
) -> Mesh:
    """A box of cells of a type, its corners moved; with `jitter` triangles are split along either diagonal."""
    if not jitter:
        return block(kind, counts, low, high)
    random = np.random.default_rng(seed)
    points = grids.box(*(a + np.arange(n + 1) / n * (b - a) for n, a, b in zip(counts, low, high, strict=True)))
    points = points + _moves(points, counts, low, high, random) * jitter
    patterns = [SPLITS["TRIA3"], LEFT] if CELLS[kind].linear == "TRIA3" else [SPLITS[CELLS[kind].linear]]
    return boxed(kind, points, (patterns, random.integers(len(patterns), size=np.prod(counts))))


def _moves(
    points: Floats, counts: Sequence[int], low: Sequence[float], high: Sequence[float], random: np.random.Generator
) -> Floats:
    """Random displacements (a, .., dim) of points, between -1 and 1 cell; 0 across the sides on which points lie."""
    inside = (points != low) & (points != high)
    return random.uniform(-1, 1, points.shape) * np.subtract(high, low) / counts * inside


def _shaken(points: Floats, angle: float, random: np.random.Generator) -> Floats:
    """Turn the rays from 0 to points by random angles about each axis; zero coordinates stay zero."""
    r = np.linalg.norm(points, axis=1, keepdims=True)
    rays, number = _merged(points / r)
    rays = rays + angle * random.uniform(-1, 1, rays.shape) * (np.abs(rays) > 1e-12)
    return (rays / np.linalg.norm(rays, axis=1, keepdims=True))[number] * r


def _turned(name: str, turn: int) -> str:
    """The side of a block of an octant as a side of the octant, axes turned so many times x to y to z."""
    if name in ("x0", "y0"):
        return f"{'xyz'[(1 + 'xy'.index(name[0]) + turn) % 3]}0"
    return _FACES.get(name, name)


def _merged(points: Floats) -> tuple[Floats, Ints]:
    """Merge coincident points: the distinct points, and the index (n,) of each point among them."""
    near = cKDTree(points).query_pairs(1e-9 * np.abs(points).max(), output_type="ndarray")
    graph = coo_array((np.ones(len(near)), near.T), shape=(len(points),) * 2)
    number = connected_components(graph, directed=False)[1]
    return points[np.unique(number, return_index=True)[1]], number
