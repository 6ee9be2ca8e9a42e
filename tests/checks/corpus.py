"""The corpus of broken meshes: how one is entered, and the tools that break a healthy one.

The meshes are in `corpus_cells`, `corpus_skins` and `corpus_contact`, which enter them when imported.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lacmesh import Mesh
from lacmesh.cutting.cut import CELL_RECORDS, NODE_RECORD
from lacmesh.topology.winding import REVERSED

#: name -> function that makes the mesh; filled by `defect`
CORPUS: dict[str, Case] = {}


@dataclass(frozen=True)
class Case:
    """A broken mesh: how it is made, the rule that names its defect, and how `check` is asked."""

    make: Any
    rule: str
    #: other errors that the same defect is bound to cause
    also: tuple[str, ...] = ()
    asked: dict[str, Any] = field(default_factory=dict)


def defect(rule, name=None, also=(), **asked):
    """Enter a mesh into the corpus."""

    def enter(make):
        key = name or make.__name__
        assert key not in CORPUS
        CORPUS[key] = Case(make, rule, also, {"slave": "slave", "master": "master", **asked})
        return make

    return enter


# ---- tools


def changed(mesh, kind=None, rows=(), nodes=None, points=None, drop=(), add=(), groups=None, **rest):
    """A mesh with some cells' nodes replaced, other points, cells left out, and cells added: (type, nodes, groups).

    Data of the cells follow; those of an added cell are -1.
    """
    points = mesh.points if points is None else np.asarray(points)
    keep = np.setdiff1d(np.arange(mesh.n_cells), drop)
    blocks = {b.type: b.nodes.copy() for b in mesh.blocks}
    if nodes is not None:
        blocks[kind][rows] = nodes
    members = {name: set(np.asarray(g).tolist()) for name, g in mesh.cell_groups.items()} | (groups or {})
    parts, source = [], []
    for k, b in enumerate(mesh.blocks):
        mine = keep[(keep >= mesh.offsets[k]) & (keep < mesh.offsets[k + 1])]
        new = [np.atleast_2d(n) for t, n, _ in add if t == b.type]
        parts.append((b.type, np.concatenate([blocks[b.type][mine - mesh.offsets[k]], *new])))
        source += mine.tolist() + [-1 - i for i, (t, _, _) in enumerate(add) if t == b.type]
    for t in dict.fromkeys(t for t, _, _ in add if t not in blocks):
        parts.append((t, np.concatenate([np.atleast_2d(n) for u, n, _ in add if u == t])))
        source += [-1 - i for i, (u, _, _) in enumerate(add) if u == t]
    names = [*members, *(g for _, _, of in add for g in of if g not in members)]
    inside = lambda name, s: s in members.get(name, ()) if s >= 0 else name in add[-1 - s][2]  # noqa: E731
    cell_groups = {name: [i for i, s in enumerate(source) if inside(name, s)] for name in names}
    data = {name: np.array([v[s] if s >= 0 else -1 for s in source], v.dtype) for name, v in mesh.cell_data.items()}
    node_data = {n: np.concatenate([v, np.full(len(points) - len(v), -1, v.dtype)]) for n, v in mesh.node_data.items()}
    made = Mesh.create(
        points, parts, cell_groups=cell_groups, cell_data=data, node_data=node_data, space_dim=mesh.space_dim, **rest
    )
    return replace(made, zones=mesh.zones)


def at(mesh, *x):
    """The node nearest to a place."""
    return int(np.linalg.norm(mesh.points - np.resize(np.append(x, 0), 3), axis=1).argmin())


def moved(mesh, node, by):
    """A mesh with one node moved."""
    points = mesh.points.copy()
    points[node] += by
    return changed(mesh, points=points)


def of_type(mesh, kind, group):
    """(rows in the block, nodes) of the cells of one type in a group."""
    k = [b.type for b in mesh.blocks].index(kind)
    cells = mesh.cell_groups[group]
    cells = cells[(cells >= mesh.offsets[k]) & (cells < mesh.offsets[k + 1])]
    return cells - mesh.offsets[k], mesh.block(kind)[cells - mesh.offsets[k]]


def reversed_group(mesh, group):
    """A mesh with the faces of a group turned over."""
    blocks = []
    for k, b in enumerate(mesh.blocks):
        nodes = b.nodes.copy()
        cells = mesh.cell_groups[group]
        rows = cells[(cells >= mesh.offsets[k]) & (cells < mesh.offsets[k + 1])] - mesh.offsets[k]
        if len(rows):
            nodes[rows] = nodes[rows][:, REVERSED[b.type]]
        blocks.append(b._replace(nodes=nodes))
    return replace(mesh, blocks=tuple(blocks))


def without_records(mesh):
    """A cut mesh as another program would write it."""
    data = {k: v for k, v in mesh.cell_data.items() if k not in CELL_RECORDS}
    return replace(
        mesh, cell_data=data, node_data={k: v for k, v in mesh.node_data.items() if k != NODE_RECORD}, zones=()
    )


def merged(mesh):
    """Merge the nodes of a mesh that coincide."""
    _, first, inverse = np.unique(mesh.points.round(9), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), np.int64)
    rank[order] = np.arange(len(first))
    new = rank[inverse.ravel()]
    blocks = [(b.type, new[b.nodes]) for b in mesh.blocks]
    return Mesh.create(mesh.points[first[order]], blocks, cell_groups=mesh.cell_groups)
