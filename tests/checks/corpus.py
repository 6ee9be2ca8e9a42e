"""The corpus of broken meshes: how one is entered, the tools that break a healthy one, and faults of cells.

Faults of the skins and of the contact are in `corpus_skins`, which enters them when it is imported.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import lacmesh
from lacmesh import Mesh, cut_skin
from lacmesh.cells import CELLS
from lacmesh.cutting.cut import CELL_RECORDS, NODE_RECORD
from lacmesh.generate import box
from lacmesh.topology.winding import REVERSED
from tests.checks.blocks import cut_blocks

#: name -> how a broken mesh is made and what is found; filled by `defect`
CORPUS: dict[str, Case] = {}


@dataclass(frozen=True)
class Case:
    """A broken mesh: how it is made, the rule that names its defect, and how `check` is asked."""

    build: Any
    rule: str
    #: cells of the findings of that rule or, if they have none, nodes
    count: int
    #: the other errors and warnings
    also: tuple[str, ...] = ()
    #: type of the two blocks, cut, that are broken; by default there are none
    on: str | None = None
    asked: dict[str, Any] = field(default_factory=dict)

    def make(self):
        return self.build(cut_blocks(self.on)) if self.on else self.build()


def defect(rule, count, *also, on=None, name=None, **asked):
    """Enter a mesh into the corpus, by the name of the function that makes it."""

    def enter(build):
        key = name or build.__name__
        assert key not in CORPUS
        CORPUS[key] = Case(build, rule, count, also, on, {"slave": "slave", "master": "master", **asked})
        return build

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
    """Merge the nodes of a mesh that coincide, to nine digits."""
    _, first, inverse = np.unique(mesh.points.round(9), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), np.int64)
    rank[order] = np.arange(len(first))
    new = rank[inverse.ravel()]
    blocks = [(b.type, new[b.nodes]) for b in mesh.blocks]
    return Mesh.create(mesh.points[first[order]], blocks, cell_groups=mesh.cell_groups)


# ---- numbers and places


@defect("no-cells", 0, slave="line", master=None)
def only_lines():
    return Mesh.create([[0, 0], [1, 0]], [("SEG2", [[0, 1]])], cell_groups={"line": [0]})


@defect("no-cells", 0, slave="none", master=None)
def nothing_at_all():
    return Mesh.create(np.zeros((0, 3)), [], cell_groups={"none": []})


for kind, value in (("HEXA8", np.nan), ("TETRA10", np.inf)):
    defect("not-finite", 1, on=kind, name=f"a coordinate that is {value}")(
        lambda mesh, value=value: moved(mesh, at(mesh, 0.33, 0.33, 1.67), value)
    )


@defect("repeated-number", 1, on="HEXA8")
def two_cells_of_one_number(mesh):
    number = mesh.cell_number.copy()
    number[3] = number[7]
    return replace(mesh, cell_number=number)


@defect("repeated-number", 1, on="HEXA8")
def a_negative_node_number(mesh):
    number = mesh.node_number.copy()
    number[-1] = -4
    return replace(mesh, node_number=number)


@defect("unreferenced-node", 1, on="HEXA8")
def a_node_of_no_cell(mesh):
    return changed(mesh, points=np.vstack([mesh.points, [5.0, 5.0, 5.0]]))


# ---- cells by themselves


@defect("repeated-node", 1, on="HEXA8")
def a_hexahedron_that_lists_a_node_twice(mesh):
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    return changed(mesh, "HEXA8", rows[-1], nodes[-1][[0, 1, 2, 3, 4, 5, 7, 7]])


@defect("repeated-cell", 1, on="HEXA8")
def the_same_hexahedron_twice(mesh):
    return changed(mesh, add=[("HEXA8", of_type(mesh, "HEXA8", "body1")[1][-1], ["body1"])])


@defect("repeated-cell", 1, on="TETRA4")
def a_cell_inside_the_body_listed_again_from_another_corner(mesh):
    return changed(mesh, add=[("TETRA4", of_type(mesh, "TETRA4", "body1")[1][80][[1, 2, 0, 3]], ["body1"])])


@defect("invalid-cell", 6, on="HEXA8")
def a_node_pushed_through_its_cells(mesh):
    return moved(mesh, at(mesh, 1 / 3, 1 / 3, 1 + 2 / 3), [0.5, 0.5, 0.0])


@defect("invalid-cell", 4, on="TETRA10")
def a_mid_node_beyond_the_quarter_of_its_edge(mesh):
    mid = of_type(mesh, "TETRA10", "body1")[1][-1]
    return moved(mesh, mid[4], 0.4 * (mesh.points[mid[1]] - mesh.points[mid[0]]))


@defect("invalid-cell", 1, on="TETRA4")
def a_flat_tetrahedron(mesh):
    corner, n = at(mesh, 1, 1, 2.01), mesh.n_nodes
    more = mesh.points[corner] + 0.3 * np.array([[1, 0, 0], [0, 1, 0], [1, 1, 0]])
    return changed(mesh, points=np.vstack([mesh.points, more]), add=[("TETRA4", [corner, n, n + 1, n + 2], ["body1"])])


#: rule of a cell with its nodes in another order, its type, the order
for rule, kind, row, order in (
    ("inverted-cell", "HEXA8", -1, [4, 5, 6, 7, 0, 1, 2, 3]),
    ("inverted-cell", "TETRA10", 90, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]),
    ("clockwise-cell", "QUAD4", -1, [0, 3, 2, 1]),
):

    @defect(rule, 1, on=kind, name=f"{rule} of {kind}")
    def listed(mesh, kind=kind, row=row, order=order):
        rows, nodes = of_type(mesh, kind, "body1")
        return changed(mesh, kind, rows[row], nodes[row][order])


@defect("poor-cell", 1, on="HEXA8")
def a_cell_almost_flat(mesh):
    return moved(mesh, at(mesh, 1, 1, 2.01), np.full(3, -0.32 / 3))  # at 1/3 the corner is flat


# ---- cells with their neighbours


#: rule of a pyramid on the facet of a hexahedron, outside or inside it
for rule, count, row, side in (("crowded-facet", 3, 0, 1), ("overlapping-cells", 2, -1, -1)):

    @defect(rule, count, on="HEXA8", name=f"{rule} by a pyramid")
    def pyramid(mesh, row=row, side=side):
        _, nodes = of_type(mesh, "HEXA8", "body1")
        base = nodes[row][list(CELLS["HEXA8"].facets[5].nodes)][::side]
        points = np.vstack([mesh.points, mesh.points[base].mean(axis=0) + np.array([0, 0, 0.1 * side])])
        return changed(mesh, points=points, add=[("PYRAM5", [*base, mesh.n_nodes], ["body1"])])


#: type of a cell whose mid-node is its own, its group, its place there, the mid-node, how many cells differ
for kind, cell, group, row, mid, count in (
    ("HEXA20", "HEXA20", "body1", 13, 8, 3),
    ("TETRA10", "TRIA6", "slave", 0, 3, 1),
):

    @defect("mid-nodes-differ", count, on=kind, name=f"a {cell} with a mid-node of its own")
    def own(mesh, cell=cell, group=group, row=row, mid=mid):
        rows, nodes = of_type(mesh, cell, group)
        points = np.vstack([mesh.points, mesh.points[nodes[row, mid]]])
        nodes[row, mid] = mesh.n_nodes
        return changed(mesh, cell, rows[row], nodes[row], points=points)


@defect("mid-nodes-differ", 4, on="HEXA20")
def linear_beside_quadratic(mesh):
    _, nodes = of_type(mesh, "HEXA20", "body1")
    return changed(mesh, drop=[mesh.cell_groups["body1"][-1]], add=[("HEXA8", nodes[-1][:8], ["body1"])])


@defect("torn-body", 6)
def a_node_inside_an_edge_away_from_the_skins():
    high = box(2, (1, 1, 0.99), corner=(0, 0, 1.01)).renamed(bottom="master")
    mesh = lacmesh.join(box(2).renamed(top="slave"), high, box((4, 2, 2), corner=(0, 0, 2)))
    return cut_skin(merged(mesh.only("body", "slave", "master")), "slave").mesh


@defect("coincident-nodes", 16, on="HEXA8")
def a_body_torn_along_a_plane(mesh):
    rows, nodes = of_type(mesh, "HEXA8", "body1")
    upper = mesh.points[nodes].mean(axis=1)[:, 2] > 1.4
    torn = np.unique(nodes[upper])
    torn = torn[(np.abs(mesh.points[torn, 2] - (1.01 + 1 / 3)) < 1e-9) & (mesh.points[torn, 0] < 0.5)]
    new = np.arange(mesh.n_nodes)
    new[torn] = mesh.n_nodes + np.arange(len(torn))
    return changed(mesh, "HEXA8", rows[upper], new[nodes[upper]], points=np.vstack([mesh.points, mesh.points[torn]]))
