"""Rings of few faces: thick polygons whose nodes lie on circles, in the plane and along z, of every linear cell."""

from __future__ import annotations

import itertools

import numpy as np

from lacmesh import Mesh
from lacmesh.cells import CELLS

#: hexahedra (x, y, z fastest last) split along one diagonal, the same for all, so that neighbours agree
_KUHN = [[0, *np.cumsum([1 << axis for axis in order]).tolist()] for order in itertools.permutations(range(3))]


def rings(*given, dim):
    """A mesh of several rings, each a dict of arguments of `ring`."""
    points, parts, first = [], [], 0
    for one in given:
        x, own = ring(**one)
        points.append(x)
        parts += [(kind, nodes + first, name) for kind, nodes, name in own]
        first += len(x)
    blocks, groups, done = [], {}, 0
    for kind in dict.fromkeys(kind for kind, _, _ in parts):
        blocks.append((kind, np.concatenate([nodes for other, nodes, _ in parts if other == kind])))
        for other, nodes, name in parts:
            if other == kind:
                groups[name] = np.arange(done, done + len(nodes))
                done += len(nodes)
    return Mesh.create(np.concatenate(points), blocks, cell_groups=groups, space_dim=dim)


def ring(kind, n, radii, heights=(0.0,), turn=0.0, twist=0.0, names=("body", "inner", "outer")):
    """Nodes, and (type, nodes, name) of the body and its two skins, of a ring of n cells around of a linear type.

    Nodes are at `radii`, and in space at `heights`. `turn`: angle of the first node; `twist`: how far each layer of
    nodes is turned further.
    """
    a, r, z = np.meshgrid(np.arange(n), radii, heights, indexing="ij")
    angle = 2 * np.pi * a / n + turn + twist * np.arange(len(heights))
    x = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=-1).reshape(-1, 3)
    number = np.arange(len(x)).reshape(a.shape)
    dim = CELLS[kind].dim
    shells = [(*_faces(number[:, k], dim, kind), name) for k, name in zip((0, -1), names[1:], strict=True)]
    return x, [(kind, split(np.concatenate([number, number[:1]]), kind), names[0]), *shells]


def split(number, kind):
    """Cells of a linear type over a block of nodes (n, rows, layers), or (n, rows, 1) in the plane."""
    dim = CELLS[kind].dim
    n, rows, layers = number.shape[0] - 1, number.shape[1] - 1, number.shape[2] - (dim == 3)
    places = [(i, j, k) for k in range(dim - 1) for j in (0, 1) for i in (0, 1)]
    boxes = [number[i : i + n, j : j + rows, k : k + layers].reshape(-1) for i, j, k in places]
    return _split(np.stack(boxes, axis=1), kind, dim)


def _split(boxes, kind, dim):
    """Cells of one type from boxes with corners numbered in binary, angle first."""
    if dim == 2:
        quads = boxes[:, [0, 2, 3, 1]]
        return quads if kind == "QUAD4" else np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    hexa = boxes[:, [0, 2, 3, 1, 4, 6, 7, 5]]
    if kind == "HEXA8":
        return hexa
    if kind == "PENTA6":
        return np.concatenate([hexa[:, [0, 1, 2, 4, 5, 6]], hexa[:, [0, 2, 3, 4, 6, 7]]])
    return np.concatenate([boxes[:, one] for one in _KUHN])


def _faces(number, dim, kind):
    """Faces of the skin with nodes (n, layers), closed round, as cells of a type have them."""
    if dim == 2:
        nodes = number[:, 0]
        return "SEG2", np.stack([nodes, np.roll(nodes, -1)], axis=1)
    low, high = number[:, :-1], number[:, 1:]
    quads = np.stack([low, np.roll(low, -1, axis=0), np.roll(high, -1, axis=0), high], axis=-1).reshape(-1, 4)
    if kind != "TETRA4":
        return "QUAD4", quads
    return "TRIA3", np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
