"""Blocks that stand on one another, their faces not matching: every type of cell, even, uneven and distorted, tilted.

A block fills [0, 1]^d; the lower of a stack is at height 0 to 1, the upper at 1 to 2. Groups of a stack: `slave` and
`master` between the blocks, `bottom`, `top`, and `x0`, `y0` (`x1`, `y1`) on the sides, over both blocks.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from lacmesh import Mesh, raise_order
from lacmesh.cells import CELLS
from tests.lacsolver.bodies import cube, mixture, plane_mixture, raised, square
from tests.lacsolver.held import with_sides
from tests.meshes import box
from verification.meshes.stacks import LAYERS


@cache
def block(kind, dim, n, meets, *, skew=0.0, bulge=0.0, seed=0, even=False):
    """A block of n cells a side and two layers, its skin in groups x0, x1, y0 ...

    `meets` ("z0", "z1"; in 2D "y0", "y1"): the side that faces the other block, whose inner nodes are moved at random
    by up to `skew` of a cell, or all one way by up to `bulge` of the block. Grid lines are uneven unless `even`.
    """
    mesh = _linear(kind, dim, n)
    rng = np.random.default_rng(seed)
    x = mesh.points.copy()
    if not even:
        for s in range(dim):
            lines = np.unique(np.round(x[:, s], 12)) if kind.startswith("mixed") else np.linspace(0, 1, n + 1)
            steps = rng.uniform(0.7, 1.3, len(lines) - 1)
            x[:, s] = np.interp(x[:, s], lines, np.concatenate([[0], np.cumsum(steps) / steps.sum()]))
    up = dim - 1
    plane = x[:, :up]
    inner = (np.abs(x[:, up] - int(meets[1])) < 1e-9) & ((plane > 1e-9) & (plane < 1 - 1e-9)).all(axis=1)
    x[inner, :up] += rng.uniform(-skew, skew, (inner.sum(), up)) / n
    x[:, :up] += bulge * np.prod(4 * plane * (1 - plane), axis=1)[:, None] * np.array([1.0, -0.7])[:up]
    moved = Mesh.create(x, mesh.blocks, space_dim=dim)
    return with_sides(_raised(moved, kind))


def _linear(kind, dim, n):
    """Linear cells in the unit square or cube, in n x n columns and two layers."""
    name, _, face = kind.partition(" ")
    up = dim - 1
    if name == "mixed":
        mesh = plane_mixture(seed=n) if dim == 2 else mixture(seed=n)
        low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
        return Mesh.create((mesh.points - low) / np.where(high > low, high - low, 1.0), mesh.blocks, space_dim=dim)
    linear = CELLS[name].linear
    if dim == 2:
        mesh = square(linear, n)
        mesh = Mesh.create(mesh.points - [1, 0, 0], mesh.blocks, space_dim=2)
    elif linear == "PYRAM5" and face == "triangle":
        mesh = _pyramids_at_corners(n)
    else:
        mesh = cube(linear, n)
        if linear == "PENTA6" and face == "quadrangle":
            mesh = Mesh.create(mesh.points[:, [2, 0, 1]], mesh.blocks)
    return _lowest(mesh, up, LAYERS / n) if n > LAYERS else mesh


def _pyramids_at_corners(n):
    """Each hexahedron as three pyramids whose apex is its one corner with even numbers: triangles at even heights."""
    points, hexahedra = box(n)
    even = (np.round(points * n).astype(int) % 2 == 0).all(axis=1)[hexahedra].argmax(axis=1)
    cells = []
    for corner in range(8):
        nodes = hexahedra[even == corner]
        bases = [f.nodes[::-1] for f in CELLS["HEXA8"].facets if corner not in f.nodes]
        cells += [np.column_stack([nodes[:, list(base)], nodes[:, corner]]) for base in bases]
    return Mesh.create(points, [("PYRAM5", np.concatenate(cells))])


def _lowest(mesh, axis, height):
    """The cells below a height, as a block of height 1."""
    (cells,) = mesh.blocks
    nodes = cells.nodes[mesh.points[cells.nodes, axis].mean(axis=1) < height]
    used, place = np.unique(nodes, return_inverse=True)
    points = mesh.points[used].copy()
    points[:, axis] /= height
    return Mesh.create(points, [(cells.type, place.reshape(nodes.shape))], space_dim=mesh.space_dim)


def _raised(mesh, kind):
    """Replace linear cells by those of a kind."""
    name, _, order = kind.partition(" ")
    if name == "mixed":
        return mesh if order == "1" else raise_order(mesh, order)
    return raised(mesh, name)


def stack(slave, master, dim, *, slave_below=True, number="", shift=(0, 0, 0), counts=(3, 2), gap=0.0, **moves):
    """Two blocks of kinds `slave` and `master`, the slave with counts[0] cells a side; other arguments: of `block`.

    `number` is added to the names of slave and master; `gap`: how far the upper is above the lower.
    """
    up = "xyz"[dim - 1]
    kinds = [(slave, counts[0], "slave"), (master, counts[1], "master")]
    parts = []
    for k, (kind, n, role) in enumerate(kinds if slave_below else kinds[::-1]):
        meets, outer = (f"{up}1", f"{up}0") if k == 0 else (f"{up}0", f"{up}1")
        own = {name: -value if k and name == "bulge" else value for name, value in moves.items()}
        mesh = block(kind, dim, n, meets, **{"seed": k, **own})
        names = {meets: f"{role}{number}", outer: ("bottom", "top")[k], "body": ("lower", "upper")[k]}
        names |= {f"{a}{e}": f"{a}{e}" for a in "xyz"[: dim - 1] for e in "01"}
        parts.append((mesh, np.eye(3)[dim - 1] * k * (1 + gap) + shift, names))
    return joined(parts)


def three_blocks(kinds=("HEXA8", "TETRA4", "PENTA6 quadrangle")):
    """Three blocks on one another: slave1 on master1, slave2 on master2, each slave the upper."""
    names = {"x0": "x0", "y0": "y0"}
    low, middle, high = (block(kind, 3, n, "z1", seed=n) for kind, n in zip(kinds, (2, 3, 2), strict=True))
    up = np.array([0.0, 0.0, 1.0])
    return joined(
        [
            (low, 0 * up, {**names, "z0": "bottom", "z1": "master1"}),
            (middle, up, {**names, "z0": "slave1", "z1": "master2"}),
            (high, 2 * up, {**names, "z0": "slave2", "z1": "top"}),
        ]
    )


def joined(parts):
    """Join meshes given as (mesh, shift, {name of a group: its name here}); groups of one name are merged."""
    kinds = dict.fromkeys(b.type for mesh, _, _ in parts for b in mesh.blocks)
    start = np.cumsum([0, *(mesh.n_nodes for mesh, _, _ in parts)])
    rows = {kind: [] for kind in kinds}
    for (mesh, _, _), first in zip(parts, start, strict=False):
        for b in mesh.blocks:
            rows[b.type].append(b.nodes + first)
    offset = dict(zip(kinds, np.cumsum([0, *(sum(map(len, rows[kind])) for kind in kinds)]), strict=False))
    groups = {}
    for mesh, _, names in parts:
        place = np.empty(mesh.n_cells, np.int64)
        for k, b in enumerate(mesh.blocks):
            place[mesh.offsets[k] : mesh.offsets[k + 1]] = offset[b.type] + np.arange(len(b.nodes))
            offset[b.type] += len(b.nodes)
        for old, new in names.items():
            groups.setdefault(new, []).append(place[mesh.cell_groups[old]])
    return Mesh.create(
        np.concatenate([mesh.points + shift for mesh, shift, _ in parts]),
        [(kind, np.concatenate(own)) for kind, own in rows.items()],
        cell_groups={name: np.sort(np.concatenate(own)) for name, own in groups.items()},
        space_dim=parts[0][0].space_dim,
    )


def side_by_side(slave, masters, dim, **options):
    """One stack for each master, on squares of side 2 about the origin; the slave is below and above by turns.

    Groups slave0, master0, slave1 ...
    """
    row = len(masters) if dim == 2 else 5
    stacks = [
        stack(slave, master, dim, slave_below=k % 2 == 0, number=k, shift=place, **options)
        for k, (master, place) in enumerate(zip(masters, _places(len(masters), row), strict=True))
    ]
    return joined([(mesh, np.zeros(3), {name: name for name in mesh.cell_groups}) for mesh in stacks])


def _places(count, row):
    """(count, 3): where stacks stand, `row` of them in a row along x."""
    k = np.arange(count)
    return 2.0 * np.column_stack([k % row - row // 2, k // row - count // row // 2, np.zeros(count)])


def own_places(points, dim):
    """(n, 3): places (n, 3) in stacks that are side by side, each from its own corner."""
    return points - 2 * np.floor(points / 2 + 0.25) * [1, dim == 3, 0]


def placed(mesh, turn=None, size=1.0, shift=(0, 0, 0)):
    """The mesh scaled (by one number, or one for each axis), turned and shifted."""
    turn = np.eye(3) if turn is None else turn
    points = (np.asarray(size) * mesh.points) @ turn.T + np.asarray(shift)
    return Mesh.create(points, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=mesh.space_dim)
