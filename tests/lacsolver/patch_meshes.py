"""Blocks that stand on one another, their faces not matching: every type of cell, even, uneven and distorted, tilted.

A block fills [0, 1]^d; the lower of a stack is at height 0 to 1, the upper at 1 to 2. Groups of a stack: `slave` and
`master` between the blocks, `bottom`, `top`, and `x0`, `y0` (`x1`, `y1`) on the sides, over both blocks.
"""

from functools import cache

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS
from lacmesh.generate.parts import raised
from tests.lacsolver.held import with_sides
from verification.meshes import blocks, stacks


def ways(kind):
    """The ways in which the slave faces of a kind may be cut."""
    return ("pyramid", "hexa") if kind in stacks.TWO_WAYS else ("pyramid",)


@cache
def block(kind, dim, n, meets, *, skew=0.0, bulge=0.0, seed=0, even=False):
    """A block of n cells a side and two layers, its skin in groups x0, x1, y0 ...

    `meets` ("z0", "z1"; in 2D "y0", "y1"): the side that faces the other block, whose inner nodes are moved at random
    by up to `skew` of a cell, or all one way by up to `bulge` of the block. Grid lines are uneven unless `even`.
    """
    name, _, face = kind.partition(" ")
    linear = "mixed 1" if name == "mixed" else f"{CELLS[name].linear} {face}".strip()
    mesh = stacks.block(linear, (*(n,) * (dim - 1), stacks.LAYERS))
    rng = np.random.default_rng(seed)
    x = mesh.points.copy()
    if not even:
        for s in range(dim):
            steps = rng.uniform(0.7, 1.3, n)
            x[:, s] = np.interp(
                x[:, s], np.linspace(0, 1, n + 1), np.concatenate([[0], np.cumsum(steps) / steps.sum()])
            )
    up = dim - 1
    plane = x[:, :up]
    inner = (np.abs(x[:, up] - int(meets[1])) < 1e-9) & ((plane > 1e-9) & (plane < 1 - 1e-9)).all(axis=1)
    x[inner, :up] += rng.uniform(-skew, skew, (inner.sum(), up)) / n
    x[:, :up] += bulge * np.prod(4 * plane * (1 - plane), axis=1)[:, None] * np.array([1.0, -0.7])[:up]
    solid = [b for b in mesh.blocks if CELLS[b.type].dim == dim]
    return with_sides(raised(Mesh.create(x, solid, space_dim=dim), kind))


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


def waves(slave, master, dim, *, gap=0.0, size=0.1, counts=(3, 4), margin=0.15, skew=0.1):
    """Two blocks that wave, from x = 1 on; the slave, below, stops short of its master's rim by `margin`."""
    mesh = stack(slave, master, dim, counts=counts, gap=gap, skew=skew)
    x, up = mesh.points.copy(), dim - 1
    low = np.unique(np.concatenate([n.ravel() for _, _, n in mesh.select(mesh.cell_groups["lower"])]))
    x[low, :up] = 0.5 + (1 - 2 * margin) * (x[low, :up] - 0.5)
    x[:, up] += size * np.sin(2.1 * x[:, :up].sum(axis=1))
    x[:, 0] += 1.0
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=dim)


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
    return blocks.joined([(placed(mesh, shift=shift), names) for mesh, shift, names in parts])


def placed(mesh, turn=None, size=1.0, shift=(0, 0, 0)):
    """The mesh scaled (by one number, or one for each axis), turned and shifted."""
    turn = np.eye(3) if turn is None else turn
    points = (np.asarray(size) * mesh.points) @ turn.T + np.asarray(shift)
    return Mesh.create(points, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=mesh.space_dim)
