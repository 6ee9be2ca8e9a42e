"""Meshes of the corpus: small blocks with the groups that its records name."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np

from lacmesh import Mesh, generate
from lacmesh import join as join_meshes
from lacmesh.cells import CELLS
from tests.checks.blocks import block as linear_block
from tests.checks.blocks import join, skin
from tests.lacsolver.patch_meshes import block, joined, placed, stack, three_blocks
from tests.lacsolver.sectors import sector


def nodes_of(mesh, group):
    """The nodes of a group of cells."""
    return np.unique(np.concatenate([nodes.ravel() for _, _, nodes in mesh.select(mesh.cells_of(group))]))


@cache
def cube():
    """[0, 1]^3 in eight cells, `left` and `right` of x = 1/2. Node groups have the names of cell groups.

    Nodes `z1`: (0, 0, 1) and (0, 1/2, 1); `z0`: all of the side z = 1; `y1`: the corner (1, 1, 1).
    """
    mesh = block("HEXA8", 3, 2, "z1", even=True)
    x = mesh.points
    body = mesh.cell_groups["body"]
    centre = np.array([x[nodes].mean(axis=0) for nodes in mesh.block("HEXA8")])
    top = np.flatnonzero(x[:, 2] == 1)
    return Mesh.create(
        x,
        mesh.blocks,
        cell_groups={**mesh.cell_groups, "left": body[centre[:, 0] < 0.5], "right": body[centre[:, 0] > 0.5]},
        node_groups={"z1": top[[0, 1]], "z0": top, "y1": np.flatnonzero((x == 1).all(axis=1))},
    )


@cache
def bolted():
    """Two columns of base 1 and height 3, with the sections `shank` and `second` at z = 1."""
    parts = []
    for x, name in ((0, "shank"), (2, "second")):
        points, cells = linear_block((2, 2, 3), (x, 0, 0), (x + 1, 1, 3))
        section = skin(points, cells, lambda p: np.abs(p[..., 2] - 1) < 1e-9)["QUAD4"]
        section = section[np.unique(np.sort(section, axis=1), axis=0, return_index=True)[1]]
        ends = {
            end: skin(points, cells, lambda p, z=z: np.abs(p[..., 2] - z) < 1e-9) for end, z in (("z0", 0), ("z1", 3))
        }
        parts.append((points, cells, {**ends, name: {"QUAD4": section}}))
    return join(parts)


@cache
def towers():
    """Two blocks apart, one over the other, their sides `low` (z = 1) and `high` (z = 2).

    Nodes `master`: those of `high`, the cells of that name those of `low`.
    """
    mesh = stack("HEXA8", "TETRA4", 3, counts=(2, 2), gap=1.0, even=True)
    groups = dict(mesh.cell_groups)
    groups["low"], groups["high"] = groups["slave"], groups.pop("master")
    groups["master"] = groups.pop("slave")
    return Mesh.create(mesh.points, mesh.blocks, cell_groups=groups, node_groups={"master": nodes_of(mesh, "master")})


@cache
def overhang(gap=0.0):
    """A plane slave on four cells a side, x in [0, 1], below a master on x in [0, 5/8]."""
    mesh = stack("QUAD4", "TRIA3", 2, counts=(4, 3), even=True, gap=gap)
    x = mesh.points.copy()
    nodes = nodes_of(mesh, "upper")
    x[nodes, 0] *= 0.625
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=2)


@cache
def plane(slave="QUAD8", master="TRIA3"):
    """Two blocks on one another in a plane."""
    return stack(slave, master, 2, counts=(3, 2))


@cache
def solid(slave, master):
    """Two blocks on one another in space, distorted."""
    return stack(slave, master, 3, counts=(2, 1), skew=0.05)


@cache
def gapped():
    """Two blocks, one above the other with a gap of 0.01."""
    return stack("QUAD8", "TRIA3", 2, counts=(3, 2), gap=0.01)


@cache
def roof():
    """A slave of two faces that slope to both sides of x = 1/2, by 1/4; the master above is flat and twice as wide."""
    mesh = stack("QUAD4", "QUAD4", 2, counts=(2, 1), even=True, gap=0.5)
    x = mesh.points.copy()
    low, high = nodes_of(mesh, "lower"), nodes_of(mesh, "upper")
    x[low, 1] *= 1 - 0.25 * np.abs(x[low, 0] - 0.5)
    x[high, 0] += x[high, 0] - 0.5
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=2)


@cache
def wedge():
    """A sixth of a ring about an axis along x through y = 1, whose sides `a` and `b` do not match."""
    mesh = sector("HEXA8", (4, 1, 3), 6, skew=0.2)
    x = mesh.points[:, [2, 0, 1]] + [0, 1, 0]
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups)


@cache
def punch():
    """A master whose underside is a parabola, on a flat slave."""
    mesh = stack("QUAD4", "QUAD4", 2, counts=(6, 5), even=True)
    x = mesh.points.copy()
    nodes = nodes_of(mesh, "upper")
    x[nodes, 1] += 0.1 * (x[nodes, 0] - 0.5) ** 2 * (2 - x[nodes, 1])
    return Mesh.create(x, mesh.blocks, cell_groups=mesh.cell_groups, space_dim=2)


@cache
def apart():
    """Two cubes over one another, a cell each, a tenth apart."""
    return stack("HEXA8", "HEXA8", 3, counts=(1, 1), gap=0.1, even=True)


@cache
def linked():
    """The cubes of `apart`, with the nodes `eye` at (0, 0, 1) and `hook` at (1, 1, 1.1)."""
    mesh = apart()
    nodes = {"eye": [0.0, 0.0, 1.0], "hook": [1.0, 1.0, 1.1]}
    places = {name: np.flatnonzero(np.abs(mesh.points - x).max(axis=1) < 1e-9) for name, x in nodes.items()}
    return Mesh.create(mesh.points, mesh.blocks, cell_groups=mesh.cell_groups, node_groups=places)


@cache
def pair():
    """Two squares on one another, with `slave` and `master`."""
    return stack("QUAD4", "QUAD4", 2, counts=(3, 2), gap=0.1, even=True)


@cache
def tower(height):
    """Three blocks on one another, all of hexahedra; tall ones are cut best into hexahedra."""
    return placed(three_blocks(("HEXA8", "HEXA8", "HEXA8")), size=(1, 1, height))


# ---- blocks whose surfaces wave, and a bolted joint


def waved(mesh, size=0.05):
    """Blocks whose surfaces wave, the upper one crowned so that it stands off the lower at the rim."""
    x, up = mesh.points.copy(), mesh.space_dim - 1
    upper = nodes_of(mesh, "upper")
    x[:, up] += size * np.sin(2.1 * x[:, :up].sum(axis=1) + 0.4)
    crown = {1: 0.1, 2: 0.04}[up]
    x[upper, up] += crown * ((x[upper, :up] - x[upper, :up].mean(axis=0)) ** 2).sum(axis=1)
    inner = np.setdiff1d(upper, nodes_of(mesh, "top")) if "top" in mesh.cell_groups else upper
    return replace(mesh, points=x, node_groups={"inner": inner})


@cache
def _waving(slave, master, counts, shift):
    return waved(stack(slave, master, CELLS[slave].dim, counts=counts, skew=0.1, shift=shift))


def waving(slave, master, counts=(4, 3), shift=(0, 0, 0)):
    """A maker of two blocks whose surfaces wave; nodes `inner`: those of the upper one that are not on its top."""
    return partial(_waving, slave, master, counts, shift)


@cache
def two_stacks(kinds=(("QUAD4", "TRIA3"), ("TRIA6", "QUAD4")), apart=(1.5, 0.1, 0.0)):
    """Two stacks beside each other: slave0 on master0, slave1 on master1."""
    parts = []
    for k, (low, high) in enumerate(kinds):
        mesh = waved(stack(low, high, 2, number=k, counts=(4, 2), skew=0.1))
        parts.append((mesh, k * np.asarray(apart), {name: name for name in mesh.cell_groups}))
    return joined(parts)


@cache
def joint(kind="HEXA8", n=2, m=2, halves=False):
    """A bolt on 0 < x < 1, and beside it a foot and a lid on 2 < x < 3 that touch; all are 2 high.

    `m`: cells of the lid to a side; `halves`: the bolt is of two bodies whose meshes differ.
    """
    dim = CELLS[kind.split()[0]].dim
    up = dim - 1

    def column(x, low, high, n, tall):
        size, corner = (*(1,) * up, high - low), (x, *(0,) * (dim - 2), low)
        make = generate.rectangle if dim == 2 else generate.box
        return make((*(n,) * up, tall), size, kind, corner=corner).only("body", "bottom", "top")

    parts = [column(2, 0, 1, n, 2).renamed(bottom="foot", top="slave", body="body0")]
    parts += [column(2, 1, 2, m, 2).renamed(bottom="master", top="head", body="body1")]
    if halves:
        parts += [column(0, 0, 1, n, 2).renamed(bottom="foot", top="shank_a", body="body2")]
        parts += [column(0, 1, 2, n + 1, 2).renamed(bottom="shank_b", top="head", body="body3")]
    else:
        bolt = column(0, 0, 2, n, 4).with_groups("inner", shank=lambda x: np.abs(x[up] - 1) < 1e-9)
        parts += [bolt.renamed(bottom="foot", top="head", body="body2")]
    return join_meshes(*parts)
